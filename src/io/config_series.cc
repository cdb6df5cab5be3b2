#include "io/config_series.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>

#include <glob.h>

#include "io/config_reader.h"
#include "io/table.h"

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

/// Frames by the rows of the table; with `files` each must be one of these and all of these must have a row.
void join_table(ConfigReader& reader, const std::string& table_name, const Where& where,
                const std::optional<std::vector<std::string>>& files, const Where& files_where, ImageSeries& series) {
  const fs::path path = reader.resolve(table_name);
  TextTable table;
  try {
    table = load_text_table(path, where, reader.problems);
  } catch (const UserError& error) {
    reader.problems.add(error);
    return;
  }
  const std::string place = path.string();
  const auto file_column =
      std::find_if(table.header.begin(), table.header.end(), [](const TableCell& c) { return c.text == "file"; });
  if (file_column == table.header.end()) {
    std::vector<std::string> names;
    for (const TableCell& cell : table.header) names.push_back(cell.text);
    reader.problems.add({place, table.header_line, 1}, "has no column file",
                        "it has " + some_of(names) + "; expected file, then parameter paths");
    return;
  }
  const auto file_at = static_cast<std::size_t>(file_column - table.header.begin());
  for (std::size_t c = 0; c < table.header.size(); ++c)
    if (c != file_at)
      series.columns.push_back({table.header[c].text, {place, table.header_line, table.header[c].column}});
  std::map<std::string, int> line_of;  // of a file's row
  std::vector<std::string> known;
  if (files)
    for (const std::string& file : *files) known.push_back(fs::path(file).filename().string());
  std::vector<Problem> absent;  // rows of files that there are not: slips, where a file of the series has no row
  for (std::size_t r = 0; r < table.rows.size(); ++r) {
    const TableCell& cell = table.rows[r][file_at];
    const Where here{place, table.lines[r], cell.column};
    SeriesFrame frame;
    frame.file = cell.text;
    frame.where = here;
    if (cell.text.empty()) {
      reader.problems.add(here, "names no file");
      continue;
    }
    if (files) {
      // By its path or by its name alone; names do not repeat.
      const auto match = std::find_if(files->begin(), files->end(), [&](const std::string& file) {
        return file == cell.text || fs::path(file).filename() == cell.text;
      });
      if (match != files->end()) {
        frame.file = *match;
      } else {
        const std::string near = nearest_word(cell.text, known);
        const Problem problem{here, cell.text + " is not among the files of the series",
                              near.empty() ? "" : "did you mean " + near + "?"};
        if (std::error_code code; fs::exists(reader.resolve(cell.text), code)) {
          reader.problems.add(problem.where, problem.what, problem.hint);
          continue;
        }
        absent.push_back(problem);
        if (!fs::path(cell.text).has_parent_path())
          frame.file = (fs::path(files->front()).parent_path() / cell.text).string();
      }
    }
    if (const auto [earlier, fresh] = line_of.emplace(frame.file, table.lines[r]); !fresh) {
      reader.problems.add(here, cell.text + " has a row already, in line " + std::to_string(earlier->second));
      continue;
    }
    for (std::size_t c = 0; c < table.header.size(); ++c)
      if (c != file_at)
        frame.cells.push_back({table.rows[r][c].text, {place, table.lines[r], table.rows[r][c].column}});
    series.frames.push_back(std::move(frame));
  }
  if (!files || !reader.problems.empty()) return;
  std::vector<std::string> without;
  for (const std::string& file : *files)
    if (!line_of.count(file)) without.push_back(file);
  if (without.empty()) return;
  for (const Problem& problem : absent) reader.problems.add(problem.where, problem.what, problem.hint);
  reader.problems.add(files_where, some_of(without) + (without.size() == 1 ? " has" : " have") + " no row in " + place,
                      "add rows, or narrow files");
}

void read_names(ConfigReader& reader, const Block& block, ImageSeries& series) {
  const YamlNode* list = block.find("shared");
  if (!list) return;
  if (!list->is_sequence() || list->items.empty()) {
    reader.problems.add(list->where, "micrographs.shared must be a list of parameter paths, found " +
                                         (list->is_sequence() ? "an empty one" : list->describe()));
    return;
  }
  for (const YamlNode& item : list->items) {
    if (!item.is_scalar())
      reader.problems.add(item.where, "micrographs.shared must hold parameter paths, found " + item.describe());
    else if (std::any_of(series.shared.begin(), series.shared.end(),
                         [&](const auto& other) { return other.first == item.text; }))
      reader.problems.add(item.where, item.text + " is listed twice");
    else
      series.shared.emplace_back(item.text, item.where);
  }
}

}  // namespace

