#include "samples/pixels/pixel_plan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include <fmt/format.h>

#include "samples/pixels/edge_pixels.h"

namespace birefit {
namespace {

/// Numbers without pattern between 0 and 1: two sequences that leave no gaps together (the plastic number).
double even_x(int i) { return std::fmod(0.5 + i * 0.7548776662466927, 1.0); }
double even_y(int i) { return std::fmod(0.5 + i * 0.5698402909980532, 1.0); }

/// The fewest points from `n` on with which means are within `target` of those by more; `left`: by how much they
/// differ.
int fewest_points(const std::vector<std::array<double, 2>>& pixels, int n, int most, double target, double& left,
                  const std::function<double(double, double, int)>& mean) {
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

void measure_points(const SampleImage<Pack>& model, RenderPlan& plan) {
  // Pilots are few, of edges the hardest among them.
  const double target = 0.25 * plan.demand.intensity_accuracy;
  double worst = 0;
  // Pixel grids may lie anywhere about the sample: pilots are no pixels of this one.
  const auto place = [&](double radius, double turn) {
    const double azimuth = 2 * std::numbers::pi * turn;
    return std::array<double, 2>{plan.means.center_x_px + radius * std::cos(azimuth),
                                 plan.means.center_y_px + radius * std::sin(azimuth)};
  };
  constexpr int kPairs = 12, kMostRings = 1024;
  constexpr double kBeyond = 0.3;
  const int bins = static_cast<int>(plan.means.samples.size()), together = 1 + bins / kMostRings;
  for (int first = 0; first < bins; first += together) {
    const int last = std::min(first + together, bins);
    int& n = *std::max_element(plan.means.samples.begin() + first, plan.means.samples.begin() + last);
    std::vector<std::array<double, 2>> pixels;
    const auto try_at = [&](double radius, double turn) {
      const auto pixel = place(radius, turn);
      if (!is_edge_pixel(model, pixel[0], pixel[1]) && !is_defect_pixel(model, pixel[0], pixel[1]))
        pixels.push_back(pixel);
    };
    // In pairs of mirror images: a picture and its mirror image, which has the signs of the polarizers' angles changed,
    // are to have the same plan.
    const auto try_at_pair = [&](double radius, double turn) { try_at(radius, turn), try_at(radius, -turn); };
    for (int k = 0; k < kPairs; ++k) {
      // A little beyond the ring on either side: of one that edge pixels all but fill, too few would be left. Fringes
      // are hardest along an axis, where one row of points has all their slope, but there crossed polarizers see
      // nothing: the more points, the nearer to it are the hardest pixels.
      const double bin = first - kBeyond + (last - first + 2 * kBeyond) * (k + 0.5) / kPairs,
                   anywhere = even_x(first * kPairs + k);
      try_at_pair(plan.means.bin_px * std::max(0.0, bin),
                  k % 2 == 0 ? anywhere : 0.25 * (k / 2 % 2) + 0.125 * even_y(k));
    }
    // Light changes fastest beside the pixels that are cut.
    for (int e = 0; e < model.edges(); ++e)
      if (const auto circle = model.circle(e))
        for (const double border : {circle->radius - kEdgeWithin - 1e-6, circle->radius + kEdgeBeyond + 1e-6})
          if (border >= plan.means.bin_px * first && border < plan.means.bin_px * last)
            for (const double turn : {0.01, 0.03, 0.0625, 0.17, 0.24, 0.44}) try_at_pair(border, turn);
    if (pixels.empty()) continue;
    double left = 0;
    const int needed =
        fewest_points(pixels, n, kMostPoints / 2, target, left, [&](double column, double row, int points) {
          return lane(mean_over_one_pixel(model, column, row, points), 0);
        });
    worst = std::max(worst, left);
    if (needed > n) std::fill(plan.means.samples.begin() + first, plan.means.samples.begin() + last, needed);
  }
  const auto cut = [&](double column, double row, int points) {
    return lane(mean_over_edge_pixel(model, column, row, points), 0);
  };
  constexpr int kAtEdges = 32, kTries = 20000;  // pairs
  std::vector<std::array<double, 2>> pixels;
  const auto add = [&](double radius, double turn) {
    for (const auto& pixel : {place(radius, turn), place(radius, -turn)})
      if (is_edge_pixel(model, pixel[0], pixel[1]) && !is_defect_pixel(model, pixel[0], pixel[1]))
        pixels.push_back(pixel);
  };
  for (int e = 0; e < model.edges(); ++e) {
    const auto circle = model.circle(e);
    if (!circle) {
      for (int k = 0, found = 0; k < kTries && found < 2 * kAtEdges; ++k) {
        const auto pixel = place(bins * plan.means.bin_px * std::sqrt(even_y(k)), even_x(k));
        const double beyond = lane(model.beyond_edge(e, Pack(pixel[0]), Pack(pixel[1])), 0);
        if (!(beyond < kEdgeWithin && beyond > -kEdgeBeyond)) continue;
        pixels.push_back(pixel), ++found;
      }
      continue;
    }
    for (int k = 0; k < kAtEdges; ++k)
      add(std::max(0.0, circle->radius - kEdgeWithin + (kEdgeWithin + 0.7) * even_y(k)), even_x(k));
    // The hardest are few: pixels that a circle touches from within, along the axes, and those it crosses from corner
    // to corner.
    constexpr int kHard = 12;
    for (int k = 0; k < kHard; ++k) {
      const double turn = (even_x(k) - 0.5) / std::max(1.0, circle->radius);
      add(std::max(0.0, circle->radius + 1.4 * (even_y(k) - 0.5)), 0.25 * (k % 2) + 0.16 * turn);
      add(std::max(0.0, circle->radius + 0.2 * (even_y(k) - 0.5)), 0.125 + 0.25 * (k % 2) + 0.1 * turn);
    }
  }
  if (!pixels.empty()) {
    double left = 0;
    constexpr int kFewest = 3;
    plan.means.edge_points = fewest_points(pixels, kFewest, kMostPoints / 2, target, left, cut);
    worst = std::max(worst, left);
  }
  std::vector<std::array<double, 2>> about;
  constexpr int kAbout = 24;
  for (const auto& [column, row] : model.defects())
    for (int k = 0; k < kAbout; ++k) {
      const double within = k % 2 == 0 ? 0.5 : kDefectWithin;  // the hardest have it within
      about.push_back({column + within * (2 * even_x(k) - 1), row + within * (2 * even_y(k) - 1)});
    }
  if (!about.empty()) {
    double left = 0;
    // With more than so many lines what is left is the table's own error about the defect.
    constexpr int kMostAbout = 16;
    plan.means.defect_points =
        fewest_points(about, plan.means.edge_points, std::max(kMostAbout, plan.means.edge_points), target, left, cut);
    worst = std::max(worst, left);
  }
  plan.reasons.push_back(fmt::format(
      "pixels are means over their area: up to {0} x {0} points where fringes or a defect are finer than a "
      "pixel, {1} lines across rims and edges, measured: they are good to {2:.1e}",
      *std::max_element(plan.means.samples.begin(), plan.means.samples.end()), plan.means.edge_points, worst));
  plan.numerical_error = std::max(plan.numerical_error, worst);
}

}  // namespace birefit
