#include "io/config_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "birefit/render.h"
#include "io/config_director.h"
#include "io/config_disc.h"
#include "io/config_material.h"
#include "io/config_microscope.h"
#include "io/config_rings.h"
#include "io/config_volume.h"
#include "io/number_specs.h"
#include "io/table.h"
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

UniformDirector read_uniform(ConfigReader& reader, const Block& parent) {
  UniformDirector director;
  const Block block = reader.block(parent, "uniform", {"axis", "azimuth_deg", "tilt_deg"}, true);
  const YamlNode* axis = block.find("axis");
  if (axis) {
    if (block.find("azimuth_deg") || block.find("tilt_deg"))
      reader.problems.add(axis->where, block.path + " has an axis and angles", "give one of the two");
    if (!axis->is_sequence() || axis->items.size() != 3) {
      reader.problems.add(axis->where,
                          "axis must be three components [x, y, z], found " +
                              (axis->is_sequence() ? std::to_string(axis->items.size()) + " items" : axis->describe()));
      return director;
    }
    double square = 0;
    for (int i = 0; i < 3; ++i) {
      const char* const letters[] = {"x", "y", "z"};
      director.axis[i] =
          reader.number_at(axis->items[i], block.path_of("axis") + "." + letters[i], number_within(-1e6, 1e6));
      square += std::pow(reader.table[director.axis[i]].value, 2);
    }
    if (square == 0) reader.problems.add(axis->where, "axis = [0, 0, 0] has no direction");
    return director;
  }
  if (block.node && !block.find("azimuth_deg") && !block.find("tilt_deg")) {
    reader.problems.add(block.where, block.path + " needs an axis: [x, y, z] or azimuth_deg and tilt_deg");
    return director;
  }
  director.azimuth_deg = reader.number(block, "azimuth_deg", angle(), 0);
  director.tilt_deg = reader.number(block, "tilt_deg", angle(), 0);
  return director;
}

/// The reduced field, or the applied one with the two numbers that reduce it.
AxialDirector read_axial(ConfigReader& reader, const Block& parent) {
  AxialDirector axial;
  const Block block = reader.block(parent, "axial",
                                   {"reduced_field", "field_v_per_um", "coherence_voltage_v", "local_field_factor",
                                    "ring_radius", "branch", "field_azimuth_deg"},
                                   true);
  const YamlNode *reduced = block.find("reduced_field"), *applied = block.find("field_v_per_um");
  if (reduced && applied)
    reader.problems.add(applied->where, block.path + " has a reduced field and an applied one", "give one of the two");
  if (!reduced && !applied)
    reader.missing(block, "reduced_field",
                   "radius over coherence length, 0 without a field; or field_v_per_um with coherence_voltage_v and "
                   "local_field_factor");
  if (reduced) {
    NumberSpec e = number_within(0, 60);
    e.physical_lower = 0;
    axial.reduced_field = reader.number(block, "reduced_field", e);
    for (const char* other : {"coherence_voltage_v", "local_field_factor"})
      if (const YamlNode* node = block.find(other))
        reader.problems.add(node->where, std::string(other) + " has no effect on a reduced field",
                            "leave it out, or give field_v_per_um");
  } else if (applied) {
    NumberSpec field = number_within(0, 100);
    field.unit = "V/um";
    field.physical_lower = 0;
    axial.field_v_per_um = reader.number(block, "field_v_per_um", field);
    NumberSpec voltage = number_within(0, 10);
    voltage.unit = "V";
    voltage.lower_open = true;
    axial.coherence_voltage_v = reader.number(block, "coherence_voltage_v", voltage);
    axial.local_field_factor = reader.number(block, "local_field_factor", number_within(0.01, 3));
  }
  if (block.find("field_azimuth_deg")) axial.field_azimuth_deg = reader.number(block, "field_azimuth_deg", angle());
  if (block.find("ring_radius")) axial.ring_radius = reader.number(block, "ring_radius", number_within(0.2, 0.995));
  const std::string branch =
      reader.choice(block, "branch", {"hedgehog", "ring", "compare"}).value_or(axial.ring_radius ? "ring" : "hedgehog");
  axial.compare = branch == "compare";
  if (branch == "hedgehog" && axial.ring_radius)
    reader.problems.add(block.find("ring_radius")->where, "a hedgehog has no ring_radius",
                        "leave it out, or write branch: compare");
  if (branch != "hedgehog" && !axial.ring_radius)
    reader.missing(block, "ring_radius",
                   "the ring's radius over the droplet's, for example {value: 0.9, fit: [0.6, 0.99]}");
  return axial;
}

