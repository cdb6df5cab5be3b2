#include "core/cut_end.h"

#include <cmath>
#include <iterator>
#include <map>
#include <utility>
#include <vector>

#include "core/robust.h"

namespace birefit {

std::optional<double> noise_of_neighbours(const Image& values, const PixelRect& area,
                                          std::optional<double> without_code) {
  std::vector<double> off;
  const auto counts = [&](double value) { return std::isfinite(value) && value != without_code; };
  for (int y = area.y0; y < area.y1; ++y)
    for (int x = area.x0 + 1; x + 1 < area.x1; ++x) {
      const double left = values(x - 1, y), value = values(x, y), right = values(x + 1, y);
      if (counts(left) && counts(value) && counts(right)) off.push_back(std::abs(value - 0.5 * (left + right)));
    }
  if (off.empty()) return std::nullopt;
  return kNormalSdPerMad * median(std::move(off)) / std::sqrt(1.5);
}

std::optional<CutEnd> find_cut_end(End end, const Image& values, const PixelRect& area,
                                   std::optional<double> noise_sd) {
  constexpr double kShare = 0.005, kOverNext = 3, kNoise = 0.7;  // half a code, and rounding by the same measure
  constexpr int kFewest = 4;                                     // of a small picture one pixel is a share, and no pile
  constexpr double kNoiseElsewhere = 2;  // an even picture of many frames may have one code by right
  std::map<double, int> pixels;
  int all = 0;
  for (int y = area.y0; y < area.y1; ++y)
    for (int x = area.x0; x < area.x1; ++x)
      if (const double value = values(x, y); std::isfinite(value)) ++pixels[value], ++all;
  if (all == 0) return std::nullopt;
  // Codes are as far apart as neighbours are at the median: single values lie between.
  std::vector<double> steps;
  for (auto above = std::next(pixels.begin()); above != pixels.end(); ++above)
    steps.push_back(above->first - std::prev(above)->first);
  const double step = steps.empty() ? 1 : median(std::move(steps));
  const auto [code, here] = end == End::lowest ? *pixels.begin() : *pixels.rbegin();
  int next = 0;
  for (const auto& [value, count] : pixels)
    if (const double off = std::abs(value - code); off > 0 && off < 1.5 * step) next += count;
  if (here < kFewest || !(here > kShare * all) || here < kOverNext * next) return std::nullopt;
  const std::optional<double> own = noise_of_neighbours(values, area, code), noise = own ? own : noise_sd;
  if (!noise || !(*noise > (own ? kNoise : kNoiseElsewhere) * step)) return std::nullopt;
  return CutEnd{code, static_cast<double>(here) / all};
}

}  // namespace birefit
