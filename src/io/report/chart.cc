#include "io/report/chart.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include <fmt/format.h>

#include "io/report/format.h"

namespace birefit {
namespace {

constexpr double kLeft = 62, kRight = 14, kTop = 8, kBottom = 44, kGap = 14, kLegend = 20, kHeading = 20;
constexpr double kEntry = 17;  ///< a line of a sheet's legend
constexpr const char* kFaint = "#e3e6ea";

/// Of a chart on a page or in a file: there labels are of any length, and logarithmic axes have small ticks.
struct Look {
  bool in_file = false;
  double left = kLeft;
};

template <class Visit>
void visit_values(const Panel& panel, bool x, bool log, Visit visit) {
  const auto see = [&](const std::vector<double>& values) {
    for (const double value : values)
      if (std::isfinite(value) && (!log || value > 0)) visit(value);
  };
  for (const DataSeries& series : panel.series) {
    see(x ? series.x : series.y);
    if (!x) see(series.low), see(series.high);
  }
}

std::pair<double, double> range_of_y(const Panel& panel) {
  if (panel.y_range) return *panel.y_range;
  double low = std::numeric_limits<double>::infinity(), high = -low;
  visit_values(panel, false, panel.log_y, [&](double v) { low = std::min(low, v), high = std::max(high, v); });
  if (!(low <= high)) return panel.log_y ? std::pair{1.0, 10.0} : std::pair{0.0, 1.0};
  if (panel.log_y) {
    const double margin = std::max(std::pow(high / low, 0.07), 1.02);
    return {low / margin, high * margin};
  }
  const double margin = high > low ? 0.06 * (high - low) : std::max(0.05 * std::abs(high), 1e-12);
  return {low - margin, high + margin};
}

std::pair<double, double> range_of_x(const Chart& chart) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const Panel& panel : chart.panels)
    visit_values(panel, true, chart.log_x, [&](double v) { low = std::min(low, v), high = std::max(high, v); });
  if (chart.x_range) std::tie(low, high) = *chart.x_range;
  if (!(low <= high)) return chart.log_x ? std::pair{1.0, 10.0} : std::pair{0.0, 1.0};
  if (chart.log_x && !chart.x_range) {
    const double margin = std::max(std::pow(high / low, 0.03), 1.02);
    return {low / margin, high * margin};
  }
  return low < high ? std::pair{low, high} : std::pair{low - 0.5, high + 0.5};
}

std::vector<AxisTick> ticks_of_y(const Panel& panel, const AxisScale& y, const Look& look, int& power) {
  return axis_ticks(y, std::clamp(panel.height / 32, 3, 8), power, look.in_file);
}

/// Labels of powers of ten are short.
std::vector<AxisTick> ticks_of_x(const AxisScale& x, const Look& look, int& power) {
  return axis_ticks(x, std::clamp(static_cast<int>((x.to - x.from) / (x.log ? 42 : 70)), 3, 12), power, look.in_file);
}

/// Text that would be longer than `room` is squeezed into it: names in a file are of any length.
std::string squeezed(const std::string& label, double room, const Look& look) {
  return look.in_file && width_of(label) > room
             ? fmt::format(" textLength=\"{:.0f}\" lengthAdjust=\"spacingAndGlyphs\"", room)
             : "";
}

std::string draw_legend(const Panel& panel, double left, double top) {
  std::string out;
  double at = left;
  const auto entry = [&](const std::string& symbol, const std::string& label) {
    out += symbol;
    out += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" fill=\"{}\">{}</text>", at + 22, top + 4, kInk,
                       escape_html(label));
    at += 34 + 6.2 * label.size();
  };
  for (const DataSeries& series : panel.series)
    if (!series.label.empty()) entry(legend_symbol(series, at, top), series.label);
  for (const Marker& marker : panel.markers)
    if (!marker.label.empty())
      entry(fmt::format("<path d=\"M{:.1f} {:.1f}v11\" stroke=\"{}\" stroke-width=\"1.4\"{}/>", at + 10, top - 5.5,
                        marker.colour, marker.dashed ? " stroke-dasharray=\"3 2.5\"" : ""),
            marker.label);
  return out;
}

/// For who cannot see it: what is drawn against what, and between which numbers.
std::string alternative_text(const Chart& chart, double x_low, double x_high) {
  std::string text = chart.title + ".";
  for (const Panel& panel : chart.panels) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    visit_values(panel, false, panel.log_y, [&](double v) { low = std::min(low, v), high = std::max(high, v); });
    std::string names;
    for (const DataSeries& series : panel.series)
      if (!series.label.empty()) names += (names.empty() ? ": " : ", ") + series.label;
    text += fmt::format(" {}{}", panel.y_label, names);
    if (low <= high) text += fmt::format(", from {:.4g} to {:.4g}", low, high);
    text += ".";
  }
  return text + fmt::format(" Against {} from {:.4g} to {:.4g}.", chart.x_label, x_low, x_high);
}

