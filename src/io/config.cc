// load_config: from a YAML file to scene, images and masks. Every mistake found on the way is reported at once.

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <iterator>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "birefit/io.h"
#include "io/config_disc.h"
#include "io/config_mosaic.h"
#include "io/config_pixels.h"
#include "io/config_reader.h"
#include "io/config_rings.h"
#include "io/config_scene.h"
#include "io/config_series.h"
#include "io/config_signal.h"
#include "io/images/mask.h"
#include "io/images/mosaic.h"
#include "io/prior.h"
#include "medium/references.h"

namespace birefit {
namespace {

/// More messages than this say no more.
constexpr std::size_t kMaxProblemsShown = 50;
/// Below this find_disc saw no disc (DiscGuess::contrast).
constexpr double kLeastDiscContrast = 3;
/// Half-width of the bounds of an automatic centre, as a fraction of the image size.
constexpr double kCenterBoundFraction = 0.15;
/// A frame's pixel whose light is below this fraction of the typical one says nothing about transmission.
constexpr double kLeastLightFraction = 0.05;
constexpr int kMaxImageSide = 16384;

/// What the `micrograph:` block gives to every image.
struct MicrographSettings {
  std::optional<std::string> image;
  Where image_where;
  std::optional<int> page;
  std::string channel;
  MosaicSettings mosaic;
  std::optional<double> pixel_size_um;
  Transfer transfer;
  ParameterRef gain, offset, center_x, center_y, rotation;
  std::vector<UnevenLight> uneven;
  bool offset_automatic = false;
  std::optional<PixelRect> roi;
  Where roi_where;
  std::optional<std::string> mask;
  Where mask_where;
  std::optional<double> saturation_counts;
  std::optional<NoiseModel> noise;
  std::optional<std::string> dark, parallel, crossed;
  Where dark_where, parallel_where, crossed_where;
  Where where;
};

/// One item of `micrographs:`.
struct Item {
  std::optional<std::string> image;
  Where image_where;
  std::optional<int> page;
  std::vector<std::pair<std::string, const YamlNode*>> set;
  std::vector<Where> set_where;
  std::string axis;  ///< of `set`, may be no parameter: a column that a series is only drawn along
};

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

/// An automatic gain: a negative one would pass off dark fringes as bright ones, half an order away.
void keep_positive(Parameter& gain) {
  if (gain.automatic && !std::isfinite(gain.lower)) gain.lower = gain.physical_lower = 0;
}

/// `gain` or `offset`: absent means `fit: auto`, a nuisance every real image has.
ParameterRef read_linear(ConfigReader& reader, const Block& block, const std::string& key, double start,
                         bool automatic) {
  const bool given = block.find(key) != nullptr;
  const ParameterRef ref = reader.number(block, key, linear_spec(), start);
  if (!given && automatic) make_automatic(reader, ref);
  Parameter& parameter = reader.table[ref];
  if (!std::isfinite(parameter.value)) parameter.value = start;
  if (key == "gain") keep_positive(parameter);
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
    settings.center_x = reader.constant(path + ".x", pixel_spec(), std::numeric_limits<double>::quiet_NaN());
    settings.center_y = reader.constant(path + ".y", pixel_spec(), std::numeric_limits<double>::quiet_NaN());
    const YamlNode* fit = node && node->is_map() ? node->find("fit") : nullptr;
    const bool automatic = fit && fit->is_scalar() && fit->text == "auto" && node->entries.size() == 1;
    if (node && !automatic)
      reader.problems.add(node->where,
                          "center_px must be [x, y] (each a number or {value, fit}) or {fit: auto}, found " +
                              (node->is_sequence() ? std::to_string(node->items.size()) + " items" : node->describe()));
    // Where a droplet lies is hardly ever known, and its image shows it.
    if (automatic || (!node && droplet && reader.use != ConfigUse::render)) {
      make_automatic(reader, settings.center_x);
      make_automatic(reader, settings.center_y);
    }
  }
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
  const Block block = reader.block(top ? root : micrograph, "calibration", {"dark", "parallel", "crossed"}, true);
  for (const auto& [key, name, where] :
       {std::tuple(std::string("dark"), &settings.dark, &settings.dark_where),
        std::tuple(std::string("parallel"), &settings.parallel, &settings.parallel_where),
        std::tuple(std::string("crossed"), &settings.crossed, &settings.crossed_where)}) {
    *name = reader.text(block, key);
    *where = block.find(key) ? block.find(key)->where : block.where;
    if (key != "crossed" && !block.find(key))
      reader.missing(block, key, "transmission = (image - dark) / (parallel - dark)");
  }
}

/// r, g, b, mean or a number.
std::string read_channel(ConfigReader& reader, const Block& block) {
  const YamlNode* node = block.find("channel");
  if (node && node->is_scalar() && !node->text.empty() &&
      node->text.find_first_not_of("0123456789") == std::string::npos)
    return node->text;
  return reader.choice(block, "channel", {"r", "g", "b", "mean"}).value_or("");
}

std::string not_square(double x, double y) { return fmt::format("{:.5g} x {:.5g} um", x, y); }

/// A number, or [x, y] of pixels that are square after all.
std::optional<double> read_pixel_size(ConfigReader& reader, const Block& block, const NumberSpec& spec) {
  const YamlNode* node = block.find("pixel_size_um");
  if (!node || !node->is_sequence()) return reader.plain(block, "pixel_size_um", spec);
  if (node->items.size() != 2) {
    reader.problems.add(node->where, "pixel_size_um must be a number or [x, y], found " +
                                         std::to_string(node->items.size()) + " items");
    return std::nullopt;
  }
  const auto x = reader.value_of(node->items[0], "pixel_size_um", spec);
  const auto y = reader.value_of(node->items[1], "pixel_size_um", spec);
  if (!x || !y) return std::nullopt;
  // As close as sizes are known from a stage micrometer.
  constexpr double kSquare = 1e-3;
  if (std::abs(*x / *y - 1) > kSquare)
    reader.problems.add(node->where,
                        "pixel_size_um = [" + show(*x) + ", " + show(*y) + "]: pixels of " + not_square(*x, *y) +
                            " are not square, which is not modelled",
                        "resample the image to square pixels (ImageJ: Image > Scale) and state their size");
  return 0.5 * (*x + *y);
}

MicrographSettings read_micrograph(ConfigReader& reader, const Block& root, const Scene& scene, Quantity quantity) {
  MicrographSettings settings;
  const Block block = reader.block(
      root, "micrograph",
      {"image", "page", "channel", "mosaic", "bayer", "pixel_size_um", "transfer", "gain", "offset", "illumination",
       "background", "center_px", "rotation_deg", "roi_px", "mask", "saturation_counts", "noise", "calibration"},
      false);
  settings.where = block.where;
  const auto place = [&](const char* key) { return block.find(key) ? block.find(key)->where : block.where; };
  settings.image = reader.text(block, "image");
  settings.image_where = place("image");
  settings.page = reader.integer(block, "page", 0, 100000);
  settings.channel = read_channel(reader, block);
  settings.mosaic = read_mosaic(reader, block, settings.channel);

  NumberSpec pixel_size;
  pixel_size.unit = "um";
  pixel_size.lower = 0;
  pixel_size.lower_open = true;
  pixel_size.upper = std::holds_alternative<StressedDisc>(scene.sample) ? 1000 : 20;
  settings.pixel_size_um = read_pixel_size(reader, block, pixel_size);

  if (const YamlNode* transfer = block.find("transfer")) {
    if (transfer->is_map()) {
      const Block gamma = reader.block(block, "transfer", {"gamma"}, true);
      NumberSpec range;
      range.lower = 0.1;
      range.upper = 10;
      if (!gamma.find("gamma")) reader.missing(gamma, "gamma");
      settings.transfer = {Transfer::Kind::gamma, reader.plain(gamma, "gamma", range).value_or(1)};
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
  NumberSpec angle;
  angle.unit = "deg";
  angle.lower = -36000;
  angle.upper = 36000;
  settings.rotation = reader.number(block, "rotation_deg", angle, 0);

  settings.roi_where = place("roi_px");
  if (const auto roi = reader.integers(block, "roi_px", 4, "[x0, y0, x1, y1] (end exclusive)")) {
    settings.roi = PixelRect{(*roi)[0], (*roi)[1], (*roi)[2], (*roi)[3]};
    if (settings.roi->width() <= 0 || settings.roi->height() <= 0) {
      reader.problems.add(settings.roi_where, "roi_px is empty: x1 must be above x0 and y1 above y0 (end exclusive)");
      settings.roi.reset();
    }
  }
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
    settings.noise = model;
  }
  read_calibration(reader, root, block, settings);
  return settings;
}

/// The image of a frame with its row of the table; `cells` holds the row's nodes, in the order of the columns.
Item item_of(const ImageSeries& series, const SeriesFrame& frame, const std::vector<YamlNode>& cells) {
  Item item;
  item.image = frame.file;
  item.image_where = frame.where;
  for (std::size_t c = 0; c < cells.size(); ++c) {
    item.set.emplace_back(series.columns[c].name, &cells[c]);
    item.set_where.push_back(series.columns[c].where);
  }
  if (series.along) item.axis = series.columns[*series.along].name;
  return item;
}

std::vector<Item> read_items(ConfigReader& reader, const Block& root) {
  std::vector<Item> items;
  const YamlNode* list = root.find("micrographs");
  if (!list) return items;
  if (is_series(*list)) {
    reader.problems.add(list->where, "micrographs with files are a series of fits",
                        "run birefit series " + reader.file);
    return items;
  }
  if (!list->is_sequence() || list->items.empty()) {
    reader.problems.add(list->where, "micrographs must be a list of {image, set}, found " +
                                         (list->is_sequence() ? "an empty one" : list->describe()));
    return items;
  }
  for (std::size_t i = 0; i < list->items.size(); ++i) {
    const std::string path = "micrographs[" + std::to_string(i) + "]";
    const Block block = reader.block_of(list->items[i], path, {"image", "set", "page"});
    Item item;
    item.image = reader.text(block, "image");
    item.image_where = block.find("image") ? block.find("image")->where : block.where;
    if (!block.find("image") && reader.use == ConfigUse::fit) reader.missing(block, "image");
    item.page = reader.integer(block, "page", 0, 100000);
    if (const YamlNode* set = block.find("set")) {
      if (!set->is_map()) {
        reader.problems.add(set->where, path + ".set must be a map of parameter paths, found " + set->describe());
      } else {
        for (const YamlEntry& entry : set->entries) {
          item.set.emplace_back(entry.key, &entry.value);
          item.set_where.push_back(entry.where);
        }
      }
    }
    items.push_back(std::move(item));
  }
  return items;
}

/// The calibration frames as what a micrograph needs of them.
struct Calibration {
  Image dark;   ///< counts in linear light
  Image light;  ///< parallel - dark
  Mask usable;
  Mask saturated;
  double crossed_median = 0, crossed_sd = 0;
  bool has_crossed = false;
};

PixelRect whole(const Image& image) { return {0, 0, image.width(), image.height()}; }

bool check_roi(ConfigReader& reader, const MicrographSettings& settings, const Image& image, const std::string& name) {
  if (!settings.roi) return true;
  const PixelRect& roi = *settings.roi;
  if (roi.x0 >= 0 && roi.y0 >= 0 && roi.x1 <= image.width() && roi.y1 <= image.height()) return true;
  reader.problems.add(settings.roi_where, "roi_px = [" + std::to_string(roi.x0) + ", " + std::to_string(roi.y0) + ", " +
                                              std::to_string(roi.x1) + ", " + std::to_string(roi.y1) +
                                              "] reaches outside " + name + ", which is " +
                                              std::to_string(image.width()) + " x " + std::to_string(image.height()) +
                                              " pixels");
  return false;
}

void say(ConfigReader& reader, const std::filesystem::path& file, const std::vector<std::string>& notes) {
  for (const std::string& note : notes) reader.warnings.push_back(file.filename().string() + ": " + note);
}

/// An image with the reader's remarks among the warnings.
std::optional<LoadedImage> try_load(ConfigReader& reader, const ImageRequest& request) {
  try {
    LoadedImage image = load_image(request);
    say(reader, request.path, image.notes);
    return image;
  } catch (const UserError& error) {
    reader.problems.add(error);
    return std::nullopt;
  }
}

void mark_saturated(const Image& counts, double from, Mask& saturated) {
  for (std::size_t i = 0; i < counts.size(); ++i)
    if (counts.values()[i] >= from) saturated.values()[i] = 1;
}

/// The smallest difference that can be told from none: half a code, or single precision.
double smallest_step(const LoadedImage& image) {
  if (image.top_code > 0) return 0.5;
  double largest = 0;
  for (double value : image.values.values())
    if (std::isfinite(value)) largest = std::max(largest, std::abs(value));
  return std::max(1e-6 * largest, 1e-300);
}

ImageRequest image_request(const MicrographSettings& settings, const std::filesystem::path& file,
                           std::optional<int> page, const Where& where) {
  ImageRequest request{file, page, settings.channel, where};
  request.cells = !settings.mosaic.parts.empty();
  return request;
}

std::optional<Calibration> load_calibration(ConfigReader& reader, const MicrographSettings& settings) {
  if (!settings.dark || !settings.parallel) return std::nullopt;
  const auto load = [&](const std::string& name, const Where& where) {
    return try_load(reader, image_request(settings, reader.resolve(name), std::nullopt, where));
  };
  std::optional<LoadedImage> dark = load(*settings.dark, settings.dark_where);
  std::optional<LoadedImage> parallel = load(*settings.parallel, settings.parallel_where);
  std::optional<LoadedImage> crossed;
  if (settings.crossed) {
    crossed = load(*settings.crossed, settings.crossed_where);
    if (!crossed) return std::nullopt;
  }
  if (!dark || !parallel) return std::nullopt;

  const auto same_size = [&](const LoadedImage& frame, const std::string& name, const Where& where) {
    if (frame.values.width() == dark->values.width() && frame.values.height() == dark->values.height()) return true;
    reader.problems.add(where, name + " is " + std::to_string(frame.values.width()) + " x " +
                                   std::to_string(frame.values.height()) + " pixels, " + *settings.dark + " is " +
                                   std::to_string(dark->values.width()) + " x " +
                                   std::to_string(dark->values.height()));
    return false;
  };
  if (!same_size(*parallel, *settings.parallel, settings.parallel_where)) return std::nullopt;
  if (crossed && !same_size(*crossed, *settings.crossed, settings.crossed_where)) return std::nullopt;
  if (!check_roi(reader, settings, dark->values, *settings.dark)) return std::nullopt;

  const PixelRect area = settings.roi.value_or(whole(dark->values));
  Calibration calibration;
  calibration.usable = Mask(dark->values.width(), dark->values.height(), 1);
  calibration.saturated = Mask(dark->values.width(), dark->values.height(), 0);
  for (LoadedImage* frame : {&*dark, &*parallel, crossed ? &*crossed : nullptr}) {
    if (!frame) continue;
    // The frames come from one camera: the code at which one saturates is the code for all.
    mark_saturated(frame->values, find_saturation(*frame, area, settings.saturation_counts).from,
                   calibration.saturated);
    const double step = smallest_step(*frame);
    linearise(frame->values, settings.transfer, frame->top_code);
    for (std::size_t i = 0; i < frame->values.size(); ++i)
      if (!std::isfinite(frame->values.values()[i]) || calibration.saturated.values()[i])
        calibration.usable.values()[i] = 0;
    if (settings.mosaic.parts.empty())
      exclude_outliers(frame->values, area, step, Smoothness::frame, calibration.usable);
    else
      exclude_outliers_in_cells(frame->values, area, step, Smoothness::frame, calibration.usable);
  }

  calibration.dark = dark->values;
  calibration.light = parallel->values;
  for (std::size_t i = 0; i < calibration.light.size(); ++i)
    calibration.light.values()[i] -= calibration.dark.values()[i];
  Mask positive = calibration.usable;
  for (std::size_t i = 0; i < positive.size(); ++i)
    if (!(calibration.light.values()[i] > 0)) positive.values()[i] = 0;
  const RobustSpread typical = robust_spread(calibration.light, positive, area);
  if (typical.count == 0) {
    reader.problems.add(settings.parallel_where, *settings.parallel + " is nowhere brighter than " + *settings.dark,
                        "were the two exchanged?");
    return std::nullopt;
  }
  for (std::size_t i = 0; i < calibration.light.size(); ++i)
    if (!(calibration.light.values()[i] > kLeastLightFraction * typical.median)) calibration.usable.values()[i] = 0;

  if (crossed) {
    Image transmission = crossed->values;
    for (std::size_t i = 0; i < transmission.size(); ++i)
      transmission.values()[i] =
          (transmission.values()[i] - calibration.dark.values()[i]) / calibration.light.values()[i];
    const RobustSpread spread = robust_spread(transmission, calibration.usable, area);
    if (spread.count > 0) {
      calibration.has_crossed = true;
      calibration.crossed_median = spread.median;
      // The spread over the frame, not the error of its median: residual birefringence differs from place to place, so
      // the stray light of another frame is known no better.
      calibration.crossed_sd = std::max(spread.sd, 1e-6);
    }
  }
  return calibration;
}

/// Values, mask and the reasons for exclusion; false when a problem left nothing to work with. Of a mosaic only the
/// pixels of a `part`.
bool fill_pixels(ConfigReader& reader, const MicrographSettings& settings, const Calibration* calibration,
                 const Mask* user_mask, const MosaicPart* part, LoadedImage image, const Where& where,
                 Picture& micrograph) {
  const int width = image.values.width(), height = image.values.height();
  const std::string& name = micrograph.name;
  const std::size_t problems_before = reader.problems.all().size();
  check_roi(reader, settings, image.values, name);
  const auto other_size = [&](int other_width, int other_height, const std::string& what, const Where& place) {
    if (other_width == width && other_height == height) return;
    reader.problems.add(place, what + " is " + std::to_string(other_width) + " x " + std::to_string(other_height) +
                                   " pixels, " + name + " is " + std::to_string(width) + " x " +
                                   std::to_string(height));
  };
  if (user_mask) other_size(user_mask->width(), user_mask->height(), *settings.mask, settings.mask_where);
  if (calibration)
    other_size(calibration->dark.width(), calibration->dark.height(), *settings.dark, settings.dark_where);
  if (reader.problems.all().size() > problems_before) return false;

  const PixelRect area = settings.roi.value_or(whole(image.values));
  const Saturation saturation = find_saturation(image, area, settings.saturation_counts);
  if (saturation.pile_up)
    reader.warnings.push_back(name + ": " + std::to_string(saturation.pile_up_pixels) + " pixels pile up at " +
                              show(saturation.from) + " counts, below the file's top code of " + show(image.top_code) +
                              "; they are taken as saturated (saturation_counts sets the limit).");
  Mask saturated(width, height, 0);
  mark_saturated(image.values, saturation.from, saturated);
  const double step = smallest_step(image);
  linearise(image.values, settings.transfer, image.top_code);

  micrograph.mask = Mask(width, height, 0);
  int frame_dead = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (part && ((x - part->x0) % 2 != 0 || (y - part->y0) % 2 != 0)) continue;
      if (!area.contains(x, y))
        ++micrograph.outside_roi;
      else if (user_mask && !(*user_mask)(x, y))
        ++micrograph.masked_by_user;
      else if (!std::isfinite(image.values(x, y)))
        ++micrograph.non_finite;
      else if (saturated(x, y) || (calibration && calibration->saturated(x, y)))
        ++micrograph.saturated;
      else if (calibration && !calibration->usable(x, y))
        ++frame_dead;
      else
        micrograph.mask(x, y) = 1;
    }
  }
  micrograph.dead = frame_dead + exclude_outliers(image.values, area, step, Smoothness::image, micrograph.mask);

