#pragma once
// How long rendering and fitting take, foreseen from small pictures of the same scenes. Unlike all else here it depends
// on the machine and on what else runs on it.

#include "birefit/fit.h"

namespace birefit {

/// About how long one image takes on one thread, s, without derivatives: measured where it is a moment, else
/// extrapolated from coarser pictures of the same scene, or as the planner says where light is sent as waves. Takes up
/// to a second. 0 for scenes without pixels (directions of light).
double forecast_image(const Scene& scene, const Demand& demand, const Theta& theta, const Observable& observable = {});

/// About how long fit(job) takes, s, by the threads that it is given: pictures alone; right within a factor of three as
/// a rule (docs/methods.md, "How long a fit takes"). Pixels that are left out cost nothing. Takes a second or two.
/// Throws UserError like plan().
double forecast_fit(const FitJob& job);

}  // namespace birefit
