#include "io/config/micrograph.h"

#include <cmath>

#include <fmt/format.h>

#include "io/config/described.h"
#include "io/config/rings.h"
#include "io/files/table.h"

namespace birefit {
namespace {

/// Of a lamp's light from the first picture of several to the last.
constexpr double kLampDrift = 0.005;

NumberSpec linear_spec() {
  NumberSpec spec;
  spec.lower = -1e12;
  spec.upper = 1e12;
  spec.linear = true;
  spec.automatic = true;
  return spec;
}

NumberSpec pixel_spec() {
  NumberSpec spec;
  spec.unit = "px";
  spec.lower = -1e5;
  spec.upper = 1e5;
  spec.automatic = true;
  return spec;
}

Parameter& make_automatic(ConfigReader& reader, ParameterRef ref) {
  Parameter& parameter = reader.table[ref];
  parameter.free = true;
  parameter.automatic = true;
  parameter.value = std::numeric_limits<double>::quiet_NaN();
  return parameter;
}

/// `gain` or `offset`: absent means `fit: auto`, a nuisance every real image has.
ParameterRef read_linear(ConfigReader& reader, const Block& block, const std::string& key, double start,
                         bool automatic) {
  const bool given = block.find(key) != nullptr;
  const NumberSpec spec = key == "gain" ? linear_spec().known_within_share(kLampDrift) : linear_spec();
  const ParameterRef ref = reader.number(block, key, spec, start);
  if (!given && automatic) make_automatic(reader, ref);
  Parameter& parameter = reader.table[ref];
  if (!std::isfinite(parameter.value)) parameter.value = start;
  if (key == "gain") {
    keep_positive(parameter);
    if (!given) parameter.known_to.share = kLampDrift;
  }
  return ref;
}

void read_center(ConfigReader& reader, const Block& block, const Scene& scene, MicrographSettings& settings) {
  const bool droplet = std::holds_alternative<Droplet>(scene.sample);
  const Slab* slab = std::get_if<Slab>(&scene.sample);
  const bool disc = std::holds_alternative<StressedDisc>(scene.sample);
  const bool cone = disc || std::holds_alternative<SampledVolume>(scene.sample) ||
                    std::holds_alternative<Plate>(scene.sample) || (slab && slab->half_angle_deg);
  const YamlNode* node = block.find("center_px");
  const std::string path = "micrograph.center_px";
  if (node && node->is_sequence() && node->items.size() == 2) {
    settings.center_x = reader.number_at(node->items[0], path + ".x", pixel_spec());
    settings.center_y = reader.number_at(node->items[1], path + ".y", pixel_spec());
  } else {
    // `--set micrograph.center_px.x=26` beside {fit: auto}, or beside nothing.
    const YamlNode *x = node && node->is_map() ? node->find("x") : nullptr,
                   *y = node && node->is_map() ? node->find("y") : nullptr;
    const auto number = [&](const YamlNode* given, const std::string& name) {
      return given ? reader.number_at(*given, name, pixel_spec())
                   : reader.constant(name, pixel_spec(), std::numeric_limits<double>::quiet_NaN());
    };
    settings.center_x = number(x, path + ".x");
    settings.center_y = number(y, path + ".y");
    const YamlNode* fit = node && node->is_map() ? node->find("fit") : nullptr;
    const std::size_t known = (fit ? 1 : 0) + (x ? 1 : 0) + (y ? 1 : 0);
    const bool automatic = node && node->is_map() && known > 0 && node->entries.size() == known &&
                           (!fit || (fit->is_scalar() && fit->text == "auto"));
    if (node && !automatic)
      reader.problems.add(node->where,
                          "center_px must be [x, y] (each a number or {value, fit}) or {fit: auto}, found " +
                              (node->is_sequence() ? std::to_string(node->items.size()) + " items" : node->describe()));
    // Where a droplet lies is hardly ever known, and its image shows it.
    if (automatic || (!node && droplet && reader.use != ConfigUse::render)) {
      if (!x) make_automatic(reader, settings.center_x);
      if (!y) make_automatic(reader, settings.center_y);
    }
  }
  // The figure of a cone of light is put in the middle of the camera by eye.
  constexpr double kByEye = 2;
  const bool figure = std::holds_alternative<Plate>(scene.sample) || (slab && slab->half_angle_deg);
  if (figure && !node && reader.use != ConfigUse::render)
    for (const ParameterRef at : {settings.center_x, settings.center_y}) reader.table[at].known_to.sd = kByEye;
  const bool fitted = reader.table[settings.center_x].free || reader.table[settings.center_y].free;
  if (node && fitted && !droplet && !cone)
    reader.problems.add(node->where, "center_px has no effect on this sample and cannot be fitted", "leave it out");
}

void read_calibration(ConfigReader& reader, const Block& root, const Block& micrograph, MicrographSettings& settings) {
  const bool top = root.find("calibration"), inner = micrograph.find("calibration");
  if (top && inner)
    reader.problems.add(micrograph.find("calibration")->where, "calibration is also given at top level",
                        "give one of the two");
  if (!top && !inner) return;
  const Block block =
      reader.block(top ? root : micrograph, "calibration", {"dark", "parallel", "flat", "crossed"}, true);
  const auto read = [&](const char* key, std::optional<std::string>& name, Where& where) {
    if (!block.find(key)) return;
    name = reader.text(block, key);
    where = block.find(key)->where;
  };
  read("dark", settings.dark, settings.dark_where);
  read("flat", settings.light, settings.light_where);
  read("parallel", settings.light, settings.light_where);
  read("crossed", settings.crossed, settings.crossed_where);
  const bool parallel = block.find("parallel"), flat = block.find("flat"), dark = block.find("dark");
  if (block.node && block.node->entries.empty())
    reader.missing(block, "dark, parallel or flat", "dark alone is subtracted, flat alone divides");
  if (parallel && flat)
    reader.problems.add(
        block.find("flat")->where, "flat is given beside parallel",
        "give one of the two: both divide, a parallel frame with the sample's polarizers and a dark one");
  if ((parallel || block.find("crossed")) && !dark)
    reader.missing(block, "dark", "transmission = (image - dark) / (parallel - dark); flat alone divides");
  if (block.find("crossed") && !parallel)
    reader.missing(block, "parallel", "transmission = (image - dark) / (parallel - dark)");
  if (flat && !dark)
    reader.warnings.push_back("calibration has a flat and no dark: what the camera shows without light is taken as 0.");
}

/// r, g, b, all three, mean or a number.
std::string read_channel(ConfigReader& reader, const Block& block) {
  const YamlNode* node = block.find("channel");
  if (node && node->is_scalar() && !node->text.empty() &&
      node->text.find_first_not_of("0123456789") == std::string::npos)
    return node->text;
  return reader.choice(block, "channel", {"r", "g", "b", "rgb", "mean"}).value_or("");
}

/// A number, or [x, y] of pixels that are square after all.
ParameterRef read_pixel_size(ConfigReader& reader, const Block& block, const Scene& scene) {
  const std::string key = "pixel_size_um";
  NumberSpec spec = described<View>(key);
  if (!std::holds_alternative<StressedDisc>(scene.sample)) spec.upper = 20;  // what a microscope has
  if (!reader.given(block, key)) return {};
  const YamlNode* node = block.find(key);
  if (!node || !node->is_sequence()) return reader.number(block, key, spec);
  if (node->items.size() != 2) {
    reader.problems.add(node->where, "pixel_size_um must be a number or [x, y], found " +
                                         std::to_string(node->items.size()) + " items");
    return {};
  }
  const auto x = reader.value_of(node->items[0], key, spec);
  const auto y = reader.value_of(node->items[1], key, spec);
  if (!x || !y) return {};
  // As close as sizes are known from a stage micrometer.
  constexpr double kSquare = 1e-3;
  if (std::abs(*x / *y - 1) > kSquare)
    reader.problems.add(node->where,
                        "pixel_size_um = [" + show(*x) + ", " + show(*y) + "]: pixels of " + not_square(*x, *y) +
                            " are not square, which is not modelled",
                        "resample the image to square pixels (ImageJ: Image > Scale) and state their size");
  return reader.constant(block.path_of(key), spec, 0.5 * (*x + *y));
}

/// {file: curve.csv}: columns code and light, both growing from row to row.
Transfer read_curve(ConfigReader& reader, const Block& block) {
  Transfer transfer;
  const std::optional<std::string> name = reader.text(block, "file");
  if (!name) return transfer;
  const std::string file = reader.resolve(*name).string();
  try {
    const PlacedTable table = load_placed_table(file, block.find("file")->where);
    if (table.table.columns != std::vector<std::string>{"code", "light"})
      throw UserError({file, table.header_line},
                      "is no curve of a camera: its columns are " + list_words(table.table.columns),
                      "two columns, code and light: what the file holds, and how much light that was");
    for (std::size_t i = 0; i < table.table.rows.size(); ++i) {
      const std::vector<double>& row = table.table.rows[i];
      if (i > 0 && !(row[0] > transfer.code.back() && row[1] > transfer.light.back()))
        throw UserError({file, table.lines[i]}, "neither code nor light may fall or stay from row to row",
                        "sort the rows by code; where the camera is saturated the curve ends");
      transfer.code.push_back(row[0]), transfer.light.push_back(row[1]);
    }
    if (transfer.code.size() < 3)
      throw UserError({file}, "a curve needs three rows at least", "a straight line is transfer: linear");
    transfer.kind = Transfer::Kind::table;
    reader.warnings.insert(reader.warnings.end(), table.notes.begin(), table.notes.end());
  } catch (const UserError& error) {
    reader.problems.add(error);
  }
  return transfer;
}

}  // namespace

std::optional<PixelRect> read_roi(ConfigReader& reader, const Block& block, Where& where) {
  where = block.find("roi_px") ? block.find("roi_px")->where : block.where;
  const auto given = reader.integers(block, "roi_px", 4, "[x0, y0, x1, y1] (end exclusive)");
  if (!given) return std::nullopt;
  const PixelRect roi{(*given)[0], (*given)[1], (*given)[2], (*given)[3]};
  if (roi.width() > 0 && roi.height() > 0) return roi;
  reader.problems.add(where, "roi_px is empty: x1 must be above x0 and y1 above y0 (end exclusive)");
  return std::nullopt;
}

std::vector<MicrographSettings> by_channel(const MicrographSettings& settings) {
  if (settings.channel != "rgb") return {settings};
  std::vector<MicrographSettings> all;
  for (const char* channel : {"r", "g", "b"}) {
    MicrographSettings own = settings;
    own.channel = channel;
    if (!own.mosaic.bayer.empty()) own.mosaic.parts = bayer_parts(own.mosaic.bayer, *channel);
    all.push_back(std::move(own));
  }
  return all;
}

void keep_positive(Parameter& gain) {
  if (gain.automatic && !std::isfinite(gain.lower)) gain.lower = gain.physical_lower = 0;
}

std::string not_square(double x, double y) { return fmt::format("{:.5g} x {:.5g} um", x, y); }

MicrographSettings read_micrograph(ConfigReader& reader, const Block& root, const Scene& scene, Quantity quantity) {
  MicrographSettings settings;
  const Block block =
      reader.block(root, "micrograph",
                   {"image",    "page", "channel", "channels",          "mosaic",     "bayer",       "pixel_size_um",
                    "transfer", "gain", "offset",  "illumination",      "background", "center_px",   "rotation_deg",
                    "roi_px",   "bin",  "mask",    "saturation_counts", "noise",      "calibration", "metadata"},
                   false);
  settings.where = block.where;
  const auto place = [&](const char* key) { return block.find(key) ? block.find(key)->where : block.where; };
  settings.image = reader.text(block, "image");
  settings.image_where = place("image");
  settings.page = read_page(reader, block);
  settings.channel = read_channel(reader, block);
  settings.channel_where = place("channel");
  if (settings.channel == "rgb" && reader.camera.empty())
    reader.problems.add(settings.channel_where, "channel: rgb needs the light and what the camera sees of it",
                        "microscope: {light: {lamp: A}, camera: {sensitivity: nikon_d5100}}");
  if (const Block channels = reader.block(block, "channels", {"r", "g", "b"}, false); channels.node) {
    if (settings.channel != "rgb")
      reader.problems.add(channels.where, "channels is what each colour of channel: rgb has for itself",
                          "channel: rgb, or leave channels out");
    for (const YamlEntry& entry : channels.node->entries) settings.channels[entry.key] = &entry.value;
  }
  settings.mosaic = read_mosaic(reader, block, settings.channel);
  settings.metadata_ignored = reader.choice(block, "metadata", {"compare", "ignore"}).value_or("compare") == "ignore";

  settings.pixel_size_um = read_pixel_size(reader, block, scene);
  if (const YamlNode* transfer = block.find("transfer")) {
    if (transfer->is_map()) {
      const Block curve = reader.block(block, "transfer", {"gamma", "file"}, true);
      if (const YamlNode* file = curve.find("file")) {
        if (curve.find("gamma")) reader.problems.add(file->where, "file is given beside gamma", "give one of the two");
        settings.transfer = read_curve(reader, curve);
      } else {
        NumberSpec range;
        range.lower = 0.1;
        range.upper = 10;
        if (!curve.find("gamma")) reader.missing(curve, "gamma or file");
        settings.transfer = {Transfer::Kind::gamma, reader.plain(curve, "gamma", range).value_or(1)};
      }
    } else if (reader.choice(block, "transfer", {"linear", "srgb"}).value_or("linear") == "srgb") {
      settings.transfer.kind = Transfer::Kind::srgb;
    }
  }
  // radii come in cm, retardances as what they are
  const bool scaled = !has_ring_table(scene) && quantity == Quantity::intensity;
  settings.gain = read_linear(reader, block, "gain", 1, scaled);
  settings.offset = read_linear(reader, block, "offset", 0, scaled);
  settings.offset_automatic = reader.table[settings.offset].automatic;
  using Shape = UnevenLight::Shape;
  for (const auto& [key, of_intensity] : {std::pair("illumination", true), std::pair("background", false)}) {
    if (!block.find(key)) continue;
    const Block uneven = reader.block(block, key, {"x", "y", "square"}, false);
    for (const auto& [name, shape] :
         {std::pair("x", Shape::x), std::pair("y", Shape::y), std::pair("square", Shape::square)}) {
      if (!uneven.find(name)) continue;
      const ParameterRef ref = reader.number(uneven, name, linear_spec(), 0);
      if (!std::isfinite(reader.table[ref].value)) reader.table[ref].value = 0;
      settings.uneven.push_back({ref, shape, of_intensity});
    }
  }
  read_center(reader, block, scene, settings);
  settings.rotation = read_described<View>(reader, block, "rotation_deg");

  settings.roi = read_roi(reader, block, settings.roi_where);
  constexpr int kMostBin = 1000;
  settings.bin = reader.integer(block, "bin", 1, kMostBin).value_or(1);
  settings.bin_where = place("bin");
  if (settings.bin > 1 && !settings.mosaic.parts.empty())
    reader.problems.add(settings.bin_where,
                        "bin is given beside " + std::string(settings.mosaic.bayer.empty() ? "mosaic" : "bayer") +
                            ": neighbours see different things, and have no mean",
                        "leave bin out; roi_px makes a fit of a mosaic smaller");
  settings.mask = reader.text(block, "mask");
  settings.mask_where = place("mask");
  NumberSpec counts;
  counts.lower = 0;
  counts.upper = 1e9;
  NumberSpec positive = counts;
  positive.lower_open = true;
  settings.saturation_counts = reader.plain(block, "saturation_counts", positive);
  if (block.find("noise")) {
    const Block noise = reader.block(block, "noise", {"read_counts", "counts_per_photon", "black_counts"}, true);
    NoiseModel model;
    model.read_counts = reader.plain(noise, "read_counts", counts).value_or(0);
    model.counts_per_photon = reader.plain(noise, "counts_per_photon", counts).value_or(0);
    NumberSpec level = counts;
    level.lower = -1e9;
    model.black_counts = reader.plain(noise, "black_counts", level).value_or(0);
    const bool given = noise.find("read_counts") || noise.find("counts_per_photon");
    if (noise.node && !given)
      reader.missing(noise, "read_counts or counts_per_photon", "leave noise out to estimate it");
    else if (noise.node && model.read_counts == 0 && model.counts_per_photon == 0)
      reader.problems.add(noise.where, "micrograph.noise is zero: no image is exact", "leave noise out to estimate it");
    // Stated of a pixel of the file: the mean of so many has a smaller one.
    model.read_counts /= settings.bin;
    model.counts_per_photon /= settings.bin * settings.bin;
    settings.noise = model;
  }
  read_calibration(reader, root, block, settings);
  return settings;
}

}  // namespace birefit
