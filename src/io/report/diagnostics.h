#pragma once
// A report's charts of the search and of the residuals.

#include <string>
#include <vector>

#include "birefit/fit.h"
#include "io/report/pictures.h"

namespace birefit::page {

/// "" where there is nothing to draw. `figure`: the number of the next one.
std::string diagnostics(const FitResult& result, const std::vector<Frame>& frames, int& figure);

}  // namespace birefit::page
