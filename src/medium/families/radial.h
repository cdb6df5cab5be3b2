#pragma once
// The radial hedgehog along a refracted straight ray, in the ray's frame (t, phi, k): k along the ray, t in the
// meridional plane (the plane of the ray and the droplet's axis), away from the axis, phi = k x t.

#include "medium/column.h"

namespace birefit {

/// The chord inside a droplet of radius R: r(u) = impact t + s(u) k, s = beta sinh((2u - 1) asinh(S / beta)),
/// S = half chord. The director of a hedgehog changes over a depth ~ impact, so nodes uniform in u resolve it whatever
/// the impact. beta = sqrt(impact^2 + (1e-3 R)^2) keeps the map finite for a ray through the centre.
template <class S>
struct Chord {
  S impact_um, half_um, radius_um;
  S beta, span;  // set by the constructor

  Chord(const S& impact, const S& half, const S& radius) : impact_um(impact), half_um(half), radius_um(radius) {
    beta = sqrt(impact * impact + radius * radius * 1e-6);
    span = asinh(half / beta);
  }
  /// Depth along the ray from the chord's middle and its slope.
  template <class T>
  BIREFIT_INLINE void place(const T& u, T& s_um, T& slope_um) const {
    const T e = exp((2.0 * u - 1.0) * T(span));
    const T inverse = 1.0 / e;
    s_um = T(beta) * (e - inverse) * 0.5;
    slope_um = T(beta * span) * (e + inverse);
  }
};

/// n = r/|r|: the axis stays in the meridional plane.
template <class S>
struct RadialLaw {
  Chord<S> chord;
  S ordinary, extraordinary;
  template <class T>
  BIREFIT_INLINE OpticalPoint<T> at(const T& u) const {
    T s, slope;
    chord.place(u, s, slope);
    const T b = T(chord.impact_um);
    // + (1e-9 R)^2: the ray exactly through the defect keeps finite values; its retardance is zero there anyway.
    const T inverse_r = 1.0 / sqrt(s * s + b * b + T(chord.radius_um * chord.radius_um * 1e-18));
    return {{b * inverse_r, T(0.0), s * inverse_r}, T(ordinary), T(extraordinary), T(0.0), T(0.0), slope};
  }
};

/// The hedgehog turned about the droplet's axis by twist (1 - r/R): radial at the surface, twisted inside.
template <class S>
struct TwistedRadialLaw {
  Chord<S> chord;
  S sin_deflection, cos_deflection;  ///< of the ray inside against the droplet's axis; > 0 turns towards the axis
  S twist_rad;
  S ordinary, extraordinary;
  template <class T>
  BIREFIT_INLINE OpticalPoint<T> at(const T& u) const {
    T s, slope;
    chord.place(u, s, slope);
    const T b = T(chord.impact_um), sd = T(sin_deflection), cd = T(cos_deflection);
    const T r2 = s * s + b * b + T(chord.radius_um * chord.radius_um * 1e-18);
    const T inverse_r = 1.0 / sqrt(r2);
    const T n_t = b * inverse_r, n_k = s * inverse_r;
    T sn, cs;
    sin_cos(T(twist_rad) * (1.0 - r2 * inverse_r / T(chord.radius_um)), sn, cs);
    const T n_rho = cd * n_t - sd * n_k, n_z = sd * n_t + cd * n_k;  // droplet frame: outward, along its axis
    const T m_rho = n_rho * cs, m_phi = n_rho * sn;
    return {{cd * m_rho + sd * n_z, m_phi, cd * n_z - sd * m_rho}, T(ordinary), T(extraordinary), T(0.0), T(0.0), slope};
  }
};

}  // namespace birefit
