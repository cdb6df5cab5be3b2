// Values with standard errors, and where an interval is not value +- t standard errors.

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

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
  std::vector<Eigen::VectorXd>& known;  ///< places that profiles came by
  const Parameter& parameter() const { return task.job.parameters[task.unknowns.table_index(unknown)]; }
  Profile profile() const {
    return Profile(*optimum.problem, task.job, task.unknowns, optimum.searched, of_noise.covariance, unknown, known);
  }
};

/// A place on a profile, and how far all unknowns are there from the estimate.
struct Place {
  double value = 0;
  Eigen::VectorXd change;
};
Place place_at(const Question& q, const Profile& profile, double value) {
  q.optimum.problem->evaluate(profile.place_nearest(value), false);
  Place place{value, Eigen::VectorXd(q.task.unknowns.size())};
  for (int j = 0; j < q.task.unknowns.size(); ++j) {
    const auto at = static_cast<std::size_t>(q.task.unknowns.table_index(j));
    place.change[j] = q.optimum.problem->theta()[at] - q.optimum.theta[at];
  }
  return place;
}

/// Nor has a model that misses the picture by many times its noise a likelihood to follow: it is as wrong elsewhere.
/// (By the result: profiles of others have moved the problem.)
bool misses_by_far(const FitResult& result) {
  constexpr double kMissed = 10;
  return result.reduced_chi_square > kMissed;
}

/// Where the profile likelihood of a searched unknown, going up from the estimate, leaves 95 % one-sided confidence;
/// nothing when it stays below that up to the bound, or when the physical limit at its lower bound is itself excluded.
/// Needed where the curvature at the estimate says nothing: a director below its threshold hardly answers to the
/// voltage, above it does.
std::optional<Place> upper_limit(const Question& q) {
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
    return place_at(q, profile, outside);
  }
  return std::nullopt;
}

/// Whether at the place of a profile nearest to a value what is stated lies so far away that normal priors would make
/// most of this rise: what has flattened there is the priors' heavy tails and not the likelihood.
bool flattened_by_priors(const Question& q, const Profile& profile, double value, double rise) {
  constexpr double kMost = 0.5;
  const Eigen::VectorXd& place = profile.place_nearest(value);
  double by_priors = 0;
  for (std::size_t j = 0; j < q.task.unknowns.searched.size(); ++j)
    if (const Parameter& parameter = q.task.searched(j); parameter.nuisance && parameter.prior_sd)
      by_priors += std::pow((place[static_cast<Eigen::Index>(j)] - parameter.value) / *parameter.prior_sd, 2);
  return by_priors > kMost * rise;
}

