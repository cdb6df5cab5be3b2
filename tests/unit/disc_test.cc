// Synthetic droplets: I = sin^2(2 phi) sin^2(delta(b)/2) inside the disc, delta from the chord of a sphere.

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "birefit/io.h"

namespace birefit {
namespace {

struct Drop {
  int width = 160, height = 140;
  double x = 79.3, y = 70.6, radius = 50;
  double phase_rad = 15;  ///< largest retardance
  double noise = 0.02;    ///< sd as a fraction of the brightest ring
  double tilt = 0;        ///< of the background from left to right, same unit
  bool inverted = false;  ///< parallel polarizers
  unsigned seed = 1;
};

Image render_drop(const Drop& drop) {
  std::mt19937 generator(drop.seed);
  std::normal_distribution<double> normal;
  Image image(drop.width, drop.height);
  for (int y = 0; y < drop.height; ++y)
    for (int x = 0; x < drop.width; ++x) {
      double sum = 0;
      constexpr int kSub = 3;
      for (int j = 0; j < kSub; ++j)
        for (int i = 0; i < kSub; ++i) {
          const double u = x + (i + 0.5) / kSub - 0.5 - drop.x, v = y + (j + 0.5) / kSub - 0.5 - drop.y;
          const double b = std::hypot(u, v) / drop.radius;
          if (b >= 1) continue;
          // Retardance of a radial director vanishes at the centre and at the edge.
          const double delta = drop.phase_rad * 2.6 * b * b * std::sqrt(1 - b * b);
          const double s = std::sin(2 * std::atan2(v, u)) * std::sin(delta / 2);
          sum += s * s / (kSub * kSub);
        }
      const double signal =
          (drop.inverted ? 1 - sum : sum) + drop.tilt * x / drop.width + drop.noise * normal(generator);
      image(x, y) = 100 + 2000 * signal;
    }
  return image;
}

void expect_found(const Drop& drop, const std::string& what, double centre_px = 1.0, double radius_fraction = 0.05) {
  const DiscGuess guess = find_disc(render_drop(drop), {});
  EXPECT_NEAR(guess.center_x_px, drop.x, centre_px) << what;
  EXPECT_NEAR(guess.center_y_px, drop.y, centre_px) << what;
  EXPECT_NEAR(guess.radius_px / drop.radius, 1, radius_fraction) << what;
  EXPECT_GT(guess.contrast, 3) << what;
}

TEST(FindDisc, FindsDropletsOfManyRingCountsAndNoiseLevels) {
  for (const double phase : {3.0, 8.0, 15.0, 30.0})
    for (const double noise : {0.005, 0.02, 0.05, 0.1}) {
      Drop drop;
      drop.phase_rad = phase;
      drop.noise = noise;
      expect_found(drop, "phase " + std::to_string(phase) + " noise " + std::to_string(noise));
    }
}

TEST(FindDisc, FindsInvertedContrast) {
  for (const double noise : {0.005, 0.05}) {
    Drop drop;
    drop.inverted = true;
    drop.noise = noise;
    expect_found(drop, "noise " + std::to_string(noise));
  }
}

TEST(FindDisc, FindsDropletsOffCentreSmallAndLarge) {
  for (const double radius : {12.0, 25.0, 64.0}) {
    Drop drop;
    drop.radius = radius;
    drop.x = std::max(radius + 6, 60.25);
    drop.y = std::max(radius + 4, 80.75) - (radius > 60 ? 10 : 0);
    drop.phase_rad = std::min(15.0, radius / 3);
    expect_found(drop, "radius " + std::to_string(radius));
  }
}

TEST(FindDisc, FindsDropletsCroppedByAFifth) {
  for (const double noise : {0.01, 0.05}) {
    Drop drop;
    drop.noise = noise;
    drop.x = 30.4;  // a fifth of the diameter is cut off on the left
    expect_found(drop, "left, noise " + std::to_string(noise));
    drop.x = 128.3, drop.y = 100.2;  // and two sides
    expect_found(drop, "corner, noise " + std::to_string(noise), 1.5);
  }
}

TEST(FindDisc, IgnoresATiltedBackground) {
  for (const double tilt : {0.1, 0.3}) {
    Drop drop;
    drop.tilt = tilt;
    expect_found(drop, "tilt " + std::to_string(tilt));
  }
}

TEST(FindDisc, IgnoresMaskedAndNonFinitePixels) {
  Drop drop;
  Image image = render_drop(drop);
  Mask mask(image.width(), image.height(), 1);
  for (int y = 0; y < 20; ++y)
    for (int x = 0; x < 20; ++x) image(x, y) = 1e6, mask(x, y) = 0;
  image(80, 40) = std::nan("");
  const DiscGuess guess = find_disc(image, mask);
  EXPECT_NEAR(guess.center_x_px, drop.x, 1);
  EXPECT_NEAR(guess.center_y_px, drop.y, 1);
  EXPECT_NEAR(guess.radius_px / drop.radius, 1, 0.05);
}

TEST(FindDisc, WorksAtTheScaleOfLargeImages) {
  Drop drop;
  drop.width = 1400, drop.height = 1200, drop.x = 650.5, drop.y = 640.25, drop.radius = 420;
  expect_found(drop, "1400 x 1200", 2);
}

TEST(FindDisc, FlatImagesHaveNoContrast) {
  EXPECT_LT(find_disc(Image(64, 64, 5.0), {}).contrast, 3);
  EXPECT_LT(find_disc(Image(4, 4, 5.0), {}).contrast, 3);
  EXPECT_LT(find_disc(Image(64, 64, std::nan("")), {}).contrast, 3);
  EXPECT_LT(find_disc(Image(64, 64, 5.0), Mask(64, 64, 0)).contrast, 3);
  Image ramp(80, 60);
  for (int y = 0; y < 60; ++y)
    for (int x = 0; x < 80; ++x) ramp(x, y) = x + 2 * y;
  EXPECT_LT(find_disc(ramp, {}).contrast, 3);
}

TEST(FindDisc, NoiseAloneHasNoContrast) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    std::mt19937 generator(seed);
    std::normal_distribution<double> normal;
    Image image(128, 96);
    for (double& value : image.values()) value = 100 + 10 * normal(generator);
    EXPECT_LT(find_disc(image, {}).contrast, 3) << "seed " << seed;
  }
}

}  // namespace
}  // namespace birefit
