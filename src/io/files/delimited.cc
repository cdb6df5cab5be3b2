#include "io/files/delimited.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "birefit/error.h"

namespace birefit {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\t'; }
bool ends_line(char c) { return c == '\n' || c == '\r'; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// Behind the end of the line at `at` ("\n", "\r\n", "\r").
std::size_t next_line(std::string_view text, std::size_t at) {
  return at + (text[at] == '\r' && at + 1 < text.size() && text[at + 1] == '\n' ? 2 : 1);
}

/// The first lines that are no comments, as many as there are up to two; quotes may go over line ends.
std::vector<std::string_view> first_records(std::string_view text) {
  std::vector<std::string_view> found;
  for (std::size_t at = 0; at < text.size() && found.size() < 2;) {
    std::size_t end = at;
    bool quoted = false;
    while (end < text.size() && (quoted || !ends_line(text[end]))) quoted = quoted != (text[end++] == '"');
    const std::string_view record = text.substr(at, end - at);
    const std::size_t first = record.find_first_not_of(" \t");
    if (first != std::string_view::npos && record[first] != '#') found.push_back(record);
    at = end < text.size() ? next_line(text, end) : end;
  }
  return found;
}

std::size_t count_outside_quotes(std::string_view record, char wanted) {
  std::size_t count = 0;
  bool quoted = false;
  for (const char c : record) {
    quoted = quoted != (c == '"');
    count += c == wanted && !quoted;
  }
  return count;
}

/// "a,\tb": tabs that only align what commas separate.
bool tabs_only_align(std::string_view record) {
  for (std::size_t i = 0; i < record.size(); ++i) {
    if (record[i] != '\t') continue;
    std::size_t before = i;
    while (before > 0 && is_blank(record[before - 1])) --before;
    if (before == 0 || record[before - 1] != ',') return false;
  }
  return true;
}

/// The one that parts the line of names and the first row into as many cells; where several do, commas give way, as
/// they may be decimal ones.
char find_separator(std::string_view text) {
  const std::vector<std::string_view> first = first_records(text);
  if (first.empty()) return ',';
  char best = ',';
  std::size_t most = 0;
  for (const char candidate : {'\t', ';', ','}) {
    const std::size_t count = count_outside_quotes(first[0], candidate);
    if (count == 0) continue;
    if (candidate == '\t' && count_outside_quotes(first[0], ',') > 0 && tabs_only_align(first[0])) continue;
    if (first.size() < 2 || count_outside_quotes(first[1], candidate) == count) return candidate;
    if (count > most) best = candidate, most = count;
  }
  return best;
}

class Splitter {
 public:
  Splitter(std::string_view text, char separator, const std::string& file)
      : text_(text), separator_(separator), file_(file) {}

  std::vector<TableRecord> split() {
    std::vector<TableRecord> records;
    while (at_ < text_.size()) {
      skip_blanks();
      if (at_ < text_.size() && !ends_line(text_[at_]) && text_[at_] != '#') {
        at_ = line_start_;  // the first cell may be empty: a separator that is a tab
        records.push_back(record());
      }
      while (at_ < text_.size() && !ends_line(text_[at_])) ++at_;
      end_line();
    }
    return records;
  }

 private:
  void skip_blanks() {
    while (at_ < text_.size() && is_blank(text_[at_])) ++at_;
  }
  void end_line() {
    if (at_ >= text_.size()) return;
    at_ = line_start_ = next_line(text_, at_);
    ++line_;
  }
  int column() const { return static_cast<int>(at_ - line_start_) + 1; }

  TableRecord record() {
    TableRecord record;
    record.line = line_;
    for (;;) {
      while (at_ < text_.size() && text_[at_] != separator_ && is_blank(text_[at_])) ++at_;
      record.cells.push_back(at_ < text_.size() && text_[at_] == '"' ? quoted_cell() : plain_cell());
      if (at_ >= text_.size() || text_[at_] != separator_) return record;
      ++at_;
    }
  }

  TableCell plain_cell() {
    TableCell cell{{}, column()};
    const std::size_t begin = at_;
    while (at_ < text_.size() && text_[at_] != separator_ && !ends_line(text_[at_])) ++at_;
    std::size_t end = at_;
    while (end > begin && is_blank(text_[end - 1])) --end;
    cell.text = std::string(text_.substr(begin, end - begin));
    return cell;
  }

  TableCell quoted_cell() {
    TableCell cell{{}, column()};
    const Where start{file_, line_, column()};
    for (++at_;;) {
      if (at_ >= text_.size())
        throw UserError(start, "a quote is opened here and does not end", "a quote inside quotes is written twice");
      const char c = text_[at_];
      if (c == '"') {
        if (at_ + 1 >= text_.size() || text_[at_ + 1] != '"') break;
        ++at_;
      }
      if (ends_line(c)) {
        cell.text += ' ';
        end_line();
        continue;
      }
      cell.text += c;
      ++at_;
    }
    ++at_;
    while (at_ < text_.size() && text_[at_] != separator_ && is_blank(text_[at_])) ++at_;
    if (at_ < text_.size() && text_[at_] != separator_ && !ends_line(text_[at_]))
      throw UserError({file_, line_, column()}, "something stands behind the end of a quote",
                      "a quote inside quotes is written twice");
    const std::size_t first = cell.text.find_first_not_of(" \t"), last = cell.text.find_last_not_of(" \t");
    cell.text = first == std::string::npos ? std::string() : cell.text.substr(first, last - first + 1);
    return cell;
  }

  std::string_view text_;
  char separator_;
  const std::string& file_;
  std::size_t at_ = 0, line_start_ = 0;
  int line_ = 1;
};

/// A number with `mark` between its digits: how many digits stand before and behind it. Nothing for anything else.
struct MarkedNumber {
  std::size_t at = 0, before = 0, behind = 0;
  bool leading_zero = false, exponent = false;
};
std::optional<MarkedNumber> marked_number(std::string_view text, char mark) {
  MarkedNumber found;
  std::size_t i = !text.empty() && (text[0] == '-' || text[0] == '+') ? 1 : 0;
  found.leading_zero = i < text.size() && text[i] == '0';
  while (i < text.size() && is_digit(text[i])) ++i, ++found.before;
  if (i >= text.size() || text[i] != mark) return std::nullopt;
  found.at = i++;
  while (i < text.size() && is_digit(text[i])) ++i, ++found.behind;
  if (found.before + found.behind == 0) return std::nullopt;
  if (i < text.size() && (text[i] == 'e' || text[i] == 'E')) {
    found.exponent = true;
    if (++i < text.size() && (text[i] == '-' || text[i] == '+')) ++i;
    const std::size_t digits = i;
    while (i < text.size() && is_digit(text[i])) ++i;
    if (i == digits) return std::nullopt;
  }
  return i == text.size() ? std::optional(found) : std::nullopt;
}

/// "977": what a column of thousands has beside "1,250".
bool below_a_thousand(const std::string& text) {
  return !text.empty() && text.size() <= 3 && text.front() != '0' &&
         std::all_of(text.begin(), text.end(), [](unsigned char c) { return std::isdigit(c); });
}

/// Has a column both "1,250" and "977"? Decimals would all show what is behind their comma, or vary in length.
bool has_mixed_column(const DelimitedText& table) {
  std::vector<std::pair<bool, bool>> of_column;
  for (const TableRecord& record : table.records) {
    of_column.resize(std::max(of_column.size(), record.cells.size()));
    for (std::size_t i = 0; i < record.cells.size(); ++i) {
      if (marked_number(record.cells[i].text, ',')) of_column[i].first = true;
      if (below_a_thousand(record.cells[i].text)) of_column[i].second = true;
    }
  }
  return std::any_of(of_column.begin(), of_column.end(), [](const auto& both) { return both.first && both.second; });
}

/// Makes decimal commas points. "1,234" may be a thousand and some: it is a decimal where another number shows what
/// commas are, or where semicolons separate (who writes them does so because the comma is taken) and nothing speaks
/// for thousands.
bool settle_decimal_commas(DelimitedText& table) {
  bool any = false, points = false, sure = table.separator == ';' && !has_mixed_column(table);
  for (const TableRecord& record : table.records)
    for (const TableCell& cell : record.cells) {
      points = points || marked_number(cell.text, '.');
      const std::optional<MarkedNumber> comma = marked_number(cell.text, ',');
      if (!comma) continue;
      any = true;
      sure = sure || comma->behind != 3 || comma->before == 0 || comma->before > 3 || comma->leading_zero ||
             comma->exponent;
    }
  if (!any || points || !sure) return false;
  for (TableRecord& record : table.records)
    for (TableCell& cell : record.cells)
      if (const auto comma = marked_number(cell.text, ',')) cell.text[comma->at] = '.';
  return true;
}

}  // namespace

DelimitedText split_delimited(std::string_view content, const std::string& file) {
  using namespace std::string_view_literals;
  if (content.substr(0, 3) == "\xEF\xBB\xBF"sv) content.remove_prefix(3);
  if (content.substr(0, 2) == "\xFF\xFE"sv || content.substr(0, 2) == "\xFE\xFF"sv)
    throw UserError({file}, "is UTF-16 text", "save it as UTF-8 (in a spreadsheet: CSV UTF-8)");
  if (const std::size_t zero = content.find('\0'); zero != std::string_view::npos)
    throw UserError({file, 1 + static_cast<int>(std::count(content.begin(), content.begin() + zero, '\n'))},
                    "is not a text table");
  DelimitedText table;
  table.separator = find_separator(content);
  // Excel's own way to say it, in a line before all others.
  std::string_view rest = content;
  if (rest.size() > 4 && (rest[0] == 's' || rest[0] == 'S') && rest.substr(1, 3) == "ep="sv && !ends_line(rest[4]) &&
      (rest.size() == 5 || ends_line(rest[5]))) {
    table.separator = rest[4];
    std::string blanked(content);
    blanked.replace(0, 5, "#    ");
    table.records = Splitter(blanked, table.separator, file).split();
  } else {
    table.records = Splitter(content, table.separator, file).split();
  }
  table.decimal_comma = settle_decimal_commas(table);
  return table;
}

}  // namespace birefit
