#include "io/config/frames.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <set>
#include <utility>

#include <glob.h>

#include "io/files/table.h"

namespace birefit {
namespace {

namespace fs = std::filesystem;

/// frame2 before frame10: runs of digits compare as numbers.
bool natural_less(const std::string& a, const std::string& b) {
  const auto digit = [](char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; };
  std::size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (!digit(a[i]) || !digit(b[j])) {
      if (a[i] != b[j]) return static_cast<unsigned char>(a[i]) < static_cast<unsigned char>(b[j]);
      ++i, ++j;
      continue;
    }
    const auto number = [&](const std::string& text, std::size_t& at) {
      while (at < text.size() && text[at] == '0') ++at;
      const std::size_t begin = at;
      while (at < text.size() && digit(text[at])) ++at;
      return text.substr(begin, at - begin);
    };
    const std::string x = number(a, i), y = number(b, j);
    if (x.size() != y.size()) return x.size() < y.size();
    if (x != y) return x < y;
  }
  if ((i < a.size()) != (j < b.size())) return j < b.size();
  return a < b;  // 01 and 1
}

/// Files that match, from `folder` on, in natural order.
std::vector<std::string> matching_files(const fs::path& folder, const std::string& pattern) {
  std::string whole;
  if (!fs::path(pattern).is_absolute() && !folder.empty()) {
    for (const char c : (folder / "").string()) {  // the folder's own name is no pattern
      if (std::string("*?[\\").find(c) != std::string::npos) whole += '\\';
      whole += c;
    }
  }
  whole += pattern;
  std::vector<std::string> files;
  glob_t found{};
  if (::glob(whole.c_str(), GLOB_NOSORT, nullptr, &found) == 0)
    for (std::size_t i = 0; i < found.gl_pathc; ++i) {
      std::error_code code;
      const fs::path file(found.gl_pathv[i]);
      if (!fs::is_regular_file(file, code)) continue;
      files.push_back(fs::path(pattern).is_absolute() || folder.empty() ? file.string()
                                                                        : file.lexically_relative(folder).string());
    }
  ::globfree(&found);
  std::sort(files.begin(), files.end(), natural_less);
  return files;
}

/// "a, b, c and 4 more".
std::string some_of(std::vector<std::string> names) {
  constexpr std::size_t kShown = 3;
  if (names.size() > kShown + 1) {
    const std::size_t more = names.size() - kShown;
    names.resize(kShown);
    names.push_back(std::to_string(more) + " more");
  }
  return list_words(names);
}

/// A file as a frame; the pages of a stack that are chosen as a frame each.
std::vector<SeriesFrame> frames_of(ConfigReader& reader, const std::string& file, const PageChoice& choice,
                                   const Where& where) {
  SeriesFrame frame;
  frame.name = fs::path(file).stem().string();
  frame.file = file;
  frame.page = choice.number;
  frame.where = where;
  const fs::path path = reader.resolve(file);
  std::error_code code;
  if (choice.number || !fs::is_regular_file(path, code)) return {frame};
  std::vector<SeriesFrame> frames;
  for (const StackPage& page : stack_pages(path)) {
    if (!choice.lets_through(page)) continue;
    frames.push_back(frame);
    if (!page.number) continue;
    frames.back().page = page.number;
    frames.back().name += "_" + page.label();
  }
  if (frames.empty()) {
    frame.unreadable = frame.file + " has no page at " + choice.words();
    frames.push_back(frame);
  }
  return frames;
}

/// The unit that the end of a key states: "V" of sample.crystal.bias_v; "" of none that a table could contradict.
std::string unit_of_key(const std::string& path) {
  static constexpr std::pair<const char*, const char*> kUnits[] = {{"_um", "um"}, {"_nm", "nm"},   {"_cm", "cm"},
                                                                   {"_mm", "mm"}, {"_deg", "deg"}, {"_rad", "rad"},
                                                                   {"_k", "K"},   {"_v", "V"}};
  for (const auto& [end, unit] : kUnits)
    if (path.ends_with(end)) return unit;
  return {};
}

/// "stack.tif, page 3".
std::string words_of(const SeriesFrame& frame) {
  return frame.file + (frame.page ? ", page " + std::to_string(*frame.page) : "");
}

/// Joins the rows of a table to the frames that are known.
class Join {
 public:
  Join(ConfigReader& reader, const FramesAsked& asked, const TextTable& table, std::string place)
      : reader_(reader), asked_(asked), table_(table), place_(std::move(place)) {}

