#pragma once
// Text tables as programs write them: cells between commas, semicolons or tabs, quotes as in RFC 4180.

#include <string>
#include <string_view>
#include <vector>

namespace birefit {

struct TableCell {
  std::string text;  ///< without its quotes; decimal commas are points
  int column = 0;    ///< character column, from 1
};

struct TableRecord {
  std::vector<TableCell> cells;
  int line = 0;  ///< on which it starts; cells in quotes may go over several
};

struct DelimitedText {
  char separator = ',';
  bool decimal_comma = false;
  std::vector<TableRecord> records;  ///< without blank lines and those that start with #
};

/// Splits the content of a file. Which separator it has is told by its first lines. Numbers with a decimal comma get a
/// point where the whole table has none: "1,5" beside "1.5" stays what it is, and is no number. Throws UserError
/// (`file`, line): no text, UTF-16, a quote that does not end.
DelimitedText split_delimited(std::string_view content, const std::string& file);

}  // namespace birefit
