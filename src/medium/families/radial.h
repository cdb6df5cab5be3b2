#pragma once
// The radial hedgehog along a refracted straight ray, in the ray's frame (t, phi, k): k along the ray, t in the
// meridional plane (the plane of the ray and the droplet's axis), away from the axis, phi = k x t.

#include "medium/column.h"

namespace birefit {

/// The chord inside a droplet of radius R: r = impact t + s k, |s| = S q w/(1 + q - w) with w = |2u - 1|, S = half
/// chord, q = 4 impact/S + 0.01. The director of a hedgehog changes over a depth ~ impact; this map crowds w there at
/// the price of one division (0.01 keeps it finite for the ray through the centre). Factors 0.5 to 4, offsets 0.01 to
/// 0.4 and sinh and cubic maps were compared; this one needs the fewest Magnus steps. Its kink at u = 1/2 must be a
/// mesh node.
template <class S>
struct Chord {
  S impact_um, radius_um, inverse_radius;
  S q, half_q;  // q and S q

  Chord(const S& impact, const S& half, const S& radius)
      : impact_um(impact),
        radius_um(radius),
        inverse_radius(inverse(radius)),
        q(4.0 * impact * inverse(half) + 0.01),
        half_q(half * q) {}
  /// Depth along the ray from the chord's middle and its slope d s / d u, for w = 2u - 1.
  template <class T>
  BIREFIT_INLINE void place(const T& w, T& s_um, T& slope_um) const {
    const auto behind = plain(w) < PlainOf<T>(0.0);
    const T size = select(behind, -w, w);
    const T f = inverse(T(q) + 1.0 - size);
    const T distance = T(half_q) * size * f;
    s_um = select(behind, -distance, distance);
    slope_um = 2.0 * T(half_q) * (T(q) + 1.0) * f * f;
  }
};

/// n = r/|r|: the axis stays in the meridional plane and both halves of the chord retard alike, so u runs over one
/// half, with twice its depth.
template <class S>
struct RadialLaw {
  Chord<S> chord;
  S ordinary, extraordinary;
  template <class T>
  BIREFIT_INLINE OpticalPoint<T> at(const T& u) const {
    T s, slope;
    chord.place(u, s, slope);  // w = u: from the middle to the surface
    const T b = T(chord.impact_um);
    // + (1e-9 R)^2: the ray exactly through the defect keeps finite values; its retardance is zero there anyway.
    const T inverse_r = inverse_root(s * s + b * b + T(chord.radius_um * chord.radius_um * 1e-18));
    return {{b * inverse_r, T(0.0), s * inverse_r}, T(ordinary), T(extraordinary), T(0.0), T(0.0), slope};
  }
};

/// The hedgehog between a core and the surface: as RadialLaw, from depth `from` over `length`.
template <class S>
struct ShellLaw {
  S impact_um, from_um, length_um;
  S ordinary, extraordinary;
  template <class T>
  BIREFIT_INLINE OpticalPoint<T> at(const T& u) const {
    const T s = T(from_um) + T(length_um) * u, b(impact_um);
    const T inverse_r = inverse_root(s * s + b * b);
    return {{b * inverse_r, T(0.0), s * inverse_r}, T(ordinary), T(extraordinary), T(0.0), T(0.0), T(2.0 * length_um)};
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
    chord.place(2.0 * u - 1.0, s, slope);
    const T b = T(chord.impact_um), sd = T(sin_deflection), cd = T(cos_deflection);
    const T r2 = s * s + b * b + T(chord.radius_um * chord.radius_um * 1e-18);
    const T inverse_r = inverse_root(r2);
    const T n_t = b * inverse_r, n_k = s * inverse_r;
    T sn, cs;
    sin_cos(T(twist_rad) * (1.0 - r2 * inverse_r * T(chord.inverse_radius)), sn, cs);
    const T n_rho = cd * n_t - sd * n_k, n_z = sd * n_t + cd * n_k;  // droplet frame: outward, along its axis
    const T m_rho = n_rho * cs, m_phi = n_rho * sn;
    return {
        {cd * m_rho + sd * n_z, m_phi, cd * n_z - sd * m_rho}, T(ordinary), T(extraordinary), T(0.0), T(0.0), slope};
  }
};

}  // namespace birefit
