// Does the model describe what there is to see?

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "core/robust.h"
#include "fit/errors/discrepancy.h"
#include "fit/errors/report.h"
#include "fit/errors/stated.h"
#include "fit/errors/verdict.h"
#include "fit/problem/constant.h"

namespace birefit::estimation {
bool judge_description(const Task& task, const Optimum& optimum, double chi_square, int places, FitResult& result) {
  const std::optional<double> constant = chi_square_of_a_constant(task, *optimum.problem);
  if (!constant) return true;
  const double rows = static_cast<double>(optimum.problem->pixel_rows()), reduced = std::max(1.0, chi_square / rows);
  // More than half: measured images of crystals with an uneven field leave up to 0.37 and return the right voltage, a
  // bipolar droplet taken for a radial one leaves 0.77 and returns a birefringence 6 standard errors off.
  constexpr double kMisfit = 2;
  result.left_over = *constant > rows ? (chi_square - rows) / (*constant - rows) : 0;
  result.described = !(reduced > kMisfit && result.left_over > kMostLeftOver);
  const double by_chance = 25 + 2 * task.unknowns.size() + 2 * std::log(std::max(1, places));
  return (*constant - chi_square) / reduced > by_chance;
}

std::string judge_rows(const Task& task, const Optimum& optimum, FitResult& result) {
  constexpr double kMostOfRange = 0.03;
  struct Rows {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    std::vector<double> off, noise;
  };
  std::map<std::string, Rows> tables;
  for (int g = 0; g < task.frames(); ++g) {
    const LeastSquares::FrameMisfit frame = optimum.problem->frame_misfit(g);
    Rows& rows = tables[task.sights[static_cast<std::size_t>(g)].table];
    rows.low = std::min(rows.low, frame.mean_light), rows.high = std::max(rows.high, frame.mean_light);
    rows.off.push_back(std::abs(frame.mean_whitened) * frame.mean_noise_sd), rows.noise.push_back(frame.mean_noise_sd);
  }
  for (auto& [name, rows] : tables) {
    // By the median: a row that is wrong by itself is none of the model's.
    const double off = kNormalSdPerMad * median(rows.off), noise = median(rows.noise),
                 missed = std::sqrt(std::max(0.0, off * off - noise * noise)) / std::max(rows.high - rows.low, 1e-300);
    if (!(missed > kMostOfRange)) continue;
    result.described = false;
    return fmt::format(
        "Not described: the model misses {:.2g} % of the range of the values{}, where 3 % is the most that its values "
        "could be trusted with.",
        100 * missed, tables.size() > 1 ? " of " + name : "");
  }
  return {};
}

std::string judge_discrepancy(const Task& task, const Optimum& optimum, const Inverse& of_noise, FitResult& result) {
  constexpr double kMostOfContrast = 0.03, kMostOfBounds = 0.25, kAtTheEnd = 0.5;
  const bool round = traits_of(task.picture(0).scene).round.has_value();
  const double most_of_value = round ? 0.1 : 0.2;
  double squares = 0;  // over the colours of a photograph
  for (int g = 0; g < task.frames(); ++g) squares += std::pow(missed_of_contrast(task, optimum, g), 2);
  const double missed = std::sqrt(squares / task.frames());
  if (round && missed > kMostOfContrast) {
    result.described = false;
    return fmt::format(
        "Not described: the model misses {:.2g} % of the image's contrast, where 3 % is the most that its "
        "values could be trusted with.",
        100 * missed);
  }
  for (std::size_t j = 0; j < result.parameters.size(); ++j) {
    const ParameterEstimate& p = result.parameters[j];
    const Parameter& parameter = task.job.parameters[task.unknowns.table_index(static_cast<int>(j))];
    if (parameter.nuisance) {
      // What is stated may be wrong by as much, and then it describes the picture; not at the end of what is allowed.
      const bool stated = parameter.prior_sd && parameter.known_to.of(parameter.value) > 0;
      const double off = stated ? std::abs(p.value - parameter.value) / *parameter.prior_sd : 0;
      if (!(off > kFarthestStated - kAtTheEnd)) continue;
      result.described = false;
      return fmt::format(
          "Not described: {} would have to be {:.0f} times what it is known to away from what is stated, and the model "
          "leaves over what noise does not explain all the same.",
          p.name, off);
    }
    const double half = 0.5 * (p.interval95_high - p.interval95_low);
    if (p.linear || !p.limit.empty() || !std::isfinite(half)) continue;
    const bool by_bounds = (p.lower <= 0 && p.upper >= 0) || p.unit == "deg" || p.unit == "px";
    if (by_bounds && !round) continue;
    const double most = by_bounds ? kMostOfBounds * (p.upper - p.lower) : most_of_value * std::abs(p.value);
    const auto at = static_cast<Eigen::Index>(j);
    const bool noise_alone = 2 * std::sqrt(of_noise.covariance(at, at)) > most;
    if (!(half > most) || noise_alone) continue;
    result.described = false;
    return fmt::format("Not described: what the model leaves over could move {} by {:.2g}{}.", p.name, half,
                       p.unit.empty() ? "" : " " + p.unit);
  }
  return {};
}

}  // namespace birefit::estimation
