#include "io/results/work.h"

#include <algorithm>
#include <fstream>
#include <limits>
#include <string_view>

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include "io/config/yaml.h"

namespace birefit {
namespace {

constexpr double kMegabyte = 1 << 20;
/// The program and its libraries.
constexpr double kOwn = 160 * kMegabyte;

/// The place of what is measured: a top-level key, else the whole file.
Where place_of_data(const Config& config) {
  Problems ignored;
  const YamlNode root = parse_yaml(config.text, config.path.string(), ignored);
  for (const std::string_view key : {"micrographs", "micrograph", "signals", "signal"})
    for (const YamlEntry& entry : root.entries)
      if (entry.key == key) return entry.where;
  return {config.path.string()};
}

/// Of memory, in bytes: what the machine has, and the limits of this process and of its control group.
double most_memory() {
  double most = static_cast<double>(::sysconf(_SC_PHYS_PAGES)) * static_cast<double>(::sysconf(_SC_PAGESIZE));
  if (!(most > 0)) most = std::numeric_limits<double>::infinity();
  rlimit limit{};
  if (::getrlimit(RLIMIT_AS, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY)
    most = std::min(most, static_cast<double>(limit.rlim_cur));
  for (const char* file : {"/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"}) {
    double bytes = 0;  // "max" is no number
    if (std::ifstream(file) >> bytes && bytes > 0) most = std::min(most, bytes);
  }
  return most;
}

double pixels_of(const Scene& scene) { return static_cast<double>(scene.view.width) * scene.view.height; }

std::string need(double bytes) { return "this takes about " + describe_memory(bytes) + " of memory"; }
constexpr const char* kAdvice = "give it fewer pixels (roi_px, a crop, binning), or run it where there is more";

}  // namespace

double memory_to_render(const Scene& scene) {
  constexpr double kBytesPerPixel = 24;  // in double, in float and, twice, as the file's bytes
  return kOwn + kBytesPerPixel * pixels_of(scene);
}

double memory_to_fit(const FitJob& job) {
  double pixels = 0, searched = 0;
  for (const Measurement& measurement : job.measurements)
    if (const Picture* picture = std::get_if<Picture>(&measurement)) pixels += pixels_of(picture->scene);
  for (int i = 0; i < job.parameters.size(); ++i) searched += job.parameters[i].free && !job.parameters[i].linear;
  // Measured: most while results are written; or, with many parameters, in the search.
  constexpr double kBytesPerPixel = 290, kBytesInSearch = 150, kBytesPerDerivative = 24;
  return kOwn + pixels * std::max(kBytesPerPixel, kBytesInSearch + kBytesPerDerivative * searched);
}

std::string describe_memory(double bytes) {
  return bytes < 1000 * kMegabyte ? fmt::format("{:.0f} MB", bytes / kMegabyte)
                                  : fmt::format("{:.1f} GB", bytes / (1024 * kMegabyte));
}

std::string describe_duration(double seconds) {
  constexpr double kMinute = 60, kHour = 3600, kDay = 24 * kHour;
  if (seconds < 1) return "less than 1 s";
  if (seconds < 1.5 * kMinute) return fmt::format("{:.0f} s", seconds);
  if (seconds < 1.5 * kHour) return fmt::format("{:.0f} min", seconds / kMinute);
  if (seconds < 2 * kDay) return fmt::format("{:.2g} h", seconds / kHour);
  return fmt::format("{:.0f} days", seconds / kDay);
}

void check_memory(const Config& config, double bytes) {
  const double most = most_memory();
  if (bytes > most)
    throw UserError(place_of_data(config), need(bytes) + ", and at most " + describe_memory(most) + " can be had",
                    kAdvice);
}

UserError too_little_memory(const Config& config, double bytes) {
  return UserError(place_of_data(config), need(bytes) + ", and there is not as much", kAdvice);
}

UserError with_place(const UserError& error, const Config& config) {
  std::vector<Problem> problems = error.problems();
  for (Problem& problem : problems)
    if (problem.where.file.empty()) problem.where = place_of_data(config);
  return UserError(std::move(problems));
}

FitResult fit_config(const Config& config) {
  FitResult result = do_work(config, memory_to_fit(config.job), [&] { return fit(config.job); });
  for (std::string& words : describe_rows(config)) result.warnings.push_back(std::move(words));
  return result;
}

}  // namespace birefit
