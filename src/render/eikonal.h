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
/// Satiro & Moraes' cone for the extraordinary ray: in the meridional plane r sin(angle to r) is conserved and the polar angle
/// turns n_o/n_e times as fast, so that a ray of tangential wavevector kappa = n_host sin(psi) sweeps (pi - 2 psi_0) n_o/n_e,
/// sin psi_0 = kappa / n_e, on an optical path 2 n_o R cos psi_0; the ordinary one sweeps pi - 2 psi_0, sin psi_0 = kappa / n_o.
template <class S>
EikonalRay<S> eikonal_ray(const DropletOptics<S>&, bool extraordinary, const S& rho_um, double objective_na);

}  // namespace birefit
