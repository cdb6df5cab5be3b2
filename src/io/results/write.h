#pragma once
// The texts of the files that a fit leaves behind.

#include <string>

#include "birefit/io.h"

namespace birefit {

/// What log.txt says.
std::string log_text(const Config& config, const FitResult& result);

}  // namespace birefit
