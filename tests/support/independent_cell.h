#pragma once
// A uniformly twisted cell at normal incidence in closed form (Yeh & Gu, Optics of Liquid Crystal Displays, 4.1),
// tangential E continuous, no reflections. Shares nothing with src/.

#include <cmath>
#include <complex>

namespace birefit::testing {

struct IndependentCell {
  double thickness_um = 5, birefringence = 0.13, twist_deg = 90, azimuth_deg = 10, wavelength_um = 0.55;

  // u = 2 d dn/lambda = 2.36 with the numbers above, away from the Gooch-Tarry minimum at sqrt(3), where two solutions
  // for (dn, twist) merge.
  double intensity(double polarizer_deg, double analyzer_deg) const {
    using C = std::complex<double>;
    const double deg = M_PI / 180, half = M_PI / wavelength_um * thickness_um * birefringence, phi = twist_deg * deg;
    const double x = std::hypot(phi, half), s = std::sin(x) / x, c = std::cos(x);
    // In the frame that follows the director (n, n_perp).
    const double in = (polarizer_deg - azimuth_deg) * deg, out = (analyzer_deg - azimuth_deg - twist_deg) * deg;
    const C e_n = C(c, half * s) * std::cos(in) + phi * s * std::sin(in);
    const C e_p = -phi * s * std::cos(in) + C(c, -half * s) * std::sin(in);
    return std::norm(e_n * std::cos(out) + e_p * std::sin(out));
  }
};

}  // namespace birefit::testing
