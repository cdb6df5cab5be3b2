#include "io/report/samples.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "core/robust.h"
#include "io/report/axis.h"
#include "io/report/page.h"

namespace birefit::page {
namespace {

constexpr std::size_t kMostParameters = 6;
constexpr double kLeft = 78, kTop = 22, kRight = 10, kBottom = 58, kGap = 8;
constexpr const char* kBars = "#b9c4d3";

/// One parameter's draws, and the range that is drawn of them.
struct Axis {
  std::string label;
  std::vector<double> values;
  double low = 0, high = 1, estimate = 0;
  double share(double v) const { return (v - low) / (high - low); }
};

/// What was searched for comes first: gains and offsets are seldom asked about.
std::vector<Axis> axes_of(const FitResult& result) {
  std::vector<Axis> axes;
  for (const bool linear : {false, true})
    for (std::size_t j = 0; j < result.parameters.size() && axes.size() < kMostParameters; ++j) {
      const ParameterEstimate& p = result.parameters[j];
      if (p.linear != linear) continue;
      const auto column = result.samples->values.col(static_cast<Eigen::Index>(j));
      Axis axis{short_name(p.name), {column.begin(), column.end()}, 0, 1, p.value};
      if (!p.unit.empty()) axis.label += " (" + std::string(p.unit == "um" ? "\u00b5m" : p.unit) + ")";
      // All but the last few of a hundred, and a margin.
      axis.low = quantile(axis.values, 0.002), axis.high = quantile(axis.values, 0.998);
      const double margin = axis.high > axis.low ? 0.08 * (axis.high - axis.low) : 0.5 + std::abs(axis.low);
      axis.low -= margin, axis.high += margin;
      axes.push_back(std::move(axis));
    }
  return axes;
}

struct Square {
  double left, top, side;
  double x(const Axis& a, double v) const { return left + side * std::clamp(a.share(v), 0.0, 1.0); }
  double y(const Axis& a, double v) const { return top + side * (1 - std::clamp(a.share(v), 0.0, 1.0)); }
};

std::string histogram(const Square& cell, const Axis& axis) {
  constexpr int kBins = 30;
  std::vector<double> bins(kBins);
  for (const double v : axis.values)
    if (const double at = axis.share(v); at >= 0 && at < 1) ++bins[static_cast<std::size_t>(at * kBins)];
  const double most = std::max(1.0, *std::max_element(bins.begin(), bins.end()));
  std::string out;
  for (int i = 0; i < kBins; ++i)
    if (const double high = 0.94 * cell.side * bins[static_cast<std::size_t>(i)] / most; high > 0)
      out +=
          fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\"/>",
                      cell.left + cell.side * i / kBins, cell.top + cell.side - high, cell.side / kBins, high, kBars);
  return out + fmt::format("<path d=\"M{:.1f} {:.1f}v{:.1f}\" stroke=\"{}\" stroke-width=\"1.2\"/>",
                           cell.x(axis, axis.estimate), cell.top, cell.side, kFitted);
}

std::string cloud(const Square& cell, const Axis& across, const Axis& up) {
  constexpr std::size_t kMostPoints = 700;
  const std::size_t count = across.values.size(), every = std::max<std::size_t>(1, count / kMostPoints);
  std::string dots;
  for (std::size_t i = 0; i < count; i += every)
    dots += fmt::format("M{:.1f} {:.1f}h0", cell.x(across, across.values[i]), cell.y(up, up.values[i]));
  return fmt::format(
             "<path d=\"{}\" stroke=\"{}\" stroke-width=\"2\" stroke-linecap=\"round\" stroke-opacity=\"0.45\"/>", dots,
             kBlue) +
         fmt::format("<path d=\"M{0:.1f} {1:.1f}m-5 0h10m-5 -5v10\" stroke=\"{2}\" stroke-width=\"1.4\"/>",
                     cell.x(across, across.estimate), cell.y(up, up.estimate), kFitted);
}

/// Two or three labels, which do not touch those of the next cell.
std::vector<std::pair<double, std::string>> ticks_of(const Axis& axis) {
  constexpr double kEdge = 0.15;
  std::vector<double> values = nice_ticks(axis.low, axis.high, 3);
  const double step = values.size() > 1 ? values[1] - values[0] : 1;
  std::vector<std::pair<double, std::string>> ticks;
  for (const double v : values)
    if (const double at = axis.share(v); at > kEdge && at < 1 - kEdge)
      ticks.emplace_back(v, html_number(tick_label(v, step)));
  return ticks;
}

std::string corner(const std::vector<Axis>& axes, double width) {
  const auto count = static_cast<double>(axes.size());
  const double side = (width - kLeft - kRight - (count - 1) * kGap) / count,
               height = kTop + kBottom + count * side + (count - 1) * kGap;
  std::string names;
  for (const Axis& axis : axes) names += (names.empty() ? "" : ", ") + axis.label;
  std::string out = fmt::format(
      "<svg class=\"chart\" viewBox=\"0 0 {:.0f} {:.0f}\" role=\"img\" aria-label=\"{}\" font-size=\"11\" "
      "fill=\"none\">",
      width, height, escape_html("Draws from the posterior of " + names + ", each against each."));
  for (std::size_t row = 0; row < axes.size(); ++row)
    for (std::size_t column = 0; column <= row; ++column) {
      const Square cell{kLeft + static_cast<double>(column) * (side + kGap),
                        kTop + static_cast<double>(row) * (side + kGap), side};
      const Axis &across = axes[column], &up = axes[row];
      out += row == column ? histogram(cell, across) : cloud(cell, across, up);
      out += fmt::format(
          "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" stroke=\"{}\" stroke-width=\"0.9\"/>",
          cell.left, cell.top, side, side, kGrey);
      if (row + 1 == axes.size()) {
        out += fmt::format("<g fill=\"{}\" text-anchor=\"middle\">", kInk);
        for (const auto& [value, label] : ticks_of(across))
          out += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\">{}</text>", cell.x(across, value), cell.top + side + 15,
                             label);
        out += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\">{}</text></g>", cell.left + 0.5 * side,
                           cell.top + side + 34, escape_html(across.label));
      }
      if (column == 0 && row > 0) {
        out += fmt::format("<g fill=\"{}\">", kInk);
        for (const auto& [value, label] : ticks_of(up))
          out += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"end\">{}</text>", kLeft - 6,
                             cell.y(up, value) + 4, label);
        out += fmt::format("<text transform=\"translate(13 {:.1f}) rotate(-90)\" text-anchor=\"middle\">{}</text></g>",
                           cell.top + 0.5 * side, escape_html(up.label));
      }
    }
  return out + "</svg>\n";
}

}  // namespace

