// Distributions and least-squares algebra against tables and closed forms.

#include "fit/errors/statistics.h"

#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

namespace birefit::estimation {
namespace {

TEST(StudentT, QuantilesEqualTheTables) {
  // Printed to three digits in every table of the distribution.
  EXPECT_NEAR(student_t_quantile(0.975, 1), 12.706, 5e-4);
  EXPECT_NEAR(student_t_quantile(0.975, 2), 4.303, 5e-4);
  EXPECT_NEAR(student_t_quantile(0.975, 3), 3.182, 5e-4);
  EXPECT_NEAR(student_t_quantile(0.975, 10), 2.228, 5e-4);
  EXPECT_NEAR(student_t_quantile(0.95, 5), 2.015, 5e-4);
  EXPECT_NEAR(student_t_quantile(0.975, std::numeric_limits<double>::infinity()), 1.960, 5e-4);
}

TEST(StudentT, OneAndTwoDegreesOfFreedomFollowTheClosedForms) {
  for (const double p : {1e-6, 0.01, 0.3, 0.5, 0.77, 0.999}) {
    // (The tail probabilities of p near 1 lose a few digits.)
    const double one = std::tan(M_PI * (p - 0.5)), two = (2 * p - 1) * std::sqrt(2 / (4 * p * (1 - p)));
    EXPECT_NEAR(student_t_quantile(p, 1), one, 1e-9 * (1 + std::abs(one)));
    EXPECT_NEAR(student_t_quantile(p, 2), two, 1e-9 * (1 + std::abs(two)));
  }
}

TEST(StudentT, NonIntegerDegreesOfFreedomInvertTheDistribution) {
  for (const double dof : {0.9, 2.5, 17.3, 1e4, 1e7})
    for (const double p : {0.001, 0.2, 0.975})
      EXPECT_NEAR(student_t_cdf(student_t_quantile(p, dof), dof), p, 1e-9) << dof << ' ' << p;
}

TEST(ChiSquare, QuantilesEqualTheTables) {
  EXPECT_NEAR(chi_square_quantile(0.95, 1), 3.841, 5e-4);
  EXPECT_NEAR(chi_square_quantile(0.999, 10), 29.588, 5e-4);
  EXPECT_NEAR(chi_square_quantile(0.9999, 8), 31.828, 5e-4);
  // Of two degrees of freedom it is exponential.
  for (const double p : {1e-3, 0.5, 0.95, 0.9999}) EXPECT_NEAR(chi_square_quantile(p, 2), -2 * std::log1p(-p), 1e-9);
}

TEST(Distributions, HaveNoValueWhereThereIsNone) {
  EXPECT_TRUE(std::isnan(student_t_quantile(0.975, 0)));
  EXPECT_TRUE(std::isnan(student_t_quantile(0.975, -1)));
  EXPECT_TRUE(std::isnan(chi_square_quantile(0.95, 0)));
  EXPECT_NEAR(student_t_quantile(0.975, 1e9), normal_quantile(0.975), 1e-12);
  EXPECT_NEAR(normal_cdf(normal_quantile(1e-300)), 1e-300, 1e-310);
}

TEST(TallQr, FactorSquaresToTheNormalEquations) {
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  Eigen::MatrixXd rows(1000, 4);
  for (double& value : rows.reshaped()) value = normal(random);
  TallQr whole(4), parts(4);
  whole.add(rows);
  for (int begin = 0; begin < 1000; begin += 300) parts.add(rows.middleRows(begin, std::min(300, 1000 - begin)));
  const Eigen::MatrixXd gram = rows.transpose() * rows;
  // A thousand products of size one, rounded at 1e-16.
  EXPECT_LT((whole.factor().transpose() * whole.factor() - gram).norm(), 1e-11 * gram.norm());
  EXPECT_LT((parts.factor().transpose() * parts.factor() - gram).norm(), 1e-11 * gram.norm());
}

TEST(Inverse, KeepsItsDigitsAtAHeatedPlatesCorrelation) {
  // Two unit columns with correlation rho: variance 1 / (1 - rho^2), known in closed form.
  const double rho = 0.999998;
  Eigen::MatrixXd factor(2, 2);
  factor << 1, rho, 0, std::sqrt(1 - rho * rho);
  factor.col(1) *= 1e6;  // units that differ
  const Inverse inverse = invert_normal_equations(factor);
  const double variance = 1 / (1 - rho * rho);
  EXPECT_NEAR(inverse.covariance(0, 0), variance, 1e-8 * variance);
  EXPECT_NEAR(inverse.covariance(1, 1) * 1e12, variance, 1e-8 * variance);
  EXPECT_NEAR(inverse.covariance(0, 1) / std::sqrt(inverse.covariance(0, 0) * inverse.covariance(1, 1)), -rho, 1e-9);
  EXPECT_FALSE(inverse.undetermined[0] || inverse.undetermined[1]);
}

TEST(Inverse, NamesColumnsWithoutInfluenceAndDirectionsUnseen) {
  Eigen::MatrixXd factor = Eigen::MatrixXd::Zero(4, 4);
  factor(0, 0) = 2;                     // determined
  factor(1, 2) = 3, factor(1, 3) = -5;  // only a combination of 2 and 3
  const Inverse inverse = invert_normal_equations(factor);
  EXPECT_NEAR(inverse.covariance(0, 0), 0.25, 1e-14);
  EXPECT_EQ(inverse.no_influence, (std::vector<bool>{false, true, false, false}));
  EXPECT_EQ(inverse.undetermined, (std::vector<bool>{false, true, true, true}));
}

Image white_noise(int width, int height, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Image image(width, height);
  for (double& value : image.values()) value = normal(random);
  return image;
}

TEST(CorrelationArea, IsOneForWhiteNoise) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const Image image = white_noise(80, 60, seed);
    EXPECT_EQ(correlation_area(image, Mask(80, 60, 1)), 1) << seed;
  }
}

TEST(CorrelationArea, OfAMovingAverageIsItsNumberOfPixels) {
  // Mean of n x n pixels: the autocorrelation is a pyramid whose sum is n^2.
  constexpr int kSide = 5;
  const Image noise = white_noise(300, 300, 3);
  Image image(296, 296);
  for (int y = 0; y < 296; ++y)
    for (int x = 0; x < 296; ++x)
      for (int j = 0; j < kSide; ++j)
        for (int i = 0; i < kSide; ++i) image(x, y) += noise(x + i, y + j);
  // Correlations below 0.05 are left out (4 % of the pyramid); those kept scatter by a few percent.
  EXPECT_NEAR(correlation_area(image, Mask(296, 296, 1)), kSide * kSide, 0.15 * kSide * kSide);
}

}  // namespace
}  // namespace birefit::estimation
