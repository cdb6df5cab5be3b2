// birefit watch: fits every image as it arrives in a folder, each from where the last one ended.

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <iostream>
#include <memory>
#include <optional>
#include <sstream>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/commands.h"
#include "app/frames.h"
#include "app/interrupt.h"
#include "app/output.h"
#include "app/watch.h"
#include "birefit/series.h"
#include "core/printable.h"
#include "io/config/edit.h"
#include "io/config/overrides.h"
#include "io/files/arrivals.h"
#include "io/files/file.h"
#include "io/report/format.h"
#ifdef BIREFIT_VIEW
#include "view/server.h"
#endif

namespace birefit {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct WatchArguments {
  std::string config, folder, out;
  std::vector<std::string> set;
  int threads = -1, port = 0;
  double patience = 5;
  bool resume = false, view = false, quiet = false;
};

#ifdef BIREFIT_VIEW
/// What the page shows: the image that came last, and the table.
class Screen {
 public:
  explicit Screen(const WatchArguments& arguments) {
    if (!arguments.view) return;
    session_.emplace(arguments.threads);
    server_.emplace(*session_, arguments.port);
    std::cout << server_->address() << std::endl;
  }
  void show(const Config& config, std::optional<FitResult> result = std::nullopt) {
    if (session_) session_->open(config, std::move(result));
  }
  void row(std::size_t at, const std::vector<std::string>& columns, std::vector<std::string> cells) {
    if (session_) session_->set_row(at, columns, std::move(cells));
  }
  void say(const std::string& line) {
    if (session_) session_->say(line);
  }

 private:
  std::optional<view::Session> session_;
  std::optional<view::Server> server_;  // goes before its session
};
#else
class Screen {
 public:
  explicit Screen(const WatchArguments& arguments) {
    if (arguments.view)
      throw UserError({}, "this birefit was built without `view`",
                      "watch without --view, or build it where cpp-httplib is installed (Debian: libcpp-httplib-dev)");
  }
  void show(const Config&, std::optional<FitResult> = std::nullopt) {}
  void row(std::size_t, const std::vector<std::string>&, std::vector<std::string>) {}
  void say(const std::string&) {}
};
#endif

/// "birefringence = 0.1502 +- 0.0004, .." of what was searched.
std::string estimates(const FitResult& result) {
  std::string text;
  for (const ParameterEstimate& p : result.parameters)
    if (!p.linear)
      text += fmt::format(", {} = {} +- {}{}", short_name(p.name), format_value(p.value, p.stderr_),
                          format_error(p.stderr_), p.unit.empty() ? "" : " " + p.unit);
  return text;
}

/// The images so far, in the order in which they came, what is known of each, and the files that hold it.
class Watched {
 public:
  Watched(const WatchArguments& arguments, fs::path out)
      : arguments_(arguments), folder_(arguments.folder), out_(std::move(out)), screen_(arguments) {
    series_.path = arguments.config;
    std::ifstream file(arguments.config, std::ios::binary);
    series_.text.assign(std::istreambuf_iterator<char>(file), {});
    series_.set = arguments.set;
    // Each is a frame, with an image of its own.
    series_.set.push_back("micrograph.image=");
    series_.set.push_back("micrographs={files: \"*\"}");
  }

  /// What an earlier run took, in its order. Files that are gone keep their rows.
  void resume(Arrivals& arrivals) {
    std::ifstream file(out_ / kArrivals);
    if (!file) return;
    const Json list = Json::parse(file, nullptr, false);
    if (!list.is_array())
      throw UserError({(out_ / kArrivals).string()}, "is no list of files", "another --out begins anew");
    for (const Json& one : list) {
      const FileState state{one.value("device", std::uint64_t{0}), one.value("inode", std::uint64_t{0}),
                            one.value("size", std::uint64_t{0}), one.value("changed_ns", std::int64_t{0})};
      const Arrival arrival{
          one.contains("bytes") ? text_of_bytes(one["bytes"]) : one.value("file", ""), state, {}, false};
      if (arrival.name.empty() || arrival.name.find('/') != std::string::npos) continue;
      const std::string reason = one.value("unreadable", "");
      std::error_code code;
      if (!fs::exists(folder_ / arrival.name, code) || (!reason.empty() && arrivals.is_still(arrival))) {
        remember(arrival, reason);
        if (reason.empty())
          if (auto record = load_recorded_fit(place_of(arrival.name) / "fit.json"))
            fits_[index_of(arrival.name)] = std::move(record->result);
      } else if (arrivals.is_still(arrival)) {
        if (!take(arrivals, arrival, true)) continue;
      } else {
        continue;  // it has changed, and comes as if it were new
      }
      arrivals.take(arrival.name, arrival.state);
    }
    for (std::size_t i = 0; i < fits_.size(); ++i) show_row(i);
  }

