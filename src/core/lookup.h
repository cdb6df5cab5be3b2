#pragma once
// Reading a table of doubles at different places lane by lane. Lanes that are neighbours in a picture read neighbouring
// places: one load and one permutation serve them all, where a gather loads for every lane.

#include "core/scalar.h"

namespace birefit {

/// The `width` places that follow one address, in any order. Lookup(offset)(p) holds p[offset[k]] in lane k for every lane
/// whose offset is in [0, width) and anything in the others; p must be readable for `width` places.
template <class P>
class Lookup;

template <>
class Lookup<double> {
 public:
  static constexpr int width = 1;
  explicit Lookup(double) {}
  double operator()(const double* p) const { return *p; }
};

template <>
class Lookup<Pack> {
 public:
  static constexpr int width = kLanes;
#if defined(__AVX512F__)
  explicit Lookup(const Pack& offset) : order_(_mm512_cvtepi32_epi64(_mm512_cvtpd_epi32(offset))) {}
  BIREFIT_INLINE Pack operator()(const double* p) const {
    return _mm512_permutexvar_pd(order_, _mm512_loadu_pd(p));
  }

 private:
  __m512i order_;
#elif defined(__AVX2__)
  // Doubles as pairs of floats, the only permutation over all of a register.
  explicit Lookup(const Pack& offset) {
    const __m256i twice = _mm256_slli_epi64(_mm256_cvtepi32_epi64(_mm256_cvtpd_epi32(offset)), 1);
    order_ = _mm256_or_si256(twice, _mm256_slli_epi64(_mm256_add_epi64(twice, _mm256_set1_epi64x(1)), 32));
  }
  BIREFIT_INLINE Pack operator()(const double* p) const {
    return _mm256_castps_pd(_mm256_permutevar8x32_ps(_mm256_castpd_ps(_mm256_loadu_pd(p)), order_));
  }

 private:
  __m256i order_;
#else
  explicit Lookup(const Pack& offset) {
    for (int k = 0; k < kLanes; ++k) order_[k] = static_cast<int>(lane(offset, k)) & (kLanes - 1);
  }
  Pack operator()(const double* p) const {
    alignas(64) double out[kLanes];
    for (int k = 0; k < kLanes; ++k) out[k] = p[order_[k]];
    return Pack::load_aligned(out);
  }

 private:
  int order_[kLanes];
#endif
};

}  // namespace birefit
