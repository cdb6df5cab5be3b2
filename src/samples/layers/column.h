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

template <class S, class Law>
std::unique_ptr<Column<S>> column_of_law(Law law, bool planar) {
  auto column = std::make_unique<LawColumn<S, Law>>(std::move(law));
  column->planar = planar;
  return column;
}

/// The medium of a cell by its director. A family is its law in medium/families/ and a case here; one that has none
/// does not compile.
template <class S>
struct CellMedium {
  const Values<S>& value;
  S rotation_rad, thickness, ordinary, extraordinary;  ///< of the picture; um; permittivities

  std::unique_ptr<Column<S>> operator()(const UniformDirector& uniform) const {
    const Vec3<S> axis = rotated(uniform_axis<S>(uniform, value), rotation_rad);
    return column_of_law<S>(UniformLaw<S>{axis, ordinary, extraordinary, thickness}, true);
  }
  std::unique_ptr<Column<S>> operator()(const TwistedDirector& twisted) const {
    return column_of_law<S>(
        TwistedLaw<S>{value.radians(twisted.azimuth_deg) + rotation_rad, value.radians(twisted.twist_deg),
                      value.radians(twisted.pretilt_deg), ordinary, extraordinary, thickness},
        false);
  }
  std::unique_ptr<Column<S>> operator()(const FreederickszDirector& field) const {
    const CellForces<S> forces = cell_forces(field, thickness, value);
    return column_of_law<S>(
        FreederickszLaw<S>{make_director_profile(forces, value.memo()), value.radians(field.azimuth_deg) + rotation_rad,
                           ordinary, extraordinary, thickness},
        !forces.twisted);
  }
  std::unique_ptr<Column<S>> operator()(const HelixDirector& helix) const {
    const S azimuth = value.radians(helix.azimuth_deg) + rotation_rad, pitch = value(helix.pitch_um);
    if (helix.modulus)
      return column_of_law<S>(
          UnwoundHelixLaw<S>(pitch, azimuth, value(helix.modulus), ordinary, extraordinary, thickness), false);
    return column_of_law<S>(
        TwistedLaw<S>{azimuth, (2 * std::numbers::pi) * thickness / pitch, S(0.0), ordinary, extraordinary, thickness},
        false);
  }
};

/// Another column whose indices have imaginary parts.
template <class S>
class AbsorbingColumn final : public Column<S> {
 public:
  AbsorbingColumn(std::unique_ptr<Column<S>> column, const S& k_o, const S& k_e)
      : column_(std::move(column)), k_o_(k_o), k_e_(k_e) {
    this->absorbing = true;
    this->planar = column_->planar;
    this->breaks = column_->breaks;
    this->jumps = column_->jumps;
  }
  void sample(std::span<const double> u, OpticalPoint<S>* out) const override {
    column_->sample(u, out);
    for (std::size_t i = 0; i < u.size(); ++i) absorb(out[i]);
  }
  void sample_with_slope(std::span<const double> u, OpticalPoint<Slope<S>>* out) const override {
    column_->sample_with_slope(u, out);
    for (std::size_t i = 0; i < u.size(); ++i) absorb(out[i]);
  }
  void sample_taylor(double u, int order, OpticalPoint<Series<S>>* out) const override {
    column_->sample_taylor(u, order, out);
    if constexpr (kHasSeries<S>) absorb(*out);
  }

 private:
  /// (n + i k)^2
  template <class T>
  void absorb(OpticalPoint<T>& p) const {
    const auto one = [](T& re, T& im, const S& k) {
      im = T(S(2.0 * k)) * sqrt(re);
      re = re - T(S(k * k));
    };
    one(p.ordinary, p.ordinary_im, k_o_);
    one(p.extraordinary, p.extraordinary_im, k_e_);
  }
  std::unique_ptr<Column<S>> column_;
  S k_o_, k_e_;
};

/// Turned by the sample's rotation in the picture; without absorption.
template <class S>
std::unique_ptr<Column<S>> transparent_planar_column(const Scene& scene, const Values<S>& value) {
  const Sample& sample = scene.sample;
  const S rotation_rad = value.radians(scene.view.rotation_deg), wavelength = wavelength_um(scene, value);
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
  if (const auto* cell = std::get_if<Cell>(&sample))
    return std::visit(CellMedium<S>{value, rotation_rad, value(cell->thickness_um), eo, ee}, cell->director);
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
    return column_of_law<S>(HeatedNematicLaw<S>{axis, profile, thickness, nematic_law<S>(*law, value, wavelength)},
                            true);
  if (heat) return column_of_law<S>(HeatedLaw<S>{axis, profile, thickness}, true);
  return column_of_law<S>(UniformLaw<S>{axis, eo, ee, thickness}, true);
}

/// Imaginary parts of n_o and n_e of a scene that absorbs, at its light's wavelength.
template <class S>
std::array<S, 2> absorption_at(const Scene& scene, const Values<S>& value) {
  const std::vector<Absorption>& all = scene.absorption;
  const auto of = [&](std::size_t i) { return std::array<S, 2>{value(all[i].ordinary), value(all[i].extraordinary)}; };
  const S nm = value(scene.microscope.wavelength_nm);
  const double at = lane(plain(nm), 0);
  std::size_t above = 0;
  while (above < all.size() && all[above].wavelength_nm <= at) ++above;
  if (above == 0 || above == all.size()) return of(above == 0 ? 0 : above - 1);
  const std::array<S, 2> low = of(above - 1), high = of(above);
  const double from = all[above - 1].wavelength_nm;
  const S share = (nm - from) * (1 / (all[above].wavelength_nm - from));
  return {low[0] + share * (high[0] - low[0]), low[1] + share * (high[1] - low[1])};
}

/// The same as the scene has it.
template <class S>
std::unique_ptr<Column<S>> make_planar_column(const Scene& scene, const Values<S>& value) {
  std::unique_ptr<Column<S>> column = transparent_planar_column(scene, value);
  if (scene.absorption.empty()) return column;
  const auto [ordinary, extraordinary] = absorption_at<S>(scene, value);
  return std::make_unique<AbsorbingColumn<S>>(std::move(column), ordinary, extraordinary);
}

}  // namespace birefit
