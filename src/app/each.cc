#include "app/each.h"

#include <algorithm>
#include <cmath>
#include <variant>

#include <fmt/format.h>

#include "app/plot.h"
#include "io/config_discs.h"

namespace birefit {

std::vector<EachDroplet> droplets_in_view(const Config& config) {
  constexpr double kSmallest = 0.8;  // of the stated diameter: as where one of several is looked for
  const FitJob& job = config.job;
  const Picture* picture = job.measurements.size() == 1 ? std::get_if<Picture>(&job.measurements.front()) : nullptr;
  const Droplet* droplet = picture ? std::get_if<Droplet>(&picture->scene.sample) : nullptr;
  if (!droplet || !droplet->diameter_um || !picture->scene.view.pixel_size_um)
    throw UserError(Where{}, "--each is for one picture of droplets", "leave it out");
  const Theta theta = job.parameters.values();
  const View& view = picture->scene.view;
  const Parameter& diameter = job.parameters[droplet->diameter_um];
  const double pixel = view.pixel_size_um.in(theta);
  Mask seen(picture->values.width(), picture->values.height());
  for (std::size_t i = 0; i < seen.size(); ++i) seen.values()[i] = std::isfinite(picture->values.values()[i]);
  std::vector<EachDroplet> found;
  for (const DiscGuess& disc : find_discs(picture->values, seen, kSmallest * diameter.value / pixel)) {
    EachDroplet each;
    each.x_px = view.center_x_px.stated(disc.center_x_px), each.y_px = view.center_y_px.stated(disc.center_y_px);
    each.diameter_um = 2 * disc.radius_px * pixel;
    const double reach = 0.25 * 2 * disc.radius_px * view.file.bin;
    const auto place = [&](double at) {
      return fmt::format("{{value: {:.2f}, fit: [{:.2f}, {:.2f}]}}", at, at - reach, at + reach);
    };
    each.set.push_back(fmt::format("micrograph.center_px=[{}, {}]", place(each.x_px), place(each.y_px)));
    if (diameter.free)
      each.set.push_back(fmt::format("{}={{value: {:.4g}, fit: [{:.4g}, {:.4g}]}}", diameter.name, each.diameter_um,
                                     0.8 * each.diameter_um, 1.25 * each.diameter_um));
    found.push_back(std::move(each));
  }
  if (found.empty())
    throw UserError(Where{}, picture->name + " does not show several droplets that stand apart", "leave --each out");
  return found;
}

std::string droplets_csv(const std::vector<EachDroplet>& droplets, const std::vector<FitResult>& results) {
  std::string text = "droplet,seen_at_x_px,seen_at_y_px,seen_diameter_um";
  const auto first =
      std::find_if(results.begin(), results.end(), [](const FitResult& r) { return !r.parameters.empty(); });
  if (first != results.end())
    for (const ParameterEstimate& p : first->parameters)
      text += fmt::format(",{0},{0}_stderr,{0}_low95,{0}_high95", p.name);
  text += ",reduced_chi_square,verdict\n";
  for (std::size_t i = 0; i < results.size(); ++i) {
    const EachDroplet& d = droplets[i];
    const FitResult& r = results[i];
    text += fmt::format("{},{:.1f},{:.1f},{:.3g}", i + 1, d.x_px, d.y_px, d.diameter_um);
    for (const ParameterEstimate& p : r.parameters)
      text += fmt::format(",{},{},{},{}", csv_number(p.value), csv_number(p.stderr_), csv_number(p.interval95_low),
                          csv_number(p.interval95_high));
    text += fmt::format(",{},{}\n", csv_number(r.reduced_chi_square), r.grade());
  }
  return text;
}

}  // namespace birefit
