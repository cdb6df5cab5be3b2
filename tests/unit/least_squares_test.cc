// The objective that the solver goes down by.

#include <cmath>

#include <gtest/gtest.h>

#include "bar.h"
#include "birefit/fit.h"
#include "fit/problem/least_squares.h"
#include "fit/search/scan.h"
#include "scene_builder.h"

namespace birefit {
namespace {

using namespace testing;

// Three parts of some thousand pixels. Whitened, the residual's generalised mean has its own variance and what lies
// across it another (Misfit): chi-square is the sum of both, its gradient the difference of two chi-squares, the
// triangular factor has the same chi-square and gradient, and the gain is where its own vanishes.
TEST(LeastSquares, WeightsMeanAndShapeApartOverAllParts) {
  Bar bar(700, 0.4);
  bar.free(bar.bias, 690, 100, 4000);
  bar.free(bar.tilt, 0.38, 0.1, 0.7);
  bar.job.parameters[bar.gain].free = bar.job.parameters[bar.gain].linear = true;
  bar.job.parameters[bar.offset].value = 160;  // wrong, so that the mean counts
  Picture& micrograph = bar.add_image(110, 100, bar.bias);
  Gaussian gaussian(23);
  expose(micrograph, 3000, 100, 700, 0.4, [&](int, int, double) { return 20 * gaussian(); });
  estimation::PixelSet set;
  std::vector<double> value, sigma;
  for (int y = 0; y < 100; ++y)
    for (int x = 0; x < 110; ++x) {
      set.pixels.push_back({x, y});
      value.push_back(micrograph.values(x, y));
      sigma.push_back(15 + 0.1 * x);
    }
  set.value = Eigen::Map<const Eigen::VectorXd>(value.data(), static_cast<Eigen::Index>(value.size()));
  set.sigma = Eigen::Map<const Eigen::VectorXd>(sigma.data(), static_cast<Eigen::Index>(sigma.size()));
  const estimation::Task task(bar.job);
  estimation::LeastSquares problem(task, {plan(micrograph.scene, bar.job.parameters.values())}, {set});
  const estimation::Misfit misfit{0.9, 2.5, false};
  problem.set_misfit({misfit});
  const auto objective_at = [&](double bias, double tilt) {
    problem.evaluate(Eigen::Vector2d(bias, tilt), false);
    return problem.objective();
  };
  const double by_bias = (objective_at(690.01, 0.38) - objective_at(689.99, 0.38)) / 0.02;
  const double by_tilt = (objective_at(690, 0.3801) - objective_at(690, 0.3799)) / 0.0002;
  problem.evaluate(Eigen::Vector2d(690, 0.38), true);
  const Theta& theta = problem.theta();
  Eigen::VectorXd noise(set.value.size());
  for (Eigen::Index i = 0; i < noise.size(); ++i) {
    const double signal =
        theta[bar.gain.index] * intensity(690, 0.38, set.pixels[static_cast<std::size_t>(i)][1], 100) +
        theta[bar.offset.index];
    noise[i] = (signal - set.value[i]) / set.sigma[i];
  }
  const Eigen::VectorXd along = set.sigma.cwiseInverse().normalized();
  const double mean = along.dot(noise), ratio = misfit.mean_sd * set.sigma.cwiseInverse().norm();
  const double chi_square =
      (noise - mean * along).squaredNorm() / misfit.shape_variance + mean * mean / (1 + ratio * ratio);
  // Pixel means of the intensity are within 1e-4 of the formula's points.
  EXPECT_GT(mean * mean / (1 + ratio * ratio), 0.1 * chi_square);
  EXPECT_NEAR(problem.objective(), chi_square, 1e-3 * chi_square);
  const Eigen::VectorXd gradient = problem.gradient();
  EXPECT_NEAR(gradient[0], by_bias, 1e-5 * std::abs(by_bias));
  EXPECT_NEAR(gradient[1], by_tilt, 1e-5 * std::abs(by_tilt));
  const Eigen::MatrixXd all = problem.factor();
  EXPECT_LT(std::abs(gradient[2]), 1e-9 * all.col(2).norm() * std::sqrt(chi_square));
  const Eigen::MatrixXd reduced = problem.projected_factor(Eigen::Vector2d::Ones());
  EXPECT_NEAR(reduced.col(2).squaredNorm(), problem.objective(), 1e-11 * chi_square);
  for (int j = 0; j < 2; ++j)
    EXPECT_NEAR(2 * reduced.col(j).dot(reduced.col(2)), gradient[j], 1e-9 * std::abs(gradient[j]));
}

// What the solver is told to go down by is the slope of what it compares, beside priors with Student's tails, too, of a
// linear unknown that the image pulls deviations away and of a searched one, and where lens and camera act on the
// light.
TEST(LeastSquares, TheSolversGradientIsThatOfTheObjectiveBesideStudentPriorsAndEffects) {
  Bar bar(700, 0.4);
  bar.free(bar.bias, 690, 100, 4000);
  bar.free(bar.tilt, 0.38, 0.1, 0.7);
  bar.free_linear();
  Parameter& offset = bar.job.parameters[bar.offset];
  offset.nuisance = true, offset.value = 140, offset.prior_sd = 4;
  Parameter& tilt = bar.job.parameters[bar.tilt];
  tilt.nuisance = true, tilt.prior_sd = 0.005;  // about 0.38
  Picture& micrograph = bar.add_image(40, 40, bar.bias);
  Gaussian gaussian(23);
  expose(micrograph, 3000, 100, 700, 0.4, [&](int, int, double) { return 20 * gaussian(); });
  using Effect = PictureEffect::Kind;
  for (const auto& [effect, size] :
       {std::pair{Effect::blur, 4.0}, {Effect::gamma, 0.2}, {Effect::curve, 0.2}, {Effect::stretch_x, 0.05}}) {
    Parameter parameter;
    parameter.name = "effect " + std::to_string(static_cast<int>(effect));
    parameter.value = 3000 * size;
    micrograph.effects.push_back({bar.job.parameters.add(parameter), effect});
  }
  estimation::PixelSet set;
  for (int y = 0; y < 40; ++y)
    for (int x = 0; x < 40; ++x) set.pixels.push_back({x, y});
  set.value = Eigen::Map<const Eigen::VectorXd>(micrograph.values.values().data(), 1600);
  set.sigma = Eigen::VectorXd::Constant(1600, 300);  // the prior counts beside the image
  const estimation::Task task(bar.job);
  estimation::LeastSquares problem(task, {plan(micrograph.scene, bar.job.parameters.values())}, {set});
  const Eigen::Vector2d at(690, 0.396);  // 3.2 deviations
  const auto objective_at = [&](const Eigen::Vector2d& searched) {
    problem.evaluate(searched, false);
    return problem.objective();
  };
  const Eigen::Vector2d step(0.02, 1e-5);
  for (int j = 0; j < 2; ++j) {
    const Eigen::Vector2d by = step[j] * Eigen::Vector2d::Unit(j);
    const double slope = (objective_at(at + by) - objective_at(at - by)) / (2 * step[j]);
    problem.evaluate(at, true);
    EXPECT_GT(std::abs(problem.theta()[bar.offset.index] - 140) / 4, 2) << "or the tails would not be reached";
    const Eigen::MatrixXd factor = problem.projected_factor(Eigen::Vector2d::Ones());
    EXPECT_NEAR(2 * factor.col(j).dot(factor.col(2)), slope, 1e-5 * std::abs(slope)) << j;
  }
}

}  // namespace
}  // namespace birefit
