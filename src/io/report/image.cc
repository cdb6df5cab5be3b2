#include "io/report/image.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "birefit/io.h"
#include "io/report/chart.h"
#include "io/report/format.h"

namespace birefit {
namespace {

using Rgb = std::array<unsigned char, 3>;

constexpr Rgb kHatchLight = {226, 222, 214}, kHatchDark = {190, 184, 173};
constexpr int kHatchPeriod = 6;  // of the PNG's pixels

/// ColorBrewer RdBu, blue first: symmetric in lightness, safe for the colour-blind.
constexpr std::array<Rgb, 11> kDiverging = {{{5, 48, 97},
                                             {33, 102, 172},
                                             {67, 147, 195},
                                             {146, 197, 222},
                                             {209, 229, 240},
                                             {247, 247, 247},
                                             {253, 219, 199},
                                             {244, 165, 130},
                                             {214, 96, 77},
                                             {178, 24, 43},
                                             {103, 0, 31}}};

Rgb colour_of(double t, Colours colours) {
  t = std::clamp(t, 0.0, 1.0);
  if (colours == Colours::grey) {
    const auto grey = static_cast<unsigned char>(std::lround(255 * t));
    return {grey, grey, grey};
  }
  const double at = t * (kDiverging.size() - 1);
  const std::size_t i = std::min(static_cast<std::size_t>(at), kDiverging.size() - 2);
  Rgb rgb;
  for (int c = 0; c < 3; ++c)
    rgb[c] = static_cast<unsigned char>(
        std::lround(kDiverging[i][c] + (at - i) * (kDiverging[i + 1][c] - kDiverging[i][c])));
  return rgb;
}

std::string base64(const std::vector<unsigned char>& bytes) {
  static constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const unsigned b =
        bytes[i] << 16 | (i + 1 < bytes.size() ? bytes[i + 1] << 8 : 0) | (i + 2 < bytes.size() ? bytes[i + 2] : 0);
    out += kDigits[b >> 18 & 63];
    out += kDigits[b >> 12 & 63];
    out += i + 1 < bytes.size() ? kDigits[b >> 6 & 63] : '=';
    out += i + 2 < bytes.size() ? kDigits[b & 63] : '=';
  }
  return out;
}

std::string png_uri(const std::vector<unsigned char>& samples, int width, int height, int channels) {
  return "data:image/png;base64," + base64(encode_png(samples, width, height, channels));
}

std::string encode_panel(const ImagePanel& panel, int factor) {
  const Image& values = *panel.values;
  const int width = std::max(1, values.width() / factor), height = std::max(1, values.height() / factor);
  std::vector<unsigned char> rgb(static_cast<std::size_t>(width) * height * 3);
  bool coloured = panel.colours != Colours::grey;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      double used_sum = 0, sum = 0;
      int used = 0, finite = 0, all = 0;
      for (int v = y * factor; v < std::min((y + 1) * factor, values.height()); ++v)
        for (int u = x * factor; u < std::min((x + 1) * factor, values.width()); ++u) {
          ++all;
          if (!std::isfinite(values(u, v))) continue;
          ++finite;
          sum += values(u, v);
          if (panel.mask != nullptr && !panel.mask->empty() && !(*panel.mask)(u, v)) continue;
          ++used;
          used_sum += values(u, v);
        }
      const bool left_out = 2 * used < all;
      const double mean = !left_out ? used_sum / used : finite > 0 ? sum / finite : std::nan("");
      Rgb colour =
          std::isfinite(mean) ? colour_of((mean - panel.low) / (panel.high - panel.low), panel.colours) : kHatchLight;
      if (left_out) {
        coloured = true;
        const Rgb& hatch = (x + y) % kHatchPeriod < kHatchPeriod / 2 ? kHatchDark : kHatchLight;
        // What lies below shows through, so that a mask can be judged; not in the residual, where it means nothing.
        const double share = !std::isfinite(mean) || panel.colours == Colours::diverging ? 1.0 : 0.65;
        for (int c = 0; c < 3; ++c)
          colour[c] = static_cast<unsigned char>(std::lround(share * hatch[c] + (1 - share) * colour[c]));
      }
      std::copy(colour.begin(), colour.end(), rgb.begin() + 3 * (static_cast<std::size_t>(y) * width + x));
    }
  if (coloured) return png_uri(rgb, width, height, 3);
  std::vector<unsigned char> grey(static_cast<std::size_t>(width) * height);
  for (std::size_t i = 0; i < grey.size(); ++i) grey[i] = rgb[3 * i];
  return png_uri(grey, width, height, 1);
}

