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
#include "birefit/memo.h"
#include "core/printable.h"
#include "io/config/disc.h"
#include "io/config/fit.h"
#include "io/config/items.h"
#include "io/config/light.h"
#include "io/config/micrograph.h"
#include "io/config/mosaic.h"
#include "io/config/overrides.h"
#include "io/config/pictures.h"
#include "io/config/reader.h"
#include "io/config/rings.h"
#include "io/config/scene.h"
#include "io/config/series.h"
#include "io/config/signal.h"
#include "io/config/signal_frames.h"
#include "io/config/starts.h"
#include "io/config/ties.h"
#include "io/files/array_image.h"
#include "io/files/whole_file.h"
#include "medium/references.h"

namespace birefit {
namespace {

/// More messages than this say no more.
constexpr std::size_t kMaxProblemsShown = 50;
constexpr int kMaxImageSide = 16384;

/// All problems, those of the config first and from top to bottom.
[[noreturn]] void throw_sorted(const ConfigReader& reader) {
  std::vector<Problem> problems = reader.problems.all();
  std::stable_sort(problems.begin(), problems.end(), [&](const Problem& a, const Problem& b) {
    const bool a_other = a.where.file != reader.file, b_other = b.where.file != reader.file;
    return std::tie(a_other, a.where.line, a.where.column) < std::tie(b_other, b.where.line, b.where.column);
  });
  // What the frames of a config are read by reads parts of it again.
  problems.erase(std::unique(problems.begin(), problems.end(),
                             [](const Problem& a, const Problem& b) {
                               return a.where.line == b.where.line && a.where.file == b.where.file && a.what == b.what;
                             }),
                 problems.end());
  if (problems.size() > kMaxProblemsShown) {
    const std::size_t more = problems.size() - kMaxProblemsShown;
    problems.resize(kMaxProblemsShown);
    problems.push_back({{reader.file}, "and " + std::to_string(more) + " more", ""});
  }
  throw UserError(std::move(problems));
}

/// Does an image of this size have the region, and a pixel of it?
bool fits_in(const MicrographSettings& settings, const std::array<int, 2>& size) {
  const PixelRect roi = settings.roi.value_or(PixelRect{0, 0, size[0], size[1]});
  return roi.x0 >= 0 && roi.y0 >= 0 && roi.x1 <= size[0] && roi.y1 <= size[1] &&
         std::min(roi.width(), roi.height()) >= settings.bin;
}

/// What was read of arrays, for whoever wants to know what a result was made of.
void note_arrays(const ConfigReader& reader, const std::optional<std::filesystem::path>& image, Config& config) {
  if (image && reader.image_in_memory(*image)) config.inputs.push_back(*image);
  for (const std::filesystem::path& input : config.inputs)
    if (const ArrayImage* array = reader.image_in_memory(input))
      config.arrays[input] = sha256(*array);
    else if (const std::string* field = reader.field_in_memory(input))
      config.arrays[input] = sha256(*field);
}

/// `image` replaces the single micrograph's file; with `series` the micrograph is one of its frames. Without `starts`
/// nothing is looked for in the image: enough to know that a config is sound. `tied`: what tied numbers begin with,
/// which is known once the config was read; null: it has to be read for that.
Config load(const std::filesystem::path& path, const std::string& text, const std::vector<std::string>& set,
            ConfigUse use, const std::optional<std::filesystem::path>& image, const ImageSeries* series = nullptr,
            std::size_t frame = 0, bool starts = true, const TieStarts* tied = nullptr,
            const InMemory* in_memory = nullptr) {
  Config config;
  config.path = path;
  ConfigReader reader(path.string(), path.parent_path(), use);
  if (tied) reader.tie_starts = *tied;
  reader.in_memory = in_memory;
  const YamlNode tree = parse_config(text, reader.file, set, reader.problems);
  config.text = text_as_set(text, tree, set);
  const Block root{&tree, "", {reader.file}};
  reader.check_keys(tree, "",
                    {"micrograph", "micrographs", "calibration", "image_size_px", "sample", "microscope", "accuracy",
                     "physics", "transport", "prior", "fit", "signal", "report"});
  const std::vector<Wanted> wanted = read_report(reader, root);

  const YamlNode* list = root.find("micrographs");
  TableNodes nodes;
  std::vector<Item> items =
      series ? items_of(reader, *series, frame, frame + 1, nodes) : read_items(reader, root, config, nodes);
  if (!items.empty()) {
    for (const auto& set : items[0].set) {
      const std::string& name = set.first;
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
  if (own_analyzers) reader.table[settings.gain].known_to = {};  // one exposure
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
  shared.scene.view.pixel_size_um = settings.pixel_size_um;
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
  } else if (settings.page.given()) {
    for (Item& item : items)
      if (!item.page.given()) item.page = settings.page;
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
    choose_channel(reader, "", settings.where, shared.scene);
    set_view(reader, 1, 1, 0, "the signal", shared.scene);
    if (reader.problems.empty()) resolve_automatic(reader, shared.scene, nullptr, nullptr, "the signal");
    for (std::size_t i = 0; i < signals.size(); ++i) {
      Item own;
      own.set = signals[i].set;
      own.set_where = signals[i].set_where;
      const Picture base = apply_set(reader, shared, own, i, "signal");
      std::size_t rows = 0;
      for (const Readings& table : tables) rows += table.rows.size();
      // Frames may be many: they are not read for a config that is wrong.
      if (signals[i].frames && !reader.problems.empty()) continue;
      const std::optional<TextTable> table =
          signals[i].frames ? table_of_frames(reader, signals[i], settings) : load_signal(reader, signals[i]);
      if (!table) continue;
      append_signal(
          reader, signals[i], *table, i, base, rows,
          [&](Scene& scene, ParameterRef from, ParameterRef to) {
            reader.replaced.insert(from.index);
            replace_ref(scene, from, to);
          },
          config, tables);
    }
    items.clear();
  }
  const std::vector<MicrographSettings> channels = by_channel(settings);
  for (std::size_t i = 0; i < items.size(); ++i) {
    const Picture own = apply_set(reader, shared, items[i], i);
    for (const MicrographSettings& of_channel : channels) {
      const auto of_colour = settings.channels.find(of_channel.channel);
      Picture& picture = micrographs.emplace_back(
          of_colour == settings.channels.end() ? own
                                               : apply_colour(reader, own, of_channel.channel, *of_colour->second));
      choose_channel(reader, of_channel.channel, settings.channel_where, picture.scene);
      if (channels.size() > 1) own_levels(reader, of_channel.channel, picture);
    }
  }

  std::vector<Scene*> scenes;
  for (Picture& picture : micrographs) scenes.push_back(&picture.scene);
  for (Readings& table : tables)
    for (Scene& scene : table.rows) scenes.push_back(&scene);
  const TieStarts found = bind_ties(reader, scenes, wanted, config.job.derived);
  if (!tied && !reader.ties.empty()) return load(path, text, set, use, image, series, frame, starts, &found, in_memory);

  // An image may have a focus of its own, which only waves know.
  for (const Picture& own : micrographs) {
    const ParameterRef focus = own.scene.microscope.focus_um;
    if (!focus || focus == shared.scene.microscope.focus_um || reader.demand.ceiling == Ceiling::wave ||
        !is_defocused(reader, own.scene))
      continue;
    if (!reader.choose_waves) {
      add_defocus_problem(reader, own.scene);
      continue;
    }
    reader.choose_waves = false;
    reader.demand.ceiling = Ceiling::wave;
  }

  // Without an image to look at there is only the view.
  const bool view_only =
      use == ConfigUse::render || (use == ConfigUse::plan && !image && signals.empty() &&
                                   std::none_of(items.begin(), items.end(), [&](const Item& i) {
                                     if (!i.image || !size) return i.image.has_value();
                                     const std::filesystem::path file = reader.resolve(*i.image);
                                     return reader.image_in_memory(file) ||
                                            std::filesystem::exists(file);  // named, but not yet taken
                                   }));
  if (use != ConfigUse::render) {
    // A shared parameter that every image replaces by its own is no unknown of the fit.
    std::set<int> used;
    const auto use_root = [&](const ParameterRef& ref) {
      if (ref)
        for (const int root : reader.table.roots(ref.index)) used.insert(root);
    };
    for (Picture& micrograph : micrographs) {
      for_each_ref(micrograph.scene, use_root);
      used.insert({micrograph.gain.index, micrograph.offset.index});
      for (const UnevenLight& uneven : micrograph.uneven) used.insert(uneven.coefficient.index);
    }
    for (Readings& table : tables) {
      for (Scene& scene : table.rows) for_each_ref(scene, use_root);
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
    if (!needs_pixel_size || scene.view.pixel_size_um || !reader.problems.empty()) return;
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

  const bool sound = reader.problems.empty();
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
      set_view(reader, (*size)[0], (*size)[1], 0, name, scene);
      demand_pixel_size(scene);
      if (use == ConfigUse::plan && fits_in(settings, *size)) take_part(settings, scene);
      resolve_automatic(reader, scene, nullptr, nullptr, name);
      if (reader.problems.empty()) check_overlap(reader, scene, "the image");
    } else if (image || item.image) {
      const std::filesystem::path file = image ? *image : reader.resolve(*item.image);
      const Where where = image ? Where{image->string()} : item.image_where;
      if (const std::optional<LoadedImage> loaded = has_ring_table(scene)
                                                        ? load_ring_table(reader, file, where, scene, config.observable)
                                                        : try_load(reader, channels[0], file, item.page, where)) {
        set_view(reader, loaded->width, loaded->height, loaded->pixel_size_um, name, scene);
        demand_pixel_size(scene, loaded->uneven_pixel_um);
        if (reader.problems.empty()) {
          Mask all(loaded->values.width(), loaded->values.height(), 1);
          for (std::size_t i = 0; i < all.size(); ++i) all.values()[i] = std::isfinite(loaded->values.values()[i]);
          resolve_automatic(reader, scene, &loaded->values, &all, name);
          check_overlap(reader, scene, name);
        }
      } else if (series && sound) {
        throw FrameError(reader.problems.all());
      }
    } else if (root.find("image_size_px")) {
      // Its mistake was reported.
    } else if (!scene.microscope.directions.empty()) {
      set_view(reader, 1, 1, 0, name, scene);
      resolve_automatic(reader, scene, nullptr, nullptr, name);
    } else {
      reader.problems.add({reader.file}, "needs image_size_px: [width, height] or micrograph.image");
    }
    config.scene = scene;
    for (std::size_t c = 0; c < channels.size(); ++c) {
      Scene& of_channel = micrographs[c].scene;
      const ParameterRef own_size = of_channel.view.pixel_size_um;
      of_channel.view = scene.view;
      if (own_size && settings.channels.count(channels[c].channel)) of_channel.view.pixel_size_um = own_size;
      if (channels.size() > 1) config.colours.push_back(of_channel);
      if (use == ConfigUse::plan) config.job.measurements.push_back(micrographs[c]);
    }
  } else if (!view_only) {
    if (!list && signals.empty() && !items[0].image && !image) {
      const Block micrograph{root.find("micrograph"), "micrograph",
                             settings.where.line > 0 ? settings.where : Where{reader.file}};
      if (!micrograph.node || !micrograph.node->find("image")) reader.missing(micrograph, "image");
    }
    // Images are loaded although something else is wrong: their mistakes are reported in the same run.
    std::vector<std::optional<Calibration>> calibrations(channels.size());
    for (std::size_t c = 0; c < channels.size(); ++c)
      if (settings.calibrated() && signals.empty()) calibrations[c] = load_calibration(reader, channels[c]);
    const std::optional<LoadedMask> user_mask =
        signals.empty() ? load_user_mask(reader, settings) : std::nullopt;  // tables have read theirs
    std::vector<Observable> observables(micrographs.size());
    std::vector<std::vector<Picture>> filled(micrographs.size());
    std::string of_colours;  // the first picture that is one colour of several
    std::string of_codes;    // the first photograph of which nothing says how codes follow light
    const YamlNode* block = root.find("micrograph");
    const bool transfer_stated = block && block->find("transfer");
    const bool frames_missing = settings.calibrated() && !std::all_of(calibrations.begin(), calibrations.end(),
                                                                      [](const auto& c) { return c.has_value(); });
    const bool mask_missing = settings.mask && !user_mask;
    for (std::size_t i = 0; i < micrographs.size(); ++i) {
      const Item& item = items[i / channels.size()];
      MicrographSettings own = channels[i % channels.size()];
      if (item.roi) own.roi = item.roi, own.roi_where = item.roi_where;
      if (item.roi && (settings.calibrated() || settings.mask)) {
        reader.problems.add(item.roi_where, "a region of its own is given beside calibration frames or a mask",
                            "crop image, frames and mask alike, or give all images the same roi_px");
        continue;
      }
      const std::optional<Calibration>& calibration = calibrations[i % channels.size()];
      Picture& micrograph = micrographs[i];
      if (!item.image && !(image && !list)) continue;
      const bool replaced = image && !list;
      const std::filesystem::path file = replaced ? *image : reader.resolve(*item.image);
      const Where where = replaced ? Where{file.string()} : item.image_where;
      micrograph.name =
          printable(file.filename().string()) + (item.page.given() && list ? " (" + item.page.words() + ")" : "") +
          (item.roi ? fmt::format(" [{}, {}, {}, {}]", item.roi->x0, item.roi->y0, item.roi->x1, item.roi->y1) : "") +
          (channels.size() > 1 && own.mosaic.parts.empty() ? " (" + own.channel + ")" : "");
      std::optional<LoadedImage> loaded = has_ring_table(micrograph.scene)
                                              ? load_ring_table(reader, file, where, micrograph.scene, observables[i])
                                              : try_load(reader, own, file, item.page, where);
      if (!loaded) continue;
      if (size && (loaded->width != (*size)[0] || loaded->height != (*size)[1]))
        reader.problems.add(root.find("image_size_px")->where,
                            "image_size_px differs from the size of " + micrograph.name + ", " +
                                std::to_string(loaded->width) + " x " + std::to_string(loaded->height),
                            "leave it out");
      set_view(reader, loaded->width, loaded->height, loaded->pixel_size_um, micrograph.name, micrograph.scene);
      if (sound) demand_pixel_size(micrograph.scene, loaded->uneven_pixel_um);
      if (!has_ring_table(micrograph.scene)) {
        take_part(own, micrograph.scene);
      } else if (settings.roi || settings.bin > 1) {
        reader.problems.add(settings.roi ? settings.roi_where : settings.bin_where,
                            "a table of rings has no pixels to choose from or to bin", "leave roi_px and bin out");
        continue;
      }
      if (frames_missing || mask_missing) continue;
      if ((loaded->colour || !settings.mosaic.bayer.empty()) && !micrograph.scene.microscope.channel_light)
        of_colours = of_colours.empty() ? micrograph.name : of_colours;
      if (loaded->colour && loaded->bits == 8 && !transfer_stated && of_codes.empty()) of_codes = micrograph.name;
      filled[i] = pictures_of(reader, own, calibration ? &*calibration : nullptr, user_mask ? &*user_mask : nullptr,
                              std::move(*loaded), where, micrograph);
    }
    // A frame's own mistake, with which the others of its series have nothing to do.
    if (series && sound && !frames_missing && !mask_missing && !reader.problems.empty())
      throw FrameError(reader.problems.all());
    for (std::vector<Picture>& pictures : filled)
      for (Picture& picture : pictures) {
        if (!sound || !reader.problems.empty() || !starts) continue;
        const auto used = [&] { return std::count(picture.mask.values().begin(), picture.mask.values().end(), 1); };
        const auto before = used();
        resolve_automatic(reader, picture.scene, &picture.values, &picture.mask, picture.name);
        refresh_ties(reader);
        picture.outside_roi += static_cast<int>(before - used());  // other discs than the one that is meant
        check_overlap(reader, picture.scene, picture.name);
        check_stressed_disc(reader, picture);
      }
    if (!of_colours.empty() && !shared.scene.microscope.bandwidth_nm) {
      reader.warnings.push_back(
          of_colours +
          ": a channel of a colour camera passes light about 100 nm wide, unless a filter or the lamp's "
          "line makes it less; the model takes one wavelength. State microscope.light.bandwidth_nm (1 for "
          "a laser), or the lamp, light: {lamp: A}, and the camera; else the intervals do not hold.");
      reader.misfit.push_back(of_colours + " is a colour camera's channel, whose light is no single wavelength");
    }
    if (!of_codes.empty())
      reader.warnings.push_back(of_codes +
                                ": colours of 8 bits are sRGB codes as a rule, which are no measure of light; they are "
                                "taken as linear. State micrograph.transfer: srgb, or linear.");
    for (std::size_t c = 0; c < channels.size() && settings.offset_automatic; ++c) {
      if (!calibrations[c] || !calibrations[c]->has_crossed) continue;
      Parameter& offset = reader.table[channels.size() == 1 ? settings.offset : micrographs[c].offset];
      offset.value = calibrations[c]->crossed_median;
      offset.prior_sd = calibrations[c]->crossed_sd;
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

  if (reader.problems.empty()) check_ties(reader);
  if (!reader.problems.empty()) throw_sorted(reader);
  config.job.options.choose_rays = reader.choose_rays;
  config.job.options.max_seconds = reader.max_seconds;
  if (reader.choose_waves) {
    const Theta theta = reader.table.values();
    if (use == ConfigUse::fit) {
      config.job.options.choose_waves = true;
    } else if (const WaveChoice choice = wave_choice(config.scene, reader.demand, theta);
               choice.seconds_an_image <= reader.max_seconds) {
      reader.demand.ceiling = Ceiling::wave;
    } else {
      reader.warnings.push_back(choice.words +
                                " Rays are taken instead: physics.max_seconds and ceiling: wave change that.");
    }
  }
  config.job.demand = reader.demand;
  config.job.demand.memo = std::make_shared<Memo>();
  config.job.parameters = std::move(reader.table);
  config.job.warnings = std::move(reader.warnings);
  config.job.misfit = std::move(reader.misfit);
  config.inputs.assign(reader.inputs.begin(), reader.inputs.end());
  if (use == ConfigUse::fit) note_arrays(reader, image, config);
  return config;
}

}  // namespace

Config load_config(const std::filesystem::path& path, ConfigUse use, const std::optional<std::filesystem::path>& image,
                   const std::vector<std::string>& set) {
  return load_config_text(read_text(path), path, use, image, set);
}

Config load_config_text(std::string text, const std::filesystem::path& path, ConfigUse use,
                        const std::optional<std::filesystem::path>& image, const std::vector<std::string>& set,
                        const InMemory* in_memory) {
  if (use != ConfigUse::fit && holds_series(text, set)) {
    // What the frames have in common shows in the first that can be read.
    const ImageSeries series = read_series(path, std::move(text), set);
    for (std::size_t frame = 0;; ++frame) {
      try {
        return load(path, series.text, set, use, image, &series, frame, true, nullptr, in_memory);
      } catch (const FrameError&) {
        if (frame + 1 == series.frames.size()) throw;
      }
    }
  }
  return load(path, text, set, use, image, nullptr, 0, true, nullptr, in_memory);
}

Config load_frame(const ImageSeries& series, std::size_t frame) {
  return load(series.path, series.text, series.set, ConfigUse::fit, std::nullopt, &series, frame);
}

void check_frame(const ImageSeries& series, std::size_t frame) {
  load(series.path, series.text, series.set, ConfigUse::fit, std::nullopt, &series, frame, false);
}

}  // namespace birefit
