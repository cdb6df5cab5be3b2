#include "io/config/signal.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <regex>
#include <utility>

#include <fmt/format.h>

#include "core/printable.h"
#include "core/robust.h"
#include "fit/weights/rows.h"
#include "io/config/micrograph.h"

namespace birefit {
namespace {

/// Robust standard deviation of one value: from differences of second, fourth and sixth order along x, the least of
/// them, as what they leave of the curve only adds. Differences of too high an order would amplify uneven spacing.
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
    least = std::min(least, kNormalSdPerMad * median(std::move(size)) / std::sqrt(variance));
  }
  return std::isfinite(least) ? least : 0;
}

/// A table in a file, or frames that make one.
void read_source(ConfigReader& reader, const Block& block, SignalItem& item) {
  const YamlNode *file = block.find("file"), *frames = block.find("frames");
  if (!file && !frames) reader.missing(block, "file", "or frames: images whose means over roi_px are the rows");
  if (file && frames) reader.problems.add(frames->where, "frames is given beside file", "give one of the two");
  const char* key = frames ? "frames" : "file";
  if (const auto name = reader.text(block, key)) {
    item.file = *name;
    item.file_where = block.find(key)->where;
  }
  for (const char* other : {"set_from", "roi_px"})
    if (const YamlNode* found = block.find(other); found && !frames)
      reader.problems.add(found->where, std::string(other) + " is of frames", "frames: stack.tif");
  if (!frames) return;
  if (const YamlNode* value = block.find("value"))
    reader.problems.add(value->where, "value is of a file: of frames it is the mean over roi_px", "leave it out");
  FramesAsked asked;
  asked.files = item.file, asked.files_where = item.file_where;
  asked.set_from = reader.text(block, "set_from");
  if (asked.set_from) asked.set_from_where = block.find("set_from")->where;
  item.frames = asked;
  item.roi = read_roi(reader, block, item.roi_where);
}

SignalItem read_item(ConfigReader& reader, const YamlNode& node, const std::string& path) {
  SignalItem item;
  const Block block = reader.block_of(
      node, path,
      {"file", "frames", "set_from", "roi_px", "value", "quantity", "columns", "where", "set", "every", "noise"});
  item.where = item.file_where = block.where;
  read_source(reader, block, item);
  item.value_column = reader.text(block, "value").value_or("signal");
  const std::vector<std::string> quantities{"intensity", "retardance_um", "retardance_waves", "birefringence"};
  if (const auto quantity = reader.choice(block, "quantity", quantities))
    item.quantity =
        static_cast<Quantity>(std::find(quantities.begin(), quantities.end(), *quantity) - quantities.begin());
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
    SignalItem::Column column{entry.key, entry.value.text, 1, 0, entry.where};
    if (entry.value.is_map()) {
      const Block map = reader.block_of(entry.value, path + ".columns." + entry.key, {"column", "scale", "plus"});
      if (!map.find("column")) reader.missing(map, "column");
      column.name = reader.text(map, "column").value_or("");
      NumberSpec any;
      column.scale = reader.plain(map, "scale", any).value_or(1);
      column.plus = reader.plain(map, "plus", any).value_or(0);
    } else if (!entry.value.is_scalar()) {
      reader.problems.add(
          entry.value.where,
          entry.key + " must be the name of a column, or {column, scale, plus}, found " + entry.value.describe());
      return;
    }
    item.columns.push_back(column);
  });
  pairs("where", "column names and what they must hold", [&](const YamlEntry& entry) {
    SignalItem::Only only{entry.key, entry.value.text, {}, entry.where};
    if (entry.value.is_sequence()) {
      const auto number = [&](std::size_t i) {
        return entry.value.items[i].is_scalar() ? parse_number(entry.value.items[i].text) : std::nullopt;
      };
      if (entry.value.items.size() == 2 && number(0) && number(1) && *number(0) <= *number(1))
        only.range = {*number(0), *number(1)};
    }
    if (!only.range && !entry.value.is_scalar()) {
      reader.problems.add(entry.value.where,
                          entry.key + " must be a text or a range [low, high], found " + entry.value.describe());
      return;
    }
    item.only.push_back(only);
  });
  pairs("set", "parameter paths", [&](const YamlEntry& entry) {
    item.set.emplace_back(entry.key, &entry.value);
    item.set_where.push_back(entry.where);
  });
  return item;
}

