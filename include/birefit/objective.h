#pragma once
// What a fit makes small, as a function of its free parameters: for solvers and samplers of one's own.

#include <memory>
#include <string>
#include <vector>

#include <Eigen/Dense>

#include "birefit/fit.h"

namespace birefit {

/// Residuals of a job by weights that stay: those that a fit of it begins with, or those that one ended with. All free
/// parameters are arguments, gains and offsets among them, each in its unit and in the order of FitResult::parameters
/// (searched first, then linear). Several threads may ask at once; one is answered after the other, on the threads of
/// FitOptions::threads. What nobody knows exactly (StatedNumber), departures of the picture, and what a fit makes of
/// its misfit are left out.
class Objective {
 public:
  /// Plans and noise as where a fit of the job begins. Throws UserError where there is nothing to fit.
  explicit Objective(FitJob job);
  /// Plans, pixels and noise as the fit of the same job ended with.
  Objective(FitJob job, const FitResult& result);
  ~Objective();
  Objective(const Objective&) = delete;
  Objective& operator=(const Objective&) = delete;

  /// The arguments' names: config paths.
  const std::vector<std::string>& names() const;
  /// Their places in the job's table.
  const std::vector<int>& table_indices() const;
  /// Where a fit begins, or ended; gains and offsets are the best ones there.
  const Eigen::VectorXd& start() const;
  /// Bounds of the arguments; infinite where there are none.
  const Eigen::VectorXd& lower() const;
  /// The same, above.
  const Eigen::VectorXd& upper() const;
  /// Values that are used, picture after picture, then a row a prior.
  Eigen::Index rows() const;

  /// (model - value) / standard deviation of every value, then (argument - mean) / sd of every prior. Throws
  /// std::invalid_argument where theta is of another length.
  Eigen::VectorXd residual(const Eigen::VectorXd& theta) const;
  /// Its derivatives, rows() x arguments.
  Eigen::MatrixXd jacobian(const Eigen::VectorXd& theta) const;
  /// -(residual, squared and added up) / 2: ln of the posterior but for a constant, -infinity outside of the bounds.
  double log_posterior(const Eigen::VectorXd& theta) const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace birefit
