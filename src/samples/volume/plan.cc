// The plan of a sampled field: method and pixel means, both measured on rays and pixels of this very field.

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "birefit/error.h"
#include "samples/kind.h"
#include "samples/pilots.h"
#include "samples/pixels/pixel_mean.h"
#include "samples/pixels/sampling.h"
#include "samples/volume/volume.h"

namespace birefit {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr int kMost = 8;        ///< points per pixel side
constexpr int kReference = 10;  ///< what they are measured against

/// plan.means.samples by distance from the box's middle: in each of a few rings the fewest points whose means hold
/// `target` on a few pixels. Returns the largest error left.
double plan_pixel_means(const Planning& planning, const VolumeOptics<double>& o, double target, RenderPlan& plan) {
  const Scene& scene = planning.scene;
  const VolumeGrid& grid = *o.grid;
  const double w = scene.view.width, h = scene.view.height;
  const double box = 0.5 * std::hypot((grid.nx - 1) / o.nodes_per_px_x, (grid.ny - 1) / o.nodes_per_px_y);
  const double view =
      std::hypot(std::max(o.center_x_px, w - 1 - o.center_x_px), std::max(o.center_y_px, h - 1 - o.center_y_px));
  const double most = std::max(1.0, std::min(box, view));
  if (most > 100000)
    throw UserError(Where{}, "the volume is more than 200000 pixels across",
                    "check the spacing, scale and pixel_size_um");
  const double near_edge = 0.5 * std::min((grid.nx - 1) / o.nodes_per_px_x, (grid.ny - 1) / o.nodes_per_px_y);
  const Values<Pack> lanes = planning.value.as<Pack>();
  const auto model = make_volume_image<Pack>(scene, plan, lanes, planning.light);
  const auto within = [&](double column, double row) {
    double x, y;
    o.place(column, row, x, y);
    return x >= 0 && y >= 0 && x <= grid.nx - 1 && y <= grid.ny - 1;
  };
  const int rings = static_cast<int>(std::min(16.0, std::ceil(most)));
  constexpr int kPixels = 10;
  std::vector<int> needed(static_cast<std::size_t>(rings), 1);
  double left = 0;
  int turn = 0;
  for (int ring = 0; ring < rings; ++ring)
    for (int k = 0; k < kPixels; ++k, ++turn) {
      const double radius = most * (ring + (k + 0.5) / kPixels) / rings, azimuth = 2.399963 * turn;  // the golden angle
      const double column = std::round(o.center_x_px + radius * std::cos(azimuth)),
                   row = std::round(o.center_y_px + radius * std::sin(azimuth));
      bool whole = column >= 0 && row >= 0 && column < w && row < h;
      for (const auto& [x, y] : {std::pair{-1.5, -1.5}, {-1.5, 1.5}, {1.5, -1.5}, {1.5, 1.5}})
        whole = whole && within(column + x, row + y);
      if (!whole) continue;
      const double exact = lane(mean_over_one_pixel(*model, column, row, kReference), 0);
      double error = 0;
      int n = 1;
      for (; n <= kMost; n += n < 4 ? 1 : 2) {
        error = std::abs(lane(mean_over_one_pixel(*model, column, row, n), 0) - exact);
        if (error <= target || n == kMost) break;
      }
      left = std::max(left, error);
      needed[static_cast<std::size_t>(ring)] = std::max(needed[static_cast<std::size_t>(ring)], n);
    }
  plan.means.center_x_px = o.center_x_px;
  plan.means.center_y_px = o.center_y_px;
  plan.means.bin_px = 1;
  plan.means.samples.clear();
  for (int bin = 0; bin < static_cast<int>(std::ceil(most)) + 1; ++bin) {
    // With its neighbours: few pixels stand for a ring.
    const int ring = std::min(rings - 1, static_cast<int>((bin + 0.5) / most * rings));
    int n = bin + 2 > near_edge ? 2 : 1;  // the correction of single points looks a pixel further, beside the box
    for (int i = std::max(0, ring - 1); i <= std::min(rings - 1, ring + 1); ++i)
      n = std::max(n, needed[static_cast<std::size_t>(i)]);
    plan.means.samples.push_back(n);
  }
  if (most >= box) plan.means.samples.push_back(1);  // beside the box
  return left;
}

/// Of all methods with a few equal steps between two layers the one that takes the fewest samples and holds `target` on
/// the pilots; where none does, the best tried: more steps than these do not mend what lies between the nodes.
Effort cheapest_steps(const Pilots& pilots, int cells, double target, const std::string& only) {
  std::vector<Effort> efforts;
  for (const TransportMethod<double>* method : transport_methods<double>()) {
    if (method->info().reflections || method->info().name == std::string("modal") ||
        (!only.empty() && only != method->info().name))
      continue;
    for (int steps : {1, 2, 3, 4, 6, 8})
      efforts.push_back({method, steps * cells, pilots.samples(*method, pilots.mesh(steps * cells)), 1e300});
  }
  std::stable_sort(efforts.begin(), efforts.end(),
                   [](const Effort& a, const Effort& b) { return a.samples < b.samples; });
  Effort best;
  for (Effort& effort : efforts) {
    effort.error = pilots.error(*effort.method, pilots.mesh(effort.steps), target);
    if (effort.error <= target) return effort;
    if (!best.method || effort.error < best.error) best = effort;
  }
  best.error = pilots.error(*best.method, pilots.mesh(best.steps));
  return best;
}

Pilots volume_pilots(const Scene& scene, const Demand& demand, const Values<double>& value) {
  Pilots pilots;
  const auto o = std::make_shared<const VolumeOptics<double>>(scene, value, continuity_of(demand));
  pilots.breaks = o->breaks;
  const Mesh fine = uniform_mesh(8 * (o->grid->nz - 1), pilots.breaks),
             finer = uniform_mesh(16 * (o->grid->nz - 1), pilots.breaks);
  constexpr int kMost = 48;
  for (int i = 0; i < kMost && pilots.rays.size() < 16; ++i) {
    const auto [x, y] = volume_place(*o->grid, i);
    const Su2<double> exact = volume_retarder<double>(*o, x, y, transport_method<double>("magnus4"), finer);
    // Through a defect the axis between two nodes is anybody's guess, and turns as fast as it likes: no measure of a
    // method.
    const double unsure =
        intensity_distance(exact, volume_retarder<double>(*o, x, y, transport_method<double>("magnus4"), fine));
    if (unsure > 0.1 * demand.intensity_accuracy && i < kMost - 4) continue;
    pilots.rays.push_back([=, x = x, y = y](const TransportMethod<double>& method, const Mesh& mesh) {
      try {
        return or_huge(intensity_distance(exact, volume_retarder(*o, x, y, method, mesh)));
      } catch (const std::logic_error&) {  // a method that asks for more than this column knows
        return 1e300;
      }
    });
  }
  pilots.samples_of = [=](const TransportMethod<double>& method, const Mesh& mesh) {
    return volume_samples(*o, method, mesh);
  };
  return pilots;
}

/// Retardances of rays spread over the box (rad).
std::vector<double> volume_phases_of(const Scene& scene, const Values<double>& value) {
  constexpr int kRays = 24;
  return volume_phases(VolumeOptics<double>(scene, value), kRays);
}

RenderPlan plan_volume(const Planning& planning) {
  const Scene& scene = planning.scene;
  const Values<double>& value = planning.value;
  if (planning.demand.ceiling == Ceiling::reflections)
    throw UserError(Where{}, "ceiling: reflections is for cells and slabs", "use one_way");
  if (!scene.view.pixel_size_um)
    throw UserError(Where{}, "a volume needs micrograph.pixel_size_um", "the size of a pixel on the sample");
  const VolumeOptics<double> o(scene, value);
  const VolumeGrid& grid = *o.grid;
  RenderPlan plan = planning.start();
  const Pilots pilots = volume_pilots(scene, planning.demand, value);
  const Effort effort = cheapest_steps(pilots, grid.nz - 1, 0.5 * plan.demand.intensity_accuracy,
                                       plan.demand.method == "auto" ? "" : plan.demand.method);
  plan.method = effort.method->info().name;
  plan.steps = effort.steps;
  plan.reasons.push_back(
      plan.demand.method != "auto"
          ? fmt::format("method {} was asked for by name", plan.method)
          : "a sampled director turns along the rays: modes couple, so the full 2 x 2 transport is needed");
  plan.reasons.push_back(
      fmt::format("{}: {} steps, one or more between any two of the {} layers, {} samples of the medium a ray, hold "
                  "the intensity to {:.1e} on {} pilot rays (asked: {:.1e}); no method needs fewer",
                  plan.method, pilots.mesh(plan.steps).size() - 1, grid.nz, effort.samples, effort.error, pilots.size(),
                  plan.demand.intensity_accuracy));
  if (effort.error > 0.5 * plan.demand.intensity_accuracy)
    plan.warnings.push_back(fmt::format("The {} method errs by {:.1e} here.", plan.method, effort.error));
  const double left = plan_pixel_means(planning, o, 0.5 * plan.demand.intensity_accuracy, plan);
  plan.numerical_error = effort.error + left;
  const int most = *std::max_element(plan.means.samples.begin(), plan.means.samples.end());
  plan.reasons.push_back(
      fmt::format("pixel means from up to {0} x {0} points, measured: they are good to {1:.1e}", most, left));
  // Across the rays the extraordinary index changes by gradient / (k0 depth): such a ray turns by gradient / (k0 n) on
  // its way and leaves a point of the mid plane beside the one it is seen at, by the order of turn * depth / 8.
  constexpr int kRays = 65;
  // at defects and at a mask's edge gradients are as steep as the grid is fine: the median
  std::vector<double> squares;
  const std::vector<double> here = volume_phases(o, kRays, 0, 0), right = volume_phases(o, kRays, 0.01, 0),
                            up = volume_phases(o, kRays, 0, 0.01);
  double largest = 0;
  for (std::size_t i = 0; i < here.size(); ++i) {
    largest = std::max(largest, std::abs(here[i]));
    const double slope = square((right[i] - here[i]) * o.nodes_per_px_x) + square((up[i] - here[i]) * o.nodes_per_px_y);
    if (slope > 0) squares.push_back(slope * square(100 / value(scene.view.pixel_size_um)));  // rad^2/um^2
  }
  std::sort(squares.begin(), squares.end());
  const double typical = squares.empty() ? 0 : squares[squares.size() / 2], turn = std::sqrt(typical) / (o.k0 * o.n_o);
  plan.model_error = std::min(0.5, typical * o.depth_um / (8 * o.k0 * o.n_o));
  plan.left_out.push_back(
      fmt::format("Light runs straight through the sampled field: refraction, diffraction and reflections are left "
                  "out. Its gradients would turn the extraordinary "
                  "ray by some {:.2g} degrees (median), which changes the intensity by the order of {:.1g}.",
                  turn * 180 / kPi, plan.model_error));
  return plan;
}

void add_volume_jones(const Scene& scene, const RenderPlan& plan, const Values<double>& value, JonesTable& table) {
  const VolumeOptics<double> optics(scene, value, continuity_of(plan.demand));
  const Mesh layers = plan.mesh.empty() ? uniform_mesh(plan.steps, optics.breaks) : plan.mesh;
  for (int r = 0; r < scene.view.height; ++r)
    for (int c = 0; c < scene.view.width; ++c)
      table.add(volume_jones(optics, c, r, transport_method<double>(plan.method), layers), 0, {.row = r, .column = c});
}

ManyDirections volume_directions(const Scene&, const RenderPlan& plan) {
  return plan.wave ? ManyDirections::summed : ManyDirections::never;
}

}  // namespace

const SampleKind kVolume{.name = "volume",
                         .is = is_sample<SampledVolume>,
                         .plan = plan_volume,
                         .pilots = volume_pilots,
                         .phases_rad = volume_phases_of,
                         .jones = add_volume_jones,
                         .directions = volume_directions,
                         .passes_axis = true,
                         .waves = &kVolumeWaves};

}  // namespace birefit
