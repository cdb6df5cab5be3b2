#include "fit/search/scan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <numeric>

#include <fmt/format.h>

#include "birefit/error.h"
#include "fit/errors/statistics.h"
#include "samples/kind.h"

namespace birefit::estimation {
namespace {

/// Of a grid, or places spread over the box of all axes: pictures of cells without a field cost microseconds.
constexpr std::size_t kMostPlaces = 3000, kMostPlacesOfCells = 6000;
/// Of places spread over the box, for every start that is wanted of them: who asks for one start states good ones.
constexpr std::size_t kPlacesOfAStart = 250;
constexpr int kMostPointsPerAxis = 400;
/// Fewer points than this could step over the valley of a parameter that also moves an edge.
constexpr int kFewestPointsOfFringes = 7, kFewestPoints = 3;
/// Radians a step. A cosine's square, which chi-square is made of, turns twice as fast: two or three steps a valley.
constexpr double kStepOfFringes = 1, kStep = 0.7;
/// A droplet's edge carries all of its rings: the largest step of a diameter, of its upper bound.
constexpr double kDiameterStep = 1.0 / 30;
/// Pictures that turn by less along all of an unknown have one valley there, which the solver follows.
constexpr double kOneValley = 4;
/// Of a grid that has axes of one valley, too.
constexpr std::size_t kMostPlacesWithoutNeed = 1000;
/// Of the best points of a grid, whose pictures cost next to nothing, that are starts beside its minima.
constexpr std::size_t kBesideMinima = 16;
/// Batches of starts looked at; the next one only where chi-square is more standard deviations above its expectation.
constexpr std::size_t kMostBatches = 4;
constexpr double kDoubtful = 5;
/// Of the solver, for every start of a batch.
constexpr int kFirstSteps = 2;

using Places = std::vector<std::pair<double, Eigen::VectorXd>>;  ///< objective, searched
bool lower(const Places::value_type& a, const Places::value_type& b) { return a.first < b.first; }

struct Axis {
  int searched = 0;
  PicturePhase steps;          ///< the phase, or more where steps have to be shorter
  std::vector<double> values;  ///< of the grid, ascending
};

/// Steps below `radians`, and below `longest`, however fast the picture turns where.
Axis axis_along(int searched, const PicturePhase& phase, double radians, double longest) {
  Axis axis{searched, {phase.value, {0}}, {}};
  for (std::size_t i = 1; i < phase.value.size(); ++i)
    axis.steps.radians.push_back(
        axis.steps.radians.back() +
        std::max((phase.radians[i] - phase.radians[i - 1]) / radians, (phase.value[i] - phase.value[i - 1]) / longest));
  const double total = axis.steps.total();
  const int points = static_cast<int>(std::clamp(std::ceil(total), 1.0, static_cast<double>(kMostPointsPerAxis)));
  // Cell middles: the bounds themselves are where models degenerate.
  for (int i = 0; i < points; ++i) axis.values.push_back(axis.steps.value_at(total * (i + 0.5) / points));
  return axis;
}

std::size_t product_of(const std::vector<Axis>& axes) {
  constexpr std::size_t kMany = 1000000;
  std::size_t product = axes.empty() ? 0 : 1;
  for (const Axis& axis : axes) product = std::min(product * axis.values.size(), kMany);
  return product;
}

/// What has several valleys, and what has one as long as the grid stays small: it moves the others' minima. `fineness`:
/// steps are so much shorter.
std::vector<Axis> axes_of(const Task& task, const std::vector<PicturePhase>& phases, double fineness = 1) {
  std::vector<Axis> axes;
  for (const bool of_fringes : {true, false})
    for (std::size_t j = 0; j < phases.size(); ++j) {
      if (phases[j].value.empty() || phases[j].of_fringes != of_fringes) continue;
      const Parameter& parameter = task.searched(j);
      double longest = (parameter.upper - parameter.lower) / (of_fringes ? kFewestPointsOfFringes : kFewestPoints);
      for (const Sight& sight : task.sights)
        if (const ParameterRef diameter = traits_of(sight.picture->scene).sphere_diameter_um;
            diameter && follows_from(task.job.parameters, diameter, task.unknowns.searched[j]))
          longest = std::min(longest, kDiameterStep * parameter.upper);
      Axis axis = axis_along(static_cast<int>(j), phases[j], (of_fringes ? kStepOfFringes : kStep) / fineness, longest);
      const bool needed = of_fringes || phases[j].total() > kOneValley;
      if (needed || product_of(axes) * axis.values.size() <= kMostPlacesWithoutNeed) axes.push_back(std::move(axis));
    }
  return axes;
}

/// Of several numbers known to a thousandth each a minimum may be far narrower than the phase of any: as fine a grid as
/// pictures of cells cost next to nothing for.
std::vector<Axis> fine_axes_of(const Task& task, const std::vector<PicturePhase>& phases) {
  constexpr double kFinest = 5, kFiner = 1.2;
  std::vector<Axis> axes = axes_of(task, phases);
  for (double fineness = kFiner; costs_microseconds(task) && fineness < kFinest; fineness *= kFiner) {
    std::vector<Axis> finer = axes_of(task, phases, fineness);
    if (product_of(finer) > kMostPlacesOfCells) break;
    axes = std::move(finer);
  }
  return axes;
}

/// Solves from every start, a few steps at a glance for all and the rest for those that may still be the best, and adds
/// the minima found to the result, those `beyond_reach` of the best only where asked. What is the `same` as a minimum
/// that is known is left out; of starts that lead to places near by the best goes on before others do, and the rest
/// after all others: minima may lie as close. Those that have `arrived` at one place, at a glance, go on as one. `same`
/// and `near_by` may be empty. Returns the lowest objective.
double polish_into(ScanResult& result, LeastSquares& glance, LeastSquares& problem, const FitOptions& options,
                   std::vector<std::pair<double, Eigen::VectorXd>> starts, std::size_t finalists, int steps,
                   double hopeless_above, const SameMinimum& same, const SameMinimum& near_by,
                   const SameMinimum& arrived, bool beyond_reach = false) {
  const auto by_objective = [](const auto& a, const auto& b) { return a.first < b.first; };
  SolveOptions polish;
  polish.function_tolerance = 1e-5;  // a few hundredths of a chi-square unit: all pixels follow
  polish.interrupted = options.interrupted;
  const auto walk = [&](LeastSquares& by, int iterations) {
    polish.max_iterations = iterations;
    for (auto& [objective, x] : starts) {
      if (result.interrupted) return;
      result.interrupted = by.solve(x, polish).interrupted;
      objective = std::isfinite(by.objective()) ? by.objective() : std::numeric_limits<double>::infinity();
    }
    std::stable_sort(starts.begin(), starts.end(), by_objective);
  };
  // Two steps tell whether a valley leads down.
  if (starts.size() > finalists + 1) {
    walk(glance, kFirstSteps);
    // Where most lead into one valley they would leave no room for the others.
    std::vector<std::pair<double, Eigen::VectorXd>> apart, besides;
    for (auto& start : starts)
      (near_by &&
               std::any_of(apart.begin(), apart.end(), [&](const auto& a) { return near_by(a.second, start.second); })
           ? besides
           : apart)
          .push_back(std::move(start));
    starts = std::move(apart);
    std::move(besides.begin(), besides.end(), std::back_inserter(starts));
    starts.resize(finalists);
  }
  if (&glance != &problem) {
    walk(glance, steps);
    // What has come together goes on as one.
    std::vector<std::pair<double, Eigen::VectorXd>> apart;
    for (auto& start : starts)
      if (std::none_of(apart.begin(), apart.end(), [&](const auto& a) { return arrived(a.second, start.second); }))
        apart.push_back(std::move(start));
    starts = std::move(apart);
  }
  walk(problem, steps);
  const double best = starts.front().first;
  const bool beaten = best > hopeless_above;
  for (const auto& [objective, from] : starts) {
    if (!std::isfinite(objective)) continue;
    if (beaten ? objective > best : !beyond_reach && !in_reach(objective, best)) continue;
    if (beaten) {
      problem.evaluate(from, true);
      result.candidates.push_back({from, problem.objective(), projected_information(problem)});
      break;
    }
    if (same && std::any_of(result.candidates.begin(), result.candidates.end(),
                            [&, at = from](const Candidate& known) { return same(known.searched, at); }))
      continue;
    Candidate candidate;
    candidate.searched = from;
    polish.max_iterations = 20;
    result.interrupted = problem.solve(candidate.searched, polish).interrupted || result.interrupted;
    candidate.objective = problem.objective();
    candidate.information = projected_information(problem);
    if (std::isfinite(candidate.objective)) result.candidates.push_back(std::move(candidate));
    if (result.interrupted && !result.candidates.empty()) break;
  }
  return best;
}

/// Of candidates from any number of starts, the distinct ones, best first; at least one, `start` itself if need be.
void keep_distinct(ScanResult& result, LeastSquares& problem, const Eigen::VectorXd& start) {
  if (result.candidates.empty()) {
    problem.evaluate(start, true);
    result.candidates.push_back({start, problem.objective(), projected_information(problem)});
  }
  std::stable_sort(result.candidates.begin(), result.candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.objective < b.objective; });
  // By both measures: where one is flat, at an extremum of the fringes, everything is near it. A few pixels know less
  // than all of them: what is near by their errors may be two minima, between which the objective rises.
  constexpr double kNear = 5, kRise = 1e-4;
  const auto one_valley = [&](const Candidate& a, const Candidate& b) {
    problem.evaluate(0.5 * (a.searched + b.searched), false);
    return problem.objective() <= (1 + kRise) * std::max(a.objective, b.objective);
  };
  std::vector<Candidate> distinct;
  for (Candidate& candidate : result.candidates) {
    const bool known = std::any_of(distinct.begin(), distinct.end(), [&](const Candidate& other) {
      return separation(other, candidate.searched) < kNear && separation(candidate, other.searched) < kNear &&
             one_valley(other, candidate);
    });
    if (!known) distinct.push_back(std::move(candidate));
  }
  result.candidates = std::move(distinct);
}

/// Spread evenly over the phases of the axes.
Eigen::VectorXd spread_point(int index, const std::vector<Axis>& axes, const Eigen::VectorXd& start) {
  Eigen::VectorXd x = start;
  const std::vector<double> share = spread_in_box(index, axes.size());
  for (std::size_t k = 0; k < axes.size(); ++k)
    x[axes[k].searched] = axes[k].steps.value_at(share[k] * axes[k].steps.total());
  return x;
}

/// Fewer than so many steps apart in everything.
bool near(const std::vector<Axis>& axes, const Eigen::VectorXd& a, const Eigen::VectorXd& b, double steps = 1) {
  return std::all_of(axes.begin(), axes.end(), [&](const Axis& axis) {
    return std::abs(axis.steps.at(a[axis.searched]) - axis.steps.at(b[axis.searched])) < steps;
  });
}

/// Where the objective is looked at before any solver starts.
class Survey {
 public:
  Survey(LeastSquares& problem, const Task& task, const std::vector<Axis>& axes, const Eigen::VectorXd& start,
         ScanResult& result)
      : problem_(problem), task_(task), axes_(axes), start_(start), result_(result) {}

