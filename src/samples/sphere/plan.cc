#include "samples/sphere/plan.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "birefit/error.h"
#include "samples/choices.h"
#include "samples/curved/eikonal_image.h"
#include "samples/pixels/pixel_plan.h"
#include "samples/pixels/sampling.h"
#include "samples/sphere/ball.h"
#include "samples/sphere/droplet.h"

namespace birefit {

namespace {

constexpr double kPi = std::numbers::pi;

/// Retardance phase (rad) of the droplet's ray at angle of incidence psi, as if a twist did not turn its modes.
double droplet_phase(const DropletOptics<double>& o, double psi) {
  DropletRay<double> ray{};
  ray.sin_out = std::sin(psi), ray.cos_out = std::cos(psi);
  ray.sin_in = o.ratio * ray.sin_out;
  if (ray.sin_in >= 1) return 0;
  ray.cos_in = std::sqrt(1 - square(ray.sin_in));
  ray.sin_deflection = ray.sin_out * ray.cos_in - ray.cos_out * ray.sin_in;
  ray.cos_deflection = ray.cos_out * ray.cos_in + ray.sin_out * ray.sin_in;
  return with_droplet_column(o, ray, [&](const auto& column) {
    // 64 midpoints in the clustered coordinate: enough for a planner.
    std::array<double, 64> u;
    std::array<OpticalPoint<double>, 64> p;
    for (std::size_t i = 0; i < u.size(); ++i) u[i] = (static_cast<double>(i) + 0.5) / 64;
    column.sample(u, p.data());
    double sum = 0;
    for (const auto& point : p) sum += retardance_per_length(point) * point.depth_slope_um / 64;
    return o.k0 * sum;
  });
}

/// One ray a radius instead of one a point, when that is fewer rays. plan.means.samples says how many those are.
void plan_radial_table(const Planning& planning, RenderPlan& plan) {
  using Image = DropletImage<Pack>;
  const Scene& scene = planning.scene;
  // A director from elements has small kinks between them, which no polynomial follows to more than this.
  const double share =
      std::holds_alternative<AxialDirector>(std::get<Droplet>(scene.sample).director) ? 10 * kTableShare : kTableShare;
  const double target = std::max(share * plan.demand.intensity_accuracy, 2e-11);
  // Rays were every point to have its own; of a droplet larger than the picture, its share.
  const double disc_px = std::numbers::pi * square(static_cast<double>(plan.means.samples.size()) * plan.means.bin_px);
  const double points = points_within(plan.means.samples, plan.means.bin_px).back() *
                        std::min(1.0, scene.view.width * static_cast<double>(scene.view.height) / disc_px);
  const Values<Pack> lanes = planning.value.as<Pack>();
  const bool shell = std::holds_alternative<ShellDirector>(std::get<Droplet>(scene.sample).director);
  Image image(scene, plan, lanes, planning.light);
  if (!image.can_tabulate()) {
    plan.reasons.push_back(
        "retardance has a kink where rays touch the core, too close to the rim for a table over the radius: one ray a "
        "point");
    return;
  }
  // The largest error of one part read at many places.
  const auto error_of = [&](Image::Part part, int panels) {
    std::array<Pack, Image::kMostTerms> direct;
    double error = 0;
    // A panel's error is largest near its ends; the golden ratio meets all places of a panel, the ends of the table
    // too. Closer to the centre than 1/1000 of the radius (v = 0.4 of that part) the mesh along the chord no longer
    // resolves the defect; the ripple this leaves is far below the accuracy but not smooth. A shell has a core there.
    const bool defect = part == Image::Part::centre && !shell;
    const double from = defect ? 0.4 : 0;
    for (int i = 0; i < 96; i += kLanes) {
      alignas(64) double v[kLanes];
      for (int k = 0; k < kLanes; ++k) {
        const double turn = (i + k + 0.5) * 0.6180339887498949;
        const double in_panel = (i + k + 0.1) / 8.2 / panels;
        v[k] = i + k >= 8 ? from + (1 - from) * (turn - std::floor(turn))
               : defect   ? 1 - in_panel
                          : in_panel;  // the rim, the core's edge
      }
      image.terms(part, Pack::load_aligned(v), direct.data());
      for (int f = 0; f < image.number_of_terms(); ++f) {
        std::array<Pack, Image::kMostTerms> basis;
        basis.fill(Pack(0.0));
        basis[static_cast<std::size_t>(f)] = Pack(1.0);
        const Pack read = image.tabulated_sum(part, Pack::load_aligned(v), basis.data());
        error = std::max(error, largest(max_of(direct[static_cast<std::size_t>(f)] - read,
                                               read - direct[static_cast<std::size_t>(f)])));
      }
    }
    return error;
  };
  choices(plan).radial_panels = 2;
  choices(plan).centre_panels = 2;
  while ((choices(plan).radial_panels + choices(plan).centre_panels) * RadialTable<Pack>::kPoints < points / 4) {
    image.set_panels(choices(plan).centre_panels, choices(plan).radial_panels);
    image.tabulate(Image::Wanted::picture, 1);
    const double rest = error_of(Image::Part::rest, choices(plan).radial_panels);
    const double centre = error_of(Image::Part::centre, choices(plan).centre_panels);
    if (rest <= target && centre <= target) {
      plan.reasons.push_back(fmt::format(
          "the droplet looks the same from all sides of the viewing axis: {} rays, one a radius, serve all pixels "
          "(interpolated to {}{})",
          (choices(plan).radial_panels + choices(plan).centre_panels) * RadialTable<Pack>::kPoints,
          sci(std::max(rest, centre)), shell ? "; the core's edge is an end of two tables" : ""));
      return;
    }
    if (rest > target) choices(plan).radial_panels += std::max(1, choices(plan).radial_panels / 4);
    if (centre > target) choices(plan).centre_panels += std::max(1, choices(plan).centre_panels / 4);
  }
  choices(plan).radial_panels = 0;
  plan.reasons.push_back("the picture has too few pixels for a table over the radius: one ray a point");
}

/// Retardance phase (rad) of the ball's ray that is seen at (rho, azimuth), as if its modes did not couple.
double ball_phase(const BallOptics<double>& o, const RimTable& rim, double rho_um, double azimuth) {
  const DropletRay<double> ray =
      trace(o.sphere, rim, std::min(rho_um, rim.rho_max() * o.sphere.radius_um * (1 - 1e-9)));
  return with_ball_column(o, ray, std::cos(azimuth), std::sin(azimuth), [&](const auto& column) {
    std::array<double, 48> u;
    std::array<OpticalPoint<double>, 48> p;
    for (std::size_t i = 0; i < u.size(); ++i) u[i] = (static_cast<double>(i) + 0.5) / 48;
    column.sample(u, p.data());
    double sum = 0;
    for (const auto& point : p) sum += retardance_per_length(point) * point.depth_slope_um / 48;
    return o.sphere.k0 * sum;
  });
}

/// What refraction at a shell's core would turn a straight ray by, half-way to its edge (rad).
double turned_by_core(const DropletOptics<double>& o) {
  if (o.director != DropletOptics<double>::Director::shell) return 0;
  return 2 * std::abs(std::asin(0.5) - std::asin(std::min(1.0, 0.5 * o.n_o / o.core_index)));
}

void note_rays(const Scene& scene, const Values<double>& value, const DropletOptics<double>& o, RenderPlan& plan) {
  const double worst_reflection = std::max(reflectance(o.n_e, o.n_host), reflectance(o.n_o, o.n_host));
  plan.model_error = 2 * worst_reflection;
  const double size = 2 * o.radius_um * o.n_host / value(scene.microscope.wavelength_nm) * 1000;
  if (size < 400 && plan.demand.rays == Rays::eikonal)
    plan.left_out.push_back(
        fmt::format("The droplet is {:.3g} wavelengths across: rays, curved as they are, leave out diffraction. An "
                    "image of beam propagation (23 wavelengths, "
                    "birefringence 0.22) is met to 2 % of its range, its birefringence to 0.3 % and its diameter to "
                    "0.1 %; the error bars do not contain this.",
                    size));
  else if (size < 400)
    plan.left_out.push_back(fmt::format(
        "The droplet is {:.3g} wavelengths across: straight rays leave out diffraction and walk-off. Measured on exact "
        "solutions of 5 to 20 um droplets of birefringence 0.22, ray images differ by 25 to 60 % RMS and a fitted "
        "birefringence comes out 1 to 7 % low. Where microscope.objective_na is given, a fit foretells what it is here "
        "and its error bars contain that; "
        "elsewhere they do not.",
        size));
  if (const double turned = turned_by_core(o); turned > 0.005 && plan.demand.rays == Rays::straight)
    plan.left_out.push_back(
        fmt::format("Light is taken straight through the shell's core; refraction there would turn a ray half-way to "
                    "the core's edge by {:.2g} degrees, "
                    "and moves fringes around the edge. The error bars do not contain this.",
                    turned * 180 / kPi));
}

std::unique_ptr<SampleImage<Pack>> straight_image(const Scene& scene, const RenderPlan& plan, const Values<Pack>& value,
                                                  const BeamMaker& light) {
  if (looks_round(std::get<Droplet>(scene.sample))) return make_droplet_image(scene, plan, value, light);
  return make_ball_image(scene, plan, value, light);
}

/// measure_points() of a droplet whose rays are planned.
void measure_points_of(const Planning& planning, RenderPlan& plan) {
  const std::unique_ptr<SampleImage<Pack>> model =
      straight_image(planning.scene, plan, planning.value.as<Pack>(), planning.light);
  model->tabulate(SampleImage<Pack>::Wanted::picture, 0);
  measure_points(*model, plan);
}

RenderPlan plan_ball(const Planning& planning) {
  const Scene& scene = planning.scene;
  const Values<double>& value = planning.value;
  RenderPlan plan = planning.start();
  const BallOptics<double> o = ball_optics(scene, value);
  if (plan.demand.method == "diagonal")
    throw UserError(Where{}, "transport.method: diagonal cannot do this droplet: its director turns along the rays",
                    "use auto or magnus4");
  const RimTable rim = rim_table(o.sphere);
  const Pilots pilots = sphere_pilots(scene, plan.demand, value);
  const Effort effort = cheapest_effort(pilots, plan.demand.intensity_accuracy,
                                        plan.demand.method == "auto" ? "" : plan.demand.method, true, "modal");
  plan.method = effort.method->info().name;
  plan.steps = effort.steps;
  plan.numerical_error = effort.error;
  plan.reasons.push_back(
      plan.demand.method != "auto"
          ? fmt::format("method {} was asked for by name", plan.method)
          : "the director leaves the plane of the ray: modes couple, so the full 2 x 2 transport is needed");
  plan.reasons.push_back(
      fmt::format("{}: {} steps, {} samples of the medium a ray, hold the intensity to {} on {} pilot rays (asked: "
                  "{}); no method needs fewer",
                  plan.method, plan.steps, effort.samples, sci(plan.numerical_error), pilots.size(),
                  sci(plan.demand.intensity_accuracy)));
  const double px = value(scene.view.pixel_size_um), edge = rim.rho_max() * o.sphere.radius_um;
  const int bins = std::max(2, static_cast<int>(std::ceil(edge / px)) + 2);
  if (bins > 100000)
    throw UserError(Where{}, "the droplet is more than 100000 pixels across", "check diameter_um and pixel_size_um");
  // The fringes on 64 radii and 24 azimuths; the fastest change over a pixel, along either, at each radius.
  constexpr int kRadii = 64, kAzimuths = 24;
  std::vector<double> gradient(kRadii + 1);
  double largest_phase = 0;
  for (int k = 0; k < kAzimuths; ++k) {
    double before = 0;
    for (int i = 0; i <= kRadii; ++i) {
      const double r = edge * i / kRadii, here = ball_phase(o, rim, r, 2 * kPi * k / kAzimuths),
                   beside = ball_phase(o, rim, r, 2 * kPi * (k + 0.5) / kAzimuths);
      largest_phase = std::max(largest_phase, std::abs(here));
      const double outward = i > 0 ? std::abs(here - before) / (edge / kRadii) : 0,
                   around = i > 0 ? std::abs(beside - here) / (r * kPi / kAzimuths) : 0;
      gradient[static_cast<std::size_t>(i)] =
          std::max(gradient[static_cast<std::size_t>(i)], std::hypot(outward, around) * px);
      before = here;
    }
  }
  sample_by_radius(plan, value(scene.view.center_x_px), value(scene.view.center_y_px), bins + 1, [&](double r) {
    if (r < 3) return r < 2 ? 8 : 6;  // where a defect may be
    const double f = std::min(kRadii - 1e-9, r * px / edge * kRadii);
    return samples_for(std::max(gradient[static_cast<std::size_t>(f)], gradient[static_cast<std::size_t>(f) + 1]),
                       plan.demand.intensity_accuracy);
  });
  if (plan.demand.method == "auto")
    plan_disc_squares(scene, value, planning.light, std::max(kSquaresShare * plan.demand.intensity_accuracy, 1e-10),
                      plan);
  else
    plan.reasons.push_back("the droplet does not look the same from all sides of the viewing axis: one ray a point");
  plan.means.samples.push_back(1);  // outside
  measure_points_of(planning, plan);
  note_rays(scene, value, o.sphere, plan);
  return plan;
}

/// Points per pixel of a droplet that looks the same from all sides, from its axis to `edge`: more where light changes
/// without bound, at `jumps` (all um).
void sample_round(const Scene& scene, const Values<double>& value, const DropletOptics<double>& o, double edge,
                  const std::vector<double>& jumps, RenderPlan& plan) {
  const RimTable rim = rim_table(o);
  const double px = value(scene.view.pixel_size_um);
  const int bins = std::max(2, static_cast<int>(std::ceil(edge / px)) + 2);
  if (bins > 100000)
    throw UserError(Where{}, "the droplet is more than 100000 pixels across", "check diameter_um and pixel_size_um");
  const auto phase_at = [&](double radius_um) {
    const double psi = rim.psi_at(std::clamp(radius_um / o.radius_um, 0.0, rim.rho_max()));
    return droplet_phase(o, psi);
  };
  double largest_phase = 0;
  for (int i = 0; i <= 64; ++i) largest_phase = std::max(largest_phase, phase_at(edge * i / 64));
  // Half a pixel apart, by the parabola through three places: all that the phase goes, there and back, and by how much
  // more it would go were it everywhere as fast as at the pixel's faster end. The difference of the ends alone is
  // nothing where the phase turns back.
  std::vector<double> step;
  for (int i = -1; i < 2 * bins + 4; ++i)
    step.push_back(phase_at(std::abs(0.5 * (i + 1) * px)) - phase_at(std::abs(0.5 * i * px)));
  const auto across = [&](std::size_t i) {
    return std::abs(step[i]) + std::abs(step[i + 1]) + 2 * std::abs(step[i + 1] - step[i]);
  };
  sample_by_radius(plan, value(scene.view.center_x_px), value(scene.view.center_y_px), bins + 1, [&](double r) {
    const double low = std::max(0.0, (r - 0.5) * px), high = (r + 0.5) * px;
    // The cross turns within the innermost pixels.
    if (r < 3) return r < 2 ? 8 : 6;
    for (const double jump : jumps)
      if (high > jump - px && low < jump + px) return 8;
    // Of pixels whose middles lie in this bin, r - 1/2 to r + 1/2.
    const std::size_t first = static_cast<std::size_t>(std::lround(2 * r - 1));
    return samples_for(std::max({across(first), across(first + 1), across(first + 2)}), plan.demand.intensity_accuracy);
  });
  // Outside the droplet one sample is enough.
  plan.means.samples.push_back(1);
  note_rays(scene, value, o, plan);
}

/// Each mode on its own curved ray.
RenderPlan plan_curved(const Planning& planning) {
  const Scene& scene = planning.scene;
  const Values<double>& value = planning.value;
  RenderPlan plan = planning.start();
  plan.method = "eikonal";
  const DropletOptics<double> o = droplet_optics(scene, value);
  EikonalImage<Pack> image(scene, plan, value.template as<Pack>(), planning.light);
  plan.reasons.push_back(o.axial
                             ? fmt::format("each mode on its own curved ray, {} of the extraordinary one integrated",
                                           image.integrated_rays())
                             : "each mode on its own curved ray, in closed form");
  if (plan.demand.method != "auto")
    plan.reasons.push_back(
        fmt::format("method {}, asked for by name, is for straight rays: not used", plan.demand.method));
  // Rays in a field have small kinks between the director's elements, which no polynomial follows to more than this.
  const double target = std::max((o.axial ? 100 : 1) * kTableShare * plan.demand.intensity_accuracy, 2e-11);
  constexpr int kMost = 32;
  double left = 0;
  int radii = 0;
  for (std::size_t part = 0; part < image.parts(); ++part) {
    int panels = 1;
    double error = image.tail(part, panels);
    while (error > target && panels < kMost) error = image.tail(part, panels += (panels + 1) / 2);
    choices(plan).part_panels.push_back(panels);
    left = std::max({left, error, image.table_error(part, panels)});
    radii += panels * RadialTable<Pack>::kPoints;
  }
  choices(plan).radial_panels = choices(plan).part_panels.empty() ? 1
                                                                  : *std::max_element(choices(plan).part_panels.begin(),
                                                                                      choices(plan).part_panels.end());
  plan.numerical_error = 2 * left + image.phase_error_rad();
  const std::vector<double> ends = image.ends_um();
  plan.reasons.push_back(
      fmt::format("light of either mode begins or ends at {} radii: {} rays between them, one a radius, serve all "
                  "pixels (interpolated to {})",
                  ends.size(), radii, sci(left)));
  sample_round(scene, value, o, ends.empty() ? o.radius_um : ends.back(), ends, plan);
  plan.reasons.push_back(fmt::format(
      "pixels are means over their area: up to {0} x {0} points where light jumps or fringes are finer than a pixel",
      *std::max_element(plan.means.samples.begin(), plan.means.samples.end())));
  return plan;
}

}  // namespace

/// A ring of defects where its tension and the field do not balance is on its way, or something holds it.
void note_sphere(const Scene& scene, const Values<double>& value, RenderPlan& plan) {
  const auto* axial = std::get_if<AxialDirector>(&std::get<Droplet>(scene.sample).director);
  if (!axial || !axial->ring_radius) return;
  const DropletOptics<double> o = droplet_optics(scene, value);
  const double e = o.axial->e(), ring = o.axial->ring();
  const RingBalance balance = ring_balance(e, ring, value.memo());
  // Cores of 5 to 10 nm, with up to one more for what they cost themselves.
  const double least = std::log(o.radius_um / 0.010), most = std::log(o.radius_um / 0.005) + 1;
  const std::string where =
      fmt::format("A ring of defects at {:.3g} of the radius under a reduced field of {:.3g}", ring, e);
  const std::string model =
      "Strong anchoring and one elastic constant are assumed, and the ring is taken to be where it is given or fitted.";
  if (!balance.stable)
    plan.warnings.push_back(fmt::format(
        "{} is not stable, whatever its core: a free one would move in and vanish, or out. {}", where, model));
  else if (balance.core_length < least || balance.core_length > most)
    plan.warnings.push_back(fmt::format(
        "{} is out of balance: {} and a free one would move {}. {}", where,
        balance.core_length > 1 && balance.core_length < 15
            ? fmt::format("it would be at rest for ln(radius/core) = {:.2g}, has {:.2g} to {:.2g} (core 5 to 10 nm),",
                          balance.core_length, least, most)
            : "cores of 5 to 10 nm are far from what would hold it there,",
        balance.core_length > most ? "out" : "in", model));
}

std::vector<double> sphere_phases(const Scene& scene, const Values<double>& value) {
  std::vector<double> result;
  const Droplet& droplet = std::get<Droplet>(scene.sample);
  if (!looks_round(droplet)) {
    const BallOptics<double> o = ball_optics(scene, value);
    const RimTable rim(o.sphere.ratio, o.sphere.n_host, 0);
    for (int i = 1; i < 8; ++i)
      for (int k = 0; k < 6; ++k)
        result.push_back(ball_phase(o, rim, rim.rho_max() * o.sphere.radius_um * i / 8, 2.399963 * (6 * i + k)));
  } else {
    const DropletOptics<double> o = droplet_optics(scene, value);
    for (int i = 1; i < 12; ++i) result.push_back(droplet_phase(o, std::asin(std::min(1.0, 1 / o.ratio)) * i / 12));
    result.push_back(o.twist_rad);
  }
  return result;
}

RenderPlan plan_sphere(const Planning& planning) {
  const Scene& scene = planning.scene;
  const Values<double>& value = planning.value;
  RenderPlan plan = planning.start();
  if (plan.demand.ceiling == Ceiling::reflections)
    throw UserError(Where{}, "ceiling: reflections is for cells and slabs", "use one_way");
  const Droplet& droplet = std::get<Droplet>(scene.sample);
  if (plan.demand.rays == Rays::eikonal && !rays_stay_meridional(droplet))
    throw UserError(Where{},
                    "physics.rays: eikonal is for radial droplets without twist, shells whose core is in the middle "
                    "and droplets in a field along the view",
                    "use straight or auto");
  if (!looks_round(droplet)) return plan_ball(planning);
  if (plan.demand.rays == Rays::eikonal) return plan_curved(planning);
  const DropletOptics<double> o = droplet_optics(scene, value);
  const RimTable rim = rim_table(o);
  const bool twisted = o.coupled(), axial = o.axial != nullptr;
  if (plan.demand.method == "diagonal" && twisted)
    throw UserError(Where{}, "transport.method: diagonal cannot do a twisted director, its modes are coupled",
                    "use auto or magnus4");
  const Pilots pilots = sphere_pilots(scene, plan.demand, value);
  // The measure is an upper bound: no further margin. Twisted, the chord's map has a kink in the middle.
  const Effort effort = cheapest_effort(pilots, plan.demand.intensity_accuracy,
                                        plan.demand.method == "auto" ? "" : plan.demand.method, twisted, "modal");
  plan.method = effort.method->info().name;
  plan.steps = effort.steps;
  plan.numerical_error = effort.error;
  if (plan.demand.method != "auto")
    plan.reasons.push_back(fmt::format("method {} was asked for by name", plan.method));
  else if (twisted)
    plan.reasons.push_back(
        "the twisted director leaves the plane of the ray: modes couple, so the full 2 x 2 transport is needed");
  else
    plan.reasons.push_back(axial ? "the director stays in the meridional plane of every ray: transport is diagonal, "
                                   "one phase integral suffices"
                                 : "the radial director stays in the meridional plane of every ray: transport is "
                                   "diagonal, one phase integral suffices");
  plan.reasons.push_back(
      fmt::format("{}: {}, {} samples of the medium a ray, hold the intensity to {} on {} pilot rays (asked: {}); no "
                  "method needs fewer",
                  plan.method, effort_text(plan.method, plan.steps), effort.samples, sci(plan.numerical_error),
                  pilots.size(), sci(plan.demand.intensity_accuracy)));
  plan.reasons.push_back(
      "normal incidence in the frame of each refracted ray: a retarder (unit quaternion), no 4 x 4 and no oblique "
      "terms");

  sample_round(scene, value, o, rim.rho_max() * o.radius_um, {}, plan);
  plan_radial_table(planning, plan);
  measure_points_of(planning, plan);
  return plan;
}

}  // namespace birefit
