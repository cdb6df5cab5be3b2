#pragma once
// The rays that methods are compared on: the source paper's three scenes, cells, and rays that are hard.

#include <functional>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "medium/counting_column.h"
#include "medium/families/planar.h"
#include "medium/families/radial.h"
#include "transport/method.h"

namespace birefit::study {

/// The evaluation slab: axis, conductivity and extraordinary permittivity all vary with depth. Functions of
/// the same kind as the source paper's, whose own are not public.
template <class S>
struct EvaluationSlabLaw {
  S shift;  ///< added to n_e
  double thickness_um;
  template <class T>
  OpticalPoint<T> at(const T& u) const {
    T s, c, tilt_s, tilt_c, azimuth_s, azimuth_c, n_s, n_c, k_s, k_c;
    sin_cos(T(2.0 * u + 0.4), s, c);
    sin_cos(T(0.5 + 0.35 * s), tilt_s, tilt_c);
    sin_cos(T(2.5 * u), s, c);
    sin_cos(T(0.3 + 0.8 * u + 0.2 * c), azimuth_s, azimuth_c);
    sin_cos(T(2.2 * u + 0.5), n_s, n_c);
    sin_cos(T(3.0 * u), k_s, k_c);
    const T n_e = T(shift) + 1.70 + 0.03 * n_c;
    return {{tilt_c * azimuth_c, tilt_c * azimuth_s, tilt_s},
            T(1.52 * 1.52),
            n_e * n_e,
            T(0.0),
            1e-3 * (1.0 + 0.6 * k_s),
            T(thickness_um)};
  }
};

/// n_e by which all scenes are differentiated is the law's own plus `shift`.
template <class Law, class S>
struct Shifted {
  Law law;
  S shift;
  template <class T>
  OpticalPoint<T> at(const T& u) const {
    OpticalPoint<T> p = law.template at<T>(u);
    const T n_e = sqrt(p.extraordinary) + T(shift);
    p.extraordinary = n_e * n_e;
    return p;
  }
};

struct RaySpec {
  std::string name, what;
  double wavelength_um, kx, ky;
  double host_index;  ///< for the comparison with reflections
};

inline std::vector<RaySpec> ray_specs() {
  return {
      {"hedgehog", "E12 droplet of 9 um, radial, ray 2 um from the axis", 0.59, 0, 0, 1.43},
      {"e44_plate", "E44 plate of 0.8 mm under heat diffusion, Fourier number 0.1, 24 degrees", 0.64, 0, -0.4, 1.0},
      {"evaluation_slab", "slab of 0.45 mm whose axis, absorption and n_e all vary", 0.5, std::numbers::pi / 8, 0, 1.0},
      {"twisted_cell", "90 degrees in 5 um, oblique", 0.55, 0.3, 0, 1.5},
      {"cholesteric", "10 turns in 20 um", 0.59, 0, 0, 1.5},
      {"twisted_droplet", "9 um, director out of the ray's plane", 0.59, 0, 0, 1.43},
      {"near_defect", "9 um droplet, ray 25 nm from the point defect, twisted", 0.59, 0, 0, 1.43},
  };
}

/// The column of one of ray_specs(), n_e shifted.
template <class S>
std::unique_ptr<Column<S>> ray_column(const std::string& name, const S& shift) {
  const auto make = [&](auto law, bool planar = false, bool absorbing = false) -> std::unique_ptr<Column<S>> {
    using Law = Shifted<decltype(law), S>;
    auto column = std::make_unique<LawColumn<S, Law>>(Law{law, shift});
    column->planar = planar;
    column->absorbing = absorbing;
    if constexpr (std::is_same_v<decltype(law), TwistedRadialLaw<S>>) column->breaks = {0.5};  // the chord map's kink
    return column;
  };
  constexpr double kDeg = std::numbers::pi / 180;
  const auto droplet = [&](double impact, double twist) {
    const double radius = 4.5;
    const Chord<S> chord{S(impact), S(std::sqrt(radius * radius - impact * impact)), S(radius)};
    return TwistedRadialLaw<S>{chord, S(0.0), S(1.0), S(twist), S(1.52 * 1.52), S(1.74 * 1.74)};
  };
  if (name == "hedgehog") return make(droplet(2.0, 0), true);
  if (name == "twisted_droplet") return make(droplet(2.0, 60 * kDeg));
  if (name == "near_defect") return make(droplet(0.025, 60 * kDeg));
  if (name == "e44_plate")
    return make(HeatedLaw<S>{{S(-0.35355339059327373), S(0.35355339059327373), S(-0.8660254037844386)},
                             {S(0.1), S(278.0), S(368.0), S(278.0), true},
                             S(800.0)});
  if (name == "evaluation_slab") {
    auto column = std::make_unique<LawColumn<S, EvaluationSlabLaw<S>>>(EvaluationSlabLaw<S>{shift, 450});
    column->absorbing = true;
    return column;
  }
  if (name == "twisted_cell")
    return make(TwistedLaw<S>{S(0.3), S(90 * kDeg), S(0.0), S(1.522 * 1.522), S(1.739 * 1.739), S(5.0)});
  return make(TwistedLaw<S>{S(0.3), S(3600 * kDeg), S(0.0), S(1.52 * 1.52), S(1.74 * 1.74), S(20.0)});
}

}  // namespace birefit::study