std::string draw_small_ticks(const AxisScale& x, const AxisScale& y) {
  std::string path;
  for (const double value : small_ticks(x)) path += fmt::format("M{:.1f} {:.1f}v-4", x(value), y.from);
  for (const double value : small_ticks(y)) path += fmt::format("M{:.1f} {:.1f}h4", x.from, y(value));
  return path.empty() ? path : fmt::format("<path d=\"{}\" stroke=\"{}\" stroke-width=\"0.7\"/>", path, kFrame);
}

/// Everything of a panel but what is above and below its frame.
std::string draw_panel(const Panel& panel, const AxisScale& x, const std::vector<AxisTick>& x_ticks, double top,
                       const Look& look) {
  const double left = x.from, right = x.to, bottom = top + panel.height;
  const auto [y_low, y_high] = range_of_y(panel);
  const AxisScale y{y_low, y_high, bottom, top, panel.log_y};
  int y_power = 0;
  const std::vector<AxisTick> y_ticks = ticks_of_y(panel, y, look, y_power);

  std::string out;
  for (const ChartBand& band : panel.bands)
    out += fmt::format("<rect x=\"{}\" y=\"{:.1f}\" width=\"{}\" height=\"{:.1f}\" fill=\"{}\"/>", left,
                       std::max(y(band.high), top), right - left,
                       std::min(y(band.low), bottom) - std::max(y(band.high), top), band.colour);
  std::string grid, labels;
  for (const AxisTick& tick : y_ticks) {
    grid += fmt::format("M{} {:.1f}H{}", left, y(tick.value), right);
    labels += fmt::format("<text x=\"{}\" y=\"{:.1f}\" text-anchor=\"end\">{}</text>", left - 6, y(tick.value) + 4,
                          tick.label);
  }
  for (const AxisTick& tick : x_ticks) grid += fmt::format("M{:.1f} {:.1f}V{:.1f}", x(tick.value), top, bottom);
  out += fmt::format("<path d=\"{}\" stroke=\"{}\" stroke-width=\"0.7\"/>", grid, kFaint);
  // A nested svg clips without an id, which would have to differ between all charts of a page.
  out += fmt::format("<svg x=\"{0}\" y=\"{1:.1f}\" width=\"{2}\" height=\"{3}\" viewBox=\"{0} {1:.1f} {2} {3}\">", left,
                     top, right - left, panel.height);
  for (const Marker& marker : panel.markers)
    if (std::isfinite(marker.x))
      out += fmt::format("<path d=\"M{:.1f} {:.1f}V{:.1f}\" stroke=\"{}\" stroke-width=\"1.4\"{}/>", x(marker.x), top,
                         bottom, marker.colour, marker.dashed ? " stroke-dasharray=\"4 3\"" : "");
  for (const DataSeries& series : panel.series) out += draw_series(series, x, y);
  out += "</svg>";
  if (look.in_file) out += draw_small_ticks(x, y);
  out += fmt::format("<rect x=\"{}\" y=\"{:.1f}\" width=\"{}\" height=\"{}\" stroke=\"{}\" stroke-width=\"0.9\"/>",
                     left, top, right - left, panel.height, kFrame);
  out += fmt::format("<g fill=\"{}\">{}", kInk, labels);
  out += fmt::format("<text transform=\"translate(13 {:.1f}) rotate(-90)\" text-anchor=\"middle\"{}>{}</text></g>",
                     0.5 * (top + bottom), squeezed(panel.y_label, panel.height + kGap - 4, look),
                     with_power(panel.y_label, y_power));
  return out;
}

bool has_legend(const Chart& chart) {
  if (chart.panels.empty()) return false;
  const auto listed = [](const auto& entry) { return !entry.label.empty(); };
  const Panel& first = chart.panels[0];
  return std::any_of(first.series.begin(), first.series.end(), listed) ||
         std::any_of(first.markers.begin(), first.markers.end(), listed);
}

/// Down to the first panel: its heading and its legend, for which there is always room on a page.
double top_of(const Chart& chart, const Look& look) {
  return kTop + (chart.heading.empty() ? 0 : kHeading) + (has_legend(chart) || !look.in_file ? kLegend : 0);
}

double height_of(const Chart& chart, const Look& look) {
  double height = top_of(chart, look) + kBottom;
  for (std::size_t i = 0; i < chart.panels.size(); ++i) height += chart.panels[i].height + (i == 0 ? 0 : kGap);
  return height;
}

