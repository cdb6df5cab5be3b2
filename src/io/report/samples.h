#pragma once
// A report's section of draws from the posterior.

#include <string>

#include "birefit/fit.h"

namespace birefit::page {

/// A table and a corner plot; "" without draws. `figure`: the number of the next one.
std::string samples_section(const FitResult& result, int& figure);

}  // namespace birefit::page
