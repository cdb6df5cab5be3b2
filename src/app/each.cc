#include "app/each.h"

#include <algorithm>
#include <cmath>
#include <variant>

#include <fmt/format.h>

#include "app/output.h"
#include "core/sub_grid.h"
#include "io/config/discs.h"

namespace birefit {

namespace {

/// Of a size within the bounds; where these are made from the picture (`fit: auto`), from all that there is to see
/// taken for one, of any smaller size as well.
std::vector<DiscGuess> droplets_of(const Image& values, const Mask& seen, const Parameter& diameter, double pixel_um) {
  const DiameterPx wanted = diameter_px(diameter, pixel_um);
  std::vector<DiscGuess> discs = find_discs(values, seen, wanted);
  constexpr double kStep = 0.7, kSmallest = 0.1, kLeast = 0.4, kMost = 1.4;  // a step's sizes hold the next ones
  for (double share = kStep; diameter.automatic && discs.empty() && share > kSmallest; share *= kStep) {
    const double start = share * wanted.start;
    discs = find_discs(values, seen, {start, kLeast * start, kMost * start});
    if (!discs.empty() && 2 * discs.front().radius_px > kMost * start) discs.clear();
  }
  return discs;
}

}  // namespace

std::vector<EachDroplet> droplets_in_view(const Config& config) {
  const FitJob& job = config.job;
  const Picture* picture = job.measurements.size() == 1 ? std::get_if<Picture>(&job.measurements.front()) : nullptr;
  const Droplet* droplet = picture ? std::get_if<Droplet>(&picture->scene.sample) : nullptr;
  if (!droplet || !droplet->diameter_um || !picture->scene.view.pixel_size_um)
    throw UserError(Where{}, "--each is for one picture of droplets", "leave it out");
  if (picture->masked_by_user > 0)
    throw UserError(Where{}, "--each does not know what a mask of " + picture->name + " stands for",
                    "leave the mask out, or choose a part by roi_px");
  const Theta theta = job.parameters.values();
  const View& view = picture->scene.view;
  const Parameter& diameter = job.parameters[droplet->diameter_um];
  const double pixel = view.pixel_size_um.in(theta);
  // Others than the one that the config means were left out: of a mosaic's colour all that there is, else all that is a
  // number.
  const SubGrid grid = sub_grid(picture->mask);
  Mask seen(picture->values.width(), picture->values.height());
  for (int y = grid.y0; y < seen.height(); y += grid.spacing)
    for (int x = grid.x0; x < seen.width(); x += grid.spacing) seen(x, y) = std::isfinite(picture->values(x, y));
  std::vector<EachDroplet> found;
  for (const DiscGuess& disc : droplets_of(picture->values, seen, diameter, pixel)) {
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
  std::vector<std::string> names;  // branches have parameters of their own
  for (const FitResult& r : results)
    for (const ParameterEstimate& p : r.parameters)
      if (std::find(names.begin(), names.end(), p.name) == names.end()) names.push_back(p.name);
  std::string text = "droplet,seen_at_x_px,seen_at_y_px,seen_diameter_um";
  for (const std::string& name : names) text += fmt::format(",{0},{0}_stderr,{0}_low95,{0}_high95", name);
  text += ",reduced_chi_square,verdict\n";
  for (std::size_t i = 0; i < results.size(); ++i) {
    const EachDroplet& d = droplets[i];
    const FitResult& r = results[i];
    text += fmt::format("{},{:.1f},{:.1f},{:.3g}", i + 1, d.x_px, d.y_px, d.diameter_um);
    for (const std::string& name : names) {
      const auto p = std::find_if(r.parameters.begin(), r.parameters.end(),
                                  [&](const ParameterEstimate& one) { return one.name == name; });
      text += p == r.parameters.end() ? ",,,,"
                                      : fmt::format(",{},{},{},{}", csv_number(p->value), csv_number(p->stderr_),
                                                    csv_number(p->interval95_low), csv_number(p->interval95_high));
    }
    text +=
        r.parameters.empty() ? ",,unreadable\n" : fmt::format(",{},{}\n", csv_number(r.reduced_chi_square), r.grade());
  }
  return text;
}

}  // namespace birefit
