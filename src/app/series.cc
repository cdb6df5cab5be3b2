// birefit series: fits every frame of a series, each from where frames before it ended, and settles what they share.

#include <algorithm>
#include <atomic>
#include <cmath>
#include <iostream>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string_view>

#include <fmt/format.h>

#include "app/commands.h"
#include "app/frames.h"
#include "app/interrupt.h"
#include "app/output.h"
#include "app/watch.h"
#include "birefit/series.h"
#include "core/printable.h"
#include "core/threads.h"
#include "io/files/table.h"
#include "io/report/chart.h"
#include "io/results/work.h"

namespace birefit {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kFramesTogether = 4;

struct SeriesArguments {
  std::string config;
  std::vector<std::string> set;
  std::string out;
  int threads = -1;
  bool resume = false;
  bool quiet = false;
};

/// Is this folder of a frame's results, and not somebody else's?
bool holds_fit(const fs::path& folder) {
  std::error_code code;
  return fs::is_regular_file(folder / "fit.json", code);
}

/// Results of earlier runs that are none of this series' stand apart: beside new ones they would pass for some of them.
class EarlierFrames {
 public:
  explicit EarlierFrames(const fs::path& out) : frames_(out / "frames"), earlier_(out / "earlier") {}

  /// Brings a frame's results back where the series has it again: they may be up to date.
  void bring_back(const std::string& name) const {
    std::error_code code;
    if (!fs::exists(frames_ / name, code) && holds_fit(earlier_ / name))
      fs::rename(earlier_ / name, frames_ / name, code);
  }

  /// Takes away what there is of a frame that has no result now; says whether there was anything.
  bool take_away(const std::string& name) const {
    std::error_code code;
    if (!holds_fit(frames_ / name)) return false;
    fs::create_directories(earlier_, code);
    fs::remove_all(earlier_ / name, code);  // still earlier
    fs::rename(frames_ / name, earlier_ / name, code);
    return !code;
  }

  /// Takes away the frames that the series does not have; what was said of it, in sentences. What holds no fit stays.
  std::vector<std::string> take_away_others(const ImageSeries& series) const {
    std::vector<std::string> names, taken, sentences;
    std::error_code code;
    for (const fs::directory_entry& entry : fs::directory_iterator(frames_, code))
      names.push_back(entry.path().filename().string());
    std::sort(names.begin(), names.end());
    for (const std::string& name : names) {
      const auto is_it = [&](const SeriesFrame& f) { return f.name == name; };
      if (std::any_of(series.frames.begin(), series.frames.end(), is_it)) continue;
      if (take_away(name))
        taken.push_back(name);
      else
        sentences.push_back("frames/" + name + " is no frame of this series.");
    }
    if (!taken.empty())
      sentences.push_back(fmt::format("{} of an earlier run {} no frame of this series: moved to {}/.",
                                      taken.size() == 1 ? "frames/" + taken[0] : fmt::format("{} frames", taken.size()),
                                      taken.size() == 1 ? "is" : "are", earlier_.filename().string()));
    return sentences;
  }

