#include "io/report/chart.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include <fmt/format.h>

#include "io/report/format.h"

namespace birefit {
namespace {

constexpr double kLeft = 62, kRight = 14, kTop = 8, kBottom = 44, kGap = 14, kLegend = 20;
constexpr const char* kInk = "#2b2f36";
constexpr const char* kFaint = "#e3e6ea";

struct Scale {
  double low = 0, high = 1, from = 0, to = 1;
  bool log = false;
  double operator()(double value) const {
    const double t = log ? std::log(value / low) / std::log(high / low) : (value - low) / (high - low);
    return from + t * (to - from);
  }
};

struct Tick {
  double value;
  std::string label;
};

/// Ticks and, for large or tiny numbers, a common power of ten that goes into the axis label.
std::vector<Tick> linear_ticks(double low, double high, int count, int& power) {
  const double largest = std::max(std::abs(low), std::abs(high));
  power = 0;
  if (largest >= 1e5 || (largest > 0 && largest < 1e-3)) power = static_cast<int>(std::floor(std::log10(largest)));
  const double factor = std::pow(10.0, power);
  const std::vector<double> values = nice_ticks(low / factor, high / factor, count);
  std::vector<Tick> ticks;
  const double step = values.size() > 1 ? values[1] - values[0] : 1;
  for (const double value : values) ticks.push_back({value * factor, html_number(tick_label(value, step))});
  return ticks;
}

std::vector<Tick> log_ticks(double low, double high, int count, int& power) {
  power = 0;
  const double decades = std::log10(high / low);
  if (decades < 0.9) return linear_ticks(low, high, count, power);
  std::vector<Tick> ticks;
  const int every = std::max(1, static_cast<int>(std::ceil(decades / count)));
  for (int d = static_cast<int>(std::ceil(std::log10(low) - 1e-9)); d <= std::floor(std::log10(high) + 1e-9); ++d) {
    if (d % every != 0) continue;
    const std::string sign = d < 0 ? "\u2212" : "";
    ticks.push_back({std::pow(10.0, d), d >= 0 && d <= 3 ? fmt::format("{:.0f}", std::pow(10.0, d))
                                                         : "10<tspan dy=\"-4\" font-size=\"8.5\">" + sign +
                                                               std::to_string(std::abs(d)) + "</tspan>"});
  }
  if (ticks.size() >= 2) return ticks;
  ticks.clear();
  for (int d = static_cast<int>(std::floor(std::log10(low))); d <= std::ceil(std::log10(high)); ++d)
    for (const double m : {1.0, 2.0, 5.0})
      if (const double value = m * std::pow(10.0, d); value >= low * (1 - 1e-9) && value <= high * (1 + 1e-9))
        ticks.push_back({value, html_number(fmt::format("{:.3g}", value))});
  for (Tick& tick : ticks)  // SVG has no <sup>
    if (const std::size_t at = tick.label.find("<sup>"); at != std::string::npos) {
      tick.label.replace(at, 5, "<tspan dy=\"-4\" font-size=\"8.5\">");
      tick.label.replace(tick.label.find("</sup>"), 6, "</tspan>");
    }
  return ticks;
}

std::string with_power(const std::string& label, int power) {
  if (power == 0) return escape_html(label);
  return escape_html(label) + " \u00d710<tspan dy=\"-4\" font-size=\"8.5\">" + (power < 0 ? "\u2212" : "") +
         std::to_string(std::abs(power)) + "</tspan>";
}

template <class Visit>
void visit_values(const Panel& panel, bool x, Visit visit) {
  for (const Series& series : panel.series)
    for (const double value : x ? series.x : series.y)
      if (std::isfinite(value) && (x || !panel.log_y || value > 0)) visit(value);
}

std::pair<double, double> range_of_y(const Panel& panel) {
  if (panel.y_range) return *panel.y_range;
  double low = std::numeric_limits<double>::infinity(), high = -low;
  visit_values(panel, false, [&](double v) { low = std::min(low, v), high = std::max(high, v); });
  if (!(low <= high)) return panel.log_y ? std::pair{1.0, 10.0} : std::pair{0.0, 1.0};
  if (panel.log_y) {
    const double margin = std::max(std::pow(high / low, 0.07), 1.02);
    return {low / margin, high * margin};
  }
  const double margin = high > low ? 0.06 * (high - low) : std::max(0.05 * std::abs(high), 1e-12);
  return {low - margin, high + margin};
}

std::string draw_series(const Series& series, const Panel& panel, const Scale& x, const Scale& y) {
  std::string out;
  const std::size_t count = std::min(series.x.size(), series.y.size());
  const auto drawable = [&](std::size_t i) {
    return std::isfinite(series.x[i]) && std::isfinite(series.y[i]) && (!panel.log_y || series.y[i] > 0);
  };
  const double top = std::min(y.from, y.to) - 2, bottom = std::max(y.from, y.to) + 2;
  switch (series.kind) {
    case Series::Kind::line: {
      std::string path;
      bool pen_down = false;
      for (std::size_t i = 0; i < count; ++i) {
        if (!drawable(i)) {
          pen_down = false;
          continue;
        }
        path += fmt::format("{}{:.1f} {:.1f}", pen_down ? "L" : "M", x(series.x[i]),
                            std::clamp(y(series.y[i]), top - 500, bottom + 500));
        pen_down = true;
      }
      out = fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" stroke-linejoin=\"round\"/>",
                        path, series.colour, series.width);
      break;
    }
    case Series::Kind::points: {
      // One path of zero-length round strokes is a tenth of as many circles.
      std::string path;
      for (std::size_t i = 0; i < count; ++i)
        if (drawable(i))
          if (const double v = y(series.y[i]); v >= top && v <= bottom)
            path += fmt::format("M{:.1f} {:.1f}h0", x(series.x[i]), v);
      out = fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" stroke-linecap=\"round\"/>",
                        path, series.colour, series.width);
      break;
    }
    case Series::Kind::bars: {
      const double half = count > 1 ? 0.5 * (series.x[1] - series.x[0]) : 0.5;
      for (std::size_t i = 0; i < count; ++i)
        if (drawable(i) && series.y[i] != 0)
          out += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\"/>",
                             x(series.x[i] - half) + 0.4, y(series.y[i]),
                             x(series.x[i] + half) - x(series.x[i] - half) - 0.8, std::max(0.0, y(0) - y(series.y[i])),
                             series.colour);
      break;
    }
  }
  return out;
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
  for (const Series& series : panel.series) {
    if (series.label.empty()) continue;
    if (series.kind == Series::Kind::line)
      entry(fmt::format("<path d=\"M{:.1f} {:.1f}h17\" stroke=\"{}\" stroke-width=\"{}\"/>", at, top, series.colour,
                        series.width),
            series.label);
    else if (series.kind == Series::Kind::points)
      entry(fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{}\" fill=\"{}\"/>", at + 10, top,
                        std::max(series.width / 2, 1.6), series.colour),
            series.label);
    else
      entry(fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"14\" height=\"9\" fill=\"{}\"/>", at + 3, top - 4.5,
                        series.colour),
            series.label);
  }
  for (const Marker& marker : panel.markers)
    if (!marker.label.empty())
      entry(fmt::format("<path d=\"M{:.1f} {:.1f}v11\" stroke=\"{}\" stroke-width=\"1.4\"{}/>", at + 10, top - 5.5,
                        marker.colour, marker.dashed ? " stroke-dasharray=\"3 2.5\"" : ""),
            marker.label);
  return out;
}

}  // namespace