  /// `known`: of `files`, else empty. Frames in the order of the rows.
  void run(std::vector<SeriesFrame> known, ImageSeries& series) {
    known_ = std::move(known);
    if (!find_columns(series)) return;
    if (!asked_.files) know_files_of_table();
    line_.assign(known_.size(), 0);
    for (std::size_t r = 0; r < table_.rows.size(); ++r) take_row(r, series);
    if (asked_.files && reader_.problems.empty()) say_what_has_no_row();
  }

 private:
  const std::string& text(std::size_t row, std::size_t column) const { return table_.rows[row][column].text; }

  /// `file` and `page`; of a single file its pages are enough.
  bool find_columns(ImageSeries& series) {
    std::vector<std::string> names;
    for (const TableCell& cell : table_.header) names.push_back(cell.text);
    const auto column = [&](const char* name) -> std::optional<std::size_t> {
      const auto found = std::find(names.begin(), names.end(), name);
      return found == names.end() ? std::nullopt : std::optional(static_cast<std::size_t>(found - names.begin()));
    };
    file_at_ = column("file"), page_at_ = column("page");
    const bool one_file = !known_.empty() && std::all_of(known_.begin(), known_.end(), [&](const SeriesFrame& frame) {
      return frame.file == known_[0].file;
    });
    if (!file_at_ && !(page_at_ && one_file)) {
      reader_.problems.add(
          {place_, table_.header_line, 1}, "has no column file",
          "it has " + some_of(names) + "; expected file (or page, of a single stack), then parameter paths");
      return false;
    }
    for (std::size_t c = 0; c < names.size(); ++c) {
      if (c == file_at_ || c == page_at_) continue;
      series.columns.push_back({names[c], place_of(table_.header_line, table_.header[c])});
      check_unit(c);
    }
    return true;
  }

  /// A line of units under the names contradicts what a name says: nothing here scales numbers.
  void check_unit(std::size_t c) {
    if (table_.units.empty()) return;
    const std::string &given = table_.units[c], wanted = unit_of_key(table_.header[c].text);
    if (wanted.empty() || !contradicts_unit(given, wanted)) return;
    reader_.problems.add(
        place_of(table_.header_line, table_.header[c]),
        table_.header[c].text + " is in " + given + " by the table's line of units, and in " + wanted + " by its name",
        "give the column in " + wanted + ", and say so in the line of units");
  }

  void know_files_of_table() {
    std::set<std::string> seen;
    for (std::size_t r = 0; r < table_.rows.size(); ++r) {
      const std::string& file = text(r, *file_at_);
      if (file.empty() || !seen.insert(file).second) continue;
      for (SeriesFrame& frame : frames_of(reader_, file, asked_.page, {})) known_.push_back(std::move(frame));
    }
  }

  void take_row(std::size_t r, ImageSeries& series) {
    const std::size_t at = file_at_.value_or(page_at_.value_or(0));
    const Where here = place_of(table_.lines[r], table_.rows[r][at]);
    const std::string file = file_at_ ? text(r, *file_at_) : known_[0].file;
    if (file.empty()) {
      reader_.problems.add(here, "names no file");
      return;
    }
    std::optional<int> page;
    if (page_at_) {
      const auto number = parse_number(text(r, *page_at_));
      if (!number || *number < 0 || *number > 1e6 || *number != std::floor(*number)) {
        reader_.problems.add(place_of(table_.lines[r], table_.rows[r][*page_at_]),
                             "page must be a whole number from 0, found " + text(r, *page_at_));
        return;
      }
      page = static_cast<int>(*number);
    }
    std::vector<std::size_t> of_file, matches;
    for (std::size_t k = 0; k < known_.size(); ++k) {
      // By its path or by its name alone; names do not repeat.
      if (known_[k].file != file && !(asked_.files && fs::path(known_[k].file).filename() == file)) continue;
      of_file.push_back(k);
      if (!page || *page == known_[k].page.value_or(0)) matches.push_back(k);
    }
    if (matches.size() > 1) {
      reader_.problems.add(here,
                           file + " has " + std::to_string(matches.size()) + " pages, and the row is of all of them",
                           "add a column page, from 0, and a row for each");
      return;
    }
    SeriesFrame frame;
    if (matches.size() == 1) {
      frame = known_[matches[0]];
      int& line = line_[matches[0]];
      if (line > 0) {
        reader_.problems.add(here, words_of(frame) + " has a row already, in line " + std::to_string(line));
        return;
      }
      line = table_.lines[r];
    } else if (!find_absent(file, page, of_file.empty() ? nullptr : &known_[of_file[0]], here, frame)) {
      return;
    }
    frame.where = here;
    for (std::size_t c = 0; c < table_.header.size(); ++c)
      if (c != file_at_ && c != page_at_) {
        const TableCell& cell = table_.rows[r][c];
        frame.cells.push_back({cell.text, place_of(table_.lines[r], cell)});
      }
    series.frames.push_back(std::move(frame));
  }