  /// Every point of the product grid; its minima are points below their neighbours along every axis. A valley across
  /// the axes may have none where it is lowest: so many of the best points follow, two steps and more from each other
  /// and from the minima in something.
  Places minima_of_grid(std::size_t others) {
    const std::size_t product = product_of(axes_);
    std::vector<double> chi(product, std::numeric_limits<double>::infinity());
    for (std::size_t i = 0; i < product && !result_.interrupted; ++i) chi[i] = objective_at(point_at(i));
    trace_grid(chi);
    Places minima;
    for (std::size_t i = 0; i < product; ++i) {
      bool lowest = std::isfinite(chi[i]);
      std::size_t rest = i, step = 1;
      for (const Axis& axis : axes_) {
        const std::size_t size = axis.values.size(), at = rest % size;
        rest /= size;
        if (at > 0) lowest = lowest && chi[i] < chi[i - step];
        if (at + 1 < size) lowest = lowest && chi[i] <= chi[i + step];
        step *= size;
      }
      if (lowest) minima.emplace_back(chi[i], point_at(i));
    }
    std::stable_sort(minima.begin(), minima.end(), lower);
    if (others == 0) return minima;
    std::vector<std::size_t> order(product);
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return chi[a] < chi[b]; });
    for (std::size_t i = 0; i < product && others > 0 && std::isfinite(chi[order[i]]); ++i) {
      Eigen::VectorXd x = point_at(order[i]);
      constexpr double kApart = 1.5;
      if (std::any_of(minima.begin(), minima.end(), [&](const auto& m) { return near(axes_, x, m.second, kApart); }))
        continue;
      minima.emplace_back(chi[order[i]], std::move(x));
      --others;
    }
    return minima;
  }

  /// So many points spread evenly over the box, then each axis through the best of them, twice; of neighbours, less
  /// than a radian apart in everything, the best.
  Places best_of_box(std::size_t points, std::size_t wanted) {
    Places places;
    for (std::size_t i = 0; i < points && !result_.interrupted; ++i) {
      Eigen::VectorXd x = spread_point(static_cast<int>(i), axes_, start_);
      const double objective = objective_at(x);
      places.emplace_back(objective, std::move(x));
    }
    places.emplace_back(objective_at(start_), start_);
    for (int round = 0; round < 2 && !result_.interrupted; ++round)
      for (const Axis& axis : axes_) {
        ScanTrace trace{name_of(axis), axis.values, {}};
        Eigen::VectorXd x = std::min_element(places.begin(), places.end(), lower)->second;
        for (const double value : axis.values) {
          x[axis.searched] = value;
          trace.chi_square.push_back(result_.interrupted ? std::numeric_limits<double>::infinity() : objective_at(x));
          places.emplace_back(trace.chi_square.back(), x);
        }
        if (round == 1) result_.traces.push_back(std::move(trace));
      }
    std::stable_sort(places.begin(), places.end(), lower);
    Places apart;
    for (auto& place : places) {
      if (apart.size() >= wanted || !std::isfinite(place.first)) break;
      if (std::none_of(apart.begin(), apart.end(),
                       [&](const auto& other) { return near(axes_, place.second, other.second); }))
        apart.push_back(std::move(place));
    }
    return apart;
  }

 private:
  double objective_at(const Eigen::VectorXd& x) {
    ++result_.points;
    problem_.evaluate(x, false);
    result_.interrupted = result_.interrupted || task_.interrupted();
    const double objective = problem_.objective();
    return std::isfinite(objective) ? objective : std::numeric_limits<double>::infinity();
  }
  Eigen::VectorXd point_at(std::size_t flat) const {
    Eigen::VectorXd x = start_;
    for (const Axis& axis : axes_) {
      x[axis.searched] = axis.values[flat % axis.values.size()];
      flat /= axis.values.size();
    }
    return x;
  }
  const std::string& name_of(const Axis& axis) const {
    return task_.searched(static_cast<std::size_t>(axis.searched)).name;
  }
  void trace_grid(const std::vector<double>& chi) {
    std::size_t stride = 1;
    for (const Axis& axis : axes_) {
      ScanTrace trace{name_of(axis), axis.values, {}};
      trace.chi_square.assign(axis.values.size(), std::numeric_limits<double>::infinity());
      for (std::size_t i = 0; i < chi.size(); ++i) {
        double& best = trace.chi_square[i / stride % axis.values.size()];
        best = std::min(best, chi[i]);
      }
      stride *= axis.values.size();
      result_.traces.push_back(std::move(trace));
    }
  }

  LeastSquares& problem_;
  const Task& task_;
  const std::vector<Axis>& axes_;
  const Eigen::VectorXd& start_;
  ScanResult& result_;
};

