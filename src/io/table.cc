#include "io/table.h"

#include <charconv>
#include <cmath>
#include <fstream>
#include <limits>
#include <string>
#include <utility>

namespace birefit {
namespace {

/// Larger files are not profiles; reading them would only be a slow way to an error.
constexpr std::uintmax_t kMaxTableBytes = 64u << 20;

/// More are a file of another kind, not slips.
constexpr std::size_t kMostProblems = 20;

std::vector<TableCell> split(const std::string& line) {
  std::vector<TableCell> cells;
  std::size_t start = 0;
  for (;;) {
    std::size_t end = line.find(',', start);
    if (end == std::string::npos) end = line.size();
    std::size_t a = start, b = end;
    while (a < b && (line[a] == ' ' || line[a] == '\t')) ++a;
    while (b > a && (line[b - 1] == ' ' || line[b - 1] == '\t' || line[b - 1] == '\r')) --b;
    cells.push_back({line.substr(a, b - a), static_cast<int>(a) + 1});
    if (end == line.size()) return cells;
    start = end + 1;
  }
}

}  // namespace

std::optional<double> parse_number(std::string_view text) {
  if (!text.empty() && text.front() == '+') {
    text.remove_prefix(1);
    if (!text.empty() && (text.front() == '-' || text.front() == '+')) return std::nullopt;
  }
  if (text.empty() || text.find_first_not_of("0123456789+-.eE") != std::string_view::npos) return std::nullopt;
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (end != text.data() + text.size()) return std::nullopt;
  if (error == std::errc::result_out_of_range) {
    // Overflow and underflow share this code; only an exponent with a minus can underflow.
    const std::size_t exponent = text.find_first_of("eE");
    const bool tiny = exponent != std::string_view::npos && exponent + 1 < text.size() && text[exponent + 1] == '-';
    if (tiny) return 0.0;
    return text.front() == '-' ? -std::numeric_limits<double>::infinity() : std::numeric_limits<double>::infinity();
  }
  if (error != std::errc()) return std::nullopt;
  return value;
}

TextTable load_text_table(const std::filesystem::path& path, const Where& where, Problems& problems, bool numbered) {
  std::error_code code;
  if (!std::filesystem::exists(path, code)) throw UserError(where, path.string() + " does not exist");
  if (!std::filesystem::is_regular_file(path, code)) throw UserError(where, path.string() + " is not a file");
  if (std::filesystem::file_size(path, code) > kMaxTableBytes || code)
    throw UserError(where, path.string() + " is too large for a table");
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw UserError(where, path.string() + " cannot be read");

  const std::string file = path.string();
  TextTable table;
  Problems header;
  std::string line;
  int number = 0;
  while (std::getline(stream, line)) {
    ++number;
    if (number == 1 && line.rfind("\xEF\xBB\xBF", 0) == 0) line.erase(0, 3);
    const std::size_t first = line.find_first_not_of(" \t\r");
    if (first == std::string::npos || line[first] == '#') continue;
    if (line.find('\0') != std::string::npos) throw UserError({file, number}, "is not a text table");
    std::vector<TableCell> cells = split(line);
    if (table.header_line == 0) {
      table.header_line = number;
      for (TableCell& cell : cells) {
        for (const TableCell& earlier : table.header)
          if (earlier.text == cell.text) header.add({file, number, cell.column}, "duplicate column " + cell.text);
        if (cell.text.empty() && !(numbered && table.header.empty()))
          header.add({file, number, cell.column}, "a column has no name");
        if (parse_number(cell.text))
          header.add({file, number, cell.column}, "the first line must name the columns, found " + cell.text);
        table.header.push_back(std::move(cell));
      }
      header.throw_if_any();
      continue;
    }
    if (cells.size() != table.header.size()) {
      problems.add({file, number}, "has " + std::to_string(cells.size()) + " fields, the header names " +
                                       std::to_string(table.header.size()));
    } else {
      table.rows.push_back(std::move(cells));
      table.lines.push_back(number);
    }
    if (problems.all().size() >= kMostProblems) break;
  }
  if (table.header_line == 0) throw UserError({file}, "is empty", "expected a line of column names, then numbers");
  if (table.rows.empty() && problems.empty())
    throw UserError({file, table.header_line}, "has column names but no rows");
  return table;
}

PlacedTable load_placed_table(const std::filesystem::path& path, const Where& where, bool numbered) {
  Problems problems;
  TextTable text = load_text_table(path, where, problems, numbered);
  const std::string file = path.string();
  PlacedTable placed;
  placed.header_line = text.header_line;
  placed.lines = std::move(text.lines);
  for (TableCell& cell : text.header) {
    placed.header_columns.push_back(cell.column);
    placed.table.columns.push_back(std::move(cell.text));
  }
  for (std::size_t r = 0; r < text.rows.size() && problems.all().size() < kMostProblems; ++r) {
    std::vector<double> row;
    std::vector<int> columns;
    for (std::size_t i = 0; i < text.rows[r].size(); ++i) {
      const TableCell& cell = text.rows[r][i];
      const std::optional<double> value = parse_number(cell.text);
      if (!value || !std::isfinite(*value))
        problems.add({file, placed.lines[r], cell.column},
                     placed.table.columns[i] + " = " + (cell.text.empty() ? "nothing" : cell.text.substr(0, 40)) +
                         " is not a finite number");
      row.push_back(value.value_or(0));
      columns.push_back(cell.column);
    }
    placed.table.rows.push_back(std::move(row));
    placed.cell_columns.push_back(std::move(columns));
  }
  problems.throw_if_any();
  return placed;
}

Table load_table(const std::filesystem::path& path, Where where) { return load_placed_table(path, where).table; }

}  // namespace birefit