/// A row of a table that is wanted, as numbers.
struct Row {
  std::size_t number;  ///< in the file
  double value;
  std::vector<double> set;  ///< what the columns set
};

/// A range asks for a number; a text for itself, or for the same number written otherwise ("25", "25.0").
bool lets_through(const SignalItem::Only& only, const std::string& text) {
  const std::optional<double> x = parse_number(text);
  if (only.range) return x && *x >= (*only.range)[0] && *x <= (*only.range)[1];
  const std::optional<double> wanted = parse_number(only.text);
  return text == only.text || (x && wanted && *x == *wanted);
}

/// The rows that `where` (in the columns `only`) lets through, with the numbers of `columns`: the value, then what sets
/// parameters. Where a reading is missing the row is left out, which is said; what has digits and is no number is a
/// slip.
std::vector<Row> wanted_rows(ConfigReader& reader, const TextTable& text, const std::string& file,
                             const SignalItem& item, const std::vector<int>& only, const std::vector<int>& columns) {
  constexpr std::size_t kMostProblems = 100;
  std::vector<Row> rows;
  std::vector<int> left_out;
  const std::size_t before = reader.problems.all().size();
  for (std::size_t r = 0; r < text.rows.size() && reader.problems.all().size() <= before + kMostProblems; ++r) {
    const auto cell = [&](int at) -> const TableCell& { return text.rows[r][static_cast<std::size_t>(at)]; };
    bool wanted = true, missing = false;
    for (std::size_t i = 0; i < only.size(); ++i) {
      if (item.only[i].range && is_missing_number(cell(only[i]).text))
        missing = true;
      else
        wanted = wanted && lets_through(item.only[i], cell(only[i]).text);
    }
    if (!wanted) continue;
    std::vector<double> numbers;
    for (const int at : columns) {
      const std::string& shown = cell(at).text;
      const std::optional<double> x = parse_number(shown);
      missing = missing || is_missing_number(shown);
      if (!is_missing_number(shown) && !(x && std::isfinite(*x)))
        reader.problems.add(
            {file, text.lines[r], cell(at).column},
            text.header[static_cast<std::size_t>(at)].text + " = " + shown.substr(0, 40) + " is not a finite number",
            number_hint(shown));
      numbers.push_back(x.value_or(0));
    }
    if (missing) {
      left_out.push_back(text.lines[r]);
      continue;
    }
    Row row{r, numbers[0], {}};
    for (std::size_t c = 0; c < item.columns.size(); ++c)
      row.set.push_back(item.columns[c].scale * numbers[c + 1] + item.columns[c].plus);
    rows.push_back(std::move(row));
  }
  if (reader.problems.all().size() > before) return rows;
  const std::string name = printable(std::filesystem::path(file).filename().string());
  if (!left_out.empty()) reader.warnings.push_back(describe_left_out(name, left_out));
  if (rows.size() < 3)
    reader.problems.add(item.file_where, item.file +
                                             (rows.size() + left_out.size() < text.rows.size()
                                                  ? " has fewer than three rows that `where` lets through"
                                                  : " has fewer than three rows") +
                                             (left_out.empty() ? "" : " and have numbers"));
  return rows;
}

/// What a table says of a column's unit, and where: in its line of units or in the column's name; empty: nothing.
std::pair<std::string, const char*> unit_of(const TextTable& text, int column, const std::string& name) {
  if (!text.units.empty() && !text.units[static_cast<std::size_t>(column)].empty())
    return {text.units[static_cast<std::size_t>(column)], " by the table's line of units, "};
  return {unit_in_name(name), " by its name, "};
}

