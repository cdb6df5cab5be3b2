#pragma once
// Pixels at a line along which light has a slope without bound on one side (PixelModel::has_edge): no number of points spread evenly gives their
// mean soon, as light there goes like the root of the distance from the line. Lines of points across it, divided where they cross it, do.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "render/pixel_model.h"
#include "render/sampling.h"

namespace birefit {

/// Added to a pixel's number of samples a side: the line passes through it or one beside it.
inline constexpr std::uint8_t kEdgePixel = 16;

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

/// beyond_edge() is positive at so many of the nine pixels about one.
template <class S>
int beyond_edge_about(const PixelModel<S>& model, double column, double row) {
  using P = PlainOf<S>;
  constexpr int kStep = kLanesOf<S>;
  int count = 0;
  for (int first = 0; first < 9; first += kStep) {
    alignas(64) std::array<double, kLanes> x, y;
    for (int k = 0; k < kStep; ++k) x[static_cast<std::size_t>(k)] = column + (first + k) % 3 - 1.0, y[static_cast<std::size_t>(k)] = row + std::min(first + k, 8) / 3 - 1.0;
    P beyond;
    if constexpr (kStep == 1)
      beyond = model.beyond_edge(x[0], y[0]);
    else
      beyond = model.beyond_edge(Pack::load_aligned(x.data()), Pack::load_aligned(y.data()));
    for (int k = 0; k < std::min(kStep, 9 - first); ++k) count += lane(beyond, k) > 0;
  }
  return count;
}
template <class S>
bool is_edge_pixel(const PixelModel<S>& model, double column, double row) {
  const int beyond = beyond_edge_about(model, column, row);
  return beyond > 0 && beyond < 9;
}

/// Finds the edge pixels of rows of a picture.
class EdgeMarks {
 public:
  /// Looks at `rows` rows from first_row on and `columns` columns from first_column on, and one more on all sides.
  template <class S>
  void look(const PixelModel<S>& model, int first_row, int rows, int first_column, int columns) {
    constexpr int kStep = kLanesOf<S>;
    columns_ = columns;
    wide_ = static_cast<std::size_t>(columns) + 2;
    beyond_.assign(wide_ * (static_cast<std::size_t>(rows) + 2), 0);
    alignas(64) std::array<double, kLanes> along{};
    for (int r = 0; r < rows + 2; ++r)
      for (int c = 0; c < columns + 2; c += kStep) {
        for (int k = 0; k < kStep; ++k) along[static_cast<std::size_t>(k)] = first_column - 1.0 + c + k;
        PlainOf<S> at;
        if constexpr (kStep == 1)
          at = along[0];
        else
          at = Pack::load_aligned(along.data());
        const PlainOf<S> beyond = model.beyond_edge(at, PlainOf<S>(first_row - 1.0 + r));
        for (int k = 0; k < std::min(kStep, columns + 2 - c); ++k) beyond_[static_cast<std::size_t>(r) * wide_ + static_cast<std::size_t>(c + k)] = lane(beyond, k) > 0;
      }
  }
  /// Adds kEdgePixel where it is due in the row-th of the rows.
  void mark(int row, std::uint8_t* samples) const {
    const std::uint8_t* at = beyond_.data() + static_cast<std::size_t>(row) * wide_;
    const auto column = [&](std::size_t c) { return at[c] + at[wide_ + c] + at[2 * wide_ + c]; };
    int left = column(0), here = column(1);
    for (std::size_t c = 0; c < static_cast<std::size_t>(columns_); ++c) {
      const int right = column(c + 2), all = left + here + right;
      if (all > 0 && all < 9) samples[c] |= kEdgePixel;
      left = here, here = right;
    }
  }

