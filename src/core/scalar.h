#pragma once
// The numbers every kernel is written for: double, Pack (one ray per SIMD lane) and Dual<Pack, N> (first derivatives
// by N parameters, over lanes). Kernels are templates on the scalar and use only what this header offers, so tests may
// also run them with ceres::Jet, the oracle for derivatives.

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include <xsimd/xsimd.hpp>

// Kernels are long chains of these small functions over wide values; a compiler that leaves one call in the chain
// passes 64-byte lanes through memory, which costs more than the arithmetic. Not under the sanitizers, whose
// instructions would make such a chain take minutes to compile.
#if defined(__GNUC__) && !defined(__SANITIZE_ADDRESS__)
#define BIREFIT_INLINE [[gnu::always_inline]] inline
#define BIREFIT_INLINE_LAMBDA __attribute__((always_inline))  // after the parameters
#else
#define BIREFIT_INLINE inline
#define BIREFIT_INLINE_LAMBDA
#endif

namespace birefit {

/// One ray per SIMD lane: 8 doubles with AVX-512, 4 with AVX2, 2 with SSE2 or NEON.
using Pack = xsimd::batch<double>;
inline constexpr int kLanes = static_cast<int>(Pack::size);

using std::acos;
using std::asin;
using std::asinh;
using std::atan2;
using std::cos;
using std::cosh;
using std::erfc;
using std::exp;
using std::fabs;
using std::log;
using std::sin;
using std::sinh;
using std::sqrt;
using std::tan;

/// The plain number type under a scalar: double for double, Pack for Pack and Dual<Pack, N>.
template <class S>
struct ScalarTraits {
  using Plain = S;
  static constexpr int derivatives = 0;
};
template <class S>
using PlainOf = typename ScalarTraits<S>::Plain;

/// Value without derivatives.
BIREFIT_INLINE double plain(double x) { return x; }
BIREFIT_INLINE Pack plain(const Pack& x) { return x; }

/// lane-wise condition ? a : b. Both sides are computed: never for "x < eps", only for piecewise definitions.
BIREFIT_INLINE double select(bool condition, double a, double b) { return condition ? a : b; }
BIREFIT_INLINE Pack select(const Pack::batch_bool_type& condition, const Pack& a, const Pack& b) {
  return xsimd::select(condition, a, b);
}
/// Of all lanes of a condition.
BIREFIT_INLINE bool none(bool condition) { return !condition; }
BIREFIT_INLINE bool none(const Pack::batch_bool_type& condition) { return xsimd::none(condition); }
BIREFIT_INLINE bool all(bool condition) { return condition; }
BIREFIT_INLINE bool all(const Pack::batch_bool_type& condition) { return xsimd::all(condition); }
BIREFIT_INLINE double min_of(double a, double b) { return a < b ? a : b; }
BIREFIT_INLINE double max_of(double a, double b) { return a > b ? a : b; }
BIREFIT_INLINE Pack min_of(const Pack& a, const Pack& b) { return xsimd::min(a, b); }
BIREFIT_INLINE Pack max_of(const Pack& a, const Pack& b) { return xsimd::max(a, b); }
BIREFIT_INLINE double largest(double x) { return x; }
BIREFIT_INLINE double largest(const Pack& x) {
#ifdef __AVX512F__
  return _mm512_reduce_max_pd(x);
#endif
  alignas(64) double lanes[kLanes];
  x.store_aligned(lanes);
  double result = lanes[0];
  for (int i = 1; i < kLanes; ++i) result = lanes[i] > result ? lanes[i] : result;
  return result;
}
BIREFIT_INLINE double smallest(double x) { return x; }
BIREFIT_INLINE double smallest(const Pack& x) { return -largest(-x); }
BIREFIT_INLINE double sum_of_lanes(double x) { return x; }
BIREFIT_INLINE double sum_of_lanes(const Pack& x) {
#ifdef __AVX512F__
  return _mm512_reduce_add_pd(x);
#endif
  alignas(64) double lanes[kLanes];
  x.store_aligned(lanes);
  double result = lanes[0];
  for (int i = 1; i < kLanes; ++i) result += lanes[i];
  return result;
}
BIREFIT_INLINE double lane(double x, int) { return x; }
BIREFIT_INLINE double lane(const Pack& x, int i) { return x.get(static_cast<std::size_t>(i)); }
BIREFIT_INLINE void sin_cos(double x, double& s, double& c) {
  s = std::sin(x);
  c = std::cos(x);
}
#if defined(__AVX512F__)
#define BIREFIT_FUSED
/// a b + c rounded once (xsimd 8 rounds twice on some of these machines).
BIREFIT_INLINE Pack fused(const Pack& a, const Pack& b, const Pack& c) { return _mm512_fmadd_pd(a, b, c); }
#elif defined(__AVX2__) && defined(__FMA__)
#define BIREFIT_FUSED
BIREFIT_INLINE Pack fused(const Pack& a, const Pack& b, const Pack& c) { return _mm256_fmadd_pd(a, b, c); }
#endif
BIREFIT_INLINE void sin_cos(const Pack& x, Pack& s, Pack& c) {
#ifdef BIREFIT_FUSED
  // r = x - n pi/2: with fused multiply and add the first step is exact and the second leaves rounding and n 1.5e-33,
  // so that one reduction serves any phase; a general library tests for large arguments first and is not inlined.
  constexpr double kMostPhase = 1e9;
  if (xsimd::any(xsimd::abs(x) > Pack(kMostPhase))) [[unlikely]] {
    const auto both = xsimd::sincos(x);
    s = both.first;
    c = both.second;
    return;
  }
  constexpr double kToInteger = 6755399441055744.0;  // 1.5 * 2^52: the sum's last bits are the integer
  const Pack shifted = fused(x, Pack(0.63661977236758134308), Pack(kToInteger)), n = shifted - Pack(kToInteger);
  const Pack r = fused(n, Pack(-6.123233995736766e-17), fused(n, Pack(-1.5707963267948966), x)), z = r * r;
  // Minimax polynomials on [-pi/4, pi/4]: S. L. Moshier, Cephes Mathematical Library, sin.c.
  const auto step = [&](const Pack& p, double a) { return fused(p, z, Pack(a)); };
  const Pack p = step(
      step(step(step(step(Pack(1.58962301576546568060e-10), -2.50507477628578072866e-8), 2.75573136213857245213e-6),
                -1.98412698295895385996e-4),
           8.33333333332211858878e-3),
      -1.66666666666666307295e-1);
  const Pack q = step(
      step(step(step(step(Pack(-1.13585365213876817300e-11), 2.08757008419747316778e-9), -2.75573141792967388112e-7),
                2.48015872888517045348e-5),
           -1.38888888888730564116e-3),
      4.16666666666665929218e-2);
  const Pack sine = fused(r * z, p, r), cosine = fused(z * z, q, fused(Pack(-0.5), z, Pack(1.0)));
  // Quadrant n mod 4: odd ones exchange the two, the second and third turn the sine's sign, the first and second the
  // cosine's.
  using Bits = xsimd::batch<std::int64_t>;
  const Bits quadrant = xsimd::bitwise_cast<Bits>(shifted), one(1), two(2);
  const auto exchange = xsimd::bool_cast((quadrant & one) == one);
  const auto sign = [&](const Bits& k) { return xsimd::bitwise_cast<Pack>((k & two) << 62); };
  s = xsimd::select(exchange, cosine, sine) ^ sign(quadrant);
  c = xsimd::select(exchange, sine, cosine) ^ sign(quadrant + one);
#else
  const auto both = xsimd::sincos(x);
  s = both.first;
  c = both.second;
#endif
}
template <class T>
T square(const T& x) {
  return x * x;
}

// 1/x, sqrt x, 1/sqrt x for the hot kernels. AVX-512's own double division and root cost about as much for eight lanes
// as eight scalar ones do; its 14-bit estimates with two Newton steps need neither and are exact to
// rounding (tests/laws/scalar_test.cc).
// Arguments must be positive and normal (inverse: any sign).
BIREFIT_INLINE double inverse(double x) { return 1 / x; }
BIREFIT_INLINE double root(double x) { return std::sqrt(x); }
BIREFIT_INLINE double inverse_root(double x) { return 1 / std::sqrt(x); }
#ifdef __AVX512F__
BIREFIT_INLINE Pack inverse(const Pack& x) {
  const __m512d one = _mm512_set1_pd(1.0);
  __m512d y = _mm512_rcp14_pd(x);
  y = _mm512_fmadd_pd(y, _mm512_fnmadd_pd(x, y, one), y);
  return _mm512_fmadd_pd(y, _mm512_fnmadd_pd(x, y, one), y);
}
BIREFIT_INLINE Pack inverse_root(const Pack& x) {
  const __m512d half = _mm512_set1_pd(0.5);
  __m512d y = _mm512_rsqrt14_pd(x);
  const __m512d hx = _mm512_mul_pd(half, x);
  y = _mm512_fmadd_pd(y, _mm512_fnmadd_pd(_mm512_mul_pd(hx, y), y, half), y);
  return _mm512_fmadd_pd(y, _mm512_fnmadd_pd(_mm512_mul_pd(hx, y), y, half), y);
}
BIREFIT_INLINE Pack root(const Pack& x) {
  const __m512d y = inverse_root(x);
  // One more correction on the root itself: s + (x - s^2) y / 2.
  const __m512d s = _mm512_mul_pd(x, y);
  return _mm512_fmadd_pd(_mm512_fnmadd_pd(s, s, x), _mm512_mul_pd(_mm512_set1_pd(0.5), y), s);
}
#else
BIREFIT_INLINE Pack inverse(const Pack& x) { return Pack(1.0) / x; }
BIREFIT_INLINE Pack root(const Pack& x) { return xsimd::sqrt(x); }
BIREFIT_INLINE Pack inverse_root(const Pack& x) { return Pack(1.0) / xsimd::sqrt(x); }
#endif

template <class B, int N>
struct Dual;
/// Whether T is B, or what B has derivatives over.
template <class T, class B>
inline constexpr bool is_under = std::is_same_v<T, B>;
template <class T, class B, int N>
inline constexpr bool is_under<T, Dual<B, N>> = std::is_same_v<T, Dual<B, N>> || is_under<T, B>;

/// Forward-mode derivative number: value and N partial derivatives, over any base scalar (nests).
template <class B, int N>
struct Dual {
  B value;
  std::array<B, N> d;

