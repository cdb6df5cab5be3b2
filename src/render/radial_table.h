#pragma once
// Smooth functions of one coordinate, tabulated once and read at every pixel. A sample that is symmetric about the
// viewing axis needs one ray for every radius, not one for every pixel.

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "core/scalar.h"
#include "render/chebyshev.h"
#include "render/pixel_model.h"

namespace birefit {

/// `functions` functions of v in [0, 1], each a polynomial of degree 11 on every one of `panels` equal panels, through
/// the panel's 12 Chebyshev points (none at an end, so ends may be singular points of the functions). Derivatives by
/// parameters are tabulated beside the values and those by v come from the polynomial: together they are the exact
/// derivative of what is read.
template <class S>
class RadialTable {
 public:
  static constexpr int kPoints = 12;
  using P = PlainOf<S>;

  RadialTable() = default;
  /// evaluate(v, out): the functions at v (one a lane), out has `functions` places.
  template <class Evaluate>
  RadialTable(int panels, int functions, const Evaluate& evaluate)
      : panels_(panels), functions_(functions), stride_(static_cast<std::size_t>(panels) * functions * kPoints) {
    const ChebyshevRule<kPoints>& rule = chebyshev_rule<kPoints>();
    const int n = panels * kPoints;
    std::vector<double> values(stride_ * kPlanes);  // [plane][panel][function][point]
    std::vector<S> out(static_cast<std::size_t>(functions));
    constexpr int kStep = kLanesOf<S>;
    for (int first = 0; first < n; first += kStep) {
      alignas(64) double v[kLanes];
      for (int k = 0; k < kStep; ++k) {
        const int i = std::min(first + k, n - 1);
        v[k] = (i / kPoints + 0.5 + 0.5 * rule.x[static_cast<std::size_t>(i % kPoints)]) / panels;
      }
      if constexpr (kStep == 1)
        evaluate(v[0], out.data());
      else
        evaluate(Pack::load_aligned(v), out.data());
      for (int k = 0; k < std::min(kStep, n - first); ++k) {
        const int i = first + k;
        for (int f = 0; f < functions; ++f) {
          const std::size_t at = index(i / kPoints, f) + static_cast<std::size_t>(i % kPoints);
          const S& value = out[static_cast<std::size_t>(f)];
          values[at] = lane(plain(value), k);
          if constexpr (kPlanes > 1)
            for (std::size_t j = 0; j + 1 < kPlanes; ++j) values[(j + 1) * stride_ + at] = lane(value.d[j], k);
        }
      }
    }
    coefficients_.assign(values.size(), 0.0);
    for (std::size_t plane = 0; plane < kPlanes; ++plane)
      for (std::size_t block = plane * stride_; block < (plane + 1) * stride_; block += kPoints)
        for (std::size_t c = 0; c < kPoints; ++c) {
          double sum = 0;
          for (std::size_t k = 0; k < kPoints; ++k) sum += rule.to_powers[c][k] * values[block + k];
          coefficients_[block + c] = sum;
        }
    // Rounding leaves 1e-17 of what vanishes (crossed polarizers, parameters that do not matter).
    for (std::size_t plane = 0; plane < kPlanes; ++plane) {
      std::vector<double> size(static_cast<std::size_t>(functions), 0.0);
      for (int panel = 0; panel < panels; ++panel)
        for (int f = 0; f < functions; ++f)
          for (std::size_t c = 0; c < kPoints; ++c) {
            double& largest_yet = size[static_cast<std::size_t>(f)];
            largest_yet = std::max(largest_yet, std::abs(coefficients_[plane * stride_ + index(panel, f) + c]));
          }
      const double all = *std::max_element(size.begin(), size.end());
      int live = 0;
      for (int f = 0; f < functions; ++f)
        if (size[static_cast<std::size_t>(f)] > 1e-15 * all) live = f + 1;
      if (plane == 0)
        live_ = live;
      else if (live > 0)
        (live <= 1 ? of_one_ : live <= 3 ? of_three_ : of_all_).add(static_cast<int>(plane) - 1);
    }
  }

  /// sum_k basis[k] f_k(v) over the F functions that were tabulated, with its derivatives at fixed basis; with `turned`
  /// also sum_k turned[k] f_k(v), the value alone, in *turned_sum. v outside [0, 1] is extrapolated from the end panels.
  /// Functions after the last one that is not negligible are left out.
  template <int F>
  BIREFIT_INLINE S sum(const S& v, const P* basis, const P* turned = nullptr, P* turned_sum = nullptr) const {
    if (F > 1 && live_ <= 1) return sum_of_live<1, F>(v, basis, turned, turned_sum);
    if (F > 3 && live_ <= 3) return sum_of_live<3, F>(v, basis, turned, turned_sum);
    return sum_of_live<F, F>(v, basis, turned, turned_sum);
  }

