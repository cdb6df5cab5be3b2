#pragma once
// Colours along an axis, and what looks alike, as SVG text. Private to io and app.

#include <array>
#include <string>
#include <utility>
#include <vector>

namespace birefit {

struct ColourStrips {
  /// Of equal widths from the axis' low end to its high one; codes of red, green and blue, 0 to 1.
  struct Strip {
    std::string name;
    std::vector<std::array<double, 3>> colours;
  };
  /// A dot in the panel below: at x the axis' y looks alike, the more the lower `distance` is.
  struct Double {
    double x = 0, y = 0, distance = 0;
  };
  std::string title;  ///< for screen readers, and above
  std::string label;  ///< of the axis
  double low = 0, high = 1;
  std::vector<Strip> strips;
  std::string doubles_label;
  std::vector<Double> doubles;
  /// From the most alike to the least that is drawn, and the words for each: dots are darker the nearer.
  std::vector<std::pair<double, std::string>> steps;
};

/// As a whole file.
std::string svg_file(const ColourStrips& chart);

}  // namespace birefit
