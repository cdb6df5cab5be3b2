#pragma once
// A coloured cell for each of many rows and columns, as SVG text. Private to io and app.

#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace birefit {

struct ColourGrid {
  struct Row {
    std::string group, name;  ///< a group's name stands once, at its first row
  };
  struct Cell {
    std::size_t row = 0, column = 0;
    std::optional<double> value;  ///< positive; none = grey
  };
  std::string title;  ///< for screen readers
  std::vector<std::string> columns;
  std::vector<Row> rows;
  std::vector<Cell> cells;  ///< the others stay white
  /// From the lowest value to the highest: colours ("#rrggbb"), blended by the values' logarithms in between. Two at
  /// least.
  std::vector<std::pair<double, std::string>> palette;
  std::string value_label;  ///< of the scale of colours
  std::string grey_label;   ///< what a grey cell is
};

/// As a whole file.
std::string svg_file(const ColourGrid& grid);

}  // namespace birefit
