#pragma once
// Smooth functions of one coordinate, tabulated once and read at every pixel. A sample that is symmetric about the
// viewing axis needs one ray for every radius, not one for every pixel.

#include <array>
#include <cmath>
#include <vector>

#include "core/scalar.h"
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
    const Rule& rule = points();
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
          for (std::size_t k = 0; k < kPoints; ++k) sum += rule.to_coefficients[c][k] * values[block + k];
          coefficients_[block + c] = sum;
          if (plane > 0 && sum != 0) live_[plane - 1] = true;
        }
  }

  /// sum_k basis[k] f_k(v) over the F functions that were tabulated; v outside [0, 1] is extrapolated from the end
  /// panels.
  template <int F>
  BIREFIT_INLINE S sum(const S& v, const S* basis) const {
    const P scaled = plain(v) * P(static_cast<double>(panels_));
    using std::floor;
    const P cell = min_of(max_of(floor(scaled), P(0.0)), P(panels_ - 1.0));
    const P x = P(2.0) * (scaled - cell) - P(1.0);
    // Lanes are neighbours in the image and mostly share a panel, whose coefficients then serve all of them; gathering
    // each lane's own costs several times as much.
    const int first = static_cast<int>(smallest(cell)), last = static_cast<int>(largest(cell));
    S total = sum_on_panel<F>(first, x, v, basis);
    for (int panel = first + 1; panel <= last; ++panel)
      total = select(cell >= P(static_cast<double>(panel)), sum_on_panel<F>(panel, x, v, basis), total);
    return total;
  }

 private:
  static constexpr std::size_t kPlanes = 1 + static_cast<std::size_t>(ScalarTraits<S>::derivatives);
  struct Rule {
    std::array<double, kPoints> x;
    std::array<std::array<double, kPoints>, kPoints> to_coefficients;  ///< values at x to powers of x
  };
  static const Rule& points() {
    static const Rule rule = [] {
      Rule r;
      for (int k = 0; k < kPoints; ++k) r.x[static_cast<std::size_t>(k)] = std::cos(std::numbers::pi * (k + 0.5) / kPoints);
      // Column k: the Lagrange polynomial of point k, multiplied out.
      for (std::size_t k = 0; k < kPoints; ++k) {
        std::array<double, kPoints + 1> p{1.0};
        int degree = 0;
        for (std::size_t m = 0; m < kPoints; ++m) {
          if (m == k) continue;
          const double scale = 1 / (r.x[k] - r.x[m]);
          for (int c = ++degree; c >= 0; --c) {
            const std::size_t at = static_cast<std::size_t>(c);
            p[at] = ((c > 0 ? p[at - 1] : 0.0) - r.x[m] * p[at]) * scale;
          }
        }
        for (std::size_t c = 0; c < kPoints; ++c) r.to_coefficients[c][k] = p[c];
      }
      return r;
    }();
    return rule;
  }
  std::size_t index(int panel, int function) const {
    return (static_cast<std::size_t>(panel) * static_cast<std::size_t>(functions_) + static_cast<std::size_t>(function)) * kPoints;
  }
  /// F polynomials at x, their chains of multiply-adds side by side.
  template <int F, bool kSlope>
  BIREFIT_INLINE static void horner(const double* c, const P& x, P* value, P* slope) {
    for (int f = 0; f < F; ++f) {
      value[f] = P(c[f * kPoints + kPoints - 1]);
      if constexpr (kSlope) slope[f] = P(0.0);
    }
    for (int k = kPoints - 2; k >= 0; --k)
      for (int f = 0; f < F; ++f) {
        if constexpr (kSlope) slope[f] = slope[f] * x + value[f];
        value[f] = value[f] * x + P(c[f * kPoints + k]);
      }
  }
  template <int F>
  BIREFIT_INLINE S sum_on_panel(int panel, const P& x, const S& v, const S* basis) const {
    const double* c = coefficients_.data() + index(panel, 0);
    P value[F], slope[F];
    horner<F, (kPlanes > 1)>(c, x, value, slope);
    const auto contract = [&](const P* f) {
      P total = plain(basis[0]) * f[0];
      for (int k = 1; k < F; ++k) total = total + plain(basis[k]) * f[k];
      return total;
    };
    if constexpr (kPlanes == 1) {
      return contract(value);
    } else {
      S total(contract(value));
      const P along = contract(slope) * P(2.0 * panels_);
      for (std::size_t j = 0; j + 1 < kPlanes; ++j) {
        P d = along * v.d[j];
        for (int k = 0; k < F; ++k) d = d + basis[k].d[j] * value[k];
        total.d[j] = d;
      }
      for (std::size_t j = 0; j + 1 < kPlanes; ++j) {
        if (!live_[j]) continue;
        P parameter[F];
        horner<F, false>(c + (j + 1) * stride_, x, parameter, nullptr);
        total.d[j] = total.d[j] + contract(parameter);
      }
      return total;
    }
  }

  int panels_ = 0, functions_ = 0;
  std::size_t stride_ = 0;                 ///< coefficients a plane
  std::vector<double> coefficients_;       ///< [plane][panel][function][power], plane 0 the value
  std::array<bool, kPlanes> live_{};       ///< derivative j is not zero everywhere
};

}  // namespace birefit
