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
#include "io/config/fit.h"
#include "io/config/items.h"
#include "io/config/light.h"
#include "io/config/loading.h"
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

/// What was read of arrays, for whoever wants to know what a result was made of.
void note_arrays(const ConfigReader& reader, const std::optional<std::filesystem::path>& image, Config& config) {
  if (image && reader.image_in_memory(*image)) config.inputs.push_back(*image);
  for (const std::filesystem::path& input : config.inputs)
    if (const ArrayImage* array = reader.image_in_memory(input))
      config.arrays[input] = sha256(*array);
    else if (const std::string* field = reader.field_in_memory(input))
      config.arrays[input] = sha256(*field);
}

}  // namespace

Loading::Loading(const Asked& asked, const TieStarts* tied)
    : asked_(asked), reader_(asked.path.string(), asked.path.parent_path(), asked.use) {
  config_.path = asked.path;
  if (tied) reader_.tie_starts = *tied;
  reader_.in_memory = asked.in_memory;
  tree_ = parse_config(asked.text, reader_.file, asked.set, reader_.problems);
  config_.text = text_as_set(asked.text, tree_, asked.set);
  root_ = {&tree_, "", {reader_.file}};
}

TieStarts Loading::read() {
  reader_.check_keys(tree_, "",
                     {"micrograph", "micrographs", "calibration", "image_size_px", "sample", "microscope", "accuracy",
                      "physics", "transport", "prior", "fit", "signal", "report"});
  const std::vector<Wanted> wanted = read_report(reader_, root_);
  list_ = root_.find("micrographs");
  items_ = asked_.series ? items_of(reader_, *asked_.series, asked_.frame, asked_.frame + 1, nodes_)
                         : read_items(reader_, root_, config_, nodes_);
  signals_ = read_signals(reader_, root_);
  note_set_everywhere();
  read_shared();
  read_size();
  place_items();
  if (!signals_.empty()) read_tables();
  make_pictures();
  std::vector<Scene*> scenes;
  for (Picture& picture : micrographs_) scenes.push_back(&picture.scene);
  for (Readings& table : tables_)
    for (Scene& scene : table.rows) scenes.push_back(&scene);
  return bind_ties(reader_, scenes, wanted, config_.job.derived);
}

Config Loading::finish() {
  settle_own_focus();
  const bool view_only = is_view_only();
  if (asked_.use != ConfigUse::render) drop_unused();
  sound_ = reader_.problems.empty();
  if (asked_.use == ConfigUse::render && !signals_.empty()) {
    if (!tables_.empty()) config_.scene = tables_[0].rows[0];
  } else if (view_only && !micrographs_.empty()) {  // none: their list's mistake was reported
    take_view();
  } else if (!view_only) {
    take_images();
  }
  note_taken_as_exact();
  if (reader_.problems.empty()) check_ties(reader_);
  if (!reader_.problems.empty()) throw_sorted(reader_);
  hand_over();
  return std::move(config_);
}

void Loading::note_set_everywhere() {
  for (const auto& [name, unused] : items_.empty() ? decltype(Item::set){} : items_[0].set) {
    const std::string& wanted = name;
    const bool everywhere = std::all_of(items_.begin(), items_.end(), [&](const Item& item) {
      return std::any_of(item.set.begin(), item.set.end(), [&](const auto& entry) { return entry.first == wanted; });
    });
    if (everywhere) reader_.set_everywhere.push_back(name);
  }
  if (signals_.empty()) return;
  const auto everywhere = [&](const std::string& path) {
    return std::all_of(signals_.begin(), signals_.end(), [&](const SignalItem& item) {
      return std::any_of(item.columns.begin(), item.columns.end(),
                         [&](const SignalItem::Column& c) { return c.path == path; }) ||
             std::any_of(item.set.begin(), item.set.end(), [&](const auto& entry) { return entry.first == path; });
    });
  };
  for (const SignalItem::Column& column : signals_[0].columns)
    if (everywhere(column.path)) reader_.set_everywhere.push_back(column.path);
  for (const auto& [path, unused] : signals_[0].set)
    if (everywhere(path)) reader_.set_everywhere.push_back(path);
}

