// One fit, from a job to its result. Alternatives (branches, curved rays, waves) are in strategy.cc.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <deque>
#include <limits>
#include <memory>
#include <utility>

#include <fmt/format.h>

#include "fit/errors/catalogue.h"
#include "fit/errors/discrepancy.h"
#include "fit/errors/foreign.h"
#include "fit/errors/left_out.h"
#include "fit/errors/report.h"
#include "fit/errors/samples.h"
#include "fit/errors/stated.h"
#include "fit/strategy.h"
#include "fit/weights/settle.h"

namespace birefit::estimation {
namespace {

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

Optimum settle(const Task& task, Optimum optimum) {
  optimum = with_settled_range(task, std::move(optimum));
  optimum = with_settled_weights(task, std::move(optimum));
  optimum = with_settled_plans(task, std::move(optimum));
  optimum = with_settled_outliers(task, std::move(optimum));
  return with_settled_misfit(task, std::move(optimum));
}

/// Rivals, what the model leaves out, errors and words: everything but the values. `beyond_weights`: the covariance of
/// all unknowns that the errors have beside what the weights make.
Outcome judge(const Task& task, Optimum& optimum, const Minima& minima, bool beaten, Eigen::MatrixXd& beyond_weights) {
  Rivals rivals = weigh_rivals(task, optimum);
  LeftOut left_out;
  measure_propagation(task, optimum, left_out);
  Covariances covariances = covariances_of(task, optimum, left_out.propagation);
  const Eigen::VectorXd sd = covariances.with_misfit.covariance.diagonal().cwiseMax(0).cwiseSqrt();
  foretell_curved_rays(task, optimum, sd, left_out);
  foretell_waves(task, optimum, sd, left_out);
  foretell_light(task, optimum, left_out);
  pay_for_discrepancy(task, optimum, covariances);
  pay_for_stated(task, optimum, covariances);
  beyond_weights = covariances.with_misfit.covariance - covariances.of_noise.covariance;
  for (const Eigen::VectorXd& change : left_out.changes()) beyond_weights += change * change.transpose();
  FitResult result = report(task, optimum, minima, std::move(rivals), left_out, std::move(covariances), beaten);
  return {std::move(result), left_out.change_by_curved_rays, left_out.change_by_waves};
}

/// What the search shows not to be described, fitted to a part of large images without errors to be trusted; nothing
/// where that is described after all.
std::optional<Outcome> given_up(const Task& task, Minima minima) {
  constexpr std::size_t kPixels = 1 << 16;
  std::size_t all = 0, used = 0;
  for (const Frame& frame : minima.frames) all += frame.pixels.size();
  for (Frame& frame : minima.frames) {
    if (all > kPixels)
      frame.pixels = subsample(frame.pixels, std::max<std::size_t>(50, kPixels * frame.pixels.size() / all));
    used += frame.pixels.size();
  }
  Optimum optimum = best_minimum(task, minima, false);
  if (optimum.stopped) return std::nullopt;
  optimum.stopped = true;  // nothing is worth settling
  optimum.warnings.push_back(fmt::format(
      "None of the {} places that the search looked at describes what there is to see: the fit ended there{}.",
      minima.scan.points, used < all ? fmt::format(", with {} of {} pixels", used, all) : ""));
  Eigen::MatrixXd beyond_weights;
  Outcome outcome = judge(task, optimum = settle(task, std::move(optimum)), minima, true, beyond_weights);
  if (outcome.result.has_answer()) return std::nullopt;
  return outcome;
}

/// Judged, and once more from where a profile has gone on to and the solver had not.
Outcome concluded(const Task& task, const Minima& minima, Optimum optimum, bool beaten) {
  Eigen::MatrixXd beyond_weights;
  Outcome outcome = judge(task, optimum, minima, beaten, beyond_weights);
  constexpr int kTimes = 2;
  for (int i = 0; i < kTimes && optimum.better && !optimum.stopped; ++i) {
    optimum.rivals.push_back(optimum.searched);
    optimum.searched = *std::exchange(optimum.better, std::nullopt);
    solve_again(task, optimum, "from a better place on a profile");
    optimum = with_settled_misfit(task, std::move(optimum));
    outcome = judge(task, optimum, minima, beaten, beyond_weights);
  }
  if (task.job.options.samples > 0 && !beaten) {
    outcome.result.samples = draw_samples(task, optimum, outcome.result, beyond_weights);
    if (!outcome.result.samples)
      outcome.result.warnings.push_back(
          "No draws from the posterior: the fit was interrupted, or what is unknown has neither bounds nor an "
          "influence.");
  }
  return outcome;
}

/// A fit of another job than the one that was asked for: with more unknowns, or fewer pixels.
struct Refit {
  explicit Refit(FitJob of) : job(std::move(of)), task(job) {}
  FitJob job;
  Task task;
  Optimum optimum;
};

/// Without specks, or without all outside of the sphere, whichever leaves less over; nothing where neither takes a
/// fifth off.
std::unique_ptr<Refit> without_foreign(const Task& task, const Optimum& optimum, const Minima& minima) {
  const double before = excess_of(optimum);
  double least = std::numeric_limits<double>::infinity();
  std::unique_ptr<Refit> best;
  for (FitJob& job : narrower_jobs(task, optimum)) {
    auto fitted = std::make_unique<Refit>(std::move(job));
    fitted->optimum = settle(fitted->task, best_with_nuisances(fitted->task, task, optimum, minima));
    if (fitted->optimum.stopped) return nullptr;
    const double after = excess_of(fitted->optimum);
    if (!is_worth_leaving_out(before, after) || !(after < least)) continue;
    least = after;
    best = std::move(fitted);
  }
  return best;
}

/// Whether a number that is fitted along for what it is known to lies where it would hardly be.
bool is_far_from_stated(const Task& task, const Optimum& optimum) {
  constexpr double kHardly = 3;  // standard deviations, one of several
  for (std::size_t j = 0; j < task.unknowns.searched.size(); ++j) {
    const Parameter& parameter = task.searched(j);
    if (parameter.nuisance && parameter.prior_sd &&
        std::abs(optimum.searched[static_cast<Eigen::Index>(j)] - parameter.value) > kHardly * *parameter.prior_sd)
      return true;
  }
  return false;
}

/// Of one picture of directions, as a plate's: whether a hundredth of its contrast is missed with what is fitted along,
/// or only that far from where it is stated describes it. The right minimum may then be none that a search with
/// everything as stated has seen.
bool asks_everywhere(const Task& task, const Optimum& optimum) {
  constexpr double kMissed = 0.01;
  return !optimum.stopped && task.frames() == 1 && traits_of(task.picture(0).scene).directions &&
         (is_far_from_stated(task, optimum) || (optimum.misfit.beyond_noise && missed_of_all(task, optimum) > kMissed));
}

/// The best of minima everywhere; `optimum` where the fit was interrupted.
Optimum best_everywhere(const Task& task, const Minima& minima, Optimum optimum) {
  task.say("not described with what is stated fitted along: looking everywhere");
  Optimum other = settle(task, best_with_nuisances(task, task, optimum, minima, From::everywhere));
  return other.stopped ? std::move(optimum) : std::move(other);
}

/// All that pictures are known to depart by, fitted at once; nothing where that is not to be believed. `everywhere`:
/// where that asks for it.
std::unique_ptr<Refit> with_all_departures(const Task& task, const Optimum& optimum, const Minima& minima,
                                           bool everywhere = false) {
  task.say("something is left over: what pictures depart by is fitted as well");
  auto wider = std::make_unique<Refit>(with_catalogue(task, optimum));
  wider->optimum = settle(wider->task, best_with_nuisances(wider->task, task, optimum, minima));
  if (everywhere && asks_everywhere(wider->task, wider->optimum))
    wider->optimum =
        best_everywhere(wider->task, widened(wider->task, task, optimum.theta, minima), std::move(wider->optimum));
  if (wider->optimum.stopped ||
      !believes_catalogue(missed_of_all(task, optimum), missed_of_all(wider->task, wider->optimum)))
    return nullptr;
  wider->optimum.came_from = optimum.theta;
  return wider;
}

/// Without specks, of any sample in any number of pictures, where they are most of what is left over.
std::unique_ptr<Refit> without_specks(const Task& task, const Optimum& optimum, const Minima& minima) {
  if (!are_specks_most(task, optimum)) return nullptr;
  task.say("specks are most of what is left over: once more without them");
  FitJob job = task.job;
  job.options.leave_out_outliers = true;
  auto fitted = std::make_unique<Refit>(std::move(job));
  fitted->optimum = settle(fitted->task, best_with_nuisances(fitted->task, task, optimum, minima));
  if (fitted->optimum.stopped || !is_worth_leaving_out(excess_of(optimum), excess_of(fitted->optimum))) return nullptr;
  return fitted;
}

/// Several pictures with all that they may depart by together, where that takes a fifth off what is left over; of bars
/// four fifths: else it is something in the sample.
std::unique_ptr<Refit> explained(const Task& task, Optimum& optimum, const Minima& minima) {
  if (!asks_catalogue(task, optimum)) return nullptr;
  std::unique_ptr<Refit> wider = with_all_departures(task, optimum, minima);
  constexpr double kNearlyAll = 0.2;
  if (!wider) return nullptr;
  const double before = excess_of(optimum), after = excess_of(wider->optimum);
  const bool worth = are_of_spheres(task) ? is_worth_leaving_out(before, after) : after < kNearlyAll * before;
  return worth ? std::move(wider) : nullptr;
}

/// Where something is left over, its causes are asked for; where these do not explain all of it, what is foreign to the
/// object is left out and the rest asked again. `minima` are of this task.
Outcome with_what_is_left(const Task& task, const Minima& minima, Optimum optimum, bool beaten) {
  if (beaten || optimum.stopped) return concluded(task, minima, std::move(optimum), beaten);
  if (asks_everywhere(task, optimum) && !asks_catalogue(task, optimum))
    optimum = best_everywhere(task, minima, std::move(optimum));
  if (task.frames() > 1 || !asks_catalogue(task, optimum)) {
    std::unique_ptr<Refit> less = without_specks(task, optimum, minima);
    if (task.frames() > 1)
      if (std::unique_ptr<Refit> wider =
              less ? explained(less->task, less->optimum, minima) : explained(task, optimum, minima))
        less = std::move(wider);
    if (!less) return concluded(task, minima, std::move(optimum), false);
    const Minima places = widened(less->task, task, less->optimum.theta, minima);
    return concluded(less->task, places, std::move(less->optimum), false);
  }
  std::unique_ptr<Refit> last = with_all_departures(task, optimum, minima), less;
  if (asks_everywhere(task, optimum) && (!last || asks_everywhere(last->task, last->optimum))) {
    optimum = best_everywhere(task, minima, std::move(optimum));
    last = asks_catalogue(task, optimum) ? with_all_departures(task, optimum, minima, true) : nullptr;
  }
  if (!last || leaves_discrepancy(last->task, last->optimum)) {
    less = without_foreign(task, optimum, minima);
    if (less && asks_catalogue(less->task, less->optimum))
      last = with_all_departures(less->task, less->optimum, minima);
    else if (less)
      last = nullptr;
  }
  if (!last) last = std::move(less);
  if (!last) return concluded(task, minima, std::move(optimum), false);
  const Minima places = widened(last->task, task, last->optimum.theta, minima);
  return concluded(last->task, places, std::move(last->optimum), false);
}

/// With what is stated fitted along, is another minimum about as likely as the best, and elsewhere in what is asked
/// for?
bool has_close_rival(const Task& wider, const Optimum& optimum) {
  // Of chi-square, 7 to 10: where what is stated is exact, minima that need it elsewhere pay more than that for it.
  constexpr double kClose = 0.7;
  constexpr double kApart = 5;  // standard errors, as of rivals
  LeastSquares& problem = *optimum.problem;
  problem.evaluate(optimum.searched, true);
  const double best = deviance(wider, problem);
  const Eigen::MatrixXd root = projected_information(problem);
  const Eigen::VectorXd sd = (root.transpose() * root)
                                 .ldlt()
                                 .solve(Eigen::MatrixXd::Identity(root.cols(), root.cols()))
                                 .diagonal()
                                 .cwiseSqrt();
  SolveOptions few;
  few.max_iterations = 10;
  const bool close = std::any_of(optimum.rivals.begin(), optimum.rivals.end(), [&](Eigen::VectorXd rival) {
    problem.solve(rival, few);
    bool elsewhere = false;
    for (Eigen::Index k = 0; k < rival.size(); ++k)
      elsewhere = elsewhere || (!wider.searched(static_cast<std::size_t>(k)).nuisance &&
                                std::abs(rival[k] - optimum.searched[k]) > kApart * sd[k]);
    return elsewhere && deviance(wider, problem) < best + kClose;
  });
  problem.evaluate(optimum.searched, true);
  return close;
}

/// The best of all minima with these numbers free, where another is about as likely: the right one may be far above one
/// that takes a stated number as it is. Of pictures for which looking costs next to nothing; nothing elsewhere, and
/// where frames scatter, whose scatter is all that is known of a misfit.
std::unique_ptr<Refit> beside_close_rivals(const Task& task, const Minima& minima, const Optimum& optimum,
                                           const std::vector<int>& numbers) {
  if (!costs_microseconds(task) || minima.scan.candidates.size() < 2 || optimum.misfit.frames_scatter ||
      optimum.stopped || numbers.empty())
    return nullptr;
  auto wider = std::make_unique<Refit>(with_nuisances(task.job, numbers));
  wider->optimum = best_with_nuisances(wider->task, task, optimum, minima, From::all_found);
  if (wider->optimum.stopped || wider->optimum.rivals.empty()) return nullptr;
  wider->optimum = settle(wider->task, std::move(wider->optimum));
  return has_close_rival(wider->task, wider->optimum) ? std::move(wider) : nullptr;
}

/// Minima along each number that is asked for become rivals: numbers that are fitted along can open some that the
/// search without them has not seen, as the other side of a half wave. All else is as it is at the optimum, or, where
/// it moves along no straight line, follows for a few steps. Of pictures for which looking costs next to nothing.
void look_along(const Task& wider, Optimum& optimum, bool bent) {
  constexpr int kPlaces = 128, kPlacesOfBent = 32, kSteps = 8;
  if (optimum.stopped || !costs_microseconds(wider)) return;
  SolveOptions few;
  few.max_iterations = kSteps;
  few.interrupted = wider.job.options.interrupted;
  for (Eigen::Index j = 0; j < optimum.searched.size(); ++j) {
    const Parameter& parameter = wider.searched(static_cast<std::size_t>(j));
    if (parameter.nuisance || parameter.prior_sd || !std::isfinite(parameter.upper - parameter.lower)) continue;
    few.held = static_cast<int>(j);
    std::vector<Eigen::VectorXd> places;
    std::vector<double> objective;
    const int last = bent ? kPlacesOfBent : kPlaces;
    for (int i = 0; i <= last; ++i) {
      Eigen::VectorXd x = optimum.searched;
      x[j] = parameter.lower + (parameter.upper - parameter.lower) * i / last;
      if (bent)
        optimum.problem->solve(x, few);
      else
        optimum.problem->evaluate(x, false);
      objective.push_back(optimum.problem->objective());
      places.push_back(std::move(x));
    }
    for (std::size_t i = 1; i + 1 < places.size(); ++i)
      if (objective[i] < objective[i - 1] && objective[i] <= objective[i + 1]) optimum.rivals.push_back(places[i]);
  }
  optimum.problem->evaluate(optimum.searched, true);
}

/// The fit from the search's minima on. What another branch has beaten is reported where the search left it.
Outcome finish(const Task& task, const Minima& minima, bool beaten) {
  if (minima.hopeless && !beaten)
    if (std::optional<Outcome> outcome = given_up(task, minima)) return std::move(*outcome);
  Optimum optimum = settle(task, best_minimum(task, minima, beaten));
  if (task.job.options.values_only) return concluded(task, minima, std::move(optimum), beaten);
  const WorthFitting told = worth_fitting(task, optimum);
  if (!told.better) {
    const std::vector<int> numbers = told.numbers.empty() ? told_numbers(task, optimum) : told.numbers;
    if (const auto wider = beside_close_rivals(task, minima, optimum, numbers)) {
      const Minima places = widened(wider->task, task, wider->optimum.theta, minima);
      return with_what_is_left(wider->task, places, std::move(wider->optimum), beaten);
    }
  }
  if (told.numbers.empty()) return with_what_is_left(task, minima, std::move(optimum), beaten);
  task.say("what is stated and not known exactly is fitted as well");
  const FitJob job = with_nuisances(task.job, told.numbers);
  const Task wider(job);
  optimum = told.better ? settle(wider, best_with_nuisances(wider, task, optimum, minima))
                        : with_settled_misfit(wider, with_nuisances_from(wider, task, std::move(optimum)));
  look_along(wider, optimum, told.bent);
  const Minima places = widened(wider, task, optimum.theta, minima);
  return with_what_is_left(wider, places, std::move(optimum), beaten);
}

}  // namespace

Outcome fit_one(const FitJob& job) { return std::move(fit_side_by_side({&job, 1}).front()); }

std::vector<Outcome> fit_side_by_side(std::span<const FitJob> jobs) {
  // A branch whose misfit per pixel, by the same noise, is this many times the best one's has lost.
  constexpr double kBeaten = 10;
  double best = std::numeric_limits<double>::infinity();
  std::deque<FitJob> completed;  // tasks refer to them
  std::vector<Task> tasks;
  tasks.reserve(jobs.size());  // problems refer to theirs
  std::vector<Minima> minima;
  std::vector<double> seconds;
  for (const FitJob& job : jobs) {
    const Clock::time_point begin = Clock::now();
    tasks.emplace_back(has_more_stated(job) ? completed.emplace_back(with_all_stated(job)) : job);
    minima.push_back(search(tasks.back(), prepare(tasks.back()), kBeaten * best));
    best = std::min(best, minima.back().lowest_per_pixel());
    seconds.push_back(seconds_since(begin));
  }
  std::vector<Outcome> outcomes;
  for (std::size_t b = 0; b < jobs.size(); ++b) {
    const Clock::time_point begin = Clock::now();
    const bool beaten = minima[b].lowest_per_pixel() > kBeaten * best;
    outcomes.push_back(finish(tasks[b], minima[b], beaten));
    outcomes.back().result.seconds = seconds[b] + seconds_since(begin);
    if (outcomes.back().result.interrupted) break;
  }
  return outcomes;
}

}  // namespace birefit::estimation
