// The lanes' own inverses and roots.

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "core/scalar.h"

namespace birefit {
namespace {

// Two Newton steps from a 14-bit estimate leave rounding only: a few units in the last place.
TEST(Lanes, InversesAndRootsAreExactToRounding) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> exponent(-30, 30);
  const double tolerance = 4 * std::numeric_limits<double>::epsilon();
  for (int i = 0; i < 20000; ++i) {
    const double x = std::pow(10.0, exponent(random));
    EXPECT_NEAR(lane(inverse(Pack(x)), 0) * x, 1, tolerance) << x;
    EXPECT_NEAR(lane(inverse(Pack(-x)), 0) * -x, 1, tolerance) << x;
    EXPECT_NEAR(lane(root(Pack(x)), 0) / std::sqrt(x), 1, tolerance) << x;
    EXPECT_NEAR(lane(inverse_root(Pack(x)), 0) * std::sqrt(x), 1, tolerance) << x;
  }
}

// Phases of any size, each lane by itself, the neighbourhood of multiples of pi/2 and signed zeros among them.
TEST(Lanes, SinesAndCosinesAreExactToRounding) {
  std::mt19937_64 random(12);
  std::uniform_real_distribution<double> exponent(-12, 12), fraction(-1, 1);
  const double tolerance = 2 * std::numeric_limits<double>::epsilon();
  for (int i = 0; i < 20000; ++i) {
    alignas(64) double x[kLanes];
    for (int k = 0; k < kLanes; ++k) {
      x[k] = std::copysign(std::pow(10.0, exponent(random)), fraction(random));
      if ((i + k) % 3 == 0)
        x[k] = std::floor(1000 * fraction(random)) * 1.5707963267948966 * (1 + 1e-15 * fraction(random));
      if ((i + k) % 97 == 0) x[k] = std::copysign(0.0, fraction(random));
    }
    Pack s, c;
    sin_cos(Pack::load_aligned(x), s, c);
    for (int k = 0; k < kLanes; ++k) {
      EXPECT_NEAR(lane(s, k), std::sin(x[k]), tolerance) << x[k];
      EXPECT_NEAR(lane(c, k), std::cos(x[k]), tolerance) << x[k];
    }
  }
  Pack s, c;
  sin_cos(Pack(std::numeric_limits<double>::quiet_NaN()), s, c);
  EXPECT_TRUE(std::isnan(lane(s, 0)) && std::isnan(lane(c, 0)));
}

}  // namespace
}  // namespace birefit
