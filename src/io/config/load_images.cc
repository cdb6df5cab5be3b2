// What the images of a config tell, and what is made of them.

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "core/printable.h"
#include "core/robust.h"
#include "io/config/disc.h"
#include "io/config/fit.h"
#include "io/config/light.h"
#include "io/config/loading.h"
#include "io/config/metadata.h"
#include "io/config/mosaic.h"
#include "io/config/rings.h"
#include "io/config/scene.h"
#include "io/config/starts.h"

namespace birefit {
namespace {

/// Does an image of this size have the region, and a pixel of it?
bool fits_in(const MicrographSettings& settings, const std::array<int, 2>& size) {
  const PixelRect roi = settings.roi.value_or(PixelRect{0, 0, size[0], size[1]});
  return roi.x0 >= 0 && roi.y0 >= 0 && roi.x1 <= size[0] && roi.y1 <= size[1] &&
         std::min(roi.width(), roi.height()) >= settings.bin;
}

/// Range and scatter of a picture's used pixels; nothing of few, or of a table of rings.
struct Codes {
  double low = 0, high = 0, sd = 0;
};
std::optional<Codes> codes_of(const Picture& picture) {
  constexpr double kFewest = 50;
  double n = 0, sum = 0, squares = 0;
  Codes codes{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity(), 0};
  for (std::size_t i = 0; i < picture.values.size() && i < picture.mask.size(); ++i) {
    const double value = picture.values.values()[i];
    if (!picture.mask.values()[i] || !std::isfinite(value)) continue;
    codes.low = std::min(codes.low, value), codes.high = std::max(codes.high, value);
    n += 1, sum += value, squares += value * value;
  }
  if (n < kFewest) return std::nullopt;
  codes.sd = std::sqrt(std::max(0.0, squares / n - sum / n * sum / n));
  return codes;
}

/// A picture of one single value, as bright as any of the others, of which most scatter, is where the camera ends.
void refuse_clipped(ConfigReader& reader, const std::vector<const Picture*>& pictures,
                    const std::vector<Where>& where) {
  constexpr std::size_t kFewest = 3;  // else there are no other pictures to tell by
  if (pictures.size() < kFewest) return;
  std::vector<double> scatter;
  double brightest = -std::numeric_limits<double>::infinity();
  for (const Picture* picture : pictures)
    if (const std::optional<Codes> codes = codes_of(*picture))
      scatter.push_back(codes->sd), brightest = std::max(brightest, codes->high);
  constexpr double kCode = 1;
  if (scatter.size() < kFewest || median(scatter) < kCode) return;
  for (std::size_t i = 0; i < pictures.size(); ++i)
    if (const std::optional<Codes> codes = codes_of(*pictures[i]);
        codes && codes->low == codes->high && codes->high == brightest)
      reader.problems.add(where[i],
                          fmt::format("{}: all of its pixels are {:.6g} counts, as bright as any, while other pictures "
                                      "scatter: it is saturated",
                                      pictures[i]->name, codes->high),
                          "leave this picture out, or take it with a shorter exposure");
}

}  // namespace

void Loading::demand_pixel_size(const Scene& scene, const std::array<double, 2>& uneven_um) {
  const bool needed = std::holds_alternative<Droplet>(shared_.scene.sample) ||
                      std::holds_alternative<StressedDisc>(shared_.scene.sample) ||
                      std::holds_alternative<SampledVolume>(shared_.scene.sample);
  if (!needed || scene.view.pixel_size_um || !reader_.problems.empty()) return;
  const Where where = settings_.where.line > 0 ? settings_.where : Where{reader_.file};
  if (uneven_um[0] > 0)
    reader_.problems.add(where,
                         "the file states pixels of " + not_square(uneven_um[0], uneven_um[1]) +
                             ": they are not square, which is not modelled",
                         "resample the image to square pixels (ImageJ: Image > Scale), or state pixel_size_um if the "
                         "file is wrong");
  else
    reader_.problems.add(where, "micrograph needs pixel_size_um: the image does not state it",
                         "the size of a pixel on the sample, for example 0.05");
}

void Loading::take_view() {
  Scene& scene = micrographs_[0].scene;
  if (own_analyzers_ && !settings_.mosaic.parts.empty()) {
    reader_.table[scene.microscope.analyzer_deg].value = *settings_.mosaic.parts[0].analyzer_deg;
    reader_.warnings.push_back("Of a polarization mosaic the picture behind its first analyser is shown, at " +
                               settings_.mosaic.parts[0].name + ".");
  }
  const Item& item = items_[0];
  const std::string name = item.image.value_or("the image");
  if (asked_.use == ConfigUse::render && list_ && items_.size() > 1)
    reader_.warnings.push_back(
        fmt::format("Of {} micrographs the first is shown, {}, with what is set for it.", items_.size(), name));
  if (size_) {
    set_view(reader_, (*size_)[0], (*size_)[1], 0, name, scene);
    demand_pixel_size(scene);
    if (asked_.use == ConfigUse::plan && fits_in(settings_, *size_)) take_part(settings_, scene);
    resolve_automatic(reader_, scene, nullptr, nullptr, name);
    if (reader_.problems.empty()) check_overlap(reader_, scene, "the image");
  } else if (asked_.image || item.image) {
    take_view_of_image(item, name, scene);
  } else if (root_.find("image_size_px")) {
    // Its mistake was reported.
  } else if (!scene.microscope.directions.empty()) {
    set_view(reader_, 1, 1, 0, name, scene);
    resolve_automatic(reader_, scene, nullptr, nullptr, name);
  } else {
    reader_.problems.add({reader_.file}, "needs image_size_px: [width, height] or micrograph.image");
  }
  config_.scene = scene;
  for (std::size_t c = 0; c < channels_.size(); ++c) {
    Scene& of_channel = micrographs_[c].scene;
    const ParameterRef own_size = of_channel.view.pixel_size_um;
    of_channel.view = scene.view;
    if (own_size && settings_.channels.count(channels_[c].channel)) of_channel.view.pixel_size_um = own_size;
    if (channels_.size() > 1) config_.colours.push_back(of_channel);
    if (asked_.use == ConfigUse::plan) config_.job.measurements.push_back(micrographs_[c]);
  }
}

void Loading::take_view_of_image(const Item& item, const std::string& name, Scene& scene) {
  const std::filesystem::path file = asked_.image ? *asked_.image : reader_.resolve(*item.image);
  const Where where = asked_.image ? Where{asked_.image->string()} : item.image_where;
  const std::optional<LoadedImage> loaded = has_ring_table(scene)
                                                ? load_ring_table(reader_, file, where, scene, config_.observable)
                                                : try_load(reader_, channels_[0], file, item.page, where);
  if (!loaded) {
    if (asked_.series && sound_) throw FrameError(reader_.problems.all());
    return;
  }
  set_view(reader_, loaded->width, loaded->height, loaded->pixel_size_um, name, scene);
  compare_metadata(reader_, *loaded, name, where, settings_.metadata_ignored, scene);
  demand_pixel_size(scene, loaded->uneven_pixel_um);
  if (!reader_.problems.empty()) return;
  Mask all(loaded->values.width(), loaded->values.height(), 1);
  for (std::size_t i = 0; i < all.size(); ++i) all.values()[i] = std::isfinite(loaded->values.values()[i]);
  resolve_automatic(reader_, scene, &loaded->values, &all, name);
  check_overlap(reader_, scene, name);
}

Loading::Beside Loading::load_beside() {
  Beside beside;
  beside.calibrations.resize(channels_.size());
  for (std::size_t c = 0; c < channels_.size(); ++c)
    if (settings_.calibrated() && signals_.empty()) beside.calibrations[c] = load_calibration(reader_, channels_[c]);
  if (signals_.empty()) beside.mask = load_user_mask(reader_, settings_);  // tables have read theirs
  const bool frames =
      std::all_of(beside.calibrations.begin(), beside.calibrations.end(), [](const auto& c) { return c.has_value(); });
  beside.missing = (settings_.calibrated() && !frames) || (settings_.mask && !beside.mask);
  return beside;
}

std::string Loading::name_of(const Item& item, const MicrographSettings& own, const std::filesystem::path& file) const {
  return printable(file.filename().string()) + (item.page.given() && list_ ? " (" + item.page.words() + ")" : "") +
         (item.roi ? fmt::format(" [{}, {}, {}, {}]", item.roi->x0, item.roi->y0, item.roi->x1, item.roi->y1) : "") +
         (channels_.size() > 1 && own.mosaic.parts.empty() ? " (" + own.channel + ")" : "");
}

void Loading::take_image(std::size_t i, const Beside& beside, Taken& taken) {
  const Item& item = items_[i / channels_.size()];
  MicrographSettings own = channels_[i % channels_.size()];
  if (item.roi) own.roi = item.roi, own.roi_where = item.roi_where;
  if (item.roi && (settings_.calibrated() || settings_.mask)) {
    reader_.problems.add(item.roi_where, "a region of its own is given beside calibration frames or a mask",
                         "crop image, frames and mask alike, or give all images the same roi_px");
    return;
  }
  Picture& micrograph = micrographs_[i];
  const bool replaced = asked_.image && !list_;
  if (!item.image && !replaced) return;
  const std::filesystem::path file = replaced ? *asked_.image : reader_.resolve(*item.image);
  const Where where = replaced ? Where{file.string()} : item.image_where;
  micrograph.name = name_of(item, own, file);
  const bool rings = has_ring_table(micrograph.scene);
  std::optional<LoadedImage> loaded =
      rings ? load_ring_table(reader_, file, where, micrograph.scene, taken.observables[i])
            : try_load(reader_, own, file, item.page, where);
  if (!loaded) return;
  if (size_ && (loaded->width != (*size_)[0] || loaded->height != (*size_)[1]))
    reader_.problems.add(root_.find("image_size_px")->where,
                         "image_size_px differs from the size of " + micrograph.name + ", " +
                             std::to_string(loaded->width) + " x " + std::to_string(loaded->height),
                         "leave it out");
  set_view(reader_, loaded->width, loaded->height, loaded->pixel_size_um, micrograph.name, micrograph.scene);
  if (i % channels_.size() == 0)
    compare_metadata(reader_, *loaded, micrograph.name, where, settings_.metadata_ignored, micrograph.scene);
  if (sound_) demand_pixel_size(micrograph.scene, loaded->uneven_pixel_um);
  if (!rings) {
    if (!own.roi) set_electrodes(reader_, {0, 0, loaded->width, loaded->height}, micrograph.scene);
    take_part(own, micrograph.scene);
  } else if (settings_.roi || settings_.bin > 1) {
    reader_.problems.add(settings_.roi ? settings_.roi_where : settings_.bin_where,
                         "a table of rings has no pixels to choose from or to bin", "leave roi_px and bin out");
    return;
  }
  if (beside.missing) return;
  const YamlNode* block = root_.find("micrograph");
  const bool transfer_stated = block && block->find("transfer");
  if ((loaded->colour || !settings_.mosaic.bayer.empty()) && !micrograph.scene.microscope.channel_light)
    taken.of_colours = taken.of_colours.empty() ? micrograph.name : taken.of_colours;
  if (loaded->colour && loaded->bits == 8 && !transfer_stated && taken.of_codes.empty())
    taken.of_codes = micrograph.name;
  const std::optional<Calibration>& calibration = beside.calibrations[i % channels_.size()];
  taken.filled[i] = pictures_of(reader_, own, calibration ? &*calibration : nullptr,
                                beside.mask ? &*beside.mask : nullptr, std::move(*loaded), where, micrograph);
}

void Loading::take_images() {
  if (!list_ && signals_.empty() && !items_[0].image && !asked_.image) {
    const Block micrograph{root_.find("micrograph"), "micrograph",
                           settings_.where.line > 0 ? settings_.where : Where{reader_.file}};
    if (!micrograph.node || !micrograph.node->find("image")) reader_.missing(micrograph, "image");
  }
  // One picture that counts as two halves the variance of what it tells.
  std::set<std::tuple<std::string, std::string, std::array<int, 4>>> listed;
  for (const Item& item : items_) {
    if (!list_ || !item.image) continue;
    const PixelRect roi = item.roi.value_or(PixelRect{});
    if (!listed
             .emplace(reader_.resolve(*item.image).lexically_normal().string(), item.page.words(),
                      std::array{roi.x0, roi.y0, roi.x1, roi.y1})
             .second)
      reader_.problems.add(item.image_where, *item.image + " is listed twice: it is one measurement",
                           "leave one out, or give each a page or roi_px of its own");
  }
  // Images are loaded although something else is wrong: their mistakes are reported in the same run.
  const Beside beside = load_beside();
  Taken taken;
  taken.observables.resize(micrographs_.size());
  taken.filled.resize(micrographs_.size());
  for (std::size_t i = 0; i < micrographs_.size(); ++i) take_image(i, beside, taken);
  // A frame's own mistake, with which the others of its series have nothing to do.
  if (asked_.series && sound_ && !beside.missing && !reader_.problems.empty()) throw FrameError(reader_.problems.all());
  std::vector<const Picture*> read;
  std::vector<Where> read_from;
  for (std::size_t i = 0; i < taken.filled.size(); ++i)
    for (const Picture& picture : taken.filled[i])
      read.push_back(&picture), read_from.push_back(items_[i / channels_.size()].image_where);
  refuse_clipped(reader_, read, read_from);
  for (std::vector<Picture>& pictures : taken.filled)
    for (Picture& picture : pictures) find_starts(picture);
  warn_of_colours(taken);
  for (std::size_t c = 0; c < channels_.size() && settings_.offset_automatic; ++c) {
    if (!beside.calibrations[c] || !beside.calibrations[c]->has_crossed) continue;
    Parameter& offset = reader_.table[channels_.size() == 1 ? settings_.offset : micrographs_[c].offset];
    offset.value = beside.calibrations[c]->crossed_median;
    offset.prior_sd = beside.calibrations[c]->crossed_sd;
  }
  make_measurements(taken);
  if (const auto* droplet = std::get_if<Droplet>(&config_.scene.sample))
    if (const auto* axial = std::get_if<AxialDirector>(&droplet->director); axial && axial->compare)
      add_branches(config_.job);
  if (reader_.problems.empty())
    read_prior(reader_, root_, config_.job);
  else if (root_.find("prior"))
    reader_.block(root_, "prior", {"from", "parameters"}, true);
}

void Loading::find_starts(Picture& picture) {
  if (!sound_ || !reader_.problems.empty() || !asked_.starts) return;
  const auto used = [&] { return std::count(picture.mask.values().begin(), picture.mask.values().end(), 1); };
  const auto before = used();
  resolve_automatic(reader_, picture.scene, &picture.values, &picture.mask, picture.name);
  refresh_ties(reader_);
  picture.outside_roi += static_cast<int>(before - used());  // other discs than the one that is meant
  check_overlap(reader_, picture.scene, picture.name);
  check_stressed_disc(reader_, picture);
}

void Loading::warn_of_colours(const Taken& taken) {
  if (!taken.of_colours.empty() && !shared_.scene.microscope.bandwidth_nm) {
    reader_.warnings.push_back(
        taken.of_colours +
        ": a channel of a colour camera passes light about 100 nm wide, unless a filter or the lamp's "
        "line makes it less; the model takes one wavelength. State microscope.light.bandwidth_nm (1 for "
        "a laser), or the lamp, light: {lamp: A}, and the camera; else the intervals do not hold.");
    reader_.misfit.push_back(taken.of_colours + " is a colour camera's channel, whose light is no single wavelength");
  }
  if (!taken.of_codes.empty())
    reader_.warnings.push_back(taken.of_codes +
                               ": colours of 8 bits are sRGB codes as a rule, which are no measure of light; they are "
                               "taken as linear. State micrograph.transfer: srgb, or linear.");
}

void Loading::make_measurements(Taken& taken) {
  if (!micrographs_.empty()) {
    config_.scene = taken.filled[0].empty() ? micrographs_[0].scene : taken.filled[0][0].scene;
    config_.observable = taken.observables[0];
  }
  if (!tables_.empty()) config_.scene = tables_[0].rows[0];
  for (std::size_t i = 0; i < micrographs_.size(); ++i) {
    if (taken.filled[i].empty()) taken.filled[i].push_back(std::move(micrographs_[i]));
    for (Picture& picture : taken.filled[i]) {
      if (taken.observables[i].quantity != Quantity::ring_radius_cm)
        config_.job.measurements.push_back(std::move(picture));
      else if (!picture.mask.empty())
        config_.job.measurements.push_back(ring_readings(picture, taken.observables[i]));
    }
  }
  for (Readings& table : tables_) config_.job.measurements.push_back(std::move(table));
}

}  // namespace birefit
