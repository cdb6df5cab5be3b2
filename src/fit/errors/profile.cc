#include "fit/errors/profile.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace birefit::estimation {

bool is_known_there(const FitJob& job, const Parameter& parameter, double reach) {
  constexpr double kKnown = 0.25;
  const double width = parameter.upper - parameter.lower;
  return parameter.nuisance || parameter.prior_sd || job.prior || !std::isfinite(width) ||
         (reach > 0 && reach < kKnown * width);
}

Profile::Profile(LeastSquares& problem, const FitJob& job, const Unknowns& unknowns, const Eigen::VectorXd& best,
                 const Eigen::MatrixXd& covariance, int unknown, std::vector<Eigen::VectorXd> known)
    : problem_(problem), job_(job), unknowns_(unknowns), best_(best), unknown_(unknown), known_(std::move(known)) {
  const Eigen::Index p = best.size();
  const double variance = covariance(unknown, unknown);
  sd_ = std::sqrt(variance);
  direction_ = variance > 0 ? Eigen::VectorXd(covariance.col(unknown).head(p) / variance)
                            : Eigen::VectorXd(Eigen::VectorXd::Unit(p, unknown));
  problem_.evaluate(best_, false);
  least_ = problem_.objective();
  places_.push_back({best_[unknown_], 0, best_});
}

Eigen::VectorXd Profile::within_bounds(Eigen::VectorXd x, double value) const {
  for (Eigen::Index j = 0; j < x.size(); ++j) {
    const Parameter& parameter = job_.parameters[unknowns_.searched[static_cast<std::size_t>(j)]];
    x[j] = std::clamp(x[j], parameter.lower, parameter.upper);
  }
  x[unknown_] = value;
  return x;
}

Eigen::VectorXd Profile::along(const Eigen::VectorXd& from, double value) const {
  return within_bounds(from + (value - from[unknown_]) * direction_, value);
}

/// Of three guesses that at which the objective is lowest: the straight way, Hermite's polynomial through the estimate,
/// with its slope, and the one or two nearest places, and where another unknown's profile came by.
Eigen::VectorXd Profile::start_at(double value) {
  constexpr double kApart = 0.2;  // places closer than that, relative to their distance, tell no bend
  const double from = best_[unknown_], u = value - from;
  const Eigen::VectorXd straight = along(place_nearest(value), value);
  const auto bend = [&](const Place& place) -> Eigen::VectorXd {
    const double there = place.value - from;
    return (place.searched - best_ - there * direction_) / (there * there);
  };
  const auto nearest = [&](const Place* other) {
    const Place* found = nullptr;
    for (const Place& place : places_)
      if (std::abs(place.value - from) > kApart * std::abs(u) && std::isfinite(place.rise) &&
          (!other || std::abs(place.value - other->value) > kApart * std::abs(u)) &&
          (!found || std::abs(place.value - value) < std::abs(found->value - value)))
        found = &place;
    return found;
  };
  std::vector<Eigen::VectorXd> starts{straight};
  if (const Place* first = nearest(nullptr); first && std::abs(u) > 0) {
    Eigen::VectorXd bent = bend(*first);
    if (const Place* second = nearest(first))
      bent += (bend(*second) - bent) * ((value - first->value) / (second->value - first->value));
    starts.push_back(within_bounds(best_ + u * direction_ + u * u * bent, value));
  }
  const auto near = std::min_element(known_.begin(), known_.end(), [&](const auto& a, const auto& b) {
    return std::abs(a[unknown_] - value) < std::abs(b[unknown_] - value);
  });
  if (near != known_.end()) starts.push_back(along(*near, value));
  if (starts.size() == 1) return straight;
  std::vector<double> objective;
  for (const Eigen::VectorXd& start : starts)
    problem_.evaluate(start, false), objective.push_back(problem_.objective());
  return starts[static_cast<std::size_t>(std::min_element(objective.begin(), objective.end()) - objective.begin())];
}

double Profile::rise(double value, double enough) {
  Eigen::VectorXd x = start_at(value);
  problem_.evaluate(x, false);
  if (problem_.objective() - least_ > enough) {
    SolveOptions options;
    options.max_iterations = 20;
    options.function_tolerance = std::max(1e-9, 2e-3 / std::max(1.0, least_));  // 2e-3 of a chi-square unit
    options.held = unknown_;
    options.interrupted = job_.options.interrupted;
    problem_.solve(x, options);
  }
  places_.push_back({value, problem_.objective() - least_, x});
  return places_.back().rise;
}

