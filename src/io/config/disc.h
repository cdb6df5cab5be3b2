#pragma once
// The photoelastic disc of a config.

#include "birefit/fit.h"
#include "io/config/reader.h"

namespace birefit {

StressedDisc read_stressed_disc(ConfigReader& reader, const Block& sample);
/// A problem when the rim and what is left out around the forces leave no pixel to fit, by the starts of centre,
/// diameter and direction.
void check_stressed_disc(ConfigReader& reader, const Picture& micrograph);

}  // namespace birefit
