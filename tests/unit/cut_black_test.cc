// Pixels that pile up at the lowest code.

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "io/config_pixels.h"

namespace birefit {
namespace {

constexpr int kSize = 64;
const PixelRect kAll{0, 0, kSize, kSize};

double light_at(int x, int y) { return 3000 * std::exp(-0.04 * (std::pow(x - 30, 2) + std::pow(y - 33, 2))); }

/// A bright bump on dark ground at `black`, with noise, in codes of `step`, never below 0.
LoadedImage picture(double black, double noise, double step) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  LoadedImage image;
  image.values = Image(kSize, kSize);
  image.top_code = 65535;
  for (int y = 0; y < kSize; ++y)
    for (int x = 0; x < kSize; ++x)
      image.values(x, y) = std::max(0.0, step * std::round((black + light_at(x, y) + noise * normal(random)) / step));
  return image;
}

TEST(CutBlack, IsFoundWithItsShare) {
  for (const double step : {1.0, 16.0}) {
    const double noise = 3 * step;
    const auto cut = find_cut_black(picture(0, noise, step), kAll, step);
    ASSERT_TRUE(cut) << step;
    EXPECT_EQ(cut->code, 0);
    double expected = 0;  // what rounds to nothing or less
    for (int y = 0; y < kSize; ++y)
      for (int x = 0; x < kSize; ++x)
        expected += 0.5 * std::erfc((light_at(x, y) - 0.5 * step) / noise / std::sqrt(2.0)) / (kSize * kSize);
    // Three standard deviations of that many pixels.
    EXPECT_NEAR(cut->share, expected, 3 * 0.5 / kSize);
  }
}

TEST(CutBlack, IsNotTheGroundOfAPictureWithABlackLevel) {
  for (const double step : {1.0, 16.0}) EXPECT_FALSE(find_cut_black(picture(100 * step, 3 * step, step), kAll, step));
}

TEST(CutBlack, IsNotTheOneCodeOfGroundWithoutNoise) { EXPECT_FALSE(find_cut_black(picture(0, 0, 200), kAll, 200)); }

}  // namespace
}  // namespace birefit
