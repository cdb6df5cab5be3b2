#pragma once
// 2 x 2 matrices over any scalar, real and complex, and their exponential.

#include "core/scalar.h"

namespace birefit {

/// N: a scalar, or Complex of one.
template <class N>
struct Matrix2 {
  N a, b, c, d;  ///< [[a, b], [c, d]]
  static Matrix2 identity() { return {one(), N(), N(), one()}; }
  static N one() { return N(typename NumberTraits<N>::Real(1.0)); }
};
template <class S>
using Mat2 = Matrix2<Complex<S>>;

template <class N>
Matrix2<N> operator+(const Matrix2<N>& m, const Matrix2<N>& n) {
  return {m.a + n.a, m.b + n.b, m.c + n.c, m.d + n.d};
}
template <class N>
Matrix2<N> operator-(const Matrix2<N>& m, const Matrix2<N>& n) {
  return {m.a - n.a, m.b - n.b, m.c - n.c, m.d - n.d};
}
template <class N>
Matrix2<N> operator*(const Matrix2<N>& m, const Matrix2<N>& n) {
  return {m.a * n.a + m.b * n.c, m.a * n.b + m.b * n.d, m.c * n.a + m.d * n.c, m.c * n.b + m.d * n.d};
}
template <class S>
Mat2<S> operator*(const Matrix2<S>& m, const Mat2<S>& n) {
  return {m.a * n.a + m.b * n.c, m.a * n.b + m.b * n.d, m.c * n.a + m.d * n.c, m.c * n.b + m.d * n.d};
}
template <class S>
Mat2<S> operator*(const Mat2<S>& m, const Matrix2<S>& n) {
  return {n.a * m.a + n.c * m.b, n.b * m.a + n.d * m.b, n.a * m.c + n.c * m.d, n.b * m.c + n.d * m.d};
}
template <class N>
Matrix2<N> operator*(const N& s, const Matrix2<N>& m) {
  return {s * m.a, s * m.b, s * m.c, s * m.d};
}
template <class S>
Mat2<S> operator*(const S& s, const Mat2<S>& m) {
  return {s * m.a, s * m.b, s * m.c, s * m.d};
}
template <class N>
N determinant(const Matrix2<N>& m) {
  return m.a * m.d - m.b * m.c;
}
template <class N>
Matrix2<N> inverse(const Matrix2<N>& m) {
  const N f = Matrix2<N>::one() / determinant(m);
  return {f * m.d, -(f * m.b), -(f * m.c), f * m.a};
}
template <class N>
Matrix2<N> commutator(const Matrix2<N>& m, const Matrix2<N>& n) {
  return m * n - n * m;
}

/// cos(sqrt q) and sin(sqrt q)/sqrt q for complex q: both entire, so values and derivatives exist everywhere.
template <class S>
struct ComplexCosSinc {
  Complex<S> cos_sq, sinc_sq, sinc_slope;  ///< sinc_slope = d sinc_sq / dq
};
template <class S>
requires(ScalarTraits<S>::derivatives == 0) ComplexCosSinc<S> cos_sinc_sq(const Complex<S>& q) {
  using C = Complex<S>;
  const S modulus_sq = norm(q);
  const auto small = modulus_sq < S(0.01);
  // Series: the first term left out is below q^6/12! = 2e-15 of the value for |q| < 0.1.
  const auto horner = [&](std::initializer_list<double> coefficients) {
    C sum;
    for (double c : coefficients) sum = sum * q + C(S(c));
    return sum;
  };
  const C cos_series = horner({-1.0 / 3628800, 1.0 / 40320, -1.0 / 720, 1.0 / 24, -0.5, 1.0});
  const C sinc_series = horner({-1.0 / 39916800, 1.0 / 362880, -1.0 / 5040, 1.0 / 120, -1.0 / 6, 1.0});
  const C slope_series = horner({-5.0 / 39916800, 4.0 / 362880, -3.0 / 5040, 2.0 / 120, -1.0 / 6});
  // sqrt q by the branch that never divides by zero; cos and sinc are even, so any branch serves.
  const C safe{select(small, S(1.0), q.re), select(small, S(0.0), q.im)};
  const S modulus = sqrt(norm(safe));
  const S big = sqrt((modulus + sqrt(safe.re * safe.re)) * S(0.5));
  const S other = safe.im / (big * S(2.0));
  const auto positive = safe.re >= S(0.0);
  const C root{select(positive, big, other), select(positive, other, big)};
  S sx, cx;
  sin_cos(root.re, sx, cx);
  const S ey = exp(root.im), iy = S(1.0) / ey;
  const S ch = (ey + iy) * S(0.5), sh = (ey - iy) * S(0.5);
  const C cosine{cx * ch, -(sx * sh)};
  const C sine{sx * ch, cx * sh};
  const C sinc = sine / root;
  const C slope = (cosine - sinc) / (safe + safe);
  const auto pick = [&](const C& a, const C& b) { return C{select(small, a.re, b.re), select(small, a.im, b.im)}; };
  return {pick(cos_series, cosine), pick(sinc_series, sinc), pick(slope_series, slope)};
}
template <class B, int N>
ComplexCosSinc<Dual<B, N>> cos_sinc_sq(const Complex<Dual<B, N>>& q) {
  const ComplexCosSinc<B> f = cos_sinc_sq(Complex<B>{q.re.value, q.im.value});
  const auto chain = [&](const Complex<B>& value, const Complex<B>& slope) {
    Complex<Dual<B, N>> r;
    r.re.value = value.re, r.im.value = value.im;
    for (int i = 0; i < N; ++i) {
      const Complex<B> d = slope * Complex<B>{q.re.d[i], q.im.d[i]};
      r.re.d[i] = d.re, r.im.d[i] = d.im;
    }
    return r;
  };
  // The second derivative of sinc is not needed: only values of cos_sq and sinc_sq leave this function.
  return {chain(f.cos_sq, B(-0.5) * f.sinc_sq), chain(f.sinc_sq, f.sinc_slope), {}};
}

/// exp of a 2 x 2 matrix, exact: e^{t/2} (cos sqrt(q) + sinc sqrt(q) (M - t/2)), t = trace, q = det(M - t/2).
template <class S>
Mat2<S> exp(const Mat2<S>& m) {
  const Complex<S> half = S(0.5) * (m.a + m.d);
  const Mat2<S> free{m.a - half, m.b, m.c, m.d - half};
  const ComplexCosSinc<S> f = cos_sinc_sq(determinant(free));
  const Complex<S> scale = exp(half);
  const Complex<S> c = scale * f.cos_sq, s = scale * f.sinc_sq;
  return {c + s * free.a, s * free.b, s * free.c, c + s * free.d};
}

/// A lossless retarder without its common phase: w + i (x sx + y sy + z sz) with the Pauli matrices, a unit quaternion.
template <class S>
struct Su2 {
  S w, x, y, z;
  static Su2 identity() { return {S(1.0), S(0.0), S(0.0), S(0.0)}; }
};
/// a after b. (i u.s)(i v.s) = -u.v - i (u x v).s
template <class S>
BIREFIT_INLINE Su2<S> operator*(const Su2<S>& a, const Su2<S>& b) {
  return {a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w - (a.y * b.z - a.z * b.y),
          a.w * b.y + a.y * b.w - (a.z * b.x - a.x * b.z), a.w * b.z + a.z * b.w - (a.x * b.y - a.y * b.x)};
}
/// exp(i v.s)
template <class S>
BIREFIT_INLINE Su2<S> su2_exp(const Vec3<S>& v) {
  const CosSinc<S> f = cos_sinc_sq(dot(v, v));
  return {f.cos_sq, f.sinc_sq * v.x, f.sinc_sq * v.y, f.sinc_sq * v.z};
}
/// As a matrix: [[w + i z, y + i x], [-y + i x, w - i z]].
template <class S>
BIREFIT_INLINE Mat2<S> matrix(const Su2<S>& u) {
  return {{u.w, u.z}, {u.y, u.x}, {-u.y, u.x}, {u.w, -u.z}};
}

}  // namespace birefit
