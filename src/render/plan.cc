// The planner: the cheapest method that holds the requested accuracy, found by measuring a few pilot rays against a
// converged computation of the same physics, not by rules of thumb. docs/methods.md, "Choosing".

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "birefit/error.h"
#include "birefit/memo.h"
#include "birefit/render.h"
#include "instrument/channel_light.h"
#include "instrument/exposure.h"
#include "medium/references.h"
#include "medium/validity.h"
#include "render/direction_plan.h"
#include "render/light_plan.h"
#include "samples/choices.h"
#include "samples/kind.h"
#include "samples/tables/polar_table.h"
#include "samples/waves/wave.h"
#include "transport/method.h"

namespace birefit {
namespace {

bool has_series(const Scene& scene) {
  const SampleWaves* const waves = kind_of(scene).waves;
  return waves && waves->has_series && waves->has_series(scene);
}

void check_method(const Scene& scene, const Demand& demand) {
  if (demand.method == "auto") return;
  if (demand.ceiling == Ceiling::wave) {
    if (demand.method == "split_step" || (demand.method == "series" && has_series(scene))) return;
    if (demand.method == "series")
      throw UserError(Where{}, "transport method 'series' is for radial droplets without twist and concentric shells",
                      "use auto or split_step");
    throw UserError(Where{}, fmt::format("transport method '{}' is for rays", demand.method),
                    "ceiling: wave knows series and split_step; or leave transport.method at auto");
  }
  if (demand.method == "series" || demand.method == "split_step")
    throw UserError(Where{}, fmt::format("transport method '{}' belongs to ceiling: wave", demand.method),
                    "set physics.ceiling: wave, or leave transport.method at auto");
  const auto& names = transport_method_names();
  if (std::find(names.begin(), names.end(), demand.method) == names.end())
    throw UserError(Where{}, fmt::format("transport method '{}' does not exist", demand.method),
                    fmt::format("use auto or one of: {}", fmt::join(names, ", ")));
  if ((demand.method == "berreman") != (demand.ceiling == Ceiling::reflections))
    throw UserError(
        Where{}, fmt::format("transport method '{}' and this physics.ceiling exclude each other", demand.method),
        "berreman computes all reflections and belongs to ceiling: reflections; leave transport.method at auto");
  if (demand.method == "modal" && kind_of(scene).passes_axis)
    throw UserError(
        Where{},
        "transport method 'modal' is for cells, slabs and plates: in a droplet the axis passes every ray's wavevector",
        "leave transport.method at auto");
}

std::vector<double> phases(const Scene& scene, const Values<double>& value) {
  std::vector<double> phases = kind_of(scene).phases_rad(scene, value);
  const std::vector<double> of_parts = part_phases(scene.microscope, value);
  phases.insert(phases.end(), of_parts.begin(), of_parts.end());
  return phases;
}
double largest_phase(const Scene& scene, const Values<double>& value) {
  double largest = 0;
  for (const double phase : kind_of(scene).phases_rad(scene, value)) largest = std::max(largest, std::abs(phase));
  return largest;
}

Image picture_of(const Scene& scene, const RenderPlan& plan, const Theta& theta) {
  return render(scene, plan, theta, {}, 1).intensity;
}

Symmetry symmetry_of(const SampleKind& kind, const Scene& scene, const RenderPlan& plan, const Values<double>& value,
                     const BeamMaker& light) {
  if (plan.wave || !kind.symmetric || !kind.symmetric(scene)) return Symmetry::none;
  if (!on_middle_row(scene, value.get(scene.view.center_y_px, 0.5 * (scene.view.height - 1)))) return Symmetry::none;
  return make_image<double>(scene, plan, value, light)->symmetry();
}

/// What the literature's birefringence is off by.
void note_material(const Scene& scene, const Values<double>& value, RenderPlan& plan) {
  const auto* law = std::get_if<LawIndices>(&scene.material);
  if (!law || law->birefringence_uncertainty <= 0) return;
  const double largest = largest_phase(scene, value), unsure = largest * law->birefringence_uncertainty;
  plan.model_error = std::hypot(plan.model_error, 0.5 * std::min(1.0, unsure));  // the steepest slope of sin^2(phase/2)
  plan.left_out.push_back(fmt::format(
      "The material's birefringence is known to {:.2g} % only (standard deviation): the largest retardance, {:.3g} "
      "rad, to {:.2g} rad. "
      "Intervals do not contain this unless sample.material.birefringence_factor is fitted with prior_sd: {:.2g}.",
      100 * law->birefringence_uncertainty, largest, unsure, law->birefringence_uncertainty));
}

/// In light of the one wavelength that theta has.
RenderPlan plan_line(const Scene& scene, const Demand& demand, const Theta& theta, const Observable& observable) {
  check_validity(scene, temperatures(scene), theta);
  const Values<double> value(theta, {}, demand.memo.get());
  const SampleKind& kind = kind_of(scene, observable);
  const Exposure exposure = exposure_of(scene.microscope);
  const BeamMaker& light = exposure.directions.front();
  const Planning planning{scene,
                          demand,
                          value,
                          observable,
                          light,
                          [&](const RenderPlan& trial, const std::vector<std::array<int, 2>>& pixels) {
                            return render_pixels(scene, trial, theta, pixels, {}, 1).intensity;
                          },
                          picture_of};
  RenderPlan result;
  if (demand.ceiling == Ceiling::wave) {
    result = has_series(scene) && demand.method != "split_step" ? kind.waves->plan_series(scene, demand, value, light)
                                                                : plan_wave(planning);
  } else {
    result = kind.plan(planning);
  }
  result.observable = observable;
  note_material(scene, value, result);
  if (kind.note) kind.note(scene, value, result);
  const Symmetry symmetry = symmetry_of(kind, scene, result, value, light);
  if (symmetry == Symmetry::half_turn)
    result.reasons.push_back("half a turn about the viewing axis leaves the picture as it is: half of it is computed");
  if (symmetry == Symmetry::mirror)
    result.reasons.push_back("the lower half of the picture is the upper one's mirror image: half of it is computed");
  result.physics = demand.ceiling == Ceiling::e_only        ? "e_only"
                   : demand.ceiling == Ceiling::reflections ? "reflections"
                   : demand.ceiling == Ceiling::wave        ? "wave"
                                                            : "one_way";
  return result;
}

/// The largest retardance of the picture, with all that the microscope's parts add (rad).
double all_phases(const Scene& scene, const Demand& demand, const Theta& theta) {
  const Values<double> value(theta, {}, demand.memo.get());
  double sum = largest_phase(scene, value);
  for (const double phase : part_phases(scene.microscope, value)) sum += std::abs(phase);
  return sum;
}

/// Pixels on a spiral about the view's middle.
std::vector<std::array<int, 2>> few_pixels(const View& view) {
  constexpr int kPixels = 12;
  std::vector<std::array<int, 2>> pixels;
  for (int i = 0; i < kPixels; ++i) {
    const double radius = 0.45 * std::min(view.width, view.height) * i / kPixels, azimuth = 2.399963 * i;
    pixels.push_back(
        {std::clamp(static_cast<int>(0.5 * view.width + radius * std::cos(azimuth)), 0, view.width - 1),
         std::clamp(static_cast<int>(0.5 * view.height + radius * std::sin(azimuth)), 0, view.height - 1)});
  }
  return pixels;
}

}  // namespace

RenderPlan plan(const Scene& scene, const Demand& asked, const Theta& theta, const Observable& observable) {
  check_references(scene, theta);
  check_method(scene, asked);
  Demand demand = asked;
  if (!demand.memo) demand.memo = std::make_shared<Memo>();
  const FewMeans means = [&](const RenderPlan& trial) {
    return render_pixels(scene, trial, theta, few_pixels(scene.view), {}, 1).intensity;
  };
  const auto with_directions = [&](RenderPlan planned) {
    const SampleKind& kind = kind_of(scene, observable);
    const Values<double> value(theta, {}, demand.memo.get());
    plan_directions(scene, value, kind.directions ? kind.directions(scene, planned) : ManyDirections::never,
                    largest_phase(scene, value), means, planned);
    return planned;
  };
  const std::optional<LightBand> band = light_band(scene.microscope, theta);
  if (!band) return with_directions(plan_line(scene, demand, theta, observable));
  // Where phases are largest, numbers are hardest to hold.
  const Theta planned = band->narrow ? theta : at_wavelength(scene.microscope, theta, band->low_um);
  check_validity(scene, temperatures(scene), at_wavelength(scene.microscope, theta, band->high_um));
  RenderPlan result = plan_line(scene, demand, planned, observable);
  plan_wavelengths(scene, theta, *band, kind_of(scene, observable).sums_line,
                   {[&](const Theta& at) { return all_phases(scene, demand, at); }, means}, result);
  if (result.wave && result.wavelengths)
    for (const double nm : result.wavelengths->wavelength_nm)
      result.of_wavelengths.push_back(
          plan_line(scene, demand, at_wavelength(scene.microscope, theta, 1e-3 * nm), observable));
  return with_directions(std::move(result));
}

namespace {

/// The grids of `before` no longer hold what `now` was made for (wave optics, parts of a disc).
bool outgrown(const RenderPlan& now, const RenderPlan& before) {
  if (now.means.edge_points > before.means.edge_points || now.means.defect_points > before.means.defect_points)
    return true;
  if (!now.wave || !before.wave)
    return static_cast<bool>(now.wave) != static_cast<bool>(before.wave) ||
           outgrown_disc(choices(now).disc, choices(before).disc);
  const double ratio = now.wave->radius_um / before.wave->radius_um;
  // The pupil's grid ends 5 % beyond the aperture that it was made for.
  return ratio > 1.04 || ratio < 0.8 || now.wave->objective_na > 1.04 * before.wave->objective_na;
}

}  // namespace

bool asks_for_more(const RenderPlan& now, const RenderPlan& before) {
  const PixelMeans &means = now.means, &had = before.means;
  // A few wavelengths more or less are those of another value, not of another picture.
  const auto wavelengths = [](const RenderPlan& plan) { return plan.wavelengths ? plan.wavelengths->size() : 1; };
  if (10 * wavelengths(now) > 12 * wavelengths(before) + 20) return true;
  if (now.condenser_rings > before.condenser_rings + 1) return true;
  if (now.method != before.method || (choices(now).disc.empty() && now.steps > before.steps) ||
      now.mesh.size() > before.mesh.size() || has_finer_tables(choices(now), choices(before)) ||
      (had.fringes && !means.fringes) || outgrown(now, before))
    return true;
  const double moved = std::hypot(means.center_x_px - had.center_x_px, means.center_y_px - had.center_y_px);
  if (means.samples != had.samples && moved > had.bin_px) return true;
  for (std::size_t i = 0; i < means.samples.size(); ++i)
    if (means.samples[i] > (i < had.samples.size() ? had.samples[i] : 1)) return true;
  return false;
}

bool has_radial_table(const RenderPlan& plan) { return choices(plan).radial_panels > 0; }

Image image_by_march(const Scene& scene, const Theta& theta, int threads) {
  return marched_picture(scene, exposure_of(scene.microscope).directions.front(), theta, threads);
}

double march_error(const Scene& scene, const Theta& theta, int threads) {
  return march_error_on_twin(scene, exposure_of(scene.microscope).directions.front(), theta, threads, picture_of);
}

bool has_curved_rays(const Scene& scene) {
  const SampleKind& kind = kind_of(scene);
  return kind.curved_rays && kind.curved_rays(scene);
}

WaveChoice wave_choice(const Scene& scene, Demand demand, const Theta& theta) {
  demand.ceiling = Ceiling::wave;
  demand.rays = Rays::straight;
  try {
    const RenderPlan by_waves = plan(scene, demand, theta);
    const double seconds = by_waves.cost_seconds;
    return {seconds, !by_waves.wave, fmt::format("Wave optics of this scene takes about {:.2g} s an image.", seconds)};
  } catch (const UserError& error) {
    return {std::numeric_limits<double>::infinity(), false,
            fmt::format("Wave optics cannot do this scene: {}.", error.problems().front().what)};
  }
}

double ripple_period(const Scene& scene, const Demand& demand, const Theta& theta, int index) {
  if (demand.ceiling != Ceiling::wave || !has_series(scene) || demand.method == "split_step") return 0;
  return kind_of(scene).waves->series_ripple_period(scene, Values<double>(theta, {}, demand.memo.get()), index);
}

double fringe_phase_per_unit(const Scene& scene, const Demand& demand, const Theta& theta, int index) {
  const std::size_t i = static_cast<std::size_t>(index);
  const double h = std::max(1e-6, 1e-5 * std::abs(theta[i]));
  Theta up = theta, down = theta;
  up[i] += h;
  down[i] -= h;
  const std::vector<double> a = phases(scene, Values<double>(up, {}, demand.memo.get())),
                            b = phases(scene, Values<double>(down, {}, demand.memo.get()));
  double largest_change = 0;
  for (std::size_t k = 0; k < a.size(); ++k) largest_change = std::max(largest_change, std::abs(a[k] - b[k]));
  const double slope = largest_change / (2 * h);
  return slope > 1e-9 ? slope : 0;
}

namespace {

/// What of a scene an entry of a table moves, and how fast: itself, and what is tied to it.
std::vector<TieSlope> moved_by(const Scene& scene, const ParameterTable& table, const Theta& theta, int index) {
  std::vector<TieSlope> moved{{index, 1}};
  for_each_ref(scene, [&](const ParameterRef& ref) {
    if (!ref || !table.tie_of(ref.index)) return;
    for (const TieSlope& slope : table.slopes(ref.index, theta))
      if (slope.index == index && slope.by != 0) moved.push_back({ref.index, slope.by});
  });
  return moved;
}

}  // namespace

double fringe_phase_per_unit(const Scene& scene, const Demand& demand, const ParameterTable& table, const Theta& theta,
                             int index) {
  double sum = 0;
  for (const TieSlope& moved : moved_by(scene, table, theta, index))
    sum += std::abs(moved.by) * fringe_phase_per_unit(scene, demand, theta, moved.index);
  return sum;
}

double ripple_period(const Scene& scene, const Demand& demand, const ParameterTable& table, const Theta& theta,
                     int index) {
  for (const TieSlope& moved : moved_by(scene, table, theta, index))
    if (const double period = ripple_period(scene, demand, theta, moved.index); period > 0)
      return period / std::abs(moved.by);
  return 0;
}

}  // namespace birefit
