#pragma once
// Polynomials through Chebyshev points, none of them at an end of [-1, 1], where a function may be singular.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>

namespace birefit {

template <int kPoints>
struct ChebyshevRule {
  std::array<double, kPoints> x;
  std::array<std::array<double, kPoints>, kPoints> to_powers;  ///< [power][point]: values at x to coefficients
};
template <int kPoints>
const ChebyshevRule<kPoints>& chebyshev_rule() {
  static const ChebyshevRule<kPoints> rule = [] {
    ChebyshevRule<kPoints> r;
    for (int k = 0; k < kPoints; ++k)
      r.x[static_cast<std::size_t>(k)] = std::cos(std::numbers::pi * (k + 0.5) / kPoints);
    // Column k: the Lagrange polynomial of point k, multiplied out.
    for (std::size_t k = 0; k < kPoints; ++k) {
      std::array<double, kPoints + 1> p{1.0};
      int degree = 0;
      for (std::size_t m = 0; m < kPoints; ++m) {
        if (m == k) continue;
        const double scale = 1 / (r.x[k] - r.x[m]);
        for (int c = ++degree; c >= 0; --c) {
          const std::size_t at = static_cast<std::size_t>(c);
          p[at] = ((c > 0 ? p[at - 1] : 0.0) - r.x[m] * p[at]) * scale;
        }
      }
      for (std::size_t c = 0; c < kPoints; ++c) r.to_powers[c][k] = p[c];
    }
    return r;
  }();
  return rule;
}
/// Squares are planned to interpolate to a hundredth of the accuracy asked for (plan.cc); with a tail of more than this
/// share they are left to rays.
constexpr double kGivenUp = 0.1;
/// Size of the two highest Chebyshev coefficients, along either coordinate and at most, of values at kPoints x kPoints
/// points: how far the polynomials are from what they follow.
template <int kPoints>
double tail(const double* values) {
  constexpr std::size_t n = static_cast<std::size_t>(kPoints);
  static const std::array<std::array<double, n>, 2> weight = [] {
    std::array<std::array<double, n>, 2> w;
    for (std::size_t m = 0; m < 2; ++m)
      for (std::size_t k = 0; k < n; ++k)
        w[m][k] = 2.0 / kPoints *
                  std::cos((kPoints - 1.0 - static_cast<double>(m)) * std::numbers::pi *
                           (static_cast<double>(k) + 0.5) / kPoints);
    return w;
  }();
  double worst = 0;
  for (std::size_t i = 0; i < n; ++i)
    for (const auto& [start, stride] : {std::pair{i * n, std::size_t{1}}, {i, n}}) {
      double a[2] = {0, 0};
      for (std::size_t m = 0; m < 2; ++m)
        for (std::size_t k = 0; k < n; ++k) a[m] += weight[m][k] * values[start + k * stride];
      const double here = std::abs(a[0]) + std::abs(a[1]);
      if (!std::isfinite(here)) return here;
      worst = std::max(worst, here);
    }
  return worst;
}
/// Largest derivative of this order, 0 to 3, along either coordinate at kPoints x kPoints points, of values there.
template <int kPoints>
double largest_derivative(const double* values, int order) {
  constexpr std::size_t n = static_cast<std::size_t>(kPoints);
  using Weights = std::array<std::array<double, n>, n>;  // [at][point]
  static const std::array<Weights, 4> weights = [] {
    const ChebyshevRule<kPoints>& rule = chebyshev_rule<kPoints>();
    std::array<Weights, 4> w{};
    for (std::size_t m = 0; m < 4; ++m)
      for (std::size_t at = 0; at < n; ++at)
        for (std::size_t k = 0; k < n; ++k)
          for (std::size_t power = m; power < n; ++power) {
            double term = rule.to_powers[power][k] * std::pow(rule.x[at], static_cast<double>(power - m));
            for (std::size_t fall = 0; fall < m; ++fall) term *= static_cast<double>(power - fall);
            w[m][at][k] += term;
          }
    return w;
  }();
  const Weights& w = weights[static_cast<std::size_t>(order)];
  double largest = 0;
  for (std::size_t i = 0; i < n; ++i)
    for (const auto& [start, stride] : {std::pair{i * n, std::size_t{1}}, {i, n}})
      for (std::size_t at = 0; at < n; ++at) {
        double sum = 0;
        for (std::size_t k = 0; k < n; ++k) sum += w[at][k] * values[start + k * stride];
        largest = std::max(largest, std::abs(sum));
      }
  return largest;
}
/// Values at kPoints x kPoints Chebyshev points, [second coordinate][first], to the coefficients of their powers, in
/// the same order.
template <int kPoints>
void to_powers(const double* values, double* powers) {
  const ChebyshevRule<kPoints>& rule = chebyshev_rule<kPoints>();
  constexpr std::size_t n = static_cast<std::size_t>(kPoints);
  double half[n][n];
  for (std::size_t r = 0; r < n; ++r)
    for (std::size_t c = 0; c < n; ++c) {
      half[r][c] = 0;
      for (std::size_t k = 0; k < n; ++k) half[r][c] += rule.to_powers[c][k] * values[r * n + k];
    }
  for (std::size_t r = 0; r < n; ++r)
    for (std::size_t c = 0; c < n; ++c) {
      double sum = 0;
      for (std::size_t k = 0; k < n; ++k) sum += rule.to_powers[r][k] * half[k][c];
      powers[r * n + c] = sum;
    }
}

}  // namespace birefit
