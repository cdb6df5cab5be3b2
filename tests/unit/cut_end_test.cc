// Pixels that pile up at the lowest or highest code.

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "io/config/pixels.h"

namespace birefit {
namespace {

constexpr int kCutSide = 64;
const PixelRect kAll{0, 0, kCutSide, kCutSide};

double light_at(int x, int y) { return 3000 * std::exp(-0.04 * (std::pow(x - 30, 2) + std::pow(y - 33, 2))); }

/// A bright bump on dark ground at `black`, with noise, in codes of `step`, never below 0.
LoadedImage picture(double black, double noise, double step) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  LoadedImage image;
  image.values = Image(kCutSide, kCutSide);
  image.top_code = 65535;
  for (int y = 0; y < kCutSide; ++y)
    for (int x = 0; x < kCutSide; ++x)
      image.values(x, y) = std::max(0.0, step * std::round((black + light_at(x, y) + noise * normal(random)) / step));
  return image;
}

TEST(CutEnd, IsFoundWithItsShare) {
  for (const double step : {1.0, 16.0}) {
    const double noise = 3 * step;
    const auto cut = find_cut_end(End::lowest, picture(0, noise, step).values, kAll);
    ASSERT_TRUE(cut) << step;
    EXPECT_EQ(cut->code, 0);
    double expected = 0;  // what rounds to nothing or less
    for (int y = 0; y < kCutSide; ++y)
      for (int x = 0; x < kCutSide; ++x)
        expected += 0.5 * std::erfc((light_at(x, y) - 0.5 * step) / noise / std::sqrt(2.0)) / (kCutSide * kCutSide);
    // Three standard deviations of that many pixels.
    EXPECT_NEAR(cut->share, expected, 3 * 0.5 / kCutSide);
  }
}

// Every code has its pixels by right, whatever the lowest one's share.
TEST(CutEnd, IsNotTheLowestOfFewCodes) {
  for (const double noise : {0.5, 1.0, 2.0})
    EXPECT_FALSE(find_cut_end(End::lowest, picture(3 * noise, noise, 1).values, kAll)) << noise;
}

// Of a small picture the one darkest pixel is a share above that of a pile, and next to none has its code.
TEST(CutEnd, IsNotThePixelThatHappensToBeDarkest) {
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  for (const int size : {8, 10, 12, 14}) {
    Image image(size, size);
    for (double& value : image.values()) value = std::round(20000 + 100 * normal(random));
    for (const End end : {End::lowest, End::highest})
      EXPECT_FALSE(find_cut_end(end, image, {0, 0, size, size})) << size;
    // A twelfth of it cut off is found all the same.
    for (double& value : image.values()) value = std::max(value, 19862.0);
    EXPECT_TRUE(find_cut_end(End::lowest, image, {0, 0, size, size})) << size;
  }
}

TEST(CutEnd, IsFoundWhereLightWasTooBright) {
  LoadedImage image = picture(100, 5, 1);
  for (double& value : image.values.values()) value = std::min(value, 2500.0);
  const auto cut = find_cut_end(End::highest, image.values, kAll);
  ASSERT_TRUE(cut);
  EXPECT_EQ(cut->code, 2500);
  EXPECT_FALSE(find_cut_end(End::highest, picture(100, 5, 1).values, kAll));
  // All of it: only another frame tells whether there was noise.
  const Image all(kCutSide, kCutSide, 2500);
  EXPECT_FALSE(find_cut_end(End::highest, all, kAll));
  EXPECT_FALSE(find_cut_end(End::highest, all, kAll, 0.2));
  EXPECT_TRUE(find_cut_end(End::highest, all, kAll, 5));
}

TEST(CutEnd, IsNotTheGroundOfAPictureWithABlackLevel) {
  for (const double step : {1.0, 16.0})
    EXPECT_FALSE(find_cut_end(End::lowest, picture(100 * step, 3 * step, step).values, kAll));
}

TEST(CutEnd, IsNotTheOneCodeOfGroundWithoutNoise) {
  EXPECT_FALSE(find_cut_end(End::lowest, picture(0, 0, 200).values, kAll));
}

}  // namespace
}  // namespace birefit
