// Values with standard errors, and where an interval is not value +- t standard errors.

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "fit/errors/profile.h"
#include "fit/errors/report.h"

namespace birefit::estimation {
namespace {

/// One searched unknown on the profile of its likelihood.
struct Question {
  const Task& task;
  Optimum& optimum;
  const Inverse& of_noise;
  FitResult& result;
  int unknown;
  const Parameter& parameter() const { return task.job.parameters[task.unknowns.table_index(unknown)]; }
  Profile profile() const {
    return Profile(*optimum.problem, task.job, task.unknowns, optimum.searched, of_noise.covariance, unknown);
  }
};

/// Where the profile likelihood of a searched unknown, going up from the estimate, leaves 95 % one-sided confidence;
/// nothing when it stays below that up to the bound, or when the physical limit at its lower bound is itself excluded.
/// Needed where the curvature at the estimate says nothing: a director below its threshold hardly answers to the
/// voltage, above it does.
std::optional<double> upper_limit(const Question& q) {
  const Parameter& parameter = q.parameter();
  const std::optional<JointPrior>& joint = q.task.job.prior;
  const bool prior =
      parameter.prior_sd || (joint && std::count(joint->names.begin(), joint->names.end(), parameter.name) > 0);
  if (prior || q.optimum.stopped || !std::isfinite(parameter.upper)) return std::nullopt;
  const double allowed = std::pow(student_t_quantile(0.95, q.result.interval_degrees_of_freedom), 2);
  Profile profile = q.profile();
  if (profile.rise(parameter.lower, allowed) > allowed) return std::nullopt;
  constexpr int kSteps = 40, kHalvings = 12;  // the limit to 1e-5 of the range
  double inside = q.optimum.theta[static_cast<std::size_t>(q.task.unknowns.table_index(q.unknown))];
  const double step = (parameter.upper - inside) / kSteps;
  for (int i = 1; i <= kSteps; ++i) {
    const double value = i == kSteps ? parameter.upper : inside + step;
    if (profile.rise(value, allowed) <= allowed) {
      inside = value;
      continue;
    }
    double outside = value;
    for (int k = 0; k < kHalvings; ++k) {
      const double middle = 0.5 * (inside + outside);
      (profile.rise(middle, allowed) <= allowed ? inside : outside) = middle;
    }
    return outside;
  }
  return std::nullopt;
}

/// value +- t stderr where the objective is a parabola that far; else the places where the profile likelihood has
/// fallen as much. What models err by is added to either half.
void settle_interval(const Question& q, ParameterEstimate& estimate) {
  const auto unknown = static_cast<std::size_t>(q.unknown);
  const double t = student_t_quantile(0.975, q.result.interval_degrees_of_freedom);
  const double sd = std::sqrt(q.of_noise.covariance(q.unknown, q.unknown));
  if (q.optimum.stopped || !std::isfinite(t * sd) || !(sd > 0) || q.of_noise.undetermined[unknown]) return;
  // A joint prior is itself the parabola that an earlier fit was taken for: followed far along its valley it bends
  // where the earlier data do not (docs/methods.md, "Profiles").
  if (q.task.job.prior) return;
  const Parameter& parameter = q.parameter();
  // A valley longer than the bounds is no interval but a verdict.
  if (!(t * sd < parameter.upper - parameter.lower)) return;
  constexpr double kBent = 0.1;  // 5 % of the interval
  Profile profile = q.profile();
  const std::array<double, 2> straight = profile.straightness(t * t);
  if (std::abs(straight[0] - 1) < kBent && std::abs(straight[1] - 1) < kBent) return;
  // A bound that the data do not exclude is no end of the interval.
  const auto half = [&](double end) {
    const double to = profile.crossing(end, t * t), length = std::abs(to - estimate.value);
    return to == end ? std::max(length, t * sd) : length;
  };
  const double low = half(parameter.lower), high = half(parameter.upper);
  if (profile.lowest() < -1)
    q.result.warnings.push_back(fmt::format(
        "A better fit by {:.2g} in chi-square was met on the profile of {}: the solver had not reached the minimum.",
        -profile.lowest(), parameter.name));
  if (std::abs(low / (t * sd) - 1) < 0.5 * kBent && std::abs(high / (t * sd) - 1) < 0.5 * kBent)
    return;  // only the way there was bent
  const double more = t * t * (estimate.stderr_ * estimate.stderr_ - sd * sd);
  estimate.interval95_low = estimate.value - std::sqrt(low * low + more);
  estimate.interval95_high = estimate.value + std::sqrt(high * high + more);
  estimate.profiled = true;
  q.result.profiles.push_back(profile.trace());
}

/// An unknown's value and what the table and the priors say of it, its standard error by `covariance`.
ParameterEstimate estimate_of(const Task& task, const Optimum& optimum, const Eigen::MatrixXd& covariance,
                              int unknown) {
  const int index = task.unknowns.table_index(unknown);
  const Parameter& parameter = task.job.parameters[index];
  ParameterEstimate estimate;
  estimate.name = parameter.name;
  estimate.unit = parameter.unit;
  estimate.value = optimum.theta[static_cast<std::size_t>(index)];
  estimate.stderr_ = std::sqrt(covariance(unknown, unknown));
  estimate.start = parameter.value;
  estimate.lower = parameter.lower;
  estimate.upper = parameter.upper;
  estimate.linear = unknown >= static_cast<int>(task.unknowns.searched.size());
  if (parameter.prior_sd) {
    estimate.prior_value = parameter.value;
    estimate.prior_sd = parameter.prior_sd;
  } else if (const std::optional<JointPrior>& joint = task.job.prior) {
    for (std::size_t k = 0; k < joint->names.size(); ++k)
      if (joint->names[k] == parameter.name) {
        const auto at = static_cast<Eigen::Index>(k);
        estimate.prior_value = joint->mean[at];
        estimate.prior_sd = std::sqrt(joint->covariance(at, at));
      }
  }
  return estimate;
}

/// An estimate at a bound that the data pull across: at nature's a limit, at the user's no answer. True at the upper
/// one.
bool settle_at_bound(const Parameter& parameter, double gradient, ParameterEstimate& estimate, FitResult& result) {
  const double width = parameter.upper - parameter.lower;
  const double close = std::isfinite(width) ? 1e-6 * width : 1e-9 * std::abs(estimate.value);
  const bool at_lower = estimate.value <= parameter.lower + close && gradient >= 0;
  const bool at_upper = estimate.value >= parameter.upper - close && gradient <= 0;
  if (!at_lower && !at_upper) return false;
  estimate.at_bound = true;
  const bool physical =
      at_lower ? parameter.lower == parameter.physical_lower : parameter.upper == parameter.physical_upper;
  if (!physical) result.pinned = true;
  if (physical && std::isfinite(estimate.stderr_) && estimate.stderr_ > 0) {
    // The likelihood is the tail of a normal whose top lies `outside` standard errors beyond the limit; with a flat
    // prior on the allowed side 95 % of that tail lie within `reach`.
    const double outside = std::min(30.0, 0.5 * std::abs(gradient) * estimate.stderr_);
    const double reach = -normal_quantile(0.05 * normal_cdf(-outside)) - outside;
    estimate.limit = at_lower ? "upper" : "lower";
    estimate.limit_value = estimate.value + (at_lower ? 1 : -1) * reach * estimate.stderr_;
    estimate.interval95_low = std::min(estimate.value, estimate.limit_value);
    estimate.interval95_high = std::max(estimate.value, estimate.limit_value);
  }
  return at_upper;
}

}  // namespace

void report_parameters(const Task& task, Optimum& optimum, const Inverse& of_noise, FitResult& result) {
  const Eigen::VectorXd gradient = optimum.problem->gradient();
  const double t = student_t_quantile(0.975, result.interval_degrees_of_freedom);
  for (int j = 0; j < task.unknowns.size(); ++j) {
    const Parameter& parameter = task.job.parameters[task.unknowns.table_index(j)];
    ParameterEstimate estimate = estimate_of(task, optimum, result.covariance, j);
    estimate.interval95_low = estimate.value - t * estimate.stderr_;
    estimate.interval95_high = estimate.value + t * estimate.stderr_;
    const bool at_upper = settle_at_bound(parameter, gradient[j], estimate, result);
    // The curvature at the estimate need not be that of the way to nature's bound: ask there.
    const bool limited = !estimate.limit.empty() && estimate.limit_value < parameter.upper;
    const Question question{task, optimum, of_noise, result, j};
    if (!estimate.linear && parameter.lower == parameter.physical_lower && !limited && !at_upper)
      if (const std::optional<double> limit = upper_limit(question)) {
        estimate.limit = "upper";
        estimate.limit_value = *limit;
        estimate.interval95_low = parameter.lower;
        estimate.interval95_high = *limit;
      }
    if (!estimate.linear && !estimate.at_bound && estimate.limit.empty()) settle_interval(question, estimate);
    result.names.push_back(parameter.name);
    result.parameters.push_back(std::move(estimate));
  }
  optimum.problem->evaluate(optimum.searched, true);  // profiles moved it
}

}  // namespace birefit::estimation
