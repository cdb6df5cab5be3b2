#pragma once
// Polynomials through Chebyshev points, none of them at an end of [-1, 1], where a function may be singular.

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace birefit {

template <int kPoints>
struct ChebyshevRule {
  std::array<double, kPoints> x;
  std::array<std::array<double, kPoints>, kPoints> to_powers;  ///< [power][point]: values at x to coefficients
};
template <int kPoints>
const ChebyshevRule<kPoints>& chebyshev_rule() {
  static const ChebyshevRule<kPoints> rule = [] {
    ChebyshevRule<kPoints> r;
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
      for (std::size_t c = 0; c < kPoints; ++c) r.to_powers[c][k] = p[c];
    }
    return r;
  }();
  return rule;
}

}  // namespace birefit