std::vector<double> nice_ticks(double low, double high, int count) {
  std::vector<double> ticks;
  if (!(high > low) || !std::isfinite(high - low) || count < 1) return ticks;
  const double raw = (high - low) / count, power = std::pow(10.0, std::floor(std::log10(raw)));
  const double lead = raw / power;
  const double step = (lead < 1.5 ? 1 : lead < 3.5 ? 2 : lead < 7.5 ? 5 : 10) * power;
  const double first = std::ceil(low / step - 1e-9);
  for (double k = first; k * step <= high + 1e-9 * step && ticks.size() < 100; ++k)
    ticks.push_back(k == 0 ? 0.0 : k * step);
  return ticks;
}

std::string tick_label(double value, double step) {
  const int decimals = step > 0 ? std::clamp(static_cast<int>(std::ceil(-std::log10(step) - 1e-6)), 0, 12) : 0;
  return fmt::format("{:.{}f}", value, decimals);
}

namespace {

/// For who cannot see it: what is drawn against what, and between which numbers.
std::string alternative_text(const Chart& chart, double x_low, double x_high) {
  std::string text = chart.title + ".";
  for (const Panel& panel : chart.panels) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    visit_values(panel, false, [&](double v) { low = std::min(low, v), high = std::max(high, v); });
    std::string names;
    for (const Series& series : panel.series)
      if (!series.label.empty()) names += (names.empty() ? ": " : ", ") + series.label;
    text += fmt::format(" {}{}", panel.y_label, names);
    if (low <= high) text += fmt::format(", from {:.4g} to {:.4g}", low, high);
    text += ".";
  }
  return text + fmt::format(" Against {} from {:.4g} to {:.4g}.", chart.x_label, x_low, x_high);
}

}  // namespace

