#pragma once
// Image panels of the report: a PNG inside an SVG with colour bar, scale bar and an optional line. Private to io.

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "birefit/image.h"

namespace birefit {

enum class Colours {
  grey,       ///< black to white
  diverging,  ///< blue, white, red
};

struct ImagePanel {
  const Image* values = nullptr;
  const Mask* mask = nullptr;  ///< pixels left out are hatched; may be null
  Colours colours = Colours::grey;
  double low = 0, high = 1;  ///< of the colour scale; values beyond take the end's colour
  std::string unit;          ///< of the colour bar
  std::string title;         ///< for screen readers
  double pixel_size_um = 0;  ///< for the scale bar; 0 = none
  /// Line drawn over the image: x0, y0, x1, y1 in pixels.
  std::optional<std::array<double, 4>> line;
  int largest_side_px = 700;  ///< larger images are box-averaged
  bool wide = false;          ///< the panel has the page's full width to itself
};

std::string svg(const ImagePanel& panel);

/// Pixels averaged per side by a panel of that size.
int shrink_factor(const Image& values, int largest_side_px);

/// Smallest value v such that `fraction` of the finite values of used pixels are <= v; NaN when there are none.
double quantile(const Image& values, const Mask* mask, double fraction);

}  // namespace birefit
