#pragma once
// From stored codes to values a fit can trust: linear light, and which pixels to leave out and why.

#include <optional>
#include <string>

#include "birefit/io.h"
#include "core/cut_end.h"

namespace birefit {

/// How codes follow light: `transfer:` of a micrograph.
struct Transfer {
  enum class Kind { linear, srgb, gamma, table } kind = Kind::linear;
  double gamma = 1;
  std::vector<double> code = {}, light = {};  ///< of a table: as many, both growing, three or more
};

/// Codes to values proportional to light, on the scale of the codes (the top code stays where it is).
void linearise(Image& values, const Transfer& transfer, double top_code);

/// The lowest code that counts as saturated; infinity for floats without `saturation_counts`.
struct Saturation {
  double from = 0;
  bool pile_up = false;  ///< found in the histogram below the file's top code
  int pile_up_pixels = 0;
};
/// Given counts stand; else the file's top code, or a lower code at which many pixels of the area pile up.
Saturation find_saturation(const LoadedImage& image, const PixelRect& area, std::optional<double> given);

enum class Smoothness {
  image,  ///< fringes may be as fine as pixels: only isolated pixels are suspect
  frame,  ///< a calibration frame: whatever leaves its neighbourhood is suspect
};
/// Finds dead and hot pixels among the usable ones of the area: more than 8 robust standard deviations (at their
/// brightness) from the median of their 5 x 5 neighbourhood. Clears them in `mask`; returns how many.
int exclude_outliers(const Image& values, const PixelRect& area, double smallest_step, Smoothness smoothness,
                     Mask& mask);

/// The same where pixels see different things in cells of 2 x 2: among the neighbours of each kind.
int exclude_outliers_in_cells(const Image& values, const PixelRect& area, double smallest_step, Smoothness smoothness,
                              Mask& mask);

/// Median of the usable pixels of the area and 1.4826 times their median absolute deviation; NaN without any.
struct RobustSpread {
  double median = 0, sd = 0;
  int count = 0;
};
RobustSpread robust_spread(const Image& values, const Mask& mask, const PixelRect& area);

}  // namespace birefit