/// How many starts are worth a few steps of the solver, and how many of them all the way. A batch takes no longer than
/// the grid did, but for a few starts that any fit deserves: images are the unit, a step of the solver takes one with a
/// derivative by every unknown.
struct Effort {
  std::size_t first_look = 0, finalists = 0, batches = 1;
};
constexpr int kSteps = 6;
Effort effort_of(const LeastSquares& problem, int points, int candidates) {
  constexpr int kFewest = 4;
  const int step_cost = 1 + problem.searched_size(), affordable = points / step_cost;
  Effort effort;
  effort.finalists =
      static_cast<std::size_t>(std::clamp(affordable / (2 * kSteps), std::min(kFewest, candidates), candidates));
  effort.first_look = static_cast<std::size_t>(
      std::clamp(affordable / (2 * kFirstSteps), static_cast<int>(effort.finalists), 4 * candidates));
  effort.batches = affordable > 4 * candidates * kFirstSteps ? kMostBatches : 1;
  return effort;
}

}  // namespace

bool in_reach(double objective, double best) {
  constexpr double kHopeless = 4, kReach = 60;
  return objective <= std::max(kHopeless * best, best + kReach);
}

bool costs_microseconds(const Task& task) {
  return std::all_of(task.sights.begin(), task.sights.end(),
                     [](const Sight& sight) { return traits_of(sight.picture->scene).quick; });
}

