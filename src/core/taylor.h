#pragma once
// Truncated power series: a scalar for kernels that need derivatives of high order along one variable. A law evaluated
// at Taylor::variable(u0) returns its own Taylor coefficients about u0, to rounding, with no difference quotient.
// Recurrences: Knuth, The Art of Computer Programming 2, 4.7; Griewank & Walther, Evaluating Derivatives, 13.2.

#include <algorithm>

#include "core/scalar.h"

namespace birefit {

/// c[0] + c[1] x + .. + c[order] x^order over any base scalar B, order <= N; terms beyond are dropped. Work grows with
/// order^2, so a short series costs what it is worth. A constant has order 0 and takes the order of what it meets.
template <class B, int N>
struct Taylor {
  std::array<B, N + 1> c;  ///< 0 beyond the order
  int order = 0;

  Taylor() : Taylor(B(0.0)) {}
  Taylor(const B& v) {  // NOLINT: constants mix freely with series
    c.fill(B(0.0));
    c[0] = v;
  }
  template <class T>
  requires(std::is_arithmetic_v<T> && !std::is_same_v<T, B>) Taylor(T v)
      : Taylor(B(static_cast<double>(v))) {}  // NOLINT
  static Taylor of_order(int order, const B& v = B(0.0)) {
    Taylor r(v);
    r.order = order;
    return r;
  }
  /// at + x
  static Taylor variable(const B& at, int order = N) {
    Taylor r = of_order(order, at);
    r.c[1] = B(1.0);
    return r;
  }
  /// The sum at x.
  template <class X>
  X operator()(const X& x) const {
    X sum(c[order]);
    for (int k = order - 1; k >= 0; --k) sum = sum * x + X(c[k]);
    return sum;
  }

  Taylor& operator+=(const Taylor& o) { return *this = *this + o; }
  Taylor& operator-=(const Taylor& o) { return *this = *this - o; }
  Taylor& operator*=(const Taylor& o) { return *this = *this * o; }

