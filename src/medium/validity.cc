#include "medium/validity.h"

#include <algorithm>
#include <limits>

#include <fmt/format.h>

#include "birefit/error.h"

namespace birefit {

std::optional<WavelengthRange> wavelengths_um(const Material& material, const std::optional<Dispersion>& surround) {
  WavelengthRange range{0, std::numeric_limits<double>::infinity()};
  const auto narrow = [&](double lower, double upper) {
    range.lower = std::max(range.lower, lower);
    range.upper = std::min(range.upper, upper);
  };
  if (const auto* law = std::get_if<LawIndices>(&material)) {
    if (const auto* dispersive = std::get_if<DispersiveIndices>(&law->indices))
      for (const Dispersion* d : {&dispersive->ordinary, &dispersive->extraordinary}) narrow(d->lower_um, d->upper_um);
    if (const auto* four = std::get_if<FourParameterIndices>(&law->indices); four && four->sets.size() > 1)
      narrow(four->sets.front().wavelength_um, four->sets.back().wavelength_um);
  }
  if (surround) narrow(surround->lower_um, surround->upper_um);
  if (range.upper == std::numeric_limits<double>::infinity()) return std::nullopt;
  return range;
}

std::vector<ParameterRef> clearing_points(const LawIndices& law) {
  std::vector<ParameterRef> refs;
  if (const auto* four = std::get_if<FourParameterIndices>(&law.indices))
    for (const FourParameterIndices::Set& set : four->sets) refs.push_back(set.clearing_k);
  else if (law.haller)
    refs.push_back(law.haller->clearing_k);
  return refs;
}

std::vector<ParameterRef> temperatures(const Sample& sample, const LawIndices& law) {
  std::vector<ParameterRef> refs;
  if (clearing_points(law).empty()) return refs;
  const Plate* plate = std::get_if<Plate>(&sample);
  const HeatStep* heat = plate ? std::get_if<HeatStep>(&plate->heat) : nullptr;
  if (heat)
    refs = {heat->cold_k, heat->hot_k, heat->initial_k ? heat->initial_k : heat->cold_k};
  else if (law.temperature_k)
    refs = {law.temperature_k};
  if (law.haller) refs.push_back(law.haller->reference_k);
  return refs;
}

void check_validity(const Scene& scene, const Theta& theta) {
  const auto value = [&](ParameterRef ref) { return theta.at(static_cast<std::size_t>(ref.index)); };
  if (const auto range = wavelengths_um(scene.material, scene.surround_dispersion)) {
    const double nm = value(scene.microscope.wavelength_nm), slack = 1e-9 * nm;
    if (nm < 1000 * range->lower - slack || nm > 1000 * range->upper + slack)
      throw UserError(
          Where{},
          fmt::format("wavelength_nm = {:g} is outside [{:g}, {:g}], where the indices of this scene are known", nm,
                      1000 * range->lower, 1000 * range->upper),
          "nothing is extrapolated: use another source of the material");
  }
  const auto* law = std::get_if<LawIndices>(&scene.material);
  if (!law) return;
  const Plate* plate = std::get_if<Plate>(&scene.sample);
  if (plate && std::holds_alternative<HeatStep>(plate->heat) && clearing_points(*law).empty())
    throw UserError(Where{}, "the material of a heated plate needs a law of temperature", "add haller to the material");
  for (ParameterRef t : temperatures(scene.sample, *law)) {
    for (ParameterRef tc : clearing_points(*law))
      if (value(t) > value(tc) - kClearingMargin_k)
        throw UserError(
            Where{},
            fmt::format(
                "a temperature of {:g} K is at or above the clearing point, {:g} K (less {:g} K): there the material "
                "is not birefringent",
                value(t), value(tc), kClearingMargin_k));
    const bool reference = law->haller && t == law->haller->reference_k;
    if (law->upper_k > 0 && !reference && (value(t) < law->lower_k || value(t) > law->upper_k))
      throw UserError(Where{},
                      fmt::format("a temperature of {:g} K is outside [{:g}, {:g}] K, where this material's law holds",
                                  value(t), law->lower_k, law->upper_k));
  }
}

}  // namespace birefit
