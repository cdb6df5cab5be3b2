#pragma once
// How many points stand for a pixel.

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace birefit {

/// Points per pixel side for a retardance phase that changes by `radians` across the pixel, so that the pixel's mean
/// of (1 - cos)/2 is within about 5e-5: 1 with the second-order correction (error radians^4 / 680), n Gauss points
/// otherwise (n = 2: radians^4 / 8640).
inline int samples_for(double radians) {
  if (radians < 0.4) return 1;
  if (radians < 0.8) return 2;
  if (radians < 2.4) return 3;
  if (radians < 4.5) return 4;
  if (radians < 8) return 6;
  return 8;
}

/// Points of a round picture's pixels within each radius, 0, 1, 2 .. bins of `samples` (points per pixel side, by radius).
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
    }
    rule.x.push_back(0.5 * x);
    rule.w.push_back(1 / ((1 - x * x) * slope * slope));
  }
  return rule;
}

}  // namespace birefit