double Profile::crossing(double end, double allowed) {
  const std::optional<double> place = newton_crossing(end, allowed);
  return place ? *place : bisected_crossing(end, allowed);
}

/// At each place the Gauss-Newton model of the objective says where the others want to go, how far that lowers it, and
/// how the lowered objective goes on with the unknown: one image with derivatives instead of a whole fit. Nothing where
/// the model leads to bounds or does not converge in a few places.
std::optional<double> Profile::newton_crossing(double end, double allowed) {
  constexpr int kMostPlaces = 8;
  const Eigen::Index p = best_.size();
  const double from = best_[unknown_], wanted = std::sqrt(allowed), sign = end < from ? -1 : 1;
  const auto limited = [&](double v) { return sign * (end - v) < 0 ? end : v; };
  const auto within = [&](const Eigen::VectorXd& x) {
    for (Eigen::Index j = 0; j < p; ++j) {
      const Parameter& parameter = job_.parameters[unknowns_.searched[static_cast<std::size_t>(j)]];
      if (j != unknown_ && !(x[j] > parameter.lower && x[j] < parameter.upper)) return false;
    }
    return true;
  };
  const double first = limited(from + sign * wanted * sd_);
  Eigen::VectorXd x = start_at(first);
  double fall_before = std::numeric_limits<double>::infinity();
  problem_.evaluate(x, false);
  // A valley so bent that its straight line leaves it by far: a place on the way tells how it bends.
  constexpr double kLeft = 5, kNear = 0.25, kConverges = 0.5;
  if (problem_.objective() - least_ > kLeft * allowed) {
    rise(from + kNear * (first - from));
    x = start_at(first);
  }
  for (int i = 0; i < kMostPlaces && within(x); ++i) {
    if (job_.options.interrupted && *job_.options.interrupted) return std::nullopt;
    problem_.evaluate(x, true);
    const double value = x[unknown_], here = problem_.objective() - least_;
    // |c + R d|^2 is the objective near x but for a constant; the columns in units of their length.
    Eigen::MatrixXd r = problem_.factor();
    const Eigen::VectorXd c =
        r.transpose().triangularView<Eigen::Lower>().solve(Eigen::VectorXd(0.5 * problem_.gradient()));
    const Eigen::VectorXd length = r.colwise().norm();
    r.array().rowwise() /= length.transpose().array();
    const Eigen::VectorXd own = r.col(unknown_);
    r.col(unknown_).setZero();
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> others(r);
    const Eigen::VectorXd wish = others.solve(-c), follow = others.solve(-own);
    const Eigen::VectorXd rest = c + r * wish, free = own + r * follow;
    const double fall = c.squaredNorm() - rest.squaredNorm(), rise = here - fall;
    const double slope = rest.dot(free), curvature = free.squaredNorm();
    if (!std::isfinite(rise + slope + curvature) || !(curvature > 0)) return std::nullopt;
    const Eigen::VectorXd step = (wish.array() / length.array()).head(p);
    if (fall > allowed) {  // first to where the others want to be
      if (!(fall < kConverges * fall_before)) return std::nullopt;
      fall_before = fall;
      x += step;
      x[unknown_] = value;
      continue;
    }
    if (std::abs(fall) < 0.02 * allowed) {
      Eigen::VectorXd there = x + step;
      there[unknown_] = value;
      places_.push_back({value, rise, there});
      if (std::abs(std::sqrt(std::max(0.0, rise)) - wanted) < 0.01 * wanted || (value == end && rise < allowed))
        return value;
    }
    const double discriminant = slope * slope + curvature * (allowed - rise);
    if (!(discriminant >= 0)) return std::nullopt;
    const double forward = (-slope + sign * std::sqrt(discriminant)) / curvature / length[unknown_];
    const double next = limited(value + std::clamp(forward, -wanted * sd_, wanted * sd_));
    if (!(sign * (next - from) > 0)) return std::nullopt;
    x += step + (follow.array() / length.array()).head(p).matrix() * ((next - value) * length[unknown_]);
    x[unknown_] = next;
  }
  return std::nullopt;
}

