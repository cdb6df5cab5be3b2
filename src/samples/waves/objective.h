#pragma once
// What wave optics asks of the objective.

#include "birefit/scene.h"

namespace birefit {

/// Throws UserError where wave optics has no aperture to work with: none given, or one above the host's index.
void check_objective(const Scene& scene, double n_host);

}  // namespace birefit
