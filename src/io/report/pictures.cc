#include "io/report/pictures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>
#include <variant>

#include <fmt/format.h>

#include "io/report/image.h"
#include "io/report/page.h"

namespace birefit::page {
namespace {

constexpr const char* kBand1 = "#dfe8f3";
constexpr const char* kBand2 = "#eff4f9";

}  // namespace

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

namespace {

struct Profile {
  std::vector<double> position, measured, fitted, residual;
  std::string x_label, words;
  std::optional<std::array<double, 4>> line;
  bool mean = false;
};

std::optional<double> theta_of(const FitResult& result, ParameterRef ref) {
  if (!ref || ref.index >= std::ssize(result.theta)) return std::nullopt;
  const double value = ref.in(result.theta);
  return std::isfinite(value) ? std::optional<double>(value) : std::nullopt;
}

/// Between electrodes: the mean over the other axis against the position along the field.
Profile mean_profile(const Frame& frame, bool along_y) {
  Profile profile;
  profile.mean = true;
  const int width = frame.measured.width(), height = frame.measured.height();
  const int length = along_y ? height : width, across = along_y ? width : height;
  const FilePixels& file = frame.scene->view.file;
  const double bin = file.bin, first = along_y ? file.y0 : file.x0;
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
    profile.position.push_back(first + bin * (i + 0.5) - 0.5);
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

}  // namespace

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
  panel.title = "measured image of " + frame.result->name;
  panel.line = profile.line;
  out += "<div><h4>Measured</h4>" + svg(panel) + "</div>\n";
  panel.values = &frame.result->fitted;
  panel.title = "fitted image of " + frame.result->name;
  panel.line.reset();
  panel.pixel_size_um = 0;
  out += "<div><h4>Fitted</h4>" + svg(panel) + "</div>\n";
  panel.values = &frame.normalised;
  panel.colours = Colours::diverging;
  panel.low = -limit, panel.high = limit;
  panel.unit = "\u03c3";
  panel.title = "residual image of " + frame.result->name;
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
      (frame.scene && frame.scene->view.file.bin > 1
           ? fmt::format(" of {0} \u00d7 {0} of the file each", frame.scene->view.file.bin)
           : "") +
          (factor > 1 ? fmt::format(", {0} \u00d7 {0} averaged for display", factor) : ""),
      plain(frame.result->residual_rms), frame.unit,
      frame.result->signal_range > 0
          ? fmt::format(" ({} of the signal range)",
                        format_percent(frame.result->residual_rms / frame.result->signal_range))
          : "");
  out += "</figure>\n";

  Chart chart;
  chart.title = profile.words + " in " + frame.result->name;
  chart.x_label = profile.x_label;
  if (profile.position.size() > 1) chart.x_range = {profile.position.front(), profile.position.back()};
  const double dot = profile.position.size() > 400 ? 2.0 : profile.position.size() > 150 ? 2.8 : 3.6;
  Panel values;
  values.y_label = frame.unit;
  values.height = 230;
  values.series.push_back({DataSeries::Kind::points, "measured", profile.position, profile.measured, kMeasured, dot});
  values.series.push_back({DataSeries::Kind::line, "fitted", profile.position, profile.fitted, kFitted, 1.5});
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
      {DataSeries::Kind::line, "", {profile.position.front(), profile.position.back()}, {0, 0}, "#8a919b", 0.9});
  residuals.series.push_back({DataSeries::Kind::points, "", profile.position, profile.residual, kMeasured, dot});
  chart.panels = {values, residuals};
  out += "<figure>\n" + wide_and_narrow(chart);
  out += fmt::format(
      "<figcaption><b>Figure {}.</b> Profile: {}. Below, the residual in units of \u03c3{}.</figcaption>\n</figure>\n",
      figure++, profile.words,
      profile.mean ? " of one pixel, averaged like the profile" : "; the bands are \u00b11 and \u00b12 \u03c3");
  return out;
}

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
  values.series.push_back({DataSeries::Kind::points, "measured", x, measured, kMeasured, dot});
  values.series.push_back({DataSeries::Kind::line, "fitted", x, fitted, kFitted, 1.5});
  Panel residuals;
  residuals.y_label = "residual (\u03c3)";
  residuals.height = 88;
  const double end = std::max(1.1 * largest, 3.3);
  residuals.y_range = {-end, end};
  residuals.bands = {{-2, 2, kBand2}, {-1, 1, kBand1}};
  residuals.series.push_back({DataSeries::Kind::line, "", {x.front(), x.back()}, {0, 0}, "#8a919b", 0.9});
  residuals.series.push_back({DataSeries::Kind::points, "", x, whitened, kMeasured, dot});
  chart.panels = {values, residuals};
  return "<h3>" + escape_html(table.name) + "</h3>\n<figure>\n" + wide_and_narrow(chart) +
         fmt::format(
             "<figcaption><b>Figure {}.</b> Measured and fitted {} of {} rows; residual rms {} ({} of the "
             "signal\u2019s spread). Below, the "
             "residual in units of its noise \u03c3.</figcaption>\n</figure>\n",
             figure++, escape_html(table.quantity), order.size(), plain(rms),
             *high > *low ? format_percent(rms / (*high - *low)) : "\u2013");
}

}  // namespace birefit::page
