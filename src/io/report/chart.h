#pragma once
// Line charts as SVG text, without a library: the report must open anywhere, for years. Private to io.

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace birefit {

struct Series {
  enum class Kind { line, points, bars };
  Kind kind = Kind::line;
  std::string label;         ///< of the legend; "" = not listed
  std::vector<double> x, y;  ///< NaN interrupts a line
  std::string colour;
  double width = 1.6;  ///< of a line, or the diameter of a point
};

/// A vertical line across the panel.
struct Marker {
  double x = 0;
  std::string label, colour;
  bool dashed = false;
};

/// A shaded horizontal strip behind the data.
struct Band {
  double low = 0, high = 0;
  std::string colour;
};

struct Panel {
  std::string y_label;
  int height = 200;  ///< of the plotting area
  bool log_y = false;
  std::optional<std::pair<double, double>> y_range;  ///< else from the series
  std::vector<Series> series;
  std::vector<Marker> markers;
  std::vector<Band> bands;
};

struct Chart {
  std::string title;  ///< for screen readers
  std::string x_label;
  std::optional<std::pair<double, double>> x_range;
  std::vector<Panel> panels;  ///< stacked, one x axis
  int width = 430;
};

/// Steps of 1, 2 or 5 times a power of ten: the multiples inside [low, high], about `count` of them.
std::vector<double> nice_ticks(double low, double high, int count);
/// Decimals that the ticks of `step` need.
std::string tick_label(double value, double step);

std::string svg(const Chart& chart);

}  // namespace birefit
