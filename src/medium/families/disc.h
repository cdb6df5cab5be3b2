#pragma once
// Stresses in a disc pressed together across a diameter: plane stress, two opposite point forces (Timoshenko & Goodier,
// Theory of Elasticity, section 41; Frocht, Photoelasticity II).

#include <numbers>
#include <span>

#include "core/scalar.h"

namespace birefit {

/// The part of a plane stress that retards light: sxx - syy and 2 sxy. Its length is the difference of the principal
/// stresses, its direction twice their azimuth; unlike these two it is smooth where the principal stresses are equal.
template <class S>
struct StressPair {
  S normal, shear;
};

/// Forces P at (0, R) and (0, -R) pressing inwards, thickness t; x, y in units of R, stress in units of P/(t R),
/// tension positive. Infinite at the forces themselves, where 1e-12 keeps the numbers finite.
template <class S>
BIREFIT_INLINE StressPair<S> diametral_stress(const S& x, const S& y) {
  const S up = 1.0 - y, down = 1.0 + y, xx = x * x, uu = up * up, dd = down * down;
  const S r1 = 1.0 / (xx + uu + 1e-12), r2 = 1.0 / (xx + dd + 1e-12);
  const S a = up * r1 * r1, b = down * r2 * r2;
  constexpr double c = 2 / std::numbers::pi;
  return {c * (a * (uu - xx) + b * (dd - xx)), (2 * c) * x * (a * up - b * down)};
}

/// Coefficients of 1, X, Y, X^2, XY, Y^2, X^3, .. in turn.
template <class S>
S plane_polynomial(std::span<const S> coefficients, const S& x, const S& y) {
  S sum(0.0);
  std::size_t i = 0;
  for (int order = 0; i < coefficients.size(); ++order)
    for (int k = 0; k <= order && i < coefficients.size(); ++k, ++i) {
      S term = coefficients[i];
      for (int j = 0; j < order - k; ++j) term = term * x;
      for (int j = 0; j < k; ++j) term = term * y;
      sum = sum + term;
    }
  return sum;
}

}  // namespace birefit