bool is_series(const YamlNode& micrographs) {
  return micrographs.is_map() && (micrographs.find("files") || micrographs.find("set_from"));
}

bool holds_series(const std::string& text) {
  try {
    Problems ignored;
    const YamlNode tree = parse_yaml(text, "", ignored);
    const YamlNode* micrographs = tree.find("micrographs");
    return micrographs && is_series(*micrographs);
  } catch (const UserError&) {
    return false;
  }
}

ImageSeries read_series(const fs::path& path, std::string text) {
  ImageSeries series;
  series.path = path;
  series.text = std::move(text);
  ConfigReader reader(path.string(), path.parent_path(), ConfigUse::fit);
  const YamlNode tree = parse_yaml(series.text, reader.file, reader.problems);
  const YamlNode* node = tree.find("micrographs");
  if (!node || !is_series(*node)) {
    reader.problems.add(node ? node->where : Where{reader.file}, "is no series: it has no micrographs: {files: ..}",
                        "for the images it names run birefit fit " + reader.file);
    reader.problems.throw_if_any();
  }
  const Block block = reader.block_of(*node, "micrographs", {"files", "set_from", "shared", "along"});
  const auto place = [&](const char* key) { return block.find(key) ? block.find(key)->where : block.where; };
  const std::optional<std::string> pattern = reader.text(block, "files"), table = reader.text(block, "set_from"),
                                   along = reader.text(block, "along");
  read_names(reader, block, series);
  std::optional<std::vector<std::string>> files;
  if (pattern) {
    files = matching_files(reader.folder, *pattern);
    if (files->empty())
      reader.problems.add(place("files"), "no file matches " + *pattern,
                          "* stands for any letters, ? for one; paths start at the config's folder");
  }
  reader.problems.throw_if_any();
  if (table)
    join_table(reader, *table, place("set_from"), files, place("files"), series);
  else
    for (const std::string& file : *files) series.frames.push_back({{}, file, place("files"), {}, {}});

  std::map<std::string, std::string> file_of;
  for (SeriesFrame& frame : series.frames) {
    frame.name = fs::path(frame.file).stem().string();
    if (const auto [other, fresh] = file_of.emplace(frame.name, frame.file); !fresh)
      reader.problems.add(frame.where, other->second + " and " + frame.file + " are both called " + frame.name,
                          "frames need names of their own: rename one, or narrow files");
  }
  if (along && reader.problems.empty()) {
    const auto column = std::find_if(series.columns.begin(), series.columns.end(),
                                     [&](const ImageSeries::Column& c) { return c.name == *along; });
    std::vector<std::string> names;
    for (const ImageSeries::Column& c : series.columns) names.push_back(c.name);
    const std::string near = nearest_word(*along, names);
    if (column == series.columns.end()) {
      reader.problems.add(place("along"),
                          "along names " + *along + ", which is no column of " + table.value_or("a table (set_from)"),
                          near.empty() ? "" : "did you mean " + near + "?");
    } else {
      series.along = static_cast<std::size_t>(column - series.columns.begin());
      for (const SeriesFrame& frame : series.frames) {
        const SeriesFrame::Cell& cell = frame.cells[*series.along];
        if (const auto value = parse_number(cell.text); !value || !std::isfinite(*value))
          reader.problems.add(cell.where,
                              *along + " must be a number, found " + (cell.text.empty() ? "nothing" : cell.text));
      }
    }
  }
  reader.problems.throw_if_any();
  return series;
}

std::vector<YamlNode> cell_nodes(const SeriesFrame& frame) {
  std::vector<YamlNode> nodes;
  for (const SeriesFrame::Cell& cell : frame.cells) {
    YamlNode node;
    node.kind = cell.text.empty() ? YamlNode::Kind::null : YamlNode::Kind::scalar;
    node.text = cell.text;
    node.where = cell.where;
    nodes.push_back(std::move(node));
  }
  return nodes;
}

}  // namespace birefit
