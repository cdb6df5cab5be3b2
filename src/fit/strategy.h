#pragma once
// Which fits are worth their time: branches of a sample, straight or curved rays, rays or waves, with a prior and
// without.

#include <span>
#include <vector>

#include "birefit/fit.h"

namespace birefit::estimation {

/// A fit, and what its model leaves out would change, in standard errors (LeftOut).
struct Outcome {
  FitResult result;
  double by_curved_rays = 0, by_waves = 0;
};

/// The fit of one branch by one physics, search included.
Outcome fit_one(const FitJob& job);

/// The same of several jobs side by side, the branches of one sample: what the search shows to be beaten is not
/// finished. Fewer than there are jobs when interrupted.
std::vector<Outcome> fit_side_by_side(std::span<const FitJob> jobs);

}  // namespace birefit::estimation