  if (calibration) {
    micrograph.variance_scale = Image(width, height, 0);
    for (std::size_t i = 0; i < image.values.size(); ++i) {
      const double light = calibration->light.values()[i];
      if (!micrograph.mask.values()[i]) {
        image.values.values()[i] = std::numeric_limits<double>::quiet_NaN();
        continue;
      }
      image.values.values()[i] = (image.values.values()[i] - calibration->dark.values()[i]) / light;
      micrograph.variance_scale.values()[i] = 1 / (light * light);
    }
  }
  micrograph.values = std::move(image.values);
  if (std::none_of(micrograph.mask.values().begin(), micrograph.mask.values().end(), [](auto used) { return used; })) {
    std::vector<std::string> reasons;
    const auto count = [&](int pixels, const std::string& why) {
      if (pixels > 0) reasons.push_back(std::to_string(pixels) + " " + why);
    };
    count(micrograph.non_finite, "not finite");
    count(micrograph.saturated, "saturated");
    count(micrograph.dead, "dead");
    count(micrograph.masked_by_user, "masked");
    count(micrograph.outside_roi, "outside roi_px");
    reader.problems.add(where, name + " has no usable pixel: " + list_words(reasons));
    return false;
  }
  return true;
}

/// Replaces a reference everywhere in a scene, or in a picture with its light.
void replace_ref(Scene& scene, ParameterRef from, ParameterRef to) {
  for_each_ref(scene, [&](ParameterRef& ref) {
    if (ref == from) ref = to;
  });
}
void replace_ref(Picture& micrograph, ParameterRef from, ParameterRef to) {
  const auto swap = [&](ParameterRef& ref) {
    if (ref == from) ref = to;
  };
  replace_ref(micrograph.scene, from, to);
  swap(micrograph.gain);
  swap(micrograph.offset);
  for (UnevenLight& uneven : micrograph.uneven) swap(uneven.coefficient);
}

