#pragma once
// Permittivity of a uniaxial ball (or cylinder) in an isotropic host, for what needs eps(x, y, z). Shares nothing with src/.

#include <algorithm>
#include <array>
#include <cmath>

namespace birefit::testing {

/// director(x, y, z) -> (nx, ny, nz), unit; the surface is a linear ramp of the medium's share from 1 to 0 over `ramp_um`, about one pixel.
template <class Director>
struct IndependentBall {
  double radius_um, n_o, n_e, n_host, ramp_um;
  Director director;
  bool cylinder = false;  ///< axis along y

  /// eps_xx, yy, zz, xy, xz, yz.
  std::array<double, 6> operator()(double x, double y, double z) const {
    const double r = cylinder ? std::hypot(x, z) : std::hypot(x, y, z);
    const double share = std::clamp(0.5 + (radius_um - r) / ramp_um, 0.0, 1.0), host = (1 - share) * n_host * n_host;
    if (share == 0) return {host, host, host, 0, 0, 0};
    const std::array<double, 3> n = director(x, y, z);
    const double o = host + share * n_o * n_o, a = share * (n_e * n_e - n_o * n_o);
    return {o + a * n[0] * n[0], o + a * n[1] * n[1], o + a * n[2] * n[2], a * n[0] * n[1], a * n[0] * n[2], a * n[1] * n[2]};
  }
};

inline std::array<double, 3> radial_director(double x, double y, double z) {
  const double r = std::hypot(x, y, z);
  return {x / r, y / r, z / r};
}
inline std::array<double, 3> radial_cylinder_director(double x, double, double z) { return radial_director(x, 0, z); }

}  // namespace birefit::testing
