#include "io/config/scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "birefit/render.h"
#include "io/config/described.h"
#include "io/config/director.h"
#include "io/config/disc.h"
#include "io/config/material.h"
#include "io/config/microscope.h"
#include "io/config/rings.h"
#include "io/config/starts.h"
#include "io/config/volume.h"
#include "io/files/table.h"
#include "transport/method.h"

namespace birefit {
namespace {

const std::vector<std::string> kSampleKinds = {"droplet", "shell", "cell", "plate",
                                               "crystal", "slab",  "disc", "volume"};

/// The key of a map that names a kind: {radial: {..}}. A problem unless there is exactly one; of several the first is
/// returned, so that its mistakes are found too.
std::optional<std::string> one_kind(ConfigReader& reader, const Block& block, const std::vector<std::string>& known,
                                    const std::vector<std::string>& others = {}) {
  std::vector<std::string> found;
  for (const std::string& kind : known)
    if (block.find(kind)) found.push_back(kind);
  if (found.size() == 1) return found[0];
  if (found.size() > 1) {
    // The second one is the one too many.
    std::string first;
    for (const YamlEntry& entry : block.node->entries) {
      if (std::find(found.begin(), found.end(), entry.key) == found.end()) continue;
      if (!first.empty()) {
        reader.problems.add(entry.where, block.path + " has " + list_words(found) + ": exactly one of them is allowed");
        break;
      }
      first = entry.key;
    }
    return first;
  } else if (block.node) {
    // A misspelt kind was reported as an unknown key, with the right one suggested.
    const bool misspelt = std::any_of(
        block.node->entries.begin(), block.node->entries.end(),
        [&](const YamlEntry& entry) { return std::find(others.begin(), others.end(), entry.key) == others.end(); });
    if (!misspelt) reader.problems.add(block.where, block.path + " must name one of " + list_words(known));
  }
  return std::nullopt;
}

Droplet read_droplet(ConfigReader& reader, const Block& parent) {
  Droplet droplet;
  const Block block = reader.block(parent, "droplet", {"diameter_um", "director"}, true);
  droplet.diameter_um = read_described<Droplet>(reader, block, "diameter_um");
  const std::vector<std::string> kinds = KindsOf<decltype(Droplet::director)>::keys();
  const Block director = reader.block(block, "director", kinds, true);
  const auto kind = one_kind(reader, director, kinds);
  read_one_of(reader, director, kind, droplet.director);
  return droplet;
}

/// A droplet with a core: `sample.shell`.
Droplet read_shell(ConfigReader& reader, const Block& parent) {
  Droplet droplet;
  ShellDirector shell;
  const Block block =
      reader.block(parent, "shell", {"diameter_um", "wall_um", "core_offset_um", "director", "core"}, true);
  droplet.diameter_um = read_described<Droplet>(reader, block, "diameter_um");
  shell.wall_um = read_described<ShellDirector>(reader, block, "wall_um");
  const Block director = reader.block(block, "director", {"radial"}, false);
  if (director.node) one_kind(reader, director, {"radial"});
  const Block core = reader.block(block, "core", {"index"}, false);
  if (core.find("index")) shell.core_index = reader.number(core, "index", described<ShellDirector>("core.index"));
  double away = 0;
  if (const YamlNode* offset = block.find("core_offset_um")) {
    if (!offset->is_sequence() || offset->items.size() != 3) {
      reader.problems.add(offset->where, "core_offset_um must be three numbers [x, y, z], found " +
                                             (offset->is_sequence() ? std::to_string(offset->items.size()) + " items"
                                                                    : offset->describe()));
    } else {
      bool zero = true;
      for (std::size_t i = 0; i < 3; ++i) {
        const char* const letters[] = {"x", "y", "z"};
        shell.offset_um[i] = reader.number_at(offset->items[i], block.path_of("core_offset_um") + "." + letters[i],
                                              described<ShellDirector>("core_offset_um"));
        const Parameter& p = reader.table[shell.offset_um[i]];
        away += std::pow(p.value, 2);
        zero = zero && p.value == 0 && !reader.varies(shell.offset_um[i]);
      }
      if (zero) shell.offset_um = {};  // a core in the middle is a simpler scene
    }
  }
  if (reader.problems.empty() && std::isfinite(reader.table[droplet.diameter_um].value)) {
    const Parameter& wall = reader.table[shell.wall_um];
    const double radius = 0.5 * reader.table[droplet.diameter_um].value;
    if (wall.value >= radius)
      reader.problems.add(wall.where,
                          "wall_um = " + show(wall.value) + " leaves no core in a radius of " + show(radius) + " um",
                          "a droplet has no wall_um");
    else if (std::sqrt(away) >= wall.value)
      reader.problems.add(block.find("core_offset_um")->where, "core_offset_um is " + show(std::sqrt(away)) +
                                                                   " um long: the core would leave the wall of " +
                                                                   show(wall.value) + " um");
  }
  droplet.director = shell;
  return droplet;
}

Cell read_cell(ConfigReader& reader, const Block& parent) {
  Cell cell;
  const Block block = reader.block(parent, "cell", {"thickness_um", "director"}, true);
  cell.thickness_um = read_described<Cell>(reader, block, "thickness_um");
  const std::vector<std::string> kinds = KindsOf<decltype(Cell::director)>::keys();
  const Block director = reader.block(block, "director", kinds, true);
  const auto kind = one_kind(reader, director, kinds);
  read_one_of(reader, director, kind, cell.director);
  return cell;
}

/// `camera` of a view in a cone.
std::optional<SideCamera> read_side_camera(ConfigReader& reader, const Block& view) {
  if (!view.find("camera")) return std::nullopt;
  const Block block = reader.block(view, "camera", described_keys<SideCamera>(), true);
  SideCamera camera;
  read_numbers(reader, block, camera);
  const Parameter &x = reader.table[camera.tilt_x_deg], &y = reader.table[camera.tilt_y_deg],
                  &field = reader.table[camera.half_field_deg];
  const bool square = x.value == 0 && y.value == 0;
  // The foreshortening is even in the tilt, the perspective a product of tilt and field: nothing to go by from 0.
  if (square && (field.free || (field.value == 0 && (x.free || y.free))))
    reader.problems.add(block.where,
                        "camera starts at tilt 0, where the picture does not change with " +
                            std::string(field.free ? "half_field_deg" : "the tilt"),
                        "start on the side where the camera stood, e.g. tilt_x_deg: {value: 10, fit: [0, 60]}");
  return camera;
}

Plate read_plate(ConfigReader& reader, const Block& parent, View& shown) {
  Plate plate;
  const Block block = reader.block(parent, "plate", {"thickness_um", "director", "heat", "view"}, true);
  plate.thickness_um = read_described<Plate>(reader, block, "thickness_um");
  const Block director = reader.block(block, "director", {"uniform"}, true);
  if (one_kind(reader, director, {"uniform"})) plate.director = read_director<UniformDirector>(reader, director);
  if (block.find("heat")) {
    const Block heat = reader.block(block, "heat", described_keys<HeatStep>(), true);
    HeatStep step;
    const YamlNode* time = heat.find("time_s");
    if (time && heat.find("fourier_number"))
      reader.problems.add(time->where, "time_s is given beside fourier_number",
                          "give one of the two: fourier_number = diffusivity * time / thickness^2");
    const YamlNode* diffusivity = heat.find("diffusivity_mm2_s");
    if (time && !reader.given(heat, "diffusivity_mm2_s")) reader.missing(heat, "diffusivity_mm2_s");
    if (!time && heat.node && !reader.given(heat, "fourier_number")) reader.missing(heat, "fourier_number");
    if (!time && diffusivity)
      reader.problems.add(diffusivity->where, "diffusivity_mm2_s has no effect on a Fourier number",
                          "give time_s in place of fourier_number");
    read_numbers(reader, heat, step);
    plate.heat = step;
  }
  const Block view =
      reader.block(block, "view", {"half_angle_deg", "camera", "screen_distance_um", "ring_offset"}, true);
  if (!view.find("screen_distance_um")) {
    if (const YamlNode* node = view.find("ring_offset"))
      reader.problems.add(node->where, "ring_offset belongs to a table of rings",
                          "give screen_distance_um too, or leave it out");
    plate.half_angle_deg = reader.number(view, "half_angle_deg", described<Plate>("view.half_angle_deg"));
    shown.camera = read_side_camera(reader, view);
    return plate;
  }
  if (const YamlNode* node = view.find("half_angle_deg"))
    reader.problems.add(node->where,
                        "view has half_angle_deg (a picture) and screen_distance_um (a table of ring radii)",
                        "give one of the two");
  if (const YamlNode* node = view.find("camera"))
    reader.problems.add(node->where, "camera belongs to a picture, not to a table of ring radii", "leave it out");
  read_ring_view(reader, view, plate);
  const ParameterRef* axis = plate.director.axis.data();
  const auto upright = [&](ParameterRef ref, double value) {
    return !reader.varies(ref) && reader.table[ref].value == value;
  };
  if (axis[0] ? !(upright(axis[0], 0) && upright(axis[1], 0))
              : plate.director.tilt_deg && !upright(plate.director.tilt_deg, 90))
    reader.problems.add(director.where, "a table of ring radii needs a plate cut normal to its axis",
                        "uniform: {axis: [0, 0, 1]}");
  if (const YamlNode* node = block.find("heat"))
    reader.problems.add(node->where, "a table of ring radii does not go with heat", "leave it out");
  return plate;
}

Crystal read_crystal(ConfigReader& reader, const Block& parent) {
  Crystal crystal;
  const Block block = reader.block(parent, "crystal",
                                   {"half_wave_voltage_v", "bias_v", "built_in_bias_v", "field_along", "slow_axis_deg",
                                    "field_legendre", "electrodes_px"},
                                   true);
  for (const auto& [key, ref] :
       {std::pair("half_wave_voltage_v", &crystal.half_wave_voltage_v), std::pair("bias_v", &crystal.bias_v),
        std::pair("built_in_bias_v", &crystal.built_in_bias_v)})
    *ref = read_described<Crystal>(reader, block, key);
  if (!block.find("field_along"))
    reader.missing(block, "field_along", "x or y, the direction of the field in the image");
  crystal.field_along_y = reader.choice(block, "field_along", {"x", "y"}).value_or("y") == "y";
  crystal.slow_axis_deg =
      reader.number(block, "slow_axis_deg", described<Crystal>("slow_axis_deg"), crystal.field_along_y ? 135 : 45);
  if (const YamlNode* coefficients = block.find("field_legendre")) {
    if (!coefficients->is_sequence() || coefficients->items.size() > 20) {
      reader.problems.add(coefficients->where,
                          "field_legendre must be a list of at most 20 coefficients [c1, c2, ..], found " +
                              (coefficients->is_sequence() ? std::to_string(coefficients->items.size()) + " items"
                                                           : coefficients->describe()));
    } else {
      for (std::size_t i = 0; i < coefficients->items.size(); ++i)
        crystal.field_legendre.push_back(reader.number_at(
            coefficients->items[i], block.path_of("field_legendre") + "[" + std::to_string(i + 1) + "]",
            described<Crystal>("field_legendre")));
    }
  }
  if (const YamlNode* electrodes = block.find("electrodes_px")) {
    if (!electrodes->is_sequence() || electrodes->items.size() != 2) {
      reader.problems.add(electrodes->where,
                          "electrodes_px must be [low, high], found " +
                              (electrodes->is_sequence() ? std::to_string(electrodes->items.size()) + " items"
                                                         : electrodes->describe()));
    } else {
      const std::size_t problems_before = reader.problems.all().size();
      const NumberSpec pixel = electrode_spec();
      crystal.electrode_low_px = reader.number_at(electrodes->items[0], block.path_of("electrodes_px.low"), pixel);
      crystal.electrode_high_px = reader.number_at(electrodes->items[1], block.path_of("electrodes_px.high"), pixel);
      const bool readable = reader.problems.all().size() == problems_before;
      if (readable && reader.table[crystal.electrode_low_px].value >= reader.table[crystal.electrode_high_px].value)
        reader.problems.add(electrodes->where, "electrodes_px must grow: [low, high]");
    }
  }
  return crystal;
}

Slab read_slab(ConfigReader& reader, const Block& parent, View& shown) {
  Slab slab;
  const Block block = reader.block(parent, "slab", {"profile", "interpolation", "view"}, true);
  if (block.find("view")) {
    const Block view = reader.block(block, "view", {"half_angle_deg", "camera"}, true);
    slab.half_angle_deg = reader.number(view, "half_angle_deg", described<Slab>("view.half_angle_deg"));
    shown.camera = read_side_camera(reader, view);
  }
  const std::string interpolation =
      reader.choice(block, "interpolation", {"constant", "linear", "cubic"}).value_or("constant");
  using Interpolation = SlabProfile::Interpolation;
  slab.profile.interpolation = interpolation == "linear"  ? Interpolation::linear
                               : interpolation == "cubic" ? Interpolation::cubic
                                                          : Interpolation::constant;
  if (!block.find("profile")) reader.missing(block, "profile");
  const std::optional<std::string> name = reader.text(block, "profile");
  if (!name) return slab;
  PlacedTable table;
  try {
    table = load_placed_table(reader.resolve(*name), block.find("profile")->where);
  } catch (const UserError& error) {
    reader.problems.add(error);
    return slab;
  }

  const std::string file = reader.resolve(*name).string();
  reader.warnings.insert(reader.warnings.end(), table.notes.begin(), table.notes.end());
  const std::vector<std::string> required = {"depth_um", "ax", "ay", "az", "n_o", "n_e"};
  std::vector<std::string> known = required;
  known.insert(known.end(), {"k_o", "k_e"});
  std::array<int, 8> column;
  bool complete = true;
  for (std::size_t k = 0; k < known.size(); ++k) {
    const auto& columns = table.table.columns;
    const auto found = std::find(columns.begin(), columns.end(), known[k]);
    column[k] = found == columns.end() ? -1 : static_cast<int>(found - columns.begin());
    if (column[k] < 0 && k < required.size()) {
      reader.problems.add({file, table.header_line}, "has no column " + known[k], "columns: " + list_words(known));
      complete = false;
    }
  }
  for (std::size_t i = 0; i < table.table.columns.size(); ++i) {
    const std::string& header = table.table.columns[i];
    if (std::find(known.begin(), known.end(), header) != known.end()) continue;
    const std::string near = nearest_word(header, known);
    reader.problems.add({file, table.header_line, table.header_columns[i]}, "unknown column " + header,
                        near.empty() ? "columns: " + list_words(known) : "did you mean " + near + "?");
  }
  if (!complete) return slab;
  if (!table.units.empty() && contradicts_unit(table.units[static_cast<std::size_t>(column[0])], "um"))
    reader.problems.add({file, table.header_line + 1},
                        "depth_um is in " + table.units[static_cast<std::size_t>(column[0])] + " by its line of units",
                        "give the depths in um");

  double above_um = 0;
  for (std::size_t r = 0; r < table.table.rows.size(); ++r) {
    const std::vector<double>& row = table.table.rows[r];
    const auto value = [&](int k) { return column[k] < 0 ? 0.0 : row[column[k]]; };
    const auto place = [&](int k) { return Where{file, table.lines[r], table.cell_columns[r][column[k]]}; };
    SlabProfile::Row entry{value(0), value(1), value(2), value(3), value(4), value(5), value(6), value(7)};
    const bool layers = slab.profile.interpolation == Interpolation::constant;
    if (r == 0 && layers && !(entry.depth_um > 0))
      reader.problems.add(place(0), "depth_um = " + show(entry.depth_um) + " must be above 0",
                          "a row is a layer and gives the depth of its lower face; the first layer starts at 0");
    if (r == 0 && !layers && entry.depth_um != 0)
      reader.problems.add(place(0), "depth_um = " + show(entry.depth_um) + ": the first node must be at 0");
    if (r > 0 && !(entry.depth_um > above_um))
      reader.problems.add(
          place(0), "depth_um = " + show(entry.depth_um) + " does not grow (the row above has " + show(above_um) + ")");
    above_um = entry.depth_um;
    const double length = std::hypot(entry.ax, entry.ay, entry.az);
    if (!(length > 0)) {
      reader.problems.add(place(1), "the axis (ax, ay, az) = (0, 0, 0) has no direction");
    } else {
      entry.ax /= length;
      entry.ay /= length;
      entry.az /= length;
    }
    for (int k = 4; k <= 5; ++k)
      if (value(k) < 1 || value(k) > 4)
        reader.problems.add(place(k), known[k] + " = " + show(value(k)) + " is outside [1, 4]");
    for (int k = 6; k <= 7; ++k)
      if (column[k] >= 0 && (value(k) < 0 || value(k) > 10))
        reader.problems.add(place(k), known[k] + " = " + show(value(k)) + " is outside [0, 10]");
    slab.profile.rows.push_back(entry);
    if (reader.problems.all().size() > 100) break;  // a wrong column, said often enough
  }
  const std::size_t least = slab.profile.interpolation == Interpolation::cubic    ? 4
                            : slab.profile.interpolation == Interpolation::linear ? 2
                                                                                  : 1;
  if (table.table.rows.size() < least)
    reader.problems.add({file}, interpolation + " interpolation needs at least " + std::to_string(least) + " rows");
  return slab;
}

/// The parameter with its value, start and bounds within [lower, upper], else a problem. A NaN value (`fit: auto`)
/// passes.
void check_within(ConfigReader& reader, ParameterRef ref, double lower, double upper, const std::string& why) {
  const Parameter& parameter = reader.table[ref];
  const auto [low, high] = reader.span_of(ref);
  for (double value : {parameter.value, low, high}) {
    if (std::isfinite(value) && (value < lower || value > upper)) {
      reader.problems.add(parameter.where, parameter.name + ": " + show(value) + " is outside [" + show(lower) + ", " +
                                               show(upper) + "], " + why);
      return;
    }
  }
}

Material read_material(ConfigReader& reader, const Block& sample, const Sample& kind) {
  std::vector<std::string> keys = {"ordinary", "birefringence", "resonance_nm", "name", "temperature_k", "absorption"};
  keys.insert(keys.end(), law_material_keys().begin(), law_material_keys().end());
  keys.insert(keys.end(), form_material_keys().begin(), form_material_keys().end());
  const Block block = reader.block(sample, "material", keys, true);
  if (block.find("structure")) return read_form_material(reader, block);
  if (is_law_material(block)) return read_law_material(reader, block, kind);
  const Plate* plate = std::get_if<Plate>(&kind);
  const HeatStep* heat = plate ? std::get_if<HeatStep>(&plate->heat) : nullptr;
  if (block.find("name")) {
    for (const char* other : {"ordinary", "birefringence", "resonance_nm"})
      if (const YamlNode* node = block.find(other))
        reader.problems.add(node->where, std::string(other) + " is given beside a material's name",
                            "give one of the two");
    if (!reader.choice(block, "name", {"E44-steinberg2020"})) return ConstantIndices{};
    const std::string validity = "where E44-steinberg2020 holds";
    const NumberSpec temperature = described<E44Steinberg2020>("temperature_k");
    E44Steinberg2020 material;
    if (!heat) {
      material.temperature_k = reader.number(block, "temperature_k", temperature);
    } else {
      if (const YamlNode* node = block.find("temperature_k"))
        reader.problems.add(node->where, "temperature_k is given beside a temperature profile (sample.plate.heat)",
                            "leave it out");
      check_within(reader, heat->cold_k, 250, 373, validity);
      check_within(reader, heat->hot_k, 250, 373, validity);
      if (heat->initial_k) check_within(reader, heat->initial_k, 250, 373, validity);
      material.temperature_k = reader.constant("sample.material.temperature_k", temperature, 298.15);
      reader.specs.erase("sample.material.temperature_k");
    }
    return material;
  }
  if (const YamlNode* node = block.find("temperature_k"))
    reader.problems.add(node->where, "temperature_k has no effect on constant indices", "leave it out");
  if (heat && block.node)
    reader.problems.add(block.where, "sample.plate.heat has no effect on constant indices",
                        "use material: {name: E44-steinberg2020} or add haller, or leave heat out");
  ConstantIndices material;
  read_numbers(reader, block, material);
  const double extraordinary = reader.table[material.ordinary].value + reader.table[material.birefringence].value;
  if (extraordinary < 1 && reader.problems.empty())
    reader.problems.add(block.where, "ordinary + birefringence = " + show(extraordinary) + " is below 1");
  return material;
}

/// Of the samples whose transport knows it.
void read_absorption(ConfigReader& reader, const YamlNode* material, Scene& scene) {
  const YamlNode* absorption = material && material->is_map() ? material->find("absorption") : nullptr;
  if (!absorption) return;
  if (!std::holds_alternative<Cell>(scene.sample) && !std::holds_alternative<Plate>(scene.sample)) {
    reader.problems.add(absorption->where, "absorption is of cells and plates",
                        "a slab has it in its profile (k_o, k_e); droplets and sampled fields are transparent");
    return;
  }
  const std::string name = "sample.material.absorption";
  if (!absorption->is_sequence()) {
    const Block block = reader.block_of(*absorption, name, described_keys<Absorption>());
    if (block.node) read_numbers(reader, block, scene.absorption.emplace_back());
    return;
  }
  std::vector<std::string> keys = described_keys<Absorption>();
  keys.emplace_back("wavelength_nm");
  for (std::size_t i = 0; i < absorption->items.size(); ++i) {
    const YamlNode& item = absorption->items[i];
    const Block block = reader.block_of(item, name + "[" + std::to_string(i + 1) + "]", keys);
    if (!block.node) continue;
    Absorption& made = scene.absorption.emplace_back();
    read_numbers(reader, block, made);
    const auto nm = reader.plain(block, "wavelength_nm", numbers::within(100, 20000, "nm"));
    if (!nm) reader.missing(block, "wavelength_nm", "vacuum, where these hold");
    made.wavelength_nm = nm.value_or(0);
    if (i > 0 && nm && made.wavelength_nm <= scene.absorption[i - 1].wavelength_nm)
      reader.problems.add(item.where, "wavelengths of absorption do not grow", "list them from the shortest on");
  }
}

void read_sample(ConfigReader& reader, const Block& root, Scene& scene) {
  std::vector<std::string> keys = kSampleKinds;
  keys.insert(keys.end(), {"material", "surround"});
  const Block block = reader.block(root, "sample", keys, true);
  const auto kind = one_kind(reader, block, kSampleKinds, {"material", "surround"});
  if (!kind) return;
  if (*kind == "shell") scene.sample = read_shell(reader, block);
  if (*kind == "droplet") scene.sample = read_droplet(reader, block);
  if (*kind == "cell") scene.sample = read_cell(reader, block);
  if (*kind == "plate") scene.sample = read_plate(reader, block, scene.view);
  if (*kind == "crystal") scene.sample = read_crystal(reader, block);
  if (*kind == "slab") scene.sample = read_slab(reader, block, scene.view);
  if (*kind == "disc") scene.sample = read_stressed_disc(reader, block);
  if (*kind == "volume") scene.sample = read_sampled_volume(reader, block);

  const bool own_indices = *kind == "crystal" || *kind == "slab" || *kind == "disc";
  if (own_indices) {
    if (const YamlNode* node = block.find("material"))
      reader.problems.add(node->where, "unknown key material: a " + *kind + " needs none",
                          *kind == "slab"   ? "its indices are in the profile"
                          : *kind == "disc" ? "its stress-optic coefficient says it all"
                                            : "its half-wave voltage says it all");
  } else {
    scene.material = read_material(reader, block, scene.sample);
    read_absorption(reader, block.find("material"), scene);
  }
  if (*kind == "volume" && !block.find("surround")) return;  // rays have no use for it
  if (*kind == "crystal" || *kind == "disc") {
    if (const YamlNode* node = block.find("surround"))
      reader.problems.add(node->where, "unknown key surround: a " + *kind + " needs none");
    scene.surround_index = reader.constant("sample.surround.index", numbers::index(), 1.0);
    reader.specs.erase("sample.surround.index");
    return;
  }
  const Block surround = reader.block(block, "surround", {"index", "file"}, *kind == "droplet");
  if (surround.find("file")) {
    scene.surround_dispersion = read_surround_file(reader, surround);
  } else if (surround.node || *kind == "droplet") {
    scene.surround_index = reader.number(surround, "index", described<Scene>("sample.surround.index"));
    if (reader.table[scene.surround_index].value == 1) reader.table[scene.surround_index].known_to = {};  // air
  } else {
    scene.surround_index = reader.constant("sample.surround.index", numbers::index(), 1.0);
  }
}

void read_demand(ConfigReader& reader, const Block& root, const Scene& scene) {
  const Block accuracy = reader.block(root, "accuracy", {"intensity"}, false);
  reader.demand.intensity_accuracy = reader.plain(accuracy, "intensity", numbers::within(1e-12, 0.1)).value_or(1e-4);

  const Block physics = reader.block(root, "physics", {"ceiling", "rays", "max_seconds", "model_tolerance"}, false);
  if (const YamlNode* rays = physics.find("rays")) {
    const std::string which = reader.choice(physics, "rays", {"straight", "eikonal", "auto"}).value_or("straight");
    reader.demand.rays = which == "eikonal" ? Rays::eikonal : Rays::straight;
    reader.choose_rays = which == "auto";  // what a fit does without the key, too
    if (which == "eikonal" && !has_curved_rays(scene))
      reader.problems.add(rays->where,
                          "rays: eikonal is for radial droplets without twist, shells whose core is in the middle and "
                          "droplets in a field along the view",
                          "use straight or auto");
  }
  const YamlNode* ceiling = physics.find("ceiling");
  const Slab* slab = std::get_if<Slab>(&scene.sample);
  const bool layered = std::holds_alternative<Cell>(scene.sample) || (slab && !slab->half_angle_deg);
  const bool sphere = std::holds_alternative<Droplet>(scene.sample),
             sampled = std::holds_alternative<SampledVolume>(scene.sample);
  const std::string name =
      reader.choice(physics, "ceiling", {"one_way", "e_only", "reflections", "wave", "auto"}).value_or("auto");
  if (name == "reflections" && !layered)
    reader.problems.add(ceiling->where, "ceiling: reflections is for cells and slabs",
                        "use one_way: its model error says how large reflections are here");
  if (name == "wave" && !sphere && !sampled)
    reader.problems.add(ceiling->where, "ceiling: wave is for droplets, shells and sampled fields",
                        "use one_way or, for cells and slabs, reflections");
  if (name == "wave" && sampled && !scene.surround_index && !scene.surround_dispersion)
    reader.problems.add(ceiling->where, "ceiling: wave needs sample.surround",
                        "the index of what is around the box, and in it where the file has no liquid crystal");
  if (name == "wave" && (sphere || sampled) && !scene.microscope.objective_na)
    reader.problems.add(ceiling->where, "ceiling: wave needs microscope.objective_na",
                        "the number engraved on the objective; without it use one_way");
  if (name == "wave" && physics.find("rays"))
    reader.problems.add(physics.find("rays")->where, "rays has no meaning under ceiling: wave", "give one of the two");
  reader.demand.ceiling = name == "e_only"        ? Ceiling::e_only
                          : name == "reflections" ? Ceiling::reflections
                          : name == "wave"        ? Ceiling::wave
                                                  : Ceiling::one_way;
  if (physics.find("max_seconds")) {
    NumberSpec seconds = numbers::within(0, 1e7);
    seconds.unit = "s";
    reader.max_seconds = reader.plain(physics, "max_seconds", seconds).value_or(60);
  }

  reader.model_tolerance = reader.plain(physics, "model_tolerance", numbers::within(0, 0.5)).value_or(0.01);

  const Block transport = reader.block(root, "transport", {"method"}, false);
  std::vector<std::string> methods = {"auto"};
  methods.insert(methods.end(), transport_method_names().begin(), transport_method_names().end());
  methods.insert(methods.end(), {"series", "split_step"});
  reader.demand.method = reader.choice(transport, "method", methods).value_or("auto");
  const bool wave_method = reader.demand.method == "series" || reader.demand.method == "split_step";
  const bool defocused = is_defocused(reader, scene);
  // Left to itself: waves for spheres, where the objective's aperture is known and nobody asked for rays. Only waves
  // know defocus.
  if (name == "auto" && sphere && scene.microscope.objective_na && !physics.find("rays") &&
      (reader.demand.method == "auto" || wave_method)) {
    if (defocused || wave_method)
      reader.demand.ceiling = Ceiling::wave;
    else
      reader.choose_waves = true;
  }
  if (defocused && reader.demand.ceiling != Ceiling::wave) add_defocus_problem(reader, scene);
}

}  // namespace

bool is_defocused(const ConfigReader& reader, const Scene& scene) {
  const ParameterRef focus = scene.microscope.focus_um;
  return focus && (reader.varies(focus) || reader.table[focus].value != 0);
}

void add_defocus_problem(ConfigReader& reader, const Scene& scene) {
  reader.problems.add(reader.table[scene.microscope.focus_um].where,
                      "focus_um: rays are seen in the mid plane only; defocus needs wave optics",
                      "ceiling: wave, with objective_na, for droplets, shells and sampled fields");
}

namespace {

/// A picture in a cone ends where the objective's aperture does.
void check_cone(ConfigReader& reader, const Scene& scene) {
  ParameterRef half_angle, na = scene.microscope.objective_na;
  if (const auto* plate = std::get_if<Plate>(&scene.sample)) half_angle = plate->half_angle_deg;
  if (const auto* slab = std::get_if<Slab>(&scene.sample); slab && slab->half_angle_deg)
    half_angle = slab->half_angle_deg;
  if (!half_angle || !na || reader.varies(half_angle) || reader.varies(na) || scene.surround_dispersion) return;
  constexpr double kEngraved = 0.03;  // what such numbers are known to
  const double outside = scene.surround_index ? reader.table[scene.surround_index].value : 1,
               seen = outside * std::sin(reader.table[half_angle].value * std::numbers::pi / 180),
               taken = reader.table[na].value;
  if (seen > (1 + kEngraved) * taken)
    reader.problems.add(reader.table[half_angle].where,
                        fmt::format("half_angle_deg = {:g} needs a numerical aperture of {:.2f}, objective_na is {:g}",
                                    reader.table[half_angle].value, seen, taken),
                        "the picture ends where the objective does: state the angle at its edge, or leave "
                        "objective_na out");
}

}  // namespace

Scene read_scene(ConfigReader& reader, const Block& root) {
  Scene scene;
  // Which kind it is steers what the microscope needs, so the sample comes first.
  read_sample(reader, root, scene);
  read_microscope(reader, root, scene);
  check_material_ranges(reader, root, scene);
  check_cone(reader, scene);
  read_demand(reader, root, scene);
  return scene;
}

}  // namespace birefit