void Loading::read_shared() {
  quantity_ = signals_.empty() ? Quantity::intensity : signals_[0].quantity;
  for (const SignalItem& item : signals_)
    if (item.quantity != quantity_)
      reader_.problems.add(item.where, "every table of a config must have the same quantity");
  reader_.polarizers = quantity_ == Quantity::intensity;
  own_analyzers_ = states_polarization_mosaic(tree_);
  if (own_analyzers_) reader_.set_everywhere.push_back("microscope.analyzer_deg");
  shared_.scene = read_scene(reader_, root_);
  config_.observable.quantity = quantity_;
  settings_ = read_micrograph(reader_, root_, shared_.scene, quantity_);
  if (own_analyzers_) refuse_second_analyzer();
  if (list_ && settings_.image)
    reader_.problems.add(settings_.image_where, "micrograph.image is given beside micrographs", "give one of the two");
  if (list_ && asked_.image)
    reader_.problems.add({reader_.file},
                         "--image replaces the image of `micrograph:`, but this config has `micrographs:`");
  shared_.scene.view.pixel_size_um = settings_.pixel_size_um;
  shared_.scene.view.center_x_px = settings_.center_x;
  shared_.scene.view.center_y_px = settings_.center_y;
  shared_.scene.view.rotation_deg = settings_.rotation;
  shared_.gain = settings_.gain;
  shared_.offset = settings_.offset;
  shared_.uneven = settings_.uneven;
  shared_.noise = settings_.noise;
  if (settings_.roi) set_electrodes(reader_, *settings_.roi, shared_.scene);
  read_fit_options(reader_, root_, config_.job.options);
  channels_ = by_channel(settings_);
}

void Loading::refuse_second_analyzer() {
  reader_.table[settings_.gain].known_to = {};  // one exposure
  if (const YamlNode* microscope = root_.find("microscope"); microscope && microscope->is_map())
    for (const char* key : {"analyzer_deg", "analyser_deg"})
      if (const YamlNode* node = microscope->find(key))
        reader_.problems.add(node->where,
                             std::string(key) +
                                 " is given beside mosaic: polarization, whose pixels "
                                 "have an analyser each",
                             "leave it out");
}

void Loading::read_size() {
  const auto given = reader_.integers(root_, "image_size_px", 2, "[width, height]");
  if (!given) return;
  if ((*given)[0] < 1 || (*given)[1] < 1 || (*given)[0] > kMaxImageSide || (*given)[1] > kMaxImageSide)
    reader_.problems.add(root_.find("image_size_px")->where,
                         "image_size_px must be within [1, " + std::to_string(kMaxImageSide) + "]");
  else
    size_ = {(*given)[0], (*given)[1]};
}

void Loading::place_items() {
  if (!list_) {
    Item only;
    only.image = settings_.image;
    only.image_where = settings_.image_where;
    only.page = settings_.page;
    items_ = {only};
  } else if (settings_.page.given()) {
    for (Item& item : items_)
      if (!item.page.given()) item.page = settings_.page;
  }
}

void Loading::check_tables() {
  if (asked_.image)
    reader_.problems.add({reader_.file}, "--image replaces the image of `micrograph:`, but this config has `signal:`");
  const auto* cell = std::get_if<Cell>(&shared_.scene.sample);
  if (!cell && reader_.problems.empty())
    reader_.problems.add(signals_[0].where, "signal is for cells: every row sees the same light");
  if (!cell || quantity_ == Quantity::intensity) return;
  const auto* field = std::get_if<FreederickszDirector>(&cell->director);
  if (!std::holds_alternative<UniformDirector>(cell->director) && (!field || field->twist_deg || field->pitch_um))
    reader_.problems.add(signals_[0].where,
                         "the axis of this cell turns about the light: its retardance is not one number",
                         "quantity: intensity");
}

