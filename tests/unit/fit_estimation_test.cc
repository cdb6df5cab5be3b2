// The estimates of a fit and their covariance: linear terms, priors, bounds, and what ends a fit.

#include <atomic>
#include <cmath>

#include <gtest/gtest.h>

#include "bar.h"
#include "birefit/fit.h"
#include "fit/problem/least_squares.h"
#include "pictures.h"

namespace birefit {
namespace {

using namespace testing;

TEST(Fit, GainAndOffsetAreTheLeastSquaresSolutionWithItsCovariance) {
  Bar bar(700, 0.4);
  bar.free_linear();
  Picture& micrograph = bar.add_image(40, 30, bar.bias);
  constexpr double kSd = 20;
  micrograph.noise = NoiseModel{kSd, 0, false};
  Gaussian gaussian(1);
  expose(micrograph, 3000, 150, 700, 0.4, [&](int, int, double) { return kSd * gaussian(); });
  const FitResult result = fit(bar.job);

  // Pixels are means over their area, the model's own: recover it from the fitted image instead of repeating it.
  Eigen::MatrixXd x(1200, 2);
  Eigen::VectorXd y(1200);
  for (int i = 0; i < 1200; ++i) {
    const double fitted = result.micrographs[0].fitted(i % 40, i / 40);
    x(i, 0) = (fitted - result.theta[bar.offset.index]) / result.theta[bar.gain.index];
    x(i, 1) = 1;
    y[i] = micrograph.values(i % 40, i / 40);
  }
  const Eigen::LLT<Eigen::MatrixXd> gram(x.transpose() * x);
  const Eigen::VectorXd expected = gram.solve(x.transpose() * y);
  EXPECT_NEAR(result.theta[bar.gain.index], expected[0], 1e-8 * expected[0]);
  EXPECT_NEAR(result.theta[bar.offset.index], expected[1], 1e-8 * expected[0]);
  const Eigen::MatrixXd covariance = kSd * kSd * gram.solve(Eigen::Matrix2d::Identity());
  EXPECT_LT((result.covariance - covariance).norm(), 1e-8 * covariance.norm());
  EXPECT_TRUE(result.has_answer()) << result.verdict;
}

TEST(Fit, PriorsPullAsTheAnalyticPosterior) {
  for (const bool joint : {false, true}) {
    Bar bar(700, 0.4);
    bar.free_linear();
    Picture& micrograph = bar.add_image(20, 20, bar.bias);
    constexpr double kSd = 100;
    micrograph.noise = NoiseModel{kSd, 0, false};
    Gaussian gaussian(2);
    expose(micrograph, 3000, 150, 700, 0.4, [&](int, int, double) { return kSd * gaussian(); });
    const Eigen::Vector2d mean(2900, 200);
    Eigen::Matrix2d prior;
    prior << 20 * 20, -0.99999 * 20 * 10, -0.99999 * 20 * 10, 10 * 10;
    if (!joint) prior = Eigen::Vector2d(20 * 20, 10 * 10).asDiagonal();
    bar.job.parameters[bar.gain].value = mean[0];
    bar.job.parameters[bar.offset].value = mean[1];
    if (joint) {
      bar.job.prior = JointPrior{};
      bar.job.prior->names = {"micrograph.gain", "micrograph.offset"};
      bar.job.prior->mean = mean;
      bar.job.prior->covariance = prior;
    } else {
      bar.job.parameters[bar.gain].prior_sd = 20;
      bar.job.parameters[bar.offset].prior_sd = 10;
    }
    const FitResult result = fit(bar.job);
    Eigen::MatrixXd x(400, 2);
    Eigen::VectorXd y(400);
    for (int i = 0; i < 400; ++i) {
      const double fitted = result.micrographs[0].fitted(i % 20, i / 20);
      x(i, 0) = (fitted - result.theta[bar.offset.index]) / result.theta[bar.gain.index];
      x(i, 1) = 1;
      y[i] = micrograph.values(i % 20, i / 20);
    }
    const Eigen::Matrix2d precision = prior.inverse();
    const Eigen::Matrix2d posterior = (x.transpose() * x / (kSd * kSd) + precision).inverse();
    const Eigen::Vector2d expected = posterior * (x.transpose() * y / (kSd * kSd) + precision * mean);
    // The nearly singular prior costs five digits of sixteen, in both computations.
    EXPECT_NEAR(result.theta[bar.gain.index], expected[0], 1e-6 * std::sqrt(posterior(0, 0)) + 1e-8 * expected[0])
        << joint;
    EXPECT_NEAR(result.theta[bar.offset.index], expected[1], 1e-4 * std::sqrt(posterior(1, 1))) << joint;
    EXPECT_LT((result.covariance - posterior).norm(), 1e-6 * posterior.norm()) << joint;
  }
}

TEST(Fit, AStartInAnotherFringeOrderIsRecovered) {
  // Six half waves in the middle, 4.2 to 7.8 across the bar: the start is more than one order off. The tilt is known,
  // or every order would do: the fringes' spacing tells only bias times tilt.
  Bar bar(6 * kHalfWave, 0.3);
  bar.free(bar.bias, 3.6 * kHalfWave, 1 * kHalfWave, 9 * kHalfWave);
  bar.free_linear();
  Picture& micrograph = bar.add_image(16, 200, bar.bias);
  micrograph.noise = NoiseModel{20, 0, false};
  Gaussian gaussian(3);
  // A pixel is the mean over its area: 8 Gauss-like midpoints of it are exact to 1e-4 of a count here.
  for (int y = 0; y < 200; ++y)
    for (int x = 0; x < 16; ++x) {
      double mean = 0;
      for (int k = 0; k < 16; ++k) mean += intensity(6 * kHalfWave, 0.3, 16 * y + k, 3200) / 16;
      micrograph.values(x, y) = 1000 * mean + 100 + 20 * gaussian();
    }
  const FitResult result = fit(bar.job);
  const ParameterEstimate& bias = estimate(result, "sample.crystal.bias_v");
  EXPECT_TRUE(result.has_answer()) << result.verdict;
  EXPECT_NEAR(bias.value, 6 * kHalfWave, 5 * bias.stderr_);
  EXPECT_LT(bias.stderr_, 0.01 * kHalfWave);
  EXPECT_FALSE(result.scans.empty());
}

TEST(Fit, StandardErrorsEqualTheSpreadOverSeeds) {
  constexpr int kSeeds = 200;
  double sum = 0, squares = 0, errors = 0, worst = 0;
  int inflated = 0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    Bar bar;
    bar.free(bar.bias, 650, 400, 1000);
    bar.free(bar.tilt, 0.3, 0.1, 0.7);
    bar.free_linear();
    Picture& micrograph = bar.add_image(24, 24, bar.bias);
    micrograph.noise = NoiseModel{10, 0.5, false};
    Gaussian gaussian(1000 + seed);
    // The noise-free image at 24 x 24, pixel means as above.
    for (int y = 0; y < 24; ++y)
      for (int x = 0; x < 24; ++x) {
        double mean = 0;
        for (int k = 0; k < 16; ++k) mean += intensity(700, 0.4, 16 * y + k, 384) / 16;
        const double signal = 3000 * mean + 100;
        micrograph.values(x, y) = signal + std::sqrt(100 + 0.5 * signal) * gaussian();
      }
    bar.under_even_light();
    const FitResult result = fit(bar.job);
    const ParameterEstimate& bias = estimate(result, "sample.crystal.bias_v");
    ASSERT_TRUE(result.has_answer()) << seed << ": " << result.verdict;
    sum += bias.value;
    squares += (bias.value - 700) * (bias.value - 700);
    errors += bias.stderr_;
    worst = std::max(worst, std::abs(bias.value - 700) / bias.stderr_);
    inflated += result.covariance_kind.rfind("white noise", 0) != 0;
  }
  const double spread = std::sqrt(squares / kSeeds), error = errors / kSeeds;
  // A spread of 200 draws is known to 5 %: four of that.
  EXPECT_NEAR(error / spread, 1, 0.2);
  EXPECT_LT(std::abs(sum / kSeeds - 700), 4 * spread / std::sqrt(kSeeds));
  EXPECT_LT(worst, 5);
  EXPECT_LE(inflated, 1);  // expected: none in a million
}

TEST(Fit, AParameterWithoutInfluenceIsNamed) {
  Bar bar;
  bar.free(bar.bias, 650, 400, 1000);
  bar.free(bar.wavelength, 1550, 1000, 2000);  // a crystal's retardance is given in voltages
  bar.free_linear();
  Picture& micrograph = bar.add_image(32, 32, bar.bias);
  micrograph.noise = NoiseModel{10, 0, false};
  Gaussian gaussian(21);
  expose(micrograph, 3000, 100, 700, 0.4, [&](int, int, double) { return 10 * gaussian(); });
  const FitResult result = fit(bar.job);
  EXPECT_FALSE(result.identifiable);
  EXPECT_TRUE(std::isnan(estimate(result, "microscope.light.wavelength_nm").stderr_));
  EXPECT_NE(result.verdict.find("wavelength_nm has no measurable influence"), std::string::npos) << result.verdict;
  const ParameterEstimate& bias = estimate(result, "sample.crystal.bias_v");
  // The pixel mean differs from its middle by less than a standard error here.
  EXPECT_NEAR(bias.value, 700, 5 * bias.stderr_);
}

TEST(Fit, OneUniformFrameCannotGiveBiasGainAndOffset) {
  Bar bar(700, 0);
  bar.free(bar.bias, 650, 100, 1400);
  bar.free_linear();
  Picture& micrograph = bar.add_image(32, 32, bar.bias, true);
  micrograph.noise = NoiseModel{10, 0, false};
  Gaussian gaussian(22);
  expose(micrograph, 3000, 100, 700, 0, [&](int, int, double) { return 10 * gaussian(); });
  const FitResult result = fit(bar.job);
  EXPECT_FALSE(result.identifiable) << result.verdict;
  EXPECT_TRUE(std::isnan(estimate(result, "sample.crystal.bias_v").stderr_));
}

TEST(Fit, NoiseAloneIsNoSignal) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    Bar bar;
    bar.free(bar.bias, 650, 100, 5000);
    bar.free_linear();
    Picture& micrograph = bar.add_image(40, 40, bar.bias);
    Gaussian gaussian(300 + seed);
    for (double& value : micrograph.values.values()) value = std::round(1000 + 15 * gaussian());
    const FitResult result = fit(bar.job);
    EXPECT_FALSE(result.identifiable) << seed << ' ' << result.verdict;
    EXPECT_NE(result.verdict.find("no signal"), std::string::npos) << result.verdict;
  }
}