 private:
  int columns_ = 0;
  std::size_t wide_ = 0;
  std::vector<std::uint8_t> beyond_;
};

/// Mean over the pixel about (column, row): Gauss lines across the edge, each with Gauss points on either side of it. Beyond it, at a distance
/// u, light and its derivatives are smooth functions of sqrt u (times 1/sqrt u, for the latter), of which the points are Gauss's. Light is continuous
/// at the edge, so that no derivative needs to know how the edge moves. Of a core no larger than a pixel or two, which a line meets twice, the mean is
/// no better than that of as many points.
template <class S, std::size_t kLines, std::size_t kNodes>
S mean_over_edge_pixel(const PixelModel<S>& model, double column, double row) {
  using P = PlainOf<S>;
  constexpr std::size_t kStep = static_cast<std::size_t>(kLanesOf<S>);
  static const PixelRule lines = pixel_rule(static_cast<int>(kLines)), nodes = pixel_rule(static_cast<int>(kNodes));
  const auto at = [](const std::array<double, kLanes>& x) {
    if constexpr (kStep == 1)
      return x[0];
    else
      return Pack::load_aligned(x.data());
  };
  const bool across_x = [&] {
    std::array<double, 4> beyond;
    for (std::size_t first = 0; first < 4; first += kStep) {
      alignas(64) std::array<double, kLanes> right{}, down{};
      for (std::size_t k = 0; k < std::min(kStep, 4 - first); ++k) (first + k < 2 ? right : down)[k] = (first + k) % 2 == 0 ? 0.5 : -0.5;
      const P f = model.beyond_edge(P(column) + at(right), P(row) + at(down));
      for (std::size_t k = 0; k < std::min(kStep, 4 - first); ++k) beyond[first + k] = lane(f, static_cast<int>(k));
    }
    return std::abs(beyond[0] - beyond[1]) >= std::abs(beyond[2] - beyond[3]);
  }();

  constexpr std::size_t kMost = (2 * kLines * kNodes + kLanes - 1) / kLanes * kLanes;
  alignas(64) std::array<double, kMost> x, y, w;
  std::size_t count = 0;
  const auto add = [&](double along, double beside, double weight) {
    x[count] = column + (across_x ? along : beside), y[count] = row + (across_x ? beside : along), w[count++] = weight;
  };
  for (std::size_t first = 0; first < kLines; first += kStep) {
    alignas(64) std::array<double, kLanes> beside{};
    for (std::size_t k = 0; k < kStep; ++k) beside[k] = lines.x[std::min(first + k, kLines - 1)];
    const P q = at(beside);
    const auto beyond = [&](const P& s) { return across_x ? model.beyond_edge(P(column) + s, P(row) + q) : model.beyond_edge(P(column) + q, P(row) + s); };
    // The secant method, a pixel beyond the pixel's ends at most.
    constexpr double kFar = 1.5;
    constexpr int kSteps = 5;
    constexpr double kNothing = 1e-6;  // within rounding of the edge a slope may be anything
    P a(-0.5), b(0.5), fa = beyond(a), fb = beyond(b);
    const P rising = fb - fa;
    for (int i = 0; i < kSteps; ++i) {
      const P slope = fb - fa, safe = select(slope * slope < P(1e-24), P(1e-12), slope);
      const P next = min_of(max_of(P(b - fb * (b - a) * inverse(safe)), P(-kFar)), P(kFar));
      a = b, fa = fb, b = next, fb = beyond(next);
    }
    for (std::size_t k = 0; k < std::min(kStep, kLines - first); ++k) {
      const double place = lane(b, static_cast<int>(k)), sign = lane(rising, static_cast<int>(k)) >= 0 ? 1 : -1, edge = std::isfinite(place) ? place : sign * kFar;
      // u = sign (s - edge) from `low` to `high` within the pixel.
      const double low = -0.5 - sign * edge, high = 0.5 - sign * edge, line = lines.w[first + k];
      if (const double from = std::sqrt(std::max(0.0, low)), length = high > 0 ? std::sqrt(high) - from : 0; length > kNothing)
        for (std::size_t n = 0; n < kNodes; ++n) {
          const double t = from + length * (0.5 + nodes.x[n]);
          add(edge + sign * t * t, beside[k], line * nodes.w[n] * length * 2 * t);
        }
      if (const double length = std::min(0.0, high) - low; length > kNothing)
        for (std::size_t n = 0; n < kNodes; ++n) add(edge + sign * (low + length * (0.5 + nodes.x[n])), beside[k], line * nodes.w[n] * length);
    }
  }
  while (count % kStep != 0) x[count] = x[count - 1], y[count] = y[count - 1], w[count++] = 0;

  S sum(0.0);
  for (std::size_t i = 0; i < count; i += kStep) {
    if constexpr (kStep == 1)
      sum = sum + w[i] * model.intensity(x[i], y[i]);
    else
      sum = sum + S(Pack::load_aligned(&w[i])) * model.intensity(Pack::load_aligned(&x[i]), Pack::load_aligned(&y[i]));
  }
  return over_lanes(sum);
}

/// `samples`: as many a side as the light beside the edge needs.
template <class S>
S mean_over_edge_pixel(const PixelModel<S>& model, double column, double row, int samples) {
  return samples <= 3 ? mean_over_edge_pixel<S, 4, 4>(model, column, row) : mean_over_edge_pixel<S, 6, 8>(model, column, row);
}

}  // namespace birefit
