#include "io/report/colour_grid.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "io/report/axis.h"
#include "io/report/format.h"

namespace birefit {
namespace {

constexpr double kRow = 15, kColumn = 40, kCell = 13, kBar = 16, kBarHeight = 300, kMargin = 14;
constexpr double kSlope = 35;  ///< degrees, of the names of columns
constexpr const char* kGrey = "#cccccc";

std::array<int, 3> channels(const std::string& colour) {
  std::array<int, 3> of{};
  for (std::size_t i = 0; i < 3; ++i)
    if (colour.size() >= 3 + 2 * i) of[i] = std::strtol(colour.substr(1 + 2 * i, 2).c_str(), nullptr, 16);
  return of;
}

std::string colour_of(const ColourGrid& grid, double value) {
  const auto& palette = grid.palette;
  if (!(value > palette.front().first)) return palette.front().second;
  for (std::size_t i = 1; i < palette.size(); ++i) {
    if (!(value < palette[i].first)) continue;
    const double share = AxisScale{palette[i - 1].first, palette[i].first, 0, 1, true}(value);
    const std::array<int, 3> from = channels(palette[i - 1].second), to = channels(palette[i].second);
    std::string colour = "#";
    for (std::size_t k = 0; k < 3; ++k)
      colour += fmt::format("{:02x}", static_cast<int>(std::lround(from[k] + share * (to[k] - from[k]))));
    return colour;
  }
  return palette.back().second;
}

/// The scale of colours, its numbers, and what grey is.
std::string legend(const ColourGrid& grid, double left, double top) {
  const AxisScale y{grid.palette.front().first, grid.palette.back().first, top + kBarHeight, top, true};
  std::string out = "<linearGradient id=\"colours\" x1=\"0\" y1=\"1\" x2=\"0\" y2=\"0\">";
  for (const auto& [value, colour] : grid.palette)
    out += fmt::format("<stop offset=\"{:.4f}\" stop-color=\"{}\"/>", (y.from - y(value)) / kBarHeight, colour);
  out += fmt::format(
      "</linearGradient>\n<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"url(#colours)\" stroke=\"{}\" "
      "stroke-width=\"0.9\"/>\n",
      left, top, kBar, kBarHeight, kFrame);
  int power = 0;
  for (const AxisTick& tick : axis_ticks(y, 8, power, true))
    out += fmt::format("<path d=\"M{} {:.1f}h4\" stroke=\"{}\"/><text x=\"{}\" y=\"{:.1f}\">{}</text>\n", left + kBar,
                       y(tick.value), kFrame, left + kBar + 8, y(tick.value) + 4, tick.label);
  out += fmt::format("<text transform=\"translate({} {}) rotate(-90)\" text-anchor=\"middle\">{}</text>\n",
                     left + kBar + 54, top + kBarHeight / 2, with_power(grid.value_label, power));
  const double grey = top + kBarHeight + 20;
  return out + fmt::format(
                   "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"{}\"/><text x=\"{}\" "
                   "y=\"{}\">{}</text>\n",
                   left, grey, kBar, kCell, kGrey, left + kBar + 8, grey + 10.5, escape_html(grid.grey_label));
}

}  // namespace

std::string svg_file(const ColourGrid& grid) {
  double groups = 0, names = 0, columns = 0;
  for (const ColourGrid::Row& row : grid.rows)
    groups = std::max(groups, width_of(row.group)), names = std::max(names, width_of(svg_number(row.name)));
  for (const std::string& column : grid.columns) columns = std::max(columns, width_of(column));
  const double slope = kSlope * 3.14159265358979 / 180, left = kMargin + groups + 12 + names + 8;
  const double top = kMargin + columns * std::sin(slope) + 16, right = left + kColumn * grid.columns.size();
  // The name of the last column reaches over the scale.
  const double bar = right + 24, width = std::max(bar + kBar + 12 + width_of(grid.grey_label),
                                                  right - kColumn / 2 + columns * std::cos(slope)) +
                                         kMargin;
  const double bottom = top + kRow * grid.rows.size(), height = std::max(bottom, top + kBarHeight + 50) + kMargin;

  std::string out = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0:.0f} {1:.0f}\" width=\"{0:.0f}\" height=\"{1:.0f}\" "
      "font-family=\"sans-serif\" font-size=\"11.5\" fill=\"{2}\">\n<title>{3}</title>\n<rect width=\"{0:.0f}\" "
      "height=\"{1:.0f}\" fill=\"white\"/>\n",
      width, height, kInk, escape_html(grid.title));
  for (std::size_t i = 0; i < grid.columns.size(); ++i)
    out += fmt::format("<text transform=\"translate({:.1f} {:.1f}) rotate({})\">{}</text>\n",
                       left + kColumn * (i + 0.5) - 2, top - 6, -kSlope, escape_html(grid.columns[i]));
  std::string lines;
  for (std::size_t i = 0; i < grid.rows.size(); ++i) {
    const double y = top + kRow * i + 11.5;
    if (i == 0 || grid.rows[i].group != grid.rows[i - 1].group) {
      out += fmt::format("<text x=\"{}\" y=\"{:.1f}\">{}</text>\n", kMargin, y, escape_html(grid.rows[i].group));
      if (i > 0) lines += fmt::format("M{} {:.1f}H{:.1f}", kMargin, top + kRow * i, right);
    }
    out += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"end\">{}</text>\n", left - 8, y,
                       svg_number(escape_html(grid.rows[i].name)));
  }
  out += fmt::format("<path d=\"{}\" stroke=\"#d5d9de\" stroke-width=\"0.8\"/>\n", lines);
  for (const ColourGrid::Cell& cell : grid.cells)
    out += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{}\" height=\"{}\" fill=\"{}\"/>\n",
                       left + kColumn * (cell.column + 0.5) - kCell, top + kRow * cell.row + (kRow - kCell) / 2,
                       2 * kCell, kCell, cell.value ? colour_of(grid, *cell.value) : kGrey);
  out += fmt::format(
      "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"none\" stroke=\"{}\" "
      "stroke-width=\"0.9\"/>\n",
      left, top, right - left, bottom - top, kFrame);
  return out + legend(grid, bar, top) + "</svg>\n";
}

}  // namespace birefit
