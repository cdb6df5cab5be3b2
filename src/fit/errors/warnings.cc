// What each micrograph shows of the model, and what is to be warned of.

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include <fmt/format.h>

#include "fit/errors/report.h"
#include "fit/errors/statistics.h"
#include "fit/weights/settle.h"

namespace birefit::estimation {
namespace {

MicrographResult report_of(const Task& task, const Optimum& optimum, int g) {
  const Picture& micrograph = task.picture(g);
  const Frame& frame = optimum.frames[static_cast<std::size_t>(g)];
  MicrographResult out;
  out.name = micrograph.name;
  out.fitted = fitted_image(task, optimum.frames, g, optimum.theta);
  out.sigma = frame.sigma;
  out.noise = frame.noise;
  out.plan = frame.plan;
  out.used = static_cast<int>(frame.pixels.size());
  out.outliers = optimum.left_out[static_cast<std::size_t>(g)].count;
  out.chi_square = optimum.problem->frame_misfit(g).chi_square;
  out.residual = Image(micrograph.values.width(), micrograph.values.height(), std::numeric_limits<double>::quiet_NaN());
  double squares = 0, low = std::numeric_limits<double>::infinity(), high = -low;
  for (const auto& [x, y] : frame.pixels) {
    const double fitted = out.fitted(x, y);
    const double residual = micrograph.values(x, y) - fitted;
    out.residual(x, y) = residual;
    squares += residual * residual;
    low = std::min(low, fitted);
    high = std::max(high, fitted);
  }
  out.residual_rms = std::sqrt(squares / out.used);
  out.signal_range = high - low;
  return out;
}

void warn(FitResult& result, std::string text) {
  std::vector<std::string>& warnings = result.warnings;
  if (std::find(warnings.begin(), warnings.end(), text) == warnings.end()) warnings.push_back(std::move(text));
}

std::string in_spots(const Outliers& out) { return out.spots == 1 ? "one spot" : fmt::format("{} spots", out.spots); }

/// Pixels that were left out because they stand out of the residual, or that make much of a misfit.
void warn_of_outliers(const Task& task, const Optimum& optimum, int g, FitResult& result) {
  const MicrographResult& micrograph = result.micrographs[static_cast<std::size_t>(g)];
  if (micrograph.outliers > 0) {
    const Outliers& out = optimum.left_out[static_cast<std::size_t>(g)];
    warn(result, fmt::format("{}: {} pixels in {} ({:.2g} %) stand out of the residual and were left out, the largest "
                             "around column {}, row {}.",
                             micrograph.name, out.count, in_spots(out),
                             100.0 * out.count / (out.count + micrograph.used), out.largest_column, out.largest_row));
    return;
  }
  if (task.job.options.leave_out_outliers || !(micrograph.chi_square / std::max(1, micrograph.used) > 1.05)) return;
  const Outliers out = outliers_of(task, optimum, g);
  double theirs = 0;
  for (const auto& [x, y] : optimum.frames[static_cast<std::size_t>(g)].pixels)
    if (out.pixels(x, y)) theirs += std::pow(micrograph.residual(x, y) / micrograph.sigma(x, y), 2);
  const double excess = micrograph.chi_square - micrograph.used;
  if (out.count > 0 && out.count < kMostOutliers * micrograph.used && theirs > 0.2 * excess)
    warn(result, fmt::format("{}: {} pixels in {}, the largest around column {}, row {}, make {:.0f} % of the misfit: "
                             "dust or a scratch? Mask them, or set fit: {{outliers: leave_out}}.",
                             micrograph.name, out.count, in_spots(out), out.largest_column, out.largest_row,
                             100 * std::min(1.0, theirs / excess)));
}

/// Pixels that were left out because the codes end where their light is.
void warn_of_range(const Task& task, const Optimum& optimum, int g, FitResult& result) {
  const Picture& picture = task.picture(g);
  if (!std::isfinite(picture.cut_below) && !std::isfinite(picture.cut_above)) return;
  const Frame& frame = optimum.frames[static_cast<std::size_t>(g)];
  const std::size_t all = usable_pixels(picture, frame.sigma).size(), within = pixels_in_range(task, optimum, g).size();
  if (within == all || frame.pixels.size() > within) return;
  warn(result,
       fmt::format("{}: {} pixels ({:.2g} %) whose light is within three standard deviations of where its codes "
                   "end were left out: what is left of their noise there is not centred.",
                   picture.name, all - within, 100.0 * static_cast<double>(all - within) / static_cast<double>(all)));
}

void warn_of_misfit(const MicrographResult& micrograph, double range_of_all, double largest, FitResult& result) {
  // A uniform frame has no range of its own: then that of all frames, then its own level, is the yardstick.
  double range = micrograph.signal_range;
  if (!(range > 1e-6 * range_of_all)) range = range_of_all;
  if (!(range > 1e-9 * std::abs(largest))) range = std::abs(largest);
  const double percent = range > 0 ? 100 * micrograph.residual_rms / range : 0,
               reduced = micrograph.chi_square / std::max(1, micrograph.used);
  if (!(reduced > 2)) return;
  warn(
      result,
      fmt::format("{}: the model does not describe the image within its noise (reduced chi-square {:.3g}, residual "
                  "{:.2g} % of the signal range){}",
                  micrograph.name, reduced, percent,
                  percent > 15 && !result.described
                      ? ": so large a misfit means that the model is wrong or incomplete; do not trust the values."
                  : percent > 15
                      ? ": so large a misfit means that the model is incomplete; the errors allow for it as far as the "
                        "residuals show it."
                      : "; the errors allow for it as far as the residuals show it."));
}

/// Chi-square lies below what noise of this size would leave once in a million times, and well below.
bool is_too_little(double chi_square, double freedom) {
  constexpr double kMuch = 0.7, kByChance = 1e-6;
  return freedom > 1 && chi_square < kMuch * freedom && chi_square < chi_square_quantile(kByChance, freedom);
}

/// Correlation of the residual, in units of the noise, between neighbours along rows and columns.
double correlation_of_neighbours(const MicrographResult& micrograph) {
  const auto z = [&](int x, int y) { return micrograph.residual(x, y) / micrograph.sigma(x, y); };
  double products = 0, squares = 0;
  for (int y = 0; y + 1 < micrograph.residual.height(); ++y)
    for (int x = 0; x + 1 < micrograph.residual.width(); ++x) {
      const double here = z(x, y), right = z(x + 1, y), below = z(x, y + 1);
      if (!std::isfinite(here + right + below)) continue;
      products += 0.5 * here * (right + below), squares += here * here;
    }
  return squares > 0 ? products / squares : 0;
}

/// Less is left over than the noise that is stated: no good news, but another noise.
void warn_of_too_little(const Task& task, int g, FitResult& result) {
  const MicrographResult& micrograph = result.micrographs[static_cast<std::size_t>(g)];
  const double freedom = micrograph.used - static_cast<double>(task.unknowns.size()) / task.frames();
  if (!is_too_little(micrograph.chi_square, freedom)) return;
  const double reduced = micrograph.chi_square / freedom, shared = correlation_of_neighbours(micrograph);
  constexpr double kShared = 0.1;
  const std::string found =
      fmt::format("{}: the model leaves far less than the noise that is {} (reduced chi-square {:.3g})",
                  micrograph.name, micrograph.noise.estimated ? "read off the picture" : "stated", reduced);
  if (shared > kShared)
    warn(result, found + fmt::format(": neighbouring pixels share theirs (correlation {:.2g}), as those of pictures do "
                                     "that are resampled, demosaiced or smoothed. The errors are those of pixels "
                                     "that know nothing of each other: fit the picture as the camera saw it.",
                                     shared));
  else if (!micrograph.noise.estimated)  // of a picture without noise it is what the estimate cannot go below
    warn(result, found + fmt::format(": the picture's is about {:.2g} times that, and the errors are as much too wide. "
                                     "micrograph.noise takes another; left out, it is read off the picture.",
                                     std::sqrt(reduced)));
}

/// The rows of one table together.
struct Rows {
  double number = 0, chi_square = 0, squares = 0, low = std::numeric_limits<double>::infinity(), high = -low;
  bool stated_noise = true;
};

void warn_of_misfit(const std::string& name, const Rows& rows, double unknowns, FitResult& result) {
  const double percent =
      rows.high > rows.low ? 100 * std::sqrt(rows.squares / rows.number) / (rows.high - rows.low) : 0;
  if (rows.stated_noise && is_too_little(rows.chi_square, rows.number - unknowns))
    warn(result, fmt::format("{}: the model leaves far less than the noise that is stated (reduced chi-square {:.3g}): "
                             "the rows' is about {:.2g} times that, and the errors are as much too wide.",
                             name, rows.chi_square / rows.number, std::sqrt(rows.chi_square / rows.number)));
  if (rows.chi_square / rows.number > 2 && rows.number > 3)
    warn(result,
         fmt::format(
             "{}: the model does not describe the signal within its noise (reduced chi-square {:.3g}, residual "
             "{:.2g} % of the "
             "signal's spread){}",
             name, rows.chi_square / rows.number, percent,
             percent > 5 && !result.described
                 ? ": a curve this far off is another one, or its label is wrong; do not trust the values."
             : percent > 5
                 ? ": a curve this far off may be another one, or its label is wrong; the errors allow for it as far "
                   "as the residuals show it."
                 : "; the errors allow for it as far as the residuals show it."));
}

/// Rows of a table say the same with numbers of their own: the first speaks for all.
std::string without_digits(std::string words) {
  std::erase_if(words, [](char c) { return (c >= '0' && c <= '9') || c == '.' || c == '-' || c == '+'; });
  return words;
}

/// What is said of several micrographs in the same words ("NAME: words") is one line.
std::vector<std::string> with_shared_lines(const Task& task, const std::vector<std::string>& warnings) {
  std::vector<std::pair<std::string, std::vector<std::string>>> said;  // words, of whom; of nobody: a line as it is
  for (const std::string& warning : warnings) {
    const auto of = std::find_if(task.sights.begin(), task.sights.end(),
                                 [&](const Sight& sight) { return warning.starts_with(sight.picture->name + ": "); });
    const bool named = of != task.sights.end();
    const std::string name = named ? of->picture->name : "";
    const std::string words = named ? warning.substr(name.size() + 2) : warning;
    const auto same = std::find_if(said.begin(), said.end(), [&](const auto& line) {
      return named && !line.second.empty() && line.first == words;
    });
    if (same == said.end())
      said.push_back({words, named ? std::vector<std::string>{name} : std::vector<std::string>{}});
    else
      same->second.push_back(name);
  }
  std::vector<std::string> lines;
  for (const auto& [words, names] : said)
    lines.push_back(names.empty() ? words
                    : names.size() == 1
                        ? names.front() + ": " + words
                        : fmt::format("{} images ({} .. {}): {}", names.size(), names.front(), names.back(), words));
  return lines;
}

}  // namespace

void report_micrographs(const Task& task, const Optimum& optimum, FitResult& result) {
  for (int g = 0; g < task.frames(); ++g) result.micrographs.push_back(report_of(task, optimum, g));
  // A row of a table has no range of its own: the table's.
  std::map<std::string, std::pair<double, double>> tables;
  for (int g = 0; g < task.frames(); ++g)
    if (const MicrographResult& row = result.micrographs[static_cast<std::size_t>(g)]; row.used == 1) {
      auto& [low, high] =
          tables.try_emplace(task.sights[static_cast<std::size_t>(g)].table, row.fitted(0, 0), row.fitted(0, 0))
              .first->second;
      low = std::min(low, row.fitted(0, 0));
      high = std::max(high, row.fitted(0, 0));
    }
  for (int g = 0; g < task.frames(); ++g)
    if (MicrographResult& row = result.micrographs[static_cast<std::size_t>(g)]; row.used == 1) {
      const auto [low, high] = tables.at(task.sights[static_cast<std::size_t>(g)].table);
      row.signal_range = high - low;
    }
}

void collect_warnings(const Task& task, const Optimum& optimum, FitResult& result) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const MicrographResult& micrograph : result.micrographs)
    for (const double value : micrograph.fitted.values()) low = std::min(low, value), high = std::max(high, value);
  std::map<std::string, Rows> tables;
  for (int g = 0; g < task.frames(); ++g) {
    const MicrographResult& micrograph = result.micrographs[static_cast<std::size_t>(g)];
    for (const std::string& warning : micrograph.plan.warnings) warn(result, warning);
    for (const std::string& sentence : micrograph.plan.left_out)
      if (std::none_of(result.taken_as_exact.begin(), result.taken_as_exact.end(), [&](const std::string& said) {
            return said == sentence || (micrograph.used == 1 && without_digits(said) == without_digits(sentence));
          }))
        result.taken_as_exact.push_back(sentence);
    if (micrograph.used == 1) {  // a row of a table (name:line): judged with the others of it
      Rows& rows = tables[task.sights[static_cast<std::size_t>(g)].table];
      const auto [x, y] = optimum.frames[static_cast<std::size_t>(g)].pixels[0];
      const double value = task.picture(g).values(x, y);
      rows.number += 1;
      rows.stated_noise = rows.stated_noise && !micrograph.noise.estimated;
      rows.chi_square += micrograph.chi_square;
      rows.squares += micrograph.residual_rms * micrograph.residual_rms;
      rows.low = std::min(rows.low, value);
      rows.high = std::max(rows.high, value);
      continue;
    }
    warn_of_range(task, optimum, g, result);
    warn_of_outliers(task, optimum, g, result);
    warn_of_misfit(micrograph, high - low, high, result);
    warn_of_too_little(task, g, result);
  }
  for (const auto& [name, rows] : tables) warn_of_misfit(name, rows, task.unknowns.size(), result);
  for (const ParameterEstimate& estimate : result.parameters)
    if (estimate.prior_sd && !task.job.parameters[task.job.parameters.find(estimate.name)].nuisance &&
        estimate.stderr_ > 0.98 * *estimate.prior_sd)
      warn(result, fmt::format("The image adds nothing to the prior on {}.", estimate.name));
  result.warnings = with_shared_lines(task, result.warnings);
}

}  // namespace birefit::estimation
