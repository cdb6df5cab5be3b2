#pragma once
// The one-way operator of a uniaxial medium in closed form, with no degenerate case, and what follows from it.
//
//   dE_t/dz = i k0 N E_t,   H_t = Y E_t          forward waves with tangential wavevector kappa (units of k0)
//
// from Steinberg TOG 2020 (eqs. 70-82) rewritten for the tangential field: N = q_o I + (c/d) f g^T, a rank-one update
// whose eigenvalues are the normal components q_o and q_e. Nothing divides by the angle between axis and wavevector.
// D [I; Y] = [I; Y] N holds for the Berreman matrix D; a law test checks it for random media.

#include "birefit/demand.h"
#include "core/jones.h"
#include "medium/column.h"

namespace birefit {

/// What a transport keeps continuous where the medium changes.
enum class Continuity {
  e_and_h,  ///< E and H; only the backward wave is dropped: flux is conserved
  e_only,   ///< tangential E alone: the source paper's transport
};
inline Continuity continuity_of(const Demand& demand) {
  return demand.ceiling == Ceiling::e_only ? Continuity::e_only : Continuity::e_and_h;
}

/// N = Complex<S>, or the scalar S itself in a lossless medium without total reflection: a quarter of the arithmetic.
template <class N>
struct OneWay {
  Matrix2<N> index;       ///< N
  Matrix2<N> admittance;  ///< Y
};

/// Admittance of an isotropic medium for forward waves, q its normal component.
template <class N, class S = typename NumberTraits<N>::Real>
Matrix2<N> isotropic_admittance(const N& permittivity, const N& q, const S& kx, const S& ky) {
  const N f = Matrix2<N>::one() / q;
  const N xy(kx * ky);
  return {-(f * xy), -(f * (permittivity - N(kx * kx))), f * (permittivity - N(ky * ky)), f * xy};
}

/// `direction` +1: forward pair (N, Y); -1: the backward pair (signs of q_o and of the extraordinary root flipped).
template <class N, class S = typename NumberTraits<N>::Real>
OneWay<N> one_way_of(const Vec3<S>& axis, const N& eo, const N& ee, const S& kx, const S& ky, double direction) {
  const N de = ee - eo;
  const S ax = axis.x, ay = axis.y, az = axis.z;
  const S ak = ax * kx + ay * ky, kk = kx * kx + ky * ky;
  const N qo = S(direction) * sqrt(eo - N(kk));
  const N A = eo + (az * az) * de;
  const N B = (az * ak) * de;
  const N Cc = kk * eo + (ak * ak) * de - eo * ee;
  const N qm = (-B - S(direction) * sqrt(B * B - A * Cc)) / A;
  const N c = de / (A * (qo - qm));
  // u = axis x (kx, ky, qo); u.u without conjugation
  const N ux = ay * qo - N(az * ky), uy = N(az * kx) - ax * qo, uz = N(ax * ky - ay * kx);
  const N u2 = ux * ux + uy * uy + uz * uz;
  const N aw = N(ak) + az * qo;
  const N d = qo - az * (c * (ky * ux - kx * uy));
  const N shift = az * (c * u2);
  const N fx = ax * eo - kx * (aw + shift), fy = ay * eo - ky * (aw + shift);
  const N gx = -uy, gy = ux;
  const N cd = c / d;
  OneWay<N> r;
  r.index = {qo + cd * fx * gx, cd * fx * gy, cd * fy * gx, qo + cd * fy * gy};
  const N az_qo = N(az) / qo;
  const N hx = -(eo * (N(ay) + ky * az_qo)), hy = eo * (N(ax) + kx * az_qo);
  const Matrix2<N> iso = isotropic_admittance(eo, qo, kx, ky);
  r.admittance = {iso.a + cd * hx * gx, iso.b + cd * hx * gy, iso.c + cd * hy * gx, iso.d + cd * hy * gy};
  return r;
}
template <class S>
OneWay<Complex<S>> one_way(const OpticalPoint<S>& p, const S& kx, const S& ky, double direction = 1.0) {
  return one_way_of(p.axis, Complex<S>{p.ordinary, p.ordinary_im}, Complex<S>{p.extraordinary, p.extraordinary_im}, kx,
                    ky, direction);
}
template <class S>
OneWay<S> one_way_lossless(const OpticalPoint<S>& p, const S& kx, const S& ky, double direction = 1.0) {
  return one_way_of(p.axis, p.ordinary, p.extraordinary, kx, ky, direction);
}

/// Factor on E_t when light steps from medium `before` into `after`, backward waves dropped.
template <class N>
Matrix2<N> step_factor(const Matrix2<N>& before_forward, const Matrix2<N>& before_backward,
                       const Matrix2<N>& after_forward) {
  return inverse(after_forward - before_backward) * (before_forward - before_backward);
}

/// d(generator)/du of E_t at one point, i.e. dE_t/du = generator E_t; `lossless`: imaginary parts are not looked at.
template <class S>
Mat2<S> generator_e_only(const OpticalPoint<S>& p, const S& k0, const S& kx, const S& ky, bool lossless) {
  const S k = k0 * p.depth_slope_um;
  if (!lossless) return Complex<S>(S(0.0), k) * one_way(p, kx, ky).index;
  const Matrix2<S> n = k * one_way_lossless(p, kx, ky).index;
  return {{S(0.0), n.a}, {S(0.0), n.b}, {S(0.0), n.c}, {S(0.0), n.d}};
}

template <class S>
Mat2<S> part(const Mat2<Slope<S>>& m, bool slope) {
  const auto of = [&](const Complex<Slope<S>>& z) {
    return slope ? Complex<S>{z.re.d[0], z.im.d[0]} : Complex<S>{z.re.value, z.im.value};
  };
  return {of(m.a), of(m.b), of(m.c), of(m.d)};
}
template <class S>
Matrix2<S> part(const Matrix2<Slope<S>>& m, bool slope) {
  const auto of = [&](const Slope<S>& x) { return slope ? x.d[0] : x.value; };
  return {of(m.a), of(m.b), of(m.c), of(m.d)};
}
/// The point without its slopes.
template <class S>
OpticalPoint<S> without_slope(const OpticalPoint<Slope<S>>& p) {
  return {{p.axis.x.value, p.axis.y.value, p.axis.z.value},
          p.ordinary.value,
          p.extraordinary.value,
          p.ordinary_im.value,
          p.extraordinary_im.value,
          p.depth_slope_um.value};
}

/// E and H continuous: [i k0 N - (Y - Y-)^-1 dY/dz] du/dz.
template <class S>
Mat2<S> generator_e_and_h(const OpticalPoint<Slope<S>>& p, const S& k0, const S& kx, const S& ky, bool lossless) {
  const OpticalPoint<S> q = without_slope(p);
  const S k = k0 * q.depth_slope_um;
  if (lossless) {
    const OneWay<Slope<S>> forward = one_way_lossless<Slope<S>>(p, Slope<S>(kx), Slope<S>(ky));
    const Matrix2<S> backward = one_way_lossless(q, kx, ky, -1.0).admittance;
    const Matrix2<S> x = inverse(part(forward.admittance, false) - backward) * part(forward.admittance, true);
    const Matrix2<S> n = k * part(forward.index, false);
    return {{-x.a, n.a}, {-x.b, n.b}, {-x.c, n.c}, {-x.d, n.d}};
  }
  const OneWay<Complex<Slope<S>>> forward = one_way<Slope<S>>(p, Slope<S>(kx), Slope<S>(ky));
  const Mat2<S> y = part(forward.admittance, false), dy = part(forward.admittance, true);
  const Mat2<S> backward = one_way(q, kx, ky, -1.0).admittance;
  return Complex<S>(S(0.0), k) * part(forward.index, false) - inverse(y - backward) * dy;
}

// ---- normal incidence, lossless -------------------------------------------------------------------------------------

/// Generator i v.s of the flux-normalised field a = N^(1/2) E_t without its common phase (docs/methods.md, "Normal
/// incidence"): v_x, v_z from N = n_o + g a_t a_t^T, g = eo de/((eo + de az^2)(n_o + n_eff)); v_y is what keeping H
/// continuous adds to a turning axis: a_t x a_t' (n_eff - n_o)^2 / (2 sqrt(n_o n_eff)(sqrt n_o + sqrt n_eff)^2 a_t^2).
template <class S>
BIREFIT_INLINE Vec3<S> su2_generator(const OpticalPoint<S>& p, const S& k0) {
  const S de = p.extraordinary - p.ordinary;
  const S denominator = p.ordinary + de * p.axis.z * p.axis.z;
  const S inverse_d = inverse(denominator);
  const S n_o = root(p.ordinary);
  const S n_eff = n_o * root(p.extraordinary * inverse_d);
  const S half = 0.5 * k0 * p.depth_slope_um * p.ordinary * de * inverse_d * inverse(n_o + n_eff);
  return {half * (2.0 * p.axis.x * p.axis.y), S(0.0), half * (p.axis.x * p.axis.x - p.axis.y * p.axis.y)};
}
template <class S>
BIREFIT_INLINE Vec3<S> su2_generator_e_and_h(const OpticalPoint<Slope<S>>& p, const S& k0) {
  const S ax = p.axis.x.value, ay = p.axis.y.value, az = p.axis.z.value;
  const S eo = p.ordinary.value, ee = p.extraordinary.value;
  const S de = ee - eo;
  const S inverse_d = inverse(eo + de * az * az);
  const S n_o = root(eo);
  const S n_eff = n_o * root(ee * inverse_d);
  const S inverse_sum = inverse(n_o + n_eff);
  const S g = eo * de * inverse_d * inverse_sum;
  const S half = 0.5 * k0 * p.depth_slope_um.value * g;
  const S cross = ax * p.axis.y.d[0] - ay * p.axis.x.d[0];
  // (sqrt n_eff - sqrt n_o)^2 / (2 sqrt(n_o n_eff)) = (1 - x^2)^(-1/2) - 1, x = (n_eff - n_o)/(n_eff + n_o) = g
  // a_t^2/sum, by its binomial series: x < 0.25 for every nematic and most crystals, next term 0.23 x^12 < 1e-8 of it.
  const S at2 = ax * ax + ay * ay, x_over = g * inverse_sum;
  const S y = square(x_over * at2);
  const S series = 0.5 * (1.0 + y * (0.75 + y * (0.625 + y * (0.546875 + y * (0.4921875 + y * 0.451171875)))));
  const S turn = x_over * x_over * at2 * cross * series;
  return {half * (2.0 * ax * ay), turn, half * (ax * ax - ay * ay)};
}
/// n_eff - n_o seen by a ray along z: the retardance per length, without cancellation at small birefringence.
template <class S>
BIREFIT_INLINE S retardance_per_length(const OpticalPoint<S>& p) {
  const S de = p.extraordinary - p.ordinary;
  const S denominator = p.ordinary + de * p.axis.z * p.axis.z;
  const S n_o = root(p.ordinary);
  const S n_eff = n_o * sqrt(p.extraordinary / denominator);
  return p.ordinary * de * (p.axis.x * p.axis.x + p.axis.y * p.axis.y) / (denominator * (n_o + n_eff));
}

}  // namespace birefit
