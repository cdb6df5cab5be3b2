#pragma once
// Curved rays through a radial droplet (docs/methods.md, "Curved rays").

#include "render/droplet.h"

namespace birefit {

/// Field of one mode at image radius rho_um in the mid plane when every mode runs on its own ray through the radial droplet:
/// amplitude (surface transmissions and ray tube included, 0 where no ray arrives) and phase (rad, common part left out).
template <class S>
struct EikonalRay {
  S amplitude, phase_rad, cos_turn;  ///< cosine of the angle between ray and view behind the droplet
};
/// All rays of one mode: Satiro & Moraes' cone for the extraordinary ray: in the meridional plane r sin(angle to r) is conserved and the polar angle
/// turns n_o/n_e times as fast, so that a ray of tangential wavevector kappa = n_host sin(psi) sweeps (pi - 2 psi_0) n_o/n_e,
/// sin psi_0 = kappa / n_e, on an optical path 2 n_o R cos psi_0; the ordinary one sweeps pi - 2 psi_0, sin psi_0 = kappa / n_o.
class EikonalFan {
 public:
  /// n_mode: the index that holds tangential wavevector / k0 at the surface; sweep: how many times as fast the polar angle turns.
  EikonalFan(double n_host, double n_mode, double sweep, bool extraordinary);
  bool extraordinary() const { return extraordinary_; }
  double rho_max() const { return table_.rho_max; }  ///< largest image radius / R at which a ray arrives
  double psi_max() const { return table_.psi[0]; }
  template <class P>
  P incidence(const P& rho_over_radius) const { return table_.at(rho_over_radius); }  ///< a start for Newton

 private:
  bool extraordinary_;
  IncidenceTable table_;
};
template <class S>
EikonalFan eikonal_fan(const DropletOptics<S>& o, bool extraordinary) {
  const auto number = [](const S& x) { return lane(plain(x), 0); };
  return extraordinary ? EikonalFan(number(o.n_host), number(o.n_e), number(o.n_o) / number(o.n_e), true) : EikonalFan(number(o.n_host), number(o.n_o), 1, false);
}
/// `fan` of the same droplet.
template <class S>
EikonalRay<S> eikonal_ray(const DropletOptics<S>&, const EikonalFan& fan, const S& rho_um, double objective_na);

}  // namespace birefit