 private:
  const fs::path frames_, earlier_;
};

/// "diameter (\u00b5m)" of sample.droplet.diameter_um: the unit is part of every name. Control characters are spaces.
std::string axis_label(const std::string& path) {
  const std::size_t dot = path.rfind('.');
  std::string name = path.substr(dot + 1);
  if (name.size() == 1 && dot != std::string::npos)
    return axis_label(path.substr(0, dot)) + ", " + name;  // "center (px), x"
  constexpr std::pair<std::string_view, std::string_view> kUnits[] = {{"_v_per_um", "V/\u00b5m"},
                                                                      {"_mm2_s", "mm\u00b2/s"},
                                                                      {"_per_k", "1/K"},
                                                                      {"_um", "\u00b5m"},
                                                                      {"_nm", "nm"},
                                                                      {"_cm", "cm"},
                                                                      {"_mm", "mm"},
                                                                      {"_deg", "\u00b0"},
                                                                      {"_rad", "rad"},
                                                                      {"_px", "px"},
                                                                      {"_pn", "pN"},
                                                                      {"_min", "min"},
                                                                      {"_k", "K"},
                                                                      {"_v", "V"},
                                                                      {"_s", "s"},
                                                                      {"_h", "h"}};
  std::string unit;
  for (const auto& [suffix, word] : kUnits)
    if (name.size() > suffix.size() && name.ends_with(suffix)) {
      name.resize(name.size() - suffix.size());
      unit = fmt::format(" ({})", word);
      break;
    }
  const auto is_blank = [](unsigned char c) { return c == '_' || c < 0x20 || c == 0x7f; };
  std::replace_if(name.begin(), name.end(), is_blank, ' ');
  return name + unit;
}

/// Column of the table to draw against; nothing: the frames' numbers.
std::optional<std::size_t> abscissa(const ImageSeries& series) {
  if (series.along) return series.along;
  return series.columns.size() == 1 ? std::optional<std::size_t>(0) : std::nullopt;
}

/// Where a frame stands along the axis: cells were found to be numbers when they were read.
double x_of(const ImageSeries& series, const std::optional<std::size_t>& column, std::size_t frame) {
  if (!column) return static_cast<double>(frame + 1);
  return parse_number(series.frames[frame].cells[*column].text).value_or(std::numeric_limits<double>::quiet_NaN());
}

/// How the picture draws what is known of a parameter.
struct Looks {
  DataSeries shared{DataSeries::Kind::line, "shared by all frames (95 %)", {}, {}, "#0072B2"};
  DataSeries doubtful{DataSeries::Kind::points, "no answer", {}, {}, "#999999", 6.5, DataSeries::Mark::circle};
  DataSeries known{DataSeries::Kind::points, "estimate (95 %)", {}, {}, "#000000", 4.5};
  DataSeries below{DataSeries::Kind::points, "upper limit", {}, {}, "#D55E00", 9, DataSeries::Mark::down};
  DataSeries above{DataSeries::Kind::points, "lower limit", {}, {}, "#D55E00", 9, DataSeries::Mark::up};
  std::vector<DataSeries*> all() { return {&shared, &doubtful, &known, &below, &above}; }
};

void add(DataSeries& series, double x, double y) { series.x.push_back(x), series.y.push_back(y); }
void add(DataSeries& series, double x, double y, double low, double high) {
  add(series, x, y);
  series.low.push_back(low), series.high.push_back(high);
}

/// What is known of a parameter of each frame: estimates with 95 % intervals; limits as triangles that point to what is
/// allowed; frames without an answer as open circles. Of a shared parameter each frame's own estimate, and the common
/// one as a strip.
Looks looks_of(const std::string& name, const std::vector<double>& x, std::pair<double, double> ends,
               const SeriesResult& result) {
  Looks looks;
  const std::optional<SharedEstimate>& common = result.shared;
  const auto names = common ? common->posterior.names : std::vector<std::string>();
  const auto at = std::find(names.begin(), names.end(), name) - names.begin();
  const bool shared = at < static_cast<std::ptrdiff_t>(names.size());
  if (shared) {
    const Posterior& all = common->posterior;
    const double value = all.mean[at],
                 half = interval95_factor(all.degrees_of_freedom) * std::sqrt(all.covariance(at, at));
    for (const double place : {ends.first, ends.second}) add(looks.shared, place, value, value - half, value + half);
  }
  for (std::size_t i = 0; i < x.size(); ++i) {
    const auto& fit = shared ? result.alone[i] : result.frames[i];
    if (!fit) continue;
    for (const ParameterEstimate& p : fit->parameters) {
      if (p.name != name || !std::isfinite(p.value)) continue;
      if (!fit->has_answer() || (p.limit.empty() && !std::isfinite(p.interval95_low)))
        add(looks.doubtful, x[i], p.value);
      else if (!p.limit.empty())
        add(p.limit == "lower" ? looks.above : looks.below, x[i], p.limit_value);
      else
        add(looks.known, x[i], p.value, p.interval95_low, p.interval95_high);
    }
  }
  return looks;
}

/// The least and the largest of what is finite; 0 of nothing.
std::pair<double, double> ends_of(std::vector<double> x) {
  std::erase_if(x, [](double value) { return !std::isfinite(value); });
  if (x.empty()) return {0, 0};
  const auto [first, last] = std::minmax_element(x.begin(), x.end());
  return {*first, *last};
}

/// A panel for every searched parameter, in two columns of more than three; nothing where none was estimated.
std::optional<Sheet> sheet_of(const ImageSeries& series, const SeriesResult& result) {
  std::vector<std::string> drawn;
  for (const auto& fit : result.alone)
    if (fit)
      for (const ParameterEstimate& p : fit->parameters)
        if (!p.linear && std::find(drawn.begin(), drawn.end(), p.name) == drawn.end()) drawn.push_back(p.name);
  if (drawn.empty()) return std::nullopt;
  const auto x_column = abscissa(series);
  std::vector<double> x;
  for (std::size_t i = 0; i < series.frames.size(); ++i) x.push_back(x_of(series, x_column, i));
  const auto [first, last] = ends_of(x);
  const double room = last > first ? 0.03 * (last - first) : 1;

  Sheet sheet;
  sheet.title = "what the frames of the series say of every searched parameter";
  sheet.columns = drawn.size() > 3 ? 2 : 1;
  sheet.charts.resize(static_cast<std::size_t>(sheet.columns));
  for (Chart& chart : sheet.charts) {
    chart.title = "estimates of the frames";
    chart.x_label = x_column ? axis_label(series.columns[*x_column].name) : "frame";
    chart.x_range = {first - room, last + room};
    chart.width = sheet.columns == 1 ? 740 : 570;
  }
  Looks listed;
  for (std::size_t k = 0; k < drawn.size(); ++k) {
    Looks looks = looks_of(drawn[k], x, {first, last}, result);
    Panel panel;
    panel.y_label = axis_label(drawn[k]) + (looks.shared.x.empty() ? "" : ", shared");
    for (std::size_t i = 0; i < looks.all().size(); ++i) {
      DataSeries& one = *looks.all()[i];
      if (one.x.empty()) continue;
      *listed.all()[i] = one;
      one.label.clear();
      panel.series.push_back(one);
    }
    sheet.charts[k % sheet.charts.size()].panels.push_back(std::move(panel));
  }
  for (DataSeries* one : listed.all())
    if (!one->x.empty()) sheet.legend.push_back(*one);
  return sheet;
}

/// Counts of verdicts and warnings, and what is shared.
std::string summary_of(const ImageSeries& series, const SeriesResult& result) {
  std::map<std::string, std::size_t> verdicts, warnings;
  for (std::size_t i = 0; i < series.frames.size(); ++i) {
    const auto& fit = result.frames[i];
    ++verdicts[fit ? fit->grade() : series.frames[i].unreadable.empty() ? "not done" : "unreadable"];
    if (fit)
      for (const std::string& warning : fit->warnings) ++warnings[warning];
  }
  std::string text = fmt::format("{} frames:", series.frames.size());
  std::string separator = " ";
  for (const auto& [verdict, count] : verdicts)
    text += fmt::format("{}{} {}", separator, count, verdict), separator = ", ";
  text += "\n";
  if (result.shared) {
    const SharedEstimate& shared = *result.shared;
    const double t = interval95_factor(shared.posterior.degrees_of_freedom);
    for (std::size_t i = 0; i < shared.posterior.names.size(); ++i) {
      const auto at = static_cast<Eigen::Index>(i);
      const double value = shared.posterior.mean[at], error = std::sqrt(shared.posterior.covariance(at, at));
      const int digits = error > 0 ? static_cast<int>(std::clamp(1 - std::floor(std::log10(error)), 0.0, 12.0)) : 6;
      text += fmt::format("  {} = {:.{}f} +/- {:.2g} [95%: {:.{}f} .. {:.{}f}], shared by {} frames\n",
                          shared.posterior.names[i], value, digits, error, value - t * error, digits, value + t * error,
                          digits, shared.fits);
    }
    text += fmt::format("  the frames' own values about the shared ones: chi-square {:.4g} for {} degrees of freedom\n",
                        shared.chi_square, shared.chi_square_degrees);
  }
  for (const std::string& warning : result.warnings) text += "warning: " + warning + "\n";
  constexpr std::size_t kListed = 8;
  std::size_t listed = 0;
  for (const SeriesFrame& frame : series.frames)
    if (!frame.unreadable.empty() && listed++ < kListed)
      text += fmt::format("unreadable: {}: {}\n", frame.name, frame.unreadable);
  if (listed > kListed) text += fmt::format("and {} more that are unreadable, in the table\n", listed - kListed);
  listed = 0;
  for (const auto& [warning, count] : warnings) {
    if (listed++ == kListed)
      return text + fmt::format("and {} more warnings, in the frames' reports\n", warnings.size() - kListed);
    text += fmt::format("warning ({}): {}\n", count == 1 ? "1 frame" : fmt::format("{} frames", count), warning);
  }
  return text;
}

int run_series(const SeriesArguments& arguments) {
  ImageSeries series = load_series(arguments.config, arguments.set);
  const fs::path out = arguments.out.empty() ? fs::path(arguments.config).stem().string() + "-series" : arguments.out;
  std::error_code code;
  if (!arguments.resume && (fs::exists(out / "frames", code) || fs::exists(out / "series.csv", code)))
    throw UserError({out.string()}, "holds a series already",
                    "--resume goes on with it and keeps what is up to date; another --out leaves it alone");
  OutputFolder folder(out);

  remove_parts(out);
  const EarlierFrames earlier(out);

  const Interrupt interrupt;
  std::vector<std::optional<FitResult>> fits(series.frames.size());
  const FitResult* neighbour = nullptr;
  std::atomic<std::size_t> kept{0}, done{0};
  const auto seconds_left = [&](double elapsed) {
    const double so_far = static_cast<double>(done.load() - kept.load()), all = static_cast<double>(fits.size());
    if (!(so_far > 0)) return std::numeric_limits<double>::quiet_NaN();
    return elapsed / so_far * (all - static_cast<double>(done.load()));
  };
  std::optional<Watch> watch(std::in_place, arguments.quiet, seconds_left);
  const auto do_one = [&](std::size_t i, int threads) {
    std::optional<Config> opened = open_frame(series, i);
    if (!opened) return;
    FitOptions& options = opened->job.options;
    earlier.bring_back(series.frames[i].name);
    FrameDone frame = do_frame(series.frames[i], *opened, neighbour, out / "frames" / series.frames[i].name, [&] {
      options.threads = threads;
      options.interrupted = &interrupt.flag();
      const std::string at = fmt::format("{} of {}: {}", i + 1, series.frames.size(), printable(series.frames[i].name));
      watch->say(at);
      options.progress = [&, at](const std::string& line) { watch->say(at + ": " + line); };
    });
    if (!frame.record) return;
    if (!frame.fresh) ++kept;
    fits[i] = std::move(frame.record->result);
    ++done;
  };
  // The first alone, then a few at a time that all start where the frames before them ended: how many does not depend
  // on the number of cores, so that neither do the results.
  const int cores = thread_count(
      arguments.threads >= 0 ? arguments.threads : load_frame(series, first_readable(series)).job.options.threads);
  for (std::size_t first = 0, count; first < series.frames.size() && !interrupt.flag(); first += count) {
    count = std::min<std::size_t>(first == 0 ? 1 : kFramesTogether, series.frames.size() - first);
    const int side_by_side = std::min(cores, static_cast<int>(count)), each = cores / side_by_side;
    parallel_for(static_cast<int>(count), side_by_side, [&](int k) {
      if (!interrupt.flag()) do_one(first + static_cast<std::size_t>(k), each);
    });
    for (std::size_t i = first; i < first + count; ++i)
      if (fits[i] && fits[i]->has_answer()) neighbour = &*fits[i];
  }
  watch.reset();

  SeriesResult result = settle_series(series, std::move(fits));
  for (std::size_t i = 0; i < series.frames.size(); ++i)
    if (!series.frames[i].unreadable.empty()) earlier.take_away(series.frames[i].name);
  for (std::string& sentence : earlier.take_away_others(series)) result.warnings.push_back(std::move(sentence));
  write_file(out / "series.csv", series_csv(series, result));
  folder.keep();
  // What an earlier run left is of other numbers.
  fs::remove(out / "series.svg", code);
  fs::remove(out / "shared.csv", code);
  if (const std::string shared = shared_csv(result); !shared.empty()) write_file(out / "shared.csv", shared);
  if (const std::optional<Sheet> sheet = sheet_of(series, result)) write_file(out / "series.svg", svg_file(*sheet));
  if (!arguments.quiet) {
    if (kept > 0) std::cout << kept << " frames were up to date\n";
    std::cout << printable_lines(summary_of(series, result)) << "Table: " << printable((out / "series.csv").string())
              << "\n";
  }
  return result.has_answer() ? kExitDone : kExitNoAnswer;
}

}  // namespace

Command add_series_command(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("series", "fit every image of a series, with parameters of its own and shared ones");
  auto arguments = std::make_shared<SeriesArguments>();
  command->add_option("CONFIG", arguments->config, "the config (YAML), with micrographs: {files: ..}")->required();
  add_set_option(*command, arguments->set);
  command->add_option("--out", arguments->out,
                      "folder for the results; default: the config's name + \"-series\", here");
  command->add_flag("--resume", arguments->resume,
                    "go on with the series in that folder: frames that are up to date stay");
  add_threads_option(*command, arguments->threads);
  command->add_flag("-q,--quiet", arguments->quiet, "no summary and no progress");
  return {command, [arguments] { return run_series(*arguments); }};
}

}  // namespace birefit
