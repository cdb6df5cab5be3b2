#pragma once
// Does a picture hold pixels of several kinds, in cells of 2 x 2?

#include <optional>
#include <string>

#include "birefit/image.h"

namespace birefit {

/// What the cells look like, for a message: "colour (Bayer)", "polarization", "colour (Bayer) or polarization"; nothing
/// where pixels do not alternate along both sides. `smallest_step`: a difference that is none.
std::optional<std::string> find_mosaic(const Image& values, const PixelRect& area, double smallest_step);

}  // namespace birefit
