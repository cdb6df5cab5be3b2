#include "io/files/csv.h"

#include <string_view>

#include "core/printable.h"
#include "io/files/table.h"

namespace birefit {

std::string csv_field(const std::string& text) {
  if (parse_number(text)) return text;
  // Some spreadsheets, by their language, split at semicolons, and take what follows one for a cell.
  constexpr std::string_view kStarts = "=+-@", kSeparators = ",;|";
  std::string cell;
  bool quotes = false, at_start = true;
  for (const char c : printable(text)) {
    if (at_start && kStarts.find(c) != std::string_view::npos) cell += '\'';
    const bool separates = kSeparators.find(c) != std::string_view::npos;
    at_start = separates || (at_start && (c == ' ' || c == '"'));
    quotes = quotes || separates || c == '"';
    cell += c == '"' ? std::string("\"\"") : std::string(1, c);
  }
  return quotes ? "\"" + cell + "\"" : cell;
}

}  // namespace birefit
