#include "io/report/colour_strip.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "io/report/axis.h"
#include "io/report/format.h"

namespace birefit {
namespace {

constexpr double kStripsLeft = 70, kStripsTop = 34, kWide = 900, kStrip = 64, kBetween = 26, kPanel = 300,
                 kStripsBottom = 46, kStripsRight = 24;
/// From the nearest on.
constexpr std::array<const char*, 3> kDots = {"#111111", "#7a4fb5", "#c9b3e6"};

std::string hex(const std::array<double, 3>& colour) {
  std::string text = "#";
  for (const double code : colour)
    text += fmt::format("{:02x}", static_cast<int>(std::lround(255 * std::clamp(code, 0.0, 1.0))));
  return text;
}

std::string frame(double top, double height) {
  return fmt::format("<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"{}\"/>\n", kStripsLeft,
                     top, kWide, height, kFrame);
}

/// Its colours side by side, each a hair wider than its place so that no page shines through.
std::string strip(const ColourStrips::Strip& given, double top) {
  std::string out =
      fmt::format("<text x=\"{}\" y=\"{:.1f}\">{}</text>\n", kStripsLeft, top - 6, escape_html(given.name));
  out += "<g shape-rendering=\"crispEdges\">\n";
  const double width = kWide / static_cast<double>(given.colours.size());
  for (std::size_t i = 0; i < given.colours.size(); ++i)
    out += fmt::format("<rect x=\"{:.2f}\" y=\"{}\" width=\"{:.2f}\" height=\"{}\" fill=\"{}\"/>\n",
                       kStripsLeft + width * static_cast<double>(i), top,
                       std::min(width + 0.4, kWide - width * static_cast<double>(i)), kStrip, hex(given.colours[i]));
  return out + "</g>\n" + frame(top, kStrip);
}

std::string ticks_below(const AxisScale& x, double top, const std::string& label) {
  int power = 0;
  std::string out;
  for (const AxisTick& tick : axis_ticks(x, 10, power))
    out += fmt::format(
        "<path d=\"M{:.1f} {}v5\" stroke=\"{}\"/><text x=\"{:.1f}\" y=\"{}\" text-anchor=\"middle\">{}"
        "</text>\n",
        x(tick.value), top, kFrame, x(tick.value), top + 19, tick.label);
  return out + fmt::format("<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n", kStripsLeft + 0.5 * kWide,
                           top + 38, with_power(label, power));
}

std::string doubles_panel(const ColourStrips& chart, const AxisScale& x, double top) {
  const AxisScale y{chart.low, chart.high, top + kPanel, top, false};
  std::string out;
  int power = 0;
  for (const AxisTick& tick : axis_ticks(y, 6, power))
    out += fmt::format(
        "<path d=\"M{} {:.1f}h-5\" stroke=\"{}\"/><text x=\"{}\" y=\"{:.1f}\" text-anchor=\"end\">{}"
        "</text>\n",
        kStripsLeft, y(tick.value), kFrame, kStripsLeft - 9, y(tick.value) + 4, tick.label);
  out += fmt::format("<text transform=\"translate({} {}) rotate(-90)\" text-anchor=\"middle\">{}</text>\n",
                     kStripsLeft - 52, top + 0.5 * kPanel, escape_html(chart.doubles_label));
  for (std::size_t step = chart.steps.size(); step-- > 0;) {
    const double from = step == 0 ? -1 : chart.steps[step - 1].first;
    for (const ColourStrips::Double& dot : chart.doubles)
      if (dot.distance > from && dot.distance <= chart.steps[step].first)
        out += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"1.7\" fill=\"{}\"/>\n", x(dot.x), y(dot.y),
                           kDots.at(step));
  }
  double right = kStripsLeft + 10;
  for (std::size_t step = 0; step < chart.steps.size(); ++step) {
    out += fmt::format("<circle cx=\"{:.1f}\" cy=\"{}\" r=\"4\" fill=\"{}\"/><text x=\"{:.1f}\" y=\"{}\">{}</text>\n",
                       right + 4, top - 10, kDots.at(step), right + 13, top - 6, escape_html(chart.steps[step].second));
    right += 30 + width_of(chart.steps[step].second);
  }
  return out + frame(top, kPanel);
}

}  // namespace

std::string svg_file(const ColourStrips& chart) {
  const AxisScale x{chart.low, chart.high, kStripsLeft, kStripsLeft + kWide, false};
  double top = kStripsTop + kBetween;
  std::string body;
  for (const ColourStrips::Strip& one : chart.strips) {
    body += strip(one, top);
    top += kStrip + kBetween;
  }
  top += kBetween;
  body += doubles_panel(chart, x, top) + ticks_below(x, top + kPanel, chart.label);
  const double width = kStripsLeft + kWide + kStripsRight, height = top + kPanel + kStripsBottom;
  return fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" role=\"img\" "
      "font-family=\"sans-serif\" font-size=\"13\" fill=\"{2}\"><title>{3}</title>\n"
      "<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n<text x=\"{4}\" y=\"22\" font-size=\"16\">{3}</text>\n"
      "{5}</svg>\n",
      width, height, kInk, escape_html(chart.title), kStripsLeft, body);
}

}  // namespace birefit
