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
/// UserError where a fit's results in this folder would replace a file that its config reads (a table called
/// fitted.csv, the fit.json of its prior), or the config itself by another (a config.yaml with what --set says).
void refuse_to_replace_inputs(const std::filesystem::path& folder, const Config& config);
/// Writes these: makes the folder, and takes away what an earlier fit left there and these do not replace.
void write_result_files(const std::filesystem::path& folder, std::vector<FileContent> files);

}  // namespace birefit
