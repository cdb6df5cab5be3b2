#pragma once
// Geometry and optics of one ray through a droplet, shared by the image, the planner and the tests.

#include <array>

#include "render/pixel_model.h"
#include "transport/method.h"

namespace birefit {

/// Angle of incidence against image radius for one ratio m = n_host / n_o (values only; a start for Newton).
class RimTable {
 public:
  /// objective_na 0 = no limit.
  RimTable(double index_ratio, double host_index, double objective_na);
  double psi_max() const { return psi_max_; }
  double rho_max() const { return rho_max_; }          ///< largest image radius / R that light reaches
  double rho_over_radius(double psi) const;
  double psi_at(double rho_over_radius) const;          ///< within 1e-5 rad

 private:
  static constexpr int kNodes = 512;
  double ratio_, psi_max_ = 0, rho_max_ = 0;
  std::array<double, kNodes + 1> psi_{};
};

template <class S>
struct DropletOptics {
  S radius_um, n_o, n_e, n_host, ratio, k0, twist_rad;
  Continuity continuity = Continuity::e_and_h;
};

/// One refracted ray: sines and cosines of the angles outside and inside (against the sphere's normal), of the
/// deflection delta inside; the exit direction is turned by 2 delta. slope_um = d rho / d psi.
template <class S>
struct DropletRay {
  S sin_out, cos_out, sin_in, cos_in, sin_deflection, cos_deflection, cos_twice, rho_um, slope_um;
};

template <class S>
DropletOptics<S> droplet_optics(const Scene& scene, const Values<S>& value);
/// The ray whose backward extension meets the mid plane at image radius rho_um < rim.rho_max() R.
template <class S>
DropletRay<S> trace(const DropletOptics<S>& optics, const RimTable& rim, const S& rho_um);
/// Retarder on (p, s) = (radial, azimuthal) of the ray's frame inside, common phase left out.
template <class S>
Su2<S> droplet_retarder(const DropletOptics<S>&, const DropletRay<S>&, const TransportMethod<S>&, const Mesh&,
                        bool twisted);
/// The same with the surface's transmissions at both ends.
template <class S>
Mat2<S> droplet_jones(const DropletOptics<S>&, const DropletRay<S>&, const TransportMethod<S>&, const Mesh&,
                      bool twisted);

}  // namespace birefit
