// The middle of a picture that looks the same upside down.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "fit/search/centre.h"

namespace birefit::estimation {
namespace {

/// A cross of rings between crossed polarizers on a background, at (x, y).
Image rings(int width, int height, double x, double y, double radius) {
  Image image(width, height);
  for (int row = 0; row < height; ++row)
    for (int column = 0; column < width; ++column) {
      const double dx = column - x, dy = row - y, r = std::hypot(dx, dy);
      const double sine = r > 0 ? 2 * dx * dy / (r * r) : 0,
                   retardance = 9 * std::sqrt(std::max(0.0, 1 - r * r / (radius * radius)));
      image(column, row) = 120 + 800 * sine * sine * std::pow(std::sin(retardance), 2);
    }
  return image;
}

// A hundredth of the longer side, wherever the rings are and whatever their size, with noise and with a corner masked.
TEST(CentreOfSymmetry, IsTheMiddleOfTheRings) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise(0, 20);
  for (const auto& [size, x, y, radius] : {std::array{64.0, 40.3, 27.8, 18.0}, std::array{300.0, 110.0, 140.5, 90.0},
                                           std::array{200.0, 150.2, 60.9, 30.0}}) {
    Image image = rings(static_cast<int>(size), static_cast<int>(0.9 * size), x, y, radius);
    for (double& value : image.values()) value += noise(random);
    Mask used(image.width(), image.height(), 1);
    for (int row = 0; row < image.height() / 10; ++row)
      for (int column = 0; column < image.width() / 10; ++column) used(column, row) = 0, image(column, row) = 1e5;
    const auto centre = centre_of_symmetry(image, used);
    ASSERT_TRUE(centre);
    EXPECT_NEAR((*centre)[0], x, 0.01 * size);
    EXPECT_NEAR((*centre)[1], y, 0.01 * size);
  }
}

// The region's own middle, (47.5, 47.5), is not that of the sample.
TEST(CentreOfSymmetry, IsTheSamplesWhereTheRegionLiesWithinIt) {
  std::mt19937_64 random(4);
  std::normal_distribution<double> noise(0, 20);
  constexpr double kX = 49.1, kY = 45.8;
  Image image(96, 96);
  Mask used(96, 96, 0);
  for (int y = 0; y < 96; ++y)
    for (int x = 0; x < 96; ++x) {
      const double u = (x - kX) / 40, v = (y - kY) / 40;
      image(x, y) = 500 + 400 * std::cos(9 * u * u + 25 * v * v + 6 * u * v) + noise(random);
      used(x, y) = std::hypot(x - 47.5, y - 47.5) < 36;
    }
  const auto centre = centre_of_symmetry(image, used);
  ASSERT_TRUE(centre);
  EXPECT_NEAR((*centre)[0], kX, 0.96);
  EXPECT_NEAR((*centre)[1], kY, 0.96);
}

TEST(CentreOfSymmetry, HasNoneInAnEvenImage) {
  const Image even(40, 40, 7.0);
  EXPECT_FALSE(centre_of_symmetry(even, Mask(40, 40, 1)));
  EXPECT_FALSE(centre_of_symmetry(even, Mask(40, 40, 0)));
}

}  // namespace
}  // namespace birefit::estimation
