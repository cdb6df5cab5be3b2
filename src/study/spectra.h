#pragma once
// Traps for sums over wavelengths: whole pictures in white light and behind filters.

#include "birefit/study.h"

namespace birefit::study {

/// Retardances up to where sums alias, lines as narrow and as wide as there are, echoes whose fringes are finer than
/// the light's, rims of droplets: each as planned for 1e-4 against a sum with as many wavelengths as it has detail.
void measure_light_traps(bool quick, std::vector<StressPoint>& points);

}  // namespace birefit::study
