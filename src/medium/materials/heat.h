#pragma once
// Heat conduction into a plate and the index law of the source paper's heated plate.

#include <numbers>

#include "core/scalar.h"

namespace birefit {

inline constexpr double kE44Steinberg2020Ordinary = 1.53;

/// Steinberg TOG 2020 eq. 38, n_e at 640 nm of its "E44". Real E44 at 25 C has 1.774 where this gives 1.797.
template <class S>
S e44_steinberg2020_extraordinary(const S& temperature_k) {
  return 2.1942 - temperature_k * (1.0 / 750);
}

/// (T - T_cold)/(T_hot - T_cold) at x = distance from the cold face / thickness in a plate that was uniformly cold and
/// whose face x = 1 is held hot since the time fourier_number * thickness^2 / diffusivity ago (Carslaw & Jaeger,
/// Conduction of Heat in Solids, 3.4). Images in erfc below Fourier number 0.1 (three suffice), eigenfunctions above
/// (eight terms): both are within 1e-12 of each other at the change-over. fourier_number > 0.
template <class S>
S heat_fraction(const S& x, const S& fourier_number) {
  const double fo = largest(plain(fourier_number));
  if (fo < 0.1) {
    const S scale = 0.5 / sqrt(fourier_number);
    S u(0.0);
    for (int k = 0; k < 3; ++k) u = u + erfc(((2.0 * k + 1.0) - x) * scale) - erfc(((2.0 * k + 1.0) + x) * scale);
    return u;
  }
  constexpr double pi = std::numbers::pi;
  S u = x;
  for (int n = 1; n <= 8; ++n)
    u = u +
        (2.0 / (n * pi) * (n % 2 ? -1.0 : 1.0)) * exp(fourier_number * (-double(n) * n * pi * pi)) * sin(x * (n * pi));
  return u;
}

}  // namespace birefit
