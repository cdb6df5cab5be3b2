#include "medium/validity.h"

#include <algorithm>
#include <limits>
#include <string_view>

#include <fmt/format.h>

#include "birefit/error.h"
#include "medium/references.h"

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

void check_validity(const Scene& scene, const std::vector<ParameterRef>& temperatures, const Theta& theta) {
  const auto value = [&](ParameterRef ref) { return ref.in(theta); };
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
  for (ParameterRef t : temperatures) {
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

namespace {

/// Says of every number of a scene that is needed and missing, or of another table, where it stands.
struct ReferenceCheck {
  const Theta& theta;
  Problems problems;

  void operator()(const ParameterRef& ref, const NumberSpec& spec, const KeyPath& path) {
    // Heated samples bring temperatures of their own; a polarizer that is not there has no azimuth.
    const std::string_view key(path.key);
    const bool may_be_left_out =
        spec.optional || spec.fallback || key == "temperature_k" || key == "polarizer_deg" || key == "analyzer_deg";
    if (!ref && !may_be_left_out)
      problems.add(Where{}, path.text() + " is an empty reference: the scene has no such number",
                   "add a parameter to the table and put its reference there");
    else if (ref && static_cast<std::size_t>(ref.index) >= theta.size())
      problems.add(
          Where{},
          fmt::format("{} refers to parameter {}, and there are {} values", path.text(), ref.index, theta.size()),
          "use references of the table that the values belong to");
  }
  /// Samples that have no material leave all of it empty.
  bool skips(const ConstantIndices& indices) const { return !indices.ordinary && !indices.birefringence; }
};

}  // namespace

void check_references(const Scene& scene, const Theta& theta) {
  ReferenceCheck check{theta, {}};
  for_each_placed(scene, check);
  check.problems.throw_if_any();
}

}  // namespace birefit