Droplet read_droplet(ConfigReader& reader, const Block& parent) {
  Droplet droplet;
  const Block block = reader.block(parent, "droplet", {"diameter_um", "director"}, true);
  NumberSpec diameter = open_length(10000);
  diameter.automatic = true;
  droplet.diameter_um = reader.number(block, "diameter_um", diameter);
  const Block director = reader.block(block, "director", {"radial", "bipolar", "axial"}, true);
  const auto kind = one_kind(reader, director, {"radial", "axial", "bipolar"});
  if (kind == "axial") {
    droplet.director = read_axial(reader, director);
    return droplet;
  }
  if (kind == "bipolar") {
    BipolarDirector bipolar;
    if (director.find("bipolar")->kind != YamlNode::Kind::null) {
      const Block poles = reader.block(director, "bipolar", {"azimuth_deg", "tilt_deg", "pole_distance"}, true);
      bipolar.azimuth_deg = reader.number(poles, "azimuth_deg", angle(), 0);
      bipolar.tilt_deg = reader.number(poles, "tilt_deg", angle_within(-90, 90), 0);
      bipolar.pole_distance = reader.number(poles, "pole_distance", number_within(1, 1000), 1);
    }
    droplet.director = bipolar;
    return droplet;
  }
  if (kind == "radial") {
    // `radial:` with nothing behind it is as clear as `radial: {}`.
    const YamlNode* node = director.find("radial");
    if (node->kind == YamlNode::Kind::null) return droplet;
  }
  const Block radial = reader.block(director, "radial", {"twist_deg"}, false);
  // No twist is a simpler scene, not a twist of zero: its transport is diagonal.
  if (radial.find("twist_deg")) droplet.director = RadialDirector{reader.number(radial, "twist_deg", angle(), 0)};
  return droplet;
}

/// A droplet with a core: `sample.shell`.
Droplet read_shell(ConfigReader& reader, const Block& parent) {
  Droplet droplet;
  ShellDirector shell;
  const Block block =
      reader.block(parent, "shell", {"diameter_um", "wall_um", "core_offset_um", "director", "core"}, true);
  NumberSpec diameter = open_length(10000);
  diameter.automatic = true;
  droplet.diameter_um = reader.number(block, "diameter_um", diameter);
  shell.wall_um = reader.number(block, "wall_um", open_length(5000));
  const Block director = reader.block(block, "director", {"radial"}, false);
  if (director.node) one_kind(reader, director, {"radial"});
  const Block core = reader.block(block, "core", {"index"}, false);
  if (core.find("index")) shell.core_index = reader.number(core, "index", index_spec());
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
        NumberSpec spec = number_within(-5000, 5000);
        spec.unit = "um";
        shell.offset_um[i] =
            reader.number_at(offset->items[i], block.path_of("core_offset_um") + "." + letters[i], spec);
        const Parameter& p = reader.table[shell.offset_um[i]];
        away += std::pow(p.value, 2);
        zero = zero && p.value == 0 && !p.free;
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
  cell.thickness_um = reader.number(block, "thickness_um", open_length(10000));
  const Block director = reader.block(block, "director", {"uniform", "twisted", "freedericksz", "helix"}, true);
  const auto kind = one_kind(reader, director, {"uniform", "twisted", "freedericksz", "helix"});
  if (kind == "uniform") {
    cell.director = read_uniform(reader, director);
  } else if (kind == "twisted") {
    const Block twisted = reader.block(director, "twisted", {"twist_deg", "azimuth_deg", "pretilt_deg"}, true);
    TwistedDirector field;
    field.twist_deg = reader.number(twisted, "twist_deg", angle());
    field.azimuth_deg = reader.number(twisted, "azimuth_deg", angle(), 0);
    field.pretilt_deg = reader.number(twisted, "pretilt_deg", angle_within(-90, 90), 0);
    cell.director = field;
  } else if (kind == "freedericksz") {
    cell.director = read_freedericksz(reader, director);
  } else if (kind == "helix") {
    cell.director = read_helix(reader, director);
  }
  return cell;
}

ParameterRef read_half_angle(ConfigReader& reader, const Block& view) {
  NumberSpec half_angle = angle_within(0, 80);
  half_angle.lower_open = true;
  return reader.number(view, "half_angle_deg", half_angle);
}

