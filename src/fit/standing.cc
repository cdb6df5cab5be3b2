#include "fit/standing.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "birefit/memo.h"
#include "fit/zone.h"

namespace birefit::estimation {
namespace {

FitJob in_branch(FitJob job, std::size_t chosen) {
  if (!job.demand.memo) job.demand.memo = std::make_shared<Memo>();
  if (job.branches.size() < 2) return job;
  const SampleBranch branch = job.branches[chosen];
  job.branches.clear();
  std::size_t at = 0;
  for_each_scene(job.measurements, [&](Scene& scene) { scene.sample = branch.samples[at++]; });
  for (const int index : branch.idle) job.parameters[index].free = false;
  return job;
}

}  // namespace

FitJob as_begun(FitJob job) {
  job = in_branch(std::move(job), 0);
  const Theta theta = job.parameters.values();
  for (Measurement& measurement : job.measurements)
    if (Picture* picture = std::get_if<Picture>(&measurement)) picture->mask = fitted_pixels(*picture, theta);
  return job;
}

FitJob as_ended(FitJob job, const FitResult& result) {
  std::size_t chosen = 0;
  for (std::size_t b = 0; b < result.branches.size(); ++b)
    if (result.branches[b].reported) chosen = b;
  job = in_branch(std::move(job), std::min(chosen, job.branches.empty() ? 0 : job.branches.size() - 1));
  for (int i = 0; i < job.parameters.size() && i < static_cast<int>(result.theta.size()); ++i)
    if (!job.parameters[i].free) job.parameters[i].value = result.theta[static_cast<std::size_t>(i)];
  if (!result.micrographs.empty()) {
    const std::shared_ptr<Memo> memo = job.demand.memo;
    job.demand = result.micrographs[0].plan.demand;
    job.demand.memo = memo;
  }
  return job;
}

void take_from(const FitResult& result, Frames& frames) {
  for (std::size_t g = 0; g < std::min(frames.size(), result.micrographs.size()); ++g) {
    const MicrographResult& of = result.micrographs[g];
    Frame& frame = frames[g];
    frame.plan = of.plan;
    frame.noise = of.noise;
    frame.sigma = of.sigma;
    frame.pixels.clear();
    for (int y = 0; y < of.residual.height(); ++y)
      for (int x = 0; x < of.residual.width(); ++x)
        if (std::isfinite(of.residual(x, y))) frame.pixels.push_back({x, y});
  }
}

}  // namespace birefit::estimation