/// A mosaic that the config does not know of: reported.
bool is_unstated_mosaic(ConfigReader& reader, const MicrographSettings& settings, const LoadedImage& image,
                        const Where& where, const std::string& name) {
  if (settings.mosaic.not_looked_for || image.colour) return false;
  // Frames with and without light take off what a camera's pixels have of their own, and a camera that was calibrated
  // so is none with a mosaic: its columns and rows may differ by as much.
  if (settings.dark || settings.parallel) return false;
  PixelRect area = settings.roi.value_or(whole(image.values));
  area.x1 = std::min(area.x1, image.values.width()), area.y1 = std::min(area.y1, image.values.height());
  if (area.x0 < 0 || area.y0 < 0) return false;  // reported
  const auto kind = find_mosaic(image.values, area, smallest_step(image));
  if (!kind) return false;
  reader.problems.add(where, name + ": pixels alternate in cells of 2 x 2: a " + *kind + " mosaic",
                      "add `bayer: rggb` (or bggr, grbg, gbrg) and `channel: g`, or `mosaic: polarization`; `mosaic: "
                      "none` takes the pixels as they are");
  return true;
}

/// The picture with its pixels, or those that a mosaic holds; none when a problem left nothing to work with.
std::vector<Picture> pictures_of(ConfigReader& reader, const MicrographSettings& settings,
                                 const Calibration* calibration, const Mask* user_mask, LoadedImage image,
                                 const Where& where, const Picture& micrograph) {
  std::vector<Picture> pictures;
  if (settings.mosaic.parts.empty()) {
    pictures.push_back(micrograph);
    if (is_unstated_mosaic(reader, settings, image, where, micrograph.name) ||
        !fill_pixels(reader, settings, calibration, user_mask, nullptr, std::move(image), where, pictures[0]))
      pictures.clear();
    return pictures;
  }
  if (image.colour) {
    reader.problems.add(settings.mosaic.where, micrograph.name + " has colour channels: it is no mosaic any more",
                        "leave bayer and mosaic out, or save what the sensor saw");
    return pictures;
  }
  if (!image.filter_pattern.empty() && image.filter_pattern != settings.mosaic.bayer)
    reader.problems.add(settings.mosaic.where, micrograph.name + " states the filters " + image.filter_pattern,
                        "bayer: " + image.filter_pattern);
  NumberSpec angle;
  angle.unit = "deg";
  for (const MosaicPart& part : settings.mosaic.parts) {
    Picture picture = micrograph;
    picture.name += " (" + part.name + ")";
    if (part.analyzer_deg) {
      const ParameterRef own = reader.constant(picture.name + ".microscope.analyzer_deg", angle, *part.analyzer_deg);
      replace_ref(picture.scene, picture.scene.microscope.analyzer_deg, own);
    }
    if (!fill_pixels(reader, settings, calibration, user_mask, &part, image, where, picture)) return {};
    pictures.push_back(std::move(picture));
  }
  return pictures;
}