std::string samples_section(const FitResult& result, int& figure) {
  if (!result.samples || result.samples->values.rows() == 0) return {};
  const Samples& s = *result.samples;
  std::string out = fmt::format(
      "<h2>Posterior</h2>\n<p>{} draws (samples.csv), worth {:.0f} independent ones: autocorrelation {} steps, {} of "
      "the "
      "proposals accepted.</p>\n<div class=\"scroll\"><table>\n<tr><th>parameter</th><th>median</th><th>95 % of the "
      "draws</th></tr>\n",
      s.values.rows(), s.effective, html_number(fmt::format("{:.2g}", s.autocorrelation)), format_percent(s.accepted));
  for (const Samples::Of& p : s.parameters) {
    const double sd = 0.25 * (p.high - p.low);
    out += fmt::format("<tr><td class=\"name\">{}</td><td>{}</td><td>{} to {}</td></tr>\n",
                       escape_html(short_name(p.name)), value_html(p.median, sd), value_html(p.low, sd),
                       value_html(p.high, sd));
  }
  out += "</table></div>\n";
  const std::vector<Axis> axes = axes_of(result);
  return out + fmt::format(
                   "<figure>{}<figcaption><b>Figure {}.</b> Draws from the posterior{}; red: the reported "
                   "values.</figcaption></figure>\n",
                   corner(axes, axes.size() < 3 ? 430 : 884), figure++,
                   axes.size() < s.parameters.size() ? fmt::format(", the first {} parameters", axes.size()) : "");
}

}  // namespace birefit::page
