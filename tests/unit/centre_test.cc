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

TEST(CentreOfSymmetry, HasNoneInAnEvenImage) {
  const Image even(40, 40, 7.0);
  EXPECT_FALSE(centre_of_symmetry(even, Mask(40, 40, 1)));
  EXPECT_FALSE(centre_of_symmetry(even, Mask(40, 40, 0)));
}

}  // namespace
}  // namespace birefit::estimation