std::optional<std::array<double, 2>> Profile::about_turning_point(double allowed) {
  const Parameter& parameter = job_.parameters[unknowns_.searched[static_cast<std::size_t>(unknown_)]];
  if (is_known_there(job_, parameter, std::sqrt(allowed) * sd_)) return std::nullopt;
  std::array<double, 2> ends{parameter.lower, parameter.upper};
  for (const double end : ends)
    if (!(rise(end, allowed) > allowed)) return std::nullopt;
  for (double& end : ends) end = bisected_crossing(end, allowed);
  return ends;
}

double Profile::bisected_crossing(double end, double allowed) {
  const double from = best_[unknown_], wanted = std::sqrt(allowed), sign = end < from ? -1 : 1;
  const auto limited = [&](double v) { return sign * (end - v) < 0 ? end : v; };
  double inside = from, root_inside = 0, outside = end, root_outside = -1;  // root of the rise; -1: not known
  // (Without a slope there is no step to start by.)
  double value = sd_ > 0 ? limited(from + sign * wanted * sd_) : end;
  int from_inside = 0;
  for (int i = 0; i < 16; ++i) {
    const double root = std::sqrt(std::max(0.0, rise(value)));
    if (std::abs(root - wanted) < 0.01 * wanted) return value;
    if (root < wanted) {
      if (value == end) return end;
      inside = value, root_inside = root, ++from_inside;
    } else {
      outside = value, root_outside = root, from_inside = 0;
    }
    if (root_outside < 0) {  // the root grows next to linearly: on by its slope, at most twice as far
      const double factor = root > 0 ? std::min(2.0, wanted / root * 1.02) : 2.0;
      value = limited(from + (value - from) * std::max(1.05, factor));
    } else {
      // A root that grows as the square keeps chords on the inside: then by halves.
      constexpr int kChords = 3;
      const double fraction = from_inside > kChords ? 0.5 : (wanted - root_inside) / (root_outside - root_inside);
      value = inside + (outside - inside) * std::clamp(fraction, 0.05, 0.95);
    }
  }
  return outside;
}

double Profile::lowest() const {
  return std::min_element(places_.begin(), places_.end(),
                          [](const Place& a, const Place& b) { return a.rise < b.rise; })
      ->rise;
}

const Eigen::VectorXd& Profile::lowest_place() const {
  return std::min_element(places_.begin(), places_.end(),
                          [](const Place& a, const Place& b) { return a.rise < b.rise; })
      ->searched;
}

const Eigen::VectorXd& Profile::place_nearest(double value) const {
  return std::min_element(
             places_.begin(), places_.end(),
             [&](const Place& a, const Place& b) { return std::abs(a.value - value) < std::abs(b.value - value); })
      ->searched;
}

std::array<double, 2> Profile::straightness(double allowed) {
  std::array<double, 2> ratio{1, 1};
  const Parameter& parameter = job_.parameters[unknowns_.searched[static_cast<std::size_t>(unknown_)]];
  for (const int side : {0, 1}) {
    const double value =
        std::clamp(best_[unknown_] + (side ? 1 : -1) * std::sqrt(allowed) * sd_, parameter.lower, parameter.upper);
    const double share = (value - best_[unknown_]) / sd_;
    if (!(share * share > 0.01 * allowed)) continue;
    problem_.evaluate(along(best_, value), false);
    ratio[static_cast<std::size_t>(side)] = (problem_.objective() - least_) / (share * share);
  }
  return ratio;
}

std::vector<Eigen::VectorXd> Profile::places() const {
  std::vector<Eigen::VectorXd> all = known_;
  for (const Place& place : places_)
    if (place.rise > 0) all.push_back(place.searched);
  return all;
}

ProfileTrace Profile::trace() const {
  std::vector<Place> places = places_;
  std::sort(places.begin(), places.end(), [](const Place& a, const Place& b) { return a.value < b.value; });
  ProfileTrace trace;
  trace.name = job_.parameters[unknowns_.searched[static_cast<std::size_t>(unknown_)]].name;
  for (const Place& place : places) trace.value.push_back(place.value), trace.rise.push_back(place.rise);
  return trace;
}

}  // namespace birefit::estimation
