// What stands out of a residual, and what does not.

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "fit/weights/outliers.h"

namespace birefit::estimation {
namespace {

Image noise(int width, int height, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Image image(width, height);
  for (double& v : image.values()) v = normal(random);
  return image;
}

TEST(Outliers, WhiteNoiseHasNone) {
  // 20 images of 65,536 pixels at four scales: one pixel in 10^7 makes 0.1 in all.
  int found = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) found += find_outliers(noise(256, 256, seed), Mask(256, 256, 1)).spots;
  EXPECT_LE(found, 2);
}

TEST(Outliers, AHotPixelTakesItsNeighboursAlong) {
  Image image = noise(100, 80, 1);
  image(30, 40) = 20;
  Mask used(100, 80, 1);
  used(31, 40) = 0;
  const Outliers found = find_outliers(image, used);
  EXPECT_EQ(found.spots, 1);
  EXPECT_EQ(found.count, 8);  // three by three, less the unused one
  EXPECT_EQ(found.pixels(31, 40), 0);
  EXPECT_EQ(found.pixels(31, 41), 1);
  EXPECT_NEAR(found.largest_column, 30, 1);
  EXPECT_NEAR(found.largest_row, 40, 1);
}

TEST(Outliers, AFaintSpeckShowsByItsNeighbourhood) {
  // 1.5 deviations each, far below any limit on single pixels; over 9 x 9 of them 13.5.
  Image image = noise(128, 128, 2);
  for (int y = 60; y < 69; ++y)
    for (int x = 50; x < 59; ++x) image(x, y) += 1.5;
  const Outliers found = find_outliers(image, Mask(128, 128, 1));
  EXPECT_GE(found.spots, 1);
  EXPECT_EQ(found.pixels(54, 64), 1);
  EXPECT_LT(found.count, 400);
}

TEST(Outliers, AMisfitThatFollowsFringesIsNoOutlierButDustOnItIs) {
  Image image = noise(200, 200, 3);
  for (int y = 0; y < 200; ++y)
    for (int x = 0; x < 200; ++x) image(x, y) += 8 * std::sin(0.4 * std::hypot(x - 100, y - 100));
  EXPECT_EQ(find_outliers(image, Mask(200, 200, 1)).count, 0);
  for (int y = 48; y < 53; ++y)
    for (int x = 120; x < 125; ++x) image(x, y) += 120;
  const Outliers found = find_outliers(image, Mask(200, 200, 1));
  EXPECT_EQ(found.spots, 1);
  EXPECT_EQ(found.pixels(122, 50), 1);
  EXPECT_LT(found.count, 120);
}

}  // namespace
}  // namespace birefit::estimation