  /// Fits it, or says why not; false where it is to be looked at again later.
  bool take(const Arrivals& arrivals, const Arrival& arrival, bool again = false) {
    if (!arrival.renamed_from.empty() && rename(arrival)) return true;
    const std::optional<std::size_t> known = find(arrival.name);
    SeriesFrame frame;
    frame.name = arrival.name;
    frame.file = (fs::absolute(folder_) / arrival.name).lexically_normal().string();
    frame.where = {frame.file};
    ImageSeries one = series_;
    one.frames = {frame};
    std::optional<FitResult> fitted;
    try {
      Config config = load_frame(one, 0);
      if (!arrival.last_call && !arrivals.is_still(arrival)) return false;
      fitted = fit_one(one.frames[0], config, again, [&] { return arrivals.is_still(arrival); });
      if (!fitted && one.frames[0].unreadable.empty()) return false;  // interrupted
    } catch (const UserError& error) {                                // the config is sound
      // Perhaps the rest of it is still to come.
      if (!arrival.last_call) return false;
      one.frames[0].unreadable = reason_of(error);
    }
    const std::size_t at = known ? *known : remember(arrival, "");
    states_[at] = arrival.state;
    series_.frames[at].unreadable = one.frames[0].unreadable;
    fits_[at] = std::move(fitted);
    if (again) return true;
    write();  // before anybody hears of it: it is told of once
    tell(at);
    return true;
  }

  /// The table, and what a later run goes on with, both or none.
  void write() const {
    SeriesResult result;
    result.alone = result.frames = fits_;
    Json list = Json::array();
    for (std::size_t i = 0; i < states_.size(); ++i) {
      list.push_back({{"file", series_.frames[i].name},
                      {"device", states_[i].device},
                      {"inode", states_[i].inode},
                      {"size", states_[i].size},
                      {"changed_ns", states_[i].changed_ns}});
      if (!series_.frames[i].unreadable.empty()) list.back()["unreadable"] = series_.frames[i].unreadable;
      // A name that is no UTF-8 is not in JSON what it was.
      const std::string& name = series_.frames[i].name;
      if (const std::string as_text = Json(name).dump(-1, ' ', false, Json::error_handler_t::replace);
          Json::parse(as_text).get<std::string>() != name)
        list.back()["bytes"] = std::vector<unsigned char>(name.begin(), name.end());
    }
    write_files({{out_ / "series.csv", series_csv(series_, result)},
                 {out_ / kArrivals, list.dump(1, ' ', false, Json::error_handler_t::replace) + "\n"}});
  }

  bool all_answered() const {
    return std::all_of(fits_.begin(), fits_.end(), [](const auto& fit) { return fit && fit->has_answer(); });
  }
  std::size_t size() const { return fits_.size(); }

 private:
  static constexpr const char* kArrivals = "arrivals.json";

