#include "io/files/table.h"
#include "io/images/asked.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <iterator>
#include <limits>
#include <map>
#include <regex>
#include <sstream>
#include <string>
#include <utility>

namespace birefit {
namespace {

/// Larger files are not profiles; reading them would only be a slow way to an error.
constexpr std::uintmax_t kMaxTableBytes = 64u << 20;

/// More are a file of another kind, not slips.
constexpr std::size_t kMostProblems = 20;

bool is_number(const TableCell& cell) { return parse_number(cell.text).has_value(); }

/// "[V]" and "(V)" are V; the micro signs of Unicode (U+00B5, U+03BC) and Latin-1 are u.
std::string plain_unit(std::string unit) {
  if (unit.size() >= 2 && ((unit.front() == '[' && unit.back() == ']') || (unit.front() == '(' && unit.back() == ')')))
    unit = unit.substr(1, unit.size() - 2);
  for (const char* micro : {"\xc2\xb5", "\xce\xbc", "\xb5"})
    if (unit.rfind(micro, 0) == 0) unit = "u" + unit.substr(std::string_view(micro).size());
  if (unit == "\xc2\xb0" || unit == "\xb0" || unit == "degree" || unit == "degrees") return "deg";
  if (unit == "\xc2\xb0\x43" || unit == "\xb0\x43" || unit == "degC" || unit == "deg C" || unit == "celsius")
    return "C";
  for (const char* angstrom : {"\xc3\x85", "\xe2\x84\xab", "\xc5"})  // as a letter, as a sign, in Latin-1
    if (unit == angstrom) return "A";
  static const std::map<std::string, std::string> kSpeltOut = {
      {"angstrom", "A"},  {"angstroms", "A"},      {"ev", "eV"},
      {"thz", "THz"},     {"gon", "gon"},          {"gons", "gon"},
      {"grad", "gon"},    {"arcmin", "arcmin"},    {"arcsec", "arcsec"},
      {"turn", "turn"},   {"turns", "turn"},       {"cm-1", "1/cm"},
      {"cm^-1", "1/cm"},  {"1/cm", "1/cm"},        {"volt", "V"},
      {"volts", "V"},     {"millivolt", "mV"},     {"millivolts", "mV"},
      {"kilovolt", "kV"}, {"kilovolts", "kV"},     {"rad", "rad"},
      {"radian", "rad"},  {"radians", "rad"},      {"deg", "deg"},
      {"mrad", "mrad"},   {"milliradian", "mrad"}, {"milliradians", "mrad"},
      {"kelvin", "K"},    {"micron", "um"},        {"microns", "um"},
      {"metre", "m"},     {"meter", "m"},          {"metres", "m"},
      {"meters", "m"}};
  std::string word = lower_case(unit);
  if (const auto found = kSpeltOut.find(word); found != kSpeltOut.end()) return found->second;
  for (const auto& [prefix, sign] : {std::pair{"nano", "n"}, {"micro", "u"}, {"milli", "m"}, {"centi", "c"}})
    for (const char* rest : {"metre", "meter", "metres", "meters"})
      if (word == std::string(prefix) + rest) return std::string(sign) + "m";
  return unit;
}

/// Cells that are no numbers under names of columns that hold numbers: their units.
bool is_line_of_units(const std::vector<TableRecord>& records, std::size_t at) {
  constexpr std::size_t kLooked = 50;
  static const std::vector<std::string> kNone = {"nan", "NaN", "NAN", "NA",  "na",  "N/A", "n/a",
                                                 "nil", "inf", "Inf", "INF", "OVL", "OL",  "null"};
  const std::vector<TableCell>& cells = records[at].cells;
  bool named = false;
  for (std::size_t c = 0; c < cells.size(); ++c) {
    const std::string& text = cells[c].text;
    bool numeric = false;
    for (std::size_t r = at + 1; !numeric && r < std::min(records.size(), at + 1 + kLooked); ++r)
      numeric = c < records[r].cells.size() && is_number(records[r].cells[c]);
    if (is_number(cells[c]) || std::find(kNone.begin(), kNone.end(), text) != kNone.end()) return false;
    const bool bracketed = !text.empty() && (text.front() == '[' || text.front() == '(');
    if (!numeric && !text.empty() && text != "-" && !bracketed) return false;  // words of a column of words
    constexpr std::size_t kLongestUnit = 16;
    if (text.size() > kLongestUnit) return false;
    named = named || (numeric && (bracketed || text == "%" || text.find_first_not_of("-. ") != std::string::npos));
  }
  return named;
}

/// Spreadsheets write as many separators as their widest row has: nameless columns at the end that hold nothing.
void drop_empty_end(std::vector<TableRecord>& records) {
  std::vector<TableCell>& header = records[0].cells;
  while (header.size() > 1 && header.back().text.empty()) {
    const std::size_t last = header.size() - 1;
    const bool used = std::any_of(records.begin(), records.end(), [&](const TableRecord& record) {
      return record.cells.size() > last && !record.cells[last].text.empty();
    });
    if (used) return;
    header.pop_back();
  }
}

void read_header(const TableRecord& record, const std::string& file, bool numbered, TextTable& table) {
  Problems problems;
  table.header_line = record.line;
  for (const TableCell& cell : record.cells) {
    const Where place{file, record.line, cell.column};
    if (cell.text.empty() && !(numbered && table.header.empty())) problems.add(place, "a column has no name");
    if (is_number(cell))
      problems.add(place, "the first line must name the columns, found " + cell.text,
                   "if a line above it starts with # and names them, take the # away");
    table.header.push_back(cell);
  }
  problems.throw_if_any();
  // Which of them a name means, nobody can tell; columns that nothing names may be called anything.
  std::map<std::string_view, int> times;
  for (const TableCell& cell : record.cells) ++times[cell.text];
  for (std::size_t c = 0; c < table.header.size(); ++c)
    if (times[record.cells[c].text] > 1) table.header[c].text += " (column " + std::to_string(c + 1) + ")";
}

void read_row(TableRecord& record, const std::string& file, char separator, TextTable& table, Problems& problems) {
  const std::size_t columns = table.header.size();
  while (record.cells.size() > columns && record.cells.back().text.empty()) record.cells.pop_back();
  if (std::all_of(record.cells.begin(), record.cells.end(), [](const TableCell& c) { return c.text.empty(); })) return;
  if (record.cells.size() == columns) {
    table.rows.push_back(std::move(record.cells));
    table.lines.push_back(record.line);
    return;
  }
  const char* name = separator == ';' ? "semicolons" : separator == '\t' ? "tabs" : "commas";
  std::string hint = std::string("cells are separated by ") + name;
  if (record.cells.size() > columns && separator == ',') hint += "; decimals have a point, or stand in quotes";
  if (columns == 1) hint += "; a title above the names starts with #";
  problems.add({file, record.line},
               "has " + std::to_string(record.cells.size()) + " fields, the header names " + std::to_string(columns),
               hint);
}

/// Names and numbers with nothing but blanks between them would be one column of no numbers.
void refuse_blanks(const std::vector<TableRecord>& records, std::size_t first, const std::string& file) {
  if (records.size() <= first || records[0].cells.size() != 1 || records[first].cells.size() != 1) return;
  const auto words = [](const TableRecord& record) {
    std::istringstream stream(record.cells[0].text);
    return std::vector<std::string>{std::istream_iterator<std::string>(stream), {}};
  };
  const std::vector<std::string> numbers = words(records[first]);
  if (numbers.size() > 1 && std::all_of(numbers.begin(), numbers.end(), [](auto& w) { return parse_number(w); }))
    throw UserError({file, records[first].line}, "has columns with nothing but blanks between them",
                    "separate them, names and numbers, by commas, semicolons or tabs");
}

std::string read_table(const std::filesystem::path& path, const Where& where) {
  std::error_code code;
  if (!std::filesystem::exists(path, code)) throw UserError(where, path.string() + " does not exist");
  if (!std::filesystem::is_regular_file(path, code)) throw UserError(where, path.string() + " is not a file");
  if (std::filesystem::file_size(path, code) > kMaxTableBytes || code)
    throw UserError(where, path.string() + " is too large for a table");
  std::ifstream stream(path, std::ios::binary);
  std::string content{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  if (!stream) throw UserError(where, path.string() + " cannot be read");
  return content;
}

std::string not_a_number(const std::string& name, const std::string& text) {
  return name + " = " + (text.empty() ? "nothing" : text.substr(0, 40)) + " is not a finite number";
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

bool is_missing_number(std::string_view text) { return text.find_first_of("0123456789") == std::string_view::npos; }

std::string number_hint(std::string_view text) {
  // Signs and blanks as word processors set them, and the exponent as Fortran writes it.
  static const std::array<std::pair<std::string_view, std::string_view>, 6> kSpellings = {
      {{"\u2212", "-"}, {"\u2013", "-"}, {"\u00a0", ""}, {"\u2009", ""}, {"\u202f", ""}, {"\u2007", ""}}};
  std::string plain(text);
  for (const auto& [from, to] : kSpellings)
    for (std::size_t at; (at = plain.find(from)) != std::string::npos;) plain.replace(at, from.size(), to);
  const bool set = plain != text;
  if (const std::size_t at = plain.find_first_of("dD"); at != std::string::npos && at > 0) plain[at] = 'E';
  if (plain != text && parse_number(plain))
    return "did you mean " + plain + "?" + (set ? " it has signs or blanks that are not the keyboard's" : "");
  if (static const std::regex hexadecimal("[+-]?0[xX][0-9a-fA-F]+"); std::regex_match(plain, hexadecimal))
    return "write it in decimals";
  if (text.find(',') == std::string_view::npos) return {};
  return "a comma that may be a decimal mark or part thousands: write decimals with a point, thousands with nothing";
}

bool contradicts_unit(const std::string& given, const std::string& wanted) {
  static const std::vector<std::vector<std::string>> kKinds = {
      {"uV", "mV", "V", "kV"},
      // What light is stated by in place of a wavelength, too.
      {"m", "mm", "cm", "um", "nm", "pm", "inch", "A", "1/cm", "eV", "THz"},
      {"deg", "rad", "mrad", "gon", "arcmin", "arcsec", "turn"},
      {"K", "C"}};
  const std::string a = plain_unit(given), b = plain_unit(wanted);
  return a != b && std::any_of(kKinds.begin(), kKinds.end(), [&](const auto& kind) {
           return std::find(kind.begin(), kind.end(), a) != kind.end() &&
                  std::find(kind.begin(), kind.end(), b) != kind.end();
         });
}

std::string unit_in_name(const std::string& name) {
  static const std::regex bracketed(R"(.*[(\[]([^()\[\]]+)[)\]] *)"),
      appended(
          ".*(?:_|/|, ?| in )((?:m?[Rr]ad(?:ians?)?)|[Dd]eg(?:rees?)?|nm|um|mm|cm|mV|kV|V|C|A|\xc3\x85|"
          "[Aa]ngstroms?|eV|THz|cm\\^?-1|gon|grad|arcmin|arcsec|turns?)"),
      place(R"( \(column \d+\)$)");
  const std::string own = std::regex_replace(name, place, "");
  std::smatch found;
  return std::regex_match(own, found, bracketed) || std::regex_match(own, found, appended) ? found[1].str() : "";
}

std::string describe_left_out(const std::string& name, const std::vector<int>& lines) {
  constexpr std::size_t kShown = 10;
  std::string list;
  for (std::size_t i = 0; i < std::min(lines.size(), kShown); ++i)
    list += (i == 0 ? "" : ", ") + std::to_string(lines[i]);
  if (lines.size() > kShown) list += ", ..";
  return name + ": " + std::to_string(lines.size()) + (lines.size() == 1 ? " row" : " rows") +
         " without a number left out (" + (lines.size() == 1 ? "line " : "lines ") + list + ").";
}

TextTable load_text_table(const std::filesystem::path& path, const Where& where, Problems& problems, bool numbered) {
  const std::string file = path.string();
  DelimitedText text = split_delimited(read_table(path, where), file);
  std::vector<TableRecord>& records = text.records;
  if (records.empty()) throw UserError({file}, "is empty", "expected a line of column names, then numbers");
  TextTable table;
  drop_empty_end(records);
  read_header(records[0], file, numbered, table);
  const std::string name = path.filename().string();
  if (text.decimal_comma) table.notes.push_back(name + ": commas in its numbers are read as decimal ones.");
  std::size_t first = 1;
  if (records.size() > 2 && records[1].cells.size() <= table.header.size() && is_line_of_units(records, 1)) {
    for (const TableCell& cell : records[1].cells) table.units.push_back(plain_unit(cell.text));
    table.units.resize(table.header.size());
    table.notes.push_back(name + ": line " + std::to_string(records[1].line) +
                          " holds no numbers and is taken for the columns' units.");
    first = 2;
  }
  refuse_blanks(records, first, file);
  for (std::size_t r = first; r < records.size() && problems.all().size() < kMostProblems; ++r)
    read_row(records[r], file, text.separator, table, problems);
  if (table.rows.empty() && problems.empty())
    throw UserError({file, table.header_line}, "has column names but no rows");
  return table;
}

PlacedTable load_placed_table(const std::filesystem::path& path, const Where& where, MissingNumbers missing) {
  Problems problems;
  TextTable text = load_text_table(path, where, problems);
  const std::string file = path.string();
  PlacedTable placed;
  placed.header_line = text.header_line;
  placed.units = std::move(text.units);
  placed.notes = std::move(text.notes);
  for (TableCell& cell : text.header) {
    placed.header_columns.push_back(cell.column);
    placed.table.columns.push_back(std::move(cell.text));
  }
  std::vector<int> left_out;
  for (std::size_t r = 0; r < text.rows.size() && problems.all().size() < kMostProblems; ++r) {
    std::vector<double> row;
    std::vector<int> columns;
    bool complete = true;
    for (std::size_t i = 0; i < text.rows[r].size(); ++i) {
      const TableCell& cell = text.rows[r][i];
      const std::optional<double> value = parse_number(cell.text);
      if (missing == MissingNumbers::left_out && is_missing_number(cell.text))
        complete = false;
      else if (!value || !std::isfinite(*value))
        problems.add({file, text.lines[r], cell.column}, not_a_number(placed.table.columns[i], cell.text),
                     number_hint(cell.text));
      row.push_back(value.value_or(0));
      columns.push_back(cell.column);
    }
    if (!complete) {
      left_out.push_back(text.lines[r]);
      continue;
    }
    placed.lines.push_back(text.lines[r]);
    placed.table.rows.push_back(std::move(row));
    placed.cell_columns.push_back(std::move(columns));
  }
  problems.throw_if_any();
  if (!left_out.empty()) placed.notes.push_back(describe_left_out(path.filename().string(), left_out));
  return placed;
}

Table load_table(const std::filesystem::path& path, Where where) { return load_placed_table(path, where).table; }

}  // namespace birefit
