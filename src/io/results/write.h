#pragma once
// The files that a fit leaves behind.

#include <filesystem>
#include <string>
#include <vector>

#include "birefit/io.h"

namespace birefit {

/// As write_results (birefit/io.h), with fitted and residual pictures in each of these formats (".tif", ".npy"). Those
/// of an earlier fit in the folder that this one does not replace go away.
void write_results(const std::filesystem::path& folder, const Config& config, const FitResult& result,
                   const std::vector<std::string>& picture_formats);

/// What log.txt says.
std::string log_text(const Config& config, const FitResult& result);

}  // namespace birefit
