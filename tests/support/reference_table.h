#pragma once
// Numbers from elsewhere: the tables and images below tests/data, and the public micrographs outside the repository.

#include <array>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "birefit/image.h"

namespace birefit::testing {

/// data_path("physics/heat_profile.csv"): a file below tests/data.
inline std::filesystem::path data_path(const std::string& relative) {
  return std::filesystem::path(BIREFIT_SOURCE_DIR) / "tests" / "data" / relative;
}

/// A file of the public measurements: in data/real, where their smallest parts are shipped, else where tools/fetch_real
/// puts the rest, $BIREFIT_REAL_DATA or out/real. Empty when it is not there:
///   const auto image = real_data_path("crystal_aggregates/sample_1.tif");
///   if (!image) GTEST_SKIP() << kRealDataMissing;
inline std::optional<std::filesystem::path> real_data_path(const std::string& relative) {
  const std::filesystem::path source(BIREFIT_SOURCE_DIR);
  const char* given = std::getenv("BIREFIT_REAL_DATA");
  const std::filesystem::path fetched =
      given != nullptr && *given != '\0' ? std::filesystem::path(given) : source / "out" / "real";
  for (const std::filesystem::path& root : {source / "data" / "real", fetched}) {
    std::error_code ignored;
    if (std::filesystem::exists(root / relative, ignored)) return root / relative;
  }
  return std::nullopt;
}
inline constexpr const char* kRealDataMissing =
    "these public measurements are not part of the repository: tools/fetch_real fetches them";

/// A comma-separated table with one header line. Cells are kept as text; numbers are converted when asked for, `nan`
/// included. Everything that does not fit throws: a test must not pass on a table it did not read.
class ReferenceTable {
 public:
  explicit ReferenceTable(const std::filesystem::path& path) : name_(path.string()) {
    std::ifstream file(path);
    if (!file) throw std::runtime_error("no reference table " + name_);
    std::string line;
    while (std::getline(file, line)) {
      if (!line.empty() && line.back() == '\r') line.pop_back();
      if (line.empty()) continue;
      std::vector<std::string> cells = split(line);
      if (columns_.empty()) {
        for (const std::string& column : cells) columns_.emplace(column, columns_.size());
        continue;
      }
      if (cells.size() != columns_.size())
        throw std::runtime_error(name_ + ": data row " + std::to_string(rows_.size() + 1) + " has " +
                                 std::to_string(cells.size()) + " cells, the header " +
                                 std::to_string(columns_.size()));
      rows_.push_back(std::move(cells));
    }
    if (rows_.empty()) throw std::runtime_error(name_ + ": no rows");
  }

  std::size_t size() const { return rows_.size(); }
  bool has(const std::string& column) const { return columns_.count(column) != 0; }

  const std::string& text(std::size_t row, const std::string& column) const {
    const auto found = columns_.find(column);
    if (found == columns_.end()) throw std::runtime_error(name_ + ": no column " + column);
    return rows_.at(row)[found->second];
  }
  double number(std::size_t row, const std::string& column) const {
    const std::string& cell = text(row, column);
    char* end = nullptr;
    const double value = std::strtod(cell.c_str(), &end);
    if (cell.empty() || *end != '\0')
      throw std::runtime_error(name_ + ": column " + column + ", data row " + std::to_string(row + 1) + ": '" + cell +
                               "' is no number");
    return value;
  }
  std::vector<std::string> texts(const std::string& column) const {
    std::vector<std::string> all;
    for (std::size_t row = 0; row < size(); ++row) all.push_back(text(row, column));
    return all;
  }
  std::vector<double> numbers(const std::string& column) const {
    std::vector<double> all;
    for (std::size_t row = 0; row < size(); ++row) all.push_back(number(row, column));
    return all;
  }
  /// The rows whose `column` reads `value`.
  std::vector<std::size_t> rows_where(const std::string& column, const std::string& value) const {
    std::vector<std::size_t> found;
    for (std::size_t row = 0; row < size(); ++row)
      if (text(row, column) == value) found.push_back(row);
    return found;
  }

 private:
  static std::vector<std::string> split(const std::string& line) {
    std::vector<std::string> cells(1);
    for (const char c : line) {
      if (c == ',')
        cells.emplace_back();
      else
        cells.back() += c;
    }
    return cells;
  }

  std::string name_;
  std::map<std::string, std::size_t> columns_;
  std::vector<std::vector<std::string>> rows_;
};

/// A grey PFM image (`Pf`, scale -1.0 = little-endian floats). PFM stores the bottom row first; the result has row 0 on
/// top, as everywhere in birefit (docs/conventions.md, C4).
inline Image read_pfm(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error("no PFM image " + path.string());
  std::string magic;
  int width = 0, height = 0;
  double scale = 0;
  file >> magic >> width >> height >> scale;
  file.get();  // the one white space after the header
  if (!file || magic != "Pf" || width <= 0 || height <= 0 || scale != -1.0)
    throw std::runtime_error(path.string() + ": not a grey little-endian PFM image");
  Image image(width, height);
  for (int row = height - 1; row >= 0; --row)
    for (int column = 0; column < width; ++column) {
      std::array<unsigned char, 4> bytes{};
      if (!file.read(reinterpret_cast<char*>(bytes.data()), 4)) throw std::runtime_error(path.string() + ": truncated");
      const std::uint32_t bits =
          bytes[0] | std::uint32_t(bytes[1]) << 8 | std::uint32_t(bytes[2]) << 16 | std::uint32_t(bytes[3]) << 24;
      float value = 0;
      std::memcpy(&value, &bits, sizeof value);
      image(column, row) = value;
    }
  return image;
}

}  // namespace birefit::testing