std::string draw_chart(const Chart& chart, const Look& look, const std::string& attributes) {
  const auto [x_low, x_high] = range_of_x(chart);
  const double right = chart.width - kRight;
  const AxisScale x{x_low, x_high, look.left, right, chart.log_x};
  std::string out =
      fmt::format("<svg {} viewBox=\"0 0 {} {:.0f}\" role=\"img\" aria-label=\"{}\" font-size=\"11.5\" fill=\"none\">",
                  attributes, chart.width, height_of(chart, look), escape_html(alternative_text(chart, x_low, x_high)));
  int x_power = 0;
  const std::vector<AxisTick> x_ticks = ticks_of_x(x, look, x_power);
  double top = top_of(chart, look);
  if (!chart.heading.empty())
    out += fmt::format("<text x=\"{:.1f}\" y=\"{}\" fill=\"{}\" text-anchor=\"middle\"{}>{}</text>",
                       0.5 * (look.left + right), kTop + 11, kInk,
                       squeezed(chart.heading, right - look.left + kRight, look), escape_html(chart.heading));
  for (std::size_t i = 0; i < chart.panels.size(); ++i) {
    const Panel& panel = chart.panels[i];
    const double bottom = top + panel.height;
    out += draw_panel(panel, x, x_ticks, top, look);
    if (i == 0) out += draw_legend(panel, look.left + 2, top - 12);
    if (i + 1 == chart.panels.size()) {
      out += fmt::format("<g fill=\"{}\" text-anchor=\"middle\">", kInk);
      for (const AxisTick& tick : x_ticks)
        out += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\">{}</text>", x(tick.value), bottom + 16, tick.label);
      out += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\"{}>{}</text></g>", 0.5 * (look.left + right), bottom + 36,
                         squeezed(chart.x_label, right - look.left, look), with_power(chart.x_label, x_power));
    }
    top = bottom + kGap;
  }
  return out + "</svg>\n";
}

/// Room for the widest number of any y axis, so that the panels of a sheet stand below each other.
double left_of(const Sheet& sheet) {
  double widest = 0;
  for (const Chart& chart : sheet.charts)
    for (const Panel& panel : chart.panels) {
      const auto [low, high] = range_of_y(panel);
      int power = 0;
      for (const AxisTick& tick : ticks_of_y(panel, {low, high, 0.0 + panel.height, 0, panel.log_y}, {true}, power))
        widest = std::max(widest, width_of(tick.label));
    }
  return std::max(50.0, std::ceil(widest) + 28);
}

std::string legend_entry(const DataSeries& series, double left, double middle) {
  return fmt::format("{}<text x=\"{:.1f}\" y=\"{:.1f}\" fill=\"{}\">{}</text>\n", legend_symbol(series, left, middle),
                     left + 24, middle + 4, kInk, escape_html(series.label));
}

/// Side by side, in as many lines as they need; how high they are.
std::string legend_lines(const std::vector<DataSeries>& legend, double left, double right, double& height) {
  std::string out;
  double x = left, y = kTop + 8;
  for (const DataSeries& series : legend) {
    const double width = 24 + width_of(series.label);
    if (x > left && x + width > right) x = left, y += kEntry;
    out += legend_entry(series, x, y);
    x += width + 18;
  }
  height = legend.empty() ? 0 : y + 0.5 * kEntry;
  return out;
}

}  // namespace

std::string svg(const Chart& chart) { return draw_chart(chart, {}, "class=\"chart\""); }

std::string svg_file(const Sheet& sheet) {
  const std::size_t columns = static_cast<std::size_t>(std::max(1, sheet.columns)), count = sheet.charts.size();
  const Look look{true, left_of(sheet)};
  double cell = 0;
  for (const Chart& chart : sheet.charts) cell = std::max(cell, 1.0 * chart.width);
  const double width = std::max(cell * static_cast<double>(std::max<std::size_t>(1, std::min(columns, count))), 200.0);
  const bool in_free_place = count % columns != 0 && count > columns;
  double top = 0;
  std::string body;
  if (!in_free_place) body += legend_lines(sheet.legend, look.left, width - kRight, top);
  for (std::size_t row = 0; row < count; row += columns) {
    double height = 0;
    for (std::size_t i = row; i < std::min(count, row + columns); ++i) {
      const Chart& chart = sheet.charts[i];
      const double left = cell * static_cast<double>(i - row);
      body += draw_chart(chart, look,
                         fmt::format("x=\"{:.0f}\" y=\"{:.1f}\" width=\"{}\" height=\"{:.0f}\"", left, top, chart.width,
                                     height_of(chart, look)));
      height = std::max(height, height_of(chart, look));
    }
    if (in_free_place && row + columns > count)
      for (std::size_t k = 0; k < sheet.legend.size(); ++k)
        body += legend_entry(sheet.legend[k], cell * static_cast<double>(count - row) + look.left,
                             top + kTop + kHeading + kEntry * (static_cast<double>(k) + 0.5));
    top += height;
  }
  return fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0:.0f} {1:.0f}\" width=\"{0:.0f}\" "
      "height=\"{1:.0f}\" font-family=\"sans-serif\" font-size=\"11.5\" fill=\"none\">\n<title>{2}</title>\n<rect "
      "width=\"{0:.0f}\" height=\"{1:.0f}\" fill=\"white\"/>\n{3}</svg>\n",
      width, std::max(top, kLegend), escape_html(sheet.title), body);
}

}  // namespace birefit