std::string svg(const Chart& chart) {
  double x_low = std::numeric_limits<double>::infinity(), x_high = -x_low;
  for (const Panel& panel : chart.panels)
    visit_values(panel, true, [&](double v) { x_low = std::min(x_low, v), x_high = std::max(x_high, v); });
  if (chart.x_range) std::tie(x_low, x_high) = *chart.x_range;
  if (!(x_low <= x_high)) x_low = 0, x_high = 1;
  if (!(x_low < x_high)) x_low -= 0.5, x_high += 0.5;
  const double right = chart.width - kRight;
  const Scale x{x_low, x_high, kLeft, right};

  double height = kTop + kBottom;
  for (std::size_t i = 0; i < chart.panels.size(); ++i) height += chart.panels[i].height + (i == 0 ? kLegend : kGap);

  std::string out = fmt::format(
      "<svg class=\"chart\" viewBox=\"0 0 {} {:.0f}\" role=\"img\" aria-label=\"{}\" font-size=\"11.5\" fill=\"none\">",
      chart.width, height, escape_html(alternative_text(chart, x_low, x_high)));
  int x_power = 0;
  const std::vector<Tick> x_ticks =
      linear_ticks(x_low, x_high, std::clamp(static_cast<int>((right - kLeft) / 70), 3, 12), x_power);
  double top = kTop + kLegend;
  for (std::size_t i = 0; i < chart.panels.size(); ++i) {
    const Panel& panel = chart.panels[i];
    const double bottom = top + panel.height;
    const auto [y_low, y_high] = range_of_y(panel);
    const Scale y{y_low, y_high, bottom, top, panel.log_y};
    int y_power = 0;
    const int wanted = std::clamp(panel.height / 32, 3, 8);
    const std::vector<Tick> y_ticks =
        panel.log_y ? log_ticks(y_low, y_high, wanted, y_power) : linear_ticks(y_low, y_high, wanted, y_power);

    for (const Band& band : panel.bands)
      out += fmt::format("<rect x=\"{}\" y=\"{:.1f}\" width=\"{}\" height=\"{:.1f}\" fill=\"{}\"/>", kLeft,
                         std::max(y(band.high), top), right - kLeft,
                         std::min(y(band.low), bottom) - std::max(y(band.high), top), band.colour);
    std::string grid, labels;
    for (const Tick& tick : y_ticks) {
      grid += fmt::format("M{} {:.1f}H{}", kLeft, y(tick.value), right);
      labels += fmt::format("<text x=\"{}\" y=\"{:.1f}\" text-anchor=\"end\">{}</text>", kLeft - 6, y(tick.value) + 4,
                            tick.label);
    }
    for (const Tick& tick : x_ticks) grid += fmt::format("M{:.1f} {:.1f}V{:.1f}", x(tick.value), top, bottom);
    out += fmt::format("<path d=\"{}\" stroke=\"{}\" stroke-width=\"0.7\"/>", grid, kFaint);
    // A nested svg clips without an id, which would have to differ between all charts of a page.
    out += fmt::format("<svg x=\"{0}\" y=\"{1:.1f}\" width=\"{2}\" height=\"{3}\" viewBox=\"{0} {1:.1f} {2} {3}\">",
                       kLeft, top, right - kLeft, panel.height);
    for (const Marker& marker : panel.markers)
      if (std::isfinite(marker.x))
        out += fmt::format("<path d=\"M{:.1f} {:.1f}V{:.1f}\" stroke=\"{}\" stroke-width=\"1.4\"{}/>", x(marker.x), top,
                           bottom, marker.colour, marker.dashed ? " stroke-dasharray=\"4 3\"" : "");
    for (const Series& series : panel.series) out += draw_series(series, panel, x, y);
    out += "</svg>";
    out +=
        fmt::format("<rect x=\"{}\" y=\"{:.1f}\" width=\"{}\" height=\"{}\" stroke=\"#8a919b\" stroke-width=\"0.9\"/>",
                    kLeft, top, right - kLeft, panel.height);
    out += fmt::format("<g fill=\"{}\">{}", kInk, labels);
    out += fmt::format("<text transform=\"translate(13 {:.1f}) rotate(-90)\" text-anchor=\"middle\">{}</text></g>",
                       0.5 * (top + bottom), with_power(panel.y_label, y_power));
    if (i == 0) out += draw_legend(panel, kLeft + 2, kTop + 8);
    if (i + 1 == chart.panels.size()) {
      out += fmt::format("<g fill=\"{}\" text-anchor=\"middle\">", kInk);
      for (const Tick& tick : x_ticks)
        out += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\">{}</text>", x(tick.value), bottom + 16, tick.label);
      out += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\">{}</text></g>", 0.5 * (kLeft + right), bottom + 36,
                         with_power(chart.x_label, x_power));
    }
    top = bottom + kGap;
  }
  return out + "</svg>\n";
}

}  // namespace birefit