/// A table that says "mV" under a column that sets volts, and a config that takes the numbers as they are.
void check_unit(ConfigReader& reader, const TextTable& text, int column, const SignalItem& item, std::size_t i,
                const std::string& unit) {
  const SignalItem::Column& taken = item.columns[i];
  if (column < 0 || taken.scale != 1 || taken.plus != 0) return;
  const auto [given, by] = unit_of(text, column, taken.name);
  if (contradicts_unit(given, unit))
    reader.problems.add(taken.where, taken.name + " is in " + given + by + taken.path + " in " + unit,
                        "{column: " + taken.name + ", scale: .., plus: ..} converts it");
}

/// Spectrometers save what they show: decibels, absorbances.
void warn_of_logarithms(ConfigReader& reader, const std::string& unit, const std::string& name) {
  static const std::regex absorbance("(.*[^a-z])?(absorbance|optical density|od|dbm?)([^a-z].*)?", std::regex::icase);
  if (unit == "dB" || unit == "dBm" || std::regex_match(name, absorbance))
    reader.warnings.push_back(name +
                              " is a logarithm of light by its name, and a signal is proportional to light: give "
                              "transmission, 10^(dB / 10) or 10^(-absorbance).");
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
    reader.problems.add(node->where,
                        "signal must be a table {file, value, columns} or a list of them, found " + node->describe());
  }
  const bool images =
      std::any_of(items.begin(), items.end(), [](const SignalItem& item) { return item.frames.has_value(); });
  for (const char* other : {"micrographs", "calibration", "image_size_px"})
    if (const YamlNode* found = root.find(other); found && !(images && std::string(other) == "calibration"))
      reader.problems.add(found->where, std::string(other) + " is given beside signal", "give one of the two");
  // What belongs to images would be dropped without a word.
  if (const YamlNode* micrograph = root.find("micrograph"))
    for (const char* key :
         {"image", "page", "channel", "transfer", "roi_px", "bin", "mask", "saturation_counts", "noise", "calibration"})
      if (const YamlNode* found = micrograph->find(key);
          found && !(images && std::string(key) != "image" && std::string(key) != "noise" && std::string(key) != "bin"))
        reader.problems.add(found->where, std::string("micrograph.") + key + " is of images, this config has signal",
                            std::string(key) == "noise" ? "signal has its own noise" : "leave it out");
  return items;
}

std::optional<TextTable> load_signal(ConfigReader& reader, const SignalItem& item) {
  if (item.file.empty()) return std::nullopt;
  try {
    Problems problems;
    TextTable text = load_text_table(reader.resolve(item.file), item.file_where, problems, true);
    problems.throw_if_any();
    return text;
  } catch (const UserError& error) {
    reader.problems.add(error);
    return std::nullopt;
  }
}

namespace {

/// Places of names in the header of a table.
class Header {
 public:
  Header(ConfigReader& reader, const SignalItem& item, const TextTable& text) : reader_(reader), item_(item) {
    for (const TableCell& cell : text.header) names_.push_back(cell.text);
  }
  /// -1, and a problem, where there is none.
  int at(const std::string& name, const Where& where) const {
    const auto found = std::find(names_.begin(), names_.end(), name);
    if (found != names_.end()) return static_cast<int>(found - names_.begin());
    const std::string near = nearest_word(name, names_);
    reader_.problems.add(where, item_.file + " has no column " + name,
                         near.empty() ? "it has " + list_words(names_) : "did you mean " + near + "?");
    return -1;
  }

