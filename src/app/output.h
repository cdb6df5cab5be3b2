#pragma once
// Whether results can be written is found out before the work, not after it.

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

/// Throws UserError unless the file's name ends in one of `extensions` and its folder can be written.
void check_output_file(const std::filesystem::path& file, const std::vector<std::string>& extensions);

/// One line each on stderr.
void print_warnings(const std::vector<std::string>& warnings);

}  // namespace birefit