double separation(const Candidate& minimum, const Eigen::VectorXd& other) {
  if (minimum.searched.size() == 0) return 0;
  return (minimum.information * (other - minimum.searched)).norm();
}

double log_share(const Eigen::MatrixXd& information, const FitJob& job, const Unknowns& unknowns) {
  if (information.size() == 0) return 0;
  Eigen::MatrixXd in_widths = information;
  Eigen::VectorXd prior = Eigen::VectorXd::Ones(information.cols());
  for (Eigen::Index j = 0; j < in_widths.cols(); ++j) {
    const Parameter& parameter = job.parameters[unknowns.searched[static_cast<std::size_t>(j)]];
    const double width = parameter.upper - parameter.lower, of_gaussian = std::sqrt(2 * std::numbers::pi);
    // Bounds as the Gaussian that is as dense in its middle: variance width^2 / (2 pi). A prior is in the information
    // already. Without bounds a unit serves, which says something of the same parameters only.
    in_widths.col(j) *= (parameter.prior_sd     ? *parameter.prior_sd * of_gaussian
                         : std::isfinite(width) ? width
                                                : 1.0) /
                        of_gaussian;
    if (parameter.prior_sd) prior[j] = 0;
  }
  const Eigen::MatrixXd all = in_widths.transpose() * in_widths + Eigen::MatrixXd(prior.asDiagonal());
  return -0.5 * all.ldlt().vectorD().array().max(1e-300).log().sum();
}

