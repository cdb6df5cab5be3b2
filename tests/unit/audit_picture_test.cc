// What optics, cameras and files do to a picture, by closed forms.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "study/audit/picture.h"

namespace birefit::study {
namespace {

constexpr int kSize = 64;

template <class Of>
Image picture(const Of& of) {
  Image image(kSize, kSize);
  for (int y = 0; y < kSize; ++y)
    for (int x = 0; x < kSize; ++x) image(x, y) = of(x, y);
  return image;
}

TEST(AuditPicture, BlurAddsVariancesOfGaussians) {
  const auto gaussian = [](double variance) {
    return picture([=](int x, int y) {
      return std::exp(-0.5 * (std::pow(x - 31, 2) + std::pow(y - 33, 2)) / variance) / (2 * M_PI * variance);
    });
  };
  const Image seen = blurred(gaussian(9), 1.5), expected = gaussian(9 + 2.25);
  // A Gaussian of 1.5 px, sampled, has its variance to 1e-9, and ends beyond four of its deviations.
  for (std::size_t i = 0; i < seen.size(); ++i)
    EXPECT_NEAR(seen.values()[i], expected.values()[i], 1e-4 * expected(31, 33));
}

TEST(AuditPicture, AParabolaIsStretchedExactly) {
  const auto parabola = [](double x, double y) { return 1 + 0.3 * x - 0.2 * y + 0.01 * x * x + 0.02 * x * y; };
  const Image wide = stretched(picture(parabola), 0.05, 30, 32);
  for (int y = 8; y < kSize - 8; ++y)
    for (int x = 8; x < kSize - 8; ++x)
      EXPECT_NEAR(wide(x, y), parabola(30 + (x - 30) / 1.05, 32 + (y - 32) * 1.05), 1e-9);
}

TEST(AuditPicture, WhatIsShiftedIsElsewhereAndGroundBehindIt) {
  const auto line = [](double x, double y) { return 2 * x - y; };
  const Image moved = shifted(picture(line), 7.5, -3, -1000);
  EXPECT_NEAR(moved(20, 20), line(12.5, 23), 1e-9);
  EXPECT_EQ(moved(3, 20), -1000);
  EXPECT_EQ(moved(20, kSize - 1), -1000);
}

TEST(AuditPicture, CompressionLosesMoreTheCoarserItsSteps) {
  const Image codes =
      picture([](int x, int y) { return std::round(128 + 90 * std::sin(0.4 * x) * std::cos(0.3 * y)); });
  double before = 0;
  for (const int quality : {100, 95, 80, 50, 20}) {
    const Image stored = compressed(codes, quality);
    double squares = 0;
    for (std::size_t i = 0; i < codes.size(); ++i)
      squares += std::pow(stored.values()[i] - codes.values()[i], 2) / static_cast<double>(codes.size());
    EXPECT_GT(squares, before) << quality;
    // Steps of 1 err by 1/12 (Parseval: the cosines are orthonormal), and so does rounding to codes after.
    if (quality == 100) EXPECT_LT(squares, 2.0 / 12 * 1.1);
    before = squares;
  }
  // A block of one level has one cosine, of 8 times that, whose step is then 32.
  const Image even = compressed(Image(16, 16, 133), 25);
  for (const double v : even.values()) EXPECT_EQ(v, 132);
}

}  // namespace
}  // namespace birefit::study
