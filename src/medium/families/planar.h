#pragma once
// Director fields of plane-parallel layers: uniform axis, uniform twist, heated plate. u = depth / thickness.

#include "medium/column.h"
#include "medium/materials/heat.h"
#include "medium/materials/nematic.h"

namespace birefit {

/// Tilt from the layer plane towards +z, azimuth from +x counter-clockwise (radians).
template <class S>
BIREFIT_INLINE Vec3<S> axis_from_angles(const S& tilt_rad, const S& azimuth_rad) {
  S st, ct, sa, ca;
  sin_cos(tilt_rad, st, ct);
  sin_cos(azimuth_rad, sa, ca);
  return {ct * ca, ct * sa, st};
}

/// One axis, constant indices.
template <class S>
struct UniformLaw {
  Vec3<S> axis;
  S ordinary, extraordinary, thickness_um;
  template <class T>
  BIREFIT_INLINE OpticalPoint<T> at(const T&) const {
    return {{T(axis.x), T(axis.y), T(axis.z)}, T(ordinary), T(extraordinary), T(0.0), T(0.0), T(thickness_um)};
  }
};

/// Azimuth grows linearly with depth, tilt constant (pretilt): the off state of a twisted cell.
template <class S>
struct TwistedLaw {
  S azimuth_rad, twist_rad, tilt_rad;
  S ordinary, extraordinary, thickness_um;
  template <class T>
  BIREFIT_INLINE OpticalPoint<T> at(const T& u) const {
    return {axis_from_angles<T>(T(tilt_rad), T(azimuth_rad) + T(twist_rad) * u), T(ordinary), T(extraordinary),
            T(0.0), T(0.0), T(thickness_um)};
  }
};

/// One axis, temperature rising with u from cold to hot by conduction; indices by Steinberg's eq. 38 (materials/heat.h).
template <class S>
struct HeatedLaw {
  Vec3<S> axis;
  S fourier_number, cold_k, hot_k, thickness_um;
  template <class T>
  BIREFIT_INLINE OpticalPoint<T> at(const T& u) const {
    const T temperature = T(cold_k) + T(hot_k - cold_k) * heat_fraction<T>(u, T(fourier_number));
    const T ne = e44_steinberg2020_extraordinary(temperature);
    return {{T(axis.x), T(axis.y), T(axis.z)}, T(kE44Steinberg2020Ordinary * kE44Steinberg2020Ordinary), ne * ne,
            T(0.0), T(0.0), T(thickness_um)};
  }
};

/// The same with a nematic's own law of temperature.
template <class S>
struct HeatedNematicLaw {
  Vec3<S> axis;
  S fourier_number, cold_k, hot_k, thickness_um;
  NematicLaw<S> nematic;
  template <class T>
  BIREFIT_INLINE OpticalPoint<T> at(const T& u) const {
    const T temperature = T(cold_k) + T(hot_k - cold_k) * heat_fraction<T>(u, T(fourier_number));
    T no, ne;
    nematic.at(temperature, no, ne);
    return {{T(axis.x), T(axis.y), T(axis.z)}, no * no, ne * ne, T(0.0), T(0.0), T(thickness_um)};
  }
};

}  // namespace birefit
