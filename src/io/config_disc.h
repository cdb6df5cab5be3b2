#pragma once
// The photoelastic disc of a config.

#include "birefit/fit.h"
#include "io/config_reader.h"

namespace birefit {

StressedDisc read_stressed_disc(ConfigReader& reader, const Block& sample);
/// Leaves out of a fit what the two forces and the disc's edge spoil, and what is outside; by the starts of centre, diameter
/// and direction. Counted as outside the region. A problem when nothing is left.
void mask_stressed_disc(ConfigReader& reader, Micrograph& micrograph);

}  // namespace birefit
