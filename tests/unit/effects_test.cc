// What lens and camera do to a picture, to first order, against pictures that are known in closed form.

#include "fit/problem/effects.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace birefit::estimation {
namespace {

using Kind = PictureEffect::Kind;
constexpr int kSize = 64;
constexpr double kCenterX = 30.3, kCenterY = 33.1, kVariance = 60;

/// A Gaussian spot of unit height where its variance is kVariance, its light conserved, in a picture that is wider by
/// `x` and higher by `y` (logarithms), along axes turned by `turned` (rad).
Image spot(double variance, double x = 0, double y = 0, double turned = 0) {
  Image image(kSize, kSize);
  const double c = std::cos(turned), s = std::sin(turned);
  for (int row = 0; row < kSize; ++row)
    for (int column = 0; column < kSize; ++column) {
      const double dx = column - kCenterX, dy = row - kCenterY;
      const double u = (c * dx + s * dy) * std::exp(-x), v = (c * dy - s * dx) * std::exp(-y);
      image(column, row) = kVariance / variance * std::exp(-0.5 * (u * u + v * v) / variance);
    }
  return image;
}
KnownLight known(const Image& image) {
  KnownLight light(kSize, kSize);
  light.center_x = kCenterX, light.center_y = kCenterY;
  for (int y = 0; y < kSize; ++y)
    for (int x = 0; x < kSize; ++x) light.set(x, y, image(x, y));
  return light;
}
/// Largest difference from the derivative of `changed`, a picture for a small effect, away from the frame.
double largest_error(Kind kind, const std::function<Image(double)>& changed) {
  constexpr double kSmall = 1e-4;
  const KnownLight light = known(changed(0));
  const Image up = changed(kSmall), down = changed(-kSmall);
  double largest = 0;
  for (int y = 1; y + 1 < kSize; ++y)
    for (int x = 1; x + 1 < kSize; ++x)
      largest = std::max(largest, std::abs(effect_at(kind, light, x, y) - (up(x, y) - down(x, y)) / (2 * kSmall)));
  return largest;
}

// Differences over one pixel of a spot of this width: (1/sigma)^2 / 6 of a slope, / 12 of a Laplacian.
TEST(PictureEffects, ChangeAPictureAsTheyAreNamed) {
  const double relative = 1 / kVariance;
  EXPECT_LT(largest_error(Kind::blur, [](double v) { return spot(kVariance + v); }), 0.5 * relative / kVariance);
  EXPECT_LT(largest_error(Kind::stretch_x, [](double a) { return spot(kVariance, a, -a); }), relative);
  EXPECT_LT(largest_error(Kind::stretch_diagonal, [](double a) { return spot(kVariance, a, -a, M_PI / 4); }), relative);
  EXPECT_LT(largest_error(Kind::growth, [](double a) { return spot(kVariance, a, a); }), relative);
  const auto of_light = [](const std::function<double(double)>& curve) {
    Image image = spot(kVariance);
    for (double& v : image.values()) v = curve(v);
    return image;
  };
  EXPECT_LT(
      largest_error(Kind::gamma, [&](double g) { return of_light([g](double v) { return std::pow(v, 1 + g); }); }),
      1e-6);
  EXPECT_LT(
      largest_error(Kind::curve, [&](double c) { return of_light([c](double v) { return v * (1 + c * (v - 1)); }); }),
      1e-9);
}

// As the light does, by the spot's width and by where its centre is, to which a stretch refers: against differences.
TEST(PictureEffects, ChangeWithTheLight) {
  constexpr double kSmall = 1e-4;
  const auto moved = [](double by_x, double by_y) {  // the same spot elsewhere
    KnownLight light(kSize, kSize);
    light.center_x = kCenterX + by_x, light.center_y = kCenterY + by_y;
    for (int y = 0; y < kSize; ++y)
      for (int x = 0; x < kSize; ++x)
        light.set(x, y, std::exp(-0.5 * (std::pow(x - light.center_x, 2) + std::pow(y - light.center_y, 2)) / 60));
    return light;
  };
  struct Case {
    std::function<KnownLight(double)> at;
    double center_x, center_y;
  };
  const Case cases[] = {{[](double v) { return known(spot(kVariance + 100 * v)); }, 0, 0},
                        {[&](double v) { return moved(v, 0); }, 1, 0},
                        {[&](double v) { return moved(0, v); }, 0, 1}};
  for (const Kind kind : {Kind::gamma, Kind::curve, Kind::blur, Kind::stretch_x, Kind::stretch_diagonal, Kind::growth})
    for (const Case& one : cases) {
      const KnownLight here = one.at(0), up = one.at(kSmall), down = one.at(-kSmall);
      LightChange change{Image(kSize, kSize), one.center_x, one.center_y};
      for (std::size_t i = 0; i < change.light.size(); ++i)
        change.light.values()[i] = (up.light.values()[i] - down.light.values()[i]) / (2 * kSmall);
      double largest = 0, error = 0;
      for (int y = 1; y + 1 < kSize; ++y)
        for (int x = 1; x + 1 < kSize; ++x) {
          const double by = (effect_at(kind, up, x, y) - effect_at(kind, down, x, y)) / (2 * kSmall);
          largest = std::max(largest, std::abs(by));
          error = std::max(error, std::abs(by - effect_change_at(kind, here, change, x, y)));
        }
      EXPECT_GT(largest, 0);
      EXPECT_LT(error, 1e-4 * largest) << static_cast<int>(kind) << ' ' << one.center_x << ' ' << one.center_y;
    }
}

TEST(PictureEffects, TakeNoNeighbourThatIsNotKnown) {
  KnownLight light = known(spot(kVariance));
  light.known(40, 30) = 0;
  for (const Kind kind : {Kind::blur, Kind::stretch_x, Kind::stretch_diagonal, Kind::growth}) {
    EXPECT_EQ(effect_at(kind, light, 41, 30), 0);
    EXPECT_EQ(effect_at(kind, light, 0, 30), 0);
    EXPECT_NE(effect_at(kind, light, 42, 31), 0);
  }
  EXPECT_NE(effect_at(Kind::gamma, light, 41, 30), 0);
}

}  // namespace
}  // namespace birefit::estimation
