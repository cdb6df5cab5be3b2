#pragma once
// Where the codes of a picture end, and what was darker or brighter is not known.

#include <optional>

#include "birefit/image.h"

namespace birefit {

/// Pixels that pile up at the lowest or highest code of the area, where their noise is more than half a code (of less
/// noise, even light has one code by right): over 0.5 % of them, and three times as many as at the next code.
enum class End { lowest, highest };
struct CutEnd {
  double code = 0;
  double share = 0;  ///< of the area's pixels
};
/// Of values that are codes. `noise_sd`: stands for that of pixels which are not cut where there are none, and has to
/// be two codes then.
std::optional<CutEnd> find_cut_end(End end, const Image& values, const PixelRect& area,
                                   std::optional<double> noise_sd = {});
/// Of neighbours, none of them at this code: the middle one of three off the others' mean, a measure without the
/// picture's slope. Nothing where there are none.
std::optional<double> noise_of_neighbours(const Image& values, const PixelRect& area,
                                          std::optional<double> without_code = {});

}  // namespace birefit