  BIREFIT_INLINE Dual() : value(B(0.0)) {
    for (B& x : d) x = B(0.0);
  }
  BIREFIT_INLINE Dual(const B& v) : value(v) {  // NOLINT: constants mix freely with duals
    for (B& x : d) x = B(0.0);
  }
  template <class T>
  requires(std::is_arithmetic_v<T> && !std::is_same_v<T, B>) BIREFIT_INLINE Dual(T v)
      : value(B(static_cast<double>(v))) {  // NOLINT
    for (B& x : d) x = B(0.0);
  }
  /// f(x) with derivative f'(x): the chain rule.
  BIREFIT_INLINE Dual chain(const B& f, const B& slope) const {
    Dual r;
    r.value = f;
    for (int i = 0; i < N; ++i) r.d[i] = slope * d[i];
    return r;
  }
  BIREFIT_INLINE Dual& operator+=(const Dual& o) { return *this = *this + o; }
  BIREFIT_INLINE Dual& operator-=(const Dual& o) { return *this = *this - o; }
  BIREFIT_INLINE Dual& operator*=(const Dual& o) { return *this = *this * o; }

  BIREFIT_INLINE friend Dual operator+(const Dual& a, const Dual& b) {
    Dual r;
    r.value = a.value + b.value;
    for (int i = 0; i < N; ++i) r.d[i] = a.d[i] + b.d[i];
    return r;
  }
  BIREFIT_INLINE friend Dual operator-(const Dual& a, const Dual& b) {
    Dual r;
    r.value = a.value - b.value;
    for (int i = 0; i < N; ++i) r.d[i] = a.d[i] - b.d[i];
    return r;
  }
  BIREFIT_INLINE friend Dual operator-(const Dual& a) {
    Dual r;
    r.value = -a.value;
    for (int i = 0; i < N; ++i) r.d[i] = -a.d[i];
    return r;
  }
  BIREFIT_INLINE friend Dual operator*(const Dual& a, const Dual& b) {
    Dual r;
    r.value = a.value * b.value;
    for (int i = 0; i < N; ++i) r.d[i] = a.d[i] * b.value + a.value * b.d[i];
    return r;
  }
  BIREFIT_INLINE friend Dual operator/(const Dual& a, const Dual& b) {
    Dual r;
    const B f = inverse(b.value);
    r.value = a.value * f;
    for (int i = 0; i < N; ++i) r.d[i] = (a.d[i] - r.value * b.d[i]) * f;
    return r;
  }
  // Constants (double or base) without the work of a full dual.
  BIREFIT_INLINE friend Dual operator+(const Dual& a, double b) {
    Dual r = a;
    r.value = a.value + B(b);
    return r;
  }
  BIREFIT_INLINE friend Dual operator+(double a, const Dual& b) { return b + a; }
  BIREFIT_INLINE friend Dual operator-(const Dual& a, double b) { return a + (-b); }
  BIREFIT_INLINE friend Dual operator-(double a, const Dual& b) { return -b + a; }
  BIREFIT_INLINE friend Dual operator*(const Dual& a, double b) { return a.chain(a.value * B(b), B(b)); }
  BIREFIT_INLINE friend Dual operator*(double a, const Dual& b) { return b * a; }
  BIREFIT_INLINE friend Dual operator/(const Dual& a, double b) { return a * (1.0 / b); }
  BIREFIT_INLINE friend Dual operator/(double a, const Dual& b) {
    const B one = inverse(b.value);
    const B f = B(a) * one;
    return b.chain(f, -f * one);
  }
  // Of the base, or of its base, the same: kernels keep what does not depend on the variable there.
  template <class T>
  static constexpr bool kIsBase = !std::is_same_v<T, double> && is_under<T, B>;
  template <class T>
  requires(kIsBase<T>) BIREFIT_INLINE friend Dual operator+(const Dual& a, const T& b) {
    Dual r = a;
    r.value = a.value + b;
    return r;
  }
  template <class T>
  requires(kIsBase<T>) BIREFIT_INLINE friend Dual operator+(const T& a, const Dual& b) { return b + a; }
  template <class T>
  requires(kIsBase<T>) BIREFIT_INLINE friend Dual operator-(const Dual& a, const T& b) {
    Dual r = a;
    r.value = a.value - b;
    return r;
  }
  template <class T>
  requires(kIsBase<T>) BIREFIT_INLINE friend Dual operator-(const T& a, const Dual& b) { return -b + a; }
  template <class T>
  requires(kIsBase<T>) BIREFIT_INLINE friend Dual operator*(const Dual& a, const T& b) {
    Dual r;
    r.value = a.value * b;
    for (int i = 0; i < N; ++i) r.d[i] = a.d[i] * b;
    return r;
  }
  template <class T>
  requires(kIsBase<T>) BIREFIT_INLINE friend Dual operator*(const T& a, const Dual& b) { return b * a; }
};

template <class B, int N>
struct ScalarTraits<Dual<B, N>> {
  using Plain = PlainOf<B>;
  static constexpr int derivatives = N;
};
template <class B, int N>
BIREFIT_INLINE PlainOf<B> plain(const Dual<B, N>& x) {
  return plain(x.value);
}
/// A scalar as one with more derivatives: derivative j becomes derivative to[j].
template <class S, class R>
struct Raise {
  std::array<std::size_t, static_cast<std::size_t>(ScalarTraits<S>::derivatives)> to{};
  BIREFIT_INLINE R operator()(const S& x) const {
    R r(plain(x));
    if constexpr (ScalarTraits<S>::derivatives > 0)
      // unused ones are 0 and may share a place
      for (std::size_t j = 0; j < to.size(); ++j) r.d[to[j]] = r.d[to[j]] + x.d[j];
    return r;
  }
};
template <class S>
struct Raise<S, S> {
  BIREFIT_INLINE const S& operator()(const S& x) const { return x; }
};
template <class C, class B, int N>
BIREFIT_INLINE Dual<B, N> select(const C& condition, const Dual<B, N>& a, const Dual<B, N>& b) {
  Dual<B, N> r;
  r.value = select(condition, a.value, b.value);
  for (int i = 0; i < N; ++i) r.d[i] = select(condition, a.d[i], b.d[i]);
  return r;
}
template <class B, int N>
BIREFIT_INLINE Dual<B, N> min_of(const Dual<B, N>& a, const Dual<B, N>& b) {
  return select(plain(a) < plain(b), a, b);
}
template <class B, int N>
BIREFIT_INLINE Dual<B, N> max_of(const Dual<B, N>& a, const Dual<B, N>& b) {
  return select(plain(a) > plain(b), a, b);
}
template <class B, int N>
BIREFIT_INLINE Dual<B, N> sqrt(const Dual<B, N>& x) {
  const B root = sqrt(x.value);
  return x.chain(root, B(0.5) / root);
}
template <class B, int N>
BIREFIT_INLINE Dual<B, N> inverse(const Dual<B, N>& x) {
  const B f = inverse(x.value);
  return x.chain(f, -(f * f));
}
template <class B, int N>
BIREFIT_INLINE Dual<B, N> inverse_root(const Dual<B, N>& x) {
  const B f = inverse_root(x.value);
  return x.chain(f, B(-0.5) * f * f * f);
}
template <class B, int N>
BIREFIT_INLINE Dual<B, N> root(const Dual<B, N>& x) {
  const B f = inverse_root(x.value);
  return x.chain(x.value * f, B(0.5) * f);
}
template <class B, int N>
BIREFIT_INLINE Dual<B, N> exp(const Dual<B, N>& x) {
  const B e = exp(x.value);
  return x.chain(e, e);
}
template <class B, int N>
BIREFIT_INLINE Dual<B, N> log(const Dual<B, N>& x) {
  return x.chain(log(x.value), B(1.0) / x.value);
}
template <class B, int N>
BIREFIT_INLINE void sin_cos(const Dual<B, N>& x, Dual<B, N>& s, Dual<B, N>& c) {
  B sv, cv;
  sin_cos(x.value, sv, cv);
  s = x.chain(sv, cv);
  c = x.chain(cv, -sv);
}
template <class B, int N>
BIREFIT_INLINE Dual<B, N> sin(const Dual<B, N>& x) {
  Dual<B, N> s, c;
  sin_cos(x, s, c);
  return s;
}
template <class B, int N>
BIREFIT_INLINE Dual<B, N> cos(const Dual<B, N>& x) {
  Dual<B, N> s, c;
  sin_cos(x, s, c);
  return c;
}
template <class B, int N>
BIREFIT_INLINE Dual<B, N> sinh(const Dual<B, N>& x) {
  return x.chain(sinh(x.value), cosh(x.value));
}
template <class B, int N>
BIREFIT_INLINE Dual<B, N> cosh(const Dual<B, N>& x) {
  return x.chain(cosh(x.value), sinh(x.value));
}
template <class B, int N>
BIREFIT_INLINE Dual<B, N> asinh(const Dual<B, N>& x) {
  return x.chain(asinh(x.value), B(1.0) / sqrt(x.value * x.value + B(1.0)));
}
template <class B, int N>
BIREFIT_INLINE Dual<B, N> erfc(const Dual<B, N>& x) {
  return x.chain(erfc(x.value), B(-1.1283791670955126) * exp(-(x.value * x.value)));
}

// Oracles such as ceres::Jet bring no sin_cos, select, ... of their own; these serve any scalar that has sin and cos.
template <class S>
requires(!std::is_same_v<S, double> && !std::is_same_v<S, Pack> && ScalarTraits<S>::derivatives == 0) BIREFIT_INLINE
    void sin_cos(const S& x, S& s, S& c) {
  s = sin(x);
  c = cos(x);
}
template <class S>
requires(!std::is_same_v<S, double> && !std::is_same_v<S, Pack> && ScalarTraits<S>::derivatives == 0) BIREFIT_INLINE S
    select(bool condition, const S& a, const S& b) {
  return condition ? a : b;
}
template <class S>
requires(!std::is_same_v<S, double> && !std::is_same_v<S, Pack> && ScalarTraits<S>::derivatives == 0) BIREFIT_INLINE S
    max_of(const S& a, const S& b) {
  return a > b ? a : b;
}
template <class S>
requires(!std::is_same_v<S, double> && !std::is_same_v<S, Pack> && ScalarTraits<S>::derivatives == 0) BIREFIT_INLINE S
    min_of(const S& a, const S& b) {
  return a < b ? a : b;
}

template <class S>
requires(!std::is_same_v<S, double> && !std::is_same_v<S, Pack> && ScalarTraits<S>::derivatives == 0) S
    inverse(const S& x) {
  return S(1.0) / x;
}
template <class S>
requires(!std::is_same_v<S, double> && !std::is_same_v<S, Pack> && ScalarTraits<S>::derivatives == 0) S
    root(const S& x) {
  return sqrt(x);
}
template <class S>
requires(!std::is_same_v<S, double> && !std::is_same_v<S, Pack> && ScalarTraits<S>::derivatives == 0) S
    inverse_root(const S& x) {
  return S(1.0) / sqrt(x);
}

// ---- functions entire in their argument, so that value, derivative and lanes all survive at zero -------------------

/// cos(sqrt(q)), any real q (cosh for negative q). |q| small or moderate: phases of one step.
/// sinc_sq(q) = sin(sqrt q)/sqrt q. Both from one sin_cos; derivatives from d cos_sq/dq = -sinc_sq/2,
/// d sinc_sq/dq = (cos_sq - sinc_sq)/(2 q), the latter by its Taylor series where the quotient cancels.
/// This version is for q >= 0, which is what real rotations produce.
template <class S>
struct CosSinc {
  S cos_sq, sinc_sq;
};
template <class B>
BIREFIT_INLINE B sinc_slope(const B& q, const B& cos_sq, const B& sinc_sq) {
  // (cos_sq - sinc_sq)/(2q) = -1/6 + q/60 - q^2/1680 + q^3/90720 - q^4/7983360: next term below 1e-12 for q < 0.03.
  const B series = B(-1.0 / 6) + q * (B(1.0 / 60) + q * (B(-1.0 / 1680) + q * (B(1.0 / 90720) - q * B(1.0 / 7983360))));
  const auto small = plain(q) < PlainOf<B>(0.03);
  const B safe = select(small, B(1.0), q);
  return select(small, series, (cos_sq - sinc_sq) * (B(0.5) * inverse(safe)));
}
template <class S>
requires(ScalarTraits<S>::derivatives == 0) BIREFIT_INLINE CosSinc<S> cos_sinc_sq(const S& q) {
  const S safe = max_of(q, S(1e-40));
  const S f = inverse_root(safe);
  S s, c;
  sin_cos(safe * f, s, c);
  return {c, s * f};
}
template <class B, int N>
BIREFIT_INLINE CosSinc<Dual<B, N>> cos_sinc_sq(const Dual<B, N>& q) {
  const CosSinc<B> f = cos_sinc_sq(q.value);
  return {q.chain(f.cos_sq, f.sinc_sq * B(-0.5)), q.chain(f.sinc_sq, sinc_slope(q.value, f.cos_sq, f.sinc_sq))};
}

// ---- small vectors and complex numbers over any scalar -------------------------------------------------------------

template <class S>
struct Vec3 {
  S x, y, z;
};
template <class S>
BIREFIT_INLINE Vec3<S> operator+(const Vec3<S>& a, const Vec3<S>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class S>
BIREFIT_INLINE Vec3<S> operator*(const S& s, const Vec3<S>& a) {
  return {s * a.x, s * a.y, s * a.z};
}
template <class S>
BIREFIT_INLINE S dot(const Vec3<S>& a, const Vec3<S>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class S>
BIREFIT_INLINE Vec3<S> cross(const Vec3<S>& a, const Vec3<S>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class S>
BIREFIT_INLINE Vec3<S> normalized(const Vec3<S>& a) {
  return inverse_root(dot(a, a)) * a;
}

/// std::complex is unspecified for anything but float and double.
template <class S>
struct Complex {
  S re, im;
  Complex() : re(S(0.0)), im(S(0.0)) {}
  Complex(const S& r) : re(r), im(S(0.0)) {}  // NOLINT: real numbers are complex numbers
  Complex(const S& r, const S& i) : re(r), im(i) {}
};
/// The scalar under a number that may be complex.
template <class N>
struct NumberTraits {
  using Real = N;
};
template <class S>
struct NumberTraits<Complex<S>> {
  using Real = S;
};
template <class S>
Complex<S> operator+(const Complex<S>& a, const Complex<S>& b) {
  return {a.re + b.re, a.im + b.im};
}
template <class S>
Complex<S> operator-(const Complex<S>& a, const Complex<S>& b) {
  return {a.re - b.re, a.im - b.im};
}
template <class S>
Complex<S> operator-(const Complex<S>& a) {
  return {-a.re, -a.im};
}
template <class S>
Complex<S> operator*(const Complex<S>& a, const Complex<S>& b) {
  return {a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
}
template <class S>
Complex<S> operator*(const S& a, const Complex<S>& b) {
  return {a * b.re, a * b.im};
}
template <class S>
Complex<S> operator/(const Complex<S>& a, const Complex<S>& b) {
  const S inverse = S(1.0) / (b.re * b.re + b.im * b.im);
  return {(a.re * b.re + a.im * b.im) * inverse, (a.im * b.re - a.re * b.im) * inverse};
}
template <class S>
Complex<S> times_i(const Complex<S>& a) {
  return {-a.im, a.re};
}
template <class S>
Complex<S> conj(const Complex<S>& a) {
  return {a.re, -a.im};
}
template <class S>
BIREFIT_INLINE S norm(const Complex<S>& a) {
  return a.re * a.re + a.im * a.im;
}
template <class S>
Complex<S> exp(const Complex<S>& a) {
  S s, c;
  sin_cos(a.im, s, c);
  const S e = exp(a.re);
  return {e * c, e * s};
}
/// Principal root, Re >= 0, written for Re a > 0 or Im a away from zero: the normal components of waves that travel.
/// With Im a >= 0 the root has Im >= 0: the wave decays along +z.
template <class S>
Complex<S> sqrt(const Complex<S>& a) {
  const S modulus = sqrt(norm(a));
  const S re = sqrt((modulus + a.re) * S(0.5));
  return {re, a.im / (re * S(2.0))};
}

// The scalars all kernels are compiled for, and one more for pictures that are read from a table over the radius: eight
// derivatives at once cost less there than four and four, but not where every point has its ray (lanes leave the
// registers).
#define BIREFIT_FOR_EACH_SCALAR(X) X(double) X(Pack) X(Dual1) X(Dual2) X(Dual4)
#define BIREFIT_FOR_EACH_SCALAR_OF_TABLES(X) BIREFIT_FOR_EACH_SCALAR(X) X(Dual8)
/// Each of them and those with as many derivatives or more.
#define BIREFIT_FOR_EACH_RAISE(X)                                                                              \
  X(double, double)                                                                                            \
  X(Pack, Pack)                                                                                                \
  X(Pack, Dual1)                                                                                               \
  X(Pack, Dual2) X(Pack, Dual4) X(Pack, Dual8) X(Dual1, Dual1) X(Dual1, Dual2) X(Dual1, Dual4) X(Dual1, Dual8) \
      X(Dual2, Dual2) X(Dual2, Dual4) X(Dual2, Dual8) X(Dual4, Dual4) X(Dual4, Dual8) X(Dual8, Dual8)
using Dual1 = Dual<Pack, 1>;
using Dual2 = Dual<Pack, 2>;
using Dual4 = Dual<Pack, 4>;
using Dual8 = Dual<Pack, 8>;

}  // namespace birefit
