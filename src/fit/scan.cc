#include "fit/scan.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <fmt/format.h>

#include "fit/statistics.h"

namespace birefit::estimation {
namespace {

constexpr int kMostPointsPerAxis = 400;
constexpr int kMostProductPoints = 3000;
/// Fewer points than this could step over the valley of a parameter that also moves an edge.
constexpr int kFewestPointsPerAxis = 7;

struct Axis {
  int searched = 0;
  std::vector<double> values;
};

std::vector<Axis> axes_of(const FitJob& job, const Unknowns& unknowns, const std::vector<double>& phase_per_unit) {
  std::vector<Axis> axes;
  for (std::size_t j = 0; j < unknowns.searched.size(); ++j) {
    const Parameter& parameter = job.parameters[unknowns.searched[j]];
    const double width = parameter.upper - parameter.lower;
    if (!(phase_per_unit[j] > 0) || !std::isfinite(width) || !(width > 0)) continue;
    const int points =
        static_cast<int>(std::clamp(std::ceil(width * phase_per_unit[j]) + 1, static_cast<double>(kFewestPointsPerAxis),
                                    static_cast<double>(kMostPointsPerAxis)));
    Axis axis{static_cast<int>(j), {}};
    // Cell middles: the bounds themselves are where models degenerate.
    for (int i = 0; i < points; ++i) axis.values.push_back(parameter.lower + width * (i + 0.5) / points);
    axes.push_back(std::move(axis));
  }
  return axes;
}

/// Solves from every start and keeps the distinct minima, best first, at least one.
void polish_into(ScanResult& result, LeastSquares& problem, const FitOptions& options, std::vector<std::pair<double, Eigen::VectorXd>>& starts, int steps,
                 double hopeless_above, const SameMinimum& same = {}) {
  const Eigen::VectorXd start = starts.back().second;
  // A few steps for everyone, the rest for those that may still be the best: a wrong order stays many times worse.
  constexpr double kHopeless = 4;
  SolveOptions polish;
  polish.function_tolerance = 1e-5;  // a few hundredths of a chi-square unit: all pixels follow
  polish.interrupted = options.interrupted;
  double best = std::numeric_limits<double>::infinity();
  for (auto& [objective, x] : starts) {
    polish.max_iterations = steps;
    result.interrupted = problem.solve(x, polish).interrupted || result.interrupted;
    objective = std::isfinite(problem.objective()) ? problem.objective() : std::numeric_limits<double>::infinity();
    best = std::min(best, objective);
  }
  const bool beaten = best > hopeless_above;
  if (same) std::stable_sort(starts.begin(), starts.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const auto& [objective, from] : starts) {
    if (!(objective <= (beaten ? 1 : kHopeless) * best) || !std::isfinite(objective)) continue;
    if (beaten) {
      problem.evaluate(from, true);
      result.candidates.push_back({from, problem.objective(), projected_information(problem)});
      break;
    }
    if (same && std::any_of(result.candidates.begin(), result.candidates.end(), [&](const Candidate& known) { return same(known.searched, from); })) continue;
    Candidate candidate;
    candidate.searched = from;
    polish.max_iterations = 20;
    result.interrupted = problem.solve(candidate.searched, polish).interrupted || result.interrupted;
    candidate.objective = problem.objective();
    candidate.information = projected_information(problem);
    if (std::isfinite(candidate.objective)) result.candidates.push_back(std::move(candidate));
    if (result.interrupted && !result.candidates.empty()) break;
  }
  if (result.candidates.empty()) {
    problem.evaluate(start, true);
    result.candidates.push_back({start, problem.objective(), projected_information(problem)});
  }
  std::stable_sort(result.candidates.begin(), result.candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.objective < b.objective; });
  std::vector<Candidate> distinct;
  for (Candidate& candidate : result.candidates) {
    const bool known = std::any_of(distinct.begin(), distinct.end(), [&](const Candidate& other) {
      return separation(other, candidate.searched) < 5 || separation(candidate, other.searched) < 5;
    });
    if (!known) distinct.push_back(std::move(candidate));
  }
  result.candidates = std::move(distinct);
}

}  // namespace

double separation(const Candidate& minimum, const Eigen::VectorXd& other) {
  if (minimum.searched.size() == 0) return 0;
  return (minimum.information * (other - minimum.searched)).norm();
}

Eigen::MatrixXd projected_information(const LeastSquares& problem) {
  const int p = problem.searched_size();
  TallQr qr(p);
  if (p > 0)
    for (const LeastSquares::Tile& tile : problem.tiles()) {
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> rows(tile.count, p);
      problem.copy_jacobian(tile, Eigen::VectorXd::Ones(p), rows.data());
      qr.add(rows);
    }
  return qr.factor();
}

