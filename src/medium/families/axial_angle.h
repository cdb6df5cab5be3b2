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
/// (images of the ring in the sphere). On the sphere theta_s is the polar angle (normal anchoring), on the axis 0, on the
/// equator pi/2 outside the ring and 0 inside; around the ring it grows by half the angle about it: a line of strength
/// +1/2. ring = 0 gives the polar angle everywhere, the hedgehog.
template <class T>
T axial_boundary_angle(const T& rho, const T& z, const T& ring) {
  const T r2 = rho * rho + z * z, rz = 2.0 * ring * z, ring2 = ring * ring;
  const T quarter = 0.25 * (angle_of(rz, ring2 - r2) + angle_of(rz, 1.0 - ring2 * r2));
  T s, c;
  sin_cos(quarter, s, c);
  return 2.0 * angle_of(rho * s, (sqrt(r2) + z) * c);
}

}  // namespace birefit
