#pragma once
// A droplet's equilibrium, read at any place in the upper half: theta less axial_boundary_angle(), with slopes by
// place, field and ring.

#include <algorithm>
#include <array>
#include <cmath>
#include <type_traits>
#include <vector>

#include <Eigen/LU>

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

/// The elements' polynomials by powers of their own coordinates, -1 to 1: those of an element next to each other.
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
    const Eigen::MatrixXd* from[] = {&equilibrium.change, &equilibrium.by_e, &equilibrium.by_ring};
    const Powers to_powers = powers_of_values();
    for (int plane = 0; plane < planes_; ++plane)
      for (int a = 0; a < elements_; ++a)
        for (int b = 0; b < elements_; ++b) {
          const Powers values = from[plane]->block<kPoints, kPoints>(a * (kPoints - 1), b * (kPoints - 1)),
                       of_polar_by_r = to_powers * values.transpose() * to_powers.transpose();  // column-major
          coefficients_.insert(coefficients_.end(), of_polar_by_r.data(), of_polar_by_r.data() + kBlock);
        }
  }

  /// r in [0, 1], polar angle in [0, pi/2]; P = double or Pack.
  template <class P, int kOrder>
  AxialChange<P, kOrder> read(const P& r, const P& polar) const {
    const Along<P> of_r = along(r, r_edges_, false), of_polar = along(polar, polar_edges_, true);
    Sums<P, kOrder> sum;
    [[maybe_unused]] std::array<Sums<P, std::max(kOrder - 1, 0)>, 2> moving;
    const std::size_t plane = coefficients_.size() / static_cast<std::size_t>(planes_);
    const auto read_element = [&](double element, const auto& take) {
      const double* from = coefficients_.data() + static_cast<std::size_t>(element) * kBlock;
      take(sums_of<kOrder>(from, of_r.x, of_polar.x), sum);
      if constexpr (kOrder > 0)
        for (std::size_t q = 1; q < static_cast<std::size_t>(planes_); ++q)
          take(sums_of<kOrder - 1>(from + q * plane, of_r.x, of_polar.x), moving[q - 1]);
    };
    const P element = of_r.element * P(elements_) + of_polar.element;
    if constexpr (std::is_same_v<P, double>) {
      read_element(element, [](const auto& here, auto& out) { out = here; });
    } else {
      // Rays of one register mostly run side by side: an element is read for all of them at once.
      for (int k = 0; k < kLanes; ++k) {
        const double own = lane(element, k);
        bool seen = false;
        for (int other = 0; other < k && !seen; ++other) seen = lane(element, other) == own;
        if (seen) continue;
        const auto within = element == P(own);
        read_element(own, [&](const auto& here, auto& out) {
          for (std::size_t i = 0; i < out.size(); ++i) out[i] = k == 0 ? here[i] : select(within, here[i], out[i]);
        });
        if (k == 0 && all(within)) break;
      }
    }
    AxialChange<P, kOrder> out;
    out.value = sum[0];
    if constexpr (kOrder > 0) {
      const P a = of_r.scale, b = of_polar.scale;
      out.by_r = a * sum[1], out.by_polar = b * sum[2];
      if constexpr (kOrder > 1)
        out.by_r2 = a * a * sum[3], out.by_r_polar = a * b * sum[4], out.by_polar2 = b * b * sum[5];
      for (std::size_t q = 0; q < 2; ++q) {
        out.by[q] = out.by_r_and[q] = out.by_polar_and[q] = P(0.0);
        if (static_cast<int>(q) + 1 >= planes_) continue;
        // The element moves with e and ring.
        const P moves_r = of_r.moves[q], moves_polar = of_polar.moves[q];
        out.by[q] = moving[q][0] + out.by_r * moves_r + out.by_polar * moves_polar;
        if constexpr (kOrder > 1) {
          out.by_r_and[q] =
              a * moving[q][1] + out.by_r2 * moves_r + out.by_r_polar * moves_polar - out.by_r * of_r.wider[q];
          out.by_polar_and[q] = b * moving[q][2] + out.by_r_polar * moves_r + out.by_polar2 * moves_polar -
                                out.by_polar * of_polar.wider[q];
        }
      }
    }
    return out;
  }

 private:
  static constexpr int kPoints = 6, kBlock = kPoints * kPoints;
  using Powers = Eigen::Matrix<double, kPoints, kPoints>;
  /// Value; slopes by the coordinates x of r and y of the polar angle; by x twice, by both, by y twice.
  template <class P, int kOrder>
  using Sums = std::array<P, kOrder == 0   ? 1
                             : kOrder == 1 ? 3
                                           : 6>;

  /// Coefficients of x^row of the polynomial that is 1 at Lobatto's point `column` and 0 at the others.
  static Powers powers_of_values() {
    const LobattoRule& rule = lobatto_rule(kPoints - 1);
    Powers at_points;
    for (int i = 0; i < kPoints; ++i)
      for (int power = 0; power < kPoints; ++power)
        at_points(i, power) = std::pow(rule.x[static_cast<std::size_t>(i)], power);
    return at_points.inverse();
  }

  /// Horner's rule with its slopes, in y for every power of x and then in x.
  template <int kOrder, class P>
  static Sums<P, kOrder> sums_of(const double* coefficients, const P& x, const P& y) {
    Sums<P, kOrder> out;
    out.fill(P(0.0));
    for (int i = kPoints - 1; i >= 0; --i) {
      const double* c = coefficients + i * kPoints;
      P value(c[kPoints - 1]), slope(0.0), bend(0.0);
      for (int j = kPoints - 2; j >= 0; --j) {
        if constexpr (kOrder > 1) bend = bend * y + slope;
        if constexpr (kOrder > 0) slope = slope * y + value;
        value = value * y + P(c[j]);
      }
      if constexpr (kOrder > 1) {
        out[3] = out[3] * x + out[1];
        out[4] = out[4] * x + out[2];
        out[5] = out[5] * x + bend;
      }
      if constexpr (kOrder > 0) {
        out[1] = out[1] * x + out[0];
        out[2] = out[2] * x + slope;
      }
      out[0] = out[0] * x + value;
    }
    if constexpr (kOrder > 1) out[3] = P(2.0) * out[3], out[5] = P(2.0) * out[5];
    return out;
  }

  /// Where a place lies along one coordinate.
  template <class P>
  struct Along {
    P element, x, scale;  ///< number from 0; the element's own coordinate, -1 to 1, and its slope by the place
    /// by e and ring: of the coordinate at a fixed place, in units of the place, and of the element's width, relative
    std::array<P, 2> moves, wider;
  };
  template <class P>
  Along<P> along(const P& place, const std::vector<Dual<double, 2>>& edges, bool falling) const {
    const std::size_t moving = planes_ > 1 ? 2 : 0;
    P from(edges[0].value), to(edges[1].value);
    std::array<P, 2> from_by, to_by;
    for (std::size_t q = 0; q < moving; ++q) from_by[q] = P(edges[0].d[q]), to_by[q] = P(edges[1].d[q]);
    Along<P> out;
    out.element = P(0.0);
    for (std::size_t k = 1; k + 1 < edges.size(); ++k) {
      const auto beyond = falling ? place < P(edges[k].value) : place > P(edges[k].value);
      if (none(beyond)) break;
      from = select(beyond, P(edges[k].value), from), to = select(beyond, P(edges[k + 1].value), to);
      for (std::size_t q = 0; q < moving; ++q) {
        from_by[q] = select(beyond, P(edges[k].d[q]), from_by[q]);
        to_by[q] = select(beyond, P(edges[k + 1].d[q]), to_by[q]);
      }
      out.element = select(beyond, P(static_cast<double>(k)), out.element);
    }
    const P over_width = inverse(P(to - from)), away = place - from;
    out.scale = P(2.0) * over_width;
    out.x = away * out.scale - P(1.0);
    for (std::size_t q = 0; q < moving; ++q) {
      out.wider[q] = (to_by[q] - from_by[q]) * over_width;
      out.moves[q] = P(0.0) - (from_by[q] + away * out.wider[q]);
    }
    return out;
  }

  int elements_, planes_;
  std::vector<Dual<double, 2>> r_edges_, polar_edges_;  ///< with slopes by e and ring
  /// [plane: value, by e, by ring][element of r][of polar angle][power of x][power of y]
  std::vector<double> coefficients_;
};

}  // namespace birefit
