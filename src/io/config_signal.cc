#include "io/config_signal.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "io/table.h"

namespace birefit {
namespace {

/// Robust standard deviation of one value: from differences of second, fourth and sixth order along x, the least of them, as
/// what they leave of the curve only adds. Differences of too high an order would amplify uneven spacing.
double noise_of(std::vector<std::pair<double, double>> rows) {
  std::sort(rows.begin(), rows.end());
  std::vector<double> difference;
  for (const auto& row : rows) difference.push_back(row.second);
  double least = std::numeric_limits<double>::infinity(), variance = 1;  // of a difference, C(2p, p) of order p
  for (std::size_t order = 1; order <= 6; ++order) {
    if (difference.size() < 2) break;
    for (std::size_t i = 0; i + 1 < difference.size(); ++i) difference[i] = difference[i + 1] - difference[i];
    difference.pop_back();
    variance *= 2.0 * (2.0 * static_cast<double>(order) - 1) / static_cast<double>(order);
    // Overlapping differences of so few rows tell too little to choose by.
    if (order % 2 || (order > 2 && difference.size() < 8 * order)) continue;
    std::vector<double> size;
    for (const double d : difference) size.push_back(std::abs(d));
    const auto middle = size.begin() + static_cast<std::ptrdiff_t>(size.size() / 2);
    std::nth_element(size.begin(), middle, size.end());
    least = std::min(least, 1.482602218505602 * *middle / std::sqrt(variance));
  }
  return std::isfinite(least) ? least : 0;
}

SignalItem read_item(ConfigReader& reader, const YamlNode& node, const std::string& path) {
  SignalItem item;
  const Block block = reader.block_of(node, path, {"file", "value", "columns", "set", "every", "noise"});
  item.where = item.file_where = block.where;
  if (!block.find("file")) reader.missing(block, "file");
  if (const auto file = reader.text(block, "file")) {
    item.file = *file;
    item.file_where = block.find("file")->where;
  }
  item.value_column = reader.text(block, "value").value_or("signal");
  item.every = reader.integer(block, "every", 1, 1000000).value_or(1);
  NumberSpec positive;
  positive.lower = 0;
  positive.lower_open = true;
  item.noise = reader.plain(block, "noise", positive);
  const auto pairs = [&](const char* key, const std::string& shape, const auto& take) {
    const YamlNode* map = block.find(key);
    if (!map) return;
    if (!map->is_map()) {
      reader.problems.add(map->where, block.path_of(key) + " must be a map of " + shape + ", found " + map->describe());
      return;
    }
    for (const YamlEntry& entry : map->entries) take(entry);
  };
  if (!block.find("columns")) reader.missing(block, "columns", "parameter path: name of the column that sets it");
  pairs("columns", "parameter paths and column names", [&](const YamlEntry& entry) {
    if (!entry.value.is_scalar()) {
      reader.problems.add(entry.value.where, entry.key + " must be the name of a column, found " + entry.value.describe());
      return;
    }
    item.columns.emplace_back(entry.key, entry.value.text);
    item.column_where.push_back(entry.where);
  });
  pairs("set", "parameter paths", [&](const YamlEntry& entry) {
    item.set.emplace_back(entry.key, &entry.value);
    item.set_where.push_back(entry.where);
  });
  return item;
}

}  // namespace

std::vector<SignalItem> read_signals(ConfigReader& reader, const Block& root) {
  std::vector<SignalItem> items;
  const YamlNode* node = root.find("signal");
  if (!node) return items;
  if (node->is_map()) {
    items.push_back(read_item(reader, *node, "signal"));
  } else if (node->is_sequence() && !node->items.empty()) {
    for (std::size_t i = 0; i < node->items.size(); ++i)
      items.push_back(read_item(reader, node->items[i], "signal[" + std::to_string(i) + "]"));
  } else {
    reader.problems.add(node->where, "signal must be a table {file, value, columns} or a list of them, found " + node->describe());
  }
  for (const char* other : {"micrographs", "calibration", "image_size_px"})
    if (const YamlNode* found = root.find(other))
      reader.problems.add(found->where, std::string(other) + " is given beside signal", "give one of the two");
  // What belongs to images would be dropped without a word.
  if (const YamlNode* micrograph = root.find("micrograph"))
    for (const char* key : {"image", "page", "channel", "transfer", "roi_px", "mask", "saturation_counts", "noise", "calibration"})
      if (const YamlNode* found = micrograph->find(key))
        reader.problems.add(found->where, std::string("micrograph.") + key + " is of images, this config has signal",
                            std::string(key) == "noise" ? "signal has its own noise" : "leave it out");
  return items;
}

void append_signal(ConfigReader& reader, const SignalItem& item, std::size_t number, const Micrograph& base,
                   const std::function<void(Micrograph&, ParameterRef, ParameterRef)>& replace, Config& config,
                   std::vector<Micrograph>& micrographs) {
  if (item.file.empty()) return;
  PlacedTable placed;
  try {
    placed = load_placed_table(reader.resolve(item.file), item.file_where, true);
  } catch (const UserError& error) {
    reader.problems.add(error);
    return;
  }
  const std::string file = reader.resolve(item.file).string();
  const auto& names = placed.table.columns;
  const auto column_of = [&](const std::string& name, const Where& where) {
    const auto found = std::find(names.begin(), names.end(), name);
    if (found != names.end()) return static_cast<int>(found - names.begin());
    const std::string near = nearest_word(name, names);
    reader.problems.add(where, item.file + " has no column " + name, near.empty() ? "it has " + list_words(names) : "did you mean " + near + "?");
    return -1;
  };
  const int value_column = column_of(item.value_column, item.file_where);
  struct Column {
    int at;
    ParameterRef shared;
    const NumberSpec* spec;
  };
  std::vector<Column> columns;
  for (std::size_t i = 0; i < item.columns.size(); ++i) {
    const auto& [path, name] = item.columns[i];
    const auto spec = reader.specs.find(path);
    if (spec == reader.specs.end()) {
      std::vector<std::string> known;
      for (const auto& [each, unused] : reader.specs) known.push_back(each);
      const std::string near = nearest_word(path, known);
      reader.problems.add(item.column_where[i], path + " is no parameter of this config", near.empty() ? "" : "did you mean " + near + "?");
      continue;
    }
    if (std::any_of(item.set.begin(), item.set.end(), [&](const auto& entry) { return entry.first == path; }))
      reader.problems.add(item.column_where[i], path + " is in columns and in set", "give one of the two");
    columns.push_back({column_of(name, item.column_where[i]), reader.refs.at(path), &spec->second});
  }
  if (value_column < 0 || columns.size() != item.columns.size() || columns.empty() ||
      std::any_of(columns.begin(), columns.end(), [](const Column& c) { return c.at < 0; }))
    return;

  const auto& rows = placed.table.rows;
  std::vector<std::pair<double, double>> curve;
  for (const auto& row : rows) curve.emplace_back(row[static_cast<std::size_t>(columns[0].at)], row[static_cast<std::size_t>(value_column)]);
  double largest = 0;
  for (const auto& point : curve) largest = std::max(largest, std::abs(point.second));
  NoiseModel noise;  // of the whole table; one pixel cannot tell its own
  noise.read_counts = item.noise ? *item.noise : std::max(noise_of(curve), 1e-6 * largest);
  SignalTable table{std::filesystem::path(file).filename().string(), micrographs.size(), item.columns[0].first, {}};
  // In the order of the first column: what neighbouring rows share is told from their order.
  std::vector<std::size_t> order(rows.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return curve[a].first < curve[b].first; });
  for (std::size_t k = 0; k < order.size(); k += static_cast<std::size_t>(item.every)) {
    const std::size_t r = order[k];
    Micrograph micrograph = base;
    micrograph.name = table.name + ":" + std::to_string(placed.lines[r]);
    micrograph.values = Image(1, 1, rows[r][static_cast<std::size_t>(value_column)]);
    micrograph.mask = Mask(1, 1, 1);
    micrograph.noise = noise;
    for (std::size_t c = 0; c < columns.size(); ++c) {
      const std::size_t at = static_cast<std::size_t>(columns[c].at);
      const double value = rows[r][at];
      if (!columns[c].spec->contains(value))
        reader.problems.add({file, placed.lines[r], placed.cell_columns[r][at]},
                            item.columns[c].second + " = " + show(value) + " is outside " + columns[c].spec->range() + ", the range of " +
                                item.columns[c].first);
      const std::string name = "signal[" + std::to_string(number) + "].row[" + std::to_string(r) + "]." + item.columns[c].first;
      replace(micrograph, columns[c].shared, reader.table.add_constant(name, value, columns[c].spec->unit));
    }
    table.x.push_back(rows[r][static_cast<std::size_t>(columns[0].at)]);
    micrographs.push_back(std::move(micrograph));
    if (reader.problems.all().size() > 100) return;  // a wrong column, said often enough
  }
  if (table.x.size() < 3) reader.problems.add(item.file_where, item.file + " has fewer than three rows");
  config.signals.push_back(std::move(table));
}

}  // namespace birefit
