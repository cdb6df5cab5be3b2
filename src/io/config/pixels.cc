#include "io/config/pixels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include "core/robust.h"
#include "core/sub_grid.h"
#include "io/libraries/table.h"
#include "medium/materials/dispersion.h"

namespace birefit {
namespace {

constexpr double kOutlierSd = 8;  // one normal pixel in 1e15 lies beyond
constexpr double kPileUpFraction = 0.002;
constexpr int kPileUpPixels = 20;
/// A smooth intensity maximum (fringe crests of sin^2) puts up to three times the pixels of the next codes' average
/// into its top code; a clipped signal far more.
constexpr double kPileUpRatio = 4;
/// More than half of the pixels at the top is a bright flat image rather than a clipped one.
constexpr double kPileUpMostly = 0.5;

/// Through every entry, growing; beyond the ends straight on.
double light_of(const Transfer& t, double code) {
  const std::vector<double>&x = t.code, &y = t.light;
  if (code >= x.front() && code <= x.back()) return table_index(x, y, code);
  const std::size_t i = code < x.front() ? 0 : x.size() - 2;
  return y[i] + (code - x[i]) * (y[i + 1] - y[i]) / (x[i + 1] - x[i]);
}

}  // namespace

void linearise(Image& values, const Transfer& transfer, double top_code) {
  if (transfer.kind == Transfer::Kind::linear) return;
  if (transfer.kind == Transfer::Kind::table) {
    // The top code stays where it is, or, where there is none, the table's last.
    const double last = top_code > 0 ? top_code : transfer.code.back(), scale = last / light_of(transfer, last);
    for (double& value : values.values()) value = scale * light_of(transfer, value);
    return;
  }
  const double top = top_code > 0 ? top_code : 1;
  for (double& value : values.values()) {
    const double code = value / top;
    double light = code;
    if (transfer.kind == Transfer::Kind::gamma) {
      light = code > 0 ? std::pow(code, transfer.gamma) : code;
    } else {
      light = code <= 0.04045 ? code / 12.92 : std::pow((code + 0.055) / 1.055, 2.4);  // IEC 61966-2-1
    }
    value = light * top;
  }
}

Saturation find_saturation(const LoadedImage& image, const PixelRect& area, std::optional<double> given) {
  Saturation saturation;
  saturation.from = std::numeric_limits<double>::infinity();
  if (given) {
    saturation.from = *given;
    return saturation;
  }
  if (!(image.top_code > 0)) return saturation;
  saturation.from = image.top_code;
  std::vector<int> histogram(static_cast<std::size_t>(image.top_code) + 1);
  int total = 0, top = 0, bottom = static_cast<int>(image.top_code);
  for (int y = area.y0; y < area.y1; ++y) {
    for (int x = area.x0; x < area.x1; ++x) {
      const double value = image.values(x, y);
      // The top code itself is excluded anyway; a few such pixels (hot ones) must not hide a pile-up below.
      if (!std::isfinite(value) || value < 0 || value >= image.top_code) continue;
      const int code = static_cast<int>(std::lround(value));
      ++histogram[code];
      ++total;
      top = std::max(top, code);
      bottom = std::min(bottom, code);
    }
  }
  // A few hot pixels may lie above the code at which the sensor saturates: look at the highest well filled code.
  int above = 0;
  while (top > bottom && above + histogram[top] < kPileUpFraction * total) above += histogram[top--];
  if (total == 0 || top - bottom < 16 || top < 3) return saturation;
  const int here = histogram[top];
  const double below = (histogram[top - 1] + histogram[top - 2] + histogram[top - 3]) / 3.0;
  if (here >= kPileUpPixels && here > kPileUpFraction * total && here < kPileUpMostly * total &&
      below * kPileUpRatio <= here) {
    saturation.from = top;
    saturation.pile_up = true;
    saturation.pile_up_pixels = here + above;
  }
  return saturation;
}

int exclude_outliers(const Image& values, const PixelRect& area, double smallest_step, Smoothness smoothness,
                     Mask& mask) {
  if (const SubGrid grid = sub_grid(mask); grid.spacing > 1) {
    const auto along = [&](int edge, int first) {
      return std::max(0, (edge - first + grid.spacing - 1) / grid.spacing);
    };
    const PixelRect part{along(area.x0, grid.x0), along(area.y0, grid.y0), along(area.x1, grid.x0),
                         along(area.y1, grid.y0)};
    Mask used = on_grid(mask, grid);
    const int excluded = exclude_outliers(on_grid(values, grid), part, smallest_step, smoothness, used);
    put_back(used, grid, mask);
    return excluded;
  }
  // Two pixels of margin keep the neighbourhoods of the area's border whole.
  const PixelRect frame{std::max(0, area.x0 - 2), std::max(0, area.y0 - 2), std::min(values.width(), area.x1 + 2),
                        std::min(values.height(), area.y1 + 2)};
  const int width = frame.width(), height = frame.height();
  if (width < 5 || height < 5) return 0;
  const double fill = robust_spread(values, mask, area).median;
  if (!std::isfinite(fill)) return 0;
  // Differences to the overall median keep single precision exact enough for faint structure on a bright background.
  Grid<float> counts(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double value = values(frame.x0 + x, frame.y0 + y);
      counts(x, y) = std::isfinite(value) ? static_cast<float>(value - fill) : 0.0f;
    }
  }
  const Grid<float> smooth = median_of_neighbours(counts);