TEST(Fit, AFlatImageIsNoSignal) {
  Bar bar;
  bar.free(bar.bias, 650, 100, 5000);
  bar.free_linear();
  Picture& micrograph = bar.add_image(40, 40, bar.bias);
  for (double& value : micrograph.values.values()) value = 1000;
  const FitResult result = fit(bar.job);
  EXPECT_FALSE(result.has_answer());
  EXPECT_FALSE(result.identifiable) << result.verdict;
}

TEST(Fit, ABoundThatIsNoPhysicalLimitPins) {
  Bar bar;
  bar.free(bar.bias, 450, 300, 500);
  Picture& micrograph = bar.add_image(32, 32, bar.bias);
  micrograph.noise = NoiseModel{0.01, 0, false};
  expose(micrograph, 1, 0, 700, 0.4, [](int, int, double) { return 0.0; });
  const FitResult result = fit(bar.job);
  EXPECT_TRUE(result.pinned);
  EXPECT_TRUE(estimate(result, "sample.crystal.bias_v").at_bound);
  EXPECT_FALSE(result.has_answer());
}

TEST(Fit, APhysicalLimitGivesAOneSidedLimit) {
  Bar bar;
  bar.free(bar.tilt, 0.1, 0, 0.5);
  bar.job.parameters[bar.tilt].physical_lower = 0;
  Picture& micrograph = bar.add_image(32, 32, bar.bias);
  micrograph.noise = NoiseModel{0.05, 0, false};
  // A little beyond the limit, so that the fit must end on it.
  expose(micrograph, 1, 0, 700, -0.001, [](int, int, double) { return 0.0; });
  const FitResult result = fit(bar.job);
  const ParameterEstimate& tilt = estimate(result, "sample.crystal.field_legendre.c1");
  EXPECT_EQ(tilt.value, 0);
  EXPECT_FALSE(result.pinned);
  EXPECT_EQ(tilt.limit, "upper");
  // At the limit exactly the one-sided 95 % point of half a normal is 1.96; further out it is less.
  EXPECT_GT(tilt.limit_value, 0);
  EXPECT_LE(tilt.limit_value, 1.96 * tilt.stderr_ * (1 + 1e-6));
  EXPECT_TRUE(result.has_answer()) << result.verdict;
}

