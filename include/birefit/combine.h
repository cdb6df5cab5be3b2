#pragma once
// What several fits know together about parameters they share: their Gaussian posteriors as one.

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Dense>

namespace birefit {

/// A Gaussian over named parameters, each in its own unit.
struct Posterior {
  std::vector<std::string> names;  ///< order of mean and covariance
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;     ///< positive definite
  double degrees_of_freedom = 0;  ///< of the Student t behind its intervals
};

/// The named parameters alone, the others integrated out; nothing where one is missing or has no positive variance.
std::optional<Posterior> marginal(const Posterior& all, const std::vector<std::string>& names);

/// Shared parameters by all fits.
struct SharedEstimate {
  Posterior posterior;         ///< degrees of freedom: the fewest of any fit
  double chi_square = 0;       ///< of the fits' own values about the common ones
  int chi_square_degrees = 0;  ///< its expectation
  int fits = 0;
  /// false: chi_square is exceeded by chance less than once in a thousand times; covariance is scaled by chi_square /
  /// degrees
  bool consistent = true;
};

/// Combines fits that share nothing but these parameters: posteriors over the same names in the same order, each of
/// which holds `prior` (of all or some of them), which counts once.
SharedEstimate combine(const std::vector<Posterior>& fits, const std::optional<Posterior>& prior);

/// The posterior of one fit once the others have been heard about what is shared.
Posterior informed(const Posterior& fit, const SharedEstimate& shared);

/// `factor` standard errors to either side hold 95 %.
double interval95_factor(double degrees_of_freedom);

}  // namespace birefit
