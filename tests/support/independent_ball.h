#pragma once
// Permittivity of a uniaxial ball (or cylinder) in an isotropic host, for what needs eps(x, y, z). Shares nothing with
// src/.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace birefit::testing {

/// director(x, y, z) -> (nx, ny, nz), unit. In a layer of ramp_um about the surface the medium's share falls linearly
/// from 1 to 0, and the two are mixed as thin sheets along the surface, which keeps E along it and D across it
/// continuous (G. W. Milton, The Theory of Composites, 9.2; for pixels: Kottke, Farjadpour, Johnson, Phys. Rev. E 77,
/// 036611 (2008)). Measured with a radial ball: half the error of mixing eps itself on coarse pixels, and hardly any
/// influence of ramp_um; one pixel is right.
template <class Director>
struct IndependentBall {
  double radius_um, n_o, n_e, n_host, ramp_um;
  Director director;
  bool cylinder = false;  ///< axis along y

  /// eps_xx, yy, zz, xy, xz, yz.
  std::array<double, 6> operator()(double x, double y, double z) const {
    const double r = cylinder ? std::hypot(x, z) : std::hypot(x, y, z), host = n_host * n_host;
    const double share = std::clamp(0.5 + (radius_um - r) / ramp_um, 0.0, 1.0);
    if (share == 0) return {host, host, host, 0, 0, 0};
    const std::array<double, 3> n = director(x, y, z), m{x / r, cylinder ? 0 : y / r, z / r};
    // <eps> - s (1 - s) d d / (m.((1 - s) eps + s host).m), d = (eps - host).m, m the normal.
    const double along = n_e * n_e - n_o * n_o, nm = n[0] * m[0] + n[1] * m[1] + n[2] * m[2];
    const double across = n_o * n_o - host,
                 less = share * (1 - share) / (host + (1 - share) * (across + along * nm * nm));
    std::array<double, 3> d{};
    for (std::size_t i = 0; i < 3; ++i) d[i] = across * m[i] + along * nm * n[i];
    const auto entry = [&](std::size_t i, std::size_t j) {
      return (i == j ? host + share * across : 0) + share * along * n[i] * n[j] - less * d[i] * d[j];
    };
    return {entry(0, 0), entry(1, 1), entry(2, 2), entry(0, 1), entry(0, 2), entry(1, 2)};
  }
};

inline std::array<double, 3> radial_director(double x, double y, double z) {
  const double r = std::hypot(x, y, z);
  return {x / r, y / r, z / r};
}
inline std::array<double, 3> radial_cylinder_director(double x, double, double z) { return radial_director(x, 0, z); }

}  // namespace birefit::testing
