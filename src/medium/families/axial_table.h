#pragma once
// A droplet's equilibrium, read at any place in the upper half: theta less axial_boundary_angle(), with slopes by
// place, field and ring.

#include <algorithm>
#include <array>
#include <type_traits>
#include <vector>

#include "medium/families/axial_equilibrium.h"

namespace birefit {

/// The angle less axial_boundary_angle(), rad, at (r, polar angle), with slopes up to kOrder (0 to 2) by place; of
/// order 1 on also by e and ring, [0] and [1], at a fixed place, and those by place with one order less. What is beyond
/// the order is left empty.
template <class P, int kOrder>
struct AxialChange {
  P value, by_r, by_polar, by_r2, by_r_polar, by_polar2;
  std::array<P, 2> by, by_r_and, by_polar_and;
};

/// The elements' polynomials, values of one element next to each other: a row of six, padded to a register, for each of
/// its six radii.
class AxialTable {
 public:
  /// `slopes`: whether read() is asked for those by e and ring; the equilibrium must have them.
  AxialTable(const AxialEquilibrium& equilibrium, bool has_ring, bool slopes)
      : elements_(equilibrium.grid.elements), planes_(slopes ? has_ring ? 3 : 2 : 1) {
    Dual<double, 2> e(equilibrium.e), ring(equilibrium.ring);
    e.d[0] = ring.d[1] = 1;
    const AxialGrid& grid = equilibrium.grid;
    for (int k = 0; k <= elements_; ++k) {
      r_edges_.push_back(axial_radius_edge(grid, k, e, ring, has_ring));
      polar_edges_.push_back(axial_polar_edge(grid, k, e, ring, has_ring));
    }
    plane_ = static_cast<std::size_t>(elements_ * elements_) * kPoints * kRow;
    values_.assign(plane_ * static_cast<std::size_t>(planes_), 0.0);
    const Eigen::MatrixXd* from[] = {&equilibrium.change, &equilibrium.by_e, &equilibrium.by_ring};
    double* to = values_.data();
    for (int plane = 0; plane < planes_; ++plane)
      for (int a = 0; a < elements_; ++a)
        for (int b = 0; b < elements_; ++b)
          for (int i = 0; i < kPoints; ++i, to += kRow)
            for (int j = 0; j < kPoints; ++j) to[j] = (*from[plane])(a * (kPoints - 1) + i, b * (kPoints - 1) + j);
  }

  /// r in [0, 1], polar angle in [0, pi/2]; P = double or Pack.
  template <class P, int kOrder>
  AxialChange<P, kOrder> read(const P& r, const P& polar) const {
    const Along<P, kOrder> of_r = along<P, kOrder>(r, r_edges_, false),
                           of_polar = along<P, kOrder>(polar, polar_edges_, true);
    constexpr int n = std::is_same_v<P, double> ? 1 : kLanes;
    // A lane's sums over an element: rows along the polar angle are added up first, weighted by the polynomials of r or
    // their slopes.
    alignas(64) double block[n], of_r_lanes[kOrder + 1][kPoints][n], of_polar_lanes[n][kOrder + 1][kRow] = {};
    put(P((of_r.element * P(elements_) + of_polar.element) * P(kPoints * kRow)), block);
    for (int order = 0; order <= kOrder; ++order)
      for (int i = 0; i < kPoints; ++i) {
        alignas(64) double lanes[n];
        put(of_r.polynomial[order][i], of_r_lanes[order][i]);
        put(of_polar.polynomial[order][i], lanes);
        for (int k = 0; k < n; ++k) of_polar_lanes[k][order][i] = lanes[k];
      }
    // sum[plane][a][b]: with slopes of order a by r's coordinate and b by the polar angle's.
    alignas(64) double sum[3][kOrder + 1][kOrder + 1][n] = {};
    const auto add = [&]<int kMost>(int plane, int k) {
      const double* row =
          values_.data() + static_cast<std::size_t>(plane) * plane_ + static_cast<std::size_t>(block[k]);
      Pack along_polar[kMost + 1][kChunks];
      for (int a = 0; a <= kMost; ++a)
        for (int c = 0; c < kChunks; ++c)
          along_polar[a][c] = Pack(of_r_lanes[a][0][k]) * Pack::load_aligned(row + c * kLanes);
      for (int i = 1; i < kPoints; ++i)
        for (int c = 0; c < kChunks; ++c) {
          const Pack values = Pack::load_aligned(row + i * kRow + c * kLanes);
          for (int a = 0; a <= kMost; ++a) along_polar[a][c] = along_polar[a][c] + Pack(of_r_lanes[a][i][k]) * values;
        }
      for (int a = 0; a <= kMost; ++a)
        for (int b = 0; a + b <= kMost; ++b) {
          Pack products = along_polar[a][0] * Pack::load_aligned(of_polar_lanes[k][b]);
          for (int c = 1; c < kChunks; ++c)
            products = products + along_polar[a][c] * Pack::load_aligned(of_polar_lanes[k][b] + c * kLanes);
          sum[plane][a][b][k] = sum_of_lanes(products);
        }
    };
    for (int k = 0; k < n; ++k) {
      add.template operator()<kOrder>(0, k);
      if constexpr (kOrder > 0)
        for (int plane = 1; plane < planes_; ++plane) add.template operator()<kOrder - 1>(plane, k);
    }
    const auto of = [&](int plane, int a, int b) { return get<P>(sum[plane][a][b]); };
    AxialChange<P, kOrder> out;
    out.value = of(0, 0, 0);
    if constexpr (kOrder > 0) {
      const P a = of_r.scale, b = of_polar.scale;
      out.by_r = a * of(0, 1, 0), out.by_polar = b * of(0, 0, 1);
      if constexpr (kOrder > 1)
        out.by_r2 = a * a * of(0, 2, 0), out.by_r_polar = a * b * of(0, 1, 1), out.by_polar2 = b * b * of(0, 0, 2);
      for (std::size_t q = 0; q < 2; ++q) {
        const int plane = static_cast<int>(q) + 1;
        out.by[q] = out.by_r_and[q] = out.by_polar_and[q] = P(0.0);
        if (plane >= planes_) continue;
        // The element moves with e and ring.
        const P moves_r = of_r.moves[q], moves_polar = of_polar.moves[q];
        out.by[q] = of(plane, 0, 0) + out.by_r * moves_r + out.by_polar * moves_polar;
        if constexpr (kOrder > 1) {
          out.by_r_and[q] =
              a * of(plane, 1, 0) + out.by_r2 * moves_r + out.by_r_polar * moves_polar - out.by_r * of_r.wider[q];
          out.by_polar_and[q] = b * of(plane, 0, 1) + out.by_r_polar * moves_r + out.by_polar2 * moves_polar -
                                out.by_polar * of_polar.wider[q];
        }
      }
    }
    return out;
  }

