#pragma once
// The texts of the files that a fit leaves behind.

#include <string>
#include <vector>

#include "birefit/io.h"
#include "io/files/file.h"

namespace birefit {

/// What log.txt says.
std::string log_text(const Config& config, const FitResult& result);

/// All that write_results() writes, by the names that the files have in the folder; fit.json is the last.
std::vector<FileContent> result_files(const Config& config, const FitResult& result,
                                      const std::vector<std::string>& picture_formats);
/// Writes these: makes the folder, and takes away what an earlier fit left there and these do not replace.
void write_result_files(const std::filesystem::path& folder, std::vector<FileContent> files);

}  // namespace birefit