/// `camera` of a view in a cone.
std::optional<SideCamera> read_side_camera(ConfigReader& reader, const Block& view) {
  if (!view.find("camera")) return std::nullopt;
  const Block block = reader.block(view, "camera", {"tilt_x_deg", "tilt_y_deg", "half_field_deg"}, true);
  NumberSpec half_field = angle_within(0, 60);
  half_field.physical_lower = 0;
  SideCamera camera;
  camera.tilt_x_deg = reader.number(block, "tilt_x_deg", angle_within(-80, 80), 0);
  camera.tilt_y_deg = reader.number(block, "tilt_y_deg", angle_within(-80, 80), 0);
  camera.half_field_deg = reader.number(block, "half_field_deg", half_field, 0);
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
  plate.thickness_um = reader.number(block, "thickness_um", open_length(100000));
  const Block director = reader.block(block, "director", {"uniform"}, true);
  if (one_kind(reader, director, {"uniform"})) plate.director = read_uniform(reader, director);
  if (block.find("heat")) {
    const Block heat = reader.block(
        block, "heat", {"fourier_number", "time_s", "diffusivity_mm2_s", "cold_k", "hot_k", "initial_k"}, true);
    NumberSpec fourier = number_within(0, 1e4);
    fourier.lower_open = true;
    fourier.physical_lower = 0;
    HeatStep step;
    const YamlNode* time = heat.find("time_s");
    if (time && heat.find("fourier_number"))
      reader.problems.add(time->where, "time_s is given beside fourier_number",
                          "give one of the two: fourier_number = diffusivity * time / thickness^2");
    if (time) {
      NumberSpec seconds = number_within(0, 1e9), diffusivity = number_within(0, 1e4);
      seconds.lower_open = diffusivity.lower_open = true;
      seconds.unit = "s";
      diffusivity.unit = "mm2/s";
      step.time_s = reader.number(heat, "time_s", seconds);
      step.diffusivity_mm2_s = reader.number(heat, "diffusivity_mm2_s", diffusivity);
    } else {
      step.fourier_number = reader.number(heat, "fourier_number", fourier);
      if (const YamlNode* node = heat.find("diffusivity_mm2_s"))
        reader.problems.add(node->where, "diffusivity_mm2_s has no effect on a Fourier number",
                            "give time_s in place of fourier_number");
    }
    if (heat.find("initial_k")) step.initial_k = reader.number(heat, "initial_k", kelvin());
    step.cold_k = reader.number(heat, "cold_k", kelvin());
    step.hot_k = reader.number(heat, "hot_k", kelvin());
    plate.heat = step;
  }
  const Block view =
      reader.block(block, "view", {"half_angle_deg", "camera", "screen_distance_um", "ring_offset"}, true);
  if (!view.find("screen_distance_um")) {
    if (const YamlNode* node = view.find("ring_offset"))
      reader.problems.add(node->where, "ring_offset belongs to a table of rings",
                          "give screen_distance_um too, or leave it out");
    plate.half_angle_deg = read_half_angle(reader, view);
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
    return !reader.table[ref].free && reader.table[ref].value == value;
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
  NumberSpec half_wave;
  half_wave.unit = "V";
  half_wave.lower = 0;
  half_wave.lower_open = true;
  half_wave.upper = 1e7;
  half_wave.physical_lower = 0;
  crystal.half_wave_voltage_v = reader.number(block, "half_wave_voltage_v", half_wave);
  NumberSpec bias;  // the sign is not observable: the magnitude is asked for
  bias.unit = "V";
  bias.lower = 0;
  bias.upper = 1e7;
  bias.physical_lower = 0;
  crystal.bias_v = reader.number(block, "bias_v", bias);
  NumberSpec built_in;  // against the bias as well
  built_in.unit = "V";
  built_in.lower = -1e7;
  built_in.upper = 1e7;
  if (block.find("built_in_bias_v")) crystal.built_in_bias_v = reader.number(block, "built_in_bias_v", built_in);
  if (!block.find("field_along"))
    reader.missing(block, "field_along", "x or y, the direction of the field in the image");
  crystal.field_along_y = reader.choice(block, "field_along", {"x", "y"}).value_or("y") == "y";
  crystal.slow_axis_deg = reader.number(block, "slow_axis_deg", angle(), crystal.field_along_y ? 135 : 45);
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
            number_within(-100, 100)));
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
      NumberSpec pixel = number_within(-1e6, 1e6);
      pixel.unit = "px";
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
    slab.half_angle_deg = read_half_angle(reader, view);
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
  for (double value : {parameter.value, parameter.free ? parameter.lower : parameter.value,
                       parameter.free ? parameter.upper : parameter.value}) {
    if (std::isfinite(value) && (value < lower || value > upper)) {
      reader.problems.add(parameter.where, parameter.name + ": " + show(value) + " is outside [" + show(lower) + ", " +
                                               show(upper) + "], " + why);
      return;
    }
  }
}

