#pragma once
// Several round objects in one picture: which one the config means.

#include <vector>

#include "birefit/io.h"

namespace birefit {

/// What is known of the diameter of the one that is meant, in pixels.
struct DiameterPx {
  double start = 0, least = 0, most = 0;
  bool holds(const DiscGuess& disc) const { return 2 * disc.radius_px >= least && 2 * disc.radius_px <= most; }
};
/// That of a parameter in um; bounds that are not stated are 0.8 and 1.25 of its value, and 15 % are allowed for what
/// is seen of a disc.
DiameterPx diameter_px(const Parameter& diameter_um, double pixel_um);

/// Round objects that stand apart by a fifth of the diameter and are at least 0.4 times as large, the largest first;
/// empty where there are not at least two, or where they are the rings of one. Places are those of the values' pixels.
std::vector<DiscGuess> find_discs(const Image& values, const Mask& mask, const DiameterPx& diameter);

}  // namespace birefit
