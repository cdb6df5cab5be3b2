#pragma once
// Light through an anisotropic, lossless object by the whole of Maxwell's equations, marched along z with nothing left
// out but multiple reflections: slow, and the judge of the faster ways to compute the same field, with which it shares
// no formula.
//
// The tangential fields e = (Ex, Ey) and h = (Hy, -Hx) (H scaled by the vacuum impedance, C9) obey, with kappa = -i
// grad / k0, kp = (kappa_y, -kappa_x), g = (eps_xz, eps_yz) and eta = 1/eps_zz (D. W. Berreman, J. Opt. Soc. Am. 62,
// 502 (1972), equations 4-7, where kappa is a number; here it is an operator and acts on everything to its right),
//
//   Ez = -eta (kappa.h + g.e)      de/dz = i k0 (h + kappa Ez)      dh/dz = i k0 (eps_tt e + g Ez - kp (kp.e)).
//
// e*.h + h*.e, twice the flux along z, is conserved. Fields are kept to |kappa| < limit; where eps - limit^2 is
// positive definite everywhere, no part of the field grows or decays: evanescent waves, which cannot be marched, are
// what the limit cuts away.

#include <array>
#include <complex>
#include <functional>
#include <vector>

#include "wave/fft.h"

namespace birefit {

/// A box, periodic across; points at ((i + 1/2 - nx/2) box_x/nx, (j + 1/2 - ny/2) box_y/ny): for even sizes none on the
/// axis, where a radial director has no value. ny = 1: nothing depends on y (box_y_um is not used).
struct MarchGrid {
  int nx = 0, ny = 0;
  double box_x_um = 0, box_y_um = 0;
  double z0_um = 0, z1_um = 0;  ///< entry and exit plane, both in the host
  /// of equal thickness; the error falls with its fourth power where the medium is smooth. 0.4 um or less
  int slabs = 0;
  int subslices = 2;    ///< of each slab, at two depths in each of which the medium is evaluated
  double limit = 0.95;  ///< spectrum kept: |kappa| < limit * n_host
};

/// eps_xx, yy, zz, xy, xz, yz at (x, y, z) in um. Called from several threads. Positive definite; see `limit`.
using DielectricAt = std::function<std::array<double, 6>(double x_um, double y_um, double z_um)>;

/// A plane wave of the host: tangential wavevector kappa (C9, |kappa| < limit * n_host) and tangential field, with
/// phase 0 at the box's middle, z = 0: e exp(i k0 (kappa.r + q z)), q = sqrt(n_host^2 - kappa^2).
struct MarchWave {
  std::array<double, 2> kappa{0, 0};
  std::array<std::complex<double>, 2> e{1, 0};
};

/// ny rows of nx, row 0 = smallest y.
struct MarchedField {
  /// Tangential field at z1 of the waves that travel forward in the host, without the incident one and without the
  /// factor exp(i k0 kappa.r) of a tilted one: what the object adds.
  Plane ex, ey;
  /// Flux along z at z0 and of the whole field (backward waves too) at z1, mean over the box: (e*.h + h*.e)/2.
  double flux_in = 0, flux_out = 0;
};

/// One field per wave; the medium is evaluated once for all. k0 = 2 pi / wavelength. Two exponentials a slab (fourth
/// order), each exact to 1e-12 (Chebyshev series). What is left: slabs, points, the neighbours of a periodic box (4 um
/// of host on each side), and reflections: no reflected wave is in the field at z0, so light reflected twice is wrong.
/// Same bits for any number of threads (0 = all cores). std::domain_error where eps - (limit n_host)^2 is not positive
/// definite (a smaller limit is then needed) or a wave is not within the limit.
///
/// Radial ball, 9 um, 1.52/1.74 in 1.52, 96 points over 16 um, 24 slabs: the picture between crossed polarizers is
/// within 0.013 (NA 0.4) and 0.018 (NA 0.8) of the exact series (relative RMS, focus on the centre), 1.0 s on one core.
std::vector<MarchedField> march(const MarchGrid& grid, double k0_per_um, double n_host, const DielectricAt& dielectric,
                                const std::vector<MarchWave>& waves, int threads = 1);

}  // namespace birefit
