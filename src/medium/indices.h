#pragma once
// The indices of a scene's material.

#include <variant>

#include "birefit/scene.h"
#include "core/scalar.h"
#include "medium/materials/dispersion.h"
#include "medium/materials/heat.h"
#include "medium/materials/nematic.h"

namespace birefit {

template <class S>
struct Indices {
  S ordinary, extraordinary;  ///< n_o, n_e
};

/// Without the law of temperature: at the reference temperature of one, if there is one.
template <class S, class V>
Indices<S> indices_at_reference(const LawIndices& law, const V& value, const S& wavelength_um) {
  const S factor = value.get(law.birefringence_factor, 1.0);
  if (const auto* constant = std::get_if<ConstantIndices>(&law.indices)) {
    const S n_o = value(constant->ordinary);
    return {n_o, n_o + factor * value(constant->birefringence)};
  }
  const auto& dispersive = std::get<DispersiveIndices>(law.indices);
  const S n_o = index_at<S>(dispersive.ordinary, wavelength_um, value);
  return {n_o, n_o + factor * (index_at<S>(dispersive.extraordinary, wavelength_um, value) - n_o)};
}

/// The law of temperature of a material that has one (a HallerLaw or FourParameterIndices) at one wavelength.
template <class S, class V>
NematicLaw<S> nematic_law(const LawIndices& law, const V& value, const S& wavelength_um) {
  if (const auto* four = std::get_if<FourParameterIndices>(&law.indices)) {
    // The number of each set, straight lines in 1/wavelength^2 between the sets.
    const auto at = [&](ParameterRef FourParameterIndices::Set::*number) {
      const auto& sets = four->sets;
      if (sets.size() == 1) return S(value(sets[0].*number));
      std::size_t i = 0;
      while (i + 2 < sets.size() && lane(plain(wavelength_um), 0) > sets[i + 1].wavelength_um) ++i;
      const double from = 1 / square(sets[i].wavelength_um), to = 1 / square(sets[i + 1].wavelength_um);
      const S part = (1.0 / (wavelength_um * wavelength_um) - from) * (1 / (to - from));
      const S a = value(sets[i].*number), b = value(sets[i + 1].*number);
      return S(a + part * (b - a));
    };
    using Set = FourParameterIndices::Set;
    return {at(&Set::mean_index),
            value.get(law.birefringence_factor, 1.0) * at(&Set::birefringence_0k),
            S(0.0),
            1.0 / at(&Set::clearing_k),
            at(&Set::exponent),
            at(&Set::mean_slope_per_k)};
  }
  const Indices<S> n = indices_at_reference<S>(law, value, wavelength_um);
  return {(n.extraordinary + 2.0 * n.ordinary) * (1.0 / 3),
          n.extraordinary - n.ordinary,
          value(law.haller->reference_k),
          1.0 / value(law.haller->clearing_k),
          value(law.haller->exponent),
          value.get(law.haller->mean_slope_per_k, 0.0)};
}

/// Source: FormIndices.
template <class S, class V>
Indices<S> form_indices(const FormIndices& form, const V& value) {
  const S f = value(form.fraction), n1 = value(form.inside), n2 = value(form.between), e1 = n1 * n1, e2 = n2 * n2;
  const S along = f * e1 + (1.0 - f) * e2;
  if (form.structure == FormIndices::Structure::layers) return {sqrt(along), inverse(sqrt(f / e1 + (1.0 - f) / e2))};
  return {n2 * sqrt(((1.0 + f) * e1 + (1.0 - f) * e2) / ((1.0 - f) * e1 + (1.0 + f) * e2)), sqrt(along)};
}

/// `value(ref)` gives a parameter as S, `value.radians(ref)` an angle, `value.get(ref, fallback)` an optional one.
template <class S, class V>
Indices<S> material_indices(const Material& material, const V& value, const S& wavelength_um) {
  if (const auto* law = std::get_if<LawIndices>(&material)) {
    if (law->haller || std::holds_alternative<FourParameterIndices>(law->indices)) {
      Indices<S> n;
      nematic_law<S>(*law, value, wavelength_um).at(value.get(law->temperature_k, 298.15), n.ordinary, n.extraordinary);
      return n;
    }
    return indices_at_reference<S>(*law, value, wavelength_um);
  }
  if (const auto* form = std::get_if<FormIndices>(&material)) return form_indices<S>(*form, value);
  if (const auto* constant = std::get_if<ConstantIndices>(&material)) {
    const S n_o = value(constant->ordinary);
    if (!constant->resonance_nm) return {n_o, n_o + value(constant->birefringence)};
    // Of one absorption band, scaled to its value at 589.3 nm.
    const S w2 = wavelength_um * wavelength_um, r = 1e-3 * value(constant->resonance_nm), r2 = r * r;
    constexpr double kSodium2 = 0.5893 * 0.5893;
    return {n_o, n_o + value(constant->birefringence) * (w2 * (kSodium2 - r2)) / (kSodium2 * (w2 - r2))};
  }
  const auto& e44 = std::get<E44Steinberg2020>(material);
  return {S(kE44Steinberg2020Ordinary), e44_steinberg2020_extraordinary(value.get(e44.temperature_k, 298.0))};
}

}  // namespace birefit