 private:
  static constexpr int kPoints = 6, kRow = 8, kChunks = kRow / kLanes;
  static_assert(kRow % kLanes == 0);
  static void put(double x, double* out) { out[0] = x; }
  static void put(const Pack& x, double* out) { x.store_aligned(out); }
  template <class P>
  static P get(const double* from) {
    if constexpr (std::is_same_v<P, double>)
      return from[0];
    else
      return Pack::load_aligned(from);
  }

  /// Where a place lies along one coordinate, and the six polynomials of its element with their slopes by the element's
  /// own coordinate.
  template <class P, int kOrder>
  struct Along {
    P element, scale;  ///< number from 0; slope of its coordinate by the place
    P polynomial[kOrder + 1][kPoints];
    /// by e and ring: of the coordinate at a fixed place, in units of the place, and of the element's width, relative
    std::array<P, 2> moves, wider;
  };
  template <class P, int kOrder>
  static Along<P, kOrder> along(const P& place, const std::vector<Dual<double, 2>>& edges, bool falling) {
    using Edge = Dual<P, 2>;
    const auto edge = [&](std::size_t k) {
      Edge x;
      x.value = P(edges[k].value), x.d[0] = P(edges[k].d[0]), x.d[1] = P(edges[k].d[1]);
      return x;
    };
    Edge from = edge(0), to = edge(1);
    Along<P, kOrder> out;
    out.element = P(0.0);
    for (std::size_t k = 1; k + 1 < edges.size(); ++k) {
      const auto beyond = falling ? place < P(edges[k].value) : place > P(edges[k].value);
      if (none(beyond)) break;
      const Edge here = edge(k), next = edge(k + 1);
      from.value = select(beyond, here.value, from.value), to.value = select(beyond, next.value, to.value);
      if constexpr (kOrder > 0)
        for (std::size_t q = 0; q < 2; ++q)
          from.d[q] = select(beyond, here.d[q], from.d[q]), to.d[q] = select(beyond, next.d[q], to.d[q]);
      out.element = select(beyond, P(static_cast<double>(k)), out.element);
    }
    const P over_width = inverse(P(to.value - from.value)), away = place - from.value;
    out.scale = P(2.0) * over_width;
    if constexpr (kOrder > 0)
      for (std::size_t q = 0; q < 2; ++q) {
        out.wider[q] = (to.d[q] - from.d[q]) * over_width;
        out.moves[q] = P(0.0) - (from.d[q] + away * out.wider[q]);
      }
    // Products of (x - x_m) over all m but one, with their slopes: no division by what may vanish.
    static const LobattoRule& rule = lobatto_rule(kPoints - 1);
    static const std::array<double, kPoints> scales = [] {
      std::array<double, kPoints> result;
      for (std::size_t i = 0; i < kPoints; ++i) {
        result[i] = 1;
        for (std::size_t m = 0; m < kPoints; ++m)
          if (m != i) result[i] /= rule.x[i] - rule.x[m];
      }
      return result;
    }();
    P factor[kPoints];
    for (std::size_t m = 0; m < kPoints; ++m) factor[m] = away * out.scale - P(1.0 + rule.x[m]);
    for (std::size_t i = 0; i < kPoints; ++i) {
      P p[kOrder + 1];
      p[0] = P(scales[i]);
      for (int order = 1; order <= kOrder; ++order) p[order] = P(0.0);
      for (std::size_t m = 0; m < kPoints; ++m) {
        if (m == i) continue;
        for (int order = kOrder; order > 0; --order)
          p[order] = p[order] * factor[m] + P(static_cast<double>(order)) * p[order - 1];
        p[0] = p[0] * factor[m];
      }
      for (int order = 0; order <= kOrder; ++order) out.polynomial[order][i] = p[order];
    }
    return out;
  }

  int elements_, planes_;
  std::vector<Dual<double, 2>> r_edges_, polar_edges_;  ///< with slopes by e and ring
  std::size_t plane_ = 0;
  /// [plane: value, by e, by ring][element of r][of polar angle][radius][kRow]
  std::vector<double, xsimd::aligned_allocator<double, 64>> values_;
};

}  // namespace birefit
