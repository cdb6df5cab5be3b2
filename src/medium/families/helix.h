#pragma once
// A cholesteric helix partly unwound by a field across it (HelixDirector of director.h). u = depth / thickness.

#include <array>

#include "medium/families/planar.h"

namespace birefit {

/// Complete elliptic integrals of modulus k, 0 <= k < 1, by the arithmetic-geometric mean: K(k) and E(k).
/// Eight means are exact to rounding for 1 - k > 1e-15.
template <class S>
struct CompleteElliptic {
  S first, second;
};
template <class S>
CompleteElliptic<S> complete_elliptic(const S& k) {
  S a(1.0), b = sqrt(1.0 - k * k), weight(0.5), rest = 1.0 - 0.5 * k * k;  // E/K = 1 - sum 2^(n-1) c_n^2
  for (int i = 0; i < 8; ++i) {
    const S c = 0.5 * (a - b), mean = 0.5 * (a + b);
    b = sqrt(a * b);
    a = mean;
    weight = 2.0 * weight;
    rest = rest - weight * c * c;
  }
  const S first = (0.5 * std::numbers::pi) / a;
  return {first, first * rest};
}

/// azimuth = entry + am(rate u | k), handed as the pitch; am by its Fourier series (Abramowitz & Stegun 16.23.3),
/// am(x) = pi x / (2 K) + sum 2 q^n / (n (1 + q^2n)) sin(n pi x / K), whose terms fall as q^n: 80 leave 1e-16 up to k =
/// 1 - 1e-6.
template <class S>
struct UnwoundHelixLaw {
  static constexpr int kTerms = 80;
  S azimuth_rad, turn_rad;  ///< pi/(2 K) times the rate
  std::array<S, kTerms> wave;
  S ordinary, extraordinary, thickness_um;

  UnwoundHelixLaw(const S& pitch_um, const S& azimuth, const S& modulus, const S& o, const S& e, const S& thickness)
      : azimuth_rad(azimuth), ordinary(o), extraordinary(e), thickness_um(thickness) {
    const CompleteElliptic<S> elliptic = complete_elliptic(modulus);
    // The nome exp(-pi K'/K) is even in k; its slope pi^2 q / (2 k k'^2 K^2) by hand, since that of K' is infinite at k
    // = 0.
    using P = PlainOf<S>;
    const P k = max_of(plain(modulus), P(1e-150)), rest = 1.0 - k * k, first = plain(elliptic.first);
    const P nome = exp(-std::numbers::pi * complete_elliptic<P>(sqrt(rest)).first / first);
    S q(nome);
    if constexpr (ScalarTraits<S>::derivatives > 0)
      q = modulus.chain(nome, (0.5 * std::numbers::pi * std::numbers::pi) * nome / (k * rest * first * first));
    turn_rad = (0.5 * std::numbers::pi * std::numbers::pi * std::numbers::pi) * thickness /
               (pitch_um * elliptic.second * elliptic.first);
    S power(1.0);
    for (int n = 1; n <= kTerms; ++n) {
      power = power * q;
      wave[static_cast<std::size_t>(n - 1)] = 2.0 * power / (static_cast<double>(n) * (1.0 + power * power));
    }
  }
  template <class T>
  OpticalPoint<T> at(const T& u) const {
    const T angle = T(turn_rad) * u;
    T s, c;
    sin_cos(2.0 * angle, s, c);
    // Clenshaw's recurrence for a sine series.
    T next(0.0), after(0.0);
    for (int n = kTerms - 1; n >= 0; --n) {
      const T here = T(wave[static_cast<std::size_t>(n)]) + 2.0 * c * next - after;
      after = next;
      next = here;
    }
    return {axis_from_angles<T>(T(0.0), T(azimuth_rad) + angle + next * s),
            T(ordinary),
            T(extraordinary),
            T(0.0),
            T(0.0),
            T(thickness_um)};
  }
};

}  // namespace birefit
