#pragma once
// Dark rings of a uniaxial plate cut normal to its axis, in converging light on a screen.

#include "samples/jones_table.h"
#include "samples/planning.h"

namespace birefit {

struct SampleKind;  // samples/kind.h

/// kappa^2 (squared tangential wavevector, units of k0) of the direction where the two waves leave a plate cut normal
/// to its axis with a path difference of `path` = order x wavelength / thickness. From n_o sqrt(1 - k/n_e^2) -
/// sqrt(n_o^2 - k) = path, squared twice; exact, the same for both signs of n_e - n_o, which must not be 0.
template <class S>
S ring_kappa_squared(const S& n_o, const S& n_e, const S& path) {
  const S ratio = n_o / n_e, g = ratio * ratio - 1.0, d = path * path;
  return (2.0 * sqrt(S((1.0 + g) * d * d + g * g * n_o * n_o * d)) - (g + 2.0) * d) / (g * g);
}

/// Where such a direction meets a screen at `distance` from the middle of the plate of `thickness`, for the ordinary
/// ray through the plate's middle; any unit of length. The outside has the index n_host.
template <class S>
S ring_radius(const S& n_o, const S& kappa_squared, const S& n_host, const S& thickness, const S& distance) {
  const S outside = sqrt(S(kappa_squared / (n_host * n_host - kappa_squared)));
  const S inside = sqrt(S(kappa_squared / (n_o * n_o - kappa_squared)));
  return (distance - 0.5 * thickness) * outside + 0.5 * thickness * inside;
}

/// What is seen of the scene are the radii of rings.
inline bool is_ring_table(const Scene& scene) {
  const auto* plate = std::get_if<Plate>(&scene.sample);
  return plate && plate->screen_distance_um;
}
template <class S>
std::unique_ptr<SampleImage<S>> make_rings_image(const Scene&, const RenderPlan&, const Values<S>&, const BeamMaker&);
/// What the list of kinds (samples/kinds.def) holds of it.
extern const SampleKind kRings;

}  // namespace birefit