  static std::string text_of_bytes(const Json& bytes) {
    std::string text;
    for (const Json& byte : bytes)
      if (byte.is_number_unsigned()) text.push_back(static_cast<char>(byte.get<unsigned>()));
    return text;
  }
  static std::string reason_of(const UserError& error) {
    std::string words;
    for (const Problem& problem : error.problems())
      words += (words.empty() ? "" : "; ") + problem.what + (problem.hint.empty() ? "" : " (" + problem.hint + ")");
    return words;
  }
  fs::path place_of(const std::string& name) const { return out_ / "frames" / name; }
  std::optional<std::size_t> find(const std::string& name) const {
    for (std::size_t i = 0; i < series_.frames.size(); ++i)
      if (series_.frames[i].name == name) return i;
    return std::nullopt;
  }
  std::size_t index_of(const std::string& name) const { return find(name).value(); }
  std::size_t remember(const Arrival& arrival, const std::string& unreadable) {
    SeriesFrame frame;
    frame.name = frame.file = arrival.name;
    frame.unreadable = unreadable;
    series_.frames.push_back(std::move(frame));
    states_.push_back(arrival.state);
    fits_.emplace_back();
    return fits_.size() - 1;
  }
  /// The same file by another name: its row and its folder go along.
  bool rename(const Arrival& arrival) {
    const auto at = find(arrival.renamed_from);
    if (!at || find(arrival.name)) return false;
    std::error_code code;
    fs::rename(place_of(arrival.renamed_from), place_of(arrival.name), code);
    series_.frames[*at].name = series_.frames[*at].file = arrival.name;
    write();
    show_row(*at);
    screen_.say(printable(arrival.renamed_from + " is now called " + arrival.name));
    if (!arguments_.quiet)
      std::cout << printable(arrival.renamed_from) << " is now called " << printable(arrival.name) << std::endl;
    return true;
  }
  /// The config of this image alone, with its starts: what the page explains, fits and saves.
  Config alone(const SeriesFrame& frame, Config config) const {
    std::vector<std::string> set = arguments_.set;
    set.push_back("micrographs=");
    set.push_back("micrograph.image=" + Json(frame.file).dump(-1, ' ', false, Json::error_handler_t::replace));
    Problems ignored;  // by load_frame()
    config.text = text_as_set(series_.text, parse_config(series_.text, arguments_.config, set, ignored), set);
    std::vector<NewStart> starts;
    const ParameterTable& table = config.job.parameters;
    const auto in_prior = [&](const std::string& name) {
      const std::optional<JointPrior>& joint = config.job.prior;
      return joint && std::find(joint->names.begin(), joint->names.end(), name) != joint->names.end();
    };
    for (int i = 0; i < table.size(); ++i)
      if (const Parameter& p = table[i]; p.free && !p.linear && !p.automatic && !p.prior_sd && !in_prior(p.name))
        starts.push_back({p.name, p.value, p.lower, p.upper});
    if (!starts.empty()) config.text = with_starts(config.text, starts);
    return config;
  }
  /// From where the last one with an answer ended. Throws UserError where the file is no longer `still`.
  std::optional<FitResult> fit_one(SeriesFrame& frame, Config& config, bool again, const std::function<bool()>& still) {
    const FitResult* neighbour = nullptr;
    const std::size_t before = find(frame.name).value_or(fits_.size());
    for (std::size_t i = before; i-- > 0 && !neighbour;)
      if (fits_[i] && fits_[i]->has_answer()) neighbour = &*fits_[i];
    if (arguments_.threads >= 0) config.job.options.threads = arguments_.threads;
    Config shown = config;
    if (neighbour) start_from(shown, *neighbour);
    if (!again) screen_.show(alone(frame, shown));
    FrameDone done = do_frame(frame, config, neighbour, place_of(frame.name), [&] {
      // The fingerprint is of the file as it is now; its pixels were read before.
      if (!still()) throw UserError({frame.file}, "changes while it is read");
      config.job.options.interrupted = &Interrupt::flag();
      config.job.options.progress = [&](const std::string& line) { screen_.say(frame.name + ": " + line); };
    });
    config.job.options.progress = {};
    config.job.options.interrupted = nullptr;
    if (!done.record) return std::nullopt;
    if (done.fresh) screen_.show(alone(frame, config), std::move(done.fresh));
    return std::move(done.record->result);
  }
  /// On the terminal and in the page's table.
  void tell(std::size_t i) {
    show_row(i);
    const SeriesFrame& frame = series_.frames[i];
    if (!arguments_.quiet)
      std::cout << printable(frame.file) << ": "
                << (fits_[i] ? fits_[i]->grade() + estimates(*fits_[i]) : "unreadable: " + printable(frame.unreadable))
                << std::endl;
  }
  void show_row(std::size_t i) {
    const SeriesFrame& frame = series_.frames[i];
    std::vector<std::string> columns{"file", "verdict"}, cells{frame.file};
    cells.push_back(fits_[i] ? fits_[i]->grade() : "unreadable: " + frame.unreadable);
    const auto last = std::find_if(fits_.rbegin(), fits_.rend(), [](const auto& fit) { return fit.has_value(); });
    if (last != fits_.rend())
      for (const ParameterEstimate& p : (*last)->parameters)
        if (!p.linear) columns.push_back(short_name(p.name));
    if (fits_[i])
      for (const ParameterEstimate& p : fits_[i]->parameters)
        if (!p.linear) cells.push_back(format_value(p.value, p.stderr_) + " \u00b1 " + format_error(p.stderr_));
    screen_.row(i, columns, std::move(cells));
  }

