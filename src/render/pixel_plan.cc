#include "render/pixel_plan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include <fmt/format.h>

#include "render/edge_pixels.h"

namespace birefit {
namespace {

/// Numbers without pattern between 0 and 1: two sequences that leave no gaps together (the plastic number).
double even_x(int i) { return std::fmod(0.5 + i * 0.7548776662466927, 1.0); }
double even_y(int i) { return std::fmod(0.5 + i * 0.5698402909980532, 1.0); }

/// The fewest points from `n` on with which means are within `target` of those by more; `left`: by how much they differ.
int fewest_points(const std::vector<std::array<double, 2>>& pixels, int n, int most, double target, double& left, const std::function<double(double, double, int)>& mean) {
  const auto means = [&](int points) {
    std::vector<double> all;
    for (const auto& [column, row] : pixels) all.push_back(mean(column, row, points));
    return all;
  };
  std::vector<double> here = means(n);
  for (const int more : kPointsASide) {
    if (more <= n) continue;
    const std::vector<double> there = means(more);
    left = 0;
    for (std::size_t i = 0; i < here.size(); ++i) left = std::max(left, std::abs(here[i] - there[i]));
    if (left <= target || more > most) break;
    n = more, here = there;
  }
  return n;
}

}  // namespace

void measure_points(const Scene& scene, const PixelModel<Pack>& model, RenderPlan& plan) {
  const double target = 0.125 * scene.intensity_accuracy;
  double worst = 0;
  // Pixel grids may lie anywhere about the sample: pilots are no pixels of this one.
  const auto place = [&](double radius, double turn) {
    const double azimuth = 2 * std::numbers::pi * turn;
    return std::array<double, 2>{plan.sampling_center_x_px + radius * std::cos(azimuth), plan.sampling_center_y_px + radius * std::sin(azimuth)};
  };
  constexpr int kPilots = 16, kMostRings = 1024;
  constexpr double kBeyond = 0.3;
  const int bins = static_cast<int>(plan.samples.size()), together = 1 + bins / kMostRings;
  for (int first = 0; first < bins; first += together) {
    const int last = std::min(first + together, bins);
    int& n = *std::max_element(plan.samples.begin() + first, plan.samples.begin() + last);
    std::vector<std::array<double, 2>> pixels;
    for (int k = 0; k < kPilots; ++k) {
      // A little beyond the ring on either side: of one that edge pixels all but fill, too few would be left.
      const double bin = first - kBeyond + (last - first + 2 * kBeyond) * (k + 0.5) / kPilots;
      const auto pixel = place(plan.sampling_bin_px * std::max(0.0, bin), even_x(first * kPilots + k));
      if (!is_edge_pixel(model, pixel[0], pixel[1])) pixels.push_back(pixel);
    }
    if (pixels.empty()) continue;
    double left = 0;
    const int needed = fewest_points(pixels, n, kMostPoints / 2, target, left, [&](double column, double row, int points) { return lane(mean_over_one_pixel(model, column, row, points), 0); });
    worst = std::max(worst, left);
    if (needed > n) std::fill(plan.samples.begin() + first, plan.samples.begin() + last, needed);
  }
  constexpr int kAtEdges = 64, kTries = 20000;
  std::vector<std::array<double, 2>> pixels;
  for (int e = 0; e < model.edges(); ++e) {
    const auto circle = model.circle(e);
    for (int k = 0, found = 0; k < kTries && found < kAtEdges; ++k) {
      const double inside = kEdgeWithin - (kEdgeWithin + 0.7) * even_y(k), radius = circle ? std::max(0.0, circle->radius - inside) : bins * plan.sampling_bin_px * std::sqrt(even_y(k));
      const auto pixel = place(radius, even_x(k));
      if (!circle && !changes_sign(model, e, pixel[0], pixel[1])) continue;
      pixels.push_back(pixel);
      ++found;
    }
    // Pixels that a circle touches from within are few, and the hardest: along the axes.
    constexpr int kTouched = 32;
    for (int k = 0; circle && k < kTouched; ++k)
      pixels.push_back(place(std::max(0.0, circle->radius + 1.4 * (even_y(k) - 0.5)), 0.25 * (k % 4) + 0.16 * (even_x(k) - 0.5) / std::max(1.0, circle->radius)));
  }
  if (!pixels.empty()) {
    double left = 0;
    constexpr int kFewest = 3;
    plan.edge_points = fewest_points(pixels, kFewest, kMostPoints / 2, target, left, [&](double column, double row, int points) { return lane(mean_over_edge_pixel(model, column, row, points), 0); });
    worst = std::max(worst, left);
  }
  plan.reasons.push_back(fmt::format("pixels are means over their area: up to {0} x {0} points where fringes or a defect are finer than a pixel, {1} lines across rims and edges, measured: they are good to {2:.1e}",
                                     *std::max_element(plan.samples.begin(), plan.samples.end()), plan.edge_points, worst));
  plan.numerical_error = std::max(plan.numerical_error, worst);
}

}  // namespace birefit