 private:
  static constexpr std::size_t kPlanes = 1 + static_cast<std::size_t>(ScalarTraits<S>::derivatives);
  struct Planes {
    std::array<int, kPlanes> list{};
    int count = 0;
    void add(int j) { list[static_cast<std::size_t>(count++)] = j; }
  };
  std::size_t index(int panel, int function) const {
    return (static_cast<std::size_t>(panel) * static_cast<std::size_t>(functions_) + static_cast<std::size_t>(function)) * kPoints;
  }
  static bool same(double a, double b) { return a == b; }
  static bool same(const Pack& a, const Pack& b) { return xsimd::all(a == b); }
  /// L polynomials at x and their slopes: chains of multiply-adds side by side, and where those are too few to hide
  /// their latency, even and odd powers apart.
  template <int L, bool kSlope>
  BIREFIT_INLINE static void horner(const double* c, const P& x, P* value, P* slope) {
    if constexpr (L <= 3) {
      static_assert(kPoints % 2 == 0);
      const P square = x * x;
      P odd[L], odd_slope[L];
      for (int f = 0; f < L; ++f) {
        value[f] = P(c[f * kPoints + kPoints - 2]);
        odd[f] = P(c[f * kPoints + kPoints - 1]);
        if constexpr (kSlope) slope[f] = odd_slope[f] = P(0.0);
      }
      for (int k = kPoints - 4; k >= 0; k -= 2)
        for (int f = 0; f < L; ++f) {
          if constexpr (kSlope) {
            slope[f] = slope[f] * square + value[f];
            odd_slope[f] = odd_slope[f] * square + odd[f];
          }
          value[f] = value[f] * square + P(c[f * kPoints + k]);
          odd[f] = odd[f] * square + P(c[f * kPoints + k + 1]);
        }
      for (int f = 0; f < L; ++f) {
        if constexpr (kSlope) slope[f] = (odd_slope[f] * x + slope[f]) * (x + x) + odd[f];
        value[f] = odd[f] * x + value[f];
      }
    } else {
      for (int f = 0; f < L; ++f) {
        value[f] = P(c[f * kPoints + kPoints - 1]);
        if constexpr (kSlope) slope[f] = P(0.0);
      }
      for (int k = kPoints - 2; k >= 0; --k)
        for (int f = 0; f < L; ++f) {
          if constexpr (kSlope) slope[f] = slope[f] * x + value[f];
          value[f] = value[f] * x + P(c[f * kPoints + k]);
        }
    }
  }
  template <int L>
  BIREFIT_INLINE static P contract(const P* basis, const P* f) {
    P total = basis[0] * f[0];
    for (int k = 1; k < L; ++k) total = total + basis[k] * f[k];
    return total;
  }
  /// Adds the derivatives of which the first L functions are not negligible, contracted with the basis.
  template <int L>
  BIREFIT_INLINE void add_planes(const Planes& planes, const double* c, const P& x, const P* basis, S& total) const {
    for (int i = 0; i < planes.count; ++i) {
      const int j = planes.list[static_cast<std::size_t>(i)];
      P f[L];
      horner<L, false>(c + (static_cast<std::size_t>(j) + 1) * stride_, x, f, nullptr);
      total.d[j] = total.d[j] + contract<L>(basis, f);
    }
  }
  template <int L, int F>
  BIREFIT_INLINE S sum_of_live(const S& v, const P* basis, const P* turned, P* turned_sum) const {
    const P scaled = plain(v) * P(static_cast<double>(panels_));
    using std::floor;
    const P cell = min_of(max_of(floor(scaled), P(0.0)), P(panels_ - 1.0));
    const P x = P(2.0) * (scaled - cell) - P(1.0);
    // Lanes are neighbours in the image and mostly share a panel, whose coefficients then serve all of them; gathering
    // each lane's own costs several times as much.
    const double one = lane(cell, 0);
    if (same(cell, P(one))) return sum_on_panel<L, F>(static_cast<int>(one), x, v, basis, turned, turned_sum);
    const int first = static_cast<int>(smallest(cell)), last = static_cast<int>(largest(cell));
    S total = sum_on_panel<L, F>(first, x, v, basis, turned, turned_sum);
    for (int panel = first + 1; panel <= last; ++panel) {
      const auto here = cell >= P(static_cast<double>(panel));
      P turned_here;
      total = select(here, sum_on_panel<L, F>(panel, x, v, basis, turned, &turned_here), total);
      if (turned) *turned_sum = select(here, turned_here, *turned_sum);
    }
    return total;
  }
  template <int L, int F>
  BIREFIT_INLINE S sum_on_panel(int panel, const P& x, const S& v, const P* basis, const P* turned, P* turned_sum) const {
    const double* c = coefficients_.data() + index(panel, 0);
    P value[L], slope[L];
    horner<L, (kPlanes > 1)>(c, x, value, slope);
    if (turned) *turned_sum = contract<L>(turned, value);
    if constexpr (kPlanes == 1) {
      return contract<L>(basis, value);
    } else {
      S total(contract<L>(basis, value));
      const P along = contract<L>(basis, slope) * P(2.0 * panels_);
      for (std::size_t j = 0; j + 1 < kPlanes; ++j) total.d[j] = along * v.d[j];
      add_planes<1>(of_one_, c, x, basis, total);
      add_planes<(F > 3 ? 3 : F)>(of_three_, c, x, basis, total);
      add_planes<F>(of_all_, c, x, basis, total);
      return total;
    }
  }

  int panels_ = 0, functions_ = 0;
  std::size_t stride_ = 0;                 ///< coefficients a plane
  std::vector<double> coefficients_;       ///< [plane][panel][function][power], plane 0 the value
  int live_ = 0;                           ///< functions up to the last whose values are not negligible
  Planes of_one_, of_three_, of_all_;      ///< derivatives of which the first one, three, all functions are not negligible
};

}  // namespace birefit
