#include "fit/weights/outliers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "core/robust.h"

namespace birefit::estimation {
namespace {

constexpr double kDeviations = 5.5;
constexpr int kTile = 32;

/// Sum over the square of 2 reach + 1 pixels around each, cut off at the edges.
Image box_sums(const Image& image, int reach) {
  const int w = image.width(), h = image.height();
  std::vector<double> table(static_cast<std::size_t>(w + 1) * static_cast<std::size_t>(h + 1), 0.0);
  const auto at = [&](int x, int y) -> double& {
    return table[static_cast<std::size_t>(y) * static_cast<std::size_t>(w + 1) + static_cast<std::size_t>(x)];
  };
  for (int y = 0; y < h; ++y) {
    double row = 0;
    for (int x = 0; x < w; ++x) {
      row += image(x, y);
      at(x + 1, y + 1) = at(x + 1, y) + row;
    }
  }
  Image sums(w, h);
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x) {
      const int left = std::max(0, x - reach), right = std::min(w, x + reach + 1), top = std::max(0, y - reach),
                bottom = std::min(h, y + reach + 1);
      sums(x, y) = at(right, bottom) - at(left, bottom) - at(right, top) + at(left, top);
    }
  return sums;
}

/// Median of |z| of the used pixels around each tile, as a standard deviation; at least 1, which is the noise.
Image local_scale(const Image& z, const Mask& used) {
  const int w = z.width(), h = z.height();
  Image scale(w, h);
  std::vector<double> values;
  for (int top = 0; top < h; top += kTile)
    for (int left = 0; left < w; left += kTile) {
      values.clear();
      for (int y = std::max(0, top - kTile / 2); y < std::min(h, top + kTile + kTile / 2); ++y)
        for (int x = std::max(0, left - kTile / 2); x < std::min(w, left + kTile + kTile / 2); ++x)
          if (used(x, y)) values.push_back(std::abs(z(x, y)));
      const double deviation = std::max(1.0, kNormalSdPerMad * median(values));
      for (int y = top; y < std::min(h, top + kTile); ++y)
        for (int x = left; x < std::min(w, left + kTile); ++x) scale(x, y) = deviation;
    }
  return scale;
}

}  // namespace

Outliers find_outliers(const Image& whitened, const Mask& used) {
  const int w = whitened.width(), h = whitened.height();
  Outliers found{Mask(w, h, 0)};
  Mask left = used;
  for (const int reach : {0, 1, 2, 4}) {
    Image value(w, h), number(w, h);
    for (int y = 0; y < h; ++y)
      for (int x = 0; x < w; ++x)
        if (left(x, y)) value(x, y) = whitened(x, y), number(x, y) = 1;
    Image z = reach > 0 ? box_sums(value, reach) : value;
    if (reach > 0) {
      const Image n = box_sums(number, reach);
      for (std::size_t i = 0; i < z.size(); ++i) z.values()[i] /= std::sqrt(std::max(1.0, n.values()[i]));
    }
    const Image scale = local_scale(z, left);
    for (int y = 0; y < h; ++y)
      for (int x = 0; x < w; ++x)
        if (left(x, y) && std::abs(z(x, y)) > kDeviations * scale(x, y)) found.pixels(x, y) = 1;
    for (std::size_t i = 0; i < left.values().size(); ++i)
      left.values()[i] = left.values()[i] && !found.pixels.values()[i];
  }
  // The foot of a spot lies below any threshold.
  const Mask core = found.pixels;
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x)
      for (int j = std::max(0, y - 1); j < std::min(h, y + 2) && used(x, y); ++j)
        for (int i = std::max(0, x - 1); i < std::min(w, x + 2); ++i)
          if (core(i, j)) found.pixels(x, y) = 1;
  Mask open = found.pixels;
  std::vector<std::array<int, 2>> group;
  std::size_t largest = 0;
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x) {
      if (!open(x, y)) continue;
      group.assign(1, {x, y});
      open(x, y) = 0;
      for (std::size_t k = 0; k < group.size(); ++k)
        for (int j = std::max(0, group[k][1] - 1); j < std::min(h, group[k][1] + 2); ++j)
          for (int i = std::max(0, group[k][0] - 1); i < std::min(w, group[k][0] + 2); ++i)
            if (open(i, j)) open(i, j) = 0, group.push_back({i, j});
      found.count += static_cast<int>(group.size());
      ++found.spots;
      if (group.size() > largest)
        largest = group.size(), found.largest_column = group[largest / 2][0], found.largest_row = group[largest / 2][1];
    }
  return found;
}

}  // namespace birefit::estimation
