// Ceres over what LeastSquares leaves to be searched for.

#include <algorithm>
#include <cmath>

#include <ceres/ceres.h>
#include <fmt/format.h>

#include "fit/problem/least_squares.h"

namespace birefit::estimation {

namespace {

/// The solver's parameters are unit-free: (theta - origin) / scale.
struct Scaling {
  Eigen::VectorXd origin, scale;
  Eigen::VectorXd to_theta(const double* x) const {
    return origin + scale.cwiseProduct(Eigen::Map<const Eigen::VectorXd>(x, scale.size()));
  }
};

/// One render per point.
class SharedEvaluation : public ceres::EvaluationCallback {
 public:
  SharedEvaluation(LeastSquares& problem, const Scaling& scaling, const std::vector<double>& x)
      : problem_(problem), scaling_(scaling), x_(x) {}

  void PrepareForEvaluation(bool evaluate_jacobians, bool) override {
    // Ceres asks again at the same point (line search, then cost, then Jacobian): compare rather than trust the flag.
    if (valid_ && x_ == last_ && (has_jacobian_ || !evaluate_jacobians)) return;
    valid_ = false;
    try {
      problem_.evaluate(scaling_.to_theta(x_.data()), evaluate_jacobians);
      valid_ = std::isfinite(problem_.objective());
    } catch (...) {
      failure = std::current_exception();  // Ceres knows no exceptions: the step is refused instead
    }
    last_ = x_;
    has_jacobian_ = evaluate_jacobians;
  }
  bool valid() const { return valid_; }

  std::exception_ptr failure;

 private:
  LeastSquares& problem_;
  const Scaling& scaling_;
  const std::vector<double>& x_;
  std::vector<double> last_;
  bool valid_ = false, has_jacobian_ = false;
};

/// The whole problem in one row more than it has unknowns. With R = [A b; 0 c] the triangular factor of all rows
/// [Jacobian, residual], the residual (b, c) and the Jacobian (A, 0) have the same sum of squares, gradient and
/// Gauss-Newton steps, and the solver keeps no copies of a million rows.
class ReducedCost : public ceres::CostFunction {
 public:
  ReducedCost(const LeastSquares& problem, const Scaling& scaling, const SharedEvaluation& evaluation)
      : problem_(problem), scaling_(scaling), evaluation_(evaluation) {
    const int p = static_cast<int>(scaling.scale.size());
    set_num_residuals(p + 1);
    mutable_parameter_block_sizes()->push_back(p);
  }
  bool Evaluate(double const* const*, double* residuals, double** jacobians) const override {
    if (!evaluation_.valid()) return false;
    const Eigen::Index p = scaling_.scale.size();
    Eigen::Map<Eigen::VectorXd> residual(residuals, p + 1);
    if (jacobians && jacobians[0]) {
      const Eigen::MatrixXd factor = problem_.projected_factor(scaling_.scale);
      residual = factor.col(p);
      Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(jacobians[0], p + 1, p) =
          factor.leftCols(p);
    } else {  // only its sum of squares is asked for
      residual.setZero();
      residual[p] = std::sqrt(problem_.objective());
    }
    return true;
  }

 private:
  const LeastSquares& problem_;
  const Scaling& scaling_;
  const SharedEvaluation& evaluation_;
};

class Watch : public ceres::IterationCallback {
 public:
  explicit Watch(const SolveOptions& options) : options_(options) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
    if (options_.iterations)
      options_.iterations->push_back(
          {static_cast<int>(options_.iterations->size()), 2 * summary.cost, summary.step_norm});
    if (options_.progress && !options_.label.empty())
      options_.progress(
          fmt::format("{}, iteration {}: chi-square {:.6g}", options_.label, summary.iteration, 2 * summary.cost));
    if (options_.interrupted && options_.interrupted->load()) {
      stopped = true;
      return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
    }
    // Along a bent valley steps go on for hundreds, each for a millionth of a unit: the valley's floor is level there.
    // At a minimum that rounding has roughened no step succeeds, and none of them promises more.
    const double gain = 2 * summary.cost_change, promised = gain / summary.relative_decrease;
    if (summary.iteration > 0 && summary.step_is_valid &&
        (summary.step_is_successful ? gain : promised) < options_.least_gain) {
      settled = true;
      return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
    }
    return ceres::SOLVER_CONTINUE;
  }
  bool stopped = false, settled = false;

