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

}  // namespace
}  // namespace birefit
