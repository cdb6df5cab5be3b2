#pragma once
// Tables with the place of every row, for checks that go beyond "is a number".

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "birefit/io.h"

namespace birefit {

/// The whole of `text` as a decimal number ("1", "-2.5e-3", "+4"; no hexadecimal, no infinity); nothing when it is not.
/// A number too large for a double is returned as infinity.
std::optional<double> parse_number(std::string_view text);

struct TableCell {
  std::string text;
  int column = 0;  ///< character column, from 1
};
/// A comma-separated table as text.
struct TextTable {
  std::vector<TableCell> header;
  int header_line = 0;
  std::vector<std::vector<TableCell>> rows;  ///< each as long as the header
  std::vector<int> lines;                    ///< of each row
};
/// Rows of another length are added to `problems` and left out. `numbered`: the first column may lack a name (row
/// numbers, as programs write them).
TextTable load_text_table(const std::filesystem::path& path, const Where& where, Problems& problems,
                          bool numbered = false);

struct PlacedTable {
  Table table;
  std::vector<int> header_columns;  ///< character column of each header field, from 1
  int header_line = 0;
  std::vector<int> lines;                      ///< line of each row
  std::vector<std::vector<int>> cell_columns;  ///< character column of each cell
};
/// Of numbers alone.
PlacedTable load_placed_table(const std::filesystem::path& path, const Where& where, bool numbered = false);

}  // namespace birefit
