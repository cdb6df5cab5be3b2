#include "fit/search/centre.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace birefit::estimation {

std::optional<std::array<double, 2>> centre_of_symmetry(const Image& values, const Mask& used) {
  // Means over blocks: 64^4 / 4 products are a few milliseconds, and a parabola finds the place between them.
  constexpr int kMostBlocks = 64;
  const int block = (std::max(values.width(), values.height()) + kMostBlocks - 1) / kMostBlocks;
  const int w = values.width() / block, h = values.height() / block;
  if (w < 3 || h < 3) return std::nullopt;
  std::vector<double> mean(static_cast<std::size_t>(w * h)), border, all;
  std::vector<double> known(mean.size());  // 1 or 0
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x) {
      double sum = 0;
      int count = 0;
      for (int j = y * block; j < (y + 1) * block; ++j)
        for (int i = x * block; i < (x + 1) * block; ++i)
          if (used(i, j) && std::isfinite(values(i, j))) sum += values(i, j), ++count;
      const std::size_t at = static_cast<std::size_t>(y * w + x);
      if (count == 0) continue;
      known[at] = 1, mean[at] = sum / count;
      all.push_back(mean[at]);
      if (x == 0 || y == 0 || x == w - 1 || y == h - 1) border.push_back(mean[at]);
    }
  if (all.empty()) return std::nullopt;
  // A region within the sample has no background: its blocks are compared where both of a pair are known, else the
  // region's own middle would be found.
  const bool within = border.empty();
  std::vector<double>& of_background = within ? all : border;
  const auto middle = of_background.begin() + static_cast<std::ptrdiff_t>(of_background.size() / 2);
  const double enough = 0.5 * static_cast<double>(all.size());
  std::nth_element(of_background.begin(), middle, of_background.end());
  const double background = *middle;
  for (std::size_t i = 0; i < mean.size(); ++i) mean[i] = known[i] * (mean[i] - background);
  // s = 2c in blocks.
  const auto likeness = [&](int sx, int sy) {
    double product = 0, squares = 0, pairs = 0;
    const int left = std::max(0, sx - w + 1), right = std::min(w - 1, sx), top = std::max(0, sy - h + 1),
              bottom = std::min(h - 1, sy);
    for (int y = top; y <= bottom; ++y) {
      const double *a = mean.data() + y * w, *b = mean.data() + (sy - y) * w + sx;
      if (!within) {
        for (int x = left; x <= right; ++x) product += a[x] * b[-x];
        continue;
      }
      const double *a_known = known.data() + y * w, *b_known = known.data() + (sy - y) * w + sx;
      for (int x = left; x <= right; ++x) {
        product += a[x] * b[-x];
        squares += a[x] * a[x] * b_known[-x];  // and as much of the others: every pair is met twice
        pairs += a_known[x] * b_known[-x];
      }
    }
    if (!within) return product;
    return pairs >= enough && squares > 0 ? product / squares : 0;
  };
  int best_x = 0, best_y = 0;
  double best = 0;
  for (int sy = 0; sy <= 2 * (h - 1); ++sy)
    for (int sx = 0; sx <= 2 * (w - 1); ++sx)
      if (const double here = likeness(sx, sy); here > best) best = here, best_x = sx, best_y = sy;
  if (!(best > 0)) return std::nullopt;
  const auto between = [&](double before, double after) {
    const double curvature = 2 * best - before - after;
    return curvature > 0 ? std::clamp(0.5 * (after - before) / curvature, -0.5, 0.5) : 0.0;
  };
  const double sx = best_x + between(likeness(best_x - 1, best_y), likeness(best_x + 1, best_y));
  const double sy = best_y + between(likeness(best_x, best_y - 1), likeness(best_x, best_y + 1));
  // The middle of block k is pixel (k + 1/2) block - 1/2.
  return std::array<double, 2>{(0.5 * sx + 0.5) * block - 0.5, (0.5 * sy + 0.5) * block - 0.5};
}

}  // namespace birefit::estimation
