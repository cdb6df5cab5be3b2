#pragma once
// Where the laws of materials hold: nothing is extrapolated.

#include <optional>
#include <string>
#include <vector>

#include "birefit/scene.h"

namespace birefit {

/// Closer to the clearing point than this the birefringence falls faster than any temperature is known.
inline constexpr double kClearingMargin_k = 0.2;

struct WavelengthRange {
  double lower, upper;
};
/// The wavelengths (um) for which all dispersions of the scene hold; nothing where there is none.
std::optional<WavelengthRange> wavelengths_um(const Material& material, const std::optional<Dispersion>& surround);
/// The references to clearing points.
std::vector<ParameterRef> clearing_points(const LawIndices& law);

/// Throws UserError when theta is outside what the material's law covers: wavelength, clearing point and, of those that
/// `temperatures` (samples/kind.h) refers to, temperature.
void check_validity(const Scene& scene, const std::vector<ParameterRef>& temperatures, const Theta& theta);

/// Throws UserError that names every number of a scene built by hand that has to be there and is an empty reference, or
/// refers to an entry that a table of theta.size() parameters does not have. A material without any number is none:
/// crystals, slabs and discs have indices of their own.
void check_references(const Scene& scene, const Theta& theta);

}  // namespace birefit
