// The noise of an image from the image itself, fringes and all.

#include "fit/weights/noise.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

namespace birefit::estimation {
namespace {

struct Truth {
  double read, counts_per_photon;
};

/// Fringes of the given period along the diagonal, 100 to 3100 counts, Gaussian read and photon noise, rounded.
Micrograph fringes(const Truth& truth, double period, unsigned seed, bool rounded = true) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Micrograph micrograph;
  micrograph.values = Image(256, 256);
  micrograph.mask = Mask(256, 256, 1);
  for (int y = 0; y < 256; ++y)
    for (int x = 0; x < 256; ++x) {
      const double s = std::sin(std::numbers::pi * (x + y) / std::sqrt(2.0) / period);
      const double signal = 100 + 3000 * s * s;
      const double sd = std::sqrt(truth.read * truth.read + truth.counts_per_photon * signal);
      const double value = signal + sd * normal(random);
      micrograph.values(x, y) = rounded ? std::round(value) : value;
    }
  return micrograph;
}

TEST(NoiseEstimate, FindsReadAndPhotonNoiseUnderFringes) {
  for (const Truth truth : {Truth{20, 1.0}, Truth{5, 0.25}, Truth{40, 0.1}})
    for (const double period : {12.0, 40.0}) {
      const NoiseModel noise = estimate_noise(fringes(truth, period, 7));
      EXPECT_TRUE(noise.estimated);
      // What weights need is the variance: dark, in the middle, bright. 65,000 correlated differences in bins give
      // a robust variance to about 3 %; three of that.
      for (const double signal : {300.0, 1600.0, 3000.0}) {
        const double expected = truth.read * truth.read + truth.counts_per_photon * signal;
        const double found = noise.read_counts * noise.read_counts + noise.counts_per_photon * signal;
        EXPECT_NEAR(found, expected, 0.1 * expected) << truth.read << ' ' << truth.counts_per_photon << ' ' << period;
      }
      EXPECT_NEAR(noise.counts_per_photon, truth.counts_per_photon, 0.1 * truth.counts_per_photon + 0.03);
    }
}

TEST(NoiseEstimate, IgnoresDustAndMaskedPixels) {
  Micrograph micrograph = fringes({20, 0.0}, 30, 5);
  std::mt19937_64 random(9);
  for (int i = 0; i < 300; ++i) {
    const int x = static_cast<int>(random() % 256), y = static_cast<int>(random() % 256);
    micrograph.values(x, y) = i % 2 ? 4000 : std::numeric_limits<double>::quiet_NaN();
    if (i % 2 == 0) micrograph.mask(x, y) = 0;
  }
  const NoiseModel noise = estimate_noise(micrograph);
  // 150 specks spoil 25 differences each, 6 % of all: the median moves by about that.
  EXPECT_NEAR(std::sqrt(noise.read_counts * noise.read_counts + 1500 * noise.counts_per_photon), 20, 0.15 * 20);
}

TEST(NoiseEstimate, NeverFallsBelowTheRoundingOfCounts) {
  const NoiseModel noise = estimate_noise(fringes({0, 0}, 60, 1));
  EXPECT_GE(noise.read_counts, std::sqrt(1.0 / 12) * (1 - 1e-12));
  const NoiseModel exact = estimate_noise(fringes({0, 0}, 60, 1, false));
  EXPECT_GT(exact.read_counts, 0);
}

TEST(NoiseEstimate, IsInCountsWhenValuesAreTransmission) {
  const Truth truth{15, 0.5};
  Micrograph micrograph = fringes(truth, 25, 3);
  constexpr double kBright = 4000;  // parallel - dark
  micrograph.variance_scale = Image(256, 256, 1 / (kBright * kBright));
  for (double& value : micrograph.values.values()) value /= kBright;
  const NoiseModel noise = estimate_noise(micrograph);
  const double expected = truth.read * truth.read + truth.counts_per_photon * 1600;
  EXPECT_NEAR(noise.read_counts * noise.read_counts + noise.counts_per_photon * 1600, expected, 0.1 * expected);
  const Image sd = standard_deviation(micrograph, {truth.read, truth.counts_per_photon, false}, Image(256, 256, 0.4));
  EXPECT_NEAR(sd(100, 100), std::sqrt(expected) / kBright, 1e-12);
}

}  // namespace
}  // namespace birefit::estimation
