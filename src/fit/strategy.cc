#include "fit/strategy.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <string>

#include <fmt/format.h>

#include "birefit/memo.h"
#include "fit/errors/left_out.h"
#include "fit/errors/statistics.h"
#include "fit/zone.h"
#include "samples/waves/wave.h"

namespace birefit {
namespace {

using namespace estimation;

/// The time that `other` took belongs to the one that is reported.
void add_effort(FitResult& result, const FitResult& other) {
  result.seconds += other.seconds;
  result.evaluations += other.evaluations;
}

/// Sum of squares of a result's residuals by the weights of another, and their number; by no weights where there are
/// none.
std::pair<double, double> squares_of(const FitResult& result, const FitResult* weights) {
  double sum = 0, n = 0;
  for (std::size_t g = 0; g < result.micrographs.size(); ++g) {
    const std::vector<double>&residual = result.micrographs[g].residual.values(),
          &sigma = (weights ? *weights : result).micrographs[g].sigma.values();
    for (std::size_t i = 0; i < residual.size(); ++i)
      if (std::isfinite(residual[i]) && std::isfinite(sigma[i]) && sigma[i] > 0)
        sum += std::pow(residual[i] / (weights ? sigma[i] : 1), 2), ++n;
  }
  return {sum, n};
}

/// The branch with the best odds, which reports how all of them did.
FitResult best_branch(const FitJob& job, std::vector<FitResult> results) {
  // Each fit settled its own noise: the smallest residual's is the one that all are measured by.
  const FitResult& smallest =
      *std::min_element(results.begin(), results.end(), [](const FitResult& a, const FitResult& b) {
        return squares_of(a, nullptr).first < squares_of(b, nullptr).first;
      });
  const auto [least, pixels] = squares_of(smallest, &smallest);
  const double reduced = std::max(1.0, least / std::max(1.0, pixels - static_cast<double>(smallest.parameters.size())));
  std::vector<double> score;
  std::vector<BranchResult> branches;
  for (std::size_t b = 0; b < results.size(); ++b) {
    BranchResult branch;
    branch.name = job.branches[b].name;
    branch.chi_square = squares_of(results[b], &smallest).first;
    branch.parameters = static_cast<int>(results[b].parameters.size());
    double prior = 0;
    for (const ParameterEstimate& p : results[b].parameters)
      if (p.prior_sd && p.prior_value) prior += std::pow((p.value - *p.prior_value) / *p.prior_sd, 2);
    score.push_back(branch.chi_square / reduced + prior - 2 * results[b].log_share);
    branches.push_back(branch);
  }
  const std::size_t best = static_cast<std::size_t>(std::min_element(score.begin(), score.end()) - score.begin());
  FitResult result = std::move(results[best]);
  std::string others;
  for (std::size_t b = 0; b < branches.size(); ++b) {
    branches[b].odds = std::exp(-0.5 * (score[b] - score[best]));
    branches[b].reported = b == best;
    if (b == best) continue;
    if (branches[b].odds > kAmbiguousOdds) result.ambiguous = true;
    others += fmt::format("{}{} {:.2g}", others.empty() ? "" : ", ", branches[b].name, branches[b].odds);
    add_effort(result, results[b]);
  }
  result.verdict = fmt::format("Branch: {} (odds of the others against it: {}{}). ", branches[best].name, others,
                               result.ambiguous ? "; the image does not decide between them" : "") +
                   result.verdict;
  result.branches = std::move(branches);
  return result;
}

/// What straight rays came to, or where the choice is open and curved ones matter, the fit with those.
FitResult with_chosen_rays(const FitJob& job, Outcome straight) {
  if (!job.options.choose_rays || !(straight.by_curved_rays >= 1)) return std::move(straight.result);
  FitJob curved = job;
  curved.options.choose_rays = false;
  curved.demand.rays = Rays::eikonal;
  FitResult better = fit_one(curved).result;
  for (MicrographResult& m : better.micrographs)
    m.plan.reasons.push_back(
        fmt::format("curved rays were chosen: they describe the image as well or better, and straight ones shift a "
                    "parameter by {:.3g} standard errors",
                    straight.by_curved_rays));
  add_effort(better, straight.result);
  return better;
}

/// A prior that the data contradict may hold the fit where they are not described at all: says what they would have
/// without it.
FitResult with_doubted_priors(const FitJob& job, FitResult result) {
  const auto misfit = [](const FitResult& r) {
    double chi_square = 0, values = 0;
    for (const MicrographResult& m : r.micrographs) chi_square += m.chi_square, values += m.used;
    return chi_square / std::max(1.0, values - static_cast<double>(r.parameters.size()));
  };
  FitJob without = job;
  int priors = 0;
  for (int i = 0; i < without.parameters.size(); ++i)
    if (without.parameters[i].free && without.parameters[i].prior_sd) without.parameters[i].prior_sd.reset(), ++priors;
  constexpr double kBad = 4, kBetter = 0.1;
  if (priors == 0 || result.interrupted || misfit(result) < kBad) return result;
  const FitResult free = fit_one(without).result;
  add_effort(result, free);
  if (free.interrupted || !free.converged || misfit(free) > kBetter * misfit(result)) return result;
  std::string words;
  for (const ParameterEstimate& p : result.parameters) {
    if (!p.prior_sd || !p.prior_value) continue;
    for (const ParameterEstimate& q : free.parameters)
      if (q.name == p.name && std::abs(q.value - *p.prior_value) > 4 * std::hypot(*p.prior_sd, q.stderr_))
        words += fmt::format("{}{} = {:.4g} +- {:.2g} instead of {:.4g} +- {:.2g}{}", words.empty() ? "" : ", ", q.name,
                             q.value, q.stderr_, *p.prior_value, *p.prior_sd, q.unit.empty() ? "" : " " + q.unit);
  }
  if (words.empty()) return result;
  result.verdict = fmt::format(
                       "Data and prior contradict each other: without the prior the data's reduced chi-square falls "
                       "from {:.3g} to {:.3g}, with {}. One of the two is wrong. ",
                       misfit(result), misfit(free), words) +
                   result.verdict;
  result.identifiable = false;
  return result;
}

/// Every branch, by rays or waves as the job demands.
FitResult fit_by_given_waves(const FitJob& job) {
  if (job.branches.size() < 2) return with_doubted_priors(job, with_chosen_rays(job, fit_one(job)));
  std::vector<FitJob> jobs;
  for (const SampleBranch& branch : job.branches) {
    FitJob& one = jobs.emplace_back(job);
    one.branches.clear();
    std::size_t at = 0;
    for_each_scene(one.measurements, [&](Scene& scene) { scene.sample = branch.samples[at++]; });
    for (const int index : branch.idle) one.parameters[index].free = false;
    if (job.options.progress)
      one.options.progress = [&](const std::string& line) { job.options.progress(branch.name + ": " + line); };
  }
  std::vector<Outcome> outcomes = fit_side_by_side(jobs);
  std::vector<FitResult> results;
  for (std::size_t b = 0; b < outcomes.size(); ++b) {
    results.push_back(with_chosen_rays(jobs[b], std::move(outcomes[b])));
    if (results.back().interrupted) return std::move(results.back());
  }
  return best_branch(job, std::move(results));
}

/// How waves would be done for a job's spheres.
struct Waves {
  double seconds = 0;  ///< of a fit
  bool series = true;  ///< all of them exact, at no more than rays cost
  std::string words;
};
Waves waves_of(const FitJob& job) {
  Waves waves;
  const Theta theta = job.parameters.values();
  double an_image = 0;
  for_each_scene(job.measurements, [&](const Scene& scene) {
    const WaveChoice choice = wave_choice(scene, job.demand, theta);
    an_image += choice.seconds_an_image;
    waves.words = choice.words;
    waves.series = waves.series && choice.series;
  });
  int searched = 1;
  for (int i = 0; i < job.parameters.size(); ++i) searched += job.parameters[i].free && !job.parameters[i].linear;
  // What a fit takes, from what one image does: some 15 evaluations with derivatives, each as dear as one image a
  // parameter and one more, and as many again for the neighbouring orders, on all threads.
  waves.seconds = 15.0 * (waves.series ? 20 : 1) * an_image * searched;
  return waves;
}

bool is_in_white_light(const FitJob& job) {
  bool white = false;
  for_each_scene(job.measurements, [&](const Scene& scene) { white = white || scene.microscope.channel_light; });
  return white;
}
/// Rays that curve go other ways at every wavelength.
bool has_dispersion(const FitJob& job) {
  bool dispersion = false;
  for_each_scene(job.measurements, [&](const Scene& scene) {
    const auto* constant = std::get_if<ConstantIndices>(&scene.material);
    dispersion = dispersion || !constant || constant->resonance_nm || scene.surround_dispersion;
  });
  return dispersion;
}

/// By rays or by waves, as they matter. In white light a fit by waves, or by curved rays where there is dispersion,
/// takes minutes, and is only made where it is asked for: what straight rays leave out is in the errors all the same.
FitResult fit_by_chosen_waves(const FitJob& job) {
  if (is_in_white_light(job)) {
    FitJob by_rays = job;
    by_rays.options.choose_waves = false;
    by_rays.options.choose_rays = job.options.choose_rays && !has_dispersion(job);
    return fit_by_given_waves(by_rays);
  }
  if (!job.options.choose_waves) return fit_by_given_waves(job);
  FitJob chosen = job;
  chosen.options.choose_waves = false;
  const Waves waves = waves_of(job);
  if (waves.seconds > job.options.max_seconds) {
    chosen.warnings.push_back(
        fmt::format("{} A fit would take about {:.2g} s, more than physics.max_seconds: {:g}; rays are taken instead.",
                    waves.words, waves.seconds, job.options.max_seconds));
    return fit_by_given_waves(chosen);
  }
  FitResult by_rays;
  if (!waves.series) {
    chosen.options.choose_rays = false;
    Outcome rays = fit_one(chosen);
    by_rays = std::move(rays.result);
    if (by_rays.interrupted || rays.by_waves < kShiftThatMatters) {
      if (job.branches.size() > 1 && !by_rays.interrupted) return fit_by_given_waves(chosen);  // by rays, every branch
      for (MicrographResult& m : by_rays.micrographs)
        if (!by_rays.interrupted)
          m.plan.reasons.push_back(fmt::format(
              "rays suffice: wave optics would shift no parameter by more than {:.2g} standard errors", rays.by_waves));
      return by_rays;
    }
  }
  chosen.demand.ceiling = Ceiling::wave;
  FitResult better = fit_by_given_waves(chosen);
  add_effort(better, by_rays);
  return better;
}

/// What a table's noise was read off, its neighbouring rows, may differ by far more than noise: where several columns
/// vary, or one in large steps. Scales such noise to what the model leaves over, where that is clearly less; says
/// whether it did.
bool lower_noise_of_rows(const FitResult& result, FitJob& job, std::vector<std::string>& words) {
  struct Table {
    Readings* readings;
    double chi_square = 0, rows = 0;
  };
  std::vector<Table> tables;
  double rows = 0;
  std::size_t frame = 0;
  for (Measurement& measurement : job.measurements) {
    Readings* readings = std::get_if<Readings>(&measurement);
    Table table{readings};
    for (std::size_t i = 0; i < (readings ? readings->rows.size() : 1) && frame < result.micrographs.size(); ++i) {
      const MicrographResult& m = result.micrographs[frame++];
      table.chi_square += m.chi_square, table.rows += m.used;
    }
    rows += table.rows;
    if (readings && readings->noise && readings->noise_at_most) tables.push_back(table);
  }
  const double free = rows - static_cast<double>(result.parameters.size());
  bool lower = false;
  for (const Table& table : tables) {
    constexpr double kClearly = 0.5, kByChance = 1e-3, kRounding = 1e-6;
    const double own = table.rows * free / rows;  // degrees of freedom
    double& noise = table.readings->noise->read_counts;
    const double least = kRounding * table.readings->values.cwiseAbs().maxCoeff();
    if (!(own >= 1) || !(noise > 2 * least) || table.chi_square > kClearly * own ||
        table.chi_square > chi_square_quantile(kByChance, own))
      continue;
    noise = std::max(least, noise * std::sqrt(table.chi_square / own));
    lower = true;
    words.push_back(
        fmt::format("{}: neighbouring rows differ by more than noise, which is taken from what the model "
                    "leaves over, {:.3g}: chi-square does not tell whether the model is right.",
                    table.readings->name, noise));
  }
  return lower;
}

FitResult fit_by_settled_noise(const FitJob& job) {
  FitResult result = fit_by_chosen_waves(job);
  FitJob again = job;
  constexpr int kRounds = 3;  // the first may have ended in another valley
  for (int round = 0; round < kRounds && !result.interrupted; ++round) {
    std::vector<std::string> words;
    if (!lower_noise_of_rows(result, again, words)) break;
    FitResult better = fit_by_chosen_waves(again);
    add_effort(better, result);
    result = std::move(better);
    result.warnings.insert(result.warnings.end(), words.begin(), words.end());
  }
  return result;
}

}  // namespace

FitResult fit(const FitJob& job) {
  if (job.demand.memo) return fit_following_zones(job, fit_by_settled_noise);
  FitJob remembering = job;
  remembering.demand.memo = std::make_shared<Memo>();
  return fit_following_zones(remembering, fit_by_settled_noise);
}

}  // namespace birefit