 private:
  const SolveOptions& options_;
};

}  // namespace

SolveSummary LeastSquares::solve(Eigen::VectorXd& searched, const SolveOptions& options) {
  SolveSummary result;
  const int p = searched_size();
  if (p == 0 || (p == 1 && options.held == 0)) {
    evaluate(searched, true);
    if (options.iterations)
      options.iterations->push_back({static_cast<int>(options.iterations->size()), objective(), 0});
    result.converged = true;
    result.report = "Only linear parameters: solved exactly, without iterations.";
    return result;
  }
  Scaling scaling{searched, Eigen::VectorXd::Ones(p)};
  for (int j = 0; j < p; ++j) {
    const Parameter& parameter = job_.parameters[unknowns_.searched[j]];
    const double width = parameter.upper - parameter.lower;
    const double size = std::abs(searched[j]);
    scaling.scale[j] = std::isfinite(width) && width > 0 ? width : size > 0 ? size : 1;
  }
  std::vector<double> x(p, 0.0);
  SharedEvaluation evaluation(*this, scaling, x);
  ceres::Problem::Options problem_options;
  problem_options.evaluation_callback = &evaluation;
  ceres::Problem problem(problem_options);
  problem.AddParameterBlock(x.data(), p);
  if (options.held >= 0) problem.SetManifold(x.data(), new ceres::SubsetManifold(p, {options.held}));
  problem.AddResidualBlock(new ReducedCost(*this, scaling, evaluation), nullptr, x.data());
  for (int j = 0; j < p; ++j) {
    const Parameter& parameter = job_.parameters[unknowns_.searched[j]];
    if (std::isfinite(parameter.lower))
      problem.SetParameterLowerBound(x.data(), j, (parameter.lower - scaling.origin[j]) / scaling.scale[j]);
    if (std::isfinite(parameter.upper))
      problem.SetParameterUpperBound(x.data(), j, (parameter.upper - scaling.origin[j]) / scaling.scale[j]);
  }
  ceres::Solver::Options solver;
  solver.minimizer_type = ceres::TRUST_REGION;
  solver.trust_region_strategy_type = ceres::LEVENBERG_MARQUARDT;
  // QR keeps the digits that normal equations lose.
  solver.linear_solver_type = ceres::DENSE_QR;
  // With bounds Ceres adds a line search; the cubic one would ask for derivative images at every trial step.
  solver.line_search_interpolation_type = ceres::QUADRATIC;
  // Where a few trial steps along one direction find nothing better, a shorter step of another direction does.
  solver.max_num_line_search_step_size_iterations = 5;
  solver.num_threads = 1;
  solver.max_num_iterations = options.max_iterations;
  solver.function_tolerance = options.function_tolerance;
  solver.parameter_tolerance = 1e-10;
  solver.gradient_tolerance = 1e-12;
  solver.logging_type = ceres::SILENT;
  solver.minimizer_progress_to_stdout = false;
  Watch watch(options);
  solver.callbacks.push_back(&watch);
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  if (summary.termination_type == ceres::FAILURE && evaluation.failure) std::rethrow_exception(evaluation.failure);
  result.converged = summary.termination_type == ceres::CONVERGENCE || watch.settled;
  result.interrupted = watch.stopped;
  result.report = summary.FullReport();
  searched = scaling.to_theta(x.data());
  for (int j = 0; j < p; ++j) {  // a bound is hit exactly, not to rounding
    const Parameter& parameter = job_.parameters[unknowns_.searched[j]];
    searched[j] = std::clamp(searched[j], parameter.lower, parameter.upper);
  }
  evaluate(searched, true);
  return result;
}

}  // namespace birefit::estimation
