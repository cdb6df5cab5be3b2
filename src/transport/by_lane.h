#pragma once
// For methods that branch ray by ray: scalars with lanes are taken apart, worked on as plain numbers and put together.

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>

#include "transport/method.h"

namespace birefit {

template <class S>
inline constexpr int kRaysOf = std::is_same_v<S, double> ? 1 : kLanes;

// One lane of a value, as plain numbers.
template <class B, int N>
Dual<double, N> lane_of(const Dual<B, N>& x, int l) {
  Dual<double, N> r(lane(x.value, l));
  for (int i = 0; i < N; ++i) r.d[i] = lane(x.d[i], l);
  return r;
}
template <class B, int N>
Taylor<double, N> lane_of(const Taylor<B, N>& x, int l) {
  Taylor<double, N> r = Taylor<double, N>::of_order(x.order);
  for (int k = 0; k <= r.order; ++k) r.c[k] = lane(x.c[k], l);
  return r;
}
inline double lane_of(double x, int) { return x; }
inline double lane_of(const Pack& x, int l) { return lane(x, l); }
template <class T>
auto lane_of(const OpticalPoint<T>& p, int l) -> OpticalPoint<decltype(lane_of(p.ordinary, l))> {
  return {{lane_of(p.axis.x, l), lane_of(p.axis.y, l), lane_of(p.axis.z, l)},
          lane_of(p.ordinary, l),
          lane_of(p.extraordinary, l),
          lane_of(p.ordinary_im, l),
          lane_of(p.extraordinary_im, l),
          lane_of(p.depth_slope_um, l)};
}
template <class S>
S from_lanes(const std::array<double, kLanes>& values) {
  if constexpr (std::is_same_v<S, double>)
    return values[0];
  else
    return S::load_unaligned(values.data());
}
template <class S>
Mat2<S> from_lanes(const std::array<Mat2<double>, kLanes>& m) {
  std::array<double, kLanes> parts[8] = {};
  for (int l = 0; l < kRaysOf<S>; ++l) {
    const double entries[8] = {m[l].a.re, m[l].a.im, m[l].b.re, m[l].b.im, m[l].c.re, m[l].c.im, m[l].d.re, m[l].d.im};
    for (int k = 0; k < 8; ++k) parts[k][l] = entries[k];
  }
  const auto z = [&](int k) { return Complex<S>{from_lanes<S>(parts[k]), from_lanes<S>(parts[k + 1])}; };
  return {z(0), z(2), z(4), z(6)};
}

/// Product over the mesh of step(medium, lane, ray of that lane), medium = prepare(from, to) with members `entry` and
/// `exit` (OpticalPoint<S>), both generic lambdas, so that they need not compile where they cannot run; steps of the
/// medium at its breaks included. Values only: std::logic_error for scalars with derivatives.
template <class S, class Prepare, class Step>
Mat2<S> transfer_by_lanes(const MethodInfo& info, const Column<S>& column, const Ray<S>& ray, const Mesh& mesh,
                          const Prepare& prepare, const Step& step) {
  if constexpr (!kHasSeries<S>) {
    throw std::logic_error(std::string(info.name) + " has no derivatives");
  } else {
    std::array<Ray<double>, kLanes> rays;
    std::array<Mat2<double>, kLanes> total;
    for (int l = 0; l < kRaysOf<S>; ++l) {
      rays[l] = {lane(ray.k0_per_um, l), lane(ray.kx, l), lane(ray.ky, l), ray.continuity};
      total[l] = Mat2<double>::identity();
    }
    const bool steps_in_medium = column.jumps && ray.continuity == Continuity::e_and_h;
    OpticalPoint<S> before;
    for (std::size_t i = 0; i + 1 < mesh.size(); ++i) {
      const auto medium = prepare(mesh[i], mesh[i + 1]);
      const bool jump =
          steps_in_medium && i > 0 && std::binary_search(column.breaks.begin(), column.breaks.end(), mesh[i]);
      for (int l = 0; l < kRaysOf<S>; ++l) {
        if (jump) {
          const OpticalPoint<double> p = lane_of(before, l), q = lane_of(medium.entry, l);
          const double kx = rays[l].kx, ky = rays[l].ky;
          total[l] = step_factor(one_way(p, kx, ky).admittance, one_way(p, kx, ky, -1.0).admittance,
                                 one_way(q, kx, ky).admittance) *
                     total[l];
        }
        total[l] = step(medium, l, rays[l]) * total[l];
      }
      before = medium.exit;
    }
    return from_lanes<S>(total);
  }
}

/// The retarder nearest to a transfer at normal incidence without losses, sign undetermined: on the flux-normalised
/// field N^(1/2) E_t (e_and_h) or on E_t (e_only).
template <class S>
Su2<S> nearest_retarder(const Column<S>& column, const Ray<S>& ray, Mat2<S> t) {
  if (ray.continuity == Continuity::e_and_h) {
    const auto root = [&](double u) {  // N is real and symmetric: (N + sqrt(det) I)/sqrt(trace + 2 sqrt(det))
      OpticalPoint<S> p;
      const double at[1] = {u};
      column.sample(at, &p);
      const Matrix2<S> n = one_way_lossless(p, S(0.0), S(0.0)).index;
      const S s = sqrt(determinant(n)), f = S(1.0) / sqrt(n.a + n.d + S(2.0) * s);
      return Matrix2<S>{f * (n.a + s), f * n.b, f * n.c, f * (n.d + s)};
    };
    t = root(1) * (t * inverse(root(0)));
  }
  // A direction of sqrt(det): det + |det|, or i times it where that may vanish.
  const Complex<S> det = determinant(t);
  const S modulus = sqrt(norm(det));
  const auto left = plain(det.re) < PlainOf<S>(0.0);
  const Complex<S> half{select(left, det.im, det.re + modulus), select(left, modulus - det.re, det.im)};
  const Complex<S> phase = (S(1.0) / sqrt(norm(half))) * conj(half);
  const Complex<S> a = phase * t.a, b = phase * t.b, c = phase * t.c, d = phase * t.d;
  const S w = a.re + d.re, x = b.im + c.im, y = b.re - c.re, z = a.im - d.im;
  const S f = S(1.0) / sqrt(w * w + x * x + y * y + z * z);
  return {f * w, f * x, f * y, f * z};
}

}  // namespace birefit
