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
/// The axis turned about z by the sample's rotation in the image.
template <class S>
Vec3<S> rotated(const Vec3<S>& axis, const S& angle_rad) {
  S s, c;
  sin_cos(angle_rad, s, c);
  return {c * axis.x - s * axis.y, s * axis.x + c * axis.y, axis.z};
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
    return {axis_from_angles<T>(T(tilt_rad), T(azimuth_rad) + T(twist_rad) * u),
            T(ordinary),
            T(extraordinary),
            T(0.0),
            T(0.0),
            T(thickness_um)};
  }
};

/// Temperature across a plate of one temperature, initial_k, whose faces are at cold_k (u = 0) and hot_k (u = 1) since
/// the step: each face's step superposed.
template <class S>
struct HeatProfile {
  S fourier_number, cold_k, hot_k, initial_k;
  bool from_cold;  ///< initial_k is cold_k: one term less
  template <class T>
  BIREFIT_INLINE T at(const T& u) const {
    const T from_hot = T(hot_k - initial_k) * heat_fraction<T>(u, T(fourier_number));
    if (from_cold) return T(initial_k) + from_hot;
    return T(initial_k) + from_hot + T(cold_k - initial_k) * heat_fraction<T>(1.0 - u, T(fourier_number));
  }
};

/// One axis, temperature by conduction; indices by Steinberg's eq. 38 (materials/heat.h).
template <class S>
struct HeatedLaw {
  Vec3<S> axis;
  HeatProfile<S> heat;
  S thickness_um;
  template <class T>
  BIREFIT_INLINE OpticalPoint<T> at(const T& u) const {
    const T ne = e44_steinberg2020_extraordinary(heat.template at<T>(u));
    return {{T(axis.x), T(axis.y), T(axis.z)},
            T(kE44Steinberg2020Ordinary * kE44Steinberg2020Ordinary),
            ne * ne,
            T(0.0),
            T(0.0),
            T(thickness_um)};
  }
};

/// The same with a nematic's own law of temperature.
template <class S>
struct HeatedNematicLaw {
  Vec3<S> axis;
  HeatProfile<S> heat;
  S thickness_um;
  NematicLaw<S> nematic;
  template <class T>
  BIREFIT_INLINE OpticalPoint<T> at(const T& u) const {
    T no, ne;
    nematic.at(heat.template at<T>(u), no, ne);
    return {{T(axis.x), T(axis.y), T(axis.z)}, no * no, ne * ne, T(0.0), T(0.0), T(thickness_um)};
  }
};

}  // namespace birefit
