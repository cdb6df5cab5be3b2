#pragma once
// Series of data and how they are drawn, in a chart and in its legend. Private to io and app.

#include <string>
#include <vector>

#include "io/report/axis.h"

namespace birefit {

struct DataSeries {
  enum class Kind { line, points, bars };
  enum class Mark { dot, circle, up, down };  ///< a circle is hollow; triangles point up or down
  Kind kind = Kind::line;
  std::string label;         ///< of the legend; "" = not listed
  std::vector<double> x, y;  ///< NaN interrupts a line
  std::string colour;
  double width = 1.6;  ///< of a line, or the diameter of a point
  Mark mark = Mark::dot;
  double dots = 0;  ///< diameter of the points along a line; 0 = none
  /// Ends of an interval about each y: an upright bar through a point, a shaded strip about a line. Empty = none.
  std::vector<double> low{}, high{};
};

std::string draw_series(const DataSeries& series, const AxisScale& x, const AxisScale& y);
/// What stands before a series' label in a legend: 22 wide, around the height `middle`.
std::string legend_symbol(const DataSeries& series, double left, double middle);

}  // namespace birefit
