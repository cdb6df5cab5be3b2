#pragma once
// Several round objects in one picture: which one the config means.

#include <vector>

#include "birefit/io.h"

namespace birefit {

/// Round objects that stand apart by a quarter of `least_diameter_px` and are at least half as large, the largest
/// first; empty where there are not at least two. Places are those of the values' pixels.
std::vector<DiscGuess> find_discs(const Image& values, const Mask& mask, double least_diameter_px);

}  // namespace birefit
