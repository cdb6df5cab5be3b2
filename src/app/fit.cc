// birefit fit: estimates the parameters that the config marks `fit`.

#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>
#include <memory>
#include <optional>
#include <variant>

#include <fmt/format.h>

#include "app/commands.h"
#include "app/each.h"
#include "app/interrupt.h"
#include "app/output.h"
#include "app/watch.h"
#include "birefit/forecast.h"
#include "birefit/io.h"
#include "core/printable.h"
#include "io/results/work.h"
#include "io/results/write.h"

namespace birefit {
namespace {

struct FitArguments {
  std::string config;
  std::vector<std::string> set;
  std::string image;
  std::string out;
  int threads = -1, coverage = 0, samples = 0;
  bool quiet = false, json = false, npy = false, each = false;
};

/// The time that the job is foreseen to take, less what went by; NaN where it cannot be foreseen.
double seconds_left(const FitJob& job, double& foreseen, double elapsed) {
  const auto is_table = [](const Measurement& m) { return std::holds_alternative<Readings>(m); };
  if (std::isnan(foreseen) && std::any_of(job.measurements.begin(), job.measurements.end(), is_table))
    foreseen = std::numeric_limits<double>::infinity();  // forecasts are of pictures
  if (std::isnan(foreseen)) {
    try {
      foreseen = forecast_fit(job);
    } catch (const std::exception&) {
      foreseen = std::numeric_limits<double>::infinity();  // the fit itself says what is wrong
    }
  }
  return foreseen - elapsed;
}

/// work(), during which whoever waits is told what is done and about how long it takes.
template <class Work>
auto watched(bool quiet, FitJob& job, const Work& work) {
  FitJob alone = job;  // another thread looks at it
  alone.options.progress = {};
  double foreseen = std::numeric_limits<double>::quiet_NaN();
  Watch watch(quiet, [&](double elapsed) { return seconds_left(alone, foreseen, elapsed); });
  if (!quiet) job.options.progress = [&](const std::string& line) { watch.say(line); };
  auto result = work();
  job.options.progress = {};
  return result;
}

Config read(const FitArguments& arguments, std::vector<std::string> more = {}) {
  more.insert(more.begin(), arguments.set.begin(), arguments.set.end());
  return load_config(arguments.config, ConfigUse::fit,
                     arguments.image.empty() ? std::nullopt : std::optional<std::filesystem::path>(arguments.image),
                     more);
}

std::vector<std::string> picture_formats(const FitArguments& arguments) {
  return arguments.npy ? std::vector<std::string>{".tif", ".npy"} : std::vector<std::string>{".tif"};
}

std::filesystem::path folder_of(const FitArguments& arguments) {
  return arguments.out.empty()
             ? std::filesystem::path(arguments.config).stem().string() + (arguments.each ? "-each" : "-fit")
             : arguments.out;
}

/// Nothing stale beside new results: `file` is what another command, or option, leaves.
void refuse_beside(const std::filesystem::path& out, const char* file, const char* whose) {
  std::error_code code;
  if (std::filesystem::exists(out / file, code))
    throw UserError({out.string()}, fmt::format("holds {}, of {}", file, whose), "choose another --out");
}

/// Every droplet in view by a fit of its own: a folder of results each, and a table.
int run_each(const FitArguments& arguments) {
  const std::vector<EachDroplet> droplets = droplets_in_view(read(arguments));
  const std::filesystem::path out = folder_of(arguments);
  OutputFolder folder(out);
  refuse_beside(out, "fit.json", "a fit without --each");
  refuse_beside(out, "series.csv", "a series");
  const Interrupt interrupt;
  std::vector<FitResult> results;
  const auto folder_of_droplet = [&](std::size_t i) { return out / "droplets" / std::to_string(i + 1); };
  for (std::size_t i = 0; i < droplets.size() && !interrupt.flag().load(); ++i) {
    results.emplace_back();
    FitResult& result = results.back();
    try {
      Config config = read(arguments, droplets[i].set);
      FitJob& job = config.job;
      if (arguments.threads >= 0) job.options.threads = arguments.threads;
      job.options.samples = arguments.samples;
      job.options.interrupted = &interrupt.flag();
      const double memory = memory_to_fit(job);
      result = watched(arguments.quiet, job, [&] { return fit_config(config); });
      do_work(config, memory, [&] { write_results(folder_of_droplet(i), config, result, picture_formats(arguments)); });
      folder.keep();
      if (!arguments.quiet)
        std::cout << fmt::format("Droplet {} at ({:.1f}, {:.1f}): {}\n", i + 1, droplets[i].x_px, droplets[i].y_px,
                                 result.grade())
                  << summary(result);
      result.micrographs.clear();       // a picture of each
    } catch (const UserError& error) {  // of this one; the others go on
      result = {};
      std::cerr << fmt::format("Droplet {} at ({:.1f}, {:.1f}): {}\n", i + 1, droplets[i].x_px, droplets[i].y_px,
                               printable_lines(error.what()));
    }
  }
  // Nothing of an earlier run, which found more, beside these.
  std::error_code ignored;
  for (std::size_t i = droplets.size(); std::filesystem::exists(folder_of_droplet(i) / "fit.json", ignored); ++i)
    std::filesystem::remove_all(folder_of_droplet(i), ignored);
  write_file(out / "droplets.csv", droplets_csv(droplets, results));
  folder.keep();
  if (!arguments.quiet) std::cout << "Table: " << printable((out / "droplets.csv").string()) << "\n";
  const bool all = results.size() == droplets.size() &&
                   std::all_of(results.begin(), results.end(), [](const FitResult& r) { return r.has_answer(); });
  return all ? kExitDone : kExitNoAnswer;
}

int run_fit(const FitArguments& arguments) {
  if (arguments.each) return run_each(arguments);
  Problems problems;
  Config config;
  try {
    config = read(arguments);
  } catch (const UserError& error) {
    problems.add(error);
  }
  const std::filesystem::path out = folder_of(arguments);
  std::unique_ptr<OutputFolder> folder;
  try {
    folder = std::make_unique<OutputFolder>(out);
    refuse_to_replace_inputs(out, config);
    refuse_beside(out, "droplets.csv", "a fit with --each");
    refuse_beside(out, "series.csv", "a series");
  } catch (const UserError& error) {
    problems.add(error);
  }
  problems.throw_if_any();

  FitJob& job = config.job;
  if (arguments.threads >= 0) job.options.threads = arguments.threads;
  job.options.samples = arguments.samples;
  const Interrupt interrupt;
  job.options.interrupted = &interrupt.flag();
  const double memory = memory_to_fit(job);
  const std::vector<std::string> formats = picture_formats(arguments);
  FitResult result = watched(arguments.quiet, job, [&] { return fit_config(config); });
  if (arguments.coverage > 0 && result.has_answer() && config.signals.empty()) {
    write_results(out, config, result, formats);  // the audit may take hours
    folder->keep();
    const auto nobody_knows = [](double) { return std::numeric_limits<double>::quiet_NaN(); };
    Watch watch(arguments.quiet, nobody_knows);
    watch.say(fmt::format("fitting {} simulated images", arguments.coverage));
    result.coverage = do_work(config, memory, [&] { return measure_coverage(job, result, arguments.coverage); });
  } else if (arguments.coverage > 0) {
    result.warnings.push_back(config.signals.empty() ? "--coverage: this fit has no answer to simulate images at."
                                                     : "--coverage is for images, not for tables of signals.");
  }
  do_work(config, memory, [&] { write_results(out, config, result, formats); });
  folder->keep();

  if (arguments.json) {
    std::cout << fit_json(config, result) << "\n";
  } else if (!arguments.quiet) {
    std::cout << summary(result) << "Report: " << printable((out / "report.html").string()) << "\n";
  }
  return result.has_answer() ? kExitDone : kExitNoAnswer;
}

}  // namespace

Command add_fit_command(CLI::App& app) {
  CLI::App* command = app.add_subcommand("fit", "estimate the parameters marked `fit`");
  auto arguments = std::make_shared<FitArguments>();
  command->add_option("CONFIG", arguments->config, "the config (YAML)")->required();
  add_set_option(*command, arguments->set);
  command->add_option("--image", arguments->image, "use this image in place of micrograph.image");
  command->add_option("--out", arguments->out, "folder for the results; default: the config's name + \"-fit\", here");
  add_threads_option(*command, arguments->threads);
  CLI::Option* coverage =
      command
          ->add_option(
              "--coverage", arguments->coverage,
              "simulate N images at the result, fit each from scratch, and report how often the intervals hold")
          ->check(CLI::Range(1, 100000));
  command
      ->add_option("--samples", arguments->samples,
                   "draw N times from the posterior: samples.csv, and a corner plot in the report")
      ->check(CLI::Range(10, 1000000));
  command->add_flag("-q,--quiet", arguments->quiet, "no summary and no progress");
  command->add_flag("--npy", arguments->npy,
                    "also write fitted and residual images for NumPy: fitted.npy, residual.npy");
  CLI::Option* json = command->add_flag("--json", arguments->json, "print fit.json in place of the summary");
  command
      ->add_flag("--each", arguments->each,
                 "a fit of every droplet that stands apart in the picture: droplets.csv and a folder each")
      ->excludes(json)
      ->excludes(coverage);
  return {command, [arguments] { return run_fit(*arguments); }};
}

}  // namespace birefit
