#pragma once
// From scene descriptions to columns: the one place that knows which family and index law a scene asks for. Adding a
// family: its law in families/ and a case here.

#include <memory>
#include <variant>

#include "birefit/scene.h"
#include "medium/column.h"
#include "medium/families/freedericksz.h"
#include "medium/families/helix.h"
#include "medium/families/planar.h"
#include "medium/families/profile.h"
#include "medium/families/radial.h"
#include "medium/materials/dispersion.h"
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

template <class S, class V>
Vec3<S> uniform_axis(const UniformDirector& director, const V& value) {
  // 1e-14: a wave exactly along the axis has no two modes of its own. (Angles are never that exact.)
  if (director.axis[0])
    return normalized(Vec3<S>{value(director.axis[0]) + 1e-14, value(director.axis[1]), value(director.axis[2])});
  return axis_from_angles<S>(value.radians(director.tilt_deg), value.radians(director.azimuth_deg));
}

/// The axis turned about z by the sample's rotation in the image.
template <class S>
Vec3<S> rotated(const Vec3<S>& axis, const S& angle_rad) {
  S s, c;
  sin_cos(angle_rad, s, c);
  return {c * axis.x - s * axis.y, s * axis.x + c * axis.y, axis.z};
}

/// Column through a plane-parallel sample (cell, plate, slab), turned by `rotation_rad` about z.
template <class S, class V>
std::unique_ptr<Column<S>> make_planar_column(const Sample& sample, const Material& material, const V& value,
                                              const S& rotation_rad, const S& wavelength_um) {
  const auto make = [](auto law, bool planar) -> std::unique_ptr<Column<S>> {
    auto column = std::make_unique<LawColumn<S, decltype(law)>>(std::move(law));
    column->planar = planar;
    return column;
  };
  if (const auto* slab = std::get_if<Slab>(&sample)) {
    auto table = std::make_shared<const ProfileTable>(slab->profile);
    auto column = std::make_unique<LawColumn<S, ProfileLaw<S>>>(ProfileLaw<S>{table});
    column->absorbing = table->absorbing();
    column->jumps = table->jumps();
    column->breaks.assign(table->edges().begin() + 1, table->edges().end() - 1);
    return column;
  }
  const Indices<S> n = material_indices<S>(material, value, wavelength_um);
  const S eo = n.ordinary * n.ordinary, ee = n.extraordinary * n.extraordinary;
  if (const auto* cell = std::get_if<Cell>(&sample)) {
    const S thickness = value(cell->thickness_um);
    if (const auto* uniform = std::get_if<UniformDirector>(&cell->director))
      return make(UniformLaw<S>{rotated(uniform_axis<S>(*uniform, value), rotation_rad), eo, ee, thickness}, true);
    if (const auto* field = std::get_if<FreederickszDirector>(&cell->director)) {
      const CellForces<S> forces = cell_forces(*field, thickness, value);
      return make(FreederickszLaw<S>{make_director_profile(forces), value.radians(field->azimuth_deg) + rotation_rad,
                                     eo, ee, thickness},
                  !forces.twisted);
    }
    if (const auto* helix = std::get_if<HelixDirector>(&cell->director)) {
      const S azimuth = value.radians(helix->azimuth_deg) + rotation_rad, pitch = value(helix->pitch_um);
      if (helix->modulus)
        return make(UnwoundHelixLaw<S>(pitch, azimuth, value(helix->modulus), eo, ee, thickness), false);
      return make(TwistedLaw<S>{azimuth, (2 * std::numbers::pi) * thickness / pitch, S(0.0), eo, ee, thickness}, false);
    }
    const auto& twisted = std::get<TwistedDirector>(cell->director);
    return make(TwistedLaw<S>{value.radians(twisted.azimuth_deg) + rotation_rad, value.radians(twisted.twist_deg),
                              value.radians(twisted.pretilt_deg), eo, ee, thickness},
                false);
  }
  const Plate& plate = std::get<Plate>(sample);
  const S thickness = value(plate.thickness_um);
  const Vec3<S> axis = rotated(uniform_axis<S>(plate.director, value), rotation_rad);
  const auto* heat = std::get_if<HeatStep>(&plate.heat);
  HeatProfile<S> profile{};
  if (heat) {
    profile.from_cold = !heat->initial_k;
    profile.cold_k = value(heat->cold_k);
    profile.hot_k = value(heat->hot_k);
    profile.initial_k = profile.from_cold ? profile.cold_k : value(heat->initial_k);
    profile.fourier_number = heat->fourier_number ? value(heat->fourier_number)
                                                  : value(heat->diffusivity_mm2_s) * value(heat->time_s) *
                                                        inverse(thickness * thickness) * 1e6;
  }
  if (const auto* law = std::get_if<LawIndices>(&material); heat && law)
    return make(HeatedNematicLaw<S>{axis, profile, thickness, nematic_law<S>(*law, value, wavelength_um)}, true);
  if (heat) return make(HeatedLaw<S>{axis, profile, thickness}, true);
  return make(UniformLaw<S>{axis, eo, ee, thickness}, true);
}

}  // namespace birefit