Eigen::MatrixXd projected_information(const LeastSquares& problem) {
  const int p = problem.searched_size();
  return problem.projected_factor(Eigen::VectorXd::Ones(p)).topLeftCorner(p, p);
}

ScanResult scan(LeastSquares& glance, LeastSquares& problem, const Task& task, const Eigen::VectorXd& start,
                const std::vector<PicturePhase>& phases, double hopeless_above) {
  ScanResult result;
  const FitOptions& options = task.job.options;
  const std::vector<Axis> axes = fine_axes_of(task, phases);
  const bool cheap = costs_microseconds(task);
  const int candidates = std::max(1, options.scan_candidates) * (cheap ? 4 : 1);
  const std::size_t most = cheap ? kMostPlacesOfCells : kMostPlaces, product = product_of(axes);
  if (product > 0) task.say("scanning for the fringe order");
  Places starts;
  Survey survey(glance, task, axes, start, result);
  const std::size_t wanted = static_cast<std::size_t>(candidates);
  if (product > 0)
    starts = product <= most ? survey.minima_of_grid(cheap ? kBesideMinima : 0)
                             : survey.best_of_box(std::min(most, kPlacesOfAStart * wanted), 4 * kMostBatches * wanted);
  const Effort effort = effort_of(problem, result.points, candidates);
  const SameMinimum near_by = [&](const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
    return !axes.empty() && near(axes, a, b);
  };
  constexpr double kArrived = 0.1;  // steps of the grid
  const SameMinimum arrived = [&](const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
    return !axes.empty() && near(axes, a, b, kArrived);
  };
  // The most promising, and the user's start whatever the grid says. What describes the image badly is not yet
  // believed: the next ones, then, as long as there are any.
  const double rows = static_cast<double>(problem.pixel_rows());
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t batch = 0; batch < effort.batches && !result.interrupted; ++batch) {
    const std::size_t first = std::min(starts.size(), batch * effort.first_look),
                      last = std::min(starts.size(), first + effort.first_look);
    Places some(starts.begin() + static_cast<std::ptrdiff_t>(first),
                starts.begin() + static_cast<std::ptrdiff_t>(last));
    if (batch == 0) some.emplace_back(std::numeric_limits<double>::infinity(), start);
    if (some.empty()) break;
    // Beyond reach, too, where that is cheap: the right minimum may be far above one that takes a stated number as it
    // is.
    best = std::min(best, polish_into(result, glance, problem, options, std::move(some), effort.finalists, kSteps,
                                      hopeless_above, {}, near_by, arrived, cheap));
    // Where pictures cost next to nothing, all of them: minima may be as good as each other.
    if ((best < rows + kDoubtful * std::sqrt(2 * rows) && !cheap) || best > hopeless_above) break;
  }
  keep_distinct(result, problem, start);
  return result;
}

