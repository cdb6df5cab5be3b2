// report.html: one file, no network, no script; for the screen, the phone and paper.

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <fmt/format.h>

#include "birefit/io.h"
#include "io/report_chart.h"
#include "io/report_format.h"
#include "io/report_image.h"

namespace birefit {
namespace {

constexpr const char* kMeasured = "#3c434d";
constexpr const char* kFitted = "#c0392b";
constexpr const char* kBlue = "#2166ac";
constexpr const char* kBar = "#b9c4d3";
constexpr const char* kBand1 = "#dfe8f3";
constexpr const char* kBand2 = "#eff4f9";
constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

constexpr const char* kStyle = R"css(
:root { --ink: #1d2127; --soft: #5b626c; --line: #d9dde2; --paper: #fff; --accent: #2166ac; color-scheme: light; }
* { box-sizing: border-box; }
html { -webkit-text-size-adjust: 100%; }
body { margin: 0; background: var(--paper); color: var(--ink); line-height: 1.5; font-size: 16px;
  font-family: Charter, "Bitstream Charter", "Source Serif 4", "Iowan Old Style", Cambria, Georgia, "DejaVu Serif", serif; }
main { max-width: 940px; margin: 0 auto; padding: 36px 28px 64px; }
h1, h2, h3, table, svg, .badge, .key, .eyebrow, code, pre, dt, summary { font-family: "Inter", "Helvetica Neue", Helvetica, Arial,
  "Liberation Sans", "DejaVu Sans", sans-serif; }
.eyebrow { font-size: 12px; letter-spacing: .09em; text-transform: uppercase; color: var(--soft); margin: 0 0 4px; }
h1 { font-size: 25px; line-height: 1.25; font-weight: 600; margin: 0 0 14px; overflow-wrap: anywhere; letter-spacing: -.01em; }
h2 { font-size: 17px; font-weight: 600; margin: 44px 0 10px; padding-top: 12px; border-top: 1px solid var(--line); }
h3 { font-size: 14px; font-weight: 600; margin: 22px 0 6px; overflow-wrap: anywhere; }
p { margin: 0 0 10px; max-width: 46em; }
.verdict { display: flex; gap: 14px; align-items: baseline; margin: 0 0 22px; }
.verdict p { margin: 0; }
.badge { flex: none; font-size: 12px; font-weight: 600; padding: 3px 10px; border-radius: 999px; border: 1px solid; white-space: nowrap; }
.good { color: #1c6b3f; border-color: #9cc9ae; background: #f1f8f3; }
.bad { color: #9b2c1f; border-color: #dfaaa2; background: #fcf3f1; }
.key { display: grid; grid-template-columns: repeat(auto-fit, minmax(190px, 1fr)); gap: 0; margin: 0 0 8px; border-top: 1px solid var(--line);
  border-left: 1px solid var(--line); }
.key div { padding: 10px 14px 11px; border-right: 1px solid var(--line); border-bottom: 1px solid var(--line); min-width: 0; }
.key dt { font-size: 12px; color: var(--soft); overflow-wrap: anywhere; }
.key dd { margin: 1px 0 0; font-size: 18px; font-weight: 500; font-variant-numeric: tabular-nums; letter-spacing: -.01em; }
.key small { font-size: 13px; font-weight: 400; color: var(--soft); }
.warnings { border-left: 3px solid #d9a441; background: #fdf8ec; padding: 10px 16px; margin: 18px 0; }
.warnings ul { margin: 4px 0 0; padding-left: 20px; }
figure { margin: 16px 0 22px; }
figcaption { font-size: 14px; color: #3c434d; margin-top: 6px; max-width: 54em; line-height: 1.45; }
figcaption b { font-family: "Helvetica Neue", Helvetica, Arial, "Liberation Sans", sans-serif; font-size: 13px; }
.trio { display: grid; grid-template-columns: repeat(3, minmax(0, 1fr)); gap: 14px; }
.trio.stack { grid-template-columns: minmax(0, 1fr); gap: 8px; }
.trio h4, .pair h4 { font: 600 13px "Helvetica Neue", Helvetica, Arial, "Liberation Sans", sans-serif; margin: 0; }
.pair { display: grid; grid-template-columns: repeat(2, minmax(0, 1fr)); gap: 18px 22px; }
.pair figure { margin: 0; }
svg { display: block; width: 100%; height: auto; }
.narrow { display: none; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: 13px; font-variant-numeric: tabular-nums; }
th { font-weight: 600; text-align: right; padding: 5px 9px; border-bottom: 1.5px solid var(--ink); white-space: nowrap; vertical-align: bottom; }
td { text-align: right; padding: 4px 9px; border-bottom: 1px solid var(--line); white-space: nowrap; }
th:first-child, td:first-child { text-align: left; padding-left: 0; }
table.full { width: 100%; }
td.name { font-weight: 500; }
td.file { white-space: normal; overflow-wrap: anywhere; min-width: 9em; }
td.name small { display: block; font-weight: 400; color: var(--soft); font-size: 11px; }
td.left, th.left { text-align: left; }
td.value { font-weight: 600; }
.flag { color: #9b2c1f; font-weight: 600; font-size: 11px; }
table.matrix td, table.matrix th { text-align: center; padding: 4px 5px; border: 0; min-width: 46px; font-size: 12px; }
table.matrix td:first-child, table.matrix th:first-child { text-align: left; padding-right: 12px; }
dl.facts { display: grid; grid-template-columns: max-content minmax(0, 1fr); gap: 3px 18px; margin: 0 0 12px; font-size: 14px; }
dl.facts dt { color: var(--soft); font-size: 13px; padding-top: 1px; }
dl.facts dd { margin: 0; overflow-wrap: anywhere; }
ul { margin: 4px 0 12px; padding-left: 22px; max-width: 46em; }
li { margin: 2px 0; }
details { margin: 8px 0; }
summary { cursor: pointer; font-size: 14px; font-weight: 500; color: var(--accent); }
pre { font: 12px/1.5 "SFMono-Regular", Menlo, Consolas, "Liberation Mono", "DejaVu Sans Mono", monospace; background: #f6f7f9;
  padding: 12px 14px; overflow-x: auto; white-space: pre-wrap; overflow-wrap: anywhere; border: 1px solid var(--line); }
footer { margin-top: 44px; padding-top: 10px; border-top: 1px solid var(--line); font-size: 13px; color: var(--soft); }
@media (max-width: 700px) {
  main { padding: 22px 16px 48px; }
  h1 { font-size: 21px; }
  .trio, .pair { grid-template-columns: minmax(0, 1fr); }
  .verdict { display: block; }
  .badge { display: inline-block; margin-bottom: 8px; }
  .key { grid-template-columns: repeat(2, minmax(0, 1fr)); }
  .key div { padding: 8px 10px; }
  .key dd { font-size: 16px; }
  .wide { display: none; }
  .narrow { display: block; }
  dl.facts { grid-template-columns: minmax(0, 1fr); gap: 0; }
  dl.facts dd { margin-bottom: 6px; }
  table.full td:first-child, table.full th:first-child { position: sticky; left: 0; background: var(--paper); padding-right: 12px;
    border-right: 1px solid var(--line); min-width: 132px; max-width: 46vw; white-space: normal; overflow-wrap: anywhere; }
}
@media print {
  @page { size: A4; margin: 15mm 14mm; }
  * { -webkit-print-color-adjust: exact; print-color-adjust: exact; }
  body { font-size: 10.5pt; }
  main { max-width: none; padding: 0; }
  .wide { display: block; }
  .narrow { display: none; }
  .trio { grid-template-columns: repeat(3, minmax(0, 1fr)); }
  .pair { grid-template-columns: repeat(2, minmax(0, 1fr)); }
  table { font-size: 8pt; }
  th, td { padding: 3px 5px; }
  .scroll { overflow: visible; }
  figure, table, .key, .warnings, tr { break-inside: avoid; }
  h2, h3 { break-after: avoid; }
}
)css";

std::string unit_suffix(const std::string& unit) {
  if (unit.empty()) return {};
  return (unit == "deg" ? "" : "\u202f") + pretty_unit(unit);
}

std::string value_html(double value, double error) { return html_number(format_value(value, error)); }

std::string fact(const std::string& name, const std::string& html) {
  return "<dt>" + escape_html(name) + "</dt><dd>" + html + "</dd>\n";
}

std::string list(const std::vector<std::string>& sentences) {
  std::string out = "<ul>\n";
  for (const std::string& sentence : sentences) out += "<li>" + escape_html(sentence) + "</li>\n";
  return out + "</ul>\n";
}

/// A chart for the page's width and another one for a phone, where the first would be too small to read.
std::string wide_and_narrow(Chart chart) {
  chart.width = 884;
  std::string out = "<div class=\"wide\">" + svg(chart) + "</div>";
  chart.width = 370;
  return out + "<div class=\"narrow\">" + svg(chart) + "</div>\n";
}

// ---- one micrograph -------------------------------------------------------------------------------------------------

/// Everything the report needs of one micrograph, whatever part of it is there.
struct Frame {
  const MicrographResult* result = nullptr;
  const Picture* input = nullptr;
  const Scene* scene = nullptr;
  Image measured;
  Image normalised;  ///< residual / sigma; NaN where not used
  Mask used;         ///< pixels of the fit
  std::string unit;  ///< of the values
};

std::vector<Frame> frames_of(const Config& config, const FitResult& result) {
  std::vector<Frame> frames;
  if (!config.signals.empty()) return frames;  // one-pixel images show nothing: the signal is drawn instead
  for (std::size_t i = 0; i < result.micrographs.size(); ++i) {
    Frame frame;
    const MicrographResult& m = result.micrographs[i];
    if (m.fitted.empty()) continue;
    frame.result = &m;
    const int width = m.fitted.width(), height = m.fitted.height();
    const auto fits = [&](const auto& grid) { return grid.width() == width && grid.height() == height; };
    frame.input = picture_at(config.job.measurements, i);
    if (frame.input) {
      frame.scene = &frame.input->scene;
      if (fits(frame.input->values)) frame.measured = frame.input->values;
    }
    frame.unit = frame.input != nullptr && !frame.input->variance_scale.empty() ? "transmission" : "counts";
    frame.normalised = Image(width, height, kMissing);
    frame.used = Mask(width, height, 0);
    if (frame.measured.empty()) frame.measured = Image(width, height, kMissing);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        const double residual = fits(m.residual) ? m.residual(x, y) : kMissing;
        if (!std::isfinite(residual)) continue;
        frame.used(x, y) = 1;
        const double sigma = fits(m.sigma) ? m.sigma(x, y) : 1.0;
        frame.normalised(x, y) = sigma > 0 ? residual / sigma : kMissing;
        if (!std::isfinite(frame.measured(x, y))) frame.measured(x, y) = m.fitted(x, y) + residual;
      }
    frames.push_back(std::move(frame));
  }
  return frames;
}

struct Profile {
  std::vector<double> position, measured, fitted, residual;
  std::string x_label, words;
  std::optional<std::array<double, 4>> line;
  bool mean = false;
};

std::optional<double> theta_of(const FitResult& result, ParameterRef ref) {
  if (!ref || ref.index >= std::ssize(result.theta)) return std::nullopt;
  const double value = result.theta[ref.index];
  return std::isfinite(value) ? std::optional<double>(value) : std::nullopt;
}

/// Between electrodes: the mean over the other axis against the position along the field.
Profile mean_profile(const Frame& frame, bool along_y) {
  Profile profile;
  profile.mean = true;
  const int width = frame.measured.width(), height = frame.measured.height();
  const int length = along_y ? height : width, across = along_y ? width : height;
  profile.x_label = along_y ? "row (px)" : "column (px)";
  profile.words = along_y ? "mean over the columns of every row, along the field"
                          : "mean over the rows of every column, along the field";
  for (int i = 0; i < length; ++i) {
    double measured = 0, fitted = 0, residual = 0;
    int count = 0;
    for (int j = 0; j < across; ++j) {
      const int x = along_y ? j : i, y = along_y ? i : j;
      if (!frame.used(x, y) || !std::isfinite(frame.normalised(x, y))) continue;
      measured += frame.measured(x, y), fitted += frame.result->fitted(x, y), residual += frame.normalised(x, y);
      ++count;
    }
    profile.position.push_back(i);
    profile.measured.push_back(count ? measured / count : kMissing);
    profile.fitted.push_back(count ? fitted / count : kMissing);
    profile.residual.push_back(count ? residual / count : kMissing);
  }
  return profile;
}

/// 0: not known.
double pixel_um(const Frame& frame, const FitResult& result) {
  return frame.scene != nullptr ? theta_of(result, frame.scene->view.pixel_size_um).value_or(0) : 0;
}

/// Through the sample's centre: horizontal, unless that is where the dark cross lies and a diagonal shows more.
Profile line_profile(const Frame& frame, const FitResult& result) {
  const int width = frame.measured.width(), height = frame.measured.height();
  int cx = width / 2, cy = height / 2;
  if (frame.scene != nullptr) {
    if (const auto x = theta_of(result, frame.scene->view.center_x_px); x && *x > 0 && *x < width - 1)
      cx = int(std::lround(*x));
    if (const auto y = theta_of(result, frame.scene->view.center_y_px); y && *y > 0 && *y < height - 1)
      cy = int(std::lround(*y));
  }
  struct Way {
    int dx, dy;
    const char* words;
  };
  constexpr std::array<Way, 4> kWays = {{{1, 0, "the horizontal line"},
                                         {1, -1, "the line at 45\u00b0"},
                                         {0, 1, "the vertical line"},
                                         {1, 1, "the line at \u221245\u00b0"}}};
  const auto walk = [&](const Way& way, auto visit) {
    int first = 0, last = 0;
    const auto inside = [&](int k) {
      const int x = cx + k * way.dx, y = cy + k * way.dy;
      return x >= 0 && y >= 0 && x < width && y < height;
    };
    while (inside(first - 1)) --first;
    while (inside(last + 1)) ++last;
    for (int k = first; k <= last; ++k) visit(k, cx + k * way.dx, cy + k * way.dy);
    return std::pair{first, last};
  };
  const Way* best = &kWays[0];
  double best_variance = -1;
  for (const Way& way : kWays) {
    double sum = 0, square = 0, count = 0;
    walk(way, [&](int, int x, int y) {
      if (!frame.used(x, y)) return;
      const double v = frame.result->fitted(x, y);
      sum += v, square += v * v, count += 1;
    });
    double variance = count > 2 ? square / count - sum * sum / (count * count) : 0;
    if (&way == &kWays[0]) variance *= 1.5;  // preferred: easiest to compare with the image
    if (variance > best_variance * (1 + 1e-9)) best_variance = variance, best = &way;
  }
  Profile profile;
  const double pixel = pixel_um(frame, result);
  const double step = std::hypot(best->dx, best->dy) * (pixel > 0 ? pixel : 1);
  profile.x_label = pixel > 0 ? "distance from the centre (\u00b5m)" : "distance from the centre (px)";
  profile.words = std::string(best->words) + " through the centre (dashed in the measured image)";
  const auto [first, last] = walk(*best, [&](int k, int x, int y) {
    profile.position.push_back(k * step);
    profile.measured.push_back(frame.used(x, y) ? frame.measured(x, y) : kMissing);
    profile.fitted.push_back(frame.result->fitted(x, y));
    profile.residual.push_back(frame.normalised(x, y));
  });
  profile.line = std::array<double, 4>{double(cx + first * best->dx), double(cy + first * best->dy),
                                       double(cx + last * best->dx), double(cy + last * best->dy)};
  return profile;
}

Profile profile_of(const Frame& frame, const FitResult& result) {
  if (frame.scene != nullptr)
    if (const Crystal* crystal = std::get_if<Crystal>(&frame.scene->sample))
      return mean_profile(frame, crystal->field_along_y);
  return line_profile(frame, result);
}

/// End of a symmetric scale in units of sigma: nearly all residuals, at least 3, a round number.
double residual_limit(const Image& normalised) {
  Image magnitude = normalised;
  for (double& value : magnitude.values()) value = std::abs(value);
  const double wanted = quantile(magnitude, nullptr, 0.997);
  if (!(wanted > 3)) return 3;
  const double power = std::pow(10.0, std::floor(std::log10(wanted)));
  for (const double lead : {1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0})
    if (lead * power >= wanted) return lead * power;
  return 10 * power;
}

std::string plain(double value) {
  const bool large = std::abs(value) >= 1e4 && std::abs(value) < 1e7;
  return html_number(large ? fmt::format("{:.0f}", value) : fmt::format("{:.4g}", value));
}

std::string frame_section(const Frame& frame, const FitResult& result, int& figure, int largest_side) {
  const Profile profile = profile_of(frame, result);
  const Mask* mask = &frame.used;
  double low = quantile(frame.measured, mask, 0.001), high = quantile(frame.measured, mask, 0.999);
  low = std::fmin(low, quantile(frame.result->fitted, mask, 0.0));
  high = std::fmax(high, quantile(frame.result->fitted, mask, 1.0));
  if (!std::isfinite(low) || !std::isfinite(high)) low = 0, high = 1;
  if (!(high > low))
    low -= 0.5 * std::max(std::abs(low), 1.0) * 1e-3, high += 0.5 * std::max(std::abs(high), 1.0) * 1e-3;
  const double limit = residual_limit(frame.normalised);
  const bool stack = frame.measured.width() > 2.2 * frame.measured.height();

  ImagePanel panel;
  panel.mask = mask;
  panel.largest_side_px = largest_side;
  panel.wide = stack;
  panel.pixel_size_um = pixel_um(frame, result);
  panel.low = low, panel.high = high;
  panel.unit = frame.unit;

  std::string out = "<h3>" + escape_html(frame.result->name) + "</h3>\n<figure>\n<div class=\"trio" +
                    std::string(stack ? " stack" : "") + "\">\n";
  panel.values = &frame.measured;
  panel.title = "measured image";
  panel.line = profile.line;
  out += "<div><h4>Measured</h4>" + svg(panel) + "</div>\n";
  panel.values = &frame.result->fitted;
  panel.title = "fitted image";
  panel.line.reset();
  panel.pixel_size_um = 0;
  out += "<div><h4>Fitted</h4>" + svg(panel) + "</div>\n";
  panel.values = &frame.normalised;
  panel.colours = Colours::diverging;
  panel.low = -limit, panel.high = limit;
  panel.unit = "\u03c3";
  panel.title = "residual image";
  out += "<div><h4>Residual</h4>" + svg(panel) + "</div>\n</div>\n";

  const int factor = shrink_factor(frame.measured, largest_side);
  const bool hatched =
      std::find(frame.used.values().begin(), frame.used.values().end(), 0) != frame.used.values().end();
  out += fmt::format(
      "<figcaption><b>Figure {}.</b> Measured and fitted image on one grey scale, and measured minus fitted in units "
      "of the noise\u2019s standard deviation \u03c3 of each pixel{}.{} {} \u00d7 {} pixels{}; residual rms {} "
      "{}{}.</figcaption>\n",
      figure++, limit > 3 ? fmt::format(" (scale \u00b1{})", plain(limit)) : "",
      hatched ? " Hatched: pixels left out of the fit." : "", frame.measured.width(), frame.measured.height(),
      factor > 1 ? fmt::format(", {0} \u00d7 {0} averaged for display", factor) : "", plain(frame.result->residual_rms),
      frame.unit,
      frame.result->signal_range > 0
          ? fmt::format(" ({} of the signal range)",
                        format_percent(frame.result->residual_rms / frame.result->signal_range))
          : "");
  out += "</figure>\n";

  Chart chart;
  chart.title = "profile";
  chart.x_label = profile.x_label;
  if (profile.position.size() > 1) chart.x_range = {profile.position.front(), profile.position.back()};
  const double dot = profile.position.size() > 400 ? 2.0 : profile.position.size() > 150 ? 2.8 : 3.6;
  Panel values;
  values.y_label = frame.unit;
  values.height = 230;
  values.series.push_back({Series::Kind::points, "measured", profile.position, profile.measured, kMeasured, dot});
  values.series.push_back({Series::Kind::line, "fitted", profile.position, profile.fitted, kFitted, 1.5});
  Panel residuals;
  residuals.y_label = profile.mean ? "mean residual (\u03c3)" : "residual (\u03c3)";
  residuals.height = 88;
  double largest = 0;
  for (const double r : profile.residual)
    if (std::isfinite(r)) largest = std::max(largest, std::abs(r));
  const double end = profile.mean ? std::max(1.15 * largest, 1e-3) : std::max(1.1 * largest, 3.3);
  residuals.y_range = {-end, end};
  if (!profile.mean || end > 1) residuals.bands = {{-2, 2, kBand2}, {-1, 1, kBand1}};
  residuals.series.push_back(
      {Series::Kind::line, "", {profile.position.front(), profile.position.back()}, {0, 0}, "#8a919b", 0.9});
  residuals.series.push_back({Series::Kind::points, "", profile.position, profile.residual, kMeasured, dot});
  chart.panels = {values, residuals};
  out += "<figure>\n" + wide_and_narrow(chart);
  out += fmt::format(
      "<figcaption><b>Figure {}.</b> Profile: {}. Below, the residual in units of \u03c3{}.</figcaption>\n</figure>\n",
      figure++, profile.words,
      profile.mean ? " of one pixel, averaged like the profile" : "; the bands are \u00b11 and \u00b12 \u03c3");
  return out;
}

/// Measured and fitted signal of one table against its first column.
std::string signal_section(const SignalTable& table, const FitResult& result, int& figure) {
  std::vector<std::size_t> order;
  for (std::size_t r = 0; r < table.x.size(); ++r)
    if (table.first + r < result.micrographs.size() && !result.micrographs[table.first + r].fitted.empty())
      order.push_back(r);
  if (order.empty()) return "";
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return table.x[a] < table.x[b]; });
  std::vector<double> x, measured, fitted, whitened;
  double squares = 0, largest = 0;
  for (const std::size_t r : order) {
    const MicrographResult& m = result.micrographs[table.first + r];
    const double residual = m.residual(0, 0), sigma = m.sigma(0, 0);
    x.push_back(table.x[r]);
    fitted.push_back(m.fitted(0, 0));
    measured.push_back(m.fitted(0, 0) + residual);
    whitened.push_back(sigma > 0 ? residual / sigma : kMissing);
    if (std::isfinite(residual)) squares += residual * residual;
    if (std::isfinite(whitened.back())) largest = std::max(largest, std::abs(whitened.back()));
  }
  const auto [low, high] = std::minmax_element(measured.begin(), measured.end());
  const double rms = std::sqrt(squares / static_cast<double>(order.size()));
  Chart chart;
  chart.title = table.quantity;
  chart.x_label = table.path;
  const double beside = 0.02 * (x.back() - x.front());  // a dot at the end is seen whole
  if (beside > 0) chart.x_range = {x.front() - beside, x.back() + beside};
  const double dot = x.size() > 150 ? 2.8 : x.size() > 30 ? 3.6 : 6;
  Panel values;
  values.y_label = table.quantity;
  values.height = 230;
  values.series.push_back({Series::Kind::points, "measured", x, measured, kMeasured, dot});
  values.series.push_back({Series::Kind::line, "fitted", x, fitted, kFitted, 1.5});
  Panel residuals;
  residuals.y_label = "residual (\u03c3)";
  residuals.height = 88;
  const double end = std::max(1.1 * largest, 3.3);
  residuals.y_range = {-end, end};
  residuals.bands = {{-2, 2, kBand2}, {-1, 1, kBand1}};
  residuals.series.push_back({Series::Kind::line, "", {x.front(), x.back()}, {0, 0}, "#8a919b", 0.9});
  residuals.series.push_back({Series::Kind::points, "", x, whitened, kMeasured, dot});
  chart.panels = {values, residuals};
  return "<h3>" + escape_html(table.name) + "</h3>\n<figure>\n" + wide_and_narrow(chart) +
         fmt::format(
             "<figcaption><b>Figure {}.</b> Measured and fitted {} of {} rows; residual rms {} ({} of the "
             "signal\u2019s spread). Below, the "
             "residual in units of its noise \u03c3.</figcaption>\n</figure>\n",
             figure++, escape_html(table.quantity), order.size(), plain(rms),
             *high > *low ? format_percent(rms / (*high - *low)) : "\u2013");
}

/// The table that this micrograph is a row of, but not its first: what was said of the first holds.
bool later_row(const Config& config, std::size_t micrograph) {
  return !config.signals.empty() && std::none_of(config.signals.begin(), config.signals.end(),
                                                 [&](const SignalTable& t) { return t.first == micrograph; });
}

// ---- tables ---------------------------------------------------------------------------------------------------------

std::string estimate_html(const ParameterEstimate& p) {
  if (!p.limit.empty())
    return fmt::format("{} {}{}", p.limit == "upper" ? "&lt;" : "&gt;", plain(p.limit_value), unit_suffix(p.unit));
  if (!std::isfinite(p.stderr_)) return plain(p.value) + unit_suffix(p.unit) + " <small>\u00b1 not known</small>";
  return fmt::format("{} <small>\u00b1 {}</small>{}", value_html(p.value, p.stderr_),
                     html_number(format_error(p.stderr_)),
                     p.unit.empty() ? "" : "<small>" + unit_suffix(p.unit) + "</small>");
}

std::string key_numbers(const FitResult& result) {
  constexpr std::size_t kShown = 5;
  std::string out = "<dl class=\"key\">\n";
  std::size_t shown = 0;
  // What was asked for first; centres and gains are means to that end.
  for (const bool nuisance : {false, true})
    for (const ParameterEstimate& p : result.parameters) {
      const bool is_nuisance = p.linear || p.name.find("center_px") != std::string::npos || p.unit == "px";
      if (is_nuisance != nuisance || shown >= (nuisance ? 1 : kShown)) continue;
      ++shown;
      out += "<div><dt>" + escape_html(short_name(p.name)) + "</dt><dd>" + estimate_html(p) + "</dd></div>\n";
    }
  long used = 0;
  double sum = 0;
  for (const MicrographResult& m : result.micrographs) {
    used += m.used;
    if (m.signal_range > 0) sum += m.used * std::pow(m.residual_rms / m.signal_range, 2);
  }
  out += "<div><dt>reduced chi-square</dt><dd>" + plain(result.reduced_chi_square) +
         fmt::format(" <small>{} d.o.f.</small></dd></div>\n", result.degrees_of_freedom);
  if (used > 0 && sum > 0)
    out += "<div><dt>residual rms</dt><dd>" + format_percent(std::sqrt(sum / used)) +
           " <small>of signal range</small></dd></div>\n";
  return out + "</dl>\n";
}

std::string interval_html(double low, double high, double error) {
  if (!std::isfinite(low) && !std::isfinite(high)) return "\u2013";
  return value_html(low, error) + " \u2026 " + value_html(high, error);
}

std::string bound_html(double bound) {
  return std::isfinite(bound) ? plain(bound) : bound < 0 ? "\u2212\u221e" : "\u221e";
}

std::string parameter_table(const FitResult& result) {
  std::string out =
      "<div class=\"scroll\"><table class=\"full\">\n<tr><th>parameter</th><th>value</th><th>std. "
      "error</th><th>relative</th>"
      "<th>95 % interval</th><th>start</th><th>bounds</th><th>prior</th><th class=\"left\">unit</th></tr>\n";
  for (const ParameterEstimate& p : result.parameters) {
    const double error = p.stderr_;
    const std::string brief = short_name(p.name);
    std::string flags;
    if (!p.limit.empty())
      flags =
          fmt::format("<br><span class=\"flag\">95 % {} limit {}</span>", escape_html(p.limit), plain(p.limit_value));
    else if (p.at_bound)
      flags = "<br><span class=\"flag\">at its bound</span>";
    else if (p.profiled)
      flags = "<br><small>interval by profile likelihood</small>";
    out += "<tr><td class=\"name\">" + escape_html(brief) +
           (brief != p.name ? "<small>" + escape_html(p.name) + "</small>" : "") + "</td>";
    out += "<td class=\"value\">" + value_html(p.value, error) + flags + "</td>";
    out += "<td>" + html_number(format_error(error)) + "</td>";
    out += "<td>" + (p.value != 0 ? html_number(format_percent(error / p.value)) : "\u2013") + "</td>";
    out += "<td>" + interval_html(p.interval95_low, p.interval95_high, error) + "</td>";
    out += "<td>" + (p.linear ? "\u2013" : plain(p.start)) + "</td>";
    out += "<td>" +
           (std::isfinite(p.lower) || std::isfinite(p.upper) ? bound_html(p.lower) + " \u2026 " + bound_html(p.upper)
                                                             : "none") +
           "</td>";
    out += "<td>" +
           (p.prior_sd
                ? plain(p.prior_value.value_or(p.start)) + " \u00b1 " + html_number(fmt::format("{:.2g}", *p.prior_sd))
                : "\u2013") +
           "</td>";
    out += "<td class=\"left\">" + pretty_unit(p.unit) + "</td></tr>\n";
  }
  return out + "</table></div>\n";
}

std::string correlation_html(double c) {
  const double left = 1 - std::abs(c);
  // -0.999998 must not be rounded to -1.
  const int digits = left > 1e-12 && left < 0.005 ? std::min(7, 1 - static_cast<int>(std::floor(std::log10(left)))) : 2;
  return html_number(fmt::format("{:.{}f}", c, digits));
}

std::string correlation_table(const FitResult& result) {
  const Eigen::Index count = std::min<Eigen::Index>(result.correlation.rows(), std::ssize(result.names));
  if (count < 2 || result.correlation.cols() < count) return {};
  std::string out = "<h2>Correlations</h2>\n<div class=\"scroll\"><table class=\"matrix\">\n<tr><th></th>";
  for (Eigen::Index j = 0; j + 1 < count; ++j)
    out += fmt::format("<th title=\"{}\">{}</th>", escape_html(result.names[j]), j + 1);
  out += "</tr>\n";
  for (Eigen::Index i = 0; i < count; ++i) {
    out += fmt::format("<tr><td title=\"{}\">{}&ensp;{}</td>", escape_html(result.names[i]), i + 1,
                       escape_html(short_name(result.names[i])));
    for (Eigen::Index j = 0; j < i; ++j) {
      const double c = result.correlation(i, j);
      if (!std::isfinite(c)) {
        out += "<td>\u2013</td>";
        continue;
      }
      // Blue against red like the residual, by mixing towards white; strong cells get white figures.
      const double strength = std::pow(std::min(std::abs(c), 1.0), 1.3);
      const std::array<int, 3> end = c < 0 ? std::array{33, 102, 172} : std::array{178, 24, 43};
      std::array<int, 3> rgb;
      for (int k = 0; k < 3; ++k) rgb[k] = static_cast<int>(std::lround(255 + strength * (end[k] - 255)));
      out += fmt::format("<td style=\"background:rgb({},{},{});color:{}\">{}</td>", rgb[0], rgb[1], rgb[2],
                         strength > 0.6 ? "#fff" : "#1d2127", correlation_html(c));
    }
    out += "</tr>\n";
  }
  return out + "</table></div>\n";
}

/// How the branches of the sample compare.
std::string branch_table(const FitResult& result) {
  if (result.branches.empty()) return {};
  std::string out =
      "<h2>Branches</h2>\n<div "
      "class=\"scroll\"><table>\n<tr><th>branch</th><th>chi-square</th><th>parameters</th><th>odds</th></tr>\n";
  for (const BranchResult& b : result.branches)
    out += fmt::format(
        "<tr><td class=\"name\">{}{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n", escape_html(b.name),
        b.reported ? " (reported)" : "", plain(b.chi_square), b.parameters,
        b.odds < 1e-30 ? std::string("&lt; 10<sup>\u221230</sup>") : html_number(fmt::format("{:.2g}", b.odds)));
  return out +
         "</table></div>\n<p>Odds of the evidence: the likelihood, by the noise of the best branch, times the share of "
         "the bounds that the answer takes up.</p>\n";
}

/// What the fit took as exact, and what that does to the estimates.
std::string input_table(const FitResult& result) {
  constexpr std::size_t kMostInputs = 10, kMostParameters = 6;
  std::vector<std::size_t> shown;
  for (std::size_t j = 0; j < result.parameters.size() && shown.size() < kMostParameters; ++j)
    if (!result.parameters[j].linear && result.parameters[j].unit != "px" &&
        std::isfinite(result.parameters[j].stderr_))
      shown.push_back(j);
  if (shown.empty()) return {};
  std::string out = result.inputs.empty() && result.taken_as_exact.empty() ? "" : "<h2>Taken as exact</h2>\n";
  if (!result.taken_as_exact.empty()) out += list(result.taken_as_exact);
  if (result.inputs.empty()) return out;
  out +=
      "<p>What the estimates would change by if an input were otherwise; in brackets over the standard error. An input "
      "with a "
      "<code>prior_sd</code> is fitted, and its uncertainty counted.</p>\n<div "
      "class=\"scroll\"><table>\n<tr><th>input</th><th>value</th><th>more by</th>";
  for (const std::size_t j : shown) out += "<th>" + escape_html(short_name(result.parameters[j].name)) + "</th>";
  out += "</tr>\n";
  for (std::size_t i = 0; i < std::min(kMostInputs, result.inputs.size()); ++i) {
    const InputEffect& input = result.inputs[i];
    out += fmt::format("<tr><td class=\"name\">{}</td><td>{} {}</td><td>{}</td>", escape_html(input.name),
                       html_number(fmt::format("{:.6g}", input.value)), escape_html(input.unit),
                       input.unit == "deg" || input.unit == "px" ? "1 " + input.unit : "1 %");
    for (const std::size_t j : shown) {
      const ParameterEstimate& p = result.parameters[j];
      out += fmt::format("<td>{} ({})</td>", html_number(fmt::format("{:+.2g}", input.shift[j])),
                         html_number(fmt::format("{:+.{}f}", input.shift[j] / p.stderr_,
                                                 std::abs(input.shift[j]) < 10 * p.stderr_ ? 1 : 0)));
    }
    out += "</tr>\n";
  }
  return out + "</table></div>\n";
}

std::string coverage_table(const FitResult& result) {
  if (!result.coverage) return {};
  const Coverage& c = *result.coverage;
  std::string out = fmt::format(
      "<h2>Do the intervals hold?</h2>\n<p>{} images were simulated at this result ({}) and fitted from scratch: {} "
      "gave an answer, {} of these more than 5 standard errors off.</p>\n",
      c.draws,
      c.of_residuals ? "with the fit\u2019s own residuals as noise, drawn in blocks" : "with the noise as modelled",
      c.answered, c.wrong);
  if (c.answered == 0) return out;
  out +=
      "<div class=\"scroll\"><table>\n<tr><th>parameter</th><th>in 68 % interval</th><th>in 95 % "
      "interval</th><th>spread / std. error</th><th>bias / std. error</th></tr>\n";
  for (const Coverage::Of& p : c.parameters)
    out +=
        fmt::format("<tr><td class=\"name\">{}</td><td>{:.1f} %</td><td>{:.1f} %</td><td>{:.2f}</td><td>{}</td></tr>\n",
                    escape_html(short_name(p.name)), 100 * p.inside68, 100 * p.inside95, p.spread,
                    html_number(fmt::format("{:+.2f}", p.bias)));
  return out + fmt::format("</table></div>\n<p>Of {} fits: a fraction of 95 % is known to \u00b1{:.1g} %.</p>\n",
                           c.answered, 100 * std::sqrt(0.95 * 0.05 / c.answered));
}

// ---- diagnostics ----------------------------------------------------------------------------------------------------

const ParameterEstimate* find(const FitResult& result, const std::string& name) {
  for (const ParameterEstimate& p : result.parameters)
    if (p.name == name) return &p;
  return nullptr;
}

std::string diagnostics(const FitResult& result, const std::vector<Frame>& frames, int& figure) {
  std::vector<std::string> cells;
  for (const ScanTrace& scan : result.scans) {
    if (scan.value.size() < 2) continue;
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
    Series series{Series::Kind::line, "scan", {}, {}, kBlue, 1.5};
    for (const auto& [x, y] : points) series.x.push_back(x), series.y.push_back(y);
    panel.series.push_back(std::move(series));
    if (p != nullptr) {
      panel.markers.push_back({p->value, "optimum", kFitted, false});
      panel.markers.push_back({p->start, "start", "#8a919b", true});
    }
    chart.panels = {panel};
    cells.push_back(fmt::format(
        "<figure>{}<figcaption><b>Figure {}.</b> The scan before the solver: chi-square against {}, the other "
        "parameters as the scan had them.</figcaption></figure>\n",
        svg(chart), figure++, escape_html(short_name(scan.name))));
  }
  for (const ProfileTrace& trace : result.profiles) {
    const ParameterEstimate* p = find(result, trace.name);
    if (p == nullptr || trace.value.size() < 3) continue;
    Chart chart;
    chart.title = "profile of " + trace.name;
    chart.x_label = short_name(trace.name) +
                    (p->unit.empty() ? "" : " (" + std::string(p->unit == "um" ? "\u00b5m" : p->unit) + ")");
    Panel panel;
    panel.y_label = "rise of chi-square";
    Series line{Series::Kind::line, "profile", {}, {}, kBlue, 1.5},
        normal{Series::Kind::line, "parabola", {}, {}, "#8a919b", 1.0};
    const Series dots{Series::Kind::points, "", trace.value, trace.rise, kBlue, 4.5};
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
    cells.push_back(
        fmt::format("<figure>{}<figcaption><b>Figure {}.</b> Profile likelihood of {}, all others at their best for "
                    "each of its values. It is no parabola (grey: the standard error\u2019s): "
                    "the interval is where the profile has risen by t\u00b2.</figcaption></figure>\n",
                    svg(chart), figure++, escape_html(short_name(trace.name))));
  }
  if (result.iterations.size() > 1) {
    Chart chart;
    chart.title = "convergence";
    chart.x_label = "iteration";
    Panel panel;
    panel.y_label = "chi-square";
    panel.log_y = true;
    Series line{Series::Kind::line, "", {}, {}, kBlue, 1.5};
    for (const Iteration& i : result.iterations) {
      line.x.push_back(i.number), line.y.push_back(i.chi_square);
      panel.log_y = panel.log_y && i.chi_square > 0;
    }
    Series dots = line;
    dots.kind = Series::Kind::points;
    dots.width = 4.5;
    panel.series = {line, dots};
    chart.panels = {panel};
    cells.push_back(
        fmt::format("<figure>{}<figcaption><b>Figure {}.</b> Convergence of the solver from the best start of the "
                    "scan: {} iterations, {} evaluations.</figcaption></figure>\n",
                    svg(chart), figure++, result.iterations.back().number, result.evaluations));
  }

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
  if (count > 0) {
    Chart chart;
    chart.title = "histogram of residuals";
    chart.x_label = "residual (\u03c3)";
    chart.x_range = {-kReach, kReach};
    Panel panel;
    panel.y_label = "density";
    Series bars{Series::Kind::bars, "pixels", {}, {}, kBar, 0};
    double highest = 1 / std::sqrt(2 * std::numbers::pi);
    for (int i = 0; i < kBins; ++i) {
      bars.x.push_back(-kReach + (i + 0.5) * 2 * kReach / kBins);
      bars.y.push_back(histogram[i] / count / (2 * kReach / kBins));
      highest = std::max(highest, bars.y.back());
    }
    Series normal{Series::Kind::line, "unit normal", {}, {}, kFitted, 1.5};
    for (int i = 0; i <= 120; ++i) {
      const double x = -kReach + i * kReach / 60;
      normal.x.push_back(x), normal.y.push_back(std::exp(-0.5 * x * x) / std::sqrt(2 * std::numbers::pi));
    }
    panel.y_range = {0, 1.08 * highest};
    panel.series = {bars, normal};
    chart.panels = {panel};
    const double mean = sum / count;
    cells.push_back(
        fmt::format("<figure>{}<figcaption><b>Figure {}.</b> Residuals of all used pixels: mean {}, standard deviation "
                    "{}; {} beyond 3 \u03c3 "
                    "(a normal distribution has 0.27 %){}.</figcaption></figure>\n",
                    svg(chart), figure++, html_number(fmt::format("{:.2g}", mean)),
                    html_number(fmt::format("{:.3g}", std::sqrt(std::max(0.0, square / count - mean * mean)))),
                    format_percent(beyond / count),
                    outside > 0 ? fmt::format(", {:.0f} pixels beyond 6 \u03c3 not shown", outside) : ""));
  }
  if (cells.empty()) return {};
  std::string out = "<h2>Search and residuals</h2>\n<div class=\"pair\">\n";
  for (const std::string& cell : cells) out += cell;
  return out + "</div>\n";
}

std::string identifiability(const Config& config, const FitResult& result) {
  std::string out = "<h2>What the data determine</h2>\n";
  out += result.identifiable ? "<p>Every fitted parameter is determined by the data and the priors.</p>\n"
                             : "<p>Not every combination of the fitted parameters is determined by the data.</p>\n";
  if (!result.directions.empty()) {
    out += "<ul>\n";
    for (const FisherDirection& d : result.directions)
      if (!d.words.empty())
        out += "<li>" + std::string(d.identifiable ? "" : "<span class=\"flag\">not identifiable</span> ") +
               escape_html(d.words) + "</li>\n";
    out += "</ul>\n";
  }
  if (!result.rivals.empty()) {
    out +=
        "<h3>Rival minima, with their odds against the reported one</h3>\n<div class=\"scroll\"><table>\n<tr><th>odds "
        "against the reported "
        "minimum</th><th>likelihood ratio</th><th>chi-square</th>";
    std::vector<const ParameterEstimate*> shown;
    for (const ParameterEstimate& p : result.parameters)
      if (!p.linear && shown.size() < 6) shown.push_back(&p);
    for (const ParameterEstimate* p : shown)
      out += "<th>" + escape_html(short_name(p->name)) + (p->unit.empty() ? "" : " (" + pretty_unit(p->unit) + ")") +
             "</th>";
    out += "</tr>\n";
    for (const RivalMinimum& rival : result.rivals) {
      out += "<tr><td>" + html_number(fmt::format("{:.2g}", rival.odds)) + "</td><td>" +
             html_number(fmt::format("{:.2g}", rival.likelihood_ratio)) + "</td><td>" +
             html_number(fmt::format("{:.6g}", rival.chi_square)) + "</td>";
      for (const ParameterEstimate* p : shown) {
        const ParameterRef ref = config.job.parameters.find(p->name);
        out +=
            "<td>" +
            (ref && ref.index < std::ssize(rival.theta) ? value_html(rival.theta[ref.index], p->stderr_) : "\u2013") +
            "</td>";
      }
      out += "</tr>\n";
    }
    out += "</table></div>\n";
  }
  return out;
}

std::string model_section(const Config& config, const FitResult& result) {
  std::string out = "<h2>Model</h2>\n";
  const RenderPlan* previous = nullptr;
  for (const MicrographResult& m : result.micrographs) {
    const RenderPlan& plan = m.plan;
    if (later_row(config, static_cast<std::size_t>(&m - result.micrographs.data()))) continue;
    if (previous != nullptr && previous->method == plan.method && previous->physics == plan.physics &&
        previous->reasons == plan.reasons)
      continue;  // frames of one series share it
    previous = &plan;
    if (result.micrographs.size() > 1)
      out += "<h3>" + escape_html(m.name) + (&m == &result.micrographs[0] ? " and those like it" : "") + "</h3>\n";
    out += "<dl class=\"facts\">\n" + fact("method", escape_html(plan.method)) +
           fact("physics", escape_html(plan.physics)) +
           fact("numerical error",
                html_number(fmt::format("{:.2g}", plan.numerical_error)) + " of the incident intensity") +
           fact("model error", html_number(fmt::format("{:.2g}", plan.model_error)) +
                                   " of the incident intensity, from what the physics leaves out") +
           "</dl>\n";
    if (!plan.reasons.empty()) out += list(plan.reasons);
    std::vector<std::string> not_modelled = plan.warnings;
    not_modelled.insert(not_modelled.end(), plan.left_out.begin(), plan.left_out.end());
    if (!not_modelled.empty()) out += "<p>Not modelled:</p>\n" + list(not_modelled);
  }
  return out;
}

std::string data_section(const Config& config, const FitResult& result) {
  std::string out =
      "<h2>Data</h2>\n<p>Pixels used and left out, by reason; noise model in counts.</p>\n<div class=\"scroll\"><table "
      "class=\"full\">\n<tr><th>micrograph</th><th>used</th><th>masked</th>"
      "<th>outside<br>ROI</th><th>satu-<br>rated</th><th>dead</th><th>not<br>finite</th><th>out-<br>liers</"
      "th><th>chi-square<br>per "
      "pixel</th>"
      "<th>read<br>noise</th><th>counts per<br>photon</th></tr>\n";
  for (std::size_t i = 0; i < result.micrographs.size(); ++i) {
    if (later_row(config, i)) continue;
    const MicrographResult& m = result.micrographs[i];
    const Picture none;
    const Picture* of = picture_at(config.job.measurements, i);
    const Picture& input = of ? *of : none;
    out += fmt::format(
        "<tr><td class=\"name "
        "file\">{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td>"
        "<td>{}{}</td><td>{}</td></tr>\n",
        escape_html(m.name), m.used, input.masked_by_user, input.outside_roi + m.outside, input.saturated, input.dead,
        input.non_finite, m.outliers, m.used > 0 ? plain(m.chi_square / m.used) : "\u2013", plain(m.noise.read_counts),
        m.noise.estimated ? "*" : "", plain(m.noise.counts_per_photon));
  }
  out += "</table></div>\n";
  if (std::any_of(result.micrographs.begin(), result.micrographs.end(),
                  [](const auto& m) { return m.noise.estimated; }))
    out += "<p><small>* noise estimated from the image itself</small></p>\n";
  return out;
}

std::string statistics_section(const Config& config, const FitResult& result) {
  std::string out = "<dl class=\"facts\">\n";
  if (!result.covariance_kind.empty()) out += fact("standard errors", escape_html(result.covariance_kind));
  out += fact("95 % intervals", std::isfinite(result.interval_degrees_of_freedom)
                                    ? "Student t, " + plain(result.interval_degrees_of_freedom) + " degrees of freedom"
                                    : "normal distribution");
  if (result.frame_scatter)
    out += fact("scatter between frames", format_percent(result.frame_scatter->intensity_sd) + " of the intensity, " +
                                              plain(result.frame_scatter->degrees_of_freedom) + " degrees of freedom");
  if (config.job.prior) {
    std::string names;
    for (const std::string& name : config.job.prior->names) names += (names.empty() ? "" : ", ") + name;
    out += fact("joint prior", escape_html(names) + " from " + escape_html(config.job.prior->source));
  }
  return out + "</dl>\n";
}

std::string badge(const FitResult& result) {
  if (result.has_answer()) return "<span class=\"badge good\">Answer</span>";
  const char* reason = result.interrupted     ? "interrupted"
                       : !result.converged    ? "not converged"
                       : !result.described    ? "not described by the model"
                       : result.ambiguous     ? "ambiguous"
                       : !result.identifiable ? "not identifiable"
                                              : "pinned at a bound";
  return fmt::format("<span class=\"badge bad\">No answer: {}</span>", reason);
}

}  // namespace

std::string report_html(const Config& config, const FitResult& result) {
  const std::vector<Frame> frames = frames_of(config, result);
  const std::string title = config.path.filename().string();
  // Series of many frames stay a file that a mail can carry.
  const int largest_side = frames.size() <= 2 ? 700 : frames.size() <= 6 ? 480 : 300;
  int figure = 1;

  std::string out =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      // Even if something were to slip through the escaping, no browser would run or fetch it.
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; style-src "
      "'unsafe-inline'\">\n"
      "<title>" +
      escape_html(title) + " \u2013 birefit</title>\n<style>" + kStyle + "</style>\n</head>\n<body>\n<main>\n";
  out += "<p class=\"eyebrow\">birefit fit report</p>\n<h1>" + escape_html(title) + "</h1>\n";
  out += "<div class=\"verdict\">" + badge(result) + "<p>" + escape_html(result.verdict) + "</p></div>\n";
  out += key_numbers(result);
  if (!result.warnings.empty()) out += "<div class=\"warnings\"><b>Warnings</b>\n" + list(result.warnings) + "</div>\n";

  if (!config.signals.empty()) out += "<h2>Signal</h2>\n";
  for (const SignalTable& table : config.signals) out += signal_section(table, result, figure);
  if (!frames.empty()) out += "<h2>Images</h2>\n";
  for (const Frame& frame : frames) out += frame_section(frame, result, figure, largest_side);

  out += "<h2>Parameters</h2>\n" + parameter_table(result) + statistics_section(config, result);
  out += input_table(result);
  out += branch_table(result);
  out += coverage_table(result);
  out += correlation_table(result);
  out += diagnostics(result, frames, figure);
  out += identifiability(config, result);
  out += model_section(config, result);
  out += data_section(config, result);

  out += "<h2>Provenance</h2>\n<dl class=\"facts\">\n" + fact("program", "birefit " BIREFIT_VERSION) +
         fact("config", escape_html(config.path.string())) +
         fact("effort", fmt::format("{} evaluations, {:.3g} s", result.evaluations, result.seconds)) + "</dl>\n";
  out += "<details><summary>Config as read</summary>\n<pre>" + escape_html(config.text) + "</pre></details>\n";
  if (!result.solver_report.empty())
    out += "<details><summary>The solver\u2019s own report</summary>\n<pre>" + escape_html(result.solver_report) +
           "</pre></details>\n";
  return out + "</main>\n</body>\n</html>\n";
}

}  // namespace birefit
