// What frames, rows and pixels miss the model by together, in the errors and in words.

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "bar.h"
#include "birefit/fit.h"
#include "fit/problem/frame.h"
#include "pictures.h"

namespace birefit {
namespace {

using namespace testing;

/// Five frames at known voltages whose means err by `scatter` of the model intensity: what a joint calibration meets.
Bar calibration(unsigned seed, double scatter, int side = 8) {
  Bar bar(0, 0);
  bar.free(bar.half_wave, 1400, 1000, 2200);
  bar.free_linear();
  bar.job.parameters[bar.gain].value = 0.8;
  Gaussian gaussian(seed);
  bar.job.options.threads = 1;
  for (const double voltage : {200.0, 400.0, 600.0, 800.0, 1000.0}) {
    const ParameterRef ref = bar.job.parameters.add_constant("bias", voltage);
    Picture& micrograph = bar.add_image(side, side, ref, true);
    micrograph.noise = NoiseModel{0.002, 0, false};
    const double frame = scatter * gaussian();
    expose(micrograph, 0.77, 0.008, voltage, 0, [&](int, int, double) { return 0.77 * frame + 0.002 * gaussian(); });
  }
  return bar;
}
FitResult calibrate(unsigned seed, double scatter, int side = 8) { return fit(calibration(seed, scatter, side).job); }

TEST(Fit, IntervalsOfFramesThatScatterCoverTheTruth) {
  constexpr int kRuns = 400;
  constexpr double kScatter = 0.003;  // the pixel noise leaves 0.0003 to a frame's mean
  int covered = 0;
  double variance = 0;
  for (int run = 0; run < kRuns; ++run) {
    const FitResult result = calibrate(run, kScatter);
    const ParameterEstimate& half_wave = estimate(result, "sample.crystal.half_wave_voltage_v");
    ASSERT_TRUE(result.converged) << run;
    covered += half_wave.interval95_low <= kHalfWave && kHalfWave <= half_wave.interval95_high;
    if (result.frame_scatter) variance += result.frame_scatter->intensity_sd * result.frame_scatter->intensity_sd;
  }
  // 95 % with a sampling error of 1.1 %; the model is a little curved within its errors.
  EXPECT_GE(covered, 0.90 * kRuns);
  EXPECT_LE(covered, 0.99 * kRuns);
  // Two degrees of freedom: the mean of 400 variances is known to 5 %.
  EXPECT_NEAR(variance / kRuns, kScatter * kScatter, 0.2 * kScatter * kScatter);
}

// What five frames cannot exclude of a lamp's jitter, next to what their noise alone would leave.
TEST(Fit, FramesThatAgreeWidenTheirIntervalsByLessThanAThird) {
  int wider = 0;
  constexpr int kRuns = 200;
  for (unsigned seed = 0; seed < kRuns; ++seed) {
    const Bar bar = calibration(seed, 0);
    const FitResult result = fit(bar.job);
    const ParameterEstimate& half_wave = estimate(result, "sample.crystal.half_wave_voltage_v");
    FitJob at_estimate = bar.job;
    at_estimate.parameters[at_estimate.parameters.find(half_wave.name)].value = half_wave.value;
    const double of_noise = outlook(at_estimate).parameters.front().stderr_;
    wider += half_wave.interval95_high - half_wave.interval95_low > 1.3 * 2 * 1.96 * of_noise;
    if (!result.frame_scatter) {
      EXPECT_EQ(result.covariance_kind.rfind("white noise", 0), 0u) << result.covariance_kind;
    }
  }
  // Frames that agree to their noise look as if they scattered in one of a hundred: five in 200 more would be one in
  // 1,000.
  EXPECT_LE(wider, 7);
}

// Three even pictures are three numbers: a voltage, a gain and an offset meet them whatever they are, and the fit says
// so; a fourth one would show it.
TEST(Fit, AsManyUnknownsAsPicturesLeaveNothingToCheck) {
  for (const int pictures : {3, 4}) {
    Bar bar(700, 0);
    bar.free(bar.half_wave, 1450, 1000, 2000);
    bar.free_linear();
    Gaussian gaussian(5);
    for (int g = 0; g < pictures; ++g) {
      const double volts = 400 + 250 * g;
      Picture& picture = bar.add_image(8, 8, bar.job.parameters.add_constant("bias", volts), true);
      picture.noise = NoiseModel{30, 0, false};
      expose(picture, 3000, 150, volts, 0, [&](int, int, double) { return 20 * gaussian(); });
    }
    const std::vector<std::string> exact = fit(bar.job).taken_as_exact;
    const bool said = std::any_of(exact.begin(), exact.end(), [](const std::string& words) {
      return words.find("nothing is left to check") != std::string::npos;
    });
    EXPECT_EQ(said, pictures == 3) << pictures;
  }
}

TEST(Fit, FrameIntervalsCountFrames) {
  const FitResult result = calibrate(5, 0.02);
  // Five frames, three parameters; the frames' means hold all there is.
  EXPECT_NEAR(result.interval_degrees_of_freedom, 2, 0.02);
  const ParameterEstimate& half_wave = estimate(result, "sample.crystal.half_wave_voltage_v");
  EXPECT_NEAR((half_wave.interval95_high - half_wave.value) / half_wave.stderr_, 4.303, 0.05);
}

TEST(Fit, ASingleFrameThroughACalibrationCarriesTheFramesOwnMisfit) {
  // Gain, offset and half-wave voltage known from elsewhere: the bias' error is the frame scatter over the slope.
  Bar bar(700, 0);
  bar.free(bar.bias, 600, 100, 1400);
  bar.free_linear();
  Picture& micrograph = bar.add_image(100, 100, bar.bias, true);
  micrograph.noise = NoiseModel{0.002, 0, false};
  Gaussian gaussian(4);
  expose(micrograph, 0.77, 0.008, 700, 0, [&](int, int, double) { return 0.002 * gaussian(); });
  JointPrior prior;
  prior.names = {"micrograph.gain", "micrograph.offset"};
  prior.mean = Eigen::Vector2d(0.77, 0.008);
  prior.covariance = Eigen::Vector2d(1e-12, 1e-12).asDiagonal();
  prior.degrees_of_freedom = 2;
  prior.frame_scatter = JointPrior::FrameScatter{0.002, 2};
  bar.job.prior = prior;
  const FitResult result = fit(bar.job);
  const ParameterEstimate& bias = estimate(result, "sample.crystal.bias_v");
  const double slope = std::numbers::pi / 2 / kHalfWave * std::sin(std::numbers::pi * 700 / kHalfWave);
  // Pixel noise adds 2e-5 / 2e-3 squared: nothing.
  EXPECT_NEAR(bias.stderr_, 0.002 / slope, 0.01 * 0.002 / slope);
  EXPECT_NEAR(bias.value, 700, 0.2 * bias.stderr_);
  EXPECT_EQ(result.interval_degrees_of_freedom, 2);
  EXPECT_TRUE(result.has_answer()) << result.verdict;
}

// Light that grows by 2 % towards one electrode looks like a field that does.
TEST(Fit, LightThatMayBeUnevenIsInTheErrorOfAField) {
  constexpr int kSide = 24;
  constexpr double kGain = 3000, kVolts = 700, kTilt = 0.2, kUneven = 0.02;
  const auto run = [&](bool known_to_be_even) {
    Bar bar(kVolts);
    bar.free(bar.tilt, 0.25, 0.05, 0.6);
    bar.job.parameters[bar.gain].free = bar.job.parameters[bar.gain].linear = true;
    bar.job.parameters[bar.offset].value = 100;
    Picture& picture = bar.add_image(kSide, kSide, bar.bias);
    picture.noise = NoiseModel{30, 0, false};
    Gaussian gaussian(6);
    expose(picture, kGain, 100, kVolts, kTilt, [&](int, int y, double) {
      const double across = 2 * (y + 0.5) / kSide - 1;
      return kGain * intensity(kVolts, kTilt, y, kSide) * kUneven * across + 30 * gaussian();
    });
    if (known_to_be_even) bar.under_even_light();
    return fit(bar.job);
  };
  const FitResult even = run(true), usual = run(false);
  const auto half_widths_off = [&](const FitResult& result) {
    const ParameterEstimate& tilt = estimate(result, "sample.crystal.field_legendre.c1");
    return std::abs(tilt.value - kTilt) / (0.5 * (tilt.interval95_high - tilt.interval95_low));
  };
  EXPECT_GT(half_widths_off(even), 2);
  EXPECT_LT(half_widths_off(usual), 1);
  // Other fits of the set-up see the same light: it is what they have in common, and the rest is each one's own.
  const int j = index_of(usual, "sample.crystal.field_legendre.c1");
  EXPECT_GT(usual.stated_covariance(j, j), 0.5 * usual.covariance(j, j));
  EXPECT_LT(usual.covariance(j, j) - usual.stated_covariance(j, j), 1.5 * even.covariance(j, j));
}

TEST(Fit, MisfitSharedByPixelsWidensTheErrors) {
  const auto run = [](double misfit) {
    Bar bar;
    bar.free(bar.bias, 650, 400, 1000);
    bar.free_linear();
    Picture& micrograph = bar.add_image(64, 64, bar.bias);
    micrograph.noise = NoiseModel{10, 0, false};
    Gaussian gaussian(8);
    expose(micrograph, 3000, 100, 700, 0.4,
           [&](int x, int y, double) { return 10 * gaussian() + misfit * std::sin(0.4 * x) * std::sin(0.4 * y); });
    bar.under_even_light();
    return fit(bar.job);
  };
  const FitResult clean = run(0), wrong = run(100);
  EXPECT_EQ(clean.covariance_kind.rfind("white noise", 0), 0u) << clean.covariance_kind;
  EXPECT_TRUE(clean.warnings.empty());
  // Reduced chi-square about 26; patches of 8 x 8 pixels share a sign.
  const double ratio =
      estimate(wrong, "sample.crystal.bias_v").stderr_ / estimate(clean, "sample.crystal.bias_v").stderr_;
  EXPECT_GT(ratio, 2 * std::sqrt(26.0));
  EXPECT_FALSE(wrong.warnings.empty());
  EXPECT_NE(wrong.covariance_kind.find("scaled by reduced chi-square"), std::string::npos);
}

/// 80 rows of a table whose misfit, far above the noise, is correlated from row to row by `rho`.
FitResult sweep(unsigned seed, double rho) {
  Bar bar(0, 0);
  bar.free(bar.half_wave, 1420, 1300, 1700);
  bar.free_linear();
  bar.job.options.threads = 1;
  Gaussian gaussian(seed);
  double misfit = gaussian();
  for (int row = 0; row < 80; ++row) {
    const double voltage = 50 + 25 * row;
    Picture& micrograph = bar.add_image(1, 1, bar.job.parameters.add_constant("bias", voltage), true);
    misfit = rho * misfit + std::sqrt(1 - rho * rho) * gaussian();
    expose(micrograph, 0.8, 0.01, voltage, 0, [&](int, int, double) { return 0.01 * misfit + 0.0005 * gaussian(); });
  }
  const Picture& first = picture(bar.job, 0);
  Readings table;
  table.name = "sweep.csv";
  table.gain = first.gain, table.offset = first.offset;
  table.noise = NoiseModel{0.0005, 0, false};
  table.values.resize(80);
  for (int row = 0; row < 80; ++row) {
    const Picture& of = picture(bar.job, static_cast<std::size_t>(row));
    table.rows.push_back(of.scene);
    table.lines.push_back(row + 2);
    table.values[row] = of.values(0, 0);
  }
  bar.job.measurements = {table};
  return fit(bar.job);
}

TEST(Fit, MisfitSharedByRowsWidensTheErrors) {
  constexpr int kRuns = 60;
  for (const double rho : {0.0, 0.8}) {
    double squares = 0, variances = 0;
    for (unsigned run = 0; run < kRuns; ++run) {
      const FitResult result = sweep(run, rho);
      const ParameterEstimate& half_wave = estimate(result, "sample.crystal.half_wave_voltage_v");
      squares += std::pow(half_wave.value - kHalfWave, 2);
      variances += std::pow(half_wave.stderr_, 2);
    }
    // A spread of 60 draws is known to 9 %, and with 80 rows of a correlation of 0.8 the number of rows that share a
    // misfit is hardly known better than to a factor of 1.5. Errors that took rows for independent ones would be too
    // small by a factor of 2 to 3.
    const double ratio = std::sqrt(variances / squares);
    EXPECT_GT(ratio, 0.7) << rho;
    EXPECT_LT(ratio, rho > 0 ? 1.8 : 1.35) << rho;
  }
}

/// A line that a fit of a bar warns of which has noise of kSd and states so much.
std::string said_of_noise(double stated, bool smoothed, unsigned seed) {
  constexpr int kWidth = 40, kHeight = 30;
  constexpr double kSd = 20;
  Bar bar(700, 0.4);
  bar.free_linear();
  Picture& micrograph = bar.add_image(kWidth, kHeight, bar.bias);
  micrograph.noise = NoiseModel{stated, 0, false};
  Gaussian gaussian(seed);
  Image noise(kWidth + 1, kHeight + 1);
  for (double& x : noise.values()) x = kSd * gaussian();
  expose(micrograph, 3000, 150, 700, 0.4, [&](int x, int y, double) {
    if (!smoothed) return noise(x, y);
    return 0.25 * (noise(x, y) + noise(x + 1, y) + noise(x, y + 1) + noise(x + 1, y + 1));
  });
  for (const std::string& warning : fit(bar.job).warnings)
    if (warning.find("far less than the noise") != std::string::npos) return warning;
  return {};
}

// A chi-square far below its degrees of freedom is no good news: the noise is stated too large, or pixels share it.
TEST(Fit, LessThanTheStatedNoiseIsNamed) {
  EXPECT_NE(said_of_noise(80, false, 41).find("about 0.25 times"), std::string::npos);
  EXPECT_NE(said_of_noise(20, true, 42).find("neighbouring pixels share"), std::string::npos);
  for (unsigned seed = 50; seed < 60; ++seed) EXPECT_EQ(said_of_noise(20, false, seed), "");
}

// Stripes that the model cannot draw, orthogonal to all it can: their part of the picture's sum of squares is what it
// leaves over, noise aside.
TEST(Fit, WhatTheModelLeavesOverIsItsShareOfThePicture) {
  for (const double stripes : {0.0, 250.0, 800.0}) {
    Bar bar;
    bar.free(bar.bias, 650, 100, 1400);
    bar.free_linear();
    Picture& micrograph = bar.add_image(40, 40, bar.bias);
    constexpr double kNoise = 10;
    micrograph.noise = NoiseModel{kNoise, 0, false};
    Gaussian gaussian(7);
    expose(micrograph, 3000, 100, 700, 0.4,
           [&](int x, int, double) { return (x % 2 ? stripes : -stripes) + kNoise * gaussian(); });
    const FitResult result = fit(bar.job);
    double mean = 0, variance = 0;
    for (const double v : result.micrographs[0].fitted.values()) mean += v / 1600;
    for (const double v : result.micrographs[0].fitted.values()) variance += (v - mean) * (v - mean) / 1600;
    const double share = stripes * stripes / (variance + stripes * stripes);
    // Noise is as large as stripes on the average of 1600 pixels to this.
    EXPECT_NEAR(result.left_over, share,
                5 * 2 * kNoise * std::max(stripes, kNoise) / 40 / (variance + stripes * stripes));
    EXPECT_EQ(result.described, share < 0.5);
    EXPECT_EQ(result.has_answer(), share < 0.5) << result.verdict;
    EXPECT_EQ(result.verdict.find("not that of the image") != std::string::npos, share > 0.5) << result.verdict;
  }
}

}  // namespace
}  // namespace birefit
