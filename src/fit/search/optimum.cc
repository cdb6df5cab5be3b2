#include "fit/search/optimum.h"

#include <algorithm>
#include <cmath>

#include "samples/waves/wave.h"

namespace birefit::estimation {

SolveSummary solve(const Task& task, Optimum& optimum, Eigen::VectorXd& searched, const std::string& label,
                   int max_iterations) {
  SolveOptions options;
  options.max_iterations = max_iterations > 0 ? max_iterations : task.job.options.max_iterations;
  options.interrupted = task.job.options.interrupted;
  options.progress = task.job.options.progress;
  options.label = label;
  // Propagation takes a tenth of a second and more an image: to a thousandth of a chi-square unit, not to rounding.
  if (by_waves(optimum.frames)) options.function_tolerance = 3e-8;
  // A valley is level where a step gains so little: a hundred of them are a thirtieth of a standard error.
  constexpr double kLevel = 1e-5;
  options.least_gain = kLevel * std::max(1.0, optimum.per_pixel);
  // Of what is not described, to a thirtieth of the unit that its misfit makes of chi-square.
  constexpr double kMissed = 4, kOfUnit = 3e-2;
  const double rows = static_cast<double>(optimum.problem->pixel_rows());
  if (optimum.per_pixel > kMissed) options.function_tolerance = std::max(options.function_tolerance, kOfUnit / rows);
  if (!label.empty()) options.iterations = &optimum.iterations;
  const SolveSummary summary = optimum.problem->solve(searched, options);
  // Rounding's distance from a bound is the bound: a square's slope there is of no meaning, and not zero.
  constexpr double kRounding = 1e-9;
  bool moved = false;
  for (std::size_t j = 0; j < task.unknowns.searched.size(); ++j) {
    const Parameter& parameter = task.searched(j);
    double& x = searched[static_cast<Eigen::Index>(j)];
    const double width = parameter.upper - parameter.lower;
    for (const double bound : {parameter.lower, parameter.upper})
      if (std::isfinite(width) && x != bound && std::abs(x - bound) < kRounding * width) x = bound, moved = true;
  }
  if (moved) optimum.problem->evaluate(searched, true);
  optimum.per_pixel = optimum.problem->objective() / std::max(1.0, rows);
  optimum.stopped = optimum.stopped || summary.interrupted;
  return summary;
}

void solve_again(const Task& task, Optimum& optimum, const std::string& label) {
  const SolveSummary summary = solve(task, optimum, optimum.searched, label);
  optimum.converged = summary.converged && !optimum.stopped;
  optimum.solver_report = summary.report;
  optimum.theta = optimum.problem->theta();
  optimum.explained = false;
}

void rebuild(const Task& task, Optimum& optimum) {
  const std::vector<Misfit> misfit = optimum.problem->misfit();
  optimum.evaluations += optimum.problem->evaluations();
  optimum.problem = problem_of(task, optimum.frames, misfit);
}

double Optimum::chi_square(const Task& task) const {
  double sum = 0;
  for (int g = 0; g < task.frames(); ++g) sum += problem->frame_misfit(g).chi_square;
  return sum;
}

int Optimum::degrees_of_freedom(const Task& task) const {
  return static_cast<int>(problem->pixel_rows()) + problem->prior_rows() - task.unknowns.size();
}

double Optimum::reduced_chi_square(const Task& task) const {
  // Priors are observations too; those between parameters in a changed weighting keep their own weight.
  return (chi_square(task) + problem->prior_chi_square()) / std::max(1, degrees_of_freedom(task));
}

double ripple_period_of(const Task& task, const Theta& theta, std::size_t j) {
  double period = 0;
  for (int g = 0; g < task.frames(); ++g)
    period = std::max(period, ripple_period(task.picture(g).scene, task.job.demand, task.job.parameters, theta,
                                            task.unknowns.searched[j]));
  return period;
}

bool has_ripples(const Task& task, const Theta& theta) {
  for (std::size_t j = 0; j < task.unknowns.searched.size(); ++j)
    if (ripple_period_of(task, theta, j) > 0) return true;
  return false;
}

double score(const Task& task, const Candidate& minimum) {
  return minimum.objective - 2 * log_share(minimum.information, task.job, task.unknowns);
}

double rank(const Task& task, const Theta& theta, const Candidate& minimum) {
  return has_ripples(task, theta) ? score(task, minimum) : minimum.objective;
}

namespace {

/// Chi-square units within which a minimum may still be the best: a subsample's difference scatters by twice its root.
constexpr double kPlausible = 30;

struct Minimum {
  Candidate at;
  double rank = 0;
  bool converged = false;
  std::string report;
};
bool ranks_lower(const Minimum& a, const Minimum& b) { return a.rank < b.rank; }

/// Solves from somewhere to the minimum of that valley.
Minimum minimum_from(const Task& task, Optimum& optimum, Eigen::VectorXd x, const std::string& label,
                     int max_iterations) {
  const SolveSummary summary = solve(task, optimum, x, label, max_iterations);
  const Candidate at{x, deviance(task, *optimum.problem), projected_information(*optimum.problem)};
  return {at, rank(task, optimum.problem->theta(), at), summary.converged, summary.report};
}

/// The minima around one of them that a sphere's ripples have: too fine for the scan's grid. True where one was better.
bool look_among_ripples(const Task& task, Optimum& optimum, std::vector<Minimum>& minima, double reduced) {
  const Minimum from = *std::min_element(minima.begin(), minima.end(), ranks_lower);
  bool better = false;
  const auto look_from = [&](const Eigen::VectorXd& x) {
    const Minimum found = minimum_from(task, optimum, x, "", 30);
    const auto known = std::find_if(minima.begin(), minima.end(), [&](const Minimum& m) {
      return separation(m.at, found.at.searched) < 5 && separation(found.at, m.at.searched) < 5;
    });
    if (known == minima.end()) {
      better = better || found.rank < from.rank;
      if (found.rank - from.rank < kPlausible * reduced) minima.push_back(found);
    } else if (found.at.objective < known->at.objective) {
      *known = found;
    }
  };
  for (std::size_t j = 0; j < task.unknowns.searched.size(); ++j) {
    const Parameter& parameter = task.searched(j);
    const auto at = static_cast<Eigen::Index>(j);
    const double period = ripple_period_of(task, optimum.problem->theta(), j);
    if (period == 0) continue;
    const auto moved = [&](double by) {
      Eigen::VectorXd x = from.at.searched;
      x[at] += by;
      return x;
    };
    const auto allowed = [&](const Eigen::VectorXd& x) {
      return !optimum.stopped && x[at] > parameter.lower && x[at] < parameter.upper;
    };
    for (const double ripples : {-2.0, -1.0, -0.5, 0.5, 1.0, 2.0})  // TE and TM resonances interlace
      if (const Eigen::VectorXd x = moved(ripples * period); allowed(x)) look_from(x);
    // A resonance that follows the noise is a dip far narrower than the valley it lies in: beside it the misfit rises
    // less than its own width foretells.
    const double sd = 1 / from.at.information.col(at).norm();
    for (const double side : {-1.0, 1.0}) {
      std::optional<Eigen::VectorXd> start;
      double least = from.at.objective + kPlausible * reduced;
      for (double off = 8; off * sd < 0.5 * period; off *= 2) {
        const Eigen::VectorXd x = moved(side * off * sd);
        if (!allowed(x)) break;
        optimum.problem->evaluate(x, false);
        const double objective = deviance(task, *optimum.problem);
        if (objective < std::min(least, from.at.objective + 0.5 * off * off)) least = objective, start = x;
      }
      if (start) look_from(*start);
    }
  }
  return better;
}

}  // namespace

Optimum best_minimum(const Task& task, const Minima& found, bool beaten) {
  Optimum optimum;
  optimum.frames = found.frames;
  optimum.theta = found.theta;
  optimum.searched = found.scan.candidates.front().searched;
  optimum.problem = problem_of(task, optimum.frames, misfit_expected(task, optimum.frames, optimum.theta));
  optimum.evaluations = found.evaluations;
  optimum.stopped = found.stopped || beaten;
  optimum.warnings = task.job.warnings;
  optimum.per_pixel = found.lowest_per_pixel();
  if (optimum.stopped) {
    optimum.problem->evaluate(optimum.searched, true);
    optimum.theta = optimum.problem->theta();
    return optimum;
  }
  // On all pixels: the best, and whatever a subsample of this size cannot exclude (the difference of two chi-squares
  // scatters by twice its root).
  const std::vector<Candidate>& candidates = found.scan.candidates;
  const double reduced = std::max(1.0, found.lowest_per_pixel());
  std::vector<Minimum> minima;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (i > 0 && candidates[i].objective - candidates[0].objective > kPlausible * reduced) break;
    minima.push_back(minimum_from(task, optimum, candidates[i].searched, i == 0 ? "fit" : "", i == 0 ? 0 : 30));
    if (optimum.stopped) break;
  }
  // From the best minimum on to its neighbours, as long as that helps.
  constexpr int kRounds = 4;
  for (int round = 0; round < kRounds && !optimum.stopped; ++round)
    if (!look_among_ripples(task, optimum, minima, reduced)) break;
  const auto lowest = std::min_element(minima.begin(), minima.end(), ranks_lower);
  optimum.searched = lowest->at.searched;
  optimum.converged = lowest->converged && !optimum.stopped;
  optimum.solver_report = lowest->report;
  for (auto i = minima.begin(); i != minima.end(); ++i)
    if (i != lowest) optimum.rivals.push_back(i->at.searched);
  optimum.problem->evaluate(optimum.searched, true);
  optimum.theta = optimum.problem->theta();
  return optimum;
}

}  // namespace birefit::estimation