/// A micrograph of the shared scene with its own values of what its `set:` names.
Picture apply_set(ConfigReader& reader, const Picture& shared, const Item& item, std::size_t index,
                  const std::string& list = "micrographs") {
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
    const ParameterRef own = reader.number_at(*node, list + "[" + std::to_string(index) + "]." + path, spec->second);
    if (spec->second.linear && !std::isfinite(reader.table[own].value))
      reader.table[own].value = reader.table[shared_refs.at(path)].value;
    if (path == "micrograph.gain") keep_positive(reader.table[own]);
    reader.replaced.insert(shared_refs.at(path).index);
    replace_ref(micrograph, shared_refs.at(path), own);
  }
  // The names of this image's parameters are no paths for the next image's `set:`.
  reader.specs = shared_specs;
  reader.refs = shared_refs;
  return micrograph;
}

/// Starts and bounds of `fit: auto` from the image; the image's middle where there is none to look at.
void resolve_automatic(ConfigReader& reader, Scene& scene, const Image* values, const Mask* mask,
                       const std::string& name) {
  View& view = scene.view;
  auto* droplet = std::get_if<Droplet>(&scene.sample);
  const double middle_x = 0.5 * (view.width - 1), middle_y = 0.5 * (view.height - 1);
  const auto open = [&](ParameterRef ref) {
    return ref && reader.table[ref].automatic && !std::isfinite(reader.table[ref].value);
  };
  DiscGuess disc{middle_x, middle_y, 0.25 * std::min(view.width, view.height), 0};
  const bool wanted = open(view.center_x_px) || open(view.center_y_px) || (droplet && open(droplet->diameter_um));
  if (wanted && droplet && values) {
    const DiscGuess found = find_disc(*values, *mask);
    if (found.contrast >= kLeastDiscContrast)
      disc = found;
    else
      reader.warnings.push_back(name + ": no disc is visible; the centre starts in the middle of the image. Give " +
                                "center_px and diameter_um to start elsewhere.");
  }
  const auto center = [&](ParameterRef ref, double found, double middle, int size) {
    Parameter& parameter = reader.table[ref];
    const bool unset = !std::isfinite(parameter.value);
    if (unset) parameter.value = parameter.automatic && reader.use != ConfigUse::render ? found : middle;
    if (parameter.automatic && !std::isfinite(parameter.lower)) {
      parameter.lower = parameter.value - kCenterBoundFraction * size;
      parameter.upper = parameter.value + kCenterBoundFraction * size;
    }
  };
  center(view.center_x_px, disc.center_x_px, middle_x, view.width);
  center(view.center_y_px, disc.center_y_px, middle_y, view.height);
  if (!droplet || !droplet->diameter_um) return;  // no kind was readable: reported
  Parameter& diameter = reader.table[droplet->diameter_um];
  if (!diameter.automatic) return;
  if (!std::isfinite(diameter.value)) {
    if (!values && reader.use != ConfigUse::fit)
      reader.problems.add(diameter.where, "diameter_um has no value to render", "write {value: .., fit: auto}");
    diameter.value = 2 * disc.radius_px * view.pixel_size_um;
  }
  if (!std::isfinite(diameter.lower)) {
    diameter.lower = 0.8 * diameter.value;
    diameter.upper = 1.25 * diameter.value;
  }
}

