#include "fit/errors/report.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "fit/errors/catalogue.h"
#include "fit/errors/discrepancy.h"
#include "fit/errors/lamp_and_camera.h"
#include "fit/errors/verdict.h"
#include "samples/kind.h"

namespace birefit::estimation {
namespace {

/// A slow misfit, like that of uneven light, may be far below the noise of a pixel and still shift a parameter by many
/// standard errors: what the residual holds of each parameter's own pattern says by how much. It holds what `inverse`
/// has beyond the noise as well: the larger of the two counts. Returns the largest factor on a standard error.
double pay_for_misfit(const LeastSquares& problem, const Inverse& of_noise, Inverse& inverse) {
  const Eigen::VectorXd along = problem.misfit_along(of_noise.covariance);
  Eigen::VectorXd factor = Eigen::VectorXd::Ones(along.size());
  for (Eigen::Index j = 0; j < along.size(); ++j)
    if (const double variance = inverse.covariance(j, j); variance > 0)
      factor[j] = std::sqrt(std::max(1.0, along[j] * along[j] * of_noise.covariance(j, j) / variance));
  inverse.covariance = factor.asDiagonal() * inverse.covariance * factor.asDiagonal();
  return factor.size() > 0 ? factor.maxCoeff() : 1;
}

/// In every direction of the unknowns the larger of two variances: what is known well as a combination of several stays
/// so unless the other one says otherwise.
Eigen::MatrixXd larger_of(const Eigen::MatrixXd& covariance, const Eigen::MatrixXd& other) {
  const Eigen::VectorXd sd = covariance.diagonal().cwiseSqrt(), per_sd = sd.cwiseInverse();
  const Eigen::LLT<Eigen::MatrixXd> root(per_sd.asDiagonal() * covariance * per_sd.asDiagonal());
  if (root.info() != Eigen::Success) {
    const Eigen::VectorXd wider = other.diagonal().cwiseMax(0).cwiseSqrt().cwiseQuotient(sd).cwiseMax(1);
    return wider.asDiagonal() * covariance * wider.asDiagonal();
  }
  // In units in which the first is 1 the other one's axes are those of both.
  const Eigen::MatrixXd half = root.matrixL().solve(Eigen::MatrixXd(per_sd.asDiagonal() * other * per_sd.asDiagonal())),
                        relative = root.matrixL().solve(Eigen::MatrixXd(half.transpose()));
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(0.5 * (relative + relative.transpose()));
  const Eigen::MatrixXd along = sd.asDiagonal() * (root.matrixL() * axes.eigenvectors());
  return along * axes.eigenvalues().cwiseMax(1).asDiagonal() * along.transpose();
}

/// Noise that was read off the rows of a table is no better known than by as many rows: what these leave over counts in
/// place of it where it is more. 1 elsewhere, and where rows are seen to scatter by more than noise, or as a lamp does,
/// which holds it.
double beyond_noise_read(const Task& task, const Optimum& optimum) {
  const bool read =
      std::all_of(task.sights.begin(), task.sights.end(), [](const Sight& sight) { return sight.noise_of_rows; }) &&
      !optimum.misfit.frames_scatter && !(optimum.misfit.lamp_share > 0);
  return read ? std::max(1.0, optimum.reduced_chi_square(task)) : 1;
}

/// What the standard errors contain, in words.
std::string covariance_words(const Task& task, const Optimum& optimum, const Covariances& covariances,
                             const LeftOut& left_out) {
  constexpr double kOfNote = 0.5;  // of a frame's variance: more than what no fit of several frames can exclude
  const MisfitFound& found = optimum.misfit;
  const std::optional<JointPrior>& prior = task.job.prior;
  std::string words;
  double largest = 1;
  for (const Misfit& misfit : optimum.problem->misfit()) largest = std::max(largest, misfit.shape_variance);
  if (found.frames_scatter)
    words = fmt::format("{} scatter by {:.2g} of the model intensity about the joint fit",
                        are_rows(optimum.frames) ? "misfit included: the rows" : "clustered by image: the frames",
                        found.frame_sd);
  else if (prior && prior->frame_scatter)
    words = fmt::format("frame misfit of {:.2g} of the model intensity from the prior's fit included",
                        prior->frame_scatter->intensity_sd);
  if (found.lamp_share > kOfNote)
    words += fmt::format("{}{:.2g} % of jitter of the lamp between frames included", words.empty() ? "" : "; ",
                         100 * found.lamp_jitter);
  if (found.row_length > 1.5) words += fmt::format(", {:.2g} neighbours alike", found.row_length);
  if (found.beyond_noise) {
    if (!words.empty()) words += "; ";
    words += found.largest_area > 1.5
                 ? fmt::format("scaled by reduced chi-square {:.3g} and the {:.3g} pixels that share one misfit",
                               largest / found.largest_area, found.largest_area)
                 : fmt::format("scaled by reduced chi-square {:.3g}", largest);
  }
  if (const double more = beyond_noise_read(task, optimum); words.empty() && more > 1.05)
    words = fmt::format("scaled by reduced chi-square {:.3g}: the rows' noise is read off the rows", more);
  if (words.empty()) words = "white noise: the noise model explains the residuals";
  if (covariances.along > 1)
    words += fmt::format(", standard errors up to {:.2g} times larger by what the residual does along the parameters",
                         covariances.along);
  if (covariances.discrepancy()) words += ", and what a discrepancy of the size that is left over could do";
  const Eigen::MatrixXd& propagation = left_out.propagation;
  if (!propagation.isZero(0))
    words += ", and the error of wave propagation" + std::string(propagation.cols() > 1 ? " and of sampling" : "") +
             " by the exact image of a radial twin";
  if (left_out.by_curved_rays) words += ", and what curved rays would change";
  const bool fitted = std::any_of(task.unknowns.searched.begin(), task.unknowns.searched.end(),
                                  [&](int index) { return task.job.parameters[index].nuisance; });
  if (fitted || (covariances.stated.shift.size() > 0 && !covariances.stated.shift.isZero(0)))
    words += ", and what is stated and not known exactly";
  if (!covariances.by_light.empty()) words += ", and " + covariances.by_light;
  if (left_out.by_waves) words += ", and what rays lose of a wave-optical image";
  if (left_out.by_light) words += ", and what another lamp or camera would change";
  return words;
}

/// Degrees of freedom of the t quantile behind the intervals: the fewest of all that the standard errors are made of.
double interval_freedom(const Task& task, const Optimum& optimum, const Covariances& covariances,
                        const FitResult& result) {
  const MisfitFound& found = optimum.misfit;
  double dof = found.frames_scatter ? found.frame_dof : std::max(1.0, result.degrees_of_freedom / found.largest_area);
  // Of a sum of variances the one of which is known by few frames (F. E. Satterthwaite, Biometrics Bull. 2, 110
  // (1946)): what is taken for a lamp's jitter need not be one, nor have its prior's tail.
  if (!found.frames_scatter && found.lamp_share > 0)
    dof = std::min(dof, found.frame_dof / (found.lamp_share * found.lamp_share));
  if (covariances.along > 1) dof = std::min(dof, static_cast<double>(LeastSquares::kLeastModulations));
  if (const std::optional<JointPrior>& prior = task.job.prior) {
    dof = std::min(dof, prior->degrees_of_freedom);
    if (prior->frame_scatter) dof = std::min(dof, prior->frame_scatter->degrees_of_freedom);
  }
  return dof;
}

/// What one whole frame is off by, of the model intensity: what frames scatter by, the lamp's jitter on their mean
/// light included; nothing where they show neither.
std::optional<double> scatter_of_frames(const Task& task, const Optimum& optimum) {
  constexpr double kShown = 0.5;
  const MisfitFound& found = optimum.misfit;
  if (!found.frames_scatter && !(found.lamp_share > kShown)) return std::nullopt;
  double light = 0;
  for (int g = 0; g < task.frames(); ++g)
    if (const double gain = task.gain_of(g, optimum.theta); gain != 0)
      light += std::pow(optimum.problem->frame_misfit(g).mean_light / gain, 2) / task.frames();
  return std::hypot(found.frame_sd, found.lamp_jitter * std::sqrt(light));
}

/// A rival that lies inside the intervals makes no answer ambiguous, and one that is close by becomes part of them:
/// with either as likely as the other the variance is that of both together.
void take_in_close_rivals(const Task& task, FitResult& result) {
  constexpr double kCloseBy = 4, kOfValue = 0.02;  // half-widths; the hull is then three, or a hundredth of the value
  const double t = student_t_quantile(0.975, result.interval_degrees_of_freedom);
  result.ambiguous = false;
  for (RivalMinimum& rival : result.rivals) {
    if (!rival.counts) continue;
    Eigen::VectorXd change = Eigen::VectorXd::Zero(task.unknowns.size());
    bool inside = true, close = true;
    for (std::size_t j = 0; j < task.unknowns.searched.size(); ++j) {
      if (task.searched(j).nuisance) continue;
      const auto index = static_cast<std::size_t>(task.unknowns.searched[j]);
      const auto row = static_cast<Eigen::Index>(j);
      change[row] = rival.theta[index] - result.theta[index];
      const double half = t * std::sqrt(result.covariance(row, row)), away = std::abs(change[row]);
      inside = inside && away <= half;
      close = close && (away <= kCloseBy * half || away + 2 * half <= kOfValue * std::abs(result.theta[index]));
    }
    if (!close) {
      result.ambiguous = true;
      continue;
    }
    rival.counts = false;
    if (!inside) result.covariance += 0.25 * change * change.transpose();
  }
}

}  // namespace

Covariances covariances_of(const Task& task, const Optimum& optimum, const Eigen::MatrixXd& propagation) {
  Covariances covariances;
  covariances.factor = optimum.problem->factor();
  covariances.of_noise = invert_normal_equations(covariances.factor);
  covariances.with_misfit = covariances.of_noise;
  // What the lamp does is not one value: errors are those over all that it may be.
  if (const Eigen::VectorXd& wider = optimum.misfit.lamp_wider; wider.size() > 0)
    covariances.with_misfit.covariance = wider.asDiagonal() * covariances.with_misfit.covariance * wider.asDiagonal();
  covariances.with_misfit.covariance *= beyond_noise_read(task, optimum);
  covariances.with_misfit.covariance += propagation * propagation.transpose();
  covariances.along = pay_for_misfit(*optimum.problem, covariances.of_noise, covariances.with_misfit);
  return covariances;
}

void pay_for_discrepancy(const Task& task, const Optimum& optimum, Covariances& covariances) {
  Eigen::MatrixXd& covariance = covariances.with_misfit.covariance;
  if (!optimum.explained)
    for (const Eigen::MatrixXd& one : covariances_by_discrepancy(task, optimum)) {
      const Eigen::VectorXd sd = one.diagonal().cwiseMax(0).cwiseSqrt();
      covariances.by_discrepancy = covariances.discrepancy() ? covariances.by_discrepancy.cwiseMax(sd) : sd;
      covariance = larger_of(covariance, one);
    }
  if (!optimum.came_from) return;
  // What the fit without the catalogue would have answered: no explanation is sure enough to make it impossible.
  Eigen::VectorXd step = Eigen::VectorXd::Zero(task.unknowns.size());
  for (int j = 0; j < task.unknowns.size(); ++j)
    if (const auto index = static_cast<std::size_t>(task.unknowns.table_index(j));
        index < optimum.came_from->size() && !task.job.parameters[task.unknowns.table_index(j)].nuisance)
      step[j] = optimum.theta[index] - (*optimum.came_from)[index];
  covariance += step * step.transpose();
  const Eigen::VectorXd aspect = shift_by_aspect(task, optimum, covariances.of_noise.covariance);
  if (aspect.size() > 0) covariance += aspect * aspect.transpose();
}

void pay_for_stated(const Task& task, const Optimum& optimum, Covariances& covariances) {
  if (optimum.stopped || task.unknowns.searched.empty()) return;
  Stated stated = stated_numbers(task, optimum, covariances.of_noise.covariance);
  if (!stated.shift.allFinite()) return;
  Eigen::MatrixXd& covariance = covariances.with_misfit.covariance;
  covariance += stated.shift * stated.shift.transpose();
  covariances.stated = std::move(stated);
  const LampAndCamera light = by_lamp_and_camera(task, optimum, covariances.of_noise.covariance);
  if (light.covariance.size() == 0) return;
  covariance += light.covariance;
  covariances.of_light = light.covariance;
  constexpr double kOfNote = 0.05;  // of a variance
  if ((light.covariance.diagonal().array() > kOfNote * covariance.diagonal().array()).any())
    covariances.by_light = light.of_drift_alone ? "a lamp that drifts" : "what lamp and camera usually depart by";
}

/// Several even pictures are a number each: no more of them than unknowns agree with any model.
bool has_nothing_to_check(const Task& task, const LeastSquares& problem) {
  constexpr double kEven = 1e-9;
  if (task.frames() < 2 || task.job.prior || task.unknowns.size() < task.frames()) return false;
  for (int g = 0; g < task.frames(); ++g) {
    const auto [low, high] = problem.intensity_range(g);
    if (!task.picture(g).uneven.empty() || high - low > kEven * std::max(std::abs(high), std::abs(low))) return false;
  }
  return true;
}

/// What a line of FitJob::taken_as_exact begins with may have been asked since (catalogue.h).
bool is_fitted_since(const Task& task, const std::string& line) {
  return std::any_of(task.unknowns.searched.begin(), task.unknowns.searched.end(), [&](int index) {
    const Parameter& parameter = task.job.parameters[index];
    return parameter.nuisance && line.starts_with(parameter.name + " ");
  });
}

FitResult report(const Task& task, Optimum& optimum, const Minima& minima, Rivals rivals, const LeftOut& left_out,
                 Covariances covariances, bool beaten) {
  FitResult result;
  result.theta = optimum.theta;
  result.converged = optimum.converged;
  result.solver_report = optimum.solver_report;
  result.iterations = optimum.iterations;
  result.scans = minima.scan.traces;
  result.identifiable = optimum.possible;
  result.rivals = std::move(rivals.minima);
  result.warnings = optimum.warnings;
  for (const std::string& line : task.job.taken_as_exact)
    if (!is_fitted_since(task, line)) result.taken_as_exact.push_back(line);
  if (has_nothing_to_check(task, *optimum.problem))
    result.taken_as_exact.push_back(
        "the model itself: the pictures tell as many numbers as are fitted, and nothing is left to check it by. A "
        "picture that is wrong, or a lamp that is not steady, would not show.");
  result.warnings.insert(result.warnings.end(), left_out.warnings.begin(), left_out.warnings.end());
  result.interrupted = (optimum.stopped && !beaten) || task.interrupted();
  if (result.interrupted) result.converged = false;

  const double data_chi_square = optimum.chi_square(task);
  result.chi_square = data_chi_square + optimum.problem->prior_chi_square();
  result.degrees_of_freedom = optimum.degrees_of_freedom(task);
  result.reduced_chi_square = optimum.reduced_chi_square(task);
  if (const std::optional<double> sd = scatter_of_frames(task, optimum))
    result.frame_scatter = JointPrior::FrameScatter{*sd, optimum.misfit.frame_dof};
  result.interval_degrees_of_freedom = interval_freedom(task, optimum, covariances, result);

  Eigen::MatrixXd& covariance = covariances.with_misfit.covariance;
  for (const Eigen::VectorXd& change : left_out.changes()) covariance += change * change.transpose();
  result.log_share = log_share(projected_information(*optimum.problem), task.job, task.unknowns);
  result.covariance = covariance;
  result.stated_covariance = stated_covariance(task, covariances);
  take_in_close_rivals(task, result);
  result.covariance_kind = covariance_words(task, optimum, covariances, left_out);

  report_parameters(task, optimum, covariances.of_noise, result);
  const Eigen::VectorXd inverse_sd =
      result.covariance.diagonal().unaryExpr([](double v) { return v > 0 ? 1 / std::sqrt(v) : 0.0; });
  result.correlation = inverse_sd.asDiagonal() * result.covariance * inverse_sd.asDiagonal();
  result.correlation.diagonal().setOnes();
  judge_identifiability(result, task.job, task.unknowns, covariances.factor, covariances.of_noise);
  weigh_inputs(task, optimum, covariances.of_noise, result);
  const bool signal = judge_description(task, optimum, data_chi_square, minima.scan.points, result);
  if (!signal) result.identifiable = false;
  std::string misfit;
  const bool nearly = (covariances.discrepancy() && (task.frames() == 1 || are_of_spheres(task))) || left_out.by_light;
  const bool round = traits_of(task.picture(0).scene).round.has_value();
  if (nearly && result.described && (round || task.frames() == 1))
    misfit = judge_discrepancy(task, optimum, covariances.of_noise, result);
  else if (result.described && covariances.discrepancy() && are_rows(optimum.frames))
    misfit = judge_rows(task, optimum, result);
  report_stated(task, optimum, covariances, result);
  keep_inputs_of_note(task, result);
  report_micrographs(task, optimum, result);
  collect_warnings(task, optimum, result);
  compare_strips(task, optimum, result);
  if (task.unknowns.size() == 0)
    result.warnings.emplace_back("No parameter is marked `fit`: the image was only compared.");
  result.evaluations = optimum.evaluations + optimum.problem->evaluations();
  // Since then, too: profiles and warnings may be half done.
  if (task.interrupted()) result.interrupted = true, result.converged = false;
  result.departures = departures_of(task, result);
  report_derived(task, covariances, result);
  leave_nuisances(task, result);
  judge_misfit(task, optimum, covariances, result);
  result.verdict = (misfit.empty() ? "" : misfit + " ") + verdict(result, signal);
  return result;
}

}  // namespace birefit::estimation
