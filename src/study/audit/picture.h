#pragma once
// What optics, cameras and files do to a picture. Shares are of its range.

#include <random>

#include "birefit/image.h"

namespace birefit::study {

/// By a Gaussian; beyond the edge the picture goes on as it is there.
Image blurred(const Image& image, double sd_px);
/// The picture as it is at (x', y') = centre + (a (x - cx) , (y - cy)): cubic between pixels.
Image stretched(const Image& image, double by, double center_x, double center_y);
Image shifted(const Image& image, double by_x, double by_y, double beyond);
/// As JPEG stores it: cosines of blocks of 8 x 8, rounded to the steps of the standard's table of brightness (ITU T.81,
/// annex K) at a quality from 1 to 100. Values from 0 to 255.
Image compressed(const Image& codes, int quality);
/// Median of the pixels along the four sides.
double level_of_border(const Image& image);

}  // namespace birefit::study