/// A droplet in a field is a hedgehog or has a ring: both are fitted.
void add_branches(FitJob& job) {
  SampleBranch hedgehog{"hedgehog", {}, {}}, ring{"ring", {}, {}};
  for_each_scene(job.measurements, [&](const Scene& scene) {
    ring.samples.push_back(scene.sample);
    Droplet droplet = std::get<Droplet>(scene.sample);
    AxialDirector axial = std::get<AxialDirector>(droplet.director);
    hedgehog.idle.push_back(axial.ring_radius.index);
    axial.ring_radius = {};
    droplet.director = axial;
    hedgehog.samples.push_back(droplet);
  });
  job.branches = {hedgehog, ring};
}

/// A droplet that the image cannot show is a mistake in a unit or a centre.
void check_overlap(ConfigReader& reader, const Scene& scene, const std::string& name) {
  const auto* droplet = std::get_if<Droplet>(&scene.sample);
  const View& view = scene.view;
  if (!droplet || !droplet->diameter_um || !(view.pixel_size_um > 0) || view.width <= 0) return;
  const Parameter& diameter = reader.table[droplet->diameter_um];
  const double diameter_px = diameter.value / view.pixel_size_um;
  const double field_px = std::max(view.width, view.height);
  const std::string field =
      show(view.width * view.pixel_size_um) + " x " + show(view.height * view.pixel_size_um) + " um";
  const auto plausible = [&](double value_um) {
    const double pixels = value_um / view.pixel_size_um;
    return pixels >= 3 && pixels <= 2 * field_px;
  };
  if (!(diameter_px >= 3)) {
    std::string hint = "check pixel_size_um = " + show(view.pixel_size_um);
    for (double factor : {1e3, 1e6})
      if (plausible(diameter.value * factor))
        hint = "did you mean " + show(diameter.value * factor) + "? the key is in um";
    reader.problems.add(
        diameter.where,
        "diameter_um = " + show(diameter.value) + " is only " + show(diameter_px) + " pixels in " + name, hint);
  } else if (diameter_px > 10 * field_px) {
    const double smaller = diameter.value / 1e3;
    reader.problems.add(diameter.where,
                        "diameter_um = " + show(diameter.value) + " is " + show(std::round(diameter_px / field_px)) +
                            " times the field of view (" + field + ") of " + name,
                        plausible(smaller) ? "did you mean " + show(smaller) + "? the key is in um"
                                           : "check pixel_size_um = " + show(view.pixel_size_um));
  } else {
    const Parameter& x = reader.table[view.center_x_px];
    const Parameter& y = reader.table[view.center_y_px];
    const double dx = std::max({-0.5 - x.value, x.value - (view.width - 0.5), 0.0});
    const double dy = std::max({-0.5 - y.value, y.value - (view.height - 0.5), 0.0});
    if (std::hypot(dx, dy) >= 0.5 * diameter_px)
      reader.problems.add(x.where.line > 0 ? x.where : diameter.where,
                          "center_px = [" + show(x.value) + ", " + show(y.value) + "] puts the droplet outside " +
                              name + ", which is " + std::to_string(view.width) + " x " + std::to_string(view.height) +
                              " pixels");
  }
}

/// The view of a scene of this size; the pixel size is demanded where the sample has a size of its own.
void set_view(ConfigReader& reader, const MicrographSettings& settings, int width, int height, double file_pixel_um,
              const std::string& name, Scene& scene) {
  scene.view.width = width;
  scene.view.height = height;
  scene.view.pixel_size_um = settings.pixel_size_um.value_or(file_pixel_um);
  if (settings.pixel_size_um && file_pixel_um > 0 && std::abs(*settings.pixel_size_um / file_pixel_um - 1) > 0.01)
    reader.warnings.push_back(name + " states a pixel size of " + show(file_pixel_um) + " um; the config's " +
                              show(*settings.pixel_size_um) + " um is used.");
}

void set_electrodes(ConfigReader& reader, const MicrographSettings& settings, Scene& scene) {
  auto* crystal = std::get_if<Crystal>(&scene.sample);
  if (!crystal || crystal->electrode_low_px || !settings.roi) return;
  NumberSpec spec;
  spec.unit = "px";
  const bool y = crystal->field_along_y;
  crystal->electrode_low_px =
      reader.constant("sample.crystal.electrodes_px.low", spec, (y ? settings.roi->y0 : settings.roi->x0) - 0.5);
  crystal->electrode_high_px =
      reader.constant("sample.crystal.electrodes_px.high", spec, (y ? settings.roi->y1 : settings.roi->x1) - 0.5);
}

void read_fit_options(ConfigReader& reader, const Block& root, FitOptions& options) {
  const Block block =
      reader.block(root, "fit", {"max_iterations", "threads", "scan_pixels", "scan_candidates", "outliers"}, false);
  options.max_iterations = reader.integer(block, "max_iterations", 1, 100000).value_or(options.max_iterations);
  options.threads = reader.integer(block, "threads", 0, 1024).value_or(options.threads);
  options.scan_pixels = reader.integer(block, "scan_pixels", 100, 100000000).value_or(options.scan_pixels);
  options.scan_candidates = reader.integer(block, "scan_candidates", 1, 100).value_or(options.scan_candidates);
  options.leave_out_outliers = reader.choice(block, "outliers", {"keep", "leave_out"}).value_or("keep") == "leave_out";
}

void read_prior(ConfigReader& reader, const Block& root, FitJob& job) {
  if (!root.find("prior")) return;
  const Block block = reader.block(root, "prior", {"from", "parameters"}, true);
  if (!block.node) return;
  if (!block.find("from")) reader.missing(block, "from", "the fit.json of an earlier fit");
  const std::optional<std::string> from = reader.text(block, "from");
  const YamlNode* list = block.find("parameters");
  if (!list) reader.missing(block, "parameters", "a list of parameter paths");
  if (list && (!list->is_sequence() || list->items.empty())) {
    reader.problems.add(list->where, "prior.parameters must be a list of parameter paths, found " +
                                         (list->is_sequence() ? "an empty one" : list->describe()));
    list = nullptr;
  }
  if (!from || !list) return;

  std::vector<std::string> free;
  for (int i = 0; i < reader.table.size(); ++i)
    if (reader.table[i].free) free.push_back(reader.table[i].name);
  std::vector<std::pair<std::string, Where>> names;
  const std::size_t problems_before = reader.problems.all().size();
  for (const YamlNode& item : list->items) {
    if (!item.is_scalar()) {
      reader.problems.add(item.where, "prior.parameters must hold parameter paths, found " + item.describe());
      continue;
    }
    const bool repeated =
        std::any_of(names.begin(), names.end(), [&](const auto& name) { return name.first == item.text; });
    if (repeated) {
      reader.problems.add(item.where, item.text + " is listed twice");
    } else if (std::find(free.begin(), free.end(), item.text) == free.end()) {
      const std::string near = nearest_word(item.text, free);
      const bool known = static_cast<bool>(reader.table.find(item.text));
      reader.problems.add(item.where, item.text + (known ? " is not fitted here" : " is no parameter of this config"),
                          known          ? "give it {value: .., fit: [low, high]}"
                          : near.empty() ? "fitted here: " + list_words(free)
                                         : "did you mean " + near + "?");
    } else if (const Parameter& parameter = reader.table[reader.table.find(item.text)];
               parameter.prior_sd && !parameter.automatic) {
      reader.problems.add(item.where, item.text + " also has a prior_sd of its own", "give one of the two");
    }
    names.emplace_back(item.text, item.where);
  }
  if (reader.problems.all().size() > problems_before) return;
  JointPrior prior;
  try {
    prior = load_prior(reader.resolve(*from), names, block.find("from")->where, reader.warnings);
  } catch (const UserError& error) {
    reader.problems.add(error);
    return;
  }
  for (std::size_t i = 0; i < prior.names.size(); ++i) {
    Parameter& parameter = reader.table[reader.table.find(prior.names[i])];
    const double mean = prior.mean[static_cast<Eigen::Index>(i)];
    // A start of its own from the crossed frame would count the same light twice.
    parameter.prior_sd.reset();
    parameter.value = std::clamp(mean, parameter.lower, parameter.upper);
    if (parameter.value != mean)
      reader.warnings.push_back("The prior mean of " + parameter.name + ", " + show(mean) +
                                ", lies outside its bounds.");
  }
  job.prior = std::move(prior);
}

