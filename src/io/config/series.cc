#include "io/config/series.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "io/config/frames.h"
#include "io/config/overrides.h"
#include "io/files/table.h"

namespace birefit {
namespace {

namespace fs = std::filesystem;

/// A list of parameter paths.
std::vector<std::pair<std::string, Where>> read_names(ConfigReader& reader, const Block& block,
                                                      const std::string& key) {
  std::vector<std::pair<std::string, Where>> names;
  const YamlNode* list = block.find(key);
  if (!list) return names;
  const std::string path = block.path_of(key);
  if (!list->is_sequence() || list->items.empty()) {
    reader.problems.add(list->where, path + " must be a list of parameter paths, found " +
                                         (list->is_sequence() ? "an empty one" : list->describe()));
    return names;
  }
  for (const YamlNode& item : list->items) {
    if (!item.is_scalar())
      reader.problems.add(item.where, path + " must hold parameter paths, found " + item.describe());
    else if (std::any_of(names.begin(), names.end(), [&](const auto& other) { return other.first == item.text; }))
      reader.problems.add(item.where, item.text + " is listed twice");
    else
      names.emplace_back(item.text, item.where);
  }
  return names;
}

/// The column to draw against, of numbers.
void find_abscissa(ConfigReader& reader, const std::string& along, const Where& where, const std::string& table,
                   ImageSeries& series) {
  const auto column = std::find_if(series.columns.begin(), series.columns.end(),
                                   [&](const ImageSeries::Column& c) { return c.name == along; });
  std::vector<std::string> names;
  for (const ImageSeries::Column& c : series.columns) names.push_back(c.name);
  const std::string near = nearest_word(along, names);
  if (column == series.columns.end()) {
    reader.problems.add(where, "along names " + along + ", which is no column of " + table,
                        near.empty() ? "" : "did you mean " + near + "?");
    return;
  }
  series.along = static_cast<std::size_t>(column - series.columns.begin());
  for (const SeriesFrame& frame : series.frames) {
    const SeriesFrame::Cell& cell = frame.cells[*series.along];
    if (const auto value = parse_number(cell.text); !value || !std::isfinite(*value))
      reader.problems.add(cell.where,
                          along + " must be a number, found " + (cell.text.empty() ? "nothing" : cell.text));
  }
}

}  // namespace

bool is_series(const YamlNode& micrographs) {
  return micrographs.is_map() && (micrographs.find("files") || micrographs.find("set_from"));
}

bool holds_series(const std::string& text, const std::vector<std::string>& set) {
  try {
    Problems ignored;
    const YamlNode tree = parse_config(text, "", set, ignored);
    const YamlNode* micrographs = tree.find("micrographs");
    return micrographs && is_series(*micrographs);
  } catch (const UserError&) {
    return false;
  }
}

ImageSeries read_series(const fs::path& path, std::string text, const std::vector<std::string>& set) {
  ImageSeries series;
  series.path = path;
  series.text = std::move(text);
  series.set = set;
  ConfigReader reader(path.string(), path.parent_path(), ConfigUse::fit);
  const YamlNode tree = parse_config(series.text, reader.file, set, reader.problems);
  const YamlNode* node = tree.find("micrographs");
  if (!node || !is_series(*node)) {
    reader.problems.add(node ? node->where : Where{reader.file}, "is no series: it has no micrographs: {files: ..}",
                        "for the images it names run birefit fit " + reader.file);
    reader.problems.throw_if_any();
  }
  const Block block = reader.block_of(*node, "micrographs", {"files", "set_from", "shared", "own", "along"});
  const auto place = [&](const char* key) { return block.find(key) ? block.find(key)->where : block.where; };
  FramesAsked asked;
  asked.files = reader.text(block, "files"), asked.files_where = place("files");
  asked.set_from = reader.text(block, "set_from"), asked.set_from_where = place("set_from");
  const YamlNode* micrograph = tree.find("micrograph");
  if (micrograph && micrograph->is_map()) asked.page = read_page(reader, {micrograph, "micrograph", micrograph->where});
  const std::optional<std::string> along = reader.text(block, "along");
  series.shared = read_names(reader, block, "shared");
  series.own = read_names(reader, block, "own");
  if (series.shared.size() * series.own.size() > 0)
    reader.problems.add(place("own"), "own is given beside shared",
                        "shared is of birefit series, own of birefit fit: give one of the two");
  reader.problems.throw_if_any();
  find_frames(reader, asked, series);

  std::map<std::string, std::string> file_of;
  for (const SeriesFrame& frame : series.frames) {
    if (frame.name == "." || frame.name == "..") {  // ...tif
      reader.problems.add(frame.where,
                          frame.file + " without its extension is " + frame.name + ", no name for a folder",
                          "its results go to frames/NAME: rename the file");
      continue;
    }
    if (const auto [other, fresh] = file_of.emplace(frame.name, frame.file); !fresh)
      reader.problems.add(frame.where, other->second + " and " + frame.file + " are both called " + frame.name,
                          "frames need names of their own: rename one, or narrow files");
  }
  if (along && reader.problems.empty())
    find_abscissa(reader, *along, place("along"), asked.set_from.value_or("a table (set_from)"), series);
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
