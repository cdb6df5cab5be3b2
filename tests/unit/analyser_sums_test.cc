// The sums of crossed analysers in a polarization mosaic: which curve lies between light and codes.

#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "io/images/analyser_sums.h"

namespace birefit {
namespace {

constexpr int kSide = 160;
constexpr std::array<std::array<double, 2>, 2> kCell = {{{90, 45}, {135, 0}}};

/// Codes of a smooth scene whose light is polarized by `purity` in a direction that turns across it; `gain` of the
/// pixels behind 45 degrees.
Image codes(double gamma, double purity, double turns, double gain, double black) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise(0, 0.5);
  Image image(kSide, kSide);
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x) {
      const double azimuth = std::numbers::pi * turns * x / kSide, light = 0.3 + 0.4 * std::pow(std::sin(0.03 * y), 2);
      const double analyser = kCell[static_cast<std::size_t>(y % 2)][static_cast<std::size_t>(x % 2)];
      double value = light * (1 + purity * std::cos(2 * (azimuth - analyser * std::numbers::pi / 180))) / 2;
      if (analyser == 45) value *= gain;
      image(x, y) = std::round(black + 1000 * std::pow(value, 1 / gamma) + noise(random)) / 1023;
    }
  return image;
}
std::optional<AnalyserSums> sums(const Image& image) {
  return analyser_sums(image, Mask(kSide, kSide, 1), {0, 0, kSide, kSide}, kCell);
}

TEST(AnalyserSums, TellTheGammaOfTheCodes) {
  for (const double gamma : {1.0, 1.8, 2.2}) {
    const auto found = sums(codes(gamma, 0.8, 1, 1, 0));
    ASSERT_TRUE(found) << gamma;
    EXPECT_LT(std::abs(found->gamma - gamma), 4 * found->error + 0.01 * gamma) << found->error;  // whole codes
    EXPECT_LT(found->error, 0.1);
  }
}

TEST(AnalyserSums, DoNotTakeABlackLevelForAGamma) {
  const auto found = sums(codes(1, 0.8, 1, 1, 20));
  ASSERT_TRUE(found);
  EXPECT_LT(std::abs(found->gamma - 1), 4 * found->error + 0.01);
}

TEST(AnalyserSums, DoNotTakeSensitivitiesForAGamma) {
  const auto found = sums(codes(1, 0.8, 1, 1.02, 0));
  ASSERT_TRUE(found);
  EXPECT_LT(std::abs(found->gamma - 1), 0.05);
}

TEST(AnalyserSums, SayNothingOfOneDirectionUnpolarizedLightAndOtherAngles) {
  EXPECT_FALSE(sums(codes(2.2, 0.8, 0, 1, 0)));
  const auto found = sums(codes(2.2, 0, 1, 1, 0));
  EXPECT_TRUE(!found || found->error > 0.3) << found->gamma << ' ' << found->error;
  EXPECT_FALSE(
      analyser_sums(codes(2.2, 0.8, 1, 1, 0), Mask(kSide, kSide, 1), {0, 0, kSide, kSide}, {{{0, 30}, {60, 90}}}));
}

}  // namespace
}  // namespace birefit
