#pragma once
// A middle and a spread that a few wild values do not move.

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

namespace birefit {

/// Standard deviation of a normal distribution over its median absolute deviation.
inline constexpr double kNormalSdPerMad = 1.482602218505602;

/// The mean of the two middle values where their number is even; 0 of none.
inline double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return values.size() % 2 ? *middle : 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

/// The value that `share` of them, 0 to 1, stay below; 0 of none.
inline double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace birefit
