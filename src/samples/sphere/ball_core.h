#pragma once
// A shell's core as rays see it: a disc of its own, wherever it lies in the sphere.

#include "samples/sphere/ball_optics.h"

namespace birefit {

/// The field of a shell in the sphere, if it is one.
template <class S>
const NestedField<S>* shell_in(const BallOptics<S>& o) {
  return std::get_if<NestedField<S>>(&o.field);
}
/// The same sphere, of which no ray meets the core.
template <class S>
BallOptics<S> beside_core(BallOptics<S> o) {
  if (auto* shell = std::get_if<NestedField<S>>(&o.field)) shell->core_left_out = true;
  return o;
}
/// Where the ray that is seen at an azimuth passes the core's middle (reach_at_core).
template <class S>
void place_at_core(const NestedField<S>& shell, const S& reach, const S& ca, const S& sa, S& x, S& y) {
  const S over = inverse(shell.core);
  x = (reach * ca - shell.offset.x) * over;
  y = (reach * sa - shell.offset.y) * over;
}
template <class S>
void place_at_core(const NestedField<S>& shell, const DropletRay<S>& ray, const S& ca, const S& sa, S& x, S& y) {
  place_at_core(shell, reach_at_core(shell, ray.sin_in, ray.sin_deflection, ray.cos_deflection, ca, sa), ca, sa, x, y);
}
/// Where such a ray is seen.
template <class S>
struct SeenAt {
  S rho, cos_azimuth, sin_azimuth;  ///< rho in radii of the sphere
};
template <class S>
SeenAt<S> seen_of_core(const NestedField<S>& shell, const S& ratio, const RimTable& rim, const S& x, const S& y) {
  using P = PlainOf<S>;
  // reach (cos, sin) = core (x, y) + offset gives the azimuth, and the angle of incidence by Newton's method.
  const S px = shell.core * x + shell.offset.x, py = shell.core * y + shell.offset.y,
          square = px * px + py * py + 1e-18, over = inverse_root(square);
  SeenAt<S> r;
  r.cos_azimuth = px * over, r.sin_azimuth = py * over;
  const S wanted = square * over;
  const P m = plain(ratio), limit(rim.psi_max()), ca = plain(r.cos_azimuth), sa = plain(r.sin_azimuth);
  const NestedField<P> still{{plain(shell.offset.x), plain(shell.offset.y), plain(shell.offset.z)}, plain(shell.core)};
  const P along = still.offset.x * ca + still.offset.y * sa;
  P psi = min_of(max_of(rim.psi_at(min_of(P(plain(wanted) * inverse(m)), P(rim.rho_max()))), P(0.0)), limit),
    slope(1.0);
  constexpr int kSteps = 8;  // from a few hundredths away, quadratically
  for (int i = 0; i < kSteps; ++i) {
    const DropletRay<P> ray = ray_at(psi, m, P(1.0));
    const P turning = P(1.0) - m * ray.cos_out * inverse(ray.cos_in);
    slope = m * ray.cos_out + turning * (ray.sin_deflection * along - ray.cos_deflection * still.offset.z);
    const P miss = reach_at_core(still, ray.sin_in, ray.sin_deflection, ray.cos_deflection, ca, sa) - plain(wanted);
    psi = min_of(max_of(P(psi - miss * inverse(slope)), P(0.0)), limit);
  }
  S exact(psi);
  if constexpr (ScalarTraits<S>::derivatives > 0) {
    const DropletRay<S> ray = ray_at(exact, ratio, S(1.0));
    const S off =
        reach_at_core(shell, ray.sin_in, ray.sin_deflection, ray.cos_deflection, r.cos_azimuth, r.sin_azimuth) - wanted;
    // theorem of implicit functions
    for (std::size_t j = 0; j < off.d.size(); ++j) exact.d[j] = -off.d[j] * inverse(slope);
  }
  r.rho = ray_at(exact, ratio, S(1.0)).rho_um;
  return r;
}

/// Whether the core is seen as a disc of its own: the sphere's rim passes beside it on all sides, and no place in it is
/// seen twice. With a core towards the light rays near the rim may turn back into it: reach then falls with the angle
/// of incidence.
inline bool core_has_disc(const BallOptics<double>& o, const RimTable& rim) {
  const NestedField<double>* shell = shell_in(o);
  if (!shell) return false;
  constexpr double kMargin = 1e-3;  // of the core's radius
  constexpr int kAzimuths = 32, kAngles = 48;
  NestedField<Pack> field{{Pack(shell->offset.x), Pack(shell->offset.y), Pack(shell->offset.z)}, Pack(shell->core)};
  const Pack ratio(o.sphere.ratio);
  alignas(64) double cs[kLanes], sn[kLanes];
  for (int first = 0; first < kAzimuths; first += kLanes) {
    for (int k = 0; k < kLanes; ++k) {
      const double angle = 2 * std::numbers::pi * (first + k) / kAzimuths;
      cs[k] = std::cos(angle), sn[k] = std::sin(angle);
    }
    const Pack c = Pack::load_aligned(cs), s = Pack::load_aligned(sn);
    Pack before(0.0);
    for (int i = kAngles; i >= 0; --i) {  // from the middle to the rim, closer together there
      const double t = static_cast<double>(i) / kAngles;
      const DropletRay<Pack> ray = ray_at(Pack(rim.psi_max() * (1 - t * t)), ratio, Pack(1.0));
      const Pack reach = reach_at_core(field, ray.sin_in, ray.sin_deflection, ray.cos_deflection, c, s);
      Pack x, y;
      place_at_core(field, reach, c, s, x, y);
      const auto within = x * x + y * y < Pack((1 + kMargin) * (1 + kMargin));
      if (i == 0 && !none(within)) return false;
      if (i < kAngles && !none(within && reach <= before)) return false;
      before = reach;
    }
  }
  return true;
}

}  // namespace birefit
