// Rings of a uniaxial plate in converging light: radii against the retardance they are defined by.

#include <gtest/gtest.h>

#include <cmath>

#include "samples/layers/rings.h"

namespace birefit {
namespace {

// The defining equation, solved by halving: no squaring, no closed form.
TEST(Rings, RetardanceIsAWholeNumberOfWaves) {
  for (const auto& [n_o, n_e] : {std::pair{2.286, 2.202}, {1.544, 1.553}, {1.658, 1.486}})
    for (double waves_over_thickness : {0.6e-4, 1e-3, 4e-3}) {
      const auto path = [&](double k) {
        return std::abs(n_o * std::sqrt(1 - k / (n_e * n_e)) - std::sqrt(n_o * n_o - k));
      };
      double low = 0, high = std::min(n_o, n_e) * std::min(n_o, n_e) * 0.999;
      if (path(high) < waves_over_thickness) continue;
      for (int i = 0; i < 200; ++i) {
        const double middle = 0.5 * (low + high);
        (path(middle) < waves_over_thickness ? low : high) = middle;
      }
      // The difference of two roots near 2 carries 4e-16; over its slope, at least 1e-3, that is below 1e-12 of k
      // near 1.
      EXPECT_NEAR(ring_kappa_squared(n_o, n_e, waves_over_thickness), low, 1e-12 / std::abs(n_o - n_e))
          << n_o << " " << n_e;
    }
}

// Small angles: r^2 = (wavelength/thickness) (n_o L)^2 m/(n_o - n_e). What is left out is of the order of m
// wavelength/thickness over the birefringence, here 3e-4, and of the birefringence itself, 4 %; and L is the apparent
// distance.
TEST(Rings, PaperFormulaForSmallAngles) {
  const double n_o = 2.286, dn = 0.084, d = 26000, wavelength = 0.6328, L = 700000;
  const double k = ring_kappa_squared(n_o, n_o - dn, wavelength / d);
  const double r = ring_radius(n_o, k, 1.0, d, L),
               paper = std::sqrt(wavelength / d / dn) * n_o * (L - d / 2 + d / 2 / n_o);
  EXPECT_NEAR(r / paper, std::pow(1 - dn / n_o, 1.0) / std::sqrt(1 - dn / (2 * n_o)), 1e-3);
}

}  // namespace
}  // namespace birefit
