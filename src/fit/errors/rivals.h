#pragma once
// Other minima that the data cannot exclude.

#include "fit/search/optimum.h"

namespace birefit::estimation {

struct Rivals {
  std::vector<RivalMinimum> minima;  ///< best first
};

/// Minima that survived the scan, with the weights of the final problem: misfit is paid for in the odds as well. The
/// optimum moves to the one that now ranks lowest.
Rivals weigh_rivals(const Task& task, Optimum& optimum);

}  // namespace birefit::estimation
