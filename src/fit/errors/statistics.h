#pragma once
// Distributions, streaming least-squares algebra and the size of correlated misfit: what the error bars are made of.

#include <vector>

#include <Eigen/Dense>

#include "birefit/image.h"

namespace birefit::estimation {

/// Standard normal, Student t (`dof` > 0, infinity allowed) and chi-square distribution, to rounding; not a number
/// where there is no such value.
double normal_cdf(double x);
double normal_quantile(double probability);
double student_t_cdf(double t, double dof);
double student_t_quantile(double probability, double dof);
double chi_square_quantile(double probability, double dof);

/// Triangular factor of a tall matrix that arrives in row blocks (Golub & Van Loan, Matrix Computations, 5.2): never
/// forms J^T J, so a correlation of 0.999999 keeps its digits, and never holds more than one block.
class TallQr {
 public:
  explicit TallQr(int columns);
  void add(const Eigen::MatrixXd& rows);
  const Eigen::MatrixXd& factor() const { return factor_; }  ///< columns x columns, upper triangular

 private:
  Eigen::MatrixXd factor_;
};

/// (R^T R)^-1 by singular values of the column-normalised factor. Columns without any influence and directions the
/// rows do not see are left out of the inverse and reported.
struct Inverse {
  Eigen::MatrixXd covariance;      ///< of the determined subspace; zero rows for columns without influence
  std::vector<bool> no_influence;  ///< zero column
  std::vector<bool> undetermined;  ///< takes part in a direction the rows do not see (zero columns included)
  Eigen::VectorXd conditional_sd;  ///< one over the column's norm given all others fixed; infinity for zero columns
};
Inverse invert_normal_equations(const Eigen::MatrixXd& factor);

/// Number of pixels that share one value of a correlated residual: sum of the normalised autocorrelation inside its
/// first fall to 0.05 (to its sampling error in small images), at least 1. `whitened` is 0 where `mask` is 0.
double correlation_area(const Image& whitened, const Mask& mask);

}  // namespace birefit::estimation
