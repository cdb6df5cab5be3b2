#include "io/config/pictures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include <fmt/format.h>

#include "io/files/array_image.h"
#include "io/images/analyser_sums.h"
#include "io/images/mosaic.h"
#include "medium/references.h"

namespace birefit {
namespace {

/// A frame's pixel whose light is below this fraction of the typical one says nothing about transmission.
constexpr double kLeastLightFraction = 0.05;

/// What is read of a file for the region: two pixels more, by which broken ones at its border are known, from even
/// columns and rows on, where cells of mosaics begin.
std::optional<PixelRect> read_for(const MicrographSettings& settings) {
  if (!settings.roi) return std::nullopt;
  const PixelRect& roi = *settings.roi;
  const auto before = [](int edge) { return std::max(edge - 2, 0) / 2 * 2; };
  return PixelRect{before(roi.x0), before(roi.y0), roi.x1 + 2, roi.y1 + 2};
}

/// The region among the pixels that were read.
PixelRect region_in(const MicrographSettings& settings, const LoadedImage& image) {
  if (!settings.roi) return {0, 0, image.values.width(), image.values.height()};
  const PixelRect& roi = *settings.roi;
  return {roi.x0 - image.x0, roi.y0 - image.y0, roi.x1 - image.x0, roi.y1 - image.y0};
}

bool check_roi(ConfigReader& reader, const MicrographSettings& settings, const LoadedImage& image,
               const std::string& name) {
  if (!settings.roi) return true;
  const PixelRect& roi = *settings.roi;
  if (roi.x0 >= 0 && roi.y0 >= 0 && roi.x1 <= image.width && roi.y1 <= image.height) return true;
  reader.problems.add(settings.roi_where, "roi_px = [" + std::to_string(roi.x0) + ", " + std::to_string(roi.y0) + ", " +
                                              std::to_string(roi.x1) + ", " + std::to_string(roi.y1) +
                                              "] reaches outside " + name + ", which is " +
                                              std::to_string(image.width) + " x " + std::to_string(image.height) +
                                              " pixels");
  return false;
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

/// Why a pixel is left out: the first reason that applies counts.
enum class Left : std::uint8_t { not_of_part, masked, non_finite, saturated, dead, used };

/// The picture of a region of the file, `bin` x `bin` of its pixels each: their mean, used where all of them are. What
/// goes on alone behind the last whole one is left out.
void take_region(const LoadedImage& image, const Image& variance_scale, const Grid<Left>& left, const PixelRect& area,
                 int bin, Picture& picture) {
  const int width = area.width() / bin, height = area.height() / bin;
  picture.values = Image(width, height);
  picture.mask = Mask(width, height, 0);
  if (!variance_scale.empty()) picture.variance_scale = Image(width, height, 0);
  int of_part = 0;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      Left why = Left::used;
      double sum = 0, scales = 0;
      for (int j = 0; j < bin; ++j)
        for (int i = 0; i < bin; ++i) {
          const int column = area.x0 + bin * x + i, row = area.y0 + bin * y + j;
          why = std::min(why, left(column, row));
          sum += image.values(column, row);
          if (!variance_scale.empty()) scales += variance_scale(column, row);
        }
      picture.values(x, y) = sum / (bin * bin);
      if (!variance_scale.empty()) picture.variance_scale(x, y) = scales / (bin * bin);
      picture.mask(x, y) = why == Left::used;
      of_part += why != Left::not_of_part;
      picture.masked_by_user += why == Left::masked;
      picture.non_finite += why == Left::non_finite;
      picture.saturated += why == Left::saturated;
      picture.dead += why == Left::dead;
    }
  const double share = static_cast<double>(of_part) / (static_cast<double>(width) * height);
  picture.outside_roi = static_cast<int>(
      std::lround(share * (static_cast<double>(image.width / bin) * (image.height / bin) - 1.0 * width * height)));
}

/// The light of one code, on the scale of the codes.
double linear(double code, const Transfer& transfer, double top_code) {
  Image one(1, 1, code);
  linearise(one, transfer, top_code);
  return one(0, 0);
}

/// So many of the pixels at an end of the codes are no single hot or dead ones.
constexpr double kManyAtAnEnd = 0.005;
double share_of(const Mask& mask, const PixelRect& area) {
  double count = 0;
  for (int y = area.y0; y < area.y1; ++y)
    for (int x = area.x0; x < area.x1; ++x) count += mask(x, y) != 0;
  return count / std::max(1.0, static_cast<double>(area.width()) * area.height());
}

/// Counts of 8 bits and of 16 differ by a factor of 256 as a rule, and a dark frame is subtracted.
void compare_counts(ConfigReader& reader, int dark_bits, const LoadedImage& image, const std::string& name,
                    const Where& where) {
  const int bits = image.top_code > 0 ? image.bits : 0;
  if (dark_bits == 0 || bits == 0 || bits == dark_bits) return;
  reader.problems.add(
      where, fmt::format("{} has counts of {} bits, the dark frame that is subtracted has {}", name, bits, dark_bits),
      "save both as the camera had them, in one type; or as floats, if their scales are equal");
}

/// Values, mask and the reasons for exclusion; false when a problem left nothing to work with. Of a mosaic only the
/// pixels of a `part`.
bool fill_pixels(ConfigReader& reader, const MicrographSettings& settings, const Calibration* calibration,
                 const LoadedMask* user_mask, const MosaicPart* part, LoadedImage image, const Where& where,
                 Picture& micrograph) {
  const std::string& name = micrograph.name;
  const std::size_t problems_before = reader.problems.all().size();
  check_roi(reader, settings, image, name);
  const auto other_size = [&](int other_width, int other_height, const std::string& what, const Where& place) {
    if (other_width == image.width && other_height == image.height) return;
    reader.problems.add(place, what + " is " + std::to_string(other_width) + " x " + std::to_string(other_height) +
                                   " pixels, " + name + " is " + std::to_string(image.width) + " x " +
                                   std::to_string(image.height));
  };
  if (user_mask) other_size(user_mask->width, user_mask->height, *settings.mask, settings.mask_where);
  if (calibration) {
    other_size(calibration->width, calibration->height, calibration->name, calibration->where);
    compare_counts(reader, calibration->dark_bits, image, name, where);
  }
  const PixelRect area = region_in(settings, image);
  if (std::min(area.width(), area.height()) < settings.bin)
    reader.problems.add(settings.bin_where, fmt::format("bin = {} is more than the {} x {} pixels of {}", settings.bin,
                                                        area.width(), area.height(), name));
  if (reader.problems.all().size() > problems_before) return false;

  const int width = image.values.width(), height = image.values.height();
  const Saturation saturation = find_saturation(image, area, settings.saturation_counts);
  if (saturation.pile_up)
    reader.warnings.push_back(name + ": " + std::to_string(saturation.pile_up_pixels) + " pixels pile up at " +
                              show(saturation.from) + " counts, below the file's top code of " + show(image.top_code) +
                              "; they are taken as saturated (saturation_counts sets the limit).");
  Mask saturated(width, height, 0);
  mark_saturated(image.values, saturation.from, saturated);
  const double step = smallest_step(image);
  const bool codes = image.top_code > 0 && settings.mosaic.parts.empty();
  if (const auto cut = codes ? find_cut_end(End::lowest, image.values, area) : std::nullopt) {
    reader.warnings.push_back(fmt::format(
        "{}: {:.2g} % of the pixels sit at the lowest code, {:g}: the black was cut off, by a background that "
        "was subtracted or a contrast that was stretched. Their mean is not that of the light: take "
        "pictures with a black level above the noise, or mask what is dark.",
        name, 100 * cut->share, cut->code));
    // Calibrated, pixels have an end each.
    if (!calibration) micrograph.cut_below = linear(cut->code, settings.transfer, image.top_code);
  }
  if (codes && !calibration && share_of(saturated, area) > kManyAtAnEnd)
    micrograph.cut_above = linear(saturation.from, settings.transfer, image.top_code);
  linearise(image.values, settings.transfer, image.top_code);

  Grid<Left> left(width, height, Left::not_of_part);
  Mask usable(width, height, 0);
  for (int y = area.y0; y < area.y1; ++y) {
    for (int x = area.x0; x < area.x1; ++x) {
      if (part && ((x - part->x0) % 2 != 0 || (y - part->y0) % 2 != 0)) continue;
      left(x, y) = user_mask && !user_mask->selected(x, y)                            ? Left::masked
                   : !std::isfinite(image.values(x, y))                               ? Left::non_finite
                   : saturated(x, y) || (calibration && calibration->saturated(x, y)) ? Left::saturated
                   : calibration && !calibration->usable(x, y)                        ? Left::dead
                                                                                      : Left::used;
      usable(x, y) = left(x, y) == Left::used;
    }
  }
  // What opens the libraries that find specks, longer than all else takes, only where a fit may follow.
  if (reader.problems.empty()) exclude_outliers(image.values, area, step, Smoothness::image, usable);
  for (std::size_t i = 0; i < left.size(); ++i)
    if (left.values()[i] == Left::used && !usable.values()[i]) left.values()[i] = Left::dead;

  Image variance_scale;
  if (calibration) {
    const bool subtract = !calibration->dark.empty(), divide = !calibration->light.empty();
    if (divide) variance_scale = Image(width, height, 0);
    for (std::size_t i = 0; i < image.values.size(); ++i) {
      double& value = image.values.values()[i];
      if (!usable.values()[i]) {
        value = std::numeric_limits<double>::quiet_NaN();
        continue;
      }
      if (subtract) value -= calibration->dark.values()[i];
      if (!divide) continue;
      const double light = calibration->light.values()[i];
      value /= light;
      variance_scale.values()[i] = 1 / (light * light);
    }
  }
  take_region(image, variance_scale, left, area, settings.bin, micrograph);
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

/// A mosaic that the config does not know of: reported.
bool is_unstated_mosaic(ConfigReader& reader, const MicrographSettings& settings, const LoadedImage& image,
                        const Where& where, const std::string& name) {
  if (settings.mosaic.not_looked_for || image.colour) return false;
  // Frames with and without light take off what a camera's pixels have of their own, and a camera that was calibrated
  // so is none with a mosaic: its columns and rows may differ by as much.
  if (settings.calibrated()) return false;
  PixelRect area = region_in(settings, image);
  area.x1 = std::min(area.x1, image.values.width()), area.y1 = std::min(area.y1, image.values.height());
  if (area.x0 < 0 || area.y0 < 0 || area.width() <= 0 || area.height() <= 0) return false;  // reported
  const auto kind = find_mosaic(image.values, area, smallest_step(image));
  if (!kind) return false;
  reader.problems.add(where, name + ": pixels alternate in cells of 2 x 2: a " + *kind + " mosaic",
                      "add `bayer: rggb` (or bggr, grbg, gbrg) and `channel: g`, or `mosaic: polarization`; `mosaic: "
                      "none` takes the pixels as they are");
  return true;
}

/// Codes of a polarization mosaic that do not follow light: said, with the transfer that would make them. Of a file
/// with codes alone: a program that wrote floats has done what it meant to.
void check_analyser_sums(ConfigReader& reader, const MicrographSettings& settings, const LoadedImage& image,
                         const std::string& name) {
  std::array<std::array<double, 2>, 2> angle{};
  for (const MosaicPart& part : settings.mosaic.parts) {
    if (!part.analyzer_deg) return;
    angle[static_cast<std::size_t>(part.y0)][static_cast<std::size_t>(part.x0)] = *part.analyzer_deg;
  }
  if (!(image.top_code > 0) || settings.calibrated()) return;
  const PixelRect area = region_in(settings, image);
  const double saturated = find_saturation(image, area, settings.saturation_counts).from;
  Mask usable(image.values.width(), image.values.height(), 0);
  for (std::size_t i = 0; i < usable.size(); ++i) usable.values()[i] = image.values.values()[i] < saturated;
  Image light = image.values;
  linearise(light, settings.transfer, image.top_code);
  for (double& value : light.values()) value /= image.top_code;
  const std::optional<AnalyserSums> sums = analyser_sums(light, usable, area, angle);
  constexpr double kErrors = 3, kLeast = 0.05;
  if (!sums || std::abs(sums->gamma - 1) < std::max(kErrors * sums->error, kLeast)) return;
  const Transfer& transfer = settings.transfer;
  const bool linear = transfer.kind == Transfer::Kind::linear, power = transfer.kind == Transfer::Kind::gamma;
  const double before = power ? transfer.gamma : 1;
  std::string text = fmt::format(
      "{}: what two crossed analysers let through together differs between the two pairs of each cell by {:.2g} % "
      "where "
      "light is polarized, and must not: {} not proportional to light.",
      name, 100 * sums->mismatch, linear ? "the codes are" : "after micrograph.transfer the values are");
  if (linear || power)
    text += fmt::format(" Of light = code^{0:.2f} (+- {1:.2f}) the pairs agree: transfer: {{gamma: {0:.2f}}}.",
                        before * sums->gamma, before * sums->error);
  reader.warnings.push_back(text);
}

}  // namespace

void say(ConfigReader& reader, const std::filesystem::path& file, const std::vector<std::string>& notes) {
  for (const std::string& note : notes) {
    const std::string words = file.filename().string() + ": " + note;
    // A file of several colours is read once for each.
    if (std::find(reader.warnings.begin(), reader.warnings.end(), words) == reader.warnings.end())
      reader.warnings.push_back(words);
  }
}

std::optional<LoadedImage> try_load(ConfigReader& reader, const MicrographSettings& settings,
                                    const std::filesystem::path& file, PageChoice page, const Where& where) {
  if (!reader.image_in_memory(file) && !settle_page(reader, file, page)) return std::nullopt;
  ImageRequest request{file, page.number, settings.channel, where};
  request.cells = !settings.mosaic.parts.empty();
  if (reader.use != ConfigUse::render) request.region = read_for(settings);
  try {
    const ArrayImage* array = reader.image_in_memory(file);
    LoadedImage image = array ? load_array(request, *array) : load_image(request);
    say(reader, request.path, image.notes);
    return image;
  } catch (const UserError& error) {
    reader.problems.add(error);
    return std::nullopt;
  }
}

/// Pixels of the bright frame at its end, and those that noise may have kept from it: left out. False, with a problem,
/// where next to all are.
bool leave_out_clipped(ConfigReader& reader, const std::string& name, const Where& where, const Image& values,
                       const PixelRect& area, std::optional<double> noise_of_dark, Mask& clipped) {
  constexpr double kNextToAll = 0.9, kNoise = 3;  // standard deviations
  const std::optional<CutEnd> cut = find_cut_end(End::highest, values, area, noise_of_dark);
  if (!cut) return true;
  const std::string found = fmt::format(
      "{}: {:.3g} % of the pixels sit at {:g}, the highest code of the frame, where others "
      "scatter: it is clipped",
      name, 100 * cut->share, cut->code);
  const char* help = "take it with less light, or a shorter exposure of all frames";
  if (cut->share > kNextToAll) {
    reader.problems.add(where, found, help);
    return false;
  }
  reader.warnings.push_back(found + " and left out there; " + help + ".");
  const std::optional<double> own = noise_of_neighbours(values, area, cut->code);
  mark_saturated(values, cut->code - kNoise * (own ? *own : noise_of_dark.value_or(0)), clipped);
  return true;
}

std::optional<Calibration> load_calibration(ConfigReader& reader, const MicrographSettings& settings) {
  struct Frame {
    const std::optional<std::string>& name;
    const Where& where;
    std::optional<LoadedImage> image;
  };
  Frame dark{settings.dark, settings.dark_where, {}}, bright{settings.light, settings.light_where, {}},
      crossed{settings.crossed, settings.crossed_where, {}};
  Frame* first = nullptr;
  const std::size_t before = reader.problems.all().size();
  for (Frame* frame : {&dark, &bright, &crossed}) {
    if (!frame->name) continue;
    frame->image = try_load(reader, settings, reader.resolve(*frame->name), {}, frame->where);
    if (!frame->image) continue;
    if (!first) first = frame;
    const LoadedImage &image = *frame->image, &other = *first->image;
    if (image.width != other.width || image.height != other.height)
      reader.problems.add(frame->where, *frame->name + " is " + std::to_string(image.width) + " x " +
                                            std::to_string(image.height) + " pixels, " + *first->name + " is " +
                                            std::to_string(other.width) + " x " + std::to_string(other.height));
  }
  const int dark_bits = dark.image && dark.image->top_code > 0 ? dark.image->bits : 0;
  for (const Frame* frame : {&bright, &crossed})
    if (frame->image) compare_counts(reader, dark_bits, *frame->image, *frame->name, frame->where);
  if (!first || reader.problems.all().size() > before) return std::nullopt;
  const Image& size = first->image->values;
  if (!check_roi(reader, settings, *first->image, *first->name)) return std::nullopt;

  const PixelRect area = region_in(settings, *first->image);
  Calibration calibration;
  calibration.width = first->image->width, calibration.height = first->image->height;
  calibration.name = *first->name, calibration.where = first->where;
  calibration.dark_bits = dark_bits;
  calibration.usable = Mask(size.width(), size.height(), 1);
  calibration.saturated = Mask(size.width(), size.height(), 0);
  const auto noise_of_dark = dark.image ? noise_of_neighbours(dark.image->values, area) : std::nullopt;
  for (std::optional<LoadedImage>* frame_image : {&dark.image, &bright.image, &crossed.image}) {
    if (!*frame_image) continue;
    LoadedImage* frame = &**frame_image;
    // Neighbours of a mosaic see other things: their differences are no noise.
    if (frame_image == &bright.image && frame->top_code > 0 && settings.mosaic.parts.empty() &&
        !leave_out_clipped(reader, *bright.name, bright.where, frame->values, area, noise_of_dark,
                           calibration.saturated))
      return std::nullopt;
    // The frames come from one camera: the code at which one saturates is the code for all.
    mark_saturated(frame->values, find_saturation(*frame, area, settings.saturation_counts).from,
                   calibration.saturated);
    const double step = smallest_step(*frame);
    linearise(frame->values, settings.transfer, frame->top_code);
    for (std::size_t i = 0; i < frame->values.size(); ++i)
      if (!std::isfinite(frame->values.values()[i]) || calibration.saturated.values()[i])
        calibration.usable.values()[i] = 0;
    const auto leave_out = [&](Smoothness smoothness, Mask& usable) {
      return settings.mosaic.parts.empty() ? exclude_outliers(frame->values, area, step, smoothness, usable)
                                           : exclude_outliers_in_cells(frame->values, area, step, smoothness, usable);
    };
    // A frame that was smoothed has no noise for its own slopes to be told from: so many are no defects.
    constexpr double kMostDefects = 0.02;
    Mask usable = calibration.usable;
    if (leave_out(Smoothness::frame, usable) > kMostDefects * area.width() * area.height()) {
      usable = calibration.usable;
      leave_out(Smoothness::image, usable);
    }
    calibration.usable = std::move(usable);
  }

  if (dark.image) calibration.dark = dark.image->values;
  if (!bright.image) return calibration;
  calibration.light = bright.image->values;
  if (dark.image)
    for (std::size_t i = 0; i < calibration.light.size(); ++i)
      calibration.light.values()[i] -= calibration.dark.values()[i];
  Mask positive = calibration.usable;
  for (std::size_t i = 0; i < positive.size(); ++i)
    if (!(calibration.light.values()[i] > 0)) positive.values()[i] = 0;
  const RobustSpread typical = robust_spread(calibration.light, positive, area);
  if (typical.count == 0) {
    reader.problems.add(bright.where, *bright.name + " is nowhere brighter than " + (dark.name ? *dark.name : "0"),
                        dark.name ? "were the two exchanged?" : "");
    return std::nullopt;
  }
  for (std::size_t i = 0; i < calibration.light.size(); ++i)
    if (!(calibration.light.values()[i] > kLeastLightFraction * typical.median)) calibration.usable.values()[i] = 0;

  if (crossed.image && dark.image) {  // without a dark one a mistake was reported
    Image transmission = crossed.image->values;
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

std::optional<LoadedMask> load_user_mask(ConfigReader& reader, const MicrographSettings& settings) {
  if (!settings.mask) return std::nullopt;
  try {
    ImageRequest request{reader.resolve(*settings.mask), std::nullopt, "mean", settings.mask_where};
    request.region = read_for(settings);
    const ArrayImage* array = reader.image_in_memory(request.path);
    LoadedMask mask = load_mask(
        request, [&](const ImageRequest& asked) { return array ? load_array(asked, *array) : load_image(asked); });
    say(reader, *settings.mask, mask.notes);
    return mask;
  } catch (const UserError& error) {
    reader.problems.add(error);
    return std::nullopt;
  }
}

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

std::vector<Picture> pictures_of(ConfigReader& reader, const MicrographSettings& settings,
                                 const Calibration* calibration, const LoadedMask* user_mask, LoadedImage image,
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
  check_analyser_sums(reader, settings, image, micrograph.name);
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

}  // namespace birefit
