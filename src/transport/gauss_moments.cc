#include "transport/gauss_moments.h"

#include <array>
#include <cassert>
#include <numbers>
#include <vector>

#include <cerf.h>
#undef I

namespace birefit {
namespace {

using C = Complex<double>;

struct Rule {
  double phase;  ///< |x1| + 2 |x2|, the fastest turn of the integrand, up to which it holds 1e-12
  std::vector<double> t, weight;
};

/// Gauss-Legendre on [0, 1]: roots of P_n by Newton's iteration from their asymptotic places (Abramowitz &
/// Stegun 22.16.6).
Rule legendre(int n, double phase) {
  Rule rule{phase, {}, {}};
  for (int i = 1; i <= n; ++i) {
    double x = std::cos(std::numbers::pi * (i - 0.25) / (n + 0.5)), slope = 0;
    for (int iteration = 0; iteration < 8; ++iteration) {
      double p = 1, before = 0;
      for (int k = 1; k <= n; ++k) {
        const double next = ((2 * k - 1) * x * p - (k - 1) * before) / k;
        before = p;
        p = next;
      }
      slope = n * (x * p - before) / (x * x - 1);
      x -= p / slope;
    }
    rule.t.push_back(0.5 * (1 + x));
    rule.weight.push_back(1 / ((1 - x * x) * slope * slope));
  }
  return rule;
}

const std::array<Rule, 6>& rules() {
  static const std::array<Rule, 6> all{legendre(16, 10), legendre(24, 25),  legendre(32, 43),
                                       legendre(48, 80), legendre(64, 120), legendre(96, 180)};
  return all;
}

void by_quadrature(const Rule& rule, int n, double x1, double x2, C* moments) {
  for (int m = 0; m <= n; ++m) moments[m] = C();
  for (std::size_t i = 0; i < rule.t.size(); ++i) {
    const double t = rule.t[i], phase = (x1 + x2 * t) * t;
    C term(rule.weight[i] * std::cos(phase), -rule.weight[i] * std::sin(phase));
    for (int m = 0; m <= n; ++m, term = t * term) moments[m] = moments[m] + term;
  }
}

C unit(double phase) { return {std::cos(phase), std::sin(phase)}; }

/// Large quadratic phase. W(u) = w(i r u), r = sqrt(i x2), u >= 0: the argument is in the upper half plane, where
/// |w| <= 1, so nothing overflows; upward recurrence
///   2 i x2 I_{m+1} = m I_{m-1} - i x1 I_m + [m = 0] - E,   E = exp(-i (x1 + x2)).
void by_faddeeva(int n, double x1, double x2, C* moments) {
  const double sign = x2 < 0 ? -1 : 1;
  const double half = std::sqrt(0.5 * std::fabs(x2));
  const C r(half, sign * half), end = unit(-(x1 + x2));
  const auto w = [&](double u) {
    const C z = times_i(u * r);
    return C(re_w_of_z(z.re, z.im), im_w_of_z(z.re, z.im));
  };
  const double stationary = x1 / (2 * x2);  // the phase is stationary at t = -stationary
  C sum;
  if (stationary >= 0)
    sum = w(stationary) - end * w(1 + stationary);
  else if (1 + stationary <= 0)
    sum = end * w(-1 - stationary) - w(-stationary);
  else
    sum = 2.0 * unit(x2 * stationary * stationary) - w(-stationary) - end * w(1 + stationary);
  moments[0] = 0.5 * std::sqrt(std::numbers::pi) * (sum / r);
  const C divisor(0.0, 2 * x2);
  for (int m = 0; m < n; ++m) {
    C rest = C(m == 0 ? 1.0 : 0.0) - end - x1 * times_i(moments[m]);
    if (m > 0) rest = rest + double(m) * moments[m - 1];
    moments[m + 1] = rest / divisor;
  }
}

/// Large linear phase: the recurrence for I_0 .. I_{n+23} at once, closed by the leading term of I_{n+24}.
void by_elimination(int n, double x1, double x2, C* moments) {
  const int size = n + 24;
  const C end = unit(-(x1 + x2));
  const C diagonal(0.0, x1), upper(0.0, 2 * x2);
  std::array<C, kMaxMoment + 25> ratio, value;  // I_m = value_m - ratio_m I_{m+1}
  for (int m = 0; m < size; ++m) {
    const C before = m > 0 ? value[m - 1] : C(), slope = m > 0 ? ratio[m - 1] : C();
    const C pivot = C(1.0) / (diagonal + double(m) * slope);
    ratio[m] = upper * pivot;
    value[m] = (C(m == 0 ? 1.0 : 0.0) - end + double(m) * before) * pivot;
  }
  C next = times_i(end) / C(x1 + 2 * x2);
  for (int m = size - 1; m >= 0; --m) {
    next = value[m] - ratio[m] * next;
    if (m <= n) moments[m] = next;
  }
}

}  // namespace

void gauss_moments(int n, double x1, double x2, Complex<double>* moments) {
  assert(n >= 0 && n <= kMaxMoment);
  const double linear = std::fabs(x1), quadratic = std::fabs(x2), phase = linear + 2 * quadratic;
  const std::array<Rule, 6>& all = rules();
  for (std::size_t i = 0; i < 5; ++i)
    if (phase <= all[i].phase) return by_quadrature(all[i], n, x1, x2, moments);
  // The recurrence loses (|x1|/2|x2|)^n, nothing for |x1| <= 2 |x2|.
  if (linear <= 2 * quadratic) return by_faddeeva(n, x1, x2, moments);
  if (linear >= 6 * quadratic + n + 24) return by_elimination(n, x1, x2, moments);
  if (phase <= all[5].phase) return by_quadrature(all[5], n, x1, x2, moments);
  // |x1| < 8 |x2| here: 2e-12 for n = 7, 4e-10 for n = 11.
  by_faddeeva(n, x1, x2, moments);
}

}  // namespace birefit
