#pragma once
// The numbers of a scene as scalars of any kind.

#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "birefit/scene.h"
#include "core/scalar.h"

namespace birefit {

class Memo;  // birefit/memo.h

/// Theta as scalars S: entry active[j] carries derivative j.
template <class S>
class Values {
 public:
  /// `memo`: of what is worked out from them; may be null.
  Values(const Theta& theta, std::vector<int> active, Memo* memo = nullptr)
      : theta_(theta), active_(std::move(active)), memo_(memo) {}
  S operator()(ParameterRef ref) const {
    S value(ref.in(theta_));
    if constexpr (ScalarTraits<S>::derivatives > 0) {
      for (std::size_t j = 0; j < active_.size(); ++j)
        if (active_[j] == ref.index) value.d[j] = PlainOf<S>(ref.times);
    }
    return value;
  }
  const Theta& theta() const { return theta_; }
  const std::vector<int>& active() const { return active_; }
  Memo* memo() const { return memo_; }
  /// The same values as another scalar.
  template <class T>
  Values<T> as() const {
    return {theta_, active_, memo_};
  }
  S get(ParameterRef ref, double fallback) const { return ref ? (*this)(ref) : S(fallback); }
  S radians(ParameterRef ref, double fallback_deg = 0) const {
    return get(ref, fallback_deg) * (std::numbers::pi / 180);
  }

 private:
  const Theta& theta_;
  std::vector<int> active_;
  Memo* memo_;
};

template <class S>
inline constexpr int kLanesOf = std::is_same_v<PlainOf<S>, Pack> ? kLanes : 1;

/// `x` is `value` to rounding and no parameter moves it.
template <class S>
bool stays_at(const S& x, double value) {
  bool stays = std::abs(lane(plain(x), 0) - value) < 1e-9;
  if constexpr (ScalarTraits<S>::derivatives > 0)
    for (const auto& d : x.d) stays = stays && lane(d, 0) == 0;
  return stays;
}
/// 2 pi / wavelength in 1/um.
template <class S>
S wavenumber_per_um(const Scene& scene, const Values<S>& value) {
  return (2000 * std::numbers::pi) / value(scene.microscope.wavelength_nm);
}

/// The same wavelength in um.
template <class S>
S wavelength_um(const Scene& scene, const Values<S>& value) {
  return value(scene.microscope.wavelength_nm) * 1e-3;
}
}  // namespace birefit