TEST(Fit, GainBoundsAreHonouredByTheExactSolution) {
  Bar bar(700, 0.4);
  bar.free_linear();
  bar.job.parameters[bar.gain].upper = 2500;
  Picture& micrograph = bar.add_image(20, 20, bar.bias);
  micrograph.noise = NoiseModel{10, 0, false};
  expose(micrograph, 3000, 150, 700, 0.4, [](int, int, double) { return 0.0; });
  const FitResult result = fit(bar.job);
  EXPECT_EQ(result.theta[bar.gain.index], 2500);
  // The offset of the rest: mean(value - 2500 intensity).
  double mean = 0;
  for (int y = 0; y < 20; ++y)
    for (int x = 0; x < 20; ++x)
      mean += (micrograph.values(x, y) - result.micrographs[0].fitted(x, y) + result.theta[bar.offset.index]) / 400;
  EXPECT_NEAR(result.theta[bar.offset.index], mean, 1e-9 * 3000);
  EXPECT_TRUE(result.pinned);
}

TEST(Fit, UnevenLightIsSolvedExactlyBesideGainAndOffset) {
  using Shape = UnevenLight::Shape;
  const std::vector<std::pair<Shape, bool>> shapes{
      {Shape::x, true}, {Shape::y, true}, {Shape::square, true}, {Shape::x, false}, {Shape::y, false}};
  const std::vector<double> truth{3000, 150, 200, -120, -500, 60, -40};  // gain, offset, then the shapes
  // of 60 x 40 pixels
  const auto coordinates = [](int x, int y) { return std::pair((x - 29.5) / 30, (19.5 - y) / 30); };
  const auto shape_at = [&](Shape shape, int column, int row) {
    const auto [x, y] = coordinates(column, row);
    return shape == Shape::x ? x : shape == Shape::y ? y : x * x + y * y;
  };
  Bar bar(700, 0.4);
  bar.free(bar.bias, 650, 400, 1000);
  bar.free_linear();
  Picture& m = bar.add_image(60, 40, bar.bias);
  for (const auto& [shape, of_intensity] : shapes) {
    Parameter p;
    p.name = "uneven " + std::to_string(m.uneven.size());
    p.free = p.linear = true;
    m.uneven.push_back({bar.job.parameters.add(p), shape, of_intensity});
  }
  m.noise = NoiseModel{20, 0, false};
  Gaussian gaussian(23);
  for (int y = 0; y < 40; ++y)
    for (int x = 0; x < 60; ++x) {
      double gain = truth[0], offset = truth[1];
      for (std::size_t k = 0; k < shapes.size(); ++k)
        (shapes[k].second ? gain : offset) += truth[k + 2] * shape_at(shapes[k].first, x, y);
      m.values(x, y) = gain * intensity(700, 0.4, y, 40) + offset + 20 * gaussian();
    }
  const FitResult result = fit(bar.job);
  ASSERT_TRUE(result.has_answer()) << result.verdict;
  EXPECT_NEAR(result.reduced_chi_square, 1, 0.15);
  const ParameterEstimate& bias = estimate(result, "sample.crystal.bias_v");
  EXPECT_NEAR(bias.value, 700, 4 * bias.stderr_);
  // At the voltage found, ordinary least squares of all seven. Pixels are means over their area, the model's own: from
  // the fitted image.
  const std::vector<std::string> names{"micrograph.gain", "micrograph.offset", "uneven 0", "uneven 1",
                                       "uneven 2",        "uneven 3",          "uneven 4"};
  std::vector<double> found;
  for (const std::string& name : names) found.push_back(estimate(result, name).value);
  Eigen::MatrixXd design(2400, 7);
  Eigen::VectorXd values(2400);
  for (int y = 0; y < 40; ++y)
    for (int x = 0; x < 60; ++x) {
      const int i = y * 60 + x;
      double gain = found[0], offset = found[1];
      for (std::size_t k = 0; k < shapes.size(); ++k)
        (shapes[k].second ? gain : offset) += found[k + 2] * shape_at(shapes[k].first, x, y);
      const double light = (result.micrographs[0].fitted(x, y) - offset) / gain;
      design(i, 0) = light, design(i, 1) = 1;
      for (std::size_t k = 0; k < shapes.size(); ++k)
        design(i, static_cast<int>(k) + 2) = (shapes[k].second ? light : 1) * shape_at(shapes[k].first, x, y);
      values[i] = picture(bar.job, 0).values(x, y);
    }
  const Eigen::VectorXd expected = (design.transpose() * design).llt().solve(design.transpose() * values);
  for (std::size_t k = 0; k < names.size(); ++k) {
    const ParameterEstimate& p = estimate(result, names[k]);
    EXPECT_NEAR(p.value, expected[static_cast<Eigen::Index>(k)], 1e-6 * p.stderr_) << names[k];
    EXPECT_NEAR(p.value, truth[k], 4 * p.stderr_) << names[k];
    EXPECT_TRUE(p.linear);
  }
}