double lowest_of_few(LeastSquares& problem, const Task& task, const Eigen::VectorXd& start,
                     const std::vector<PicturePhase>& phases) {
  constexpr int kFew = 150;
  const std::vector<Axis> axes = axes_of(task, phases);
  double lowest = std::numeric_limits<double>::infinity();
  for (int i = -1; i < (axes.empty() ? 0 : kFew); ++i) {
    problem.evaluate(i < 0 ? start : spread_point(i, axes, start), false);
    if (std::isfinite(problem.objective())) lowest = std::min(lowest, problem.objective());
  }
  return lowest;
}

ScanResult polish(LeastSquares& problem, const FitJob& job, std::vector<Eigen::VectorXd> from, int steps,
                  const SameMinimum& same, bool all) {
  ScanResult result;
  std::vector<std::pair<double, Eigen::VectorXd>> starts;
  for (Eigen::VectorXd& x : from) {
    ++result.points;
    problem.evaluate(x, false);
    if (std::isfinite(problem.objective())) starts.emplace_back(problem.objective(), std::move(x));
  }
  std::stable_sort(starts.begin(), starts.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  constexpr int kMostOfDear = 4;
  const std::size_t most =
      all ? starts.size() : static_cast<std::size_t>(std::clamp(job.options.scan_candidates, 1, kMostOfDear));
  if (starts.size() > most) starts.resize(most);
  if (starts.empty())
    throw UserError(Where{}, "wave optics gives no finite picture at the start values, nor where rays would put them",
                    "check the start values and bounds of indices, diameter_um and wavelength_nm");
  const Eigen::VectorXd first = starts.front().second;
  polish_into(result, problem, problem, job.options, std::move(starts), most, steps,
              std::numeric_limits<double>::infinity(), same, {}, {});
  keep_distinct(result, problem, first);
  return result;
}

}  // namespace birefit::estimation