ScanResult scan(LeastSquares& problem, const FitJob& job, const Unknowns& unknowns, const Eigen::VectorXd& start,
                const std::vector<double>& phase_per_unit, double hopeless_above) {
  ScanResult result;
  const FitOptions& options = job.options;
  const auto interrupted = [&] { return options.interrupted && options.interrupted->load(); };
  const auto objective_at = [&](const Eigen::VectorXd& x) {
    ++result.points;
    problem.evaluate(x, false);
    const double objective = problem.objective();
    return std::isfinite(objective) ? objective : std::numeric_limits<double>::infinity();
  };

  std::vector<std::pair<double, Eigen::VectorXd>> starts;
  const std::vector<Axis> axes = axes_of(job, unknowns, phase_per_unit);
  std::size_t product = axes.empty() ? 0 : 1;
  for (const Axis& axis : axes) product = std::min<std::size_t>(product * axis.values.size(), 1000000);
  if (options.progress && product > 0) options.progress("scanning for the fringe order");

  if (product > 0 && product <= kMostProductPoints && axes.size() <= 3) {
    // Every point of the product grid; its minima are points below all neighbours, diagonal ones included.
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
      const int neighbours = static_cast<int>(std::lround(std::pow(3, axes.size())));
      for (int code = 0; code < neighbours && lowest; ++code) {
        std::size_t rest = i, step = 1, other = i;
        int digits = code;
        bool inside = true;
        for (const Axis& axis : axes) {
          const int move = digits % 3 - 1;
          digits /= 3;
          const auto at = static_cast<std::ptrdiff_t>(rest % axis.values.size()) + move;
          rest /= axis.values.size();
          inside = inside && at >= 0 && at < static_cast<std::ptrdiff_t>(axis.values.size());
          other += static_cast<std::size_t>(move) * step;  // wraps as unsigned arithmetic may
          step *= axis.values.size();
        }
        if (inside && other != i) lowest = chi[i] < chi[other] || (chi[i] == chi[other] && i < other);
      }
      if (lowest) starts.emplace_back(chi[i], point_at(i));
    }
  } else if (product > 0) {
    // Too many for a product: one axis after the other around the best so far, twice.
    Eigen::VectorXd best = start;
    double best_objective = objective_at(start);
    for (int round = 0; round < 2 && !result.interrupted; ++round)
      for (const Axis& axis : axes) {
        ScanTrace trace{job.parameters[unknowns.searched[axis.searched]].name, axis.values, {}};
        Eigen::VectorXd x = best;
        for (const double value : axis.values) {
          x[axis.searched] = value;
          trace.chi_square.push_back(result.interrupted ? std::numeric_limits<double>::infinity() : objective_at(x));
          result.interrupted = result.interrupted || interrupted();
        }
        for (std::size_t i = 0; i < axis.values.size(); ++i) {
          const double here = trace.chi_square[i];
          const double before = i > 0 ? trace.chi_square[i - 1] : std::numeric_limits<double>::infinity();
          const double after =
              i + 1 < axis.values.size() ? trace.chi_square[i + 1] : std::numeric_limits<double>::infinity();
          if (!(here < before && here <= after)) continue;
          x[axis.searched] = axis.values[i];
          starts.emplace_back(here, x);
          if (here < best_objective) best_objective = here, best = x;
        }
        if (round == 1) result.traces.push_back(std::move(trace));
      }
  }
  std::stable_sort(starts.begin(), starts.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  if (static_cast<int>(starts.size()) > options.scan_candidates) starts.resize(std::max(1, options.scan_candidates));
  starts.emplace_back(0, start);  // the user's, whatever the grid says

  polish_into(result, problem, options, starts, 6, hopeless_above);
  return result;
}

ScanResult polish(LeastSquares& problem, const FitJob& job, std::vector<Eigen::VectorXd> from, int steps, const SameMinimum& same) {
  ScanResult result;
  std::vector<std::pair<double, Eigen::VectorXd>> starts;
  for (Eigen::VectorXd& x : from) {
    ++result.points;
    problem.evaluate(x, false);
    if (std::isfinite(problem.objective())) starts.emplace_back(problem.objective(), std::move(x));
  }
  std::stable_sort(starts.begin(), starts.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  const std::size_t most = static_cast<std::size_t>(std::max(1, job.options.scan_candidates));
  if (starts.size() > most) starts.resize(most);
  polish_into(result, problem, job.options, starts, steps, std::numeric_limits<double>::infinity(), same);
  return result;
}

}  // namespace birefit::estimation