TEST(Fit, AnInterruptionGivesTheBestStateSoFar) {
  Bar bar;
  bar.free(bar.bias, 650, 400, 1000);
  bar.free_linear();
  Picture& micrograph = bar.add_image(32, 32, bar.bias);
  expose(micrograph, 3000, 100, 700, 0.4, [](int x, int y, double) { return (x * 7 + y * 13) % 5; });
  std::atomic<bool> stop = true;
  bar.job.options.interrupted = &stop;
  const FitResult result = fit(bar.job);
  EXPECT_TRUE(result.interrupted);
  EXPECT_FALSE(result.converged);
  EXPECT_FALSE(result.has_answer());
  ASSERT_EQ(result.micrographs.size(), 1u);
  EXPECT_EQ(result.micrographs[0].fitted.width(), 32);
  EXPECT_GE(result.theta[bar.bias.index], 400);
  EXPECT_LE(result.theta[bar.bias.index], 1000);
  EXPECT_NE(result.verdict.find("interrupted"), std::string::npos);
}

TEST(Fit, GivesTheSameBitsWithOneAndTwoThreads) {
  const auto run = [](int threads) {
    Bar bar;
    bar.job.options.threads = threads;
    bar.free(bar.bias, 500, 100, 4000);
    bar.free(bar.tilt, 0.3, 0.1, 0.7);
    bar.free_linear();
    Picture& micrograph = bar.add_image(160, 150, bar.bias);  // some parts of a few thousand pixels
    Gaussian gaussian(17);
    expose(micrograph, 3000, 100, 700, 0.4, [&](int, int, double) { return std::round(20 * gaussian()); });
    return fit(bar.job);
  };
  const FitResult one = run(1), two = run(2);
  EXPECT_EQ(one.theta, two.theta);
  EXPECT_EQ(one.covariance, two.covariance);
  EXPECT_EQ(one.evaluations, two.evaluations);
}

