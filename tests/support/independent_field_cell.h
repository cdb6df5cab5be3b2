#pragma once
// A planar nematic cell with pretilt in a field along its normal, computed a second time, by quadrature: the first
// integral of the tilt's equation at uniform D (Deuling, Mol. Cryst. Liq. Cryst. 19, 123 (1972), his integrals from the
// pretilt on). With sin t = sqrt(m) sin psi, k = K33/K11 - 1, g = eps_par/eps_perp - 1:
//   v = (2/pi) sqrt(1 + g m) Int sqrt((1 + k m s^2) / ((1 + g m s^2)(1 - m s^2))) dpsi,
//   dzeta = dpsi sqrt((1 + k m s^2)(1 + g m s^2) / (1 - m s^2)) / (2 J),   J its integral from psi0 to pi/2, s = sin
//   psi.
// Shares nothing with src/.

#include <algorithm>
#include <cmath>

namespace birefit::testing {

struct IndependentFieldCell {
  double k33_over_k11 = 17.1 / 11.1, eps_ratio = 19.28 / 5.21, pretilt_deg = 1;
  double thickness_um = 5, n_o = 1.52, n_e = 1.72;

  struct Integrals {
    double v, retardance_um;
  };
  /// Simpson's rule, far finer than needed: psi0 = asin(sin(pretilt) / sqrt m) to pi/2. m = 1 - exp(-w).
  Integrals at(double w) const {
    const double m = -std::expm1(-w), rest = std::exp(-w), k = k33_over_k11 - 1, g = eps_ratio - 1;
    const double psi0 = std::asin(std::min(1.0, std::sin(pretilt_deg * M_PI / 180) / std::sqrt(m)));
    double i_v = 0, i_z = 0, i_g = 0;
    // psi = pi/2 - sinh-like stretch: 1 - m s^2 falls to exp(-w) within exp(-w/2) of pi/2.
    const double a = std::sqrt(rest) + 1e-3, end = std::asinh((M_PI / 2 - psi0) / a);
    constexpr int kPanels = 4000;
    for (int i = 0; i <= kPanels; ++i) {
      const double x = end * i / kPanels, c = a * std::sinh(x),
                   weight = (i == 0 || i == kPanels ? 1
                             : i % 2                ? 4
                                                    : 2) *
                            a * std::cosh(x);
      const double s2 = std::pow(std::cos(c), 2), below = rest + m * std::pow(std::sin(c), 2);  // 1 - m s^2
      const double bend = 1 + k * m * s2, dielectric = 1 + g * m * s2;
      i_v += weight * std::sqrt(bend / (dielectric * below));
      const double dz = weight * std::sqrt(bend * dielectric / below);
      i_z += dz;
      i_g += dz * (n_o * n_e / std::sqrt(n_e * n_e * m * s2 + n_o * n_o * below) - n_o);
    }
    return {2 / M_PI * std::sqrt(1 + g * m) * i_v * end / kPanels / 3, thickness_um * i_g / i_z};
  }
  /// v grows with m from 0 at sin^2(pretilt).
  double retardance_um(double v) const {
    double low = -std::log1p(-std::pow(std::sin(pretilt_deg * M_PI / 180), 2)) + 1e-16, high = 200;
    for (int i = 0; i < 100; ++i) {
      const double middle = 0.5 * (low + high);
      (at(middle).v < v ? low : high) = middle;
    }
    return at(0.5 * (low + high)).retardance_um;
  }
  /// Director at 45 degrees between crossed polarizers.
  double crossed(double v, double wavelength_um) const {
    return std::pow(std::sin(M_PI / wavelength_um * retardance_um(v)), 2);
  }
};

}  // namespace birefit::testing
