#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "fit/search/optimum.h"
#include "fit/search/search.h"
#include "samples/kind.h"

namespace birefit::estimation {
namespace {

/// The same job by straight rays.
FitJob job_by_rays(const FitJob& job) {
  FitJob by_rays = job;
  by_rays.branches.clear();
  for_each_scene(by_rays.measurements, [](Scene& scene) { scene.microscope.focus_um = {}; });
  // They are off by a quarter of the image: good enough to start from.
  by_rays.demand.ceiling = Ceiling::one_way, by_rays.demand.method = "auto";
  by_rays.demand.intensity_accuracy = std::max(job.demand.intensity_accuracy, 1e-2);
  return by_rays;
}

/// The diameter of a frame's sphere, or what that follows from.
bool is_diameter(const Task& task, int g, std::size_t j) {
  const ParameterRef diameter = traits_of(task.picture(g).scene).sphere_diameter_um;
  return diameter && follows_from(task.job.parameters, diameter, task.unknowns.searched[j]);
}

/// Wave plans for all of the places to look at: a grid for the largest droplet among them, as a larger one than it was
/// made for would be cut off.
Frames planned_for(const Task& task, Frames frames, const Theta& start, const std::vector<Eigen::VectorXd>& places) {
  for (int g = 0; g < task.frames(); ++g) {
    Theta theta = task.with(start, places.front());
    if (const ParameterRef diameter = traits_of(task.picture(g).scene).sphere_diameter_um)
      for (const Eigen::VectorXd& x : places) {
        const auto at = static_cast<std::size_t>(diameter.index);
        theta[at] = std::max(theta[at], task.with(start, x)[at]);
      }
    frames[static_cast<std::size_t>(g)].plan = task.planned(g, theta);
  }
  return frames;
}

/// Minima of rays, the fringe orders beside the best of them, and the start.
std::vector<Eigen::VectorXd> places_near(const Task& task, const Optimum& rays, const Start& start,
                                         const Eigen::VectorXd& rates) {
  std::vector<Eigen::VectorXd> places{rays.searched};
  places.insert(places.end(), rays.rivals.begin(), rays.rivals.end());
  places.push_back(start.searched);
  for (std::size_t j = 0; j < task.unknowns.searched.size(); ++j) {
    const Parameter& parameter = task.searched(j);
    const auto at = static_cast<Eigen::Index>(j);
    if (!(rates[at] * (parameter.upper - parameter.lower) > std::numbers::pi)) continue;
    for (const double orders : {-2.0, -1.0, -0.5, 0.5, 1.0, 2.0}) {
      Eigen::VectorXd x = rays.searched;
      x[at] += orders * 2 * std::numbers::pi / rates[at];
      if (x[at] > parameter.lower && x[at] < parameter.upper) places.push_back(std::move(x));
    }
  }
  return places;
}

/// Along every axis through a place, half an order a step. A droplet's edge carries all its rings: smaller steps of the
/// diameter, as in the scan.
std::vector<Eigen::VectorXd> lines_through(const Task& task, const Eigen::VectorXd& place,
                                           const Eigen::VectorXd& rates) {
  constexpr int kDiameters = 30, kMostSteps = 100;
  std::vector<Eigen::VectorXd> lines;
  for (std::size_t j = 0; j < task.unknowns.searched.size(); ++j) {
    const Parameter& parameter = task.searched(j);
    const auto at = static_cast<Eigen::Index>(j);
    const double width = parameter.upper - parameter.lower;
    if (!(rates[at] * width > std::numbers::pi)) continue;
    const int steps = std::clamp(static_cast<int>(std::ceil(rates[at] * width / std::numbers::pi)),
                                 is_diameter(task, 0, j) ? kDiameters : 1, kMostSteps);
    for (int i = 0; i < steps; ++i) {
      lines.push_back(place);
      lines.back()[at] = parameter.lower + width * (i + 0.5) / steps;
    }
  }
  return lines;
}

}  // namespace

Minima search_near_rays(const Task& task, const Start& start) {
  const FitJob by_rays = job_by_rays(task.job);
  const Task rays_task(by_rays);
  Minima of_rays = search(rays_task, prepare(rays_task), std::numeric_limits<double>::infinity());
  Minima minima;
  minima.frames = start.frames;
  minima.theta = start.theta;
  minima.evaluations = of_rays.evaluations;
  std::vector<ScanTrace> traces = std::move(of_rays.scan.traces);
  const int points = of_rays.scan.points;
  const Optimum rays = best_minimum(rays_task, of_rays, false);
  minima.evaluations = rays.evaluations + rays.problem->evaluations();
  minima.stopped = rays.stopped;

  Eigen::VectorXd rates = Eigen::VectorXd::Zero(start.searched.size());
  for (std::size_t j = 0; j < task.unknowns.searched.size(); ++j)
    for_each_scene(by_rays.measurements, [&](const Scene& scene) {
      double& rate = rates[static_cast<Eigen::Index>(j)];
      rate = std::max(rate, std::abs(fringe_phase_per_unit(scene, task.job.demand, task.job.parameters, rays.theta,
                                                           task.unknowns.searched[j])));
    });
  task.say("neighbouring fringe orders by wave optics");
  const auto problem_for = [&](const std::vector<Eigen::VectorXd>& places) {
    return problem_of(task, planned_for(task, start.frames, start.theta, places), misfit_of_prior(task, start.theta));
  };
  std::vector<Eigen::VectorXd> places = places_near(task, rays, start, rates);
  std::unique_ptr<LeastSquares> all = problem_for(places);
  // Less than a third of an order apart in everything that forms fringes: the same minimum.
  const auto same = [&](const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
    return ((a - b).cwiseProduct(rates)).cwiseAbs().maxCoeff() < 2;
  };
  constexpr int kSteps = 3;
  ScanResult& found = minima.scan;
  found = polish(*all, task.job, std::move(places), kSteps, same);
  // Rays may have been wrong by more than that: where no minimum describes the image, farther, as long as that helps.
  constexpr double kDescribed = 2, kHelps = 0.98;
  constexpr int kRounds = 3;
  for (int round = 0; round < kRounds && !found.interrupted; ++round) {
    const Candidate best = found.candidates.front();
    if (best.objective <= kDescribed * static_cast<double>(all->pixel_rows())) break;
    task.say("no minimum near that of rays describes the image: looking farther");
    std::vector<Eigen::VectorXd> lines = lines_through(task, best.searched, rates);
    if (lines.empty()) break;
    minima.evaluations += all->evaluations();
    all = problem_for(lines);
    ScanResult more = polish(*all, task.job, std::move(lines), kSteps, same);
    const bool helps = more.candidates.front().objective < kHelps * best.objective;
    found.interrupted = more.interrupted;
    found.points += more.points;
    if (!helps) break;
    for (Candidate& other : found.candidates)
      if (std::none_of(more.candidates.begin(), more.candidates.end(),
                       [&](const Candidate& known) { return same(known.searched, other.searched); }))
        more.candidates.push_back(std::move(other));
    found.candidates = std::move(more.candidates);
  }
  found.traces = std::move(traces);
  found.points += points;
  minima.evaluations += all->evaluations();
  minima.stopped = minima.stopped || found.interrupted;
  minima.rows = static_cast<double>(all->pixel_rows());
  minima.theta = task.with(start.theta, found.candidates.front().searched);
  minima.frames = replanned(task, std::move(minima.frames), minima.theta);
  return minima;
}

}  // namespace birefit::estimation
