#pragma once
// Pixels that stand out of a residual: dust, scratches, hot pixels.

#include "birefit/image.h"

namespace birefit::estimation {

struct Outliers {
  Mask pixels;                              ///< 1 = stands out
  int count = 0;                            ///< of them
  int spots = 0;                            ///< groups of neighbours
  int largest_column = 0, largest_row = 0;  ///< a pixel of the largest group
};

/// Of `whitened` (residual over its noise) where `used`: what lies more than 5.5 robust deviations of its surroundings
/// off zero, by single pixels and by means over squares of 3, 5 and 9 pixels of what is left, and the pixels next to
/// it. The surroundings are 64 pixels wide, so that a misfit of fringes or of a rim sets its own scale there and only
/// what is foreign to it stands out; spots wider than about 20 pixels become surroundings themselves. Of white noise
/// one pixel in 10^7.
Outliers find_outliers(const Image& whitened, const Mask& used);

}  // namespace birefit::estimation
