#pragma once
// How many points stand for a pixel.

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace birefit {

/// Points per pixel side that are tried, and the most there are.
inline constexpr std::array<int, 13> kPointsASide{1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96};
inline constexpr int kMostPoints = kPointsASide.back();

/// As many for a retardance phase that changes by `radians` across the pixel, so that the pixel's mean of (1 - cos)/2
/// is within about half of `accuracy`: 1 with the second-order correction (error radians^4 / 680), n Gauss points
/// otherwise, whose error is (n!)^4 / ((2n + 1) (2n)!^3) of the derivative of order 2n (Abramowitz & Stegun, 25.4.30),
/// radians^(2n) / 2.
inline int samples_for(double radians, double accuracy) {
  if (std::pow(radians, 4) < 256 * accuracy) return 1;
  const auto log_factorial = [](int n) { return std::lgamma(n + 1.0); };
  for (const int n : kPointsASide) {
    if (n == 1) continue;
    const double log_error =
        4 * log_factorial(n) - 3 * log_factorial(2 * n) - std::log(2 * n + 1.0) + 2 * n * std::log(radians);
    if (log_error < std::log(accuracy)) return n;
  }
  return kMostPoints;
}

/// Points of a round picture's pixels within each radius, 0, 1, 2 .. bins of `samples` (points per pixel side, by
/// radius).
inline std::vector<double> points_within(const std::vector<int>& samples, double bin_px) {
  std::vector<double> inside{0};
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const double side = bin_px * samples[i];
    inside.push_back(inside.back() + std::numbers::pi * (2.0 * static_cast<double>(i) + 1) * side * side);
  }
  return inside;
}

/// Gauss-Legendre points on [-1/2, 1/2], weights summing to 1.
struct PixelRule {
  std::vector<double> x, w;
};
inline PixelRule pixel_rule(int n) {
  PixelRule rule;
  for (int i = 0; i < n; ++i) {
    // Newton on P_n from Tricomi's start.
    double x = std::cos(3.14159265358979323846 * (i + 0.75) / (n + 0.5)), slope = 1;
    for (int k = 0; k < 20; ++k) {
      double p0 = 1, p1 = x;
      for (int j = 1; j < n; ++j) {
        const double p2 = ((2 * j + 1) * x * p1 - j * p0) / (j + 1);
        p0 = p1;
        p1 = p2;
      }
      if (n == 1) p0 = 1, p1 = x;
      slope = n * (x * p1 - p0) / (x * x - 1);
      x -= p1 / slope;
      if (std::abs(p1 / slope) < 1e-16) break;
    }
    rule.x.push_back(0.5 * x);
    rule.w.push_back(1 / ((1 - x * x) * slope * slope));
  }
  return rule;
}

}  // namespace birefit
