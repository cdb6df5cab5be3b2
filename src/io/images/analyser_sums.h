#pragma once
// Do the codes of a polarization mosaic follow light? Whatever the light, what two crossed analysers let through
// together is all of it, so that two such pairs agree, with any black level, where codes are proportional to light.

#include <array>
#include <optional>

#include "birefit/image.h"

namespace birefit {

/// What the pairs say: light is a value to the power of `gamma`.
struct AnalyserSums {
  double gamma = 1, error = 0;  ///< and its standard error
  double mismatch = 0;          ///< of the pairs' sums where light is polarized, over their mean, at the values
};

/// `analyser_deg`: of the pixels of a cell, rows from the top; `usable`: 1 = neither saturated nor otherwise broken.
/// Values at or below 0 are left out. Nothing where the four angles are no two crossed pairs, or where too few cells or
/// too little polarized light in more than one direction tell nothing: pixels that differ in sensitivity break the sums
/// by a constant share, which is not taken for a gamma.
std::optional<AnalyserSums> analyser_sums(const Image& values, const Mask& usable, const PixelRect& area,
                                          const std::array<std::array<double, 2>, 2>& analyser_deg);

}  // namespace birefit
