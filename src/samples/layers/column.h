#pragma once
// The medium of a plane-parallel sample (cell, plate, slab) along its depth.

#include <memory>
#include <numbers>
#include <variant>

#include "medium/column.h"
#include "medium/families/freedericksz.h"
#include "medium/families/helix.h"
#include "medium/families/planar.h"
#include "medium/families/profile.h"
#include "medium/indices.h"
#include "scene/values.h"

namespace birefit {

template <class S>
Vec3<S> uniform_axis(const UniformDirector& director, const Values<S>& value) {
  // 1e-14: a wave exactly along the axis has no two modes of its own. (Angles are never that exact.)
  if (director.axis[0])
    return normalized(Vec3<S>{value(director.axis[0]) + 1e-14, value(director.axis[1]), value(director.axis[2])});
  return axis_from_angles<S>(value.radians(director.tilt_deg), value.radians(director.azimuth_deg));
}

/// Turned by the sample's rotation in the picture. A family of directors is its law in medium/families/ and a case
/// here.
template <class S>
std::unique_ptr<Column<S>> make_planar_column(const Scene& scene, const Values<S>& value) {
  const Sample& sample = scene.sample;
  const S rotation_rad = value.radians(scene.view.rotation_deg), wavelength = wavelength_um(scene, value);
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
  const Indices<S> n = material_indices<S>(scene.material, value, wavelength);
  const S eo = n.ordinary * n.ordinary, ee = n.extraordinary * n.extraordinary;
  if (const auto* cell = std::get_if<Cell>(&sample)) {
    const S thickness = value(cell->thickness_um);
    if (const auto* uniform = std::get_if<UniformDirector>(&cell->director))
      return make(UniformLaw<S>{rotated(uniform_axis<S>(*uniform, value), rotation_rad), eo, ee, thickness}, true);
    if (const auto* field = std::get_if<FreederickszDirector>(&cell->director)) {
      const CellForces<S> forces = cell_forces(*field, thickness, value);
      return make(FreederickszLaw<S>{make_director_profile(forces, value.memo()),
                                     value.radians(field->azimuth_deg) + rotation_rad, eo, ee, thickness},
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
  if (const auto* law = std::get_if<LawIndices>(&scene.material); heat && law)
    return make(HeatedNematicLaw<S>{axis, profile, thickness, nematic_law<S>(*law, value, wavelength)}, true);
  if (heat) return make(HeatedLaw<S>{axis, profile, thickness}, true);
  return make(UniformLaw<S>{axis, eo, ee, thickness}, true);
}

}  // namespace birefit
