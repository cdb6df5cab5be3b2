#include "fit/search/scan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include <fmt/format.h>

#include "birefit/error.h"
#include "fit/errors/statistics.h"

namespace birefit::estimation {
namespace {

constexpr int kMostPointsPerAxis = 400;
constexpr int kMostProductPoints = 3000;
constexpr std::size_t kMostAxesSpread = 4;
/// Fewer points than this could step over the valley of a parameter that also moves an edge.
constexpr int kFewestPointsPerAxis = 7;
/// A droplet's edge carries all of its rings: the largest step of a diameter, of its upper bound.
constexpr double kDiameterStep = 1.0 / 30;
/// Of a parameter that forms no fringes, as long as the grid has no more points than the second.
constexpr int kPlacesWithoutFringes = 9;
constexpr std::size_t kMostPointsWithoutFringes = 1000;
/// Batches of starts looked at; the next one only where chi-square is more standard deviations above its expectation.
constexpr std::size_t kMostBatches = 4;
constexpr double kDoubtful = 5;
/// Of the solver, for every start of a batch.
constexpr int kFirstSteps = 2;

struct Axis {
  int searched = 0;
  std::vector<double> values;  ///< of the grid, ascending
};

/// Where the line through (x, y), both ascending, has `y`; beyond its ends, there.
double inverse_of(const std::vector<double>& x, const std::vector<double>& y, double wanted) {
  const std::size_t above = static_cast<std::size_t>(std::lower_bound(y.begin(), y.end(), wanted) - y.begin());
  if (above == 0) return x.front();
  if (above == y.size()) return x.back();
  return x[above - 1] + (x[above] - x[above - 1]) * (wanted - y[above - 1]) / (y[above] - y[above - 1]);
}

/// Steps below a radian, and below `longest`, however fast the fringes are where.
std::vector<double> steps_along(const FringePhase& fringes, double longest) {
  std::vector<double> steps{0};
  for (std::size_t i = 1; i < fringes.value.size(); ++i)
    steps.push_back(steps.back() + std::max(fringes.radians[i] - fringes.radians[i - 1],
                                            (fringes.value[i] - fringes.value[i - 1]) / longest));
  const int points =
      static_cast<int>(std::clamp(std::ceil(steps.back()), 1.0, static_cast<double>(kMostPointsPerAxis)));
  std::vector<double> values;
  // Cell middles: the bounds themselves are where models degenerate.
  for (int i = 0; i < points; ++i)
    values.push_back(inverse_of(fringes.value, steps, steps.back() * (i + 0.5) / points));
  return values;
}

std::vector<Axis> axes_of(const FitJob& job, const Unknowns& unknowns, const std::vector<FringePhase>& fringes) {
  std::vector<Axis> axes;
  for (std::size_t j = 0; j < unknowns.searched.size(); ++j) {
    if (fringes[j].value.empty()) continue;
    const Parameter& parameter = job.parameters[unknowns.searched[j]];
    double longest = (parameter.upper - parameter.lower) / kFewestPointsPerAxis;
    for (const Micrograph& m : job.micrographs)
      if (const Droplet* droplet = std::get_if<Droplet>(&m.scene.sample);
          droplet && droplet->diameter_um.index == unknowns.searched[j])
        longest = std::min(longest, kDiameterStep * parameter.upper);
    axes.push_back({static_cast<int>(j), steps_along(fringes[j], longest)});
  }
  if (axes.empty()) return axes;
  // The rest moves the minima along the fringes' axes. But a centre: the picture has shown it.
  std::size_t product = 1;
  for (const Axis& axis : axes) product = std::min(product * axis.values.size(), 2 * kMostPointsWithoutFringes);
  const auto is_centre = [&](int index) {
    return std::any_of(job.micrographs.begin(), job.micrographs.end(), [&](const Micrograph& m) {
      return m.scene.view.center_x_px.index == index || m.scene.view.center_y_px.index == index;
    });
  };
  for (std::size_t j = 0; j < unknowns.searched.size() && product * kPlacesWithoutFringes <= kMostPointsWithoutFringes;
       ++j) {
    const Parameter& parameter = job.parameters[unknowns.searched[j]];
    const double width = parameter.upper - parameter.lower;
    if (!fringes[j].value.empty() || !std::isfinite(width) || !(width > 0) || is_centre(unknowns.searched[j])) continue;
    Axis axis{static_cast<int>(j), {}};
    for (int i = 0; i < kPlacesWithoutFringes; ++i)
      axis.values.push_back(parameter.lower + width * (i + 0.5) / kPlacesWithoutFringes);
    axes.push_back(std::move(axis));
    product *= kPlacesWithoutFringes;
  }
  return axes;
}

/// Solves from every start, a few steps for all and the rest for those that may still be the best, and adds the minima
/// found to the result. Returns the lowest objective.
double polish_into(ScanResult& result, LeastSquares& problem, const FitOptions& options,
                   std::vector<std::pair<double, Eigen::VectorXd>> starts, std::size_t finalists, int steps,
                   double hopeless_above, const SameMinimum& same = {}) {
  const auto by_objective = [](const auto& a, const auto& b) { return a.first < b.first; };
  SolveOptions polish;
  polish.function_tolerance = 1e-5;  // a few hundredths of a chi-square unit: all pixels follow
  polish.interrupted = options.interrupted;
  const auto walk = [&](int iterations) {
    polish.max_iterations = iterations;
    for (auto& [objective, x] : starts) {
      if (result.interrupted) return;
      result.interrupted = problem.solve(x, polish).interrupted;
      objective = std::isfinite(problem.objective()) ? problem.objective() : std::numeric_limits<double>::infinity();
    }
    std::stable_sort(starts.begin(), starts.end(), by_objective);
  };
  // Two steps tell whether a valley leads down; a wrong order stays many times worse.
  constexpr double kHopeless = 4;
  if (starts.size() > finalists + 1) {
    walk(kFirstSteps);
    starts.resize(finalists);
  }
  walk(steps);
  const double best = starts.front().first;
  const bool beaten = best > hopeless_above;
  for (const auto& [objective, from] : starts) {
    if (!(objective <= (beaten ? 1 : kHopeless) * best) || !std::isfinite(objective)) continue;
    if (beaten) {
      problem.evaluate(from, true);
      result.candidates.push_back({from, problem.objective(), projected_information(problem)});
      break;
    }
    if (same && std::any_of(result.candidates.begin(), result.candidates.end(),
                            [&](const Candidate& known) { return same(known.searched, from); }))
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
  std::vector<Candidate> distinct;
  for (Candidate& candidate : result.candidates) {
    const bool known = std::any_of(distinct.begin(), distinct.end(), [&](const Candidate& other) {
      // By both measures: where one is flat, at an extremum of the fringes, everything is near it.
      return separation(other, candidate.searched) < 5 && separation(candidate, other.searched) < 5;
    });
    if (!known) distinct.push_back(std::move(candidate));
  }
  result.candidates = std::move(distinct);
}

/// Member `index` >= 1 of the van der Corput sequence: evenly spread over (0, 1) however many are taken.
double van_der_corput(int index, int base) {
  double value = 0, digit = 1.0 / base;
  for (; index > 0; index /= base, digit /= base) value += digit * (index % base);
  return value;
}

/// The same in the box of several axes (J. H. Halton, Numer. Math. 2, 84 (1960)).
Eigen::VectorXd spread_point(int index, const FitJob& job, const Unknowns& unknowns, const std::vector<Axis>& axes,
                             const Eigen::VectorXd& start) {
  constexpr std::array<int, 8> kPrimes{2, 3, 5, 7, 11, 13, 17, 19};
  Eigen::VectorXd x = start;
  for (std::size_t k = 0; k < axes.size(); ++k) {
    const Parameter& parameter = job.parameters[unknowns.searched[static_cast<std::size_t>(axes[k].searched)]];
    x[axes[k].searched] =
        parameter.lower + (parameter.upper - parameter.lower) * van_der_corput(index + 1, kPrimes[k % kPrimes.size()]);
  }
  return x;
}

}  // namespace

double FringePhase::at(double v) const { return inverse_of(radians, value, v); }

namespace {

/// 0 where the bounds leave what the model can do (no equilibrium, beyond a clearing point): there is no image to look
/// at either.
double rate_at(const Scene& scene, const Theta& theta, int index) {
  try {
    const double rate = fringe_phase_per_unit(scene, theta, index);
    return std::isfinite(rate) ? rate : 0;
  } catch (const UserError&) {
    return 0;
  }
}

}  // namespace

std::vector<FringePhase> fringe_phases(const FitJob& job, const Unknowns& unknowns, const Theta& theta) {
  // A rate may be largest anywhere between the bounds (a voltage just above its threshold).
  constexpr int kIntervals = 16;
  // Of hundreds of rows of a table a few dozen show it.
  const std::size_t frames = job.micrographs.size(), stride = (frames + 31) / 32;
  std::vector<FringePhase> result;
  for (const int index : unknowns.searched) {
    result.emplace_back();
    const Parameter& parameter = job.parameters[index];
    const double width = parameter.upper - parameter.lower;
    if (!std::isfinite(width) || !(width > 0)) continue;
    std::array<Theta, 3> others{theta, theta, theta};
    for (const int other : unknowns.searched) {
      const Parameter& bounds = job.parameters[other];
      if (std::isfinite(bounds.upper - bounds.lower))
        others[1][static_cast<std::size_t>(other)] = bounds.lower,
        others[2][static_cast<std::size_t>(other)] = bounds.upper;
    }
    std::vector<double> rates;
    FringePhase fringes;
    for (int i = 0; i <= kIntervals; ++i) {
      fringes.value.push_back(parameter.lower + width * i / kIntervals);
      double fastest = 0;
      for (Theta& probe : others) {
        probe[static_cast<std::size_t>(index)] = fringes.value.back();
        for (std::size_t g = 0; g < frames; g += stride)
          fastest = std::max(fastest, rate_at(job.micrographs[g].scene, probe, index));
      }
      rates.push_back(fastest);
    }
    fringes.radians.push_back(0);
    for (std::size_t i = 1; i < rates.size(); ++i)
      fringes.radians.push_back(fringes.radians.back() + std::max(rates[i - 1], rates[i]) * width / kIntervals);
    if (fringes.radians.back() > 0) result.back() = std::move(fringes);
  }
  return result;
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

ScanResult scan(LeastSquares& problem, const FitJob& job, const Unknowns& unknowns, const Eigen::VectorXd& start,
                const std::vector<FringePhase>& fringes, double hopeless_above) {
  ScanResult result;
  const FitOptions& options = job.options;
  const auto interrupted = [&] { return options.interrupted && options.interrupted->load(); };
  const auto objective_at = [&](const Eigen::VectorXd& x) {
    ++result.points;
    problem.evaluate(x, false);
    const double objective = problem.objective();
    return std::isfinite(objective) ? objective : std::numeric_limits<double>::infinity();
  };

  const auto by_objective = [](const auto& a, const auto& b) { return a.first < b.first; };
  const int candidates = std::max(1, options.scan_candidates);
  std::vector<std::pair<double, Eigen::VectorXd>> starts;
  const std::vector<Axis> axes = axes_of(job, unknowns, fringes);
  std::size_t product = axes.empty() ? 0 : 1;
  for (const Axis& axis : axes) product = std::min<std::size_t>(product * axis.values.size(), 1000000);
  if (options.progress && product > 0) options.progress("scanning for the fringe order");

  if (product > 0 && product <= kMostProductPoints && axes.size() <= 3) {
    // Every point of the product grid; its minima are points below their neighbours along every axis: a valley across
    // the axes has several.
    std::vector<double> chi(product, std::numeric_limits<double>::infinity());
    const auto point_at = [&](std::size_t flat) {
      Eigen::VectorXd x = start;
      for (const Axis& axis : axes) {
        x[axis.searched] = axis.values[flat % axis.values.size()];
        flat /= axis.values.size();
      }
      return x;
    };
    for (std::size_t i = 0; i < product && !result.interrupted; ++i) {
      chi[i] = objective_at(point_at(i));
      result.interrupted = interrupted();
    }
    std::size_t stride = 1;
    for (const Axis& axis : axes) {
      ScanTrace trace{job.parameters[unknowns.searched[axis.searched]].name, axis.values, {}};
      trace.chi_square.assign(axis.values.size(), std::numeric_limits<double>::infinity());
      for (std::size_t i = 0; i < product; ++i) {
        double& best = trace.chi_square[i / stride % axis.values.size()];
        best = std::min(best, chi[i]);
      }
      stride *= axis.values.size();
      result.traces.push_back(std::move(trace));
    }
    for (std::size_t i = 0; i < product; ++i) {
      bool lowest = std::isfinite(chi[i]);
      std::size_t rest = i, step = 1;
      for (const Axis& axis : axes) {
        const std::size_t size = axis.values.size(), at = rest % size;
        rest /= size;
        if (at > 0) lowest = lowest && chi[i] < chi[i - step];
        if (at + 1 < size) lowest = lowest && chi[i] <= chi[i + step];
        step *= size;
      }
      if (lowest) starts.emplace_back(chi[i], point_at(i));
    }
  } else if (product > 0) {
    // Too many for a product: points spread evenly over the box, where its axes are few enough for them to come near
    // each other, then each axis through the best of them, twice.
    for (int i = 0; i < kMostProductPoints && axes.size() <= kMostAxesSpread && !result.interrupted; ++i) {
      Eigen::VectorXd x = spread_point(i, job, unknowns, axes, start);
      const double objective = objective_at(x);
      starts.emplace_back(objective, std::move(x));
      result.interrupted = interrupted();
    }
    starts.emplace_back(objective_at(start), start);
    for (int round = 0; round < 2 && !result.interrupted; ++round)
      for (const Axis& axis : axes) {
        ScanTrace trace{job.parameters[unknowns.searched[axis.searched]].name, axis.values, {}};
        Eigen::VectorXd x = std::min_element(starts.begin(), starts.end(), by_objective)->second;
        for (const double value : axis.values) {
          x[axis.searched] = value;
          trace.chi_square.push_back(result.interrupted ? std::numeric_limits<double>::infinity() : objective_at(x));
          starts.emplace_back(trace.chi_square.back(), x);
          result.interrupted = result.interrupted || interrupted();
        }
        if (round == 1) result.traces.push_back(std::move(trace));
      }
    // Of neighbours, less than a radian apart in everything, the best.
    std::stable_sort(starts.begin(), starts.end(), by_objective);
    std::vector<std::pair<double, Eigen::VectorXd>> apart;
    for (auto& [objective, x] : starts) {
      if (apart.size() >= 4 * kMostBatches * static_cast<std::size_t>(candidates) || !std::isfinite(objective)) break;
      const bool near = std::any_of(apart.begin(), apart.end(), [&](const auto& other) {
        return std::all_of(axes.begin(), axes.end(), [&](const Axis& axis) {
          const FringePhase& phase = fringes[static_cast<std::size_t>(axis.searched)];
          return std::abs(phase.at(x[axis.searched]) - phase.at(other.second[axis.searched])) < 1;
        });
      });
      if (!near) apart.emplace_back(objective, x);
    }
    starts = std::move(apart);
  }
  std::stable_sort(starts.begin(), starts.end(), by_objective);

  // A batch takes no longer than the grid did, but for a few starts that any fit deserves: images are the unit, a step
  // of the solver takes one with a derivative by every unknown.
  constexpr int kSteps = 6, kFewest = 4;
  const int step_cost = 1 + problem.searched_size(), affordable = result.points / step_cost;
  const std::size_t finalists =
      static_cast<std::size_t>(std::clamp(affordable / (2 * kSteps), std::min(kFewest, candidates), candidates));
  const std::size_t first_look = static_cast<std::size_t>(
      std::clamp<int>(affordable / (2 * kFirstSteps), static_cast<int>(finalists), 4 * candidates));
  const std::size_t batches = affordable > 4 * candidates * kFirstSteps ? kMostBatches : 1;

  // The most promising, and the user's start whatever the grid says. What describes the image badly is not yet
  // believed: the next ones, then, as long as there are any.
  const double rows = static_cast<double>(problem.pixel_rows());
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t batch = 0; batch < batches && !result.interrupted; ++batch) {
    const std::size_t first = batch * first_look, last = std::min(starts.size(), first + first_look);
    std::vector<std::pair<double, Eigen::VectorXd>> some;
    for (std::size_t i = first; i < last; ++i) some.push_back(starts[i]);
    if (batch == 0) some.emplace_back(std::numeric_limits<double>::infinity(), start);
    if (some.empty()) break;
    best = std::min(best, polish_into(result, problem, options, std::move(some), finalists, kSteps, hopeless_above));
    if (best < rows + kDoubtful * std::sqrt(2 * rows) || best > hopeless_above) break;
  }
  keep_distinct(result, problem, start);
  return result;
}

double lowest_of_few(LeastSquares& problem, const FitJob& job, const Unknowns& unknowns, const Eigen::VectorXd& start,
                     const std::vector<FringePhase>& fringes) {
  constexpr int kFew = 150;
  const std::vector<Axis> axes = axes_of(job, unknowns, fringes);
  double lowest = std::numeric_limits<double>::infinity();
  for (int i = -1; i < (axes.empty() ? 0 : kFew); ++i) {
    problem.evaluate(i < 0 ? start : spread_point(i, job, unknowns, axes, start), false);
    if (std::isfinite(problem.objective())) lowest = std::min(lowest, problem.objective());
  }
  return lowest;
}

ScanResult polish(LeastSquares& problem, const FitJob& job, std::vector<Eigen::VectorXd> from, int steps,
                  const SameMinimum& same) {
  ScanResult result;
  std::vector<std::pair<double, Eigen::VectorXd>> starts;
  for (Eigen::VectorXd& x : from) {
    ++result.points;
    problem.evaluate(x, false);
    if (std::isfinite(problem.objective())) starts.emplace_back(problem.objective(), std::move(x));
  }
  std::stable_sort(starts.begin(), starts.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  constexpr int kMostOfDear = 4;
  const std::size_t most = static_cast<std::size_t>(std::clamp(job.options.scan_candidates, 1, kMostOfDear));
  if (starts.size() > most) starts.resize(most);
  if (starts.empty())
    throw UserError(Where{}, "wave optics gives no finite picture at the start values, nor where rays would put them",
                    "check the start values and bounds of indices, diameter_um and wavelength_nm");
  const Eigen::VectorXd first = starts.front().second;
  polish_into(result, problem, job.options, std::move(starts), most, steps, std::numeric_limits<double>::infinity(),
              same);
  keep_distinct(result, problem, first);
  return result;
}

}  // namespace birefit::estimation
