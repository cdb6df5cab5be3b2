#pragma once
// Sensitivities of cameras, as measured (sources beside the numbers).

#include <array>
#include <cstddef>

namespace birefit {

inline constexpr std::size_t kNikonCount = 81;
inline constexpr double kNikonFromUm = 0.380, kNikonStepUm = 0.005;
/// Red, green and blue pixels of a Nikon D5100 at kNikonFromUm + i kNikonStepUm.
extern const std::array<std::array<double, 3>, kNikonCount> kNikonD5100;

}  // namespace birefit