TEST(Fit, FramesWithVoltagesOfTheirOwnGiveTheSameBitsWithOneAndTwoThreads) {
  // Ten frames, one voltage each and a tilt they share: rendered a frame a core, each with derivatives by what its own
  // scene reads.
  const auto run = [](int threads) {
    Bar bar(0, 0.4);
    bar.job.options.threads = threads;
    bar.free(bar.tilt, 0.3, 0.1, 0.7);
    bar.free_linear();
    Gaussian gaussian(19);
    for (int frame = 0; frame < 10; ++frame) {
      const double volts = 500 + 40 * frame;
      Parameter bias;
      bias.name = "bias " + std::to_string(frame);
      bias.unit = "V";
      bias.value = volts + 15;
      bias.lower = 300, bias.upper = 1100;
      bias.free = true;
      Picture& micrograph = bar.add_image(24, 24, bar.job.parameters.add(bias));
      micrograph.noise = NoiseModel{20, 0, false};
      expose(micrograph, 3000, 100, volts, 0.4, [&](int, int, double) { return 20 * gaussian(); });
    }
    return fit(bar.job);
  };
  const FitResult one = run(1), two = run(2);
  EXPECT_EQ(one.theta, two.theta);
  EXPECT_EQ(one.covariance, two.covariance);
  for (int frame = 0; frame < 10; ++frame) {
    const ParameterEstimate& bias = estimate(one, "bias " + std::to_string(frame));
    EXPECT_NEAR(bias.value, 500 + 40 * frame, 5 * bias.stderr_) << frame;
    // a derivative that went to another frame's column would leave it undetermined
    EXPECT_LT(bias.stderr_, 20) << frame;
  }
}

TEST(Fit, AnImageWithoutUsablePixelsIsTheUsersMistake) {
  Bar bar;
  bar.free(bar.bias, 500, 100, 4000);
  Picture& micrograph = bar.add_image(16, 16, bar.bias);
  micrograph.mask = Mask(16, 16, 0);
  EXPECT_THROW(fit(bar.job), UserError);
}

// Chi-square is made of squares.
TEST(Fit, ValuesWhoseSquaresOverflowAreNamed) {
  Bar bar;
  bar.free(bar.bias, 500, 100, 4000);
  for (double& value : bar.add_image(16, 16, bar.bias).values.values()) value = 1e200;
  try {
    fit(bar.job);
    FAIL() << "fitted";
  } catch (const UserError& error) {
    EXPECT_NE(error.problems().front().what.find("whose squares"), std::string::npos) << error.problems().front().what;
  }
}

}  // namespace
}  // namespace birefit