void Loading::read_tables() {
  check_tables();
  choose_channel(reader_, "", settings_.where, shared_.scene);
  set_view(reader_, 1, 1, 0, "the signal", shared_.scene);
  if (reader_.problems.empty()) resolve_automatic(reader_, shared_.scene, nullptr, nullptr, "the signal");
  for (std::size_t i = 0; i < signals_.size(); ++i) {
    Item own;
    own.set = signals_[i].set;
    own.set_where = signals_[i].set_where;
    const Picture base = apply_set(reader_, shared_, own, i, "signal");
    std::size_t rows = 0;
    for (const Readings& table : tables_) rows += table.rows.size();
    // Frames may be many: they are not read for a config that is wrong.
    if (signals_[i].frames && !reader_.problems.empty()) continue;
    const std::optional<TextTable> table =
        signals_[i].frames ? table_of_frames(reader_, signals_[i], settings_) : load_signal(reader_, signals_[i]);
    if (!table) continue;
    append_signal(
        reader_, signals_[i], *table, i, base, rows,
        [&](Scene& scene, ParameterRef from, ParameterRef to) {
          reader_.replaced.insert(from.index);
          replace_ref(scene, from, to);
        },
        config_, tables_);
  }
  items_.clear();
}

void Loading::make_pictures() {
  for (std::size_t i = 0; i < items_.size(); ++i) {
    const Picture own = apply_set(reader_, shared_, items_[i], i);
    for (const MicrographSettings& of_channel : channels_) {
      const auto of_colour = settings_.channels.find(of_channel.channel);
      Picture& picture = micrographs_.emplace_back(
          of_colour == settings_.channels.end() ? own
                                                : apply_colour(reader_, own, of_channel.channel, *of_colour->second));
      choose_channel(reader_, of_channel.channel, settings_.channel_where, picture.scene);
      if (channels_.size() > 1) own_levels(reader_, of_channel.channel, picture);
    }
  }
}

void Loading::settle_own_focus() {
  for (const Picture& own : micrographs_) {
    const ParameterRef focus = own.scene.microscope.focus_um;
    if (!focus || focus == shared_.scene.microscope.focus_um || reader_.demand.ceiling == Ceiling::wave ||
        !is_defocused(reader_, own.scene))
      continue;
    if (!reader_.choose_waves) {
      add_defocus_problem(reader_, own.scene);
      continue;
    }
    reader_.choose_waves = false;
    reader_.demand.ceiling = Ceiling::wave;
  }
}

bool Loading::is_view_only() {
  if (asked_.use == ConfigUse::render) return true;
  if (asked_.use != ConfigUse::plan || asked_.image || !signals_.empty()) return false;
  return std::none_of(items_.begin(), items_.end(), [&](const Item& i) {
    if (!i.image || !size_) return i.image.has_value();
    const std::filesystem::path file = reader_.resolve(*i.image);
    return reader_.image_in_memory(file) || std::filesystem::exists(file);  // named, but not yet taken
  });
}

void Loading::drop_unused() {
  std::set<int> used;
  const auto use_root = [&](const ParameterRef& ref) {
    if (ref)
      for (const int root : reader_.table.roots(ref.index)) used.insert(root);
  };
  for (Picture& micrograph : micrographs_) {
    for_each_ref(micrograph.scene, use_root);
    used.insert({micrograph.gain.index, micrograph.offset.index});
    for (const UnevenLight& uneven : micrograph.uneven) used.insert(uneven.coefficient.index);
  }
  for (Readings& table : tables_) {
    for (Scene& scene : table.rows) for_each_ref(scene, use_root);
    used.insert({table.gain.index, table.offset.index});
  }
  const bool sound = reader_.problems.empty();  // else images may be missing
  for (int i = 0; i < reader_.table.size(); ++i) {
    if (used.count(i) || !reader_.table[i].free) continue;
    if (!reader_.replaced.count(i) && sound)
      reader_.problems.add(reader_.table[i].where, reader_.table[i].name + " is fitted, but nothing here depends on it",
                           "give it as a number, or leave it out");
    reader_.table[i].free = false;
  }
}

