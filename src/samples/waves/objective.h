#pragma once
// What wave optics asks of the objective.

#include "scene/values.h"

namespace birefit {

/// Throws UserError where wave optics has no aperture to work with: none given, or one above the host's index.
void check_objective(const Scene& scene, const Values<double>& value, double n_host);

}  // namespace birefit
