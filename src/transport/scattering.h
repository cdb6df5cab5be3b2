#pragma once
// Maxwell's equations in a stratified medium for (E_x, E_y, H_x, H_y), and scattering matrices of slices between waves
// of the host.

#include <array>
#include <cmath>

#include "core/jones.h"
#include "medium/column.h"

namespace birefit {

/// 4 x 4 in 2 x 2 blocks [[ee, eh], [he, hh]].
template <class S>
struct Blocks4 {
  Mat2<S> ee, eh, he, hh;
  static Blocks4 identity() { return {Mat2<S>::identity(), Mat2<S>(), Mat2<S>(), Mat2<S>::identity()}; }
};
template <class S>
Blocks4<S> operator+(const Blocks4<S>& m, const Blocks4<S>& n) {
  return {m.ee + n.ee, m.eh + n.eh, m.he + n.he, m.hh + n.hh};
}
template <class S>
Blocks4<S> operator-(const Blocks4<S>& m, const Blocks4<S>& n) {
  return {m.ee - n.ee, m.eh - n.eh, m.he - n.he, m.hh - n.hh};
}
template <class S>
Blocks4<S> operator*(const Blocks4<S>& m, const Blocks4<S>& n) {
  return {m.ee * n.ee + m.eh * n.he, m.ee * n.eh + m.eh * n.hh, m.he * n.ee + m.hh * n.he, m.he * n.eh + m.hh * n.hh};
}
template <class S>
Blocks4<S> scaled(const S& f, const Blocks4<S>& m) {
  return {f * m.ee, f * m.eh, f * m.he, f * m.hh};
}

/// i k0 D dz/du of d(E, H)/du. From k x E = H and k x H = -eps E (k in units of k0, k_z = -i d/dz / k0) with
///   E_z = (k_y H_x - k_x H_y - eps_zx E_x - eps_zy E_y)/eps_zz,   H_z = k_x E_y - k_y E_x:
///   q E_x = H_y + k_x E_z,  q E_y = -H_x + k_y E_z,  q H_x = k_x H_z - (eps E)_y,  q H_y = k_y H_z + (eps E)_x.
template <class S>
Blocks4<S> berreman_generator(const OpticalPoint<S>& p, const S& k0, const S& kx, const S& ky) {
  using C = Complex<S>;
  const C eo{p.ordinary, p.ordinary_im}, de = C{p.extraordinary, p.extraordinary_im} - eo;
  const S ax = p.axis.x, ay = p.axis.y, az = p.axis.z;
  const C xx = eo + (ax * ax) * de, yy = eo + (ay * ay) * de, zz = eo + (az * az) * de;
  const C xy = (ax * ay) * de, xz = (ax * az) * de, yz = (ay * az) * de;
  const C one_zz = C(S(1.0)) / zz;
  // E_z = ex E_x + ey E_y + hx H_x + hy H_y
  const C ex = -(xz * one_zz), ey = -(yz * one_zz), hx = ky * one_zz, hy = -(kx * one_zz);
  Blocks4<S> d;
  d.ee = {kx * ex, kx * ey, ky * ex, ky * ey};
  d.eh = {kx * hx, C(S(1.0)) + kx * hy, ky * hx - C(S(1.0)), ky * hy};
  d.he = {-(C(kx * ky) + xy + yz * ex), C(kx * kx) - yy - yz * ey, xx + xz * ex - C(ky * ky),
          C(kx * ky) + xy + xz * ey};
  d.hh = {-(yz * hx), -(yz * hy), xz * hx, xz * hy};
  const C f(S(0.0), k0 * p.depth_slope_um);
  return {f * d.ee, f * d.eh, f * d.he, f * d.hh};
}

/// A slice between two half spaces of the host, amplitudes as tangential E: light from the front is transmitted by
/// `forward` and reflected by `front`, light from the back by `backward` and `back`.
template <class S>
struct Scattering {
  Mat2<S> forward, front, backward, back;
  static Scattering nothing() { return {Mat2<S>::identity(), Mat2<S>(), Mat2<S>::identity(), Mat2<S>()}; }
};

/// First a, then b: Redheffer's star product.
template <class S>
Scattering<S> joined(const Scattering<S>& a, const Scattering<S>& b) {
  const Mat2<S> one = Mat2<S>::identity();
  const Mat2<S> there = inverse(one - a.back * b.front), here = inverse(one - b.front * a.back);
  return {b.forward * there * a.forward, a.front + a.backward * (b.front * (there * a.forward)),
          a.backward * (here * b.backward), b.back + b.forward * (a.back * (here * b.backward))};
}

/// The slice whose transfer of (E, H) is exp(omega). exp by its Taylor series of a 2^-k part of omega, then k joinings
/// of the part with itself: growing waves never multiply, however thick the slice.
template <class S>
Scattering<S> scattering_of_exponential(const Blocks4<S>& omega, const Matrix2<S>& host_admittance) {
  double size = 0;
  for (const Mat2<S>* m : {&omega.ee, &omega.eh, &omega.he, &omega.hh})
    for (const Complex<S>* z : {&m->a, &m->b, &m->c, &m->d}) {
      const auto modulus = plain(z->re) * plain(z->re) + plain(z->im) * plain(z->im);
      size += std::sqrt(largest(modulus));
    }
  int halvings = 0;
  while (std::ldexp(size, -halvings) > 1 && halvings < 60) ++halvings;
  const Blocks4<S> part = scaled(S(std::ldexp(1.0, -halvings)), omega);
  constexpr int kDegree = 16;  // 1/17! = 3e-15 of a part of size 1
  Blocks4<S> e = Blocks4<S>::identity();
  for (int k = kDegree; k >= 1; --k) e = Blocks4<S>::identity() + scaled(S(1.0 / k), part * e);
  // Host waves: H = +-Y E. (f, b) = 1/2 [[1, 1/Y], [1, -1/Y]] (E, H).
  const Matrix2<S> y = host_admittance, z = inverse(y);
  const Mat2<S> ef = e.ee + e.eh * y, eb = e.ee - e.eh * y, hf = z * (e.he + e.hh * y), hb = z * (e.he - e.hh * y);
  const S half(0.5);
  const Mat2<S> ff = half * (ef + hf), fb = half * (eb + hb), bf = half * (ef - hf), bb = half * (eb - hb);
  const Mat2<S> back_through = inverse(bb);
  Scattering<S> s;
  s.backward = back_through;
  s.front = S(-1.0) * (back_through * bf);
  s.back = fb * back_through;
  s.forward = ff + fb * s.front;
  for (int i = 0; i < halvings; ++i) s = joined(s, s);
  return s;
}

}  // namespace birefit
