// Intervals: by profile, with inputs that are stated, counted on simulated pictures, foretold for pictures to come.

#include <cmath>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

#include "bar.h"
#include "birefit/fit.h"
#include "pictures.h"

namespace birefit {
namespace {

using namespace testing;

/// A uniform bar: every pixel sin^2(pi/2 V/V_half), known gain and offset. One unknown, and a likelihood in closed
/// form.
struct OneVoltage {
  static constexpr int kSide = 16;
  static constexpr double kSd = 0.8;
  Bar bar{1125, 0};
  FitJob& job = bar.job;
  /// Every pixel the same but for +-kSd, so that the mean is exactly `mean`.
  explicit OneVoltage(double mean, double start = 1100) {
    bar.free(bar.bias, start, 450, 1480);
    Picture& m = bar.add_image(kSide, kSide, bar.bias, true);
    m.noise = NoiseModel{kSd, 0, false};
    for (int y = 0; y < kSide; ++y)
      for (int x = 0; x < kSide; ++x) m.values(x, y) = mean + ((x + y) % 2 ? kSd : -kSd);
  }
  static double volts(double intensity) { return kHalfWave * 2 / std::numbers::pi * std::asin(std::sqrt(intensity)); }
};

TEST(Fit, IntervalOfABentLikelihoodIsWhereItFallsNotPlusMinus) {
  // Three quarters to the maximum: intensity flattens upwards.
  const double mean = 0.854;
  OneVoltage one(mean);
  const FitResult result = fit(one.job);
  const ParameterEstimate& bias = estimate(result, "sample.crystal.bias_v");
  ASSERT_TRUE(result.has_answer()) << result.verdict;
  EXPECT_NEAR(bias.value, OneVoltage::volts(mean), 1e-3);
  // chi-square = pixels (mean - I)^2/sd^2 + const rises by t^2 where |I - mean| = t sd/sqrt(pixels); t for 255 degrees
  // of freedom is 1.969.
  const double reach = 1.9693 * OneVoltage::kSd / OneVoltage::kSide;
  const double low = OneVoltage::volts(mean - reach), high = OneVoltage::volts(mean + reach), width = high - low;
  EXPECT_TRUE(bias.profiled);
  // The crossing is sought to 1 % of the root of the rise.
  EXPECT_NEAR(bias.interval95_low, low, 0.01 * width);
  EXPECT_NEAR(bias.interval95_high, high, 0.01 * width);
  // It matters here: a tenth and a quarter of the halves.
  EXPECT_GT(high - bias.value, 1.2 * (bias.value - low));
  // Halfway to the maximum with a hundredth of the noise the likelihood is a parabola.
  OneVoltage straight(0.5);
  picture(straight.job, 0).noise->read_counts *= 0.01;
  for (double& v : picture(straight.job, 0).values.values()) v = 0.5 + 0.01 * (v - 0.5);
  EXPECT_FALSE(estimate(fit(straight.job), "sample.crystal.bias_v").profiled);
}

// Where a picture knows a ratio alone, what is stated of the one makes the other's interval: the tails of its prior are
// heavy, which is no plateau of the likelihood.
TEST(Fit, TailsOfWhatIsStatedAreNoPlateau) {
  constexpr double kVolts = 1000, kKnownTo = 0.01;
  OneVoltage one(0.75);  // two thirds of the half-wave voltage
  one.bar.free(one.bar.half_wave, kHalfWave, 1100, 1900);
  Parameter& volts = one.job.parameters[one.bar.bias];
  volts.nuisance = true;
  volts.value = kVolts, volts.prior_sd = kKnownTo * kVolts;
  volts.lower = kVolts * (1 - 12 * kKnownTo), volts.upper = kVolts * (1 + 12 * kKnownTo);
  picture(one.job, 0).noise->read_counts *= 0.01;
  for (double& v : picture(one.job, 0).values.values()) v = 0.75 + 0.01 * (v - 0.75);
  const FitResult result = fit(one.job);
  const ParameterEstimate& half_wave = estimate(result, "sample.crystal.half_wave_voltage_v");
  EXPECT_NEAR(half_wave.value, kHalfWave, 0.1);
  // 2.2 deviations of a prior with four degrees of freedom cost as much as 1.96 of a normal one.
  for (const double end : {half_wave.interval95_low, half_wave.interval95_high}) {
    EXPECT_GT(std::abs(end / kHalfWave - 1), 1.9 * kKnownTo);
    EXPECT_LT(std::abs(end / kHalfWave - 1), 2.5 * kKnownTo);
  }
}

TEST(Fit, ProfileFollowsAValleyThatBends) {
  // The other parameters must follow: with one image of a tilted field, V and tilt are both seen; with `tilt` held the
  // interval of V would be its conditional one. Where nothing bends the profile's crossing is the marginal standard
  // error, whatever the correlation.
  Bar bar(1400, 0.4);
  bar.free(bar.bias, 1400, 900, 1900);
  bar.free(bar.tilt, 0.4, 0.1, 0.8);
  bar.job.parameters[bar.gain].value = 3000;
  bar.job.parameters[bar.offset].value = 150;
  Picture& m = bar.add_image(40, 30, bar.bias);
  constexpr double kSd = 1500;  // of 3000: errors of some percent, bent a little
  m.noise = NoiseModel{kSd, 0, false};
  Gaussian gaussian(5);
  expose(m, 3000, 150, 1400, 0.4, [&](int, int, double) { return kSd * gaussian(); });
  bar.under_even_light();
  const FitResult result = fit(bar.job);
  ASSERT_TRUE(result.has_answer()) << result.verdict;
  int profiled = 0;
  for (const char* name : {"sample.crystal.bias_v", "sample.crystal.field_legendre.c1"}) {
    const ParameterEstimate& p = estimate(result, name);
    profiled += p.profiled;
    // Brute force: the parameter fixed at either end of its interval, everything else fitted again.
    for (const double end : {p.interval95_low, p.interval95_high}) {
      FitJob held = bar.job;
      Parameter& fixed = held.parameters[held.parameters.find(name)];
      fixed.free = false;
      fixed.value = end;
      const double t = 1.9619;  // 1,198 degrees of freedom
      // Within a tenth the normal interval is kept; a profiled one is exact to 2 % in the rise.
      EXPECT_NEAR(fit(held).chi_square - result.chi_square, t * t, (p.profiled ? 0.03 : 0.12) * t * t)
          << name << " at " << end;
    }
  }
  EXPECT_GT(profiled, 0);
}

TEST(Inputs, ShiftTheEstimateAsAFitWithAnotherInputDoes) {
  // The picture depends on bias / half-wave voltage alone: one percent of the one is one percent of the other.
  Bar bar(700, 0.4);
  bar.free(bar.bias, 650, 400, 1000);
  bar.free_linear();
  Picture& m = bar.add_image(40, 30, bar.bias);
  bar.under_even_light();
  m.noise = NoiseModel{1, 0, false};
  Gaussian gaussian(29);
  expose(m, 3000, 150, 700, 0.4, [&](int, int, double) { return gaussian(); });
  const FitResult result = fit(bar.job);
  const auto effect = [&](const std::string& name) {
    for (const InputEffect& input : result.inputs)
      if (input.name == name) return input;
    ADD_FAILURE() << name;
    return InputEffect{};
  };
  const InputEffect half_wave = effect("sample.crystal.half_wave_voltage_v");
  ASSERT_EQ(half_wave.shift.size(), result.parameters.size());
  EXPECT_NEAR(half_wave.shift[0], 0.01 * result.parameters[0].value, 1e-6 * result.parameters[0].value);
  // The field's tilt, by fitting again with another one: the same but for what noise makes of the difference of two
  // curvatures.
  const InputEffect tilt = effect("sample.crystal.field_legendre.c1");
  EXPECT_NEAR(tilt.step, 0.01 * 0.4, 1e-12);
  FitJob other = bar.job;
  other.parameters[bar.tilt].value = 0.4 * 1.01;
  const FitResult there = fit(other);
  for (std::size_t j = 0; j < result.parameters.size(); ++j)
    EXPECT_NEAR(there.parameters[j].value - result.parameters[j].value, tilt.shift[j],
                0.01 * std::abs(tilt.shift[j]) + 0.01 * result.parameters[j].stderr_)
        << result.parameters[j].name;
  EXPECT_NE(result.verdict.find("1 % more of sample.crystal.half_wave_voltage_v makes bias_v +1 %"), std::string::npos)
      << result.verdict;
}

TEST(Coverage, OfAPlainFitIsNominalAndTheSameTwice) {
  Bar bar(700, 0.4);
  bar.free(bar.bias, 600, 300, 1400);
  bar.free_linear();
  Picture& m = bar.add_image(24, 20, bar.bias);
  bar.under_even_light();
  m.noise = NoiseModel{20, 0.5, false};
  Gaussian gaussian(11);
  expose(m, 3000, 150, 700, 0.4, [&](int, int, double signal) { return std::sqrt(400 + 0.5 * signal) * gaussian(); });
  const FitResult result = fit(bar.job);
  constexpr int kDraws = 200;
  const Coverage one = measure_coverage(bar.job, result, kDraws);
  EXPECT_EQ(one.draws, kDraws);
  EXPECT_EQ(one.answered, kDraws);
  EXPECT_EQ(one.wrong, 0);
  EXPECT_FALSE(one.of_residuals);
  ASSERT_EQ(one.parameters.size(), 3u);
  for (const Coverage::Of& p : one.parameters) {
    // Four standard deviations of a binomial of 200.
    EXPECT_NEAR(p.inside68, 0.6827, 4 * 0.0329) << p.name;
    EXPECT_NEAR(p.inside95, 0.95, 4 * 0.0154) << p.name;
    EXPECT_NEAR(p.spread, 1, 4 * 0.05) << p.name;
    EXPECT_NEAR(p.bias, 0, 4 * 0.071) << p.name;
  }
  FitJob other_threads = bar.job;
  other_threads.options.threads = 1;
  const Coverage again = measure_coverage(other_threads, result, kDraws);
  for (std::size_t j = 0; j < 3; ++j) {
    EXPECT_EQ(one.parameters[j].spread, again.parameters[j].spread);
    EXPECT_EQ(one.parameters[j].inside95, again.parameters[j].inside95);
  }
}

TEST(Coverage, SeesAnIntervalThatIsTooNarrow) {
  // A noise model that says half the truth, and says it so that the fit believes it: the audit simulates what the fit's
  // result says. Told the true noise of the result but refitted with weights of a fifth, intervals hold a third of the
  // time.
  Bar bar(700, 0.4);
  bar.free(bar.bias, 600, 300, 1400);
  bar.free_linear();
  Picture& m = bar.add_image(24, 20, bar.bias);
  bar.under_even_light();
  m.noise = NoiseModel{20, 0, false};
  Gaussian gaussian(12);
  expose(m, 3000, 150, 700, 0.4, [&](int, int, double) { return 20 * gaussian(); });
  FitResult result = fit(bar.job);
  // 3 % more noise than the refits believe is below what the misfit test of 480 pixels can see; 15 % would be seen and
  // paid for.
  result.micrographs[0].noise.read_counts = 20 * 1.03;
  const Coverage audit = measure_coverage(bar.job, result, 200);
  for (const Coverage::Of& p : audit.parameters) EXPECT_NEAR(p.spread, 1.03, 4 * 0.05) << p.name;
  // Another truth than the one simulated: nothing holds, and it is counted as confidently wrong.
  result.parameters[index_of(result, "sample.crystal.bias_v")].value +=
      50 * estimate(result, "sample.crystal.bias_v").stderr_;
  const Coverage wrong = measure_coverage(bar.job, result, 20);
  EXPECT_EQ(wrong.wrong, 20);
  EXPECT_EQ(wrong.parameters[0].inside95, 0);
}

TEST(Coverage, TakesResidualsForNoiseWhereTheModelDoesNotFit) {
  Bar bar(700, 0.4);
  bar.free(bar.bias, 600, 300, 1400);
  bar.free_linear();
  Picture& m = bar.add_image(40, 30, bar.bias);
  m.noise = NoiseModel{20, 0, false};
  Gaussian gaussian(13);
  // Stray fringes three times the noise.
  expose(m, 3000, 150, 700, 0.4,
         [&](int x, int y, double) { return 20 * gaussian() + 85 * std::sin(0.9 * x + 0.4 * y); });
  const FitResult result = fit(bar.job);
  ASSERT_GT(result.reduced_chi_square, 3);
  const Coverage audit = measure_coverage(bar.job, result, 60);
  EXPECT_TRUE(audit.of_residuals);
  // The intervals were widened for it: they hold at least as often as they say, within three deviations of a binomial
  // of 60.
  for (const Coverage::Of& p : audit.parameters) EXPECT_GT(p.inside95, 0.95 - 3 * 0.028) << p.name;
}

TEST(Coverage, HoldsForAParameterKnownByItsPriorAlone) {
  // The half-wave voltage is known to 3 % from elsewhere, and one image of the ratio V/V_half adds nothing: estimate
  // and error are the prior's. Held at its centre for every draw it would not scatter at all.
  Bar bar(700, 0.4);
  bar.free(bar.bias, 650, 300, 1400);
  bar.free(bar.half_wave, kHalfWave, 1000, 2000);
  bar.job.parameters[bar.half_wave].prior_sd = 45;
  bar.free_linear();
  Picture& m = bar.add_image(24, 20, bar.bias);
  m.noise = NoiseModel{20, 0, false};
  Gaussian gaussian(17);
  expose(m, 3000, 150, 700, 0.4, [&](int, int, double) { return 20 * gaussian(); });
  const FitResult result = fit(bar.job);
  const Coverage audit = measure_coverage(bar.job, result, 200);
  ASSERT_GT(audit.answered, 190);
  for (const Coverage::Of& p : audit.parameters)
    if (p.name == "sample.crystal.half_wave_voltage_v") {
      EXPECT_NEAR(p.spread, 1, 4 * 0.05);
      EXPECT_NEAR(p.inside95, 0.95, 4 * 0.0154);
    }
}

TEST(Coverage, OfAMaskedImageHasItsNoise) {
  // Residuals serve as noise; three quarters of the image are masked. Were noise lost to the mask, the refits would
  // scatter less than they say.
  Bar bar(700, 0.4);
  bar.free(bar.bias, 600, 300, 1400);
  bar.free_linear();
  Picture& m = bar.add_image(40, 40, bar.bias);
  bar.under_even_light();
  m.noise = NoiseModel{10, 0, false};  // half the truth
  Gaussian gaussian(19);
  expose(m, 3000, 150, 700, 0.4, [&](int, int, double) { return 20 * gaussian(); });
  for (int y = 0; y < 40; ++y)
    for (int x = 0; x < 40; ++x)
      if (x >= 20 || y < 10 || y >= 30) m.mask(x, y) = 0;
  const FitResult result = fit(bar.job);
  const Coverage audit = measure_coverage(bar.job, result, 200);
  EXPECT_TRUE(audit.of_residuals);
  // one residual image stands for all
  for (const Coverage::Of& p : audit.parameters) EXPECT_NEAR(p.spread, 1, 4 * 0.05 + 0.05) << p.name;
}

TEST(Outlook, IsTheStandardErrorThatTheFitThenHas) {
  Bar bar(2400, 0.9);  // one and a half fringes
  bar.free(bar.bias, 2400, 2000, 2800);
  bar.free(bar.tilt, 0.9, 0.7, 1.1);
  bar.free_linear();
  bar.job.parameters[bar.gain].value = 3000;
  bar.job.parameters[bar.offset].value = 150;
  Picture& m = bar.add_image(40, 30, bar.bias);
  bar.under_even_light();
  m.noise = NoiseModel{20, 0.5, false};
  Gaussian gaussian(21);
  expose(m, 3000, 150, 2400, 0.9, [&](int, int, double signal) { return std::sqrt(400 + 0.5 * signal) * gaussian(); });
  const FitResult result = fit(bar.job);
  FitJob planned = bar.job;
  picture(planned, 0).values = {};
  picture(planned, 0).mask = {};
  for (const FitJob& job : {bar.job, planned}) {
    const Outlook expected = outlook(job);
    EXPECT_TRUE(expected.identifiable);
    ASSERT_EQ(expected.parameters.size(), result.parameters.size());
    for (std::size_t j = 0; j < result.parameters.size(); ++j) {
      EXPECT_EQ(expected.parameters[j].name, result.parameters[j].name);
      // With the image, its level is read off its darkest and brightest pixels, noise and all.
      EXPECT_NEAR(expected.parameters[j].stderr_ / result.parameters[j].stderr_, 1,
                  picture(job, 0).values.empty() ? 0.02 : 0.1)
          << result.parameters[j].name;
    }
  }
}

// Light and background that nobody says are even: what is usual of each moves a field by as much as fits of such
// pictures show.
TEST(Outlook, KnowsThatLightMayBeUneven) {
  constexpr int kWidth = 40, kHeight = 30;
  constexpr double kGain = 3000, kOffset = 150, kVolts = 700, kTilt = 0.4, kLight = 0.02, kBackground = 0.01;
  const auto bar_with = [&](double share, const std::function<double(double, double)>& shape, bool of_light) {
    Bar bar(kVolts, kTilt);
    bar.free(bar.tilt, kTilt, 0.05, 0.8);
    bar.free_linear();
    bar.job.parameters[bar.gain].value = kGain;
    bar.job.parameters[bar.offset].value = kOffset;
    Picture& picture = bar.add_image(kWidth, kHeight, bar.bias);
    picture.noise = NoiseModel{30, 0, false};
    expose(picture, kGain, kOffset, kVolts, kTilt, [&](int x, int y, double) {
      const double half = 0.5 * kWidth;
      const double light = of_light ? kLight * intensity(kVolts, kTilt, y, kHeight) : kBackground;
      return share * kGain * light * shape((x - 0.5 * (kWidth - 1)) / half, (y - 0.5 * (kHeight - 1)) / half);
    });
    return bar;
  };
  const auto estimated = [&](double share, const std::function<double(double, double)>& shape, bool of_light) {
    Bar bar = bar_with(share, shape, of_light);
    bar.under_even_light();
    return estimate(fit(bar.job), "sample.crystal.field_legendre.c1").value;
  };
  const auto none = [](double, double) { return 0.0; };
  const std::function<double(double, double)> shapes[] = {[](double x, double) { return x; },
                                                          [](double, double y) { return y; },
                                                          [](double x, double y) { return x * x + y * y; }};
  const Bar bar = bar_with(0, none, true);
  Bar even = bar;
  even.under_even_light();
  double variance = std::pow(outlook(even.job).parameters[0].stderr_, 2);
  constexpr double kShare = 0.1;  // so that it is a derivative
  for (const auto& shape : shapes)
    for (const bool of_light : {true, false})
      variance += std::pow((estimated(kShare, shape, of_light) - estimated(0, none, of_light)) / kShare, 2);
  const double foretold = outlook(bar.job).parameters[0].stderr_;
  EXPECT_GT(foretold, 2 * outlook(even.job).parameters[0].stderr_);
  EXPECT_NEAR(foretold / std::sqrt(variance), 1, 0.03);
}

TEST(Outlook, SaysWhatThePlannedImageWillNotTell) {
  // A uniform image is one number: neither gain nor voltage.
  OneVoltage one(0.5);
  one.bar.free_linear();
  const Outlook expected = outlook(one.job);
  EXPECT_FALSE(expected.identifiable);
  EXPECT_TRUE(std::any_of(expected.directions.begin(), expected.directions.end(),
                          [](const FisherDirection& d) { return !d.identifiable && !d.words.empty(); }));
}

TEST(NextShot, IsWorthWhatTheFitWithItThenShows) {
  // A bar at 45 degrees to the polarizer.
  Bar bar(1450, 0.1);
  bar.free(bar.bias, 1450, 1200, 1499);
  bar.free_linear();
  bar.job.parameters[bar.gain].value = 3000;
  bar.job.parameters[bar.offset].value = 150;
  Picture& m = bar.add_image(30, 20, bar.bias);
  bar.under_even_light();
  m.noise = NoiseModel{20, 0, false};
  m.values = {};
  m.mask = {};
  const double alone = outlook(bar.job).parameters[0].stderr_;
  const std::vector<Shot> shots = next_shots(bar.job, "bias_v");
  ASSERT_GT(shots.size(), 5u);
  EXPECT_TRUE(
      std::is_sorted(shots.begin(), shots.end(), [](const Shot& a, const Shot& b) { return a.stderr_ < b.stderr_; }));
  const auto same = std::find_if(shots.begin(), shots.end(), [](const Shot& s) { return s.words == "the same again"; });
  ASSERT_NE(same, shots.end());
  // Two equal images with a gain and offset each.
  EXPECT_NEAR(same->stderr_ / alone, std::sqrt(0.5), 1e-6);
  const auto worth = [&](const std::string& words) {
    const auto found = std::find_if(shots.begin(), shots.end(), [&](const Shot& s) { return s.words == words; });
    return found == shots.end() ? std::numeric_limits<double>::quiet_NaN() : found->stderr_;
  };
  // Parallel polarizers show 1 - I: as much, where the noise does not depend on the light. A polarizer along the axis
  // shows nothing.
  EXPECT_NEAR(worth("analyser turned by 90 deg") / same->stderr_, 1, 1e-6);
  EXPECT_NEAR(worth("polarizer and analyser turned together by 45 deg") / alone, 1, 1e-6);
  // At 22.5 degrees to the axis half the light is modulated: information 1 + 1/4.
  EXPECT_NEAR(worth("polarizer and analyser turned together by 22.5 deg") / alone, std::sqrt(0.8), 1e-6);

  // The second one, really taken.
  const auto add = [&](const char* name, double value) {
    Parameter p;
    p.name = name;
    p.value = value;
    p.free = p.linear = true;
    return bar.job.parameters.add(p);
  };
  FitJob& job = bar.job;
  Picture first = picture(job, 0), second = first;
  second.gain = add("second.gain", 3000);
  second.offset = add("second.offset", 150);
  second.scene.microscope.analyzer_deg = job.parameters.add_constant("second.analyzer", 180);
  Gaussian gaussian(31);
  for (Picture* image : {&first, &second}) {
    image->values = Image(30, 20);
    image->mask = Mask(30, 20, 1);
    const bool crossed = image == &first;
    for (int y = 0; y < 20; ++y)
      for (int x = 0; x < 30; ++x)
        image->values(x, y) =
            150 + 3000 * (crossed ? intensity(1450, 0.1, y, 20) : 1 - intensity(1450, 0.1, y, 20)) + 20 * gaussian();
  }
  job.measurements = {first, second};
  const FitResult both = fit(job);
  // The slope at the estimate instead of at the truth.
  EXPECT_NEAR(estimate(both, "sample.crystal.bias_v").stderr_ / same->stderr_, 1, 0.15);

  EXPECT_THROW(next_shots(job, "no_such_parameter"), UserError);
}

}  // namespace
}  // namespace birefit
