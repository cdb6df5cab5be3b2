#include "fit/errors/stated.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>

#include "fit/errors/changed_input.h"
#include "fit/errors/discrepancy.h"
#include "fit/errors/profile.h"
#include "fit/errors/statistics.h"
#include "fit/problem/shared_zeros.h"
#include "fit/search/everywhere.h"

namespace birefit::estimation {
namespace {

bool is_exact(const Parameter& parameter) { return !(parameter.known_to.of(parameter.value) > 0); }

/// Read by some frame, not fitted, and not exact. What rows have for themselves is exact beside what all of them share
/// (fit/problem/shared_zeros.h): were each free, they would describe anything.
std::vector<int> uncertain(const Task& task) {
  std::vector<int> found = known_to_some_frames(task);
  std::erase_if(found, [&](int index) {
    const Parameter& stated = task.job.parameters[index];
    return is_exact(stated) || is_of_row(stated);
  });
  return found;
}

/// Without those that are never fitted along: of a bar whose field varies the electrodes' places. Pictures that are
/// nearly the model tell of both what neither is, and a field that has bent for it fits; by its derivative, such a
/// place is an error like others.
Stated fittable(const Task& task, Stated stated) {
  std::set<int> followed;
  for_each_scene(task.job.measurements, [&](const Scene& scene) {
    const auto* bar = std::get_if<Crystal>(&scene.sample);
    if (!bar || bar->field_legendre.empty()) return;
    for (const ParameterRef edge : {bar->electrode_low_px, bar->electrode_high_px})
      if (edge) followed.insert(edge.index);
  });
  if (followed.empty()) return stated;
  std::vector<Eigen::Index> kept;
  std::vector<int> index;
  for (Eigen::Index i = 0; i < stated.sd.size(); ++i)
    if (const int at = stated.index[static_cast<std::size_t>(i)]; !followed.contains(at))
      kept.push_back(i), index.push_back(at);
  return {std::move(index), Eigen::VectorXd(stated.sd(kept)), Eigen::MatrixXd(stated.shift(Eigen::all, kept)),
          Eigen::MatrixXd(stated.information(kept, kept)), Eigen::VectorXd(stated.pull(kept))};
}

/// What the weights of the problem have been divided by for what noise does not explain.
double beyond_noise(const Optimum& optimum) {
  double largest = 1;
  for (const Misfit& misfit : optimum.problem->misfit()) largest = std::max(largest, misfit.shape_variance);
  return largest;
}

/// Numbers of which pictures have this share of what their priors have, `units` times the information they are said to.
std::vector<int> numbers_told(const Stated& stated, double units) {
  constexpr double kTold = 0.05;
  std::vector<int> told;
  for (Eigen::Index i = 0; i < stated.sd.size(); ++i)
    if (units * stated.information(i, i) > kTold) told.push_back(stated.index[static_cast<std::size_t>(i)]);
  return told;
}

/// The depth of field of an objective on light of a wavelength in what is around the sample.
double depth_of_field_um(const FitJob& job, const Scene& scene) {
  constexpr double kLeast = 0.3;  // by eye
  const auto value = [&](ParameterRef ref, double otherwise) { return ref ? job.parameters[ref].value : otherwise; };
  const double na = value(scene.microscope.objective_na, 1), index = value(scene.surround_index, 1),
               wavelength_um = 1e-3 * value(scene.microscope.wavelength_nm, 0);
  return std::max(kLeast, wavelength_um * index / (2 * na * na));
}

bool may_be_out_of_focus(const FitJob& job, const Scene& scene) {
  const ParameterRef na = scene.microscope.objective_na;
  return job.demand.ceiling == Ceiling::wave && na && !scene.microscope.focus_um && !job.parameters[na].free &&
         !is_exact(job.parameters[na]);
}

/// A place of the narrow problem in the wider one.
Eigen::VectorXd widened(const Task& wider, const Task& narrow, const Theta& theta, const Eigen::VectorXd& searched) {
  const Theta all = narrow.with(theta, searched);
  Eigen::VectorXd place(static_cast<Eigen::Index>(wider.unknowns.searched.size()));
  for (Eigen::Index j = 0; j < place.size(); ++j) {
    const auto index = static_cast<std::size_t>(wider.unknowns.searched[static_cast<std::size_t>(j)]);
    place[j] = std::clamp(all[index], wider.searched(static_cast<std::size_t>(j)).lower,
                          wider.searched(static_cast<std::size_t>(j)).upper);
  }
  return place;
}

/// Where frames scatter their weights hold all that stated numbers could explain: the problem as it is before they have
/// shown a scatter, solved from the optimum.
std::unique_ptr<LeastSquares> before_scatter(const Task& task, const Optimum& optimum) {
  auto problem = problem_of(task, optimum.frames, misfit_expected(task, optimum.frames, optimum.theta));
  Eigen::VectorXd searched = optimum.searched;
  SolveOptions few;
  few.max_iterations = 15;
  few.function_tolerance = 1e-6;
  few.interrupted = task.job.options.interrupted;
  problem->solve(searched, few);
  return problem;
}

/// Whether an unknown is known by its likelihood on both sides alone. Errors by derivatives would leave out what is
/// stated then: where they are zero, it moves nothing.
bool has_turning_point(const Task& task, const Optimum& optimum, const Inverse& inverse) {
  constexpr double kReach = 2;  // standard errors
  bool found = false;
  for (Eigen::Index j = 0; j < optimum.searched.size() && !found; ++j) {
    const Parameter& parameter = task.searched(static_cast<std::size_t>(j));
    if (is_known_there(task.job, parameter, kReach * std::sqrt(inverse.covariance(j, j)))) continue;
    Profile profile(*optimum.problem, task.job, task.unknowns, optimum.searched, inverse.covariance,
                    static_cast<int>(j));
    found = profile.about_turning_point(kReach * kReach).has_value();
    optimum.problem->evaluate(optimum.searched, true);
  }
  return found;
}

/// Those that move an estimate by as much as its error and not along a straight line: where two standard deviations of
/// one make of it what its derivative does not foretell, by most of its standard error, an interval by derivatives may
/// miss the truth by many of its widths (a weak plate behind an analyser whose zero is off by a degree looks like a
/// stronger one that lies otherwise). Of pictures for which looking costs next to nothing.
std::vector<int> bent_numbers(const Task& task, const Optimum& optimum, const Stated& stated,
                              const Eigen::MatrixXd& covariance) {
  constexpr double kShare = 0.1, kFar = 2, kBent = 0.75;
  if (!costs_microseconds(task)) return {};
  const Eigen::Index n = optimum.searched.size();
  const Eigen::ArrayXd variance =
      covariance.diagonal().head(n).array() + stated.shift.topRows(n).rowwise().squaredNorm().array();
  std::vector<int> much;
  bool bent = false;
  for (Eigen::Index i = 0; i < stated.sd.size(); ++i) {
    const Eigen::VectorXd linear = stated.shift.col(i);
    if (!(linear.head(n).array().square() > kShare * variance).any()) continue;
    const int index = stated.index[static_cast<std::size_t>(i)];
    much.push_back(index);
    for (const double by : {-kFar, kFar}) {
      if (bent) break;
      const double value = optimum.theta[static_cast<std::size_t>(index)] + by * stated.sd[i];
      const Eigen::VectorXd off = shift_by_input(task, optimum, index, value, by * linear) - by * linear;
      bent = !off.allFinite() || (off.head(n).array().abs() > kBent * variance.sqrt()).any();
    }
  }
  return bent ? much : std::vector<int>{};
}

}  // namespace

Stated linear_stated_numbers(const Task& task, LeastSquares& problem, const Theta& theta,
                             const Eigen::MatrixXd& covariance) {
  Stated stated;
  stated.index = uncertain(task);
  const auto k = static_cast<Eigen::Index>(stated.index.size());
  stated.sd.resize(k);
  for (Eigen::Index i = 0; i < k; ++i) {
    const int index = stated.index[static_cast<std::size_t>(i)];
    stated.sd[i] = task.job.parameters[index].known_to.of(theta[static_cast<std::size_t>(index)]);
  }
  const LeastSquares::Beside sums = problem.beside(problem.intensity_by(stated.index));
  const auto units = stated.sd.asDiagonal();
  stated.shift = -covariance * sums.with_unknowns * units;
  stated.information = units * (sums.among - sums.with_unknowns.transpose() * covariance * sums.with_unknowns) * units;
  stated.pull = units * sums.with_residual;
  return stated;
}

Eigen::MatrixXd covariance_by(const Stated& stated) {
  const Eigen::Index k = stated.sd.size();
  const Eigen::LDLT<Eigen::MatrixXd> both(Eigen::MatrixXd::Identity(k, k) + stated.information);
  return stated.shift * both.solve(Eigen::MatrixXd(stated.shift.transpose()));
}

Stated stated_numbers(const Task& task, const Optimum& optimum, const Eigen::MatrixXd& covariance) {
  Stated stated = linear_stated_numbers(task, *optimum.problem, optimum.theta, covariance);
  const Eigen::ArrayXd sd = covariance.diagonal().array().cwiseMax(0).sqrt();
  if (by_waves(optimum.frames)) return stated;  // a fit is too dear
  for (Eigen::Index i = 0; i < stated.sd.size(); ++i) {
    const Eigen::VectorXd linear = stated.shift.col(i);
    constexpr double kOfNote = 0.5;  // standard errors
    if (!linear.allFinite() || !(linear.array().abs() > kOfNote * sd).head(optimum.searched.size()).any()) continue;
    const int index = stated.index[static_cast<std::size_t>(i)];
    const double value = optimum.theta[static_cast<std::size_t>(index)] + stated.sd[i];
    const Eigen::VectorXd shift = shift_by_input(task, optimum, index, value, linear);
    if (shift.allFinite()) stated.shift.col(i) = shift;
  }
  return stated;
}

std::vector<int> told_numbers(const Task& task, const Optimum& optimum) {
  const Inverse inverse = invert_normal_equations(optimum.problem->factor());
  const Stated stated =
      fittable(task, linear_stated_numbers(task, *optimum.problem, optimum.theta, inverse.covariance));
  return stated.information.allFinite() ? numbers_told(stated, beyond_noise(optimum)) : std::vector<int>{};
}

WorthFitting worth_fitting(const Task& task, const Optimum& optimum) {
  if (optimum.stopped || task.unknowns.searched.empty()) return {};
  const bool scatter = task.frames() > 1 && optimum.misfit.frames_scatter;
  const std::unique_ptr<LeastSquares> own = scatter ? before_scatter(task, optimum) : nullptr;
  LeastSquares& problem = own ? *own : *optimum.problem;
  const Inverse inverse = invert_normal_equations(problem.factor());
  if (!own && has_turning_point(task, optimum, inverse))
    return {fittable(task, linear_stated_numbers(task, problem, problem.theta(), inverse.covariance)).index, false,
            true};
  if (std::count(inverse.undetermined.begin(), inverse.undetermined.end(), true) > 0) return {};
  const Stated stated = fittable(task, linear_stated_numbers(task, problem, problem.theta(), inverse.covariance));
  const Eigen::Index k = stated.sd.size();
  if (k == 0 || !stated.shift.allFinite() || !stated.information.allFinite()) return {};
  // By the problem's weights, which a misfit has made smaller, and by those of the noise: the misfit may be theirs.
  const double unit = own ? 1 : beyond_noise(optimum);
  const Eigen::MatrixXd prior = Eigen::MatrixXd::Identity(k, k);
  constexpr double kBetter = 9, kOfExcess = 0.2, kWider = 1.2;
  const auto told_by = [&](double units) { return numbers_told(stated, units); };
  const auto gain_by = [&](double units) {
    const Eigen::VectorXd pull = units * stated.pull;
    return pull.dot((prior + units * stated.information).ldlt().solve(pull));
  };
  // By chance each lowers chi-square by one at most; of a misfit that is not theirs, by as much in its own units.
  const std::vector<int> told = told_by(unit);
  const double enough = kBetter + static_cast<double>(told.size()),
               chi_square = own ? problem.objective() : optimum.chi_square(task),
               excess = chi_square - static_cast<double>(problem.pixel_rows());
  // Where the scatter of a few frames is what is known of a misfit, more unknowns would leave it no degrees of freedom:
  // by derivatives then.
  constexpr int kFreedom = 4;
  // Of colours that are nearly described the pixels say what is off.
  constexpr double kNearly = 0.02;
  const bool by_frames = task.frames() > 1 && (scatter || optimum.misfit.beyond_noise) &&
                         !(are_colours(task) && missed_of_contrast(task, optimum) < kNearly);
  if (by_frames && task.frames() < task.unknowns.size() + static_cast<int>(told.size()) + kFreedom) return {};
  if (gain_by(unit) > enough && (gain_by(unit) > kOfExcess * excess || gain_by(1) > enough)) return {told, true, false};
  if (by_frames) return {};
  const Eigen::MatrixXd posterior = (prior + stated.information).ldlt().solve(prior);
  for (Eigen::Index j = 0; j < optimum.searched.size(); ++j) {
    const double noise = inverse.covariance(j, j), stated_alone = stated.shift.row(j).squaredNorm(),
                 fitted = stated.shift.row(j) * posterior * stated.shift.row(j).transpose();
    if (noise + stated_alone > kWider * (noise + fitted)) return {told_by(1), false, false};
  }
  return {bent_numbers(task, optimum, stated, inverse.covariance), false, true};
}

FitJob with_nuisances(const FitJob& job, const std::vector<int>& numbers) {
  FitJob wider = job;
  for (const int index : numbers) {
    Parameter& parameter = wider.parameters[index];
    const double sd = parameter.known_to.of(parameter.value);
    parameter.free = parameter.nuisance = true;
    parameter.prior_sd = sd;
    parameter.lower = parameter.value - kFarthestStated * sd;
    parameter.upper = parameter.value + kFarthestStated * sd;
    if (std::isfinite(parameter.physical_lower)) parameter.lower = std::max(parameter.lower, parameter.physical_lower);
    if (std::isfinite(parameter.physical_upper)) parameter.upper = std::min(parameter.upper, parameter.physical_upper);
  }
  return wider;
}

Optimum with_nuisances_from(const Task& wider, const Task& narrow, Optimum optimum) {
  optimum.searched = widened(wider, narrow, optimum.theta, optimum.searched);
  for (Eigen::VectorXd& rival : optimum.rivals) rival = widened(wider, narrow, optimum.theta, rival);
  optimum.evaluations += optimum.problem->evaluations();
  optimum.problem = problem_of(wider, optimum.frames, optimum.problem->misfit());
  solve_again(wider, optimum, "with what is stated");
  return optimum;
}

Minima widened(const Task& wider, const Task& narrow, const Theta& theta, Minima minima) {
  for (Candidate& candidate : minima.scan.candidates)
    candidate.searched = widened(wider, narrow, theta, candidate.searched);
  return minima;
}

Optimum best_with_nuisances(const Task& wider, const Task& narrow, const Optimum& optimum, const Minima& minima,
                            From from) {
  Minima places;
  places.frames = optimum.frames;
  for (int g = 0; g < wider.frames(); ++g)
    std::erase_if(places.frames[static_cast<std::size_t>(g)].pixels,
                  [&](const std::array<int, 2>& at) { return !wider.picture(g).mask(at[0], at[1]); });
  places.theta = optimum.theta;
  places.evaluations = optimum.evaluations + optimum.problem->evaluations();
  Frames few = places.frames;
  for (Frame& frame : few) {
    frame.pixels =
        subsample(frame.pixels,
                  static_cast<std::size_t>(std::max(50, wider.job.options.scan_pixels / std::max(1, wider.frames()))));
    places.rows += static_cast<double>(frame.pixels.size());
  }
  std::vector<Eigen::VectorXd> starts{widened(wider, narrow, optimum.theta, optimum.searched)};
  std::set<int> focus;
  for_each_scene(wider.job.measurements, [&](const Scene& scene) { focus.insert(scene.microscope.focus_um.index); });
  for (std::size_t j = 0; j < wider.unknowns.searched.size(); ++j) {
    if (!focus.contains(wider.unknowns.searched[j]) || !wider.searched(j).nuisance) continue;
    for (const double by : {-2.0, -1.0, 1.0, 2.0}) {
      starts.push_back(starts.front());
      starts.back()[static_cast<Eigen::Index>(j)] += by * *wider.searched(j).prior_sd;
    }
  }
  const std::size_t most = from == From::in_reach ? 12 : 64;
  for (const Eigen::VectorXd& rival : optimum.rivals)
    if (starts.size() < most) starts.push_back(widened(wider, narrow, optimum.theta, rival));
  const std::vector<Candidate>& found = minima.scan.candidates;
  for (std::size_t i = 1; i < found.size() && starts.size() < most; ++i)
    if (from != From::in_reach || in_reach(found[i].objective, found.front().objective))
      starts.push_back(widened(wider, narrow, optimum.theta, found[i].searched));
  const std::unique_ptr<LeastSquares> problem = problem_of(wider, few, misfit_expected(wider, few, optimum.theta));
  constexpr int kSteps = 8;
  places.scan = from == From::everywhere
                    ? minima_everywhere(*problem, wider, optimum.theta, std::move(starts))
                    : polish(*problem, wider.job, std::move(starts), kSteps, {}, from == From::all_found);
  places.evaluations += problem->evaluations();
  places.stopped = places.scan.interrupted;
  return best_minimum(wider, places, false);
}

bool has_more_stated(const FitJob& job) {
  bool found = has_own_dials(job);
  for_each_scene(job.measurements, [&](const Scene& scene) { found = found || may_be_out_of_focus(job, scene); });
  return found;
}

FitJob with_all_stated(FitJob job) {
  job = with_shared_zeros(std::move(job));
  ParameterRef focus;
  for_each_scene(job.measurements, [&](Scene& scene) {
    if (!may_be_out_of_focus(job, scene)) return;
    if (!focus) {
      focus = job.parameters.add_constant("microscope.focus_um", 0, "um");
      job.parameters[focus].known_to.sd = depth_of_field_um(job, scene);
    }
    scene.microscope.focus_um = focus;
  });
  return job;
}

}  // namespace birefit::estimation