/// All problems, those of the config first and from top to bottom.
[[noreturn]] void throw_sorted(const ConfigReader& reader) {
  std::vector<Problem> problems = reader.problems.all();
  std::stable_sort(problems.begin(), problems.end(), [&](const Problem& a, const Problem& b) {
    const bool a_other = a.where.file != reader.file, b_other = b.where.file != reader.file;
    return std::tie(a_other, a.where.line, a.where.column) < std::tie(b_other, b.where.line, b.where.column);
  });
  if (problems.size() > kMaxProblemsShown) {
    const std::size_t more = problems.size() - kMaxProblemsShown;
    problems.resize(kMaxProblemsShown);
    problems.push_back({{reader.file}, "and " + std::to_string(more) + " more", ""});
  }
  throw UserError(std::move(problems));
}

/// `image` replaces the single micrograph's file; with `series` the micrograph is one of its frames. Without `starts`
/// nothing is looked for in the image: enough to know that a config is sound.
Config load(const std::filesystem::path& path, std::string text, ConfigUse use,
            const std::optional<std::filesystem::path>& image, const ImageSeries* series = nullptr,
            std::size_t frame = 0, bool starts = true) {
  Config config;
  config.path = path;
  config.text = std::move(text);
  ConfigReader reader(path.string(), path.parent_path(), use);
  const YamlNode tree = parse_yaml(config.text, reader.file, reader.problems);
  const Block root{&tree, "", {reader.file}};
  reader.check_keys(tree, "",
                    {"micrograph", "micrographs", "calibration", "image_size_px", "sample", "microscope", "accuracy",
                     "physics", "transport", "prior", "fit", "signal"});

  const YamlNode* list = root.find("micrographs");
  const std::vector<YamlNode> cells = series ? cell_nodes(series->frames[frame]) : std::vector<YamlNode>{};
  std::vector<Item> items =
      series ? std::vector<Item>{item_of(*series, series->frames[frame], cells)} : read_items(reader, root);
  if (!items.empty()) {
    for (const auto& [name, node] : items[0].set) {
      const bool everywhere = std::all_of(items.begin(), items.end(), [&](const Item& item) {
        return std::any_of(item.set.begin(), item.set.end(), [&](const auto& entry) { return entry.first == name; });
      });
      if (everywhere) reader.set_everywhere.push_back(name);
    }
  }
  const std::vector<SignalItem> signals = read_signals(reader, root);
  if (!signals.empty()) {
    const auto everywhere = [&](const std::string& path) {
      return std::all_of(signals.begin(), signals.end(), [&](const SignalItem& item) {
        return std::any_of(item.columns.begin(), item.columns.end(),
                           [&](const SignalItem::Column& c) { return c.path == path; }) ||
               std::any_of(item.set.begin(), item.set.end(), [&](const auto& entry) { return entry.first == path; });
      });
    };
    for (const SignalItem::Column& column : signals[0].columns)
      if (everywhere(column.path)) reader.set_everywhere.push_back(column.path);
    for (const auto& [path, unused] : signals[0].set)
      if (everywhere(path)) reader.set_everywhere.push_back(path);
  }
  Picture shared;
  const Quantity quantity = signals.empty() ? Quantity::intensity : signals[0].quantity;
  for (const SignalItem& item : signals)
    if (item.quantity != quantity)
      reader.problems.add(item.where, "every table of a config must have the same quantity");
  reader.polarizers = quantity == Quantity::intensity;
  const bool own_analyzers = states_polarization_mosaic(tree);
  if (own_analyzers) reader.set_everywhere.push_back("microscope.analyzer_deg");
  shared.scene = read_scene(reader, root);
  config.observable.quantity = quantity;
  MicrographSettings settings = read_micrograph(reader, root, shared.scene, quantity);
  if (own_analyzers)
    if (const YamlNode* microscope = root.find("microscope"); microscope && microscope->is_map())
      for (const char* key : {"analyzer_deg", "analyser_deg"})
        if (const YamlNode* node = microscope->find(key))
          reader.problems.add(node->where,
                              std::string(key) +
                                  " is given beside mosaic: polarization, whose pixels "
                                  "have an analyser each",
                              "leave it out");
  if (list && settings.image)
    reader.problems.add(settings.image_where, "micrograph.image is given beside micrographs", "give one of the two");
  if (list && image)
    reader.problems.add({reader.file},
                        "--image replaces the image of `micrograph:`, but this config has `micrographs:`");
  shared.scene.view.center_x_px = settings.center_x;
  shared.scene.view.center_y_px = settings.center_y;
  shared.scene.view.rotation_deg = settings.rotation;
  shared.gain = settings.gain;
  shared.offset = settings.offset;
  shared.uneven = settings.uneven;
  shared.noise = settings.noise;
  set_electrodes(reader, settings, shared.scene);
  read_fit_options(reader, root, config.job.options);

  std::optional<std::array<int, 2>> size;
  if (const auto given = reader.integers(root, "image_size_px", 2, "[width, height]")) {
    const Where where = root.find("image_size_px")->where;
    if ((*given)[0] < 1 || (*given)[1] < 1 || (*given)[0] > kMaxImageSide || (*given)[1] > kMaxImageSide)
      reader.problems.add(where, "image_size_px must be within [1, " + std::to_string(kMaxImageSide) + "]");
    else
      size = {(*given)[0], (*given)[1]};
  }

  if (!list) {
    Item only;
    only.image = settings.image;
    only.image_where = settings.image_where;
    only.page = settings.page;
    items = {only};
  } else if (settings.page) {
    for (Item& item : items)
      if (!item.page) item.page = settings.page;
  }

  std::vector<Picture> micrographs;
  std::vector<Readings> tables;
  if (!signals.empty()) {
    if (image)
      reader.problems.add({reader.file}, "--image replaces the image of `micrograph:`, but this config has `signal:`");
    if (!std::holds_alternative<Cell>(shared.scene.sample) && reader.problems.empty())
      reader.problems.add(signals[0].where, "signal is for cells: every row sees the same light");
    if (const auto* cell = std::get_if<Cell>(&shared.scene.sample); cell && quantity != Quantity::intensity) {
      const auto* field = std::get_if<FreederickszDirector>(&cell->director);
      if (!std::holds_alternative<UniformDirector>(cell->director) && (!field || field->twist_deg || field->pitch_um))
        reader.problems.add(signals[0].where,
                            "the axis of this cell turns about the light: its retardance is not one number",
                            "quantity: intensity");
    }
    set_view(reader, settings, 1, 1, 0, "the signal", shared.scene);
    if (reader.problems.empty()) resolve_automatic(reader, shared.scene, nullptr, nullptr, "the signal");
    for (std::size_t i = 0; i < signals.size(); ++i) {
      Item own;
      own.set = signals[i].set;
      own.set_where = signals[i].set_where;
      const Picture base = apply_set(reader, shared, own, i, "signal");
      std::size_t rows = 0;
      for (const Readings& table : tables) rows += table.rows.size();
      append_signal(
          reader, signals[i], i, base, rows,
          [&](Scene& scene, ParameterRef from, ParameterRef to) {
            reader.replaced.insert(from.index);
            replace_ref(scene, from, to);
          },
          config, tables);
    }
    items.clear();
  }
  for (std::size_t i = 0; i < items.size(); ++i) micrographs.push_back(apply_set(reader, shared, items[i], i));

  // An image may have a focus of its own, which only waves know.
  for (const Picture& own : micrographs) {
    const ParameterRef focus = own.scene.microscope.focus_um;
    if (!focus || focus == shared.scene.microscope.focus_um || own.scene.ceiling == Ceiling::wave ||
        !is_defocused(reader, own.scene))
      continue;
    if (!reader.choose_waves) {
      add_defocus_problem(reader, own.scene);
      continue;
    }
    reader.choose_waves = false;
    for (Picture& micrograph : micrographs) micrograph.scene.ceiling = Ceiling::wave;
  }

  // Without an image to look at there is only the view.
  const bool view_only =
      use == ConfigUse::render ||
      (use == ConfigUse::plan && !image && signals.empty() &&
       std::none_of(items.begin(), items.end(), [&](const Item& i) {
         return i.image && (!size || std::filesystem::exists(reader.resolve(*i.image)));  // named, but not yet taken
       }));
  if (use != ConfigUse::render) {
    // A shared parameter that every image replaces by its own is no unknown of the fit.
    std::set<int> used;
    for (Picture& micrograph : micrographs) {
      for_each_ref(micrograph.scene, [&](ParameterRef& ref) { used.insert(ref.index); });
      used.insert({micrograph.gain.index, micrograph.offset.index});
      for (const UnevenLight& uneven : micrograph.uneven) used.insert(uneven.coefficient.index);
    }
    for (Readings& table : tables) {
      for (Scene& scene : table.rows) for_each_ref(scene, [&](ParameterRef& ref) { used.insert(ref.index); });
      used.insert({table.gain.index, table.offset.index});
    }
    const bool sound = reader.problems.empty();  // else images may be missing
    for (int i = 0; i < reader.table.size(); ++i) {
      if (used.count(i) || !reader.table[i].free) continue;
      if (!reader.replaced.count(i) && sound)
        reader.problems.add(reader.table[i].where, reader.table[i].name + " is fitted, but nothing here depends on it",
                            "give it as a number, or leave it out");
      reader.table[i].free = false;
    }
  }

  const bool needs_pixel_size = std::holds_alternative<Droplet>(shared.scene.sample) ||
                                std::holds_alternative<StressedDisc>(shared.scene.sample) ||
                                std::holds_alternative<SampledVolume>(shared.scene.sample);
  const auto demand_pixel_size = [&](const Scene& scene, const std::array<double, 2>& uneven_um = {}) {
    if (!needs_pixel_size || scene.view.pixel_size_um > 0 || !reader.problems.empty()) return;
    const Where where = settings.where.line > 0 ? settings.where : Where{reader.file};
    if (uneven_um[0] > 0)
      reader.problems.add(where,
                          "the file states pixels of " + not_square(uneven_um[0], uneven_um[1]) +
                              ": they are not square, which is not modelled",
                          "resample the image to square pixels (ImageJ: Image > Scale), or state pixel_size_um if the "
                          "file is wrong");
    else
      reader.problems.add(where, "micrograph needs pixel_size_um: the image does not state it",
                          "the size of a pixel on the sample, for example 0.05");
  };

  if (use == ConfigUse::render && !signals.empty()) {
    if (!tables.empty()) config.scene = tables[0].rows[0];
  } else if (view_only && !micrographs.empty()) {  // none: their list's mistake was reported
    Scene& scene = micrographs[0].scene;
    if (own_analyzers && !settings.mosaic.parts.empty()) {
      reader.table[scene.microscope.analyzer_deg].value = *settings.mosaic.parts[0].analyzer_deg;
      reader.warnings.push_back("Of a polarization mosaic the picture behind its first analyser is shown, at " +
                                settings.mosaic.parts[0].name + ".");
    }
    const Item& item = items[0];
    const std::string name = item.image.value_or("the image");
    if (size) {
      set_view(reader, settings, (*size)[0], (*size)[1], 0, name, scene);
      demand_pixel_size(scene);
      resolve_automatic(reader, scene, nullptr, nullptr, name);
      if (reader.problems.empty()) check_overlap(reader, scene, "the image");
    } else if (image || item.image) {
      const ImageRequest request = image_request(settings, image ? *image : reader.resolve(*item.image), item.page,
                                                 image ? Where{image->string()} : item.image_where);
      if (const std::optional<LoadedImage> loaded =
              has_ring_table(scene) ? load_ring_table(reader, request.path, request.where, scene, config.observable)
                                    : try_load(reader, request)) {
        set_view(reader, settings, loaded->values.width(), loaded->values.height(), loaded->pixel_size_um, name, scene);
        demand_pixel_size(scene, loaded->uneven_pixel_um);
        if (reader.problems.empty()) {
          Mask all(loaded->values.width(), loaded->values.height(), 1);
          for (std::size_t i = 0; i < all.size(); ++i) all.values()[i] = std::isfinite(loaded->values.values()[i]);
          resolve_automatic(reader, scene, &loaded->values, &all, name);
          check_overlap(reader, scene, name);
        }
      }
    } else if (root.find("image_size_px")) {
      // Its mistake was reported.
    } else if (!scene.microscope.directions.empty()) {
      set_view(reader, settings, 1, 1, 0, name, scene);
      resolve_automatic(reader, scene, nullptr, nullptr, name);
    } else {
      reader.problems.add({reader.file}, "needs image_size_px: [width, height] or micrograph.image");
    }
    config.scene = scene;
    if (use == ConfigUse::plan) config.job.measurements = {micrographs[0]};
  } else if (!view_only) {
    if (!list && signals.empty() && !items[0].image && !image) {
      const Block micrograph{root.find("micrograph"), "micrograph",
                             settings.where.line > 0 ? settings.where : Where{reader.file}};
      if (!micrograph.node || !micrograph.node->find("image")) reader.missing(micrograph, "image");
    }
    // Images are loaded although something else is wrong: their mistakes are reported in the same run.
    const bool sound = reader.problems.empty();
    std::optional<Calibration> calibration;
    if (settings.dark || settings.parallel) calibration = load_calibration(reader, settings);
    std::optional<Mask> user_mask;
    if (settings.mask) {
      try {
        LoadedMask mask = load_mask({reader.resolve(*settings.mask), std::nullopt, "mean", settings.mask_where});
        say(reader, *settings.mask, mask.notes);
        user_mask = std::move(mask.selected);
      } catch (const UserError& error) {
        reader.problems.add(error);
      }
    }
    std::vector<Observable> observables(micrographs.size());
    std::vector<std::vector<Picture>> filled(micrographs.size());
    std::string of_colours;  // the first picture that is one colour of several
    const bool frames_missing = (settings.dark || settings.parallel) && !calibration;
    const bool mask_missing = settings.mask && !user_mask;
    for (std::size_t i = 0; i < items.size(); ++i) {
      const Item& item = items[i];
      Picture& micrograph = micrographs[i];
      if (!item.image && !(image && !list)) continue;
      const bool replaced = image && !list;
      const std::filesystem::path file = replaced ? *image : reader.resolve(*item.image);
      const Where where = replaced ? Where{file.string()} : item.image_where;
      micrograph.name = file.filename().string();
      std::optional<LoadedImage> loaded = has_ring_table(micrograph.scene)
                                              ? load_ring_table(reader, file, where, micrograph.scene, observables[i])
                                              : try_load(reader, image_request(settings, file, item.page, where));
      if (!loaded) continue;
      if (size && (loaded->values.width() != (*size)[0] || loaded->values.height() != (*size)[1]))
        reader.problems.add(root.find("image_size_px")->where,
                            "image_size_px differs from the size of " + micrograph.name + ", " +
                                std::to_string(loaded->values.width()) + " x " +
                                std::to_string(loaded->values.height()),
                            "leave it out");
      set_view(reader, settings, loaded->values.width(), loaded->values.height(), loaded->pixel_size_um,
               micrograph.name, micrograph.scene);
      if (sound) demand_pixel_size(micrograph.scene, loaded->uneven_pixel_um);
      if (frames_missing || mask_missing) continue;
      if (loaded->colour || !settings.mosaic.bayer.empty())
        of_colours = of_colours.empty() ? micrograph.name : of_colours;
      filled[i] = pictures_of(reader, settings, calibration ? &*calibration : nullptr,
                              user_mask ? &*user_mask : nullptr, std::move(*loaded), where, micrograph);
      for (Picture& picture : filled[i]) {
        if (!sound || !reader.problems.empty() || !starts) continue;
        resolve_automatic(reader, picture.scene, &picture.values, &picture.mask, picture.name);
        check_overlap(reader, picture.scene, picture.name);
        check_stressed_disc(reader, picture);
      }
    }
    if (!of_colours.empty() && !shared.scene.microscope.bandwidth_nm)
      reader.warnings.push_back(
          of_colours +
          ": a channel of a colour camera passes light about 100 nm wide, unless a filter or the lamp's "
          "line makes it less; the model takes one wavelength. State microscope.light.bandwidth_nm (1 for "
          "a laser); in white light the intervals do not hold.");
    if (calibration && calibration->has_crossed && settings.offset_automatic) {
      Parameter& offset = reader.table[settings.offset];
      offset.value = calibration->crossed_median;
      offset.prior_sd = calibration->crossed_sd;
    }
    if (!micrographs.empty()) {
      config.scene = filled[0].empty() ? micrographs[0].scene : filled[0][0].scene;
      config.observable = observables[0];
    }
    if (!tables.empty()) config.scene = tables[0].rows[0];
    for (std::size_t i = 0; i < micrographs.size(); ++i) {
      if (filled[i].empty()) filled[i].push_back(std::move(micrographs[i]));
      for (Picture& picture : filled[i]) {
        if (observables[i].quantity != Quantity::ring_radius_cm)
          config.job.measurements.push_back(std::move(picture));
        else if (!picture.mask.empty())
          config.job.measurements.push_back(ring_readings(picture, observables[i]));
      }
    }
    for (Readings& table : tables) config.job.measurements.push_back(std::move(table));
    if (const auto* droplet = std::get_if<Droplet>(&config.scene.sample))
      if (const auto* axial = std::get_if<AxialDirector>(&droplet->director); axial && axial->compare)
        add_branches(config.job);
    if (reader.problems.empty())
      read_prior(reader, root, config.job);
    else if (root.find("prior"))
      reader.block(root, "prior", {"from", "parameters"}, true);
  }
  const YamlNode* sample = root.find("sample");
  if (sample && sample->is_map() && !sample->find("surround") && reader.specs.count("sample.surround.index"))
    config.job.taken_as_exact.push_back(
        "sample.surround is not given: air, an index of 1.0, is taken around the sample.");
  if (std::holds_alternative<Droplet>(config.scene.sample) && !config.scene.microscope.objective_na)
    config.job.taken_as_exact.push_back(
        "microscope.objective_na is not given: every ray that leaves the droplet is "
        "taken to reach the image, and wave optics, which needs it, is left out.");

  if (!reader.problems.empty()) throw_sorted(reader);
  config.job.options.choose_rays = reader.choose_rays;
  config.job.options.max_seconds = reader.max_seconds;
  if (reader.choose_waves) {
    const Theta theta = reader.table.values();
    if (use == ConfigUse::fit) {
      config.job.options.choose_waves = true;
    } else if (const WaveChoice choice = wave_choice(config.scene, theta);
               choice.seconds_an_image <= reader.max_seconds) {
      config.scene.ceiling = Ceiling::wave;
      for_each_scene(config.job.measurements, [](Scene& scene) { scene.ceiling = Ceiling::wave; });
    } else {
      reader.warnings.push_back(choice.words +
                                " Rays are taken instead: physics.max_seconds and ceiling: wave change that.");
    }
  }
  config.job.parameters = std::move(reader.table);
  config.job.warnings = std::move(reader.warnings);
  config.inputs.assign(reader.inputs.begin(), reader.inputs.end());
  return config;
}

}  // namespace

Config load_config(const std::filesystem::path& path, ConfigUse use,
                   const std::optional<std::filesystem::path>& image) {
  std::string text = read_text(path);
  if (use != ConfigUse::fit && holds_series(text)) {
    // What the frames have in common shows in the first.
    const ImageSeries series = read_series(path, std::move(text));
    return load(path, series.text, use, image, &series, 0);
  }
  return load(path, std::move(text), use, image);
}

Config load_frame(const ImageSeries& series, std::size_t frame) {
  return load(series.path, series.text, ConfigUse::fit, std::nullopt, &series, frame);
}

void check_frame(const ImageSeries& series, std::size_t frame) {
  load(series.path, series.text, ConfigUse::fit, std::nullopt, &series, frame, false);
}

}  // namespace birefit