  /// The frame of a file or page that there is not; false, with a problem, where it is there but not of the series.
  bool find_absent(const std::string& file, std::optional<int> page, const SeriesFrame* of_file, const Where& here,
                   SeriesFrame& frame) {
    frame.file = of_file ? of_file->file : file;
    frame.page = page;
    if (!of_file && asked_.files && !fs::path(file).has_parent_path())
      frame.file = (fs::path(known_[0].file).parent_path() / file).string();
    frame.name = fs::path(file).stem().string() + (page ? "_p" + std::to_string(*page) : "");
    std::vector<std::string> names;
    for (const SeriesFrame& each : known_) names.push_back(fs::path(each.file).filename().string());
    const std::string near = of_file ? "" : nearest_word(file, names);
    const Problem problem{here, words_of(frame) + " is not among the files of the series",
                          near.empty() ? "" : "did you mean " + near + "?"};
    std::error_code code;
    if (!of_file && fs::exists(reader_.resolve(file), code)) {
      reader_.problems.add(problem.where, problem.what, problem.hint);
      return false;
    }
    absent_.push_back(problem);
    return true;
  }

  /// Rows of files that there are not are slips where a file of the series has no row.
  void say_what_has_no_row() {
    std::vector<std::string> without;
    for (std::size_t k = 0; k < known_.size(); ++k)
      if (line_[k] == 0) without.push_back(words_of(known_[k]));
    if (without.empty()) return;
    for (const Problem& problem : absent_) reader_.problems.add(problem.where, problem.what, problem.hint);
    reader_.problems.add(asked_.files_where,
                         some_of(without) + (without.size() == 1 ? " has" : " have") + " no row in " + place_,
                         "add rows, or narrow files");
  }

  Where place_of(int line, const TableCell& cell) const { return {place_, line, cell.column}; }

  ConfigReader& reader_;
  const FramesAsked& asked_;
  const TextTable& table_;
  const std::string place_;
  std::vector<SeriesFrame> known_;
  std::vector<int> line_;  ///< of each known frame's row; 0: none
  std::vector<Problem> absent_;
  std::optional<std::size_t> file_at_, page_at_;
};

}  // namespace

void find_frames(ConfigReader& reader, const FramesAsked& asked, ImageSeries& series) {
  std::vector<SeriesFrame> known;
  if (asked.files) {
    const std::vector<std::string> files = matching_files(reader.folder, *asked.files);
    if (files.empty()) {
      reader.problems.add(asked.files_where, "no file matches " + *asked.files,
                          "* stands for any letters, ? for one; paths start at the config's folder");
      return;
    }
    for (const std::string& file : files)
      for (SeriesFrame& frame : frames_of(reader, file, asked.page, asked.files_where))
        known.push_back(std::move(frame));
  }
  if (!asked.set_from) {
    series.frames = std::move(known);
    return;
  }
  const fs::path path = reader.resolve(*asked.set_from);
  try {
    const TextTable table = load_text_table(path, asked.set_from_where, reader.problems);
    series.notes = table.notes;
    Join(reader, asked, table, path.string()).run(std::move(known), series);
  } catch (const UserError& error) {
    reader.problems.add(error);
  }
}

}  // namespace birefit
