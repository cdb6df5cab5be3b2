#pragma once
// Rows of a table that no model can follow: what stands out of its neighbours, and what depends on when it was
// measured.

#include <cstddef>
#include <vector>

namespace birefit {

/// What a table says about itself, in the order in which it was taken; x what was varied, y what was measured.
struct RowFindings {
  std::vector<std::size_t>
      outliers;  ///< rows that lie off the line through the eight around them by 8 robust standard deviations and more
  /// Median difference of rows from what was measured at the same x at another time (more than ten rows earlier or
  /// later), and what neighbouring rows scatter; compared: how many, 0 where no x came twice.
  double hysteresis = 0, scatter = 0;
  int compared = 0;
  bool hysteretic() const { return compared >= 10 && hysteresis > 5 * scatter; }
};
RowFindings look_at_rows(const std::vector<double>& x, const std::vector<double>& y);

}  // namespace birefit
