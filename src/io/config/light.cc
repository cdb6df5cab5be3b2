#include "io/config/light.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "birefit/measurement.h"
#include "instrument/camera_tables.h"
#include "instrument/channel_light.h"
#include "io/config/described.h"
#include "io/config/pictures.h"
#include "io/files/table.h"

namespace birefit {
namespace {

/// Where to begin to look at indices while no channel is known: the middle of what is seen.
constexpr double kMiddleNm = 550;
constexpr double kUmPerNm = 1e-3;
const std::array<const char*, 3> kColours = {"r", "g", "b"};

/// A column of a table over wavelength_nm (or wavelength_um).
std::shared_ptr<const SpectralTable> column_of(ConfigReader& reader, const PlacedTable& table, const std::string& file,
                                               std::size_t column, const std::string& name) {
  const std::vector<std::string>& names = table.table.columns;
  const double unit = names.at(0) == "wavelength_um" ? 1 : kUmPerNm;
  std::vector<double> um, value;
  for (const std::vector<double>& row : table.table.rows) {
    um.push_back(unit * row[0]);
    value.push_back(row[column]);
  }
  try {
    return std::make_shared<SpectralTable>(spectral_table(std::move(um), std::move(value), {file}, name));
  } catch (const UserError& error) {
    reader.problems.add(error);
    return nullptr;
  }
}

/// A file whose first column is the wavelength; nothing with a problem.
std::optional<PlacedTable> load_spectrum_file(ConfigReader& reader, const std::string& name, const Where& where) {
  const std::string file = reader.resolve(name).string();
  try {
    PlacedTable table = load_placed_table(file, where);
    const std::vector<std::string>& columns = table.table.columns;
    reader.warnings.insert(reader.warnings.end(), table.notes.begin(), table.notes.end());
    if (columns.size() >= 2 && (columns[0] == "wavelength_nm" || columns[0] == "wavelength_um")) return table;
    reader.problems.add({file, table.header_line}, "is no spectrum: its columns are " + list_words(columns),
                        "name the first column wavelength_nm, the others what they hold");
  } catch (const UserError& error) {
    reader.problems.add(error);
  }
  return std::nullopt;
}

/// {file: lamp.csv}: the only column beside the wavelength.
std::shared_ptr<const SpectralTable> read_table(ConfigReader& reader, const Block& block, const std::string& what) {
  const std::optional<std::string> name = reader.text(block, "file");
  if (!name) return nullptr;
  const Where where = block.find("file")->where;
  const auto table = load_spectrum_file(reader, *name, where);
  if (!table) return nullptr;
  if (table->table.columns.size() > 2)
    reader.problems.add(where,
                        *name + " has several columns beside the wavelength: " +
                            list_words({table->table.columns.begin() + 1, table->table.columns.end()}),
                        "keep the one that is meant");
  return column_of(reader, *table, *name, 1, what);
}

void read_lamp(ConfigReader& reader, const Block& light, Lamp& lamp) {
  const YamlNode* node = light.find("lamp");
  if (node->is_scalar()) {
    const std::string word = reader.choice(light, "lamp", {"A", "D65", "E"}).value_or("E");
    if (word == "D65") lamp.table = std::make_shared<SpectralTable>(illuminant_d65());
    if (word == "A")  // what incandescent lamps are like, not what one of them is
      lamp.planck_k =
          reader.constant(light.path_of("lamp.planck_k"), described<Lamp>("planck_k"), illuminant_a().temperature_k);
    return;
  }
  const Block block = reader.block(light, "lamp", {"planck_k", "file"}, true);
  const YamlNode* file = block.find("file");
  lamp.planck_k = read_described<Lamp>(reader, block, "planck_k");
  if (file && lamp.planck_k)
    reader.problems.add(file->where, "file is given beside planck_k", "give one of the two");
  else if (file)
    lamp.table = read_table(reader, block, "the lamp");
  else if (block.node && !lamp.planck_k)
    reader.missing(block, "planck_k or file", "lamp: A for an incandescent lamp, D65 for daylight");
}

void read_filters(ConfigReader& reader, const Block& light, std::vector<LightFilter>& filters) {
  const YamlNode* list = light.find("filters");
  if (!list) return;
  const std::string path = light.path_of("filters");
  if (!list->is_sequence()) {
    reader.problems.add(list->where, path + " must be a list of filters, found " + list->describe(),
                        "write filters: [{centre_nm: 546, fwhm_nm: 10}]");
    return;
  }
  for (std::size_t i = 0; i < list->items.size(); ++i) {
    const Block block =
        reader.block_of(list->items[i], path + "[" + std::to_string(i + 1) + "]", {"centre_nm", "fwhm_nm", "file"});
    if (!block.node) continue;
    LightFilter filter;
    if (block.find("file")) {
      for (const char* other : {"centre_nm", "fwhm_nm"})
        if (const YamlNode* given = block.find(other))
          reader.problems.add(given->where, std::string(other) + " is given beside a filter's file",
                              "give one of the two");
      filter.table = read_table(reader, block, "filter " + std::to_string(i + 1));
      if (!filter.table) continue;
    } else {
      for (const char* key : {"centre_nm", "fwhm_nm"})
        if (!reader.given(block, key)) reader.missing(block, key);
      read_numbers(reader, block, filter);
      if (!filter.centre_nm || !filter.fwhm_nm) continue;
      const Parameter &centre = reader.table[filter.centre_nm], &width = reader.table[filter.fwhm_nm];
      if (width.value > centre.value)
        reader.problems.add(width.where,
                            width.name + " = " + show(width.value) + " is more than centre_nm = " + show(centre.value));
    }
    filters.push_back(std::move(filter));
  }
}

/// r, g or b, by its name or its number; else what is given.
std::string colour_of(const std::string& channel) {
  for (std::size_t c = 0; c < kColours.size(); ++c)
    if (channel == std::to_string(c)) return kColours[c];
  return channel;
}

CameraTables camera_by_name(const std::string& name) {
  CameraTables tables;
  for (std::size_t c = 0; c < kColours.size(); ++c) {
    if (name == "cie_1931") {
      tables[kColours[c]] = std::make_shared<SpectralTable>(colour_matching(static_cast<int>(c)));
      continue;
    }
    SpectralTable table;
    for (std::size_t i = 0; i < kNikonCount; ++i) {
      table.wavelength_um.push_back(kNikonFromUm + kNikonStepUm * static_cast<double>(i));
      table.value.push_back(kNikonD5100[i][c]);
    }
    tables[kColours[c]] = std::make_shared<SpectralTable>(std::move(table));
  }
  return tables;
}

/// The row of `camera.crosstalk` for this colour, if there is one; once, however many pictures are of it.
void read_crosstalk(ConfigReader& reader, const std::string& colour, Microscope& to) {
  to.crosstalk.clear();
  if (!reader.crosstalk.node || !reader.crosstalk.find(colour)) return;
  std::vector<std::string> others;
  for (const char* const other : kColours)
    if (other != colour) others.emplace_back(other);
  const Block row = reader.block(reader.crosstalk, colour, others, false);
  for (const std::string& other : others) {
    const YamlNode* const given = row.find(other);
    if (!given) continue;
    const auto sensitivity = reader.camera.find(other);
    if (sensitivity == reader.camera.end()) {
      reader.problems.add(given->where, "the camera has no channel " + other);
      continue;
    }
    ParameterRef share = reader.table.find(row.path + "." + other);
    if (!share) share = reader.number(row, other, described<Crosstalk>("share"));
    to.crosstalk.push_back({sensitivity->second, share});
  }
}

}  // namespace

void read_light(ConfigReader& reader, const Block& microscope, Microscope& to) {
  const Block light = reader.block(microscope, "light", {"wavelength_nm", "bandwidth_nm", "lamp", "filters"}, true);
  const auto of_light = [&](const char* key) { return described<Microscope>(std::string("light.") + key); };
  const YamlNode* lamp = light.find("lamp");
  if (!lamp) {
    if (const YamlNode* filters = light.find("filters"))
      reader.problems.add(filters->where, "filters are given without a lamp",
                          "add lamp: A (incandescent), D65, E (even), {planck_k: ..} or {file: ..}; of a single line "
                          "wavelength_nm and bandwidth_nm say it all");
    to.wavelength_nm = reader.number(light, "wavelength_nm", of_light("wavelength_nm"));
    if (light.find("bandwidth_nm")) to.bandwidth_nm = reader.number(light, "bandwidth_nm", of_light("bandwidth_nm"));
    return;
  }
  for (const char* key : {"wavelength_nm", "bandwidth_nm"})
    if (const YamlNode* node = light.find(key))
      reader.problems.add(node->where, std::string(key) + " is given beside a lamp, which has all wavelengths",
                          "a filter makes them fewer: filters: [{centre_nm: .., fwhm_nm: ..}]");
  ChannelLight& made = to.channel_light.emplace();
  read_lamp(reader, light, made.lamp);
  read_filters(reader, light, made.filters);
  const ParameterRef centre = made.filters.empty() ? ParameterRef{} : made.filters.front().centre_nm;
  to.wavelength_nm = reader.constant("microscope.light.wavelength_nm", of_light("wavelength_nm"),
                                     centre ? reader.table[centre].value : kMiddleNm);
  reader.table[to.wavelength_nm].known_to = {};
  reader.specs.erase("microscope.light.wavelength_nm");
}

CameraTables read_camera(ConfigReader& reader, const Block& microscope) {
  if (!microscope.find("camera")) return {};
  const Block block = reader.block(microscope, "camera", {"sensitivity", "crosstalk"}, true);
  if (block.node && !block.find("sensitivity"))
    reader.missing(block, "sensitivity", "cie_1931, nikon_d5100, or a table of wavelength_nm and r, g, b");
  if (block.find("crosstalk"))
    reader.crosstalk = reader.block(block, "crosstalk", {kColours.begin(), kColours.end()}, false);
  const std::optional<std::string> name = reader.text(block, "sensitivity");
  if (!name) return {};
  if (*name == "cie_1931" || *name == "nikon_d5100") return camera_by_name(*name);
  const Where where = block.find("sensitivity")->where;
  if (name->find_first_of("./") == std::string::npos) {
    reader.problems.add(where, *name + " is no camera that birefit knows",
                        "cie_1931, nikon_d5100, or the file of a table of wavelength_nm and r, g, b");
    return {};
  }
  const auto table = load_spectrum_file(reader, *name, where);
  if (!table) return {};
  const std::vector<std::string>& columns = table->table.columns;
  CameraTables tables;
  for (std::size_t c = 1; c < columns.size(); ++c) {
    const bool colour = std::find(kColours.begin(), kColours.end(), columns[c]) != kColours.end();
    if (!colour && columns.size() > 2) {
      reader.problems.add({reader.resolve(*name).string(), table->header_line},
                          "column " + columns[c] + " is none of r, g, b",
                          "a camera without colours has one column beside the wavelength");
      continue;
    }
    tables[colour ? columns[c] : ""] = column_of(reader, *table, *name, c, "channel " + columns[c]);
  }
  return tables;
}

void choose_channel(ConfigReader& reader, const std::string& channel, const Where& where, Scene& scene) {
  Microscope& microscope = scene.microscope;
  if (!microscope.channel_light || !reader.problems.empty()) return;
  if (!reader.camera.empty()) {
    const bool grey = reader.camera.contains("");
    const auto found = reader.camera.find(grey ? "" : colour_of(channel));
    if (found == reader.camera.end()) {
      reader.problems.add(where,
                          channel == "mean" ? "the mean of a camera's colours has no sensitivity of its own"
                                            : "it is not said which colour of microscope.camera the picture is",
                          "channel: rgb fits all of them, r, g or b one");
      return;
    }
    microscope.channel_light->sensitivity = found->second;
    if (!grey)
      read_crosstalk(reader, found->first, microscope);
    else if (reader.crosstalk.node)
      reader.problems.add(reader.crosstalk.where, "crosstalk is between colours, and this camera has none");
  }
  try {
    const Theta theta = reader.table.values();
    const double nm = mean_um(channel_of(microscope, theta, 20, where)) / kUmPerNm;
    microscope.wavelength_nm =
        reader.table.add_constant("microscope.light.wavelength_nm" + (channel.empty() ? "" : "." + channel), nm, "nm");
  } catch (const UserError& error) {
    reader.problems.add(error);
  }
}

void own_levels(ConfigReader& reader, const std::string& channel, Picture& picture) {
  std::vector<ParameterRef> levels{picture.gain, picture.offset};
  for (const UnevenLight& uneven : picture.uneven) levels.push_back(uneven.coefficient);
  for (const ParameterRef level : levels) {
    if (!level || !reader.table[level].free) continue;
    const std::string name = reader.table[level].name + "." + channel;
    ParameterRef own = reader.table.find(name);
    if (!own) {
      Parameter copy = reader.table[level];
      copy.name = name;
      own = reader.table.add(std::move(copy));
      reader.replaced.insert(level.index);
    }
    replace_ref(picture, level, own);
  }
}

}  // namespace birefit
