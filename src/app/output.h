#pragma once
// Where and how results are written. Whether they can be is found out before the work, not after it.

#include <filesystem>
#include <string>
#include <vector>

namespace birefit {

/// A folder for results: made if absent and tried with a file. Removed again unless `keep` is called, so that a run
/// that fails leaves nothing. Throws UserError when it cannot be written.
class OutputFolder {
 public:
  explicit OutputFolder(const std::filesystem::path& folder);
  ~OutputFolder();
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;
  void keep() { made_.clear(); }

 private:
  std::vector<std::filesystem::path> made_;  ///< folders that did not exist before, outermost first
};

/// Makes the folder; UserError when it cannot.
void make_folder(const std::string& folder);

/// Throws UserError unless the file's name ends in one of `extensions` and its folder can be written.
void check_output_file(const std::filesystem::path& file, const std::vector<std::string>& extensions);

/// Throws UserError where the file is one of those that are read.
void check_replaces_none(const std::filesystem::path& file, const std::vector<std::filesystem::path>& inputs);

/// As CSV: empty when not finite.
std::string csv_number(double x);

/// One line each on stderr.
void print_warnings(const std::vector<std::string>& warnings);

}  // namespace birefit