  const WatchArguments& arguments_;
  const fs::path folder_, out_;
  Screen screen_;
  ImageSeries series_;
  std::vector<FileState> states_;
  std::vector<std::optional<FitResult>> fits_;
};

/// Every mistake of the config that shows without an image, before anybody waits for one.
void check_config(const WatchArguments& arguments) {
  std::vector<std::string> set = arguments.set;
  set.push_back("micrograph.image=");
  set.push_back("image_size_px=[64, 64]");
  load_config(arguments.config, ConfigUse::plan, std::nullopt, set);
}

int run_watch(const WatchArguments& arguments) {
  check_config(arguments);
  const fs::path out = arguments.out.empty() ? fs::path(arguments.config).stem().string() + "-watch" : arguments.out;
  std::error_code code;
  if (!arguments.resume && (fs::exists(out / "frames", code) || fs::exists(out / "series.csv", code)))
    throw UserError({out.string()}, "holds a series already",
                    "--resume goes on with it and keeps what is up to date; another --out leaves it alone");
  Arrivals arrivals(arguments.folder, arguments.patience);
  OutputFolder folder(out);
  remove_parts(out);
  const Interrupt interrupt;
  Watched watched(arguments, out);
  if (arguments.resume) watched.resume(arrivals);
  if (!interrupt.flag()) watched.write();  // else what the earlier run left stays
  folder.keep();
  if (!arguments.quiet)
    std::cerr << "birefit: watching " << printable(arguments.folder) << ", " << watched.size()
              << " images so far; Ctrl-C ends\n";
  constexpr double kLookUp = 0.2;  // s: how soon Ctrl-C is heard
  while (!interrupt.flag())
    for (const Arrival& arrival : arrivals.next(kLookUp)) {
      if (interrupt.flag()) break;
      if (!arrivals.is_still(arrival)) continue;
      if (!watched.take(arrivals, arrival)) {
        arrivals.put_off(arrival);
        continue;
      }
      arrivals.take(arrival.name, arrival.state);
    }
  if (!arguments.quiet)
    std::cout << watched.size() << " images\nTable: " << printable((out / "series.csv").string()) << "\n";
  return watched.all_answered() ? kExitDone : kExitNoAnswer;
}

}  // namespace

Command add_watch_command(CLI::App& app) {
  CLI::App* command = app.add_subcommand("watch", "fit every image as it arrives in a folder");
  auto arguments = std::make_shared<WatchArguments>();
  command->add_option("CONFIG", arguments->config, "the config (YAML) of one image")->required();
  command->add_option("--folder", arguments->folder, "the folder that images are written to")->required();
  add_set_option(*command, arguments->set);
  command->add_option("--out", arguments->out, "folder for the results; default: the config's name + \"-watch\", here");
  command->add_flag("--resume", arguments->resume, "go on with the images in that folder: what is up to date stays");
  command->add_flag("--view", arguments->view, "show each image and the table on a page in the browser");
  command->add_option("--port", arguments->port, "of that page on 127.0.0.1; default: one that is free")
      ->check(CLI::Range(0, 65535));
  command
      ->add_option("--patience", arguments->patience,
                   "seconds before a file that cannot be read is given up; default 5")
      ->check(CLI::Range(0.0, 3600.0));
  add_threads_option(*command, arguments->threads);
  command->add_flag("-q,--quiet", arguments->quiet, "print nothing but the page's address");
  return {command, [arguments] { return run_watch(*arguments); }};
}

}  // namespace birefit
