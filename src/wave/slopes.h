#pragma once
// Derivatives through functions that are known by their values and slopes alone.

#include "core/scalar.h"

namespace birefit {

/// x - plain(x): no value, only derivatives. f(x) is then f + f' change(x) with f and f' plain numbers, much less work
/// than a chain of duals where f is long; nothing at all for double.
template <class S>
S change(const S& x) {
  if constexpr (ScalarTraits<S>::derivatives == 0)
    return 0.0;
  else
    return x - plain(x);
}
template <class S>
Complex<double> value_of(const Complex<S>& a) {
  return {plain(a.re), plain(a.im)};
}

}  // namespace birefit
