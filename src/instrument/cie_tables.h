#pragma once
// Tables of the CIE, as published (sources beside the numbers).

#include <array>
#include <cstddef>

namespace birefit {

inline constexpr std::size_t kMatchingCount = 471;
inline constexpr double kMatchingFromUm = 0.360, kMatchingStepUm = 0.001;
/// Colour matching functions x, y, z of the 2 degree observer of 1931 at kMatchingFromUm + i kMatchingStepUm.
extern const std::array<std::array<double, 3>, kMatchingCount> kMatching;

inline constexpr std::size_t kDaylightCount = 107;
inline constexpr double kDaylightFromUm = 0.300, kDaylightStepUm = 0.005;
/// Relative spectral power of illuminant D65 at kDaylightFromUm + i kDaylightStepUm.
extern const std::array<double, kDaylightCount> kDaylight;

}  // namespace birefit
