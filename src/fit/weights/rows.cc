#include "fit/weights/rows.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/robust.h"

namespace birefit {
RowFindings look_at_rows(const std::vector<double>& x, const std::vector<double>& y) {
  RowFindings found;
  const std::size_t n = y.size();
  constexpr std::size_t kAround = 4;
  if (n < 2 * kAround + 1) return found;
  std::vector<double> off(n), size(n);
  for (std::size_t i = 0; i < n; ++i) {
    // From the line through its neighbours, one that some of them may be off (Theil & Sen).
    const std::size_t from = std::min(i > kAround ? i - kAround : 0, n - 2 * kAround - 1), to = from + 2 * kAround + 1;
    std::vector<double> slopes, heights;
    for (std::size_t j = from; j < to; ++j)
      for (std::size_t k = j + 1; k < to; ++k)
        if (j != i && k != i && x[k] != x[j]) slopes.push_back((y[k] - y[j]) / (x[k] - x[j]));
    const double slope = median(slopes);
    for (std::size_t j = from; j < to; ++j)
      if (j != i) heights.push_back(y[j] + slope * (x[i] - x[j]));
    off[i] = y[i] - median(heights);
    size[i] = std::abs(off[i]);
  }
  found.scatter = kNormalSdPerMad * median(size);
  // A table without noise has no outliers: what its curve does between nine rows is not known. Where a curve bends, its
  // neighbours are off as well.
  for (std::size_t i = 0; i < n; ++i) {
    std::vector<double> beside;
    for (std::size_t j = std::max<std::size_t>(i, 2) - 2; j < std::min(n, i + 3); ++j)
      if (j != i) beside.push_back(size[j]);
    if (found.scatter > 0 && size[i] > 8 * found.scatter && size[i] > 4 * median(beside)) found.outliers.push_back(i);
  }

  // Each row against the line between those that were taken at another time on either side of its x.
  constexpr std::size_t kLater = 10;
  std::vector<std::size_t> by_x(n);
  std::iota(by_x.begin(), by_x.end(), std::size_t{0});
  std::stable_sort(by_x.begin(), by_x.end(), [&](std::size_t a, std::size_t b) { return x[a] < x[b]; });
  const double same = 0.01 * (x[by_x.back()] - x[by_x.front()]);
  std::vector<double> differences;
  for (std::size_t at = 0; at < n; ++at) {
    const std::size_t i = by_x[at];
    const auto later = [&](std::size_t j) { return (j > i ? j - i : i - j) > kLater; };
    std::size_t below = at, above = at;
    while (below > 0 && !later(by_x[below]) && x[i] - x[by_x[below - 1]] <= same) --below;
    while (above + 1 < n && !later(by_x[above]) && x[by_x[above + 1]] - x[i] <= same) ++above;
    std::size_t a = by_x[below], b = by_x[above];
    if (!later(a) && x[b] == x[i]) a = b;
    if (!later(b) && x[a] == x[i]) b = a;
    if (!later(a) || !later(b)) continue;
    const double share = x[b] > x[a] ? (x[i] - x[a]) / (x[b] - x[a]) : 0.5;
    differences.push_back(std::abs(y[i] - (y[a] + share * (y[b] - y[a]))));
  }
  found.compared = static_cast<int>(differences.size());
  found.hysteresis = median(differences);
  return found;
}

}  // namespace birefit
