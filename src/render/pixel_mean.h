#pragma once
// Means over single pixels, for planners: what more points would change.

#include <algorithm>
#include <vector>

#include "render/pixel_model.h"
#include "render/sampling.h"

namespace birefit {

/// By n x n Gauss points; n = 1: the point value with the correction that render() makes.
inline double pixel_mean(const PixelModel<Pack>& model, double column, double row, int n) {
  std::vector<double> c, r, w;
  if (n == 1) {
    for (const auto& [x, y] : {std::pair{0, 0}, {1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
      c.push_back(column + x);
      r.push_back(row + y);
      w.push_back(x == 0 && y == 0 ? 1 - 4.0 / 24 : 1.0 / 24);
    }
  } else {
    const PixelRule rule = pixel_rule(n);
    for (std::size_t i = 0; i < rule.x.size(); ++i)
      for (std::size_t j = 0; j < rule.x.size(); ++j) {
        c.push_back(column + rule.x[i]);
        r.push_back(row + rule.x[j]);
        w.push_back(rule.w[i] * rule.w[j]);
      }
  }
  double sum = 0;
  const std::size_t lanes = static_cast<std::size_t>(kLanes);
  for (std::size_t first = 0; first < c.size(); first += lanes) {
    alignas(64) double x[kLanes], y[kLanes];
    for (std::size_t k = 0; k < lanes; ++k) {
      x[k] = c[std::min(first + k, c.size() - 1)];
      y[k] = r[std::min(first + k, c.size() - 1)];
    }
    const Pack light = model.intensity(Pack::load_aligned(x), Pack::load_aligned(y));
    for (std::size_t k = 0; k < lanes && first + k < c.size(); ++k) sum += w[first + k] * lane(light, static_cast<int>(k));
  }
  return sum;
}

}  // namespace birefit
