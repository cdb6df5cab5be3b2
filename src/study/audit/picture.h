#pragma once
// What optics, cameras and files do to a picture. Places and lengths are in pixels, (0, 0) the middle of the top left
// one.

#include "birefit/image.h"

namespace birefit::study {

/// By a Gaussian; beyond the edge the picture goes on as it is there.
Image blurred(const Image& image, double sd_px);
/// About the centre, wider by a share and as much lower: cubic between pixels (Keys), exact for parabolas.
Image stretched(const Image& image, double by, double center_x, double center_y);
/// To the right and down; `beyond`: what comes in from outside.
Image shifted(const Image& image, double by_x, double by_y, double beyond);
/// As JPEG stores it: cosines of blocks of 8 x 8, rounded to the steps of the standard's table of brightness (ITU T.81,
/// annex K) at a quality from 1 to 100. Values from 0 to 255.
Image compressed(const Image& codes, int quality);
/// As a colour camera shows its red: known at even columns and rows, linear between them.
Image every_fourth(const Image& image);
/// Median of the pixels along the four sides.
double level_of_border(const Image& image);

}  // namespace birefit::study
