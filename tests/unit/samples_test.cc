// Draws from posteriors that are known in closed form.

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "bar.h"
#include "birefit/fit.h"

namespace birefit {
namespace {

using namespace testing;

constexpr double kNoise = 20;

/// A bar's picture with noise, its errors by that noise alone.
Bar bar_with_picture(int frames = 1, double scatter = 0, double noise = kNoise) {
  Bar bar(700, 0.4);
  Gaussian gaussian(5);
  for (int frame = 0; frame < frames; ++frame) {
    Picture& picture = bar.add_image(40, 40, bar.bias);
    picture.noise = NoiseModel{noise, 0, false};
    const double off = scatter * gaussian();
    expose(picture, 3000, 100, 700, 0.4, [&](int, int, double) { return off + noise * gaussian(); });
  }
  bar.under_even_light();
  return bar;
}

std::vector<double> drawn(const FitResult& result, const std::string& name) {
  const auto column = result.samples->values.col(index_of(result, name));
  return {column.begin(), column.end()};
}
double mean_of(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return sum / static_cast<double>(values.size());
}

// Where the likelihood is a parabola the posterior is the normal that the covariance describes, of linear unknowns as
// well. A mean of n draws is known to 1/sqrt(n) of their spread, a standard deviation to 1/sqrt(2 n).
TEST(Samples, OfAParabolaAreItsNormal) {
  Bar bar = bar_with_picture(1, 0, 2);
  bar.free(bar.bias, 690, 100, 1400);
  bar.free(bar.tilt, 0.38, 0.1, 0.7);
  bar.free_linear();
  bar.job.options.samples = 3000;
  const FitResult result = fit(bar.job);
  ASSERT_TRUE(result.samples);
  const Samples& samples = *result.samples;
  ASSERT_EQ(samples.values.rows(), 3000);
  ASSERT_EQ(samples.values.cols(), std::ssize(result.parameters));
  EXPECT_GT(samples.effective, 1500);
  const double known = 4 / std::sqrt(samples.effective);
  const Eigen::RowVectorXd mean = samples.values.colwise().mean();
  const Eigen::MatrixXd off = samples.values.rowwise() - mean;
  const Eigen::MatrixXd covariance = off.transpose() * off / 2999;
  for (Eigen::Index j = 0; j < covariance.cols(); ++j) {
    const ParameterEstimate& p = result.parameters[static_cast<std::size_t>(j)];
    EXPECT_NEAR(mean[j], p.value, known * p.stderr_) << p.name;
    EXPECT_NEAR(std::sqrt(covariance(j, j)) / p.stderr_, 1, known) << p.name;
    EXPECT_NEAR(samples.parameters[static_cast<std::size_t>(j)].low, p.interval95_low, 2 * known * p.stderr_);
    EXPECT_NEAR(samples.parameters[static_cast<std::size_t>(j)].high, p.interval95_high, 2 * known * p.stderr_);
    for (Eigen::Index i = 0; i < j; ++i)
      EXPECT_NEAR(covariance(i, j) / std::sqrt(covariance(i, i) * covariance(j, j)), result.correlation(i, j), known);
  }
}

// With ten times the noise it is no parabola any more: gain, offset, field and tilt make a bent valley, whose mean lies
// a fifth of its width beside its top. Against sums over a grid of field and tilt, gain and offset integrated out as
// normals by hand.
TEST(Samples, OfABentValleyAreThoseOfAGrid) {
  Bar bar = bar_with_picture();
  bar.free(bar.bias, 690, 100, 1400);
  bar.free(bar.tilt, 0.38, 0.1, 0.7);
  bar.free_linear();
  bar.job.options.samples = 3000;
  const FitResult result = fit(bar.job);
  ASSERT_TRUE(result.samples);
  const ParameterEstimate &bias = estimate(result, "sample.crystal.bias_v"),
                          &tilt = estimate(result, "sample.crystal.field_legendre.c1");
  // Rows are even: their means tell all.
  const Picture& picture = std::get<Picture>(bar.job.measurements.front());
  Eigen::VectorXd rows = Eigen::VectorXd::Zero(40);
  for (int y = 0; y < 40; ++y)
    for (int x = 0; x < 40; ++x) rows[y] += picture.values(x, y) / 40;
  const double sd = kNoise / std::sqrt(40.0);
  constexpr int kSteps = 120;
  double sum = 0;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero(), square = Eigen::Vector2d::Zero();
  double least = 0;
  for (const bool weigh : {false, true})  // once for the least sum of squares
    for (int i = -kSteps; i <= kSteps; ++i)
      for (int j = -kSteps; j <= kSteps; ++j) {
        const Eigen::Vector2d off(6.0 * i / kSteps, 6.0 * j / kSteps);  // standard errors
        Eigen::MatrixXd terms = Eigen::MatrixXd::Ones(40, 2);
        for (int y = 0; y < 40; ++y)
          terms(y, 0) = intensity(bias.value + off[0] * bias.stderr_, tilt.value + off[1] * tilt.stderr_, y, 40);
        const Eigen::Matrix2d gram = terms.transpose() * terms / (sd * sd);
        const Eigen::Vector2d best = gram.ldlt().solve(terms.transpose() * rows / (sd * sd));
        const double misfit = (rows - terms * best).squaredNorm() / (sd * sd);
        if (!weigh) {
          least = i == -kSteps && j == -kSteps ? misfit : std::min(least, misfit);
          continue;
        }
        const double density = std::exp(-0.5 * (misfit - least)) / std::sqrt(gram.determinant());
        sum += density, mean += density * off, square += density * off.cwiseAbs2();
      }
  mean /= sum;
  const Eigen::Vector2d width = (square / sum - mean.cwiseAbs2()).cwiseSqrt();
  EXPECT_GT(mean.cwiseAbs().maxCoeff(), 0.1) << "or it would be a parabola";
  const double known = 4 / std::sqrt(result.samples->effective);
  for (int k = 0; k < 2; ++k) {
    const ParameterEstimate& p = k == 0 ? bias : tilt;
    const std::vector<double> values = drawn(result, p.name);
    const double middle = mean_of(values);
    double spread = 0;
    for (const double v : values) spread += std::pow(v - middle, 2) / static_cast<double>(values.size() - 1);
    EXPECT_NEAR((middle - p.value) / p.stderr_, mean[k], known * width[k]) << p.name;
    EXPECT_NEAR(std::sqrt(spread) / p.stderr_, width[k], known * width[k]) << p.name;
  }
}

// An even picture of sin^2 is the same below and above the half-wave voltage; a prior about 1000 V prefers the lower
// one, by its own ratio. No chain that goes step by step would cross the 1600 V between them.
TEST(Samples, OfTwoMinimaAreInEitherAsOftenAsItIsLikely) {
  Bar bar;
  bar.free(bar.bias, 900, 100, 2900);
  bar.job.parameters[bar.bias].value = 1000, bar.job.parameters[bar.bias].prior_sd = 900;
  bar.job.parameters[bar.gain].value = 3000, bar.job.parameters[bar.offset].value = 100;
  Picture& picture = bar.add_image(30, 30, bar.bias, true);
  picture.noise = NoiseModel{kNoise, 0, false};
  Gaussian gaussian(7);
  expose(picture, 3000, 100, 700, 0, [&](int, int, double) { return kNoise * gaussian(); });
  bar.job.options.samples = 3000;
  const FitResult result = fit(bar.job);
  ASSERT_TRUE(result.samples);
  const std::vector<double> bias = drawn(result, "sample.crystal.bias_v");
  const double above =
      static_cast<double>(std::count_if(bias.begin(), bias.end(), [](double v) { return v > kHalfWave; })) / 3000;
  const double odds = std::exp(-0.5 * (1300 * 1300 - 300 * 300) / (900.0 * 900));
  const double expected = odds / (1 + odds);
  EXPECT_NEAR(above, expected, 4 * std::sqrt(expected * (1 - expected) / result.samples->effective));
  for (const double v : bias) EXPECT_LT(std::min(std::abs(v - 700), std::abs(v - 2300)), 60) << v;
}

// Of a normal cut off one standard deviation above its top the mean is phi(1) / (1 - Phi(1)) = 1.525 of them above the
// top: intervals about the best value, which is the bound, know nothing of that.
TEST(Samples, EndAtABound) {
  Bar bar = bar_with_picture();
  bar.job.parameters[bar.gain].value = 3000, bar.job.parameters[bar.offset].value = 100;
  bar.free(bar.bias, 690, 100, 1400);
  const ParameterEstimate free = estimate(fit(bar.job), "sample.crystal.bias_v");
  const double bound = free.value + free.stderr_;
  bar.free(bar.bias, 720, bound, 1400);
  bar.job.options.samples = 3000;
  const FitResult result = fit(bar.job);
  ASSERT_TRUE(result.samples);
  const std::vector<double> bias = drawn(result, "sample.crystal.bias_v");
  EXPECT_GE(*std::min_element(bias.begin(), bias.end()), bound);
  // Its standard deviation is 0.446 of the whole normal's.
  EXPECT_NEAR((mean_of(bias) - free.value) / free.stderr_, 1.525, 4 * 0.446 / std::sqrt(result.samples->effective));
}

// Six frames that scatter: their spread is known by few, and the posterior has the tails of Student's t, as the
// intervals do. Of 5 degrees of freedom a quantile of 97.5 % scatters by 2.1 / sqrt(n) of the t quantile's unit.
TEST(Samples, OfFewFramesHaveTheirTails) {
  Bar bar = bar_with_picture(6, 25);
  bar.free(bar.bias, 690, 100, 1400);
  bar.job.parameters[bar.gain].value = 3000, bar.job.parameters[bar.offset].value = 100;
  bar.job.options.samples = 4000;
  const FitResult result = fit(bar.job);
  ASSERT_TRUE(result.frame_scatter);
  ASSERT_LT(result.interval_degrees_of_freedom, 10);
  ASSERT_TRUE(result.samples);
  const ParameterEstimate& p = estimate(result, "sample.crystal.bias_v");
  const Samples::Of& of = result.samples->parameters.front();
  const double half = 0.5 * (p.interval95_high - p.interval95_low),
               known = 4 * 2.5 / std::sqrt(result.samples->effective);
  EXPECT_NEAR(0.5 * (of.high - of.low) / half, 1, known);
  EXPECT_NEAR(of.median, p.value, known * p.stderr_);
}

TEST(Samples, AreTheSameBitsWhateverTheThreads) {
  const auto run = [](int threads) {
    Bar bar = bar_with_picture();
    bar.free(bar.bias, 690, 100, 1400);
    bar.free_linear();
    bar.job.options.threads = threads;
    bar.job.options.samples = 50;
    return fit(bar.job);
  };
  EXPECT_EQ(run(1).samples->values, run(2).samples->values);
  Bar bar = bar_with_picture();
  bar.free(bar.bias, 690, 100, 1400);
  EXPECT_FALSE(fit(bar.job).samples) << "none were asked for";
}

}  // namespace
}  // namespace birefit