std::string colour_bar_uri(Colours colours) {
  constexpr int kSteps = 128;
  std::vector<unsigned char> rgb;
  for (int i = 0; i < kSteps; ++i) {
    const Rgb colour = colour_of(1 - (i + 0.5) / kSteps, colours);
    rgb.insert(rgb.end(), colour.begin(), colour.end());
  }
  return png_uri(rgb, 1, kSteps, 3);
}

}  // namespace

int shrink_factor(const Image& values, int largest_side_px) {
  return std::max(1, (std::max(values.width(), values.height()) + largest_side_px - 1) / largest_side_px);
}

double quantile(const Image& values, const Mask* mask, double fraction) {
  std::vector<double> sorted;
  sorted.reserve(values.size());
  for (std::size_t i = 0; i < values.size(); ++i)
    if (std::isfinite(values.values()[i]) && (mask == nullptr || mask->empty() || mask->values()[i]))
      sorted.push_back(values.values()[i]);
  if (sorted.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto at = sorted.begin() + static_cast<std::ptrdiff_t>(fraction * static_cast<double>(sorted.size() - 1));
  std::nth_element(sorted.begin(), at, sorted.end());
  return *at;
}

std::string svg(const ImagePanel& panel) {
  const Image& values = *panel.values;
  const int factor = shrink_factor(values, panel.largest_side_px);
  const double aspect = double(values.height()) / values.width();
  double width = panel.wide ? 800 : 236, height = width * aspect;
  if (const double tallest = panel.wide ? 600 : 420; height > tallest) height = tallest, width = height / aspect;
  const double bar_x = width + 8, bar_width = 9, total = width + 64, top = 16, bar_height = std::max(height, 40.0);

  std::string out = fmt::format(
      "<svg class=\"image\" viewBox=\"0 0 {:.0f} {:.0f}\" style=\"max-width:{:.0f}px\" role=\"img\" aria-label=\"{}\" "
      "font-size=\"10.5\">",
      total, bar_height + top + 6, 1.7 * total,
      escape_html(fmt::format("{}, {} x {} pixels, {} from {:.4g} to {:.4g} {}", panel.title, values.width(),
                              values.height(), panel.colours == Colours::grey ? "black to white" : "blue to red",
                              panel.low, panel.high, panel.unit)));
  // Few pixels: each is a square to be seen. Many: let the browser average.
  const bool pixelated = std::max(values.width(), values.height()) / factor < 1.4 * std::max(width, height);
  out += fmt::format(
      "<image x=\"0\" y=\"{}\" width=\"{:.1f}\" height=\"{:.1f}\" preserveAspectRatio=\"none\"{} href=\"{}\"/>", top,
      width, height, pixelated ? " style=\"image-rendering:pixelated\"" : "", encode_panel(panel, factor));
  out += fmt::format(
      "<rect x=\"0\" y=\"{}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"none\" stroke=\"#8a919b\" "
      "stroke-width=\"0.8\"/>",
      top, width, height);

  if (panel.line) {
    const double s = width / values.width();
    const auto& [x0, y0, x1, y1] = *panel.line;
    const std::string points = fmt::format("M{:.1f} {:.1f}L{:.1f} {:.1f}", (x0 + 0.5) * s, top + (y0 + 0.5) * s,
                                           (x1 + 0.5) * s, top + (y1 + 0.5) * s);
    out += fmt::format(
        "<path d=\"{}\" fill=\"none\" stroke=\"#ffffff\" stroke-opacity=\"0.85\" stroke-width=\"1.8\"/>"
        "<path d=\"{}\" fill=\"none\" stroke=\"#c0392b\" stroke-width=\"1\" stroke-dasharray=\"5 3\"/>",
        points, points);
  }

  if (panel.pixel_size_um > 0) {
    const double field_um = panel.pixel_size_um * values.width();
    const std::vector<double> ticks = nice_ticks(0, field_um, 5);
    if (ticks.size() > 1) {
      const double length_um = ticks[1], length = length_um / field_um * width, x = 8, y = top + height - 9;
      const std::string label = length_um < 1       ? fmt::format("{:.3g} nm", 1e3 * length_um)
                                : length_um >= 1000 ? fmt::format("{:.3g} mm", 1e-3 * length_um)
                                                    : fmt::format("{:.3g} \u00b5m", length_um);
      out += fmt::format(
          "<rect x=\"{}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"3\" fill=\"#fff\" stroke=\"#000\" "
          "stroke-width=\"0.5\"/>",
          x, y, length);
      out += fmt::format(
          "<text x=\"{:.1f}\" y=\"{:.1f}\" fill=\"#fff\" stroke=\"#000\" stroke-width=\"2.2\" "
          "paint-order=\"stroke\" stroke-linejoin=\"round\">{}</text>",
          x, y - 4, label);
    }
  }

  out += fmt::format(
      "<image x=\"{:.1f}\" y=\"{}\" width=\"{}\" height=\"{:.1f}\" preserveAspectRatio=\"none\" href=\"{}\"/>", bar_x,
      top, bar_width, bar_height, colour_bar_uri(panel.colours));
  out += fmt::format(
      "<rect x=\"{:.1f}\" y=\"{}\" width=\"{}\" height=\"{:.1f}\" fill=\"none\" stroke=\"#8a919b\" "
      "stroke-width=\"0.8\"/>",
      bar_x, top, bar_width, bar_height);
  // A common power of ten keeps the labels short.
  const double largest = std::max(std::abs(panel.low), std::abs(panel.high));
  const int power =
      largest >= 1e5 || (largest > 0 && largest < 1e-2) ? static_cast<int>(std::floor(std::log10(largest))) : 0;
  const double scale = std::pow(10.0, power);
  const std::vector<double> ticks =
      nice_ticks(panel.low / scale, panel.high / scale, std::clamp(static_cast<int>(bar_height / 36), 2, 6));
  const double step = ticks.size() > 1 ? ticks[1] - ticks[0] : 1;
  for (const double tick : ticks) {
    const double y = top + bar_height * (panel.high - tick * scale) / (panel.high - panel.low);
    out += fmt::format(
        "<path d=\"M{:.1f} {:.1f}h3\" stroke=\"#5b626c\" stroke-width=\"0.8\"/>"
        "<text x=\"{:.1f}\" y=\"{:.1f}\" fill=\"#2b2f36\">{}</text>",
        bar_x + bar_width, y, bar_x + bar_width + 5, y + 3.6, html_number(tick_label(tick, step)));
  }
  std::string unit = escape_html(panel.unit);
  const bool long_unit = unit.size() > 8 || power != 0;
  if (power != 0)
    unit += fmt::format(" \u00d710<tspan dy=\"-4\" font-size=\"8\">{}{}</tspan>", power < 0 ? "\u2212" : "",
                        std::abs(power));
  out += fmt::format("<text x=\"{:.1f}\" y=\"10\" text-anchor=\"{}\" fill=\"#2b2f36\">{}</text></svg>\n",
                     long_unit ? total - 2 : bar_x, long_unit ? "end" : "start", unit);
  return out;
}

}  // namespace birefit