  struct Pixel {
    float level, difference;
    int x, y;
  };
  std::vector<Pixel> pixels;
  for (int y = area.y0; y < area.y1; ++y) {
    for (int x = area.x0; x < area.x1; ++x) {
      if (!mask(x, y)) continue;
      const float level = smooth(x - frame.x0, y - frame.y0);
      pixels.push_back({level, counts(x - frame.x0, y - frame.y0) - level, x, y});
    }
  }
  // Noise grows with brightness: the scatter is measured in groups of equal brightness.
  std::sort(pixels.begin(), pixels.end(), [](const Pixel& a, const Pixel& b) {
    return a.level != b.level ? a.level < b.level : a.y != b.y ? a.y < b.y : a.x < b.x;
  });
  const std::size_t groups = std::clamp<std::size_t>(pixels.size() / 500, 1, 16);
  int excluded = 0;
  std::vector<double> distances;
  for (std::size_t g = 0; g < groups; ++g) {
    const std::size_t begin = pixels.size() * g / groups, end = pixels.size() * (g + 1) / groups;
    distances.clear();
    for (std::size_t i = begin; i < end; ++i) distances.push_back(std::abs(pixels[i].difference));
    const double sd = std::max(kNormalSdPerMad * median(distances), smallest_step);
    for (std::size_t i = begin; i < end; ++i) {
      const Pixel& pixel = pixels[i];
      if (!(std::abs(pixel.difference) > kOutlierSd * sd)) continue;
      const int x = pixel.x - frame.x0, y = pixel.y - frame.y0;
      if (smoothness == Smoothness::image) {
        // A fringe passes through a neighbourhood, a broken pixel stands alone in it: beyond all but one of its eight
        // neighbours by half the range of the others.
        std::array<float, 8> near;
        std::array<float, 24> wide;
        int n = 0, w = 0;
        for (int dy = -2; dy <= 2; ++dy) {
          for (int dx = -2; dx <= 2; ++dx) {
            if (dx == 0 && dy == 0) continue;
            const int yy = std::clamp(y + dy, 0, height - 1), xx = std::clamp(x + dx, 0, width - 1);
            const float value = counts(xx, yy);
            wide[w++] = value;
            if (std::abs(dx) <= 1 && std::abs(dy) <= 1) near[n++] = value;
          }
        }
        std::sort(near.begin(), near.end());
        std::sort(wide.begin(), wide.end());
        const float value = counts(x, y);
        const double beyond = pixel.difference > 0 ? value - near[6] : near[1] - value;
        if (!(beyond > std::max(0.5 * kOutlierSd * sd, 0.5 * (wide[22] - wide[1])))) continue;
      }
      mask(pixel.x, pixel.y) = 0;
      ++excluded;
    }
  }
  return excluded;
}

int exclude_outliers_in_cells(const Image& values, const PixelRect& area, double smallest_step, Smoothness smoothness,
                              Mask& mask) {
  int excluded = 0;
  for (int kind = 0; kind < 4; ++kind) {
    const auto of_kind = [&](int x, int y) { return x % 2 == kind % 2 && y % 2 == kind / 2; };
    Mask part(mask.width(), mask.height(), 0);
    for (int y = 0; y < mask.height(); ++y)
      for (int x = 0; x < mask.width(); ++x)
        if (of_kind(x, y)) part(x, y) = mask(x, y);
    excluded += exclude_outliers(values, area, smallest_step, smoothness, part);
    for (int y = 0; y < mask.height(); ++y)
      for (int x = 0; x < mask.width(); ++x)
        if (of_kind(x, y)) mask(x, y) = part(x, y);
  }
  return excluded;
}

RobustSpread robust_spread(const Image& values, const Mask& mask, const PixelRect& area) {
  std::vector<double> used;
  for (int y = area.y0; y < area.y1; ++y)
    for (int x = area.x0; x < area.x1; ++x)
      if (mask(x, y) && std::isfinite(values(x, y))) used.push_back(values(x, y));
  RobustSpread spread;
  spread.count = static_cast<int>(used.size());
  if (used.empty()) {
    spread.median = spread.sd = std::numeric_limits<double>::quiet_NaN();
    return spread;
  }
  spread.median = median(used);
  for (double& value : used) value = std::abs(value - spread.median);
  spread.sd = kNormalSdPerMad * median(std::move(used));
  return spread;
}

}  // namespace birefit
