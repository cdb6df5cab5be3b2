#include "birefit/objective.h"

#include <cmath>
#include <limits>
#include <mutex>
#include <stdexcept>
#include <utility>

#include "fit/problem/frame.h"
#include "fit/standing.h"

namespace birefit {
namespace {

using namespace estimation;

/// A task that searches what is linear, too: its coefficients are then arguments like any other.
Task with_all_searched(const FitJob& job) {
  Task task(job);
  Unknowns& unknowns = task.unknowns;
  unknowns.searched.insert(unknowns.searched.end(), unknowns.linear.begin(), unknowns.linear.end());
  unknowns.linear.clear();
  return task;
}

}  // namespace

struct Objective::Parts {
  Parts(FitJob of, const FitResult* result)
      : job(result ? as_ended(std::move(of), *result) : as_begun(std::move(of))), task(with_all_searched(job)) {
    const Task begun(job);
    Start begin = prepare(begun);
    if (result) {
      take_from(*result, begin.frames);
      for (std::size_t j = 0; j < begun.unknowns.searched.size(); ++j)
        begin.searched[static_cast<Eigen::Index>(j)] =
            result->theta.at(static_cast<std::size_t>(begun.unknowns.searched[j]));
    }
    const std::vector<Misfit> noise_alone(begin.frames.size());
    const auto linear_solved = problem_of(begun, begin.frames, noise_alone);
    linear_solved->evaluate(begin.searched, false);
    problem = problem_of(task, begin.frames, noise_alone);
    const std::size_t n = task.unknowns.searched.size();
    start.resize(static_cast<Eigen::Index>(n)), lower = upper = start;
    for (std::size_t j = 0; j < n; ++j) {
      const Parameter& parameter = task.searched(j);
      const auto at = static_cast<Eigen::Index>(j);
      names.push_back(parameter.name);
      start[at] = linear_solved->theta()[static_cast<std::size_t>(task.unknowns.searched[j])];
      if (result)
        for (const ParameterEstimate& estimate : result->parameters)
          if (estimate.name == parameter.name) start[at] = estimate.value;
      lower[at] = parameter.lower, upper[at] = parameter.upper;
    }
  }

  const Eigen::VectorXd& evaluate(const Eigen::VectorXd& theta, bool derivatives) {
    if (theta.size() != start.size()) throw std::invalid_argument("theta has another length than the free parameters");
    problem->evaluate(theta, derivatives);
    return problem->residual();
  }

  const FitJob job;
  const Task task;
  std::mutex mutex;
  std::unique_ptr<LeastSquares> problem;
  std::vector<std::string> names;
  Eigen::VectorXd start, lower, upper;
};

Objective::Objective(FitJob job) : parts_(std::make_unique<Parts>(std::move(job), nullptr)) {}
Objective::Objective(FitJob job, const FitResult& result) : parts_(std::make_unique<Parts>(std::move(job), &result)) {}
Objective::~Objective() = default;

const std::vector<std::string>& Objective::names() const { return parts_->names; }
const std::vector<int>& Objective::table_indices() const { return parts_->task.unknowns.searched; }
const Eigen::VectorXd& Objective::start() const { return parts_->start; }
const Eigen::VectorXd& Objective::lower() const { return parts_->lower; }
const Eigen::VectorXd& Objective::upper() const { return parts_->upper; }
Eigen::Index Objective::rows() const { return parts_->problem->residual().size(); }

Eigen::VectorXd Objective::residual(const Eigen::VectorXd& theta) const {
  const std::lock_guard lock(parts_->mutex);
  return parts_->evaluate(theta, false);
}

Eigen::MatrixXd Objective::jacobian(const Eigen::VectorXd& theta) const {
  const std::lock_guard lock(parts_->mutex);
  parts_->evaluate(theta, true);
  return parts_->problem->searched_columns();
}

double Objective::log_posterior(const Eigen::VectorXd& theta) const {
  if (theta.size() != parts_->start.size())
    throw std::invalid_argument("theta has another length than the free parameters");
  for (Eigen::Index j = 0; j < theta.size(); ++j)
    if (!(theta[j] >= parts_->lower[j] && theta[j] <= parts_->upper[j]))
      return -std::numeric_limits<double>::infinity();
  const std::lock_guard lock(parts_->mutex);
  return -0.5 * parts_->evaluate(theta, false).squaredNorm();
}

}  // namespace birefit
