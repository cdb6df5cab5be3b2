#pragma once
// Means over pixels by points: of a pixel in each lane, or of one pixel with its points in the lanes.

#include <algorithm>
#include <array>
#include <vector>

#include "samples/image.h"
#include "samples/pixels/sampling.h"

namespace birefit {

template <class P>
P load_lanes(const double* x) {
  if constexpr (std::is_same_v<P, Pack>)
    return Pack::load_unaligned(x);
  else
    return *x;
}

/// The sum over all lanes, in each of them; derivatives, too.
template <class S>
S over_lanes(S x) {
  if constexpr (ScalarTraits<S>::derivatives > 0) {
    x.value = PlainOf<S>(sum_of_lanes(x.value));
    for (auto& d : x.d) d = PlainOf<S>(sum_of_lanes(d));
    return x;
  } else {
    return S(sum_of_lanes(x));
  }
}

/// Every number of points up to 16, and those of kPointsASide.
inline bool is_tried(int n) {
  return n <= 16 || std::find(kPointsASide.begin(), kPointsASide.end(), n) != kPointsASide.end();
}
/// n Gauss points, or the next larger number that there is.
inline const PixelRule& rule_of(int n) {
  static const std::vector<PixelRule> rules = [] {
    std::vector<PixelRule> r(static_cast<std::size_t>(kMostPoints) + 1);
    for (int i = kMostPoints; i >= 1; --i)
      r[static_cast<std::size_t>(i)] = is_tried(i) ? pixel_rule(i) : r[static_cast<std::size_t>(i) + 1];
    return r;
  }();
  return rules[static_cast<std::size_t>(std::min(n, kMostPoints))];
}

/// Points of the picture with their weights in a mean. Memory is kept from one use to the next.
struct WeightedPoints {
  std::vector<double> x, y, w;
  std::size_t size = 0;
  void clear() { size = 0; }
  /// Place for so many more: where they begin.
  std::size_t more(std::size_t count) {
    const std::size_t from = size;
    size += count;
    if (size > x.size())
      for (auto* list : {&x, &y, &w}) list->resize(2 * size);
    return from;
  }
  void add(double column, double row, double weight) {
    const std::size_t at = more(1);
    x[at] = column, y[at] = row, w[at] = weight;
  }
  /// Leaves out those from `first` on that have no weight.
  void pack_from(std::size_t first) {
    std::size_t kept = first;
    for (std::size_t i = first; i < size; ++i)
      if (w[i] != 0) x[kept] = x[i], y[kept] = y[i], w[kept++] = w[i];
    size = kept;
  }
  /// To whole packs.
  void fill_up(std::size_t lanes) {
    while (size % lanes != 0) add(x[size - 1], y[size - 1], 0);
  }
};

/// The weighted sum of the light at points, counted from (column, row); their number must be a multiple of the lanes.
template <class S>
S sum_over(const SampleImage<S>& model, double column, double row, const WeightedPoints& points) {
  using P = PlainOf<S>;
  S sum(0.0), light;
  for (std::size_t i = 0; i < points.size; i += static_cast<std::size_t>(kLanesOf<S>)) {
    model.light(P(column) + load_lanes<P>(&points.x[i]), P(row) + load_lanes<P>(&points.y[i]), &light);
    sum = sum + S(load_lanes<P>(&points.w[i])) * light;
  }
  return over_lanes(sum);
}

/// Of a pixel in each lane, by n x n Gauss points.
template <class S>
S mean_over_pixels(const SampleImage<S>& model, const PlainOf<S>& column, const PlainOf<S>& row, int n) {
  const PixelRule& rule = rule_of(n);
  S sum(0.0), light;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const std::size_t a = static_cast<std::size_t>(i), b = static_cast<std::size_t>(j);
      model.light(column + PlainOf<S>(rule.x[a]), row + PlainOf<S>(rule.x[b]), &light);
      sum = sum + (rule.w[a] * rule.w[b]) * light;
    }
  return sum;
}

/// n x n Gauss points of a pixel; n = 1: the point value with the correction that render() makes. Filled up to whole
/// packs.
inline const WeightedPoints& points_of_pixel(int n) {
  static const std::vector<WeightedPoints> all = [] {
    std::vector<WeightedPoints> r(static_cast<std::size_t>(kMostPoints) + 1);
    for (const auto& [x, y] : {std::pair{0, 0}, {1, 0}, {-1, 0}, {0, 1}, {0, -1}})
      r[1].add(x, y, x == 0 && y == 0 ? 1 - 4.0 / 24 : 1.0 / 24);
    for (int n = 1; n <= kMostPoints; ++n) {
      if (!is_tried(n)) continue;
      const PixelRule& rule = rule_of(n);
      WeightedPoints& points = r[static_cast<std::size_t>(n)];
      for (std::size_t j = 0; n > 1 && j < rule.x.size(); ++j)
        for (std::size_t i = 0; i < rule.x.size(); ++i) points.add(rule.x[i], rule.x[j], rule.w[i] * rule.w[j]);
      points.fill_up(static_cast<std::size_t>(kLanes));
    }
    return r;
  }();
  return all[static_cast<std::size_t>(n)];
}

/// Of one pixel, its points side by side: neighbours, which read the same parts of tables. n as in is_tried().
template <class S>
S mean_over_one_pixel(const SampleImage<S>& model, double column, double row, int n) {
  return sum_over(model, column, row, points_of_pixel(n));
}

}  // namespace birefit
