#pragma once
// One-way wave optics through an inhomogeneous birefringent object in an isotropic host: split step in the
// flux-normalised transverse field a = Y^(1/2) e, Y the wave admittance h = Y e (docs/methods.md, "Waves"). Derivatives
// by tangents carried beside the field: exact for the discrete scheme.

#include <memory>

#include "medium/column.h"
#include "wave/fft.h"

namespace birefit {

/// The discretisation; fixed during a fit, so that the image is a smooth function of the parameters. Lengths in um, the
/// object's centre at the origin, light along +z. Grid points lie half a step off the origin: no point is on the axis.
struct WaveGrid {
  int nx = 0, ny = 0;                ///< ny = 1: nothing changes along y
  double step_um = 0;                ///< between points, both directions
  double entry_um = 0, exit_um = 0;  ///< planes in the host, z
  int slabs = 0, layers = 0;         ///< layers: of the medium in every slab; even
  double n_ref = 0;                  ///< of the free propagation; any near the medium's
  double cut_per_um = 0;             ///< transverse wavevectors beyond are left out; below k0 n_ref
  double frame_um = 0;               ///< width of the absorbing frame; 0: periodic
  int order = 2;                     ///< of the Taylor series of one slab's oblique terms

  double x_um(int i) const { return (i + 0.5 - 0.5 * nx) * step_um; }
  double y_um(int j) const { return ny == 1 ? 0.0 : (j + 0.5 - 0.5 * ny) * step_um; }
};

/// The medium at points of the grid, one a lane; the frame is the image's x, y and the light's z.
template <class S>
class WaveMedium {
 public:
  virtual ~WaveMedium() = default;
  virtual OpticalPoint<S> at(const PlainOf<S>& x_um, const PlainOf<S>& y_um, double z_um) const = 0;
  /// False where all lanes lie in the host.
  virtual bool reaches(const PlainOf<S>& x_um, const PlainOf<S>& y_um, double z_um) const = 0;
};

/// A unit plane wave. S has the same value in all lanes.
template <class S>
struct WaveLight {
  S k0_per_um;  ///< 2 pi / vacuum wavelength
  S n_host;
  Complex<S> ex, ey;                    ///< transverse field in the host
  double kx_per_um = 0, ky_per_um = 0;  ///< transverse wavevector
};

/// The tilted wave's s and p component in flux units, a_s = (q / n_host)^(1/2) e_s and a_p = (n_host / q)^(1/2) e_p,
/// and back; along z they are the same.
template <class S>
void field_to_flux(const WaveLight<S>&, Complex<S>& x, Complex<S>& y);
/// Its own field, given in flux units, in field units.
template <class S>
void flux_to_field(WaveLight<S>&);

/// The scattered flux-normalised field (x, y) in the plane grid.exit_um: a = Y^(1/2) e less the incident wave's, in
/// units of the incident wave's phase there (with exp(i (kx x + ky y)), where it is tilted) and of n_host^(1/2), so
/// that a = e for light along z. In the host a_s = (q / n_host)^(1/2) e_s, a_p = (n_host / q)^(1/2) e_p, n_host^2 = q^2
/// + kappa^2, e_p the transverse part.
struct WaveField {
  Plane a[2];
};

/// Field and, for S with derivatives, those of it: 1 + derivatives entries.
/// S = Pack, Dual<Pack, 1>, Dual<Pack, 2>, Dual<Pack, 4>. Same bits whatever the number of threads.
template <class S>
std::vector<WaveField> propagate(const WaveGrid&, const WaveLight<S>&, const WaveMedium<S>&, int threads);

}  // namespace birefit