/// value +- t stderr where the objective is a parabola that far and twice as far; else the places where the profile
/// likelihood has fallen as much, or half as far as those where it has fallen four times as much: beyond the edge of an
/// interval there may be a plateau. What models err by is added to either half. `beside_untold`: it becomes no
/// narrower.
void settle_interval(const Question& q, bool beside_untold, ParameterEstimate& estimate) {
  const auto unknown = static_cast<std::size_t>(q.unknown);
  const double t = student_t_quantile(0.975, q.result.interval_degrees_of_freedom);
  const double sd = std::sqrt(q.of_noise.covariance(q.unknown, q.unknown));
  if (q.optimum.stopped || !std::isfinite(t * sd) || !(sd > 0) || q.of_noise.undetermined[unknown]) return;
  // A joint prior is itself the parabola that an earlier fit was taken for: followed far along its valley it bends
  // where the earlier data do not (docs/methods.md, "Profiles").
  if (q.task.job.prior) return;
  const Parameter& parameter = q.parameter();
  if (misses_by_far(q.result)) return;
  // What noise does to it is lost in what the model leaves out, however its likelihood bends.
  constexpr double kOfError = 0.1;
  if (sd < kOfError * estimate.stderr_) return;
  // A valley longer than the bounds is no interval but a verdict.
  if (!(t * sd < parameter.upper - parameter.lower)) return;
  constexpr double kBent = 0.1, kBentFar = 0.2;  // 5 % of the interval
  // A crossing nearer than kLeast of the curvature's is a place where the solver failed, not the end of an interval.
  constexpr double kFar = 2, kPlateau = 1.5, kLeast = 1e-3;
  Profile profile = q.profile();
  const auto bent = [&](double reach, double by) {
    const std::array<double, 2> straight = profile.straightness(reach * reach);
    return std::abs(straight[0] - 1) > by || std::abs(straight[1] - 1) > by;
  };
  const bool far = bent(kFar * t, kBentFar);
  if (!far && !bent(t, kBent)) return;
  // A bound that the data do not exclude is no end of the interval.
  const auto half = [&](double end) {
    const auto reaching = [&](double reach) {
      const double to = profile.crossing(end, reach * reach), length = std::abs(to - estimate.value) * t / reach;
      return to == end || !(length > kLeast * t * sd) ? std::max(length, t * sd) : length;
    };
    const double near = reaching(t), beyond = far ? reaching(kFar * t) : 0;
    if (!(beyond > kPlateau * near)) return near;
    const double there = estimate.value + (end > estimate.value ? 1 : -1) * kFar * beyond;
    return flattened_by_priors(q, profile, there, kFar * kFar * t * t) ? near : beyond;
  };
  const double least = beside_untold ? t * sd : 0, low = std::max(least, half(parameter.lower)),
               high = std::max(least, half(parameter.upper));
  q.known = profile.places();
  constexpr double kBetter = 1;  // of chi-square
  if (profile.lowest() < -kBetter) q.optimum.better = profile.lowest_place();
  if (std::abs(low / (t * sd) - 1) < 0.5 * kBent && std::abs(high / (t * sd) - 1) < 0.5 * kBent)
    return;  // only the way there was bent
  const double more = std::max(0.0, t * t * (estimate.stderr_ * estimate.stderr_ - sd * sd));
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
  if (parameter.nuisance) return false;  // contradicted, and named as that
  const double width = parameter.upper - parameter.lower;
  const double close = std::isfinite(width) ? 1e-6 * width : 1e-9 * std::abs(estimate.value);
  const bool at_lower = estimate.value <= parameter.lower + close && gradient >= 0;
  const bool at_upper = estimate.value >= parameter.upper - close && gradient <= 0;
  if (!at_lower && !at_upper) return false;
  estimate.at_bound = true;
  const bool physical =
      at_lower ? parameter.lower == parameter.physical_lower : parameter.upper == parameter.physical_upper;
  if (!physical) {
    result.pinned = true;
    // Held at a bound it was not estimated: an error that the data would leave it if it could move is no error of this
    // value.
    if (estimate.linear)
      estimate.stderr_ = estimate.interval95_low = estimate.interval95_high = std::numeric_limits<double>::quiet_NaN();
  }
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

namespace {

/// Of a searched unknown that nature keeps from falling any further, and that no bound of the user's holds.
bool may_have_a_limit(const Question& q, const ParameterEstimate& estimate, bool at_upper) {
  const bool limited = !estimate.limit.empty() && estimate.limit_value < q.parameter().upper;
  return !estimate.linear && q.parameter().lower == q.parameter().physical_lower && !limited && !at_upper;
}

/// What others owe to an unknown that lies anywhere between the estimate and this place, `t` standard errors away:
/// where the picture answers to its square, as at nature's zero, no curvature at the estimate says so.
void pay_for(const Place& place, double t, int unknown, FitResult& result) {
  Eigen::VectorXd change = place.change / t;
  change[unknown] = 0;
  result.covariance += change * change.transpose();
}

/// What is known on both sides of an unknown whose slope at the estimate says next to nothing.
struct Turn {
  std::optional<std::array<double, 2>> ends;  ///< of its interval, where its likelihood excludes both bounds
  bool up_to_bound = false;                   ///< it does not: nothing tells where between
  std::vector<Place> places;                  ///< the ends, or the bounds that are not excluded
  ProfileTrace trace;
};

Turn turning_point(const Question& q, double t) {
  if (q.unknown >= static_cast<int>(q.task.unknowns.searched.size()) || q.optimum.stopped || !q.optimum.converged ||
      misses_by_far(q.result))
    return {};
  // (Asked before there is a profile, which evaluates.)
  if (is_known_there(q.task.job, q.parameter(), t * std::sqrt(q.of_noise.covariance(q.unknown, q.unknown)))) return {};
  Turn turn;
  Profile profile = q.profile();
  turn.ends = profile.about_turning_point(t * t);
  constexpr double kBetter = 1;  // of chi-square
  if (turn.ends && profile.lowest() < -kBetter) q.optimum.better = profile.lowest_place();
  if (turn.ends)
    for (const double end : *turn.ends) turn.places.push_back(place_at(q, profile, end));
  else
    for (const double bound : {q.parameter().lower, q.parameter().upper})
      if (profile.rise(bound, t * t) <= t * t)
        turn.places.push_back(place_at(q, profile, bound)), turn.up_to_bound = true;
  turn.trace = profile.trace();
  return turn;
}

/// An unknown with both ends, and what others owe to it, are in the covariance then.
void settle_turning_point(const Turn& turn, double t, int unknown, FitResult& result) {
  result.covariance.row(unknown).setZero();
  result.covariance.col(unknown).setZero();
  for (const Place& place : turn.places) pay_for(place, std::numbers::sqrt2 * t, unknown, result);
  result.covariance(unknown, unknown) = std::pow(0.5 * ((*turn.ends)[1] - (*turn.ends)[0]) / t, 2);
  result.profiles.push_back(turn.trace);
}

/// What others owe to an unknown that may lie anywhere up to a bound: by as much as they follow it there further than
/// the slopes at the estimate say.
void pay_up_to_bounds(const Question& q, const Turn& turn, double t) {
  const double variance = q.of_noise.covariance(q.unknown, q.unknown);
  for (Place place : turn.places) {
    const double moved = place.change[q.unknown];
    if (variance > 0 && std::isfinite(variance))
      place.change -= q.of_noise.covariance.col(q.unknown) * (moved / variance);
    pay_for(place, t, q.unknown, q.result);
  }
}

/// t standard errors of what the fit itself has found; what is stated has a standard deviation that is no estimate.
double half_width(const FitResult& result, int unknown, double t) {
  const double all = result.covariance(unknown, unknown),
               stated = std::min(result.stated_covariance(unknown, unknown), all), normal = normal_quantile(0.975);
  return std::sqrt(t * t * (all - stated) + normal * normal * stated);
}

}  // namespace

void report_parameters(const Task& task, Optimum& optimum, const Inverse& of_noise, FitResult& result) {
  const Eigen::VectorXd gradient = optimum.problem->gradient();
  const double t = student_t_quantile(0.975, result.interval_degrees_of_freedom);
  std::vector<Eigen::VectorXd> known;
  const auto question = [&](int j) { return Question{task, optimum, of_noise, result, j, known}; };
  // The curvature at the estimate need not be that of the way to nature's bound: ask there.
  std::vector<std::optional<Place>> limits(static_cast<std::size_t>(task.unknowns.size()));
  std::vector<Turn> turns(limits.size());
  for (int j = 0; j < task.unknowns.size(); ++j) {
    ParameterEstimate estimate = estimate_of(task, optimum, result.covariance, j);
    FitResult unused;
    const bool at_upper = settle_at_bound(question(j).parameter(), gradient[j], estimate, unused);
    auto& limit = limits[static_cast<std::size_t>(j)];
    if (may_have_a_limit(question(j), estimate, at_upper)) limit = upper_limit(question(j));
    if (limit) pay_for(*limit, t, j, result);
    if (!limit && !estimate.at_bound) turns[static_cast<std::size_t>(j)] = turning_point(question(j), t);
  }
  // About a place where one unknown is not told, the solver of another's profile may stay: such a profile may widen
  // what the slopes say, and never narrow it.
  const bool open = std::any_of(turns.begin(), turns.end(), [](const Turn& turn) { return turn.up_to_bound; });
  for (int j = 0; j < task.unknowns.size(); ++j) {
    Turn& turn = turns[static_cast<std::size_t>(j)];
    if (open) turn.ends.reset();
    if (turn.ends) settle_turning_point(turn, t, j, result);
    if (turn.up_to_bound) pay_up_to_bounds(question(j), turn, t);
  }
  for (int j = 0; j < task.unknowns.size(); ++j) {
    ParameterEstimate estimate = estimate_of(task, optimum, result.covariance, j);
    const double half = half_width(result, j, t);
    estimate.interval95_low = estimate.value - half;
    estimate.interval95_high = estimate.value + half;
    settle_at_bound(question(j).parameter(), gradient[j], estimate, result);
    if (const auto& limit = limits[static_cast<std::size_t>(j)]) {
      estimate.limit = "upper";
      estimate.limit_value = limit->value;
      estimate.interval95_low = question(j).parameter().lower;
      estimate.interval95_high = limit->value;
    }
    if (const auto& ends = turns[static_cast<std::size_t>(j)].ends) {
      estimate.interval95_low = (*ends)[0], estimate.interval95_high = (*ends)[1];
      estimate.profiled = true;
    }
    // (Of what is fitted along for its error alone no interval is reported.)
    else if (!estimate.linear && !estimate.at_bound && estimate.limit.empty() && !question(j).parameter().nuisance)
      settle_interval(question(j), open, estimate);
    result.names.push_back(question(j).parameter().name);
    result.parameters.push_back(std::move(estimate));
  }
  optimum.problem->evaluate(optimum.searched, true);  // profiles moved it
}

}  // namespace birefit::estimation
