#include "app/output.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <iostream>

#include <fmt/format.h>
#include <unistd.h>

#include "birefit/error.h"
#include "core/printable.h"

namespace birefit {
namespace {

namespace fs = std::filesystem;

/// Permissions alone do not tell (full disk, read-only mount, root): a file is written and removed.
bool can_write_in(const fs::path& folder) {
  // mkstemp makes a file that was not there, whatever links others have put there; without its name it is gone with
  // this program, whatever ends it.
  std::string probe = (folder / ".birefit-probe-XXXXXX").string();
  const int descriptor = ::mkstemp(probe.data());
  if (descriptor < 0) return false;
  ::unlink(probe.c_str());
  const bool written = ::write(descriptor, "birefit", 7) == 7;
  return ::close(descriptor) == 0 && written;
}

}  // namespace

OutputFolder::OutputFolder(const fs::path& folder) {
  std::error_code code;
  if (fs::exists(folder, code) && !fs::is_directory(folder, code))
    throw UserError({folder.string()}, "is a file, expected a folder for the results", "choose another --out");
  std::vector<fs::path> missing;
  for (fs::path part = fs::absolute(folder).lexically_normal(); !part.empty() && !fs::exists(part, code);
       part = part.parent_path()) {
    missing.insert(missing.begin(), part);
    if (part == part.parent_path()) break;
  }
  for (const fs::path& part : missing) {
    if (part.filename().empty()) continue;  // a trailing slash
    if (!fs::create_directory(part, code) || code) {
      for (auto made = made_.rbegin(); made != made_.rend(); ++made) fs::remove(*made, code);
      throw UserError({folder.string()}, "cannot be created as a folder for the results", "choose another --out");
    }
    made_.push_back(part);
  }
  if (!can_write_in(folder)) {
    for (auto made = made_.rbegin(); made != made_.rend(); ++made) fs::remove(*made, code);
    throw UserError({folder.string()}, "cannot be written to (permissions, or the disk is full)",
                    "choose another --out");
  }
}

OutputFolder::~OutputFolder() {
  std::error_code ignored;
  // remove, not remove_all: a folder that holds anything stays.
  for (auto made = made_.rbegin(); made != made_.rend(); ++made) fs::remove(*made, ignored);
}

void make_folder(const std::string& folder) {
  std::error_code failure;
  fs::create_directories(folder, failure);
  if (failure)
    throw UserError(Where{}, folder + " cannot be made: " + failure.message(), "name a folder that can be written");
}

void check_output_file(const fs::path& file, const std::vector<std::string>& extensions) {
  std::string extension = file.extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  if (std::find(extensions.begin(), extensions.end(), extension) == extensions.end()) {
    std::string known;
    for (const std::string& e : extensions) known += (known.empty() ? "" : ", ") + e;
    throw UserError({file.string()}, "the name of the output must end in " + known);
  }
  std::error_code code;
  if (fs::is_directory(file, code)) throw UserError({file.string()}, "is a folder, expected the name of a file");
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  if (!fs::is_directory(folder, code))
    throw UserError({file.string()}, "its folder " + folder.string() + " does not exist");
  if (!can_write_in(folder))
    throw UserError({file.string()}, "its folder cannot be written to (permissions, or the disk is full)");
}

void check_replaces_none(const fs::path& file, const std::vector<fs::path>& inputs) {
  std::error_code code;
  for (const fs::path& input : inputs)
    if (fs::equivalent(file, input, code))
      throw UserError({file.string()}, "is read by the config and would be replaced", "choose another --out");
}

std::string csv_number(double x) { return std::isfinite(x) ? fmt::format("{:.6g}", x) : std::string(); }

void print_warnings(const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings) std::cerr << "warning: " << printable(warning) << "\n";
}

}  // namespace birefit