Material read_material(ConfigReader& reader, const Block& sample, const Sample& kind) {
  std::vector<std::string> keys = {"ordinary", "birefringence", "resonance_nm", "name", "temperature_k"};
  keys.insert(keys.end(), law_material_keys().begin(), law_material_keys().end());
  const Block block = reader.block(sample, "material", keys, true);
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
    NumberSpec temperature = kelvin();
    temperature.lower = 250;
    temperature.upper = 373;
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
  material.ordinary = reader.number(block, "ordinary", index_spec());
  material.birefringence = reader.number(block, "birefringence", number_within(-1, 1));
  if (block.find("resonance_nm")) {
    NumberSpec resonance = number_within(50, 20000);
    resonance.unit = "nm";
    material.resonance_nm = reader.number(block, "resonance_nm", resonance);
  }
  const double extraordinary = reader.table[material.ordinary].value + reader.table[material.birefringence].value;
  if (extraordinary < 1 && reader.problems.empty())
    reader.problems.add(block.where, "ordinary + birefringence = " + show(extraordinary) + " is below 1");
  return material;
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
  }
  if (*kind == "volume" && !block.find("surround")) return;  // rays have no use for it
  if (*kind == "crystal" || *kind == "disc") {
    if (const YamlNode* node = block.find("surround"))
      reader.problems.add(node->where, "unknown key surround: a " + *kind + " needs none");
    scene.surround_index = reader.constant("sample.surround.index", index_spec(), 1.0);
    reader.specs.erase("sample.surround.index");
    return;
  }
  const Block surround = reader.block(block, "surround", {"index", "file"}, *kind == "droplet");
  if (surround.find("file")) {
    scene.surround_dispersion = read_surround_file(reader, surround);
  } else if (surround.node || *kind == "droplet") {
    scene.surround_index = reader.number(surround, "index", index_spec());
  } else {
    scene.surround_index = reader.constant("sample.surround.index", index_spec(), 1.0);
  }
}

void read_numerics(ConfigReader& reader, const Block& root, Scene& scene) {
  const Block accuracy = reader.block(root, "accuracy", {"intensity"}, false);
  scene.intensity_accuracy = reader.plain(accuracy, "intensity", number_within(1e-12, 0.1)).value_or(1e-4);

  const Block physics = reader.block(root, "physics", {"ceiling", "rays", "max_seconds"}, false);
  if (const YamlNode* rays = physics.find("rays")) {
    const std::string which = reader.choice(physics, "rays", {"straight", "eikonal", "auto"}).value_or("straight");
    scene.rays = which == "eikonal" ? Rays::eikonal : Rays::straight;
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
  if (name == "wave" && (sphere || sampled) && scene.microscope.objective_na == 0)
    reader.problems.add(ceiling->where, "ceiling: wave needs microscope.objective_na",
                        "the number engraved on the objective; without it use one_way");
  if (name == "wave" && physics.find("rays"))
    reader.problems.add(physics.find("rays")->where, "rays has no meaning under ceiling: wave", "give one of the two");
  scene.ceiling = name == "e_only"        ? Ceiling::e_only
                  : name == "reflections" ? Ceiling::reflections
                  : name == "wave"        ? Ceiling::wave
                                          : Ceiling::one_way;
  if (physics.find("max_seconds")) {
    NumberSpec seconds = number_within(0, 1e7);
    seconds.unit = "s";
    reader.max_seconds = reader.plain(physics, "max_seconds", seconds).value_or(60);
  }

  const Block transport = reader.block(root, "transport", {"method"}, false);
  std::vector<std::string> methods = {"auto"};
  methods.insert(methods.end(), transport_method_names().begin(), transport_method_names().end());
  methods.insert(methods.end(), {"series", "split_step"});
  scene.method = reader.choice(transport, "method", methods).value_or("auto");
  const bool wave_method = scene.method == "series" || scene.method == "split_step";
  const bool defocused = is_defocused(reader, scene);
  // Left to itself: waves for spheres, where the objective's aperture is known and nobody asked for rays. Only waves
  // know defocus.
  if (name == "auto" && sphere && scene.microscope.objective_na > 0 && !physics.find("rays") &&
      (scene.method == "auto" || wave_method)) {
    if (defocused || wave_method)
      scene.ceiling = Ceiling::wave;
    else
      reader.choose_waves = true;
  }
  if (defocused && scene.ceiling != Ceiling::wave) add_defocus_problem(reader, scene);
}

}  // namespace

bool is_defocused(const ConfigReader& reader, const Scene& scene) {
  const ParameterRef focus = scene.microscope.focus_um;
  return focus && (reader.table[focus].free || reader.table[focus].value != 0);
}

void add_defocus_problem(ConfigReader& reader, const Scene& scene) {
  reader.problems.add(reader.table[scene.microscope.focus_um].where,
                      "focus_um: rays are seen in the mid plane only; defocus needs wave optics",
                      "ceiling: wave, with objective_na, for droplets, shells and sampled fields");
}

Scene read_scene(ConfigReader& reader, const Block& root) {
  Scene scene;
  // Which kind it is steers what the microscope needs, so the sample comes first.
  read_sample(reader, root, scene);
  read_microscope(reader, root, scene);
  check_material_ranges(reader, root, scene);
  read_numerics(reader, root, scene);
  return scene;
}

}  // namespace birefit
