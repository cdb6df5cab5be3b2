#pragma once
// Line charts as SVG text, without a library: the report must open anywhere, for years, and so must the pictures of
// `series`, `chart` and `stress`. Private to io and app.

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "io/report/marks.h"

namespace birefit {

/// A vertical line across the panel.
struct Marker {
  double x = 0;
  std::string label, colour;
  bool dashed = false;
};

/// A shaded horizontal strip behind the data.
struct ChartBand {
  double low = 0, high = 0;
  std::string colour;
};

struct Panel {
  std::string y_label;
  int height = 200;  ///< of the plotting area
  bool log_y = false;
  std::optional<std::pair<double, double>> y_range;  ///< else from the series
  std::vector<DataSeries> series;
  std::vector<Marker> markers;
  std::vector<ChartBand> bands;
};

struct Chart {
  std::string title;  ///< for screen readers
  std::string x_label;
  std::optional<std::pair<double, double>> x_range;
  std::vector<Panel> panels;  ///< stacked, one x axis
  int width = 430;
  bool log_x = false;
  std::string heading;  ///< above the first panel; "" = none
};

/// Charts in rows: a picture that is a file of its own.
struct Sheet {
  std::string title;          ///< for screen readers
  std::vector<Chart> charts;  ///< row by row
  int columns = 1;
  /// What the series of all charts look like, by their labels; x and y are not looked at. In the first place of the
  /// last row that no chart takes or, where there is none, above all.
  std::vector<DataSeries> legend;
};

/// As an element of a page, which gives it its font and background.
std::string svg(const Chart& chart);
/// As a whole file.
std::string svg_file(const Sheet& sheet);

}  // namespace birefit