 private:
  ConfigReader& reader_;
  const SignalItem& item_;
  std::vector<std::string> names_;
};

/// A column that sets a number of each row.
struct SetColumn {
  int at;
  ParameterRef shared;
  const NumberSpec* spec;
};

std::vector<SetColumn> set_columns(ConfigReader& reader, const SignalItem& item, const TextTable& text,
                                   const Header& header) {
  std::vector<SetColumn> columns;
  for (std::size_t i = 0; i < item.columns.size(); ++i) {
    const std::string& path = item.columns[i].path;
    const auto spec = reader.specs.find(path);
    if (spec == reader.specs.end()) {
      std::vector<std::string> known;
      for (const auto& [each, unused] : reader.specs) known.push_back(each);
      const std::string near = nearest_word(path, known);
      reader.problems.add(item.columns[i].where, path + " is no parameter of this config",
                          near.empty() ? "" : "did you mean " + near + "?");
      continue;
    }
    if (std::any_of(item.set.begin(), item.set.end(), [&](const auto& entry) { return entry.first == path; }))
      reader.problems.add(item.columns[i].where, path + " is in columns and in set", "give one of the two");
    if (path == "micrograph.gain" || path == "micrograph.offset")
      reader.problems.add(item.columns[i].where, "a column cannot set " + path,
                          "rows of a table share the lamp and the detector: give it in micrograph");
    columns.push_back({header.at(item.columns[i].name, item.columns[i].where), reader.refs.at(path), &spec->second});
    check_unit(reader, text, columns.back().at, item, i, spec->second.unit);
  }
  return columns;
}

/// What a table's values are called.
std::string words_of(Quantity quantity, const std::string& otherwise) {
  switch (quantity) {
    case Quantity::intensity:
    case Quantity::ring_radius_cm:
      break;
    case Quantity::retardance_um:
      return "retardance (\u00b5m)";
    case Quantity::retardance_waves:
      return "retardance (waves)";
    case Quantity::birefringence:
      return "birefringence";
  }
  return otherwise;
}

}  // namespace

void append_signal(ConfigReader& reader, const SignalItem& item, const TextTable& text, std::size_t number,
                   const Picture& base, std::size_t first,
                   const std::function<void(Scene&, ParameterRef, ParameterRef)>& replace, Config& config,
                   std::vector<Readings>& tables) {
  // Where the rows are; a pattern of frames is no file that is read.
  const std::string file = item.frames ? (reader.folder / item.frames->set_from.value_or(item.file)).string()
                                       : reader.resolve(item.file).string();
  const Header header(reader, item, text);
  reader.warnings.insert(reader.warnings.end(), text.notes.begin(), text.notes.end());
  const int value_column = header.at(item.value_column, item.file_where);
  if (value_column >= 0 && item.quantity == Quantity::retardance_um)
    if (const auto [given, by] = unit_of(text, value_column, item.value_column); contradicts_unit(given, "um"))
      reader.problems.add(item.file_where, item.value_column + " is in " + given + by + "quantity retardance_um in um",
                          "give the retardances in um");
  if (value_column >= 0 && item.quantity == Quantity::intensity)
    warn_of_logarithms(reader, unit_of(text, value_column, item.value_column).first, item.value_column);
  const std::vector<SetColumn> columns = set_columns(reader, item, text, header);
  std::vector<int> only;
  for (const SignalItem::Only& each : item.only) only.push_back(header.at(each.column, each.where));
  if (value_column < 0 || columns.size() != item.columns.size() || columns.empty() ||
      std::any_of(columns.begin(), columns.end(), [](const SetColumn& c) { return c.at < 0; }) ||
      std::any_of(only.begin(), only.end(), [](int at) { return at < 0; }))
    return;

  std::vector<int> wanted_columns{value_column};
  for (const SetColumn& column : columns) wanted_columns.push_back(column.at);
  const std::size_t before = reader.problems.all().size();
  const std::vector<Row> rows = wanted_rows(reader, text, file, item, only, wanted_columns);
  if (reader.problems.all().size() > before) return;
  std::vector<std::pair<double, double>> curve;
  for (const Row& row : rows) curve.emplace_back(row.set[0], row.value);
  double largest = 0;
  for (const auto& point : curve) largest = std::max(largest, std::abs(point.second));
  NoiseModel noise;  // of the whole table; one pixel cannot tell its own
  noise.read_counts = item.noise ? *item.noise : std::max(noise_of(curve), 1e-6 * largest);
  SignalTable table{
      printable(std::filesystem::path(item.file).filename().string()), first, item.columns[0].path, {}, {}};
  table.quantity = words_of(item.quantity, table.quantity);
  Readings readings;
  readings.name = table.name;
  readings.observable.quantity = item.quantity;
  readings.gain = base.gain, readings.offset = base.offset;
  readings.noise = noise;
  readings.noise_at_most = !item.noise;
  std::vector<double> values;
  // In the order of the first column: what neighbouring rows share is told from their order.
  std::vector<std::size_t> order(rows.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return curve[a].first < curve[b].first; });
  for (std::size_t k = 0; k < order.size(); k += static_cast<std::size_t>(item.every)) {
    const Row& row = rows[order[k]];
    const int line = text.lines[row.number];
    Scene scene = base.scene;
    for (std::size_t c = 0; c < columns.size(); ++c) {
      const double value = row.set[c];
      if (!columns[c].spec->contains(value))
        reader.problems.add({file, line, text.rows[row.number][static_cast<std::size_t>(columns[c].at)].column},
                            item.columns[c].name + " = " + show(value) + " is outside " + range_of(*columns[c].spec) +
                                ", the range of " + item.columns[c].path);
      const std::string name =
          "signal[" + std::to_string(number) + "].row[" + std::to_string(row.number) + "]." + item.columns[c].path;
      const ParameterRef own = reader.table.add_constant(name, value, columns[c].spec->unit);
      // The zero of a dial or thermometer, the scale of a monochromator, as well as it is known where the number itself
      // stands in the config.
      const Parameter& stated = reader.table[columns[c].shared];
      reader.table[own].known_to = stated.where.line > 0 && !stated.free ? stated.known_to : columns[c].spec->known_to;
      replace(scene, columns[c].shared, own);
    }
    table.x.push_back(row.set[0]);
    table.line.push_back(line);
    values.push_back(row.value);
    readings.rows.push_back(std::move(scene));
    readings.lines.push_back(line);
    if (reader.problems.all().size() > 100) return;  // a wrong column, said often enough
  }
  if (table.x.size() < 3) reader.problems.add(item.file_where, item.file + " has fewer than three rows");
  readings.values = Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
  tables.push_back(std::move(readings));
  config.signals.push_back(std::move(table));
}

