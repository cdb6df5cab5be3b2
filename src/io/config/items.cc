#include "io/config/items.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "io/config/micrograph.h"
#include "io/config/pictures.h"
#include "io/config/series.h"

namespace birefit {
namespace {

/// All images of a `{files, set_from}` in one fit.
std::vector<Item> read_frames(ConfigReader& reader, const Config& config, TableNodes& nodes) {
  try {
    const ImageSeries series = read_series(config.path, config.text);
    if (!series.shared.empty())
      reader.problems.add(series.shared[0].second,
                          "micrographs.shared is of a series, whose frames are fitted one by one",
                          "run birefit series " + reader.file +
                              "; one fit of all images shares whatever own: [..] does not name: leave shared out");
    return items_of(reader, series, 0, series.frames.size(), nodes);
  } catch (const UserError& error) {
    reader.problems.add(error);
    return {};
  }
}

void read_set(ConfigReader& reader, const YamlNode& set, const std::string& path, Item& item) {
  if (!set.is_map())
    reader.problems.add(set.where, path + " must be a map of parameter paths, found " + set.describe());
  for (const YamlEntry& entry : set.entries) {
    item.set.emplace_back(entry.key, &entry.value);
    item.set_where.push_back(entry.where);
  }
}

Item read_item(ConfigReader& reader, const YamlNode& node, const std::string& path) {
  const Block block = reader.block_of(node, path, {"image", "set", "page", "roi_px"});
  Item item;
  item.image = reader.text(block, "image");
  item.image_where = block.find("image") ? block.find("image")->where : block.where;
  if (!block.find("image") && reader.use == ConfigUse::fit) reader.missing(block, "image");
  item.page = read_page(reader, block);
  if (block.find("roi_px")) item.roi = read_roi(reader, block, item.roi_where);
  if (const YamlNode* set = block.find("set")) read_set(reader, *set, path + ".set", item);
  return item;
}

/// Is `path` what `own` names, or in it: micrograph.center_px names both of its coordinates.
bool names(const std::string& own, const std::string& path) {
  return path == own || path.starts_with(own + ".") || path.starts_with(own + "[");
}

}  // namespace

std::vector<Item> read_items(ConfigReader& reader, const Block& root, const Config& config, TableNodes& nodes) {
  std::vector<Item> items;
  const YamlNode* list = root.find("micrographs");
  if (!list) return items;
  if (is_series(*list)) return read_frames(reader, config, nodes);
  if (!list->is_sequence() || list->items.empty()) {
    reader.problems.add(list->where, "micrographs must be a list of {image, set}, or {files: ..}, found " +
                                         (list->is_sequence() ? "an empty one" : list->describe()));
    return items;
  }
  for (std::size_t i = 0; i < list->items.size(); ++i)
    items.push_back(read_item(reader, list->items[i], "micrographs[" + std::to_string(i) + "]"));
  return items;
}

std::vector<Item> items_of(ConfigReader& reader, const ImageSeries& series, std::size_t first, std::size_t last,
                           TableNodes& nodes) {
  std::vector<Item> items;
  reader.warnings.insert(reader.warnings.end(), series.notes.begin(), series.notes.end());
  nodes.reserve(nodes.size() + last - first);
  for (std::size_t i = first; i < last; ++i) {
    const SeriesFrame& frame = series.frames[i];
    if (!frame.unreadable.empty()) reader.problems.add(frame.where, frame.unreadable);
    nodes.push_back(cell_nodes(frame));
    Item item;
    item.image = frame.file;
    item.image_where = frame.where;
    item.page.number = frame.page;
    item.page.where = frame.where;
    item.own = series.own;
    for (std::size_t c = 0; c < nodes.back().size(); ++c) {
      item.set.emplace_back(series.columns[c].name, &nodes.back()[c]);
      item.set_where.push_back(series.columns[c].where);
    }
    if (series.along) item.axis = series.columns[*series.along].name;
    items.push_back(std::move(item));
  }
  return items;
}

namespace {

/// apply_set() with what the names of own parameters begin with. Entries that have such a name already serve.
Picture with_own(ConfigReader& reader, const Picture& shared, const Item& item, std::size_t index,
                 const std::string& prefix) {
  Picture micrograph = shared;
  const std::map<std::string, NumberSpec> shared_specs = reader.specs;
  const std::map<std::string, ParameterRef> shared_refs = reader.refs;
  for (std::size_t k = 0; k < item.set.size(); ++k) {
    const auto& [path, node] = item.set[k];
    const auto spec = shared_specs.find(path);
    if (spec == shared_specs.end()) {
      if (path == item.axis) continue;
      std::vector<std::string> known;
      for (const auto& [name, unused] : shared_specs) known.push_back(name);
      const std::string near = nearest_word(path, known);
      reader.problems.add(item.set_where[k], path + " is no parameter of this config",
                          !near.empty() ? "did you mean " + near + "?" : "known here: " + list_words(known));
      continue;
    }
    ParameterRef own = reader.table.find(prefix + path);
    if (!own) own = reader.number_at(*node, prefix + path, spec->second);
    if (spec->second.linear && !std::isfinite(reader.table[own].value))
      reader.table[own].value = reader.table[shared_refs.at(path)].value;
    if (path == "micrograph.gain") keep_positive(reader.table[own]);
    reader.replaced.insert(shared_refs.at(path).index);
    replace_ref(micrograph, shared_refs.at(path), own);
  }
  for (const auto& [own, where] : item.own) {
    bool known = false, fitted = false;
    for (const auto& [path, ref] : shared_refs) {
      if (!names(own, path)) continue;
      known = true;
      if (!reader.table[ref].free) continue;
      fitted = true;
      Parameter copy = reader.table[ref];
      copy.name = prefix + path;
      reader.replaced.insert(ref.index);
      replace_ref(micrograph, ref, reader.table.add(std::move(copy)));
    }
    if (fitted || index > 0) continue;  // said of the first image
    std::vector<std::string> paths;
    for (const auto& [path, unused] : shared_refs) paths.push_back(path);
    const std::string near = nearest_word(own, paths);
    reader.problems.add(where, own + (known ? " is not fitted here" : " is no parameter of this config"),
                        known          ? "give it {value: .., fit: [low, high]}"
                        : near.empty() ? "known here: " + list_words(paths)
                                       : "did you mean " + near + "?");
  }
  // The names of this image's parameters are no paths for the next image's `set:`.
  reader.specs = shared_specs;
  reader.refs = shared_refs;
  return micrograph;
}

}  // namespace

Picture apply_set(ConfigReader& reader, const Picture& shared, const Item& item, std::size_t index,
                  const std::string& list) {
  return with_own(reader, shared, item, index, fmt::format("{}[{}].", list, index));
}

Picture apply_colour(ConfigReader& reader, const Picture& shared, const std::string& colour, const YamlNode& set) {
  Item own;
  const std::string path = "micrograph.channels." + colour;
  read_set(reader, set, path, own);
  return with_own(reader, shared, own, 0, path + ".");
}

}  // namespace birefit
