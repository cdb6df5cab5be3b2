#include "io/config/starts.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "birefit/volume.h"
#include "io/config/described.h"
#include "io/config/discs.h"

namespace birefit {
namespace {

/// Below this find_disc saw no disc (DiscGuess::contrast).
constexpr double kLeastDiscContrast = 3;
/// Half-width of the bounds of an automatic centre, as a fraction of the image size.
constexpr double kCenterBoundFraction = 0.15;

/// What a scene has of a parameter.
double in_scene(const ConfigReader& reader, ParameterRef ref) { return ref.times * reader.table[ref].value + ref.plus; }

/// 0: not known.
double pixel_um(const ConfigReader& reader, const View& view) {
  return view.pixel_size_um ? in_scene(reader, view.pixel_size_um) : 0;
}

/// The pixel size that a file states; one number for all files that state the same.
ParameterRef stated_in_file(ConfigReader& reader, double file_pixel_um) {
  const std::string path = "micrograph.pixel_size_um";
  for (int i = 0; i < reader.table.size(); ++i)
    if (reader.table[i].name == path && reader.table[i].value == file_pixel_um) return {i};
  return reader.constant(path, described<View>("pixel_size_um"), file_pixel_um);
}

double distance(const DiscGuess& a, const DiscGuess& b) {
  return std::hypot(a.center_x_px - b.center_x_px, a.center_y_px - b.center_y_px);
}

std::string describe(const DiscGuess& disc, const View& view, double pixel) {
  const auto& [x0, y0, bin, width, height] = view.file;
  const auto in_file = [bin = bin](double at, int first) { return bin * (at + 0.5) - 0.5 + first; };
  return fmt::format("{:.3g} um at ({:.0f}, {:.0f})", 2 * disc.radius_px * pixel, in_file(disc.center_x_px, x0),
                     in_file(disc.center_y_px, y0));
}

/// Of several discs in the picture the one that the config means: around the centre that is stated, else of a size
/// within the bounds, of these nearest to where the diameter starts. The others' pixels are left out. Nothing where
/// there is one disc, or none is meant, which is said where no centre is stated.
std::optional<DiscGuess> disc_meant(ConfigReader& reader, const Scene& scene, const Parameter& diameter,
                                    const std::optional<DiscGuess>& stated, const Image& values, Mask& mask,
                                    const std::string& name) {
  constexpr double kRim = 1.4;
  const double pixel = pixel_um(reader, scene.view);
  if (!(pixel > 0) || !std::isfinite(diameter.value)) return std::nullopt;
  const DiameterPx wanted = diameter_px(diameter, pixel);
  const std::vector<DiscGuess> discs = find_discs(values, mask, wanted);
  if (discs.empty()) return std::nullopt;
  const DiscGuess* meant = nullptr;
  const auto off = [&](const DiscGuess& disc) {
    return stated ? distance(disc, *stated) : std::abs(2 * disc.radius_px - wanted.start);
  };
  for (const DiscGuess& disc : discs)
    if ((stated ? off(disc) < disc.radius_px : wanted.holds(disc)) && (!meant || off(disc) < off(*meant)))
      meant = &disc;
  if (!meant && stated) return std::nullopt;
  std::string list;
  for (const DiscGuess& disc : discs) list += (list.empty() ? "" : "; ") + describe(disc, scene.view, pixel);
  if (!meant) {
    reader.warnings.push_back(
        fmt::format("{}: several discs are visible ({}), none of them of a size within the bounds: state "
                    "center_px or roi_px.",
                    name, list));
    return std::nullopt;
  }
  int left_out = 0;
  for (int y = 0; y < mask.height(); ++y)
    for (int x = 0; x < mask.width(); ++x) {
      const auto covers = [&](const DiscGuess& disc) {
        return std::hypot(x - disc.center_x_px, y - disc.center_y_px) < kRim * disc.radius_px;
      };
      const bool others =
          std::any_of(discs.begin(), discs.end(), [&](const DiscGuess& d) { return &d != meant && covers(d); });
      if (others && !covers(*meant) && mask(x, y)) mask(x, y) = 0, ++left_out;
    }
  reader.warnings.push_back(
      fmt::format("{}: several discs are visible ({}). The one of {} is fitted, {} pixels of the others are left out; "
                  "state center_px or roi_px for another, or run fit --each.",
                  name, list, describe(*meant, scene.view, pixel), left_out));
  return *meant;
}

}  // namespace

void resolve_automatic(ConfigReader& reader, Scene& scene, const Image* values, Mask* mask, const std::string& name) {
  View& view = scene.view;
  auto* droplet = std::get_if<Droplet>(&scene.sample);
  // A droplet is looked for in the region; what else has a centre has that of the whole image.
  const double middle_x = droplet && reader.use != ConfigUse::render ? 0.5 * (view.width - 1) : view.middle_x(),
               middle_y = droplet && reader.use != ConfigUse::render ? 0.5 * (view.height - 1) : view.middle_y();
  const auto open = [&](ParameterRef ref) {
    return ref && reader.table[ref].automatic && !std::isfinite(reader.table[ref].value);
  };
  DiscGuess disc{middle_x, middle_y, 0.25 * std::min(view.width, view.height), 0};
  const bool wanted = open(view.center_x_px) || open(view.center_y_px) || (droplet && open(droplet->diameter_um));
  if (droplet && droplet->diameter_um && values) {
    std::optional<DiscGuess> stated;
    if (!open(view.center_x_px) && !open(view.center_y_px))
      stated = DiscGuess{in_scene(reader, view.center_x_px), in_scene(reader, view.center_y_px), 0, 0};
    const auto meant = reader.use == ConfigUse::render ? std::nullopt
                                                       : disc_meant(reader, scene, reader.table[droplet->diameter_um],
                                                                    stated, *values, *mask, name);
    if (meant)
      disc = *meant;
    else if (const DiscGuess found = wanted ? find_disc(*values, *mask) : disc; found.contrast >= kLeastDiscContrast)
      disc = found;
    else if (wanted)
      reader.warnings.push_back(name + ": no disc is visible; the centre starts in the middle of the image. Give " +
                                "center_px and diameter_um to start elsewhere.");
  }
  const auto center = [&](ParameterRef ref, double found, double middle, int size) {
    Parameter& parameter = reader.table[ref];
    const bool unset = !std::isfinite(parameter.value);
    if (unset) parameter.value = ref.stated(parameter.automatic && reader.use != ConfigUse::render ? found : middle);
    if (parameter.automatic && !std::isfinite(parameter.lower)) {
      const double reach = kCenterBoundFraction * size * view.file.bin;
      parameter.lower = parameter.value - reach;
      parameter.upper = parameter.value + reach;
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
    diameter.value = 2 * disc.radius_px * pixel_um(reader, view);
  }
  if (!std::isfinite(diameter.lower)) {
    diameter.lower = 0.8 * diameter.value;
    diameter.upper = 1.25 * diameter.value;
  }
}

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

/// A box in metres is none of micrometres: neither less than a pixel nor a thousand fields of view is a sample.
void check_box(ConfigReader& reader, const Scene& scene, const SampledVolume& volume, const std::string& name) {
  constexpr double kMostFields = 1000;
  const View& view = scene.view;
  if (!volume.grid || !view.pixel_size_um || view.width <= 0) return;
  const VolumeGrid& grid = *volume.grid;
  const double scale = volume.scale ? reader.table[volume.scale].value : 1, pixel = pixel_um(reader, view),
               wide = scale * (grid.nx - 1) * grid.spacing_um[0], high = scale * (grid.ny - 1) * grid.spacing_um[1],
               largest = std::max(wide, high) / pixel;
  if (largest >= 1 && largest <= kMostFields * std::max(view.width, view.height)) return;
  reader.problems.add({reader.file},
                      "sample.volume is a box of " + show(wide) + " x " + show(high) + " um, " +
                          (largest < 1 ? "less than a pixel of " : "a thousand times what is seen of ") + name,
                      "the file's spacing is in um: state scale (1e6 for metres, 0.001 for nm) or pixel_size_um");
}

void check_overlap(ConfigReader& reader, const Scene& scene, const std::string& name) {
  if (const auto* volume = std::get_if<SampledVolume>(&scene.sample)) return check_box(reader, scene, *volume, name);
  const auto* droplet = std::get_if<Droplet>(&scene.sample);
  const View& view = scene.view;
  if (!droplet || !droplet->diameter_um || !view.pixel_size_um || view.width <= 0) return;
  const Parameter& diameter = reader.table[droplet->diameter_um];
  const double pixel = pixel_um(reader, view), diameter_px = diameter.value / pixel;
  // In words, pixels are the file's.
  const int bin = view.file.bin;
  const bool part = view.whole_width() >= view.width + 1 || view.whole_height() >= view.height + 1;
  const std::string seen = (part ? "the region of " : "") + name;
  const double field_px = std::max(view.width, view.height);
  const std::string field = show(view.width * pixel) + " x " + show(view.height * pixel) + " um";
  const auto plausible = [&](double value_um) {
    const double pixels = value_um / pixel;
    return pixels >= 3 && pixels <= 2 * field_px;
  };
  if (!(diameter_px >= 3)) {
    std::string hint = "check pixel_size_um = " + show(pixel / bin) + (bin > 1 ? " and bin" : "");
    for (double factor : {1e3, 1e6})
      if (plausible(diameter.value * factor))
        hint = "did you mean " + show(diameter.value * factor) + "? the key is in um";
    reader.problems.add(
        diameter.where,
        "diameter_um = " + show(diameter.value) + " is only " + show(diameter_px) + " pixels in " + seen, hint);
  } else if (diameter_px > 10 * field_px) {
    const double smaller = diameter.value / 1e3;
    reader.problems.add(diameter.where,
                        "diameter_um = " + show(diameter.value) + " is " + show(std::round(diameter_px / field_px)) +
                            " times the field of view (" + field + ") of " + seen,
                        plausible(smaller) ? "did you mean " + show(smaller) + "? the key is in um"
                                           : "check pixel_size_um = " + show(pixel / bin));
  } else {
    const Parameter& x = reader.table[view.center_x_px];
    const Parameter& y = reader.table[view.center_y_px];
    const double column = in_scene(reader, view.center_x_px), row = in_scene(reader, view.center_y_px);
    const double dx = std::max({-0.5 - column, column - (view.width - 0.5), 0.0});
    const double dy = std::max({-0.5 - row, row - (view.height - 0.5), 0.0});
    if (std::hypot(dx, dy) >= 0.5 * diameter_px)
      reader.problems.add(x.where.line > 0 ? x.where : diameter.where,
                          "center_px = [" + show(x.value) + ", " + show(y.value) + "] puts the droplet outside " +
                              seen + ", which is " + std::to_string(bin * view.width) + " x " +
                              std::to_string(bin * view.height) + " pixels");
  }
}

void set_view(ConfigReader& reader, int width, int height, double file_pixel_um, const std::string& name,
              Scene& scene) {
  scene.view.width = width;
  scene.view.height = height;
  ParameterRef& size = scene.view.pixel_size_um;
  if (!size && file_pixel_um > 0) {
    size = stated_in_file(reader, file_pixel_um);
  } else if (size && file_pixel_um > 0 && !reader.table[size].free) {
    const double stated = reader.table[size].value;
    if (std::abs(stated / file_pixel_um - 1) > 0.01)
      reader.warnings.push_back(name + " states a pixel size of " + show(file_pixel_um) + " um; the config's " +
                                show(stated) + " um is used.");
  }
}

void take_part(const MicrographSettings& settings, Scene& scene) {
  View& view = scene.view;
  const PixelRect roi = settings.roi.value_or(PixelRect{0, 0, view.width, view.height});
  const int bin = settings.bin;
  view.file = {roi.x0, roi.y0, bin, view.width, view.height};
  view.width = roi.width() / bin, view.height = roi.height() / bin;
  const auto place = [&](ParameterRef& ref, int first) { ref = ref.seen(1.0 / bin, -(first + 0.5 * (bin - 1)) / bin); };
  place(view.center_x_px, roi.x0), place(view.center_y_px, roi.y0);
  view.pixel_size_um = view.pixel_size_um.seen(bin, 0);
  if (auto* crystal = std::get_if<Crystal>(&scene.sample))
    for (ParameterRef* electrode : {&crystal->electrode_low_px, &crystal->electrode_high_px})
      place(*electrode, crystal->field_along_y ? roi.y0 : roi.x0);
}

NumberSpec electrode_spec() {
  constexpr double kReadOff = 1;
  return described<Crystal>("electrodes_px.low").known_within(kReadOff);
}

void set_electrodes(ConfigReader& reader, const PixelRect& part, Scene& scene) {
  auto* crystal = std::get_if<Crystal>(&scene.sample);
  if (!crystal || crystal->electrode_low_px) return;
  const bool y = crystal->field_along_y;
  const auto edge = [&](const char* name, double at) {
    // Of several pictures one pair.
    const ParameterRef known = reader.table.find(name);
    return known && reader.table[known].value == at ? known : reader.constant(name, electrode_spec(), at);
  };
  crystal->electrode_low_px = edge("sample.crystal.electrodes_px.low", (y ? part.y0 : part.x0) - 0.5);
  crystal->electrode_high_px = edge("sample.crystal.electrodes_px.high", (y ? part.y1 : part.x1) - 0.5);
}

}  // namespace birefit
