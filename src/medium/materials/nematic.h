#pragma once
// Temperature in the indices of a nematic: Haller's law and the four-parameter law, which are one law with different
// reference temperatures. docs/methods.md, "Materials".

#include "core/scalar.h"

namespace birefit {

/// n_e - n_o = birefringence ((1 - T/Tc)/(1 - T_ref/Tc))^exponent (Haller, Prog. Solid State Chem. 10, 103 (1975));
/// (n_e + 2 n_o)/3 = mean - slope (T - T_ref) (Li, Gauza, Wu, J. Appl. Phys. 96, 19 (2004), with T_ref = 0). Both
/// temperatures below Tc.
template <class S>
struct NematicLaw {
  S mean, birefringence;  ///< at the reference temperature
  S reference_k, inverse_clearing, exponent, mean_slope_per_k;

  template <class T>
  BIREFIT_INLINE void at(const T& temperature_k, T& ordinary, T& extraordinary) const {
    const T left = 1.0 - temperature_k * T(inverse_clearing);
    const S left_at_reference = 1.0 - reference_k * inverse_clearing;
    const T dn = T(birefringence) * exp(T(exponent) * log(left * T(1.0 / left_at_reference)));
    const T middle = T(mean) - T(mean_slope_per_k) * (temperature_k - T(reference_k));
    ordinary = middle - dn * (1.0 / 3);
    extraordinary = middle + dn * (2.0 / 3);
  }
};

}  // namespace birefit