  friend Taylor operator+(const Taylor& a, const Taylor& b) {
    Taylor r = of_order(std::max(a.order, b.order));
    for (int k = 0; k <= r.order; ++k) r.c[k] = a.c[k] + b.c[k];
    return r;
  }
  friend Taylor operator-(const Taylor& a, const Taylor& b) {
    Taylor r = of_order(std::max(a.order, b.order));
    for (int k = 0; k <= r.order; ++k) r.c[k] = a.c[k] - b.c[k];
    return r;
  }
  friend Taylor operator-(const Taylor& a) {
    Taylor r = of_order(a.order);
    for (int k = 0; k <= r.order; ++k) r.c[k] = -a.c[k];
    return r;
  }
  friend Taylor operator*(const Taylor& a, const Taylor& b) {
    Taylor r = of_order(std::max(a.order, b.order));
    for (int k = 0; k <= r.order; ++k) {
      B sum(0.0);
      for (int j = std::max(0, k - b.order), last = std::min(k, a.order); j <= last; ++j)
        sum = sum + a.c[j] * b.c[k - j];
      r.c[k] = sum;
    }
    return r;
  }
  friend Taylor operator/(const Taylor& a, const Taylor& b) {
    Taylor r = of_order(std::max(a.order, b.order));
    const B f = inverse(b.c[0]);
    for (int k = 0; k <= r.order; ++k) {
      B rest = a.c[k];
      for (int j = 1, last = std::min(k, b.order); j <= last; ++j) rest = rest - b.c[j] * r.c[k - j];
      r.c[k] = rest * f;
    }
    return r;
  }
  friend Taylor operator*(const Taylor& a, double b) {
    Taylor r = of_order(a.order);
    for (int k = 0; k <= r.order; ++k) r.c[k] = a.c[k] * B(b);
    return r;
  }
  friend Taylor operator*(double a, const Taylor& b) { return b * a; }
  friend Taylor operator/(const Taylor& a, double b) { return a * (1.0 / b); }
  friend Taylor operator/(double a, const Taylor& b) { return Taylor(B(a)) / b; }
};

template <class B, int N>
struct ScalarTraits<Taylor<B, N>> {
  using Plain = PlainOf<B>;
  static constexpr int derivatives = N;
};
template <class B, int N>
PlainOf<B> plain(const Taylor<B, N>& x) {
  return plain(x.c[0]);
}
template <class C, class B, int N>
Taylor<B, N> select(const C& condition, const Taylor<B, N>& a, const Taylor<B, N>& b) {
  Taylor<B, N> r = Taylor<B, N>::of_order(std::max(a.order, b.order));
  for (int k = 0; k <= r.order; ++k) r.c[k] = select(condition, a.c[k], b.c[k]);
  return r;
}
template <class B, int N>
Taylor<B, N> min_of(const Taylor<B, N>& a, const Taylor<B, N>& b) {
  return select(plain(a) < plain(b), a, b);
}
template <class B, int N>
Taylor<B, N> max_of(const Taylor<B, N>& a, const Taylor<B, N>& b) {
  return select(plain(a) > plain(b), a, b);
}

/// d/dx; the coefficient of x^order is lost (0).
template <class B, int N>
Taylor<B, N> derivative(const Taylor<B, N>& x) {
  Taylor<B, N> r = Taylor<B, N>::of_order(x.order);
  for (int k = 0; k < r.order; ++k) r.c[k] = x.c[k + 1] * B(k + 1.0);
  return r;
}
/// Integral from 0 to x, of the same order: a bare constant must be given its order first.
template <class B, int N>
Taylor<B, N> integral(const Taylor<B, N>& x) {
  Taylor<B, N> r = Taylor<B, N>::of_order(x.order);
  for (int k = 0; k < r.order; ++k) r.c[k + 1] = x.c[k] * B(1.0 / (k + 1));
  return r;
}

// Each recurrence below compares coefficients in the differential equation of its function.
template <class B, int N>
Taylor<B, N> sqrt(const Taylor<B, N>& x) {  // r r = x
  Taylor<B, N> r = Taylor<B, N>::of_order(x.order, sqrt(x.c[0]));
  const B half = B(0.5) * inverse(r.c[0]);
  for (int k = 1; k <= x.order; ++k) {
    B rest = x.c[k];
    for (int j = 1; j < k; ++j) rest = rest - r.c[j] * r.c[k - j];
    r.c[k] = rest * half;
  }
  return r;
}
template <class B, int N>
Taylor<B, N> inverse(const Taylor<B, N>& x) {
  return Taylor<B, N>(B(1.0)) / x;
}
template <class B, int N>
Taylor<B, N> root(const Taylor<B, N>& x) {
  return sqrt(x);
}
template <class B, int N>
Taylor<B, N> inverse_root(const Taylor<B, N>& x) {
  return inverse(sqrt(x));
}
template <class B, int N>
Taylor<B, N> exp(const Taylor<B, N>& x) {  // r' = x' r
  Taylor<B, N> r = Taylor<B, N>::of_order(x.order, exp(x.c[0]));
  for (int k = 1; k <= x.order; ++k) {
    B sum(0.0);
    for (int j = 1; j <= k; ++j) sum = sum + B(double(j) / k) * x.c[j] * r.c[k - j];
    r.c[k] = sum;
  }
  return r;
}
/// The function with value f at the constant term and slope(x) as its derivative.
template <class B, int N>
Taylor<B, N> with_slope(const Taylor<B, N>& x, const B& f, const Taylor<B, N>& slope) {
  Taylor<B, N> r = integral(slope * derivative(x));
  r.c[0] = f;
  return r;
}
template <class B, int N>
Taylor<B, N> log(const Taylor<B, N>& x) {
  return with_slope(x, B(log(x.c[0])), inverse(x));
}
template <class B, int N>
void sin_cos(const Taylor<B, N>& x, Taylor<B, N>& s, Taylor<B, N>& c) {  // s' = x' c, c' = -x' s
  B s0, c0;
  sin_cos(x.c[0], s0, c0);
  const int order = x.order;
  Taylor<B, N> sine = Taylor<B, N>::of_order(order, s0), cosine = Taylor<B, N>::of_order(order, c0);  // x may be s or c
  for (int k = 1; k <= x.order; ++k)
    for (int j = 1; j <= k; ++j) {
      const B step = B(double(j) / k) * x.c[j];
      sine.c[k] = sine.c[k] + step * cosine.c[k - j];
      cosine.c[k] = cosine.c[k] - step * sine.c[k - j];
    }
  s = sine;
  c = cosine;
}
template <class B, int N>
Taylor<B, N> sin(const Taylor<B, N>& x) {
  Taylor<B, N> s, c;
  sin_cos(x, s, c);
  return s;
}
template <class B, int N>
Taylor<B, N> cos(const Taylor<B, N>& x) {
  Taylor<B, N> s, c;
  sin_cos(x, s, c);
  return c;
}
template <class B, int N>
Taylor<B, N> sinh(const Taylor<B, N>& x) {
  const Taylor<B, N> e = exp(x);
  Taylor<B, N> r = 0.5 * (e - inverse(e));
  r.c[0] = sinh(x.c[0]);  // no cancellation in the value near 0
  return r;
}
template <class B, int N>
Taylor<B, N> cosh(const Taylor<B, N>& x) {
  const Taylor<B, N> e = exp(x);
  return 0.5 * (e + inverse(e));
}
template <class B, int N>
Taylor<B, N> asinh(const Taylor<B, N>& x) {
  return with_slope(x, B(asinh(x.c[0])), inverse_root(1.0 + x * x));
}
template <class B, int N>
Taylor<B, N> erfc(const Taylor<B, N>& x) {
  return with_slope(x, B(erfc(x.c[0])), -1.1283791670955126 * exp(-(x * x)));  // 2/sqrt(pi)
}

}  // namespace birefit
