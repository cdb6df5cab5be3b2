#pragma once
// Small systems of equations inside a fit's least squares.

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <Eigen/Dense>

namespace birefit::estimation {

/// Symmetric square root rows R with R^T R = covariance^-1. Scaled to correlations first and the eigenvalues floored,
/// so that parameters of very different size and correlations of -0.99999 keep their digits.
inline Eigen::MatrixXd whitening_root(const Eigen::MatrixXd& covariance) {
  constexpr double kFloor = 1e-13;
  const Eigen::VectorXd inverse_sd = covariance.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(inverse_sd.asDiagonal() * covariance *
                                                             inverse_sd.asDiagonal());
  const Eigen::VectorXd values = eigen.eigenvalues().cwiseMax(kFloor * eigen.eigenvalues().maxCoeff());
  return values.cwiseSqrt().cwiseInverse().asDiagonal() * eigen.eigenvectors().transpose() * inverse_sd.asDiagonal();
}

/// Solution of a small positive semi-definite system; directions without information stay at zero.
inline Eigen::MatrixXd solve_semidefinite(const Eigen::MatrixXd& matrix, const Eigen::MatrixXd& right) {
  constexpr double kUnseen = 1e-14;
  const Eigen::VectorXd scale = matrix.diagonal().unaryExpr([](double d) { return d > 0 ? 1 / std::sqrt(d) : 0.0; });
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.asDiagonal() * matrix * scale.asDiagonal());
  const double cut = kUnseen * std::max(eigen.eigenvalues().cwiseAbs().maxCoeff(), 1e-300);
  const Eigen::VectorXd inverse = eigen.eigenvalues().unaryExpr([&](double v) { return v > cut ? 1 / v : 0.0; });
  return scale.asDiagonal() * (eigen.eigenvectors() * (inverse.asDiagonal() * (eigen.eigenvectors().transpose() *
                                                                               (scale.asDiagonal() * right))));
}

/// The solution of such a system within bounds by an active set: what leaves them furthest is held there and the rest
/// solved again.
inline Eigen::VectorXd solve_within_bounds(const Eigen::MatrixXd& matrix, const Eigen::VectorXd& right,
                                           const Eigen::VectorXd& lower, const Eigen::VectorXd& upper) {
  std::vector<Eigen::Index> moving, held;
  for (Eigen::Index j = 0; j < right.size(); ++j) moving.push_back(j);
  Eigen::VectorXd x = Eigen::VectorXd::Zero(right.size());
  while (!moving.empty()) {
    Eigen::VectorXd target = right(moving);
    if (!held.empty()) target -= matrix(moving, held) * x(held);
    const Eigen::VectorXd solved = solve_semidefinite(matrix(moving, moving), target);
    std::size_t worst = moving.size();
    double worst_excess = 0;
    for (std::size_t i = 0; i < moving.size(); ++i) {
      const Eigen::Index j = moving[i];
      x[j] = solved[static_cast<Eigen::Index>(i)];
      const double excess = std::max(lower[j] - x[j], x[j] - upper[j]) * std::sqrt(std::max(matrix(j, j), 1e-300));
      if (excess > worst_excess) worst = i, worst_excess = excess;
    }
    if (worst == moving.size()) break;
    const Eigen::Index j = moving[worst];
    x[j] = std::clamp(x[j], lower[j], upper[j]);
    held.push_back(j);
    std::sort(held.begin(), held.end());
    moving.erase(moving.begin() + static_cast<std::ptrdiff_t>(worst));
  }
  return x;
}

/// -2 ln of Student's t with four degrees of freedom where it is wider than the normal distribution, which it follows
/// up to one standard deviation: its signed root, so that squares add up, and the root's derivative. A nuisance that
/// pictures contradict is let go of; a normal prior would hold it and move all others.
inline std::pair<double, double> student_root(double z) {
  const double away = std::abs(z);
  if (away <= 1) return {z, 1};
  constexpr double kFreedom = 4;
  const double root = std::sqrt(1 + (kFreedom + 1) * std::log((kFreedom + z * z) / (kFreedom + 1)));
  return {std::copysign(root, z), (kFreedom + 1) * away / ((kFreedom + z * z) * root)};
}

/// Of a row of least squares that stands for such a prior.
inline double student_weight(double z) {
  const auto [root, slope] = student_root(z);
  return std::abs(z) <= 1 ? 1 : root * slope / z;
}

}  // namespace birefit::estimation
