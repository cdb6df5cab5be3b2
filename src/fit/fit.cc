// One fit, from a job to its result. Alternatives (branches, curved rays, waves) are in strategy.cc.

#include <chrono>
#include <limits>

#include "fit/errors/left_out.h"
#include "fit/errors/report.h"
#include "fit/strategy.h"
#include "fit/weights/settle.h"

namespace birefit::estimation {
namespace {

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

Optimum settle(const Task& task, Optimum optimum) {
  optimum = with_settled_weights(task, std::move(optimum));
  optimum = with_settled_plans(task, std::move(optimum));
  optimum = with_settled_outliers(task, std::move(optimum));
  return with_settled_misfit(task, std::move(optimum));
}

/// The fit from the search's minima on. What another branch has beaten is reported where the search left it.
Outcome finish(const Task& task, Minima minima, bool beaten) {
  Optimum optimum = settle(task, best_minimum(task, minima, beaten));
  Rivals rivals = weigh_rivals(task, optimum);
  LeftOut left_out;
  measure_propagation(task, optimum, left_out);
  Covariances covariances = covariances_of(optimum, left_out.propagation);
  const Eigen::VectorXd sd = covariances.with_misfit.covariance.diagonal().cwiseMax(0).cwiseSqrt();
  foretell_curved_rays(task, optimum, sd, left_out);
  foretell_waves(task, optimum, sd, left_out);
  FitResult result =
      report(task, optimum, std::move(minima), std::move(rivals), left_out, std::move(covariances), beaten);
  return {std::move(result), left_out.change_by_curved_rays, left_out.change_by_waves};
}

}  // namespace

Outcome fit_one(const FitJob& job) { return std::move(fit_side_by_side({&job, 1}).front()); }

std::vector<Outcome> fit_side_by_side(std::span<const FitJob> jobs) {
  // A branch whose misfit per pixel, by the same noise, is this many times the best one's has lost.
  constexpr double kBeaten = 10;
  double best = std::numeric_limits<double>::infinity();
  std::vector<Task> tasks;
  std::vector<Minima> minima;
  std::vector<double> seconds;
  for (const FitJob& job : jobs) {
    const Clock::time_point begin = Clock::now();
    tasks.emplace_back(job);
    minima.push_back(search(tasks.back(), prepare(tasks.back()), kBeaten * best));
    best = std::min(best, minima.back().lowest_per_pixel());
    seconds.push_back(seconds_since(begin));
  }
  std::vector<Outcome> outcomes;
  for (std::size_t b = 0; b < jobs.size(); ++b) {
    const Clock::time_point begin = Clock::now();
    const bool beaten = minima[b].lowest_per_pixel() > kBeaten * best;
    outcomes.push_back(finish(tasks[b], std::move(minima[b]), beaten));
    outcomes.back().result.seconds = seconds[b] + seconds_since(begin);
    if (outcomes.back().result.interrupted) break;
  }
  return outcomes;
}

}  // namespace birefit::estimation
