#include "io/report/diagnostics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "io/report/page.h"

namespace birefit::page {
namespace {

constexpr const char* kBar = "#b9c4d3";

const ParameterEstimate* find(const FitResult& result, const std::string& name) {
  for (const ParameterEstimate& p : result.parameters)
    if (p.name == name) return &p;
  return nullptr;
}

/// Chi-square along a parameter before the solver; "" of a scan of one point.
std::string scan_chart(const ScanTrace& scan, const FitResult& result, int& figure) {
  if (scan.value.size() < 2) return {};
  const ParameterEstimate* p = find(result, scan.name);
  Chart chart;
  chart.title = "scan of " + scan.name;
  const std::string unit =
      p != nullptr && !p->unit.empty() ? " (" + std::string(p->unit == "um" ? "\u00b5m" : p->unit) + ")" : "";
  chart.x_label = short_name(scan.name) + unit;
  Panel panel;
  panel.y_label = "chi-square";
  panel.log_y = std::all_of(scan.chi_square.begin(), scan.chi_square.end(), [](double c) { return !(c <= 0); });
  std::vector<std::pair<double, double>> points;
  for (std::size_t i = 0; i < std::min(scan.value.size(), scan.chi_square.size()); ++i)
    points.emplace_back(scan.value[i], scan.chi_square[i]);
  std::sort(points.begin(), points.end());
  DataSeries series{DataSeries::Kind::line, "scan", {}, {}, kBlue, 1.5};
  for (const auto& [x, y] : points) series.x.push_back(x), series.y.push_back(y);
  panel.series.push_back(std::move(series));
  if (p != nullptr) {
    panel.markers.push_back({p->value, "optimum", kFitted, false});
    panel.markers.push_back({p->start, "start", "#8a919b", true});
  }
  chart.panels = {panel};
  return fmt::format(
      "<figure>{}<figcaption><b>Figure {}.</b> The scan before the solver: chi-square against {}, the other "
      "parameters as the scan had them.</figcaption></figure>\n",
      svg(chart), figure++, escape_html(short_name(scan.name)));
}

/// The objective about a parameter whose interval is profiled.
std::string profile_chart(const ProfileTrace& trace, const FitResult& result, int& figure) {
  const ParameterEstimate* p = find(result, trace.name);
  if (p == nullptr || trace.value.size() < 3) return {};
  Chart chart;
  chart.title = "profile of " + trace.name;
  chart.x_label =
      short_name(trace.name) + (p->unit.empty() ? "" : " (" + std::string(p->unit == "um" ? "\u00b5m" : p->unit) + ")");
  Panel panel;
  panel.y_label = "rise of chi-square";
  DataSeries line{DataSeries::Kind::line, "profile", {}, {}, kBlue, 1.5},
      normal{DataSeries::Kind::line, "parabola", {}, {}, "#8a919b", 1.0};
  const DataSeries dots{DataSeries::Kind::points, "", trace.value, trace.rise, kBlue, 4.5};
  const double from = trace.value.front(), to = trace.value.back(),
               highest = *std::max_element(trace.rise.begin(), trace.rise.end());
  for (int i = 0; i <= 60; ++i) {
    const double x = from + (to - from) * i / 60, y = std::pow((x - p->value) / p->stderr_, 2);
    if (y <= 1.3 * highest) normal.x.push_back(x), normal.y.push_back(y);
  }
  // Between the places that were fitted its root is next to straight.
  const auto root = [&](std::size_t i) {
    return std::copysign(std::sqrt(std::max(0.0, trace.rise[i])), trace.value[i] - p->value);
  };
  for (std::size_t i = 0; i + 1 < trace.value.size(); ++i)
    for (int k = 0; k <= 12; ++k) {
      const double share = k / 12.0;
      line.x.push_back(trace.value[i] + share * (trace.value[i + 1] - trace.value[i]));
      line.y.push_back(std::pow(root(i) + share * (root(i + 1) - root(i)), 2));
    }
  panel.series = {normal, line, dots};
  panel.markers = {{p->interval95_low, "95 %", kFitted, true},
                   {p->value, "optimum", kFitted, false},
                   {p->interval95_high, "", kFitted, true}};
  chart.panels = {panel};
  return fmt::format(
      "<figure>{}<figcaption><b>Figure {}.</b> Profile likelihood of {}, all others at their best for "
      "each of its values. It is no parabola (grey: the standard error\u2019s): "
      "the interval is where the profile has risen by t\u00b2.</figcaption></figure>\n",
      svg(chart), figure++, escape_html(short_name(trace.name)));
}

/// The solver's way from the best start.
std::string convergence_chart(const FitResult& result, int& figure) {
  if (result.iterations.size() < 2) return {};
  Chart chart;
  chart.title = "convergence";
  chart.x_label = "iteration";
  Panel panel;
  panel.y_label = "chi-square";
  panel.log_y = true;
  DataSeries line{DataSeries::Kind::line, "", {}, {}, kBlue, 1.5};
  for (const Iteration& i : result.iterations) {
    line.x.push_back(i.number), line.y.push_back(i.chi_square);
    panel.log_y = panel.log_y && i.chi_square > 0;
  }
  DataSeries dots = line;
  dots.kind = DataSeries::Kind::points;
  dots.width = 4.5;
  panel.series = {line, dots};
  chart.panels = {panel};
  return fmt::format(
      "<figure>{}<figcaption><b>Figure {}.</b> Convergence of the solver from the best start of the "
      "scan: {} iterations, {} evaluations.</figcaption></figure>\n",
      svg(chart), figure++, result.iterations.back().number, result.evaluations);
}

/// Residuals of all used pixels in units of their noise.
std::string residual_chart(const std::vector<Frame>& frames, int& figure) {
  constexpr int kBins = 48;
  constexpr double kReach = 6;
  std::array<double, kBins> histogram{};
  double count = 0, square = 0, sum = 0, beyond = 0, outside = 0;
  for (const Frame& frame : frames)
    for (const double r : frame.normalised.values()) {
      if (!std::isfinite(r)) continue;
      ++count, sum += r, square += r * r, beyond += std::abs(r) > 3;
      if (std::abs(r) >= kReach) ++outside;
      histogram[std::clamp(static_cast<int>((r + kReach) / (2 * kReach) * kBins), 0, kBins - 1)] +=
          std::abs(r) < kReach;
    }
  if (!(count > 0)) return {};
  Chart chart;
  chart.title = "histogram of residuals";
  chart.x_label = "residual (\u03c3)";
  chart.x_range = {-kReach, kReach};
  Panel panel;
  panel.y_label = "density";
  DataSeries bars{DataSeries::Kind::bars, "pixels", {}, {}, kBar, 0};
  double highest = 1 / std::sqrt(2 * std::numbers::pi);
  for (int i = 0; i < kBins; ++i) {
    bars.x.push_back(-kReach + (i + 0.5) * 2 * kReach / kBins);
    bars.y.push_back(histogram[i] / count / (2 * kReach / kBins));
    highest = std::max(highest, bars.y.back());
  }
  DataSeries normal{DataSeries::Kind::line, "unit normal", {}, {}, kFitted, 1.5};
  for (int i = 0; i <= 120; ++i) {
    const double x = -kReach + i * kReach / 60;
    normal.x.push_back(x), normal.y.push_back(std::exp(-0.5 * x * x) / std::sqrt(2 * std::numbers::pi));
  }
  panel.y_range = {0, 1.08 * highest};
  panel.series = {bars, normal};
  chart.panels = {panel};
  const double mean = sum / count;
  return fmt::format(
      "<figure>{}<figcaption><b>Figure {}.</b> Residuals of all used pixels: mean {}, standard deviation "
      "{}; {} beyond 3 \u03c3 "
      "(a normal distribution has 0.27 %){}.</figcaption></figure>\n",
      svg(chart), figure++, html_number(fmt::format("{:.2g}", mean)),
      html_number(fmt::format("{:.3g}", std::sqrt(std::max(0.0, square / count - mean * mean)))),
      format_percent(beyond / count),
      outside > 0 ? fmt::format(", {:.0f} pixels beyond 6 \u03c3 not shown", outside) : "");
}

}  // namespace

std::string diagnostics(const FitResult& result, const std::vector<Frame>& frames, int& figure) {
  std::string cells;
  for (const ScanTrace& scan : result.scans) cells += scan_chart(scan, result, figure);
  for (const ProfileTrace& trace : result.profiles) cells += profile_chart(trace, result, figure);
  cells += convergence_chart(result, figure);
  cells += residual_chart(frames, figure);
  return cells.empty() ? "" : "<h2>Search and residuals</h2>\n<div class=\"pair\">\n" + cells + "</div>\n";
}

}  // namespace birefit::page
