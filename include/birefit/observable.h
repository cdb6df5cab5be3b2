#pragma once
// What a number that is measured in a scene is.

#include <vector>

namespace birefit {

/// All but the intensity and the radii: of a cell at normal incidence whose axis does not turn about the light, without
/// polarizers and with the sign of n_e - n_o.
enum class Quantity {
  intensity,         ///< behind the analyser, over the incident
  retardance_um,     ///< optical path difference
  retardance_waves,  ///< the same over the wavelength
  birefringence,     ///< the same over the thickness
  ring_radius_cm,    ///< of dark rings on a screen, through a plate cut normal to its axis
};

/// What is measured, and what belongs to it.
struct Observable {
  Quantity quantity = Quantity::intensity;
  /// Of ring_radius_cm: numbers of the rings, where the retardance is 2 pi (number + Plate::ring_offset); a value each.
  std::vector<double> ring_numbers = {};
};

}  // namespace birefit
