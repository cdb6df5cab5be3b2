#pragma once
// Tables with the place of every row, for checks that go beyond "is a number".

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "birefit/io.h"
#include "io/files/delimited.h"

namespace birefit {

/// The whole of `text` as a decimal number ("1", "-2.5e-3", "+4"; no hexadecimal, no infinity); nothing when it is not.
/// A number too large for a double is returned as infinity.
std::optional<double> parse_number(std::string_view text);

/// What stands for a reading that there is none of: nothing, NaN, n/a, -, OL, ..; whatever has no digit.
bool is_missing_number(std::string_view text);

/// What to do about a cell that is no number: "" when it does not show.
std::string number_hint(std::string_view text);

/// A table of cells between commas, semicolons or tabs, as text.
struct TextTable {
  std::vector<TableCell> header;
  int header_line = 0;
  std::vector<std::string> units;            ///< by column, where a line under the names gives them; else empty
  std::vector<std::vector<TableCell>> rows;  ///< each as long as the header
  std::vector<int> lines;                    ///< of each row
  std::vector<std::string> notes;            ///< of what was done to read it: decimal commas, a line of units
};
/// Rows of another length are added to `problems` and left out. `numbered`: the first column may lack a name (row
/// numbers, as programs write them).
TextTable load_text_table(const std::filesystem::path& path, const Where& where, Problems& problems,
                          bool numbered = false);

/// Is `given` ("mV", "[nm]") a unit that is known not to be `wanted` ("V", "um")? What is not known is no
/// contradiction.
bool contradicts_unit(const std::string& given, const std::string& wanted);
/// "angle (rad)", "angle [rad]", "angle_rad", "angle/rad" and "angle in radians" are in rad; empty where a column's
/// name says nothing of a unit.
std::string unit_in_name(const std::string& name);

/// "table.csv: 2 rows without a number are left out (lines 3 and 7)."
std::string describe_left_out(const std::string& name, const std::vector<int>& lines);

struct PlacedTable {
  Table table;
  std::vector<int> header_columns;  ///< character column of each header field, from 1
  int header_line = 0;
  std::vector<std::string> units;              ///< as in TextTable
  std::vector<int> lines;                      ///< line of each row
  std::vector<std::vector<int>> cell_columns;  ///< character column of each cell
  std::vector<std::string> notes;
};
enum class MissingNumbers {
  refused,   ///< rows depend on one another
  left_out,  ///< with their row, and said in the notes
};
/// Of numbers alone.
PlacedTable load_placed_table(const std::filesystem::path& path, const Where& where,
                              MissingNumbers missing = MissingNumbers::refused);

}  // namespace birefit
