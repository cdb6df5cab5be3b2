#pragma once
// The director angle of a homeotropic droplet in a field along its axis: what is known in closed form, shared by the
// equilibrium solver and the column. Lengths in units of the droplet's radius, e = radius / coherence length,
// ring = radius of the equatorial disclination ring (0: a point hedgehog in the centre). Upper half, z >= 0.

#include "core/scalar.h"

namespace birefit {

/// atan2 with derivatives, over any scalar.
BIREFIT_INLINE double angle_of(double y, double x) { return std::atan2(y, x); }
BIREFIT_INLINE Pack angle_of(const Pack& y, const Pack& x) { return xsimd::atan2(y, x); }
template <class B, int N>
BIREFIT_INLINE Dual<B, N> angle_of(const Dual<B, N>& y, const Dual<B, N>& x) {
  Dual<B, N> r;
  r.value = angle_of(y.value, x.value);
  const B over = B(1.0) / (x.value * x.value + y.value * y.value);
  for (int i = 0; i < N; ++i) r.d[i] = (x.value * y.d[i] - y.value * x.d[i]) * over;
  return r;
}

/// An angle with every boundary value and the defect's singularity of the director angle, and nothing of the field:
///   theta_s = 2 atan(tan(polar angle / 2) tan(pi q / 4)),
/// q the harmonic function that is 1 on the sphere and on the equator outside the ring and 0 on the equator inside it:
///   pi q = arg(ring^2 - r^2 + 2 i ring z) + arg(1 - ring^2 r^2 + 2 i ring z)
/// (images of the ring in the sphere). On the sphere theta_s is the polar angle (normal anchoring), on the axis 0, on
/// the equator pi/2 outside the ring and 0 inside; around the ring it grows by half the angle about it: a line of
/// strength +1/2. ring = 0 gives the polar angle everywhere, the hedgehog. As sine and cosine of theta_s: with tan(a /
/// 2) = y / (|w| + x), a = arg(x + i y), no angle is needed on the way. R = T, or a base of it.
template <class T, class R>
void axial_boundary_direction(const T& rho, const T& z, const R& ring, T& sine, T& cosine) {
  const T r2 = rho * rho + z * z, y = 2.0 * (ring * z);
  const R ring2 = ring * ring;
  // (c, s) along (cos a/2, sin a/2), 0 <= a <= pi; of the two quotients that are the same the one that does not cancel.
  const auto half = [&y](const T& x, T& c, T& s) {
    const T modulus = sqrt(x * x + y * y);
    const auto left = plain(x) < PlainOf<T>(0.0);
    const T longer = modulus + select(left, T(-x), x) + 1e-30;  // on the ring itself there is no direction: any
    c = select(left, y, longer);
    s = select(left, longer, y);
  };
  T c1, s1, c2, s2;
  half(ring2 - r2, c1, s1);
  half(1.0 - ring2 * r2, c2, s2);
  // The sum of both, halved; it stays between 0 and pi.
  const T x = c1 * c2 - s1 * s2, h = s1 * c2 + c1 * s2;
  const auto left = plain(x) < PlainOf<T>(0.0);
  const T modulus = sqrt(x * x + h * h), longer = modulus + select(left, T(-x), x);
  const T c = (sqrt(r2) + z) * select(left, h, longer), s = rho * select(left, longer, h);
  // Twice the angle of (c, s).
  const T over = inverse(T(c * c + s * s));
  sine = 2.0 * (s * c) * over;
  cosine = (c * c - s * s) * over;
}
/// theta_s itself, rad.
template <class T>
T axial_boundary_angle(const T& rho, const T& z, const T& ring) {
  T s, c;
  axial_boundary_direction(rho, z, ring, s, c);
  return angle_of(s, c);
}

}  // namespace birefit
