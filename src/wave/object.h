#pragma once
// What the objects of wave optics share: surfaces between media on its grid, and the grid for an object's size.

#include <algorithm>
#include <cmath>
#include <numbers>

#include "wave/split_step.h"

namespace birefit {

/// Surfaces are ramps of the volume fraction, so that the image is differentiable by where they are and where the grid
/// cuts them does not matter: from 0 to 1 over a width, cubic, so that derivatives have no steps. Of 1.29 grid steps it
/// is as blurred as a linear one of one step.
constexpr double kRampWidth = 1.29;
template <class S>
S surface_ramp(const S& depth_um, double width_um) {
  const S u = min_of(max_of(depth_um * (1 / width_um) + 0.5, S(0.0)), S(1.0));
  return u * u * (3.0 - 2.0 * u);
}

/// In a ramp: fraction c of a uniaxial medium of axis n, permittivities eo and ee; rest and inverse_rest:
/// permittivities of what is isotropic and their inverses, each times its fraction; face: the surface's normal. The
/// permittivity along the surface is the mean, that across it the harmonic mean (Kottke, Farjadpour & Johnson, Phys.
/// Rev. E 77, 036611 (2008)); what this leaves of a uniaxial tensor that is neither normal nor tangential to the
/// surface is brought back to a uniaxial one with the same axis.
template <class S>
OpticalPoint<S> mixed_at_surface(const Vec3<S>& n, const Vec3<S>& face, const S& eo, const S& ee, const S& c,
                                 const S& rest, const S& inverse_rest) {
  const S de = ee - eo;
  const S u = n.x * face.x + n.y * face.y + n.z * face.z, u2 = u * u, w2 = 1.0 - u2;
  // In the plane of axis and normal r, with t across: e_rr, e_rt = de u w, e_tt.
  const S rr = eo + de * u2, inverse_rr = inverse(rr), rt_over_uw = de;
  const S new_rr = inverse(S(c * inverse_rr + inverse_rest));
  const S bend = c * rt_over_uw * inverse_rr;  // times u w
  const S new_rt = bend * new_rr;              // times u w
  const S new_tt =
      c * (eo + de * w2 - rt_over_uw * rt_over_uw * u2 * w2 * inverse_rr) + rest + bend * bend * u2 * w2 * new_rr;
  const S new_ss = c * eo + rest;
  const S along = u2 * new_rr + 2.0 * u2 * w2 * new_rt + w2 * new_tt;
  return {n, 0.5 * (new_rr + new_tt + new_ss - along), along, S(0.0), S(0.0), S(0.0)};
}

/// Half of what an object takes along x, y and the light, and the host left free around it.
struct ObjectSize {
  double x_um, y_um, z_um, margin_um;
};
/// How far light from an object's widest part gets aside on its way to the exit plane, at the objective's edge.
inline double spread_um(double half_depth_um, double objective_na, double n_host) {
  const double sine = std::min(objective_na / n_host, 0.99);
  return 1 + half_depth_um * sine / std::sqrt(1 - sine * sine);
}

/// Measured on spheres against the exact series (tests/cross/split_step_test.cc): n_o 1.52, n_e 1.74, diameters of 5 to
/// 20 um leave 0.01 to 0.06 of the picture's RMS, most of it what a one-way wave to the second order in its slope
/// leaves out.
inline WaveGrid object_grid(const ObjectSize& size, double n_o, double n_e, double n_host, double k0_per_um,
                            double objective_na) {
  const double wavelength = 2 * std::numbers::pi / k0_per_um;
  // Steep waves need thin slabs: 0.8 wavelengths add nothing to the model's error at NA 0.4, and half of it at NA 0.8.
  const double step = 0.339 * wavelength, slab = (0.95 - 0.375 * std::min(objective_na, 1.2)) * wavelength;
  // more is refused elsewhere
  const auto count = [](double x) { return static_cast<int>(std::ceil(std::min(x, 1e6))); };
  WaveGrid g;
  const double longest = 2 * (std::max(size.x_um, size.y_um) + size.margin_um),
               shortest = 2 * (std::min(size.x_um, size.y_um) + size.margin_um);
  const int most = fast_fft_size(count(longest / step));
  g.step_um = longest / most;
  const int least = size.x_um == size.y_um ? most : fast_fft_size(count(shortest / g.step_um));
  g.nx = size.x_um >= size.y_um ? most : least;
  g.ny = size.x_um >= size.y_um ? least : most;
  // 5 % more: the size may be fitted.
  g.exit_um = 1.05 * size.z_um + g.step_um;
  g.entry_um = -g.exit_um;
  g.slabs = count((g.exit_um - g.entry_um) / slab);
  g.layers = 4;
  // Between host and medium: the diffraction of neither is then far from exact.
  g.n_ref = 0.5 * n_host + 0.25 * (n_o + n_e);
  g.cut_per_um = std::min({1.2, 0.5 * (objective_na + n_host) + 0.2, 0.97 * n_host, 0.97 * g.n_ref}) * k0_per_um;
  g.frame_um = 0.25 * (1.5 + 3 * objective_na);
  return g;
}

}  // namespace birefit