void Loading::note_taken_as_exact() {
  const YamlNode* sample = root_.find("sample");
  if (sample && sample->is_map() && !sample->find("surround") && reader_.specs.count("sample.surround.index"))
    config_.job.taken_as_exact.push_back(
        "sample.surround is not given: air, an index of 1.0, is taken around the sample.");
  if (!tables_.empty() && quantity_ != Quantity::intensity && !reader_.table[tables_[0].gain].free)
    config_.job.taken_as_exact.push_back(
        "the scale of the table's values: an instrument that drifts along its rows looks like a law of the material.");
  if (!tables_.empty() && quantity_ == Quantity::intensity) {
    std::string stated;
    for (const auto& [name, ref] : {std::pair("gain", tables_[0].gain), {"offset", tables_[0].offset}})
      if (ref && !reader_.table[ref].free) stated += (stated.empty() ? "" : " and ") + std::string(name);
    if (!stated.empty())
      config_.job.taken_as_exact.push_back("the " + stated +
                                           " of the table's light: a leak, a detector's curve or a lamp that changes "
                                           "the light is read as the sample's. {fit: auto} finds them.");
  }
  if (const auto* crystal = std::get_if<Crystal>(&config_.scene.sample);
      crystal && !crystal->built_in_bias_v && config_.job.measurements.size() > 1)
    config_.job.taken_as_exact.push_back(
        "sample.crystal.built_in_bias_v is not given: no charge in the bar. Pictures at three or more voltages can "
        "tell it, where it is fitted.");
  if (std::holds_alternative<Droplet>(config_.scene.sample) && !config_.scene.microscope.objective_na)
    config_.job.taken_as_exact.push_back(
        "microscope.objective_na is not given: every ray that leaves the droplet is "
        "taken to reach the image, and wave optics, which needs it, is left out.");
}

void Loading::hand_over() {
  config_.job.options.choose_rays = reader_.choose_rays;
  config_.job.options.max_seconds = reader_.max_seconds;
  if (reader_.choose_waves) {
    const Theta theta = reader_.table.values();
    if (asked_.use == ConfigUse::fit) {
      config_.job.options.choose_waves = true;
    } else if (const WaveChoice choice = wave_choice(config_.scene, reader_.demand, theta);
               choice.seconds_an_image <= reader_.max_seconds) {
      reader_.demand.ceiling = Ceiling::wave;
    } else {
      reader_.warnings.push_back(choice.words +
                                 " Rays are taken instead: physics.max_seconds and ceiling: wave change that.");
    }
  }
  config_.job.demand = reader_.demand;
  config_.model_tolerance = reader_.model_tolerance;
  config_.job.demand.memo = std::make_shared<Memo>();
  config_.job.parameters = std::move(reader_.table);
  config_.job.warnings = std::move(reader_.warnings);
  config_.job.misfit = std::move(reader_.misfit);
  config_.inputs.assign(reader_.inputs.begin(), reader_.inputs.end());
  if (asked_.use == ConfigUse::fit) note_arrays(reader_, asked_.image, config_);
}

namespace {

Config load(const Asked& asked) {
  Loading first(asked, nullptr);
  const TieStarts tied = first.read();
  if (!first.has_ties()) return first.finish();
  Loading again(asked, &tied);
  again.read();
  return again.finish();
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
        return load({path, series.text, set, use, image, &series, frame, true, in_memory});
      } catch (const FrameError&) {
        if (frame + 1 == series.frames.size()) throw;
      }
    }
  }
  return load({path, text, set, use, image, nullptr, 0, true, in_memory});
}

Config load_frame(const ImageSeries& series, std::size_t frame) {
  const std::optional<std::filesystem::path> none;
  return load({series.path, series.text, series.set, ConfigUse::fit, none, &series, frame});
}

void check_frame(const ImageSeries& series, std::size_t frame) {
  const std::optional<std::filesystem::path> none;
  load({series.path, series.text, series.set, ConfigUse::fit, none, &series, frame, false});
}

}  // namespace birefit