std::vector<std::string> describe_rows(const Config& config) {
  std::vector<std::string> sentences;
  for (std::size_t k = 0; k < config.signals.size() && k < config.job.measurements.size(); ++k) {
    const SignalTable& table = config.signals[k];
    const Eigen::VectorXd& values = std::get<Readings>(config.job.measurements[k]).values;
    std::vector<std::size_t> order(table.line.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return table.line[a] < table.line[b]; });
    std::vector<double> x, y;
    for (const std::size_t i : order) {
      x.push_back(table.x[i]);
      y.push_back(values[static_cast<Eigen::Index>(i)]);
    }
    const RowFindings found = look_at_rows(x, y);
    if (!found.outliers.empty()) {
      std::string lines;
      for (std::size_t k = 0; k < std::min<std::size_t>(found.outliers.size(), 10); ++k)
        lines += (k ? ", " : "") + std::to_string(table.line[order[found.outliers[k]]]);
      sentences.push_back(
          fmt::format("{}: {} of {} rows stand out of their neighbours by eight times the scatter and more (line "
                      "{}{}): take them out if they are slips.",
                      table.name, found.outliers.size(), y.size(), lines, found.outliers.size() > 10 ? ", .." : ""));
    }
    if (found.hysteretic())
      sentences.push_back(
          fmt::format("{}: rows at the same {} that were taken at different times differ by {:.2g} in the median, "
                      "{:.0f} times what neighbouring rows scatter: what is measured depends on "
                      "the way there (hysteresis, drift), and no single curve describes it.",
                      table.name, table.path, found.hysteresis, found.hysteresis / found.scatter));
  }
  return sentences;
}

}  // namespace birefit
