#include "fit/search/everywhere.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <optional>
#include <utility>

namespace birefit::estimation {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;
constexpr int kSteps = 8;  // of the solver, before the worst are dropped

bool is_asked(const Task& task, const std::vector<PicturePhase>& phases, std::size_t j) {
  return !task.searched(j).nuisance && phases[j].total() > 0;
}
bool is_stated(const Parameter& parameter) { return parameter.nuisance && parameter.prior_sd; }

std::vector<Eigen::VectorXd> best_of_spread(LeastSquares& problem, const Task& task,
                                            const std::vector<PicturePhase>& phases, const Eigen::VectorXd& from) {
  constexpr double kOfATurn = 8, kFewest = 64, kMost = 512, kReach = 2;
  constexpr std::size_t kBest = 24;
  double turns = 1;
  for (std::size_t j = 0; j < phases.size(); ++j)
    if (is_asked(task, phases, j)) turns *= std::max(1.0, phases[j].total() / kTurn);
  std::vector<std::pair<double, Eigen::VectorXd>> places;
  const int count = static_cast<int>(std::clamp(kOfATurn * turns, kFewest, kMost));
  for (int i = 0; i < count && !task.interrupted(); ++i) {
    Eigen::VectorXd x = from;
    const std::vector<double> share = spread_in_box(i, phases.size());
    for (std::size_t j = 0; j < phases.size(); ++j) {
      const Parameter& parameter = task.searched(j);
      double& at = x[static_cast<Eigen::Index>(j)];
      if (is_asked(task, phases, j))
        at = phases[j].value_at(share[j] * phases[j].total());
      else if (is_stated(parameter))
        at = std::clamp(parameter.value + kReach * (2 * share[j] - 1) * *parameter.prior_sd, parameter.lower,
                        parameter.upper);
    }
    problem.evaluate(x, false);
    if (std::isfinite(problem.objective())) places.emplace_back(problem.objective(), std::move(x));
  }
  std::stable_sort(places.begin(), places.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<Eigen::VectorXd> best;
  for (auto& place : places)
    if (best.size() < kBest) best.push_back(std::move(place.second));
  return best;
}

/// What is asked for and turns fringes, and what may be furthest off of what is stated, in turns.
std::vector<std::size_t> turning(const Task& task, const std::vector<PicturePhase>& phases) {
  std::vector<std::size_t> axes;
  std::optional<std::size_t> furthest;
  double most = 0;
  for (std::size_t j = 0; j < phases.size(); ++j) {
    if (!phases[j].of_fringes) continue;
    const Parameter& parameter = task.searched(j);
    if (is_asked(task, phases, j)) axes.push_back(j);
    if (!is_stated(parameter)) continue;
    const double off = std::abs(phases[j].at(parameter.value + *parameter.prior_sd) - phases[j].at(parameter.value));
    if (off > most) most = off, furthest = j;
  }
  if (furthest) axes.push_back(*furthest);
  return axes;
}

/// One turn to either side of a place along these. What turns no fringes and has run far from what is stated, to make
/// up for a wrong order, is as it is stated again.
std::vector<Eigen::VectorXd> orders_beside(const Task& task, const std::vector<PicturePhase>& phases,
                                           const std::vector<std::size_t>& axes, const Eigen::VectorXd& place) {
  constexpr double kFar = 3;  // standard deviations
  Eigen::VectorXd from = place;
  for (std::size_t j = 0; j < phases.size(); ++j) {
    const Parameter& parameter = task.searched(j);
    double& at = from[static_cast<Eigen::Index>(j)];
    if (is_stated(parameter) && !phases[j].of_fringes && std::abs(at - parameter.value) > kFar * *parameter.prior_sd)
      at = parameter.value;
  }
  std::vector<Eigen::VectorXd> beside{place};
  if (from != place) beside.push_back(from);
  for (const std::size_t j : axes) {
    const double here = phases[j].at(from[static_cast<Eigen::Index>(j)]);
    for (const double there : {here - kTurn, here + kTurn}) {
      if (!(there > 0 && there < phases[j].total())) continue;
      beside.push_back(from);
      beside.back()[static_cast<Eigen::Index>(j)] = phases[j].value_at(there);
    }
  }
  return beside;
}

/// Adds what is not there yet; says whether the best is a better one now.
bool merge(std::vector<Candidate>& known, std::vector<Candidate> found) {
  constexpr double kApart = 5, kBetter = 1;  // standard errors; of chi-square
  const double best = known.front().objective;
  for (Candidate& one : found) {
    const auto same = std::find_if(known.begin(), known.end(), [&](const Candidate& other) {
      return separation(other, one.searched) < kApart && separation(one, other.searched) < kApart;
    });
    if (same == known.end())
      known.push_back(std::move(one));
    else if (one.objective < same->objective)
      *same = std::move(one);
  }
  std::stable_sort(known.begin(), known.end(),
                   [](const Candidate& a, const Candidate& b) { return a.objective < b.objective; });
  return known.front().objective < best - kBetter;
}

/// With what a wrong model leaves over as the unit, in which priors count: numbers that run away from what is stated
/// are no better for a little less of it.
void rank_by_what_is_left(const Task& task, double rows, std::vector<Candidate>& candidates) {
  const double unit = std::max(1.0, candidates.front().objective / std::max(1.0, rows));
  const auto left = [&](const Candidate& candidate) {
    double prior = 0;
    for (std::size_t j = 0; j < task.unknowns.searched.size(); ++j)
      if (const Parameter& parameter = task.searched(j); parameter.prior_sd)
        prior +=
            std::pow((candidate.searched[static_cast<Eigen::Index>(j)] - parameter.value) / *parameter.prior_sd, 2);
    return (candidate.objective - prior) / unit + prior;
  };
  std::stable_sort(candidates.begin(), candidates.end(),
                   [&](const Candidate& a, const Candidate& b) { return left(a) < left(b); });
}

}  // namespace

ScanResult minima_everywhere(LeastSquares& problem, const Task& task, const Theta& theta,
                             std::vector<Eigen::VectorXd> starts) {
  const std::vector<PicturePhase> phases = picture_phases(problem, task, theta);
  std::vector<Eigen::VectorXd> spread = best_of_spread(problem, task, phases, starts.front());
  std::move(spread.begin(), spread.end(), std::back_inserter(starts));
  ScanResult result = polish(problem, task.job, std::move(starts), kSteps, {}, true);
  const std::vector<std::size_t> axes = turning(task, phases);
  // Orders are a long row, and the best one may be far along it from the first place found.
  constexpr int kRounds = 12, kWide = 3;
  std::vector<Eigen::VectorXd> been;
  for (int round = 0; round < kRounds && !result.interrupted; ++round) {
    const std::size_t of_the_best = round < kWide ? 4 : 2;
    std::vector<Eigen::VectorXd> beside;
    for (std::size_t i = 0; i < std::min(of_the_best, result.candidates.size()); ++i) {
      const Eigen::VectorXd& place = result.candidates[i].searched;
      if (std::find(been.begin(), been.end(), place) != been.end()) continue;
      been.push_back(place);
      std::vector<Eigen::VectorXd> of = orders_beside(task, phases, axes, place);
      std::move(of.begin(), of.end(), std::back_inserter(beside));
    }
    if (beside.empty()) break;
    ScanResult next = polish(problem, task.job, std::move(beside), kSteps, {}, true);
    result.points += next.points;
    result.interrupted = next.interrupted;
    if (!merge(result.candidates, std::move(next.candidates))) break;
  }
  rank_by_what_is_left(task, static_cast<double>(problem.pixel_rows()), result.candidates);
  return result;
}

}  // namespace birefit::estimation
