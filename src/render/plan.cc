// The planner: the cheapest method that holds the requested accuracy, found by measuring a few pilot rays against a
// converged computation of the same physics, not by rules of thumb. docs/methods.md, "Choosing".

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include <fmt/format.h>

#include "birefit/render.h"
#include "medium/build.h"
#include "medium/validity.h"
#include "render/ball.h"
#include "render/cone_view.h"
#include "render/disc.h"
#include "render/droplet.h"
#include "render/eikonal_image.h"
#include "render/fringe_table.h"
#include "render/pilots.h"
#include "render/pixel_plan.h"
#include "render/planar.h"
#include "render/retardance.h"
#include "render/sampling.h"
#include "render/series.h"
#include "render/volume.h"
#include "render/wave.h"
#include "transport/methods.h"

namespace birefit {
namespace {

constexpr double kPi = std::numbers::pi;

std::string sci(double x) { return fmt::format("{:.1e}", x); }

/// Smallest entry of `candidates` whose worst pilot error is within `target`; fills error. Falls back to the last.
int choose(const std::vector<int>& candidates, double target, const std::function<double(int)>& error_of,
           double& error) {
  for (int n : candidates) {
    error = error_of(n);
    if (error <= target) return n;
  }
  return candidates.back();
}
const std::vector<int> kSteps{1,  2,  3,  4,  5,  6,  8,   10,  12,  14,  16,  18,   20,   22,   24,  28,
                              32, 40, 48, 64, 80, 96, 128, 192, 256, 384, 512, 1024, 2048, 4096, 8192};

/// "12 steps", or Gauss nodes.
std::string effort_text(const std::string& method, int steps) {
  return fmt::format("{} {}", steps, method == "diagonal" ? "Gauss nodes" : "steps");
}

void check_method(const Scene& scene) {
  if (scene.method == "auto") return;
  if (scene.ceiling == Ceiling::wave) {
    if (scene.method == "split_step" || (scene.method == "series" && has_series(scene))) return;
    if (scene.method == "series")
      throw UserError(Where{}, "transport method 'series' is for radial droplets without twist and concentric shells",
                      "use auto or split_step");
    throw UserError(Where{}, fmt::format("transport method '{}' is for rays", scene.method),
                    "ceiling: wave knows series and split_step; or leave transport.method at auto");
  }
  if (scene.method == "series" || scene.method == "split_step")
    throw UserError(Where{}, fmt::format("transport method '{}' belongs to ceiling: wave", scene.method),
                    "set physics.ceiling: wave, or leave transport.method at auto");
  const auto& names = transport_method_names();
  if (std::find(names.begin(), names.end(), scene.method) == names.end())
    throw UserError(Where{}, fmt::format("transport method '{}' does not exist", scene.method),
                    fmt::format("use auto or one of: {}", fmt::join(names, ", ")));
  if ((scene.method == "berreman") != (scene.ceiling == Ceiling::reflections))
    throw UserError(
        Where{}, fmt::format("transport method '{}' and this physics.ceiling exclude each other", scene.method),
        "berreman computes all reflections and belongs to ceiling: reflections; leave transport.method at auto");
  if (scene.method == "modal" &&
      (std::holds_alternative<Droplet>(scene.sample) || std::holds_alternative<SampledVolume>(scene.sample)))
    throw UserError(
        Where{},
        "transport method 'modal' is for cells, slabs and plates: in a droplet the axis passes every ray's wavevector",
        "leave transport.method at auto");
}

// ---- what no method here models ------------------------------------------------------------------------------------

void note_illumination(const Scene& scene, const Values<double>& value, double largest_phase, RenderPlan& plan) {
  const Microscope& m = scene.microscope;
  if (m.bandwidth_nm > 0) {
    const double s = largest_phase * m.bandwidth_nm / 2.355 / value(m.wavelength_nm);
    const double loss = 0.5 * (1 - std::exp(-0.5 * s * s));
    plan.model_error = std::hypot(plan.model_error, loss);
    if (loss > 1e-3)
      plan.warnings.push_back(
          fmt::format("The light's bandwidth of {:g} nm is not modelled; at the largest retardance here ({:.3g} rad) "
                      "it changes the "
                      "intensity by up to {:.2g}.",
                      m.bandwidth_nm, largest_phase, loss));
  }
  if (m.condenser_na > 0) {
    const double s = largest_phase * m.condenser_na * m.condenser_na / 8;  // mean phase shift over the cone, n ~ 1.5
    const double loss = std::min(0.5, 0.5 * std::abs(s));
    plan.model_error = std::hypot(plan.model_error, loss);
    if (loss > 1e-3)
      plan.warnings.push_back(
          fmt::format("The condenser's aperture (NA {:g}) is not modelled; it shifts the phase by about {:.2g} rad.",
                      m.condenser_na, s));
  }
}

double reflectance(double n1, double n2) { return square((n1 - n2) / (n1 + n2)); }

// ---- droplets ------------------------------------------------------------------------------------------------------

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

/// points(r): a pixel side, of pixels whose middles are about r pixels from the centre.
void sample_by_radius(RenderPlan& plan, double center_x, double center_y, double bins,
                      const std::function<int(double)>& points) {
  plan.sampling_center_x_px = center_x;
  plan.sampling_center_y_px = center_y;
  plan.sampling_bin_px = 1;
  plan.samples.clear();
  for (int i = 0; i < bins; ++i) plan.samples.push_back(points(i + 0.5));
}

/// Of the accuracy asked for: the table's error stays far below it, so that neither the image nor its slope shows the
/// panels.
constexpr double kTableShare = 1e-3;
/// In two dimensions digits are dearer.
constexpr double kSquaresShare = 1e-2;

/// One ray a radius instead of one a point, when that is fewer rays. plan.samples says how many those are.
void plan_radial_table(const Scene& scene, const Values<double>& value, RenderPlan& plan) {
  using Image = DropletImage<Pack>;
  // A director from elements has small kinks between them, which no polynomial follows to more than this.
  const double share =
      std::holds_alternative<AxialDirector>(std::get<Droplet>(scene.sample).director) ? 10 * kTableShare : kTableShare;
  const double target = std::max(share * scene.intensity_accuracy, 2e-11);
  // Rays were every point to have its own; of a droplet larger than the picture, its share.
  const double disc_px = std::numbers::pi * square(static_cast<double>(plan.samples.size()) * plan.sampling_bin_px);
  const double points = points_within(plan.samples, plan.sampling_bin_px).back() *
                        std::min(1.0, scene.view.width * static_cast<double>(scene.view.height) / disc_px);
  const Values<Pack> lanes = value.template as<Pack>();
  const bool shell = std::holds_alternative<ShellDirector>(std::get<Droplet>(scene.sample).director);
  Image image(scene, plan, lanes);
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
  plan.radial_panels = 2;
  plan.centre_panels = 2;
  while ((plan.radial_panels + plan.centre_panels) * RadialTable<Pack>::kPoints < points / 4) {
    image.set_panels(plan.centre_panels, plan.radial_panels);
    image.tabulate(Image::Wanted::picture, 1);
    const double rest = error_of(Image::Part::rest, plan.radial_panels);
    const double centre = error_of(Image::Part::centre, plan.centre_panels);
    if (rest <= target && centre <= target) {
      plan.reasons.push_back(fmt::format(
          "the droplet looks the same from all sides of the viewing axis: {} rays, one a radius, serve all pixels "
          "(interpolated to {}{})",
          (plan.radial_panels + plan.centre_panels) * RadialTable<Pack>::kPoints, sci(std::max(rest, centre)),
          shell ? "; the core's edge is an end of two tables" : ""));
      return;
    }
    if (rest > target) plan.radial_panels += std::max(1, plan.radial_panels / 4);
    if (centre > target) plan.centre_panels += std::max(1, plan.centre_panels / 4);
  }
  plan.radial_panels = 0;
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
  if (size < 400 && scene.rays == Rays::eikonal)
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
  if (const double turned = turned_by_core(o); turned > 0.005 && scene.rays == Rays::straight)
    plan.warnings.push_back(
        fmt::format("Light is taken straight through the shell's core; refraction there would turn a ray half-way to "
                    "the core's edge by {:.2g} degrees, "
                    "and moves fringes around the edge. The error bars do not contain this.",
                    turned * 180 / kPi));
}

/// A ring of defects where its tension and the field do not balance is on its way, or something holds it.
void note_ring(const Scene& scene, const Values<double>& value, RenderPlan& plan) {
  const auto* droplet = std::get_if<Droplet>(&scene.sample);
  const auto* axial = droplet ? std::get_if<AxialDirector>(&droplet->director) : nullptr;
  if (!axial || !axial->ring_radius) return;
  const DropletOptics<double> o = droplet_optics(scene, value);
  const double e = o.axial->e(), ring = o.axial->ring();
  const RingBalance balance = ring_balance(e, ring);
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

/// measure_points() of a droplet whose rays are planned.
void measure_points_of(const Scene& scene, const Values<double>& value, RenderPlan& plan) {
  const Values<Pack> lanes = value.as<Pack>();
  const std::unique_ptr<PixelModel<Pack>> model = looks_round(std::get<Droplet>(scene.sample))
                                                      ? make_droplet_model(scene, plan, lanes)
                                                      : make_ball_model(scene, plan, lanes);
  model->tabulate(PixelModel<Pack>::Wanted::picture, 0);
  measure_points(scene, *model, plan);
}

RenderPlan plan_ball(const Scene& scene, const Values<double>& value) {
  RenderPlan plan;
  const BallOptics<double> o = ball_optics(scene, value);
  if (scene.method == "diagonal")
    throw UserError(Where{}, "transport.method: diagonal cannot do this droplet: its director turns along the rays",
                    "use auto or magnus4");
  const RimTable rim(o.sphere.ratio, o.sphere.n_host, scene.microscope.objective_na);
  const Pilots pilots(scene, value);
  const Effort effort =
      cheapest_effort(pilots, scene.intensity_accuracy, scene.method == "auto" ? "" : scene.method, true, "modal");
  plan.method = effort.method->info().name;
  plan.steps = effort.steps;
  plan.numerical_error = effort.error;
  plan.reasons.push_back(
      scene.method != "auto"
          ? fmt::format("method {} was asked for by name", plan.method)
          : "the director leaves the plane of the ray: modes couple, so the full 2 x 2 transport is needed");
  plan.reasons.push_back(
      fmt::format("{}: {} steps, {} samples of the medium a ray, hold the intensity to {} on {} pilot rays (asked: "
                  "{}); no method needs fewer",
                  plan.method, plan.steps, effort.samples, sci(plan.numerical_error), pilots.size(),
                  sci(scene.intensity_accuracy)));
  const double px = scene.view.pixel_size_um, edge = rim.rho_max() * o.sphere.radius_um;
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
                       scene.intensity_accuracy);
  });
  if (scene.method == "auto")
    plan_disc_squares(scene, value, std::max(kSquaresShare * scene.intensity_accuracy, 1e-10), plan);
  else
    plan.reasons.push_back("the droplet does not look the same from all sides of the viewing axis: one ray a point");
  plan.samples.push_back(1);  // outside
  measure_points_of(scene, value, plan);
  note_rays(scene, value, o.sphere, plan);
  note_illumination(scene, value, largest_phase, plan);
  return plan;
}

/// Points per pixel of a droplet that looks the same from all sides, from its axis to `edge`: more where light changes
/// without bound, at `jumps` (all um).
void sample_round(const Scene& scene, const Values<double>& value, const DropletOptics<double>& o, double edge,
                  const std::vector<double>& jumps, RenderPlan& plan) {
  const RimTable rim(o.ratio, o.n_host, scene.microscope.objective_na);
  const double px = scene.view.pixel_size_um;
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
    return samples_for(std::max({across(first), across(first + 1), across(first + 2)}), scene.intensity_accuracy);
  });
  // Outside the droplet one sample is enough.
  plan.samples.push_back(1);
  note_rays(scene, value, o, plan);
  note_illumination(scene, value, largest_phase, plan);
}

/// Each mode on its own curved ray.
RenderPlan plan_curved(const Scene& scene, const Values<double>& value) {
  RenderPlan plan;
  plan.method = "eikonal";
  const DropletOptics<double> o = droplet_optics(scene, value);
  EikonalImage<Pack> image(scene, plan, value.template as<Pack>());
  plan.reasons.push_back(o.axial
                             ? fmt::format("each mode on its own curved ray, {} of the extraordinary one integrated",
                                           image.integrated_rays())
                             : "each mode on its own curved ray, in closed form");
  if (scene.method != "auto")
    plan.reasons.push_back(fmt::format("method {}, asked for by name, is for straight rays: not used", scene.method));
  // Rays in a field have small kinks between the director's elements, which no polynomial follows to more than this.
  const double target = std::max((o.axial ? 100 : 1) * kTableShare * scene.intensity_accuracy, 2e-11);
  constexpr int kMost = 32;
  double left = 0;
  int radii = 0;
  for (std::size_t part = 0; part < image.parts(); ++part) {
    int panels = 1;
    double error = image.tail(part, panels);
    while (error > target && panels < kMost) error = image.tail(part, panels += (panels + 1) / 2);
    plan.part_panels.push_back(panels);
    left = std::max({left, error, image.table_error(part, panels)});
    radii += panels * RadialTable<Pack>::kPoints;
  }
  plan.radial_panels =
      plan.part_panels.empty() ? 1 : *std::max_element(plan.part_panels.begin(), plan.part_panels.end());
  plan.numerical_error = 2 * left + image.phase_error_rad();
  const std::vector<double> ends = image.ends_um();
  plan.reasons.push_back(
      fmt::format("light of either mode begins or ends at {} radii: {} rays between them, one a radius, serve all "
                  "pixels (interpolated to {})",
                  ends.size(), radii, sci(left)));
  sample_round(scene, value, o, ends.empty() ? o.radius_um : ends.back(), ends, plan);
  plan.reasons.push_back(fmt::format(
      "pixels are means over their area: up to {0} x {0} points where light jumps or fringes are finer than a pixel",
      *std::max_element(plan.samples.begin(), plan.samples.end())));
  return plan;
}

RenderPlan plan_droplet(const Scene& scene, const Values<double>& value) {
  RenderPlan plan;
  if (scene.ceiling == Ceiling::reflections)
    throw UserError(Where{}, "ceiling: reflections is for cells and slabs", "use one_way");
  const Droplet& droplet = std::get<Droplet>(scene.sample);
  if (scene.rays == Rays::eikonal && !has_curved_rays(scene))
    throw UserError(Where{},
                    "physics.rays: eikonal is for radial droplets without twist, shells whose core is in the middle "
                    "and droplets in a field along the view",
                    "use straight or auto");
  if (!looks_round(droplet)) return plan_ball(scene, value);
  if (scene.rays == Rays::eikonal) return plan_curved(scene, value);
  const DropletOptics<double> o = droplet_optics(scene, value);
  const RimTable rim(o.ratio, o.n_host, scene.microscope.objective_na);
  const bool twisted = o.coupled(), axial = o.axial != nullptr;
  if (scene.method == "diagonal" && twisted)
    throw UserError(Where{}, "transport.method: diagonal cannot do a twisted director, its modes are coupled",
                    "use auto or magnus4");
  const Pilots pilots(scene, value);
  // The measure is an upper bound: no further margin. Twisted, the chord's map has a kink in the middle.
  const Effort effort =
      cheapest_effort(pilots, scene.intensity_accuracy, scene.method == "auto" ? "" : scene.method, twisted, "modal");
  plan.method = effort.method->info().name;
  plan.steps = effort.steps;
  plan.numerical_error = effort.error;
  if (scene.method != "auto")
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
                  pilots.size(), sci(scene.intensity_accuracy)));
  plan.reasons.push_back(
      "normal incidence in the frame of each refracted ray: a retarder (unit quaternion), no 4 x 4 and no oblique "
      "terms");

  sample_round(scene, value, o, rim.rho_max() * o.radius_um, {}, plan);
  plan_radial_table(scene, value, plan);
  measure_points_of(scene, value, plan);
  return plan;
}

// ---- cells, plates, slabs ------------------------------------------------------------------------------------------

Ray<double> ray_at(const PlanarOptics<double>& o, double tx, double ty) {
  const double c = 1 / std::sqrt(1 + tx * tx + ty * ty);
  return {o.k0, o.n_host * c * tx, o.n_host * c * ty, o.continuity};
}

/// Phase difference of the two modes (rad), a sum over midpoints.
double planar_phase(const PlanarOptics<double>& o, double tx, double ty, int nodes = 64) {
  const Ray<double> ray = ray_at(o, tx, ty);
  std::vector<double> u(static_cast<std::size_t>(nodes));
  for (int i = 0; i < nodes; ++i) u[static_cast<std::size_t>(i)] = (i + 0.5) / nodes;
  std::vector<OpticalPoint<double>> p(u.size());
  o.column->sample(u, p.data());
  double sum = 0;
  for (const auto& point : p) {
    const double eo = point.ordinary, de = point.extraordinary - eo;
    const double ak = point.axis.x * ray.kx + point.axis.y * ray.ky, kk = ray.kx * ray.kx + ray.ky * ray.ky;
    const double a = eo + de * square(point.axis.z), b = de * point.axis.z * ak,
                 c = eo * kk + de * ak * ak - eo * point.extraordinary;
    const double root = b * b - a * c;
    if (eo <= kk || root <= 0) return 0;
    sum += ((std::sqrt(root) - b) / a - std::sqrt(eo - kk)) * point.depth_slope_um / nodes;
  }
  return o.k0 * sum;
}

/// Closed-form pixel means (render/fringe.h) wherever they agree with 8 x 8 Gauss points; around the image of the optic
/// axis, where the modes turn within a pixel, the points stay. False when the fringes curve too fast for the formula.
bool plan_fringe_means(const Scene& scene, const Values<double>& value, const PlanarOptics<double>& o,
                       RenderPlan& plan) {
  const int w = scene.view.width, h = scene.view.height;
  RenderPlan trial = plan;
  trial.fringe_means = true;
  // Along the axis inside, the wavevector is n_o a.
  OpticalPoint<double> face;
  const double start[1] = {0.0};
  o.column->sample(start, &face);
  const double n_o = std::sqrt(face.ordinary), sign = face.axis.z < 0 ? -1 : 1;
  const double sx = sign * n_o * face.axis.x / o.n_host, sy = sign * n_o * face.axis.y / o.n_host,
               s2 = sx * sx + sy * sy;
  constexpr int kAround = 10;  // pixels
  trial.samples = {1};
  if (s2 < 1) {
    const double cosine = std::sqrt(1 - s2);
    const auto [column, row] = ConeView<double>(scene, value).pixel_of({sx / cosine, sy / cosine});
    if (column > -kAround && row > -kAround && column < w + kAround && row < h + kAround) {
      trial.sampling_center_x_px = column;
      trial.sampling_center_y_px = row;
      trial.sampling_bin_px = 1;
      trial.samples.assign(kAround + 1, 1);
      std::fill(trial.samples.begin(), trial.samples.begin() + 4, 8);
      std::fill(trial.samples.begin() + 4, trial.samples.begin() + kAround, 4);
    }
  }
  RenderPlan points = trial;
  points.fringe_means = false;
  points.samples = {8};
  std::vector<std::array<int, 2>> pilots;
  for (int i = 0; i < 64; ++i) {
    const auto at = [&](double turn, int size) {
      return std::min(size - 1, static_cast<int>((turn - std::floor(turn)) * size));
    };
    // the plastic number: even in two dimensions
    pilots.push_back({at(i * 0.7548776662466927, w), at(i * 0.5698402909980532, h)});
  }
  for (int i : {0, w - 1})
    for (int j : {0, h - 1}) pilots.push_back({i, j});
  Theta theta = value.theta();
  const double error = (render_pixels(scene, trial, theta, pilots, {}, 1).intensity -
                        render_pixels(scene, points, theta, pilots, {}, 1).intensity)
                           .cwiseAbs()
                           .maxCoeff();
  if (!(error <= scene.intensity_accuracy)) return false;
  plan = trial;
  plan.numerical_error = std::max(plan.numerical_error, error);
  return true;
}

/// Squares of the picture whose fringes are smooth enough to be interpolated from 144 rays each; of the sizes tried,
/// from the whole picture on, the one with the fewest rays.
void plan_fringe_blocks(const Scene& scene, const Values<double>& value, RenderPlan& plan) {
  const int w = scene.view.width, h = scene.view.height;
  // Less than 1e-9 the powers of a phase of some hundred radians do not hold.
  constexpr double kLeast = 1e-9;
  if (scene.intensity_accuracy < 10 * kLeast) return;
  const double target = std::max(kSquaresShare * scene.intensity_accuracy, kLeast);
  constexpr int kColumns = 8, kRims = 2 * FringeBlocks::kRim;
  const Values<Pack> lanes = value.template as<Pack>();
  const std::unique_ptr<PixelModel<Pack>> model = make_planar_model(scene, plan, lanes);
  double fewest = 0.5 * w * h;
  for (int parts = 1;; parts *= 2) {
    constexpr int kWhole = 8;  // lanes do not cross from square to square
    static_assert(kWhole % kLanes == 0);
    const int size = ((std::max(w, h) + kRims + parts - 1) / parts + kWhole - 1) / kWhole * kWhole;
    const FringeBlocks blocks(w, h, size);
    const double least = static_cast<double>(blocks.count()) * FringeTable<Pack>::kRays;
    if (least >= fewest) break;
    const FringeTable<Pack> table(blocks, std::vector<std::uint8_t>(static_cast<std::size_t>(blocks.count()), 1),
                                  kGivenUp * scene.intensity_accuracy, 0, {},
                                  [&](const Pack& column, const Pack& row) { return model->fringe(column, row); });
    std::vector<std::uint8_t> smooth(static_cast<std::size_t>(blocks.count()), 0);
    parallel_for(blocks.count(), 0, [&](int b) {
      const double left = (b % blocks.columns) * size - FringeBlocks::kRim,
                   top = (b / blocks.columns) * size - FringeBlocks::kRim;
      FringeScratch scratch;
      for (const double down : {0.02, 0.31, 0.77, 0.98})  // none a Chebyshev point, the ends among them
        for (int first = 0; first < kColumns; first += kLanes) {
          alignas(64) double column[kLanes];
          for (int k = 0; k < kLanes; ++k)
            column[k] = left + size * (0.01 + 0.98 * std::min(first + k, kColumns - 1) / (kColumns - 1.0));
          const double row = top + down * size;
          const FringePoint<Pack> exact = model->fringe(Pack::load_aligned(column), Pack(row));
          for (int k = 0; k < kLanes; ++k) {
            FringePoint<double> read;
            if (!table.read(column[k], row, scratch, read)) return;
            const auto distance = [k](const Pack& a, double c) { return std::abs(lane(a, k) - c); };
            // Every part counts as the intensity it changes.
            const double size_of_fringe = std::abs(lane(exact.amplitude, k)) + std::abs(lane(exact.quadrature, k));
            const double error = distance(exact.mean, read.mean) + distance(exact.amplitude, read.amplitude) +
                                 distance(exact.quadrature, read.quadrature) +
                                 size_of_fringe * distance(exact.phase, read.phase);
            if (!(error <= target)) return;  // also where there is no number: total reflection outside the picture
          }
        }
      smooth[static_cast<std::size_t>(b)] = 1;
    });
    double left_over = 0;  // pixels
    for (int b = 0; b < blocks.count(); ++b)
      if (!smooth[static_cast<std::size_t>(b)])
        left_over += static_cast<double>(std::min(size, w + kRims - b % blocks.columns * size)) *
                     std::min(size, h + kRims - b / blocks.columns * size);
    if (least + left_over < fewest) {
      fewest = least + left_over;
      plan.fringe_block_px = size;
      plan.fringe_blocks = smooth;
    }
  }
  if (plan.fringe_block_px == 0) return;
  plan.numerical_error += target;
  plan.reasons.push_back(fmt::format("{} of {} squares of {} pixels have their fringes interpolated from {} rays each",
                                     std::count(plan.fringe_blocks.begin(), plan.fringe_blocks.end(), 1),
                                     plan.fringe_blocks.size(), plan.fringe_block_px, FringeTable<Pack>::kRays));
}

/// All reflections: as many steps of the 4 x 4 transport as change nothing when doubled.
RenderPlan plan_reflections(const Scene& scene, const Values<double>& value, const PlanarOptics<double>& o,
                            const std::vector<std::pair<double, double>>& directions) {
  RenderPlan plan;
  plan.method = "berreman";
  const Berreman<double> method;
  // Halving a step of order 4 leaves a sixteenth of its error.
  const auto change = [&](int n) {
    const Mesh mesh = uniform_mesh(n, o.column->breaks);
    Mesh halved{0.0};
    for (std::size_t i = 1; i < mesh.size(); ++i) halved.insert(halved.end(), {0.5 * (mesh[i - 1] + mesh[i]), mesh[i]});
    double largest = 0;
    for (const auto& [tx, ty] : directions)
      largest = std::max(largest, intensity_distance(planar_jones<double>(o, method, mesh, tx, ty),
                                                     planar_jones<double>(o, method, halved, tx, ty)));
    return largest;
  };
  plan.steps = choose(kSteps, scene.intensity_accuracy, change, plan.numerical_error);
  plan.reasons.push_back(
      fmt::format("{} steps of the 4 x 4 transport hold the intensity to {} on {} directions (asked: {})", plan.steps,
                  sci(plan.numerical_error), directions.size(), sci(scene.intensity_accuracy)));
  plan.reasons.push_back("asked for by physics.ceiling: all reflections, between the two faces too");
  if (plan.numerical_error > scene.intensity_accuracy)
    plan.warnings.push_back(fmt::format("Even {} steps err by {}.", plan.steps, sci(plan.numerical_error)));
  double largest_phase = 0, round_trip = 0;
  OpticalPoint<double> middle;
  const double half[1] = {0.5};
  o.column->sample(half, &middle);
  for (const auto& [tx, ty] : directions) largest_phase = std::max(largest_phase, std::abs(planar_phase(o, tx, ty)));
  round_trip = 2 * o.k0 * std::sqrt(middle.ordinary) * middle.depth_slope_um;
  const double bandwidth = scene.microscope.bandwidth_nm / value(scene.microscope.wavelength_nm);
  if (round_trip * bandwidth > 1)
    plan.warnings.push_back(
        fmt::format("Light of this bandwidth does not interfere between the faces (the phase of a round trip spreads "
                    "by {:.2g} rad), but is computed "
                    "as if it did: ceiling one_way is nearer to what is seen.",
                    round_trip * bandwidth));
  note_illumination(scene, value, largest_phase, plan);
  return plan;
}

bool has_fringes(const Effort& effort) {
  const std::string name = effort.method->info().name;
  return name == "diagonal" || name == "modal";
}

/// Whether the slow solutions of the modes hold in the whole picture, not only on the pilots: where the axis comes near
/// the wavevector the modes turn too fast for them. What their last pass changes tells.
bool slow_everywhere(const Scene& scene, const Values<double>& value, const PlanarOptics<double>& o,
                     const Effort& effort) {
  const ConeView<double> cone(scene, value);
  const double w = scene.view.width, h = scene.view.height;
  const Mesh mesh = uniform_mesh(effort.steps, o.column->breaks);
  constexpr int kAcross = 24, kPasses = Modal<double>::kPasses;
  const auto medium = [&](double u) {
    OpticalPoint<double> p;
    o.column->sample({&u, 1}, &p);
    return p;
  };
  for (int i = 0; i <= kAcross; ++i)
    for (int j = 0; j <= kAcross; ++j) {
      const auto t = cone.at(w * i / kAcross - 0.5, h - 0.5 - h * j / kAcross);
      const Ray<double> ray = ray_at(o, t.x, t.y);
      if (modes_turn_over(medium, ray, 0, 1, 32)) return false;
      const Mat2<double> all = together(modal_transfer(*o.column, ray, mesh, kPasses)),
                         fewer = together(modal_transfer(*o.column, ray, mesh, kPasses - 1));
      if (!(intensity_distance(all, fewer) <= scene.intensity_accuracy)) return false;
    }
  return true;
}

/// What a camera at the side does to the picture, in words.
void note_camera(const Scene& scene, const Values<double>& value, const ConeView<double>& view, RenderPlan& plan) {
  if (!scene.view.camera) return;
  const double x = std::tan(value.radians(scene.view.camera->tilt_x_deg)),
               y = std::tan(value.radians(scene.view.camera->tilt_y_deg));
  const double t = std::hypot(x, y), w = scene.view.width - 0.5, h = scene.view.height - 0.5;
  const auto [far, near] =
      std::minmax({view.nearness(-0.5, -0.5), view.nearness(-0.5, h), view.nearness(w, -0.5), view.nearness(w, h)});
  plan.reasons.push_back(
      fmt::format("the camera sees the screen from {:.3g} degrees aside, azimuth {:.3g}: foreshortened there to "
                  "{:.3g}; the scale in the picture's corners goes from {:.3g} to {:.3g} of the middle's",
                  std::atan(t) * 180 / kPi, std::atan2(y, x) * 180 / kPi, 1 / std::hypot(1.0, t), far, near));
}

RenderPlan plan_planar(const Scene& scene, const Values<double>& value) {
  RenderPlan plan;
  if (scene.view.camera) {
    // A twentieth of the middle's scale: what is twenty times as far away as the middle is not a picture of a screen
    // any more.
    const ConeView<double> view(scene, value);
    for (const int column : {0, scene.view.width - 1})
      for (const int row : {0, scene.view.height - 1})
        if (!(view.nearness(column, row) > 0.05))
          throw UserError(
              Where{},
              fmt::format("the corner of the picture at column {}, row {} looks past the horizon of the screen", column,
                          row),
              "lower half_field_deg or the tilt of view.camera");
  }
  const PlanarOptics<double> o = planar_optics(scene, value);
  o.column->freeze();  // no node set comes twice: remembering them would only cost the search
  const auto directions = pilot_directions(scene, value);
  const std::optional<ParameterRef> half_angle = cone_half_angle(scene);
  const bool cone = half_angle.has_value();
  for (const auto& [tx, ty] : pilot_directions(scene, value, std::numeric_limits<std::size_t>::max())) {
    const Ray<double> ray = ray_at(o, tx, ty);
    std::vector<double> u{0.0, 0.5, 1.0};
    OpticalPoint<double> p[3];
    o.column->sample(u, p);
    for (const auto& q : p)
      if (std::min(q.ordinary, q.extraordinary) <= ray.kx * ray.kx + ray.ky * ray.ky)
        throw UserError(
            Where{},
            "a direction of this scene is totally reflected: its tangential wavevector exceeds an index of the sample",
            "lower the angle of incidence or the surround's index");
  }
  if (scene.ceiling == Ceiling::reflections) return plan_reflections(scene, value, o, directions);
  const double target = scene.intensity_accuracy;
  const bool slab = std::holds_alternative<Slab>(scene.sample);
  const Pilots pilots(scene, value);
  const bool choose_freely = scene.method == "auto";
  Effort effort =
      cheapest_effort(pilots, target, choose_freely ? "" : scene.method, false, choose_freely && !cone ? "modal" : "");
  if (cone && choose_freely && !has_fringes(effort)) {
    // Pixel means come in closed form from transport in the modes: worth half as many samples again.
    for (const char* name : {"diagonal", "modal"}) {
      const Effort modes = cheapest_effort(pilots, target, name, false);
      if (modes.error <= target && 2 * modes.samples <= 3 * effort.samples) {
        effort = modes;
        break;
      }
    }
  }
  if (cone && choose_freely && effort.method->info().slow_axes && !slow_everywhere(scene, value, o, effort))
    effort = cheapest_effort(pilots, target, "", false, "modal");
  plan.method = effort.method->info().name;
  plan.steps = effort.steps;
  plan.numerical_error = effort.error;
  const std::string what =
      fmt::format("{}: {}, {} samples of the medium a ray, hold the intensity to {} on {} pilot rays (asked: {})",
                  plan.method, effort_text(plan.method, plan.steps), effort.samples, sci(effort.error), pilots.size(),
                  sci(scene.intensity_accuracy));
  if (effort.error > target && scene.method == "auto") {
    // Steps where they are needed, by their own estimate.
    double local_errors = 0;
    for (const auto& [tx, ty] : directions) {
      double estimate = 0;
      const Mesh mesh = adapted_mesh(*o.column, ray_at(o, tx, ty), std::max(target / 20, 1e-13), &estimate);
      local_errors = std::max(local_errors, estimate);
      if (mesh.size() > plan.mesh.size()) plan.mesh = mesh;
    }
    plan.method = "magnus4";
    plan.numerical_error = 2 * local_errors;  // of the matrix; an intensity changes by twice that at most
    plan.reasons.push_back(fmt::format(
        "no equal steps hold the accuracy: full 2 x 2 transport with {} adapted Magnus-4 steps", plan.mesh.size() - 1));
  } else if (effort.error > target) {
    plan.reasons.push_back(fmt::format("{} was asked for by name: {} err by {}", plan.method,
                                       effort_text(plan.method, plan.steps), sci(plan.numerical_error)));
    plan.warnings.push_back(
        fmt::format("The {} method, asked for by name, errs by {} here.", plan.method, sci(plan.numerical_error)));
  } else {
    plan.reasons.push_back(plan.method == "diagonal" ? "mode coupling is below the accuracy: " + what
                           : o.column->planar
                               ? what + "; no method needs fewer"
                               : (plan.method == "modal"
                                      ? "the modes couple, slowly against their phase: "
                                      : "the axis turns out of the ray's plane: full 2 x 2 transport, ") +
                                     what + "; no method needs fewer");
  }
  double largest_phase = 0;
  for (const auto& [tx, ty] : directions) largest_phase = std::max(largest_phase, std::abs(planar_phase(o, tx, ty)));
  if (cone) {
    const ConeView<double> view(scene, value);
    const double cx = view.center_x, cy = view.center_y;
    note_camera(scene, value, view, plan);
    const int bins = static_cast<int>(std::ceil(
                         std::hypot(std::max(cx, scene.view.width - cx), std::max(cy, scene.view.height - cy)))) +
                     1;
    // The gradient changes slowly with radius: measure it on 24 radii and 12 azimuths, interpolate.
    std::vector<double> gradient(25);
    for (int i = 0; i <= 24; ++i)
      for (int k = 0; k < 12; ++k) {
        const double r = bins * i / 24.0, a = k * kPi / 6;
        double x = cx + r * std::cos(a), y = cy - r * std::sin(a);
        // Seen from the side there may be no screen outside the picture: there its edge, which ends in its corners,
        // stands for what lies beyond.
        if (scene.view.camera)
          x = std::clamp(x, 0.0, scene.view.width - 1.0), y = std::clamp(y, 0.0, scene.view.height - 1.0);
        const auto phase = [&](double column, double row) {
          const auto t = view.at(column, row);
          return planar_phase(o, t.x, t.y, 24);
        };
        const double gx = phase(x + 0.5, y) - phase(x - 0.5, y), gy = phase(x, y + 0.5) - phase(x, y - 0.5);
        gradient[static_cast<std::size_t>(i)] = std::max(gradient[static_cast<std::size_t>(i)], std::hypot(gx, gy));
      }
    const double fastest = *std::max_element(gradient.begin(), gradient.end());
    plan.reasons.push_back(fmt::format("the phase changes by up to {:.2g} rad a pixel", fastest));
    if ((plan.method == "diagonal" || plan.method == "modal") && plan_fringe_means(scene, value, o, plan)) {
      plan.reasons.push_back("pixel means of the fringes in closed form, from one ray a pixel");
      plan_fringe_blocks(scene, value, plan);
    } else {
      sample_by_radius(plan, cx, cy, bins, [&](double r) {
        const double f = std::min(23.999, r / bins * 24);
        const std::size_t i = static_cast<std::size_t>(f);
        return samples_for(std::max(gradient[i], gradient[i + 1]), scene.intensity_accuracy);
      });
      const int most = *std::max_element(plan.samples.begin(), plan.samples.end());
      plan.reasons.push_back(fmt::format("pixel means from up to {} x {} rays a pixel", most, most));
    }
  } else if (!slab) {
    plan.reasons.push_back("every pixel sees the same ray: one transfer for the whole image");
  }
  OpticalPoint<double> faces[2];
  const double ends[2] = {0, 1};
  o.column->sample(ends, faces);
  double r = 0;
  for (const auto& f : faces)
    r = std::max({r, reflectance(std::sqrt(f.ordinary), o.n_host), reflectance(std::sqrt(f.extraordinary), o.n_host)});
  plan.model_error = r + (scene.ceiling == Ceiling::e_only ? 0.03 : 0.0);
  if (r > 0.01)
    plan.left_out.push_back(
        fmt::format("Light reflected between the faces (reflectance {:.2g}) is left out; it ripples the intensity by "
                    "up to about {:.2g}.",
                    r, r));
  note_illumination(scene, value, largest_phase, plan);
  return plan;
}

/// Retardance (rad) of a disc at a place in units of its radius.
double disc_phase(const DiscOptics<double>& o, double x, double y) {
  const StressPair<double> p = o.phases(x, y);
  return std::hypot(p.normal, p.shear);
}

RenderPlan plan_disc(const Scene& scene, const Values<double>& value) {
  if (scene.method != "auto" && scene.method != "diagonal")
    throw UserError(Where{}, fmt::format("transport method '{}' does not apply to a photoelastic disc", scene.method),
                    "leave transport.method at auto");
  if (!(scene.view.pixel_size_um > 0))
    throw UserError(Where{}, "a disc needs micrograph.pixel_size_um", "the size of a pixel on the disc");
  RenderPlan plan;
  plan.method = "closed_form";
  plan.reasons.push_back("plane stress is the same at all depths: one retarder a point, in closed form");
  const StressedDisc& disc = std::get<StressedDisc>(scene.sample);
  const DiscOptics<double> o(scene, value);
  const double radius_px = 1 / o.px_per_radius_inverse;
  if (radius_px > 100000)
    throw UserError(Where{}, "the disc is more than 200000 pixels across", "check diameter_um and pixel_size_um");
  const DiscMargins margins = disc_margins(disc, 0.5 * value(disc.diameter_um));
  double largest_phase = 0;
  // The fringes change slowly from radius to radius: measured on 120 radii. Inside the contacts nothing is fitted.
  std::vector<double> gradient(121);
  const double h = 0.5 / radius_px;
  for (int i = 0; i <= 120; ++i)
    for (int k = 0; k < 72; ++k) {
      const double r = i / 120.0, x = r * std::sin(k * kPi / 36), y = r * std::cos(k * kPi / 36);
      if (std::min(std::hypot(x, y - 1), std::hypot(x, y + 1)) < margins.contact) continue;
      largest_phase = std::max(largest_phase, disc_phase(o, x, y));
      gradient[static_cast<std::size_t>(i)] = std::max(gradient[static_cast<std::size_t>(i)],
                                                       std::hypot(disc_phase(o, x + h, y) - disc_phase(o, x - h, y),
                                                                  disc_phase(o, x, y + h) - disc_phase(o, x, y - h)));
    }
  const int bins = std::max(2, static_cast<int>(std::ceil(radius_px)) + 2);
  sample_by_radius(plan, o.center_x_px, o.center_y_px, bins, [&](double r) {
    if (std::abs(r - radius_px) < 2) return 8;  // the edge
    const double f = std::min(119.999, r / radius_px * 120);
    const std::size_t i = static_cast<std::size_t>(f);
    return samples_for(std::max(gradient[i], gradient[i + 1]), scene.intensity_accuracy);
  });
  plan.samples.push_back(1);  // outside
  const double fastest = *std::max_element(gradient.begin(), gradient.end());
  plan.reasons.push_back(
      fmt::format("the retardance reaches {:.3g} rad outside the contacts and changes by up to {:.2g} rad a pixel; "
                  "pixel means from up to {} x {} points",
                  largest_phase, fastest, *std::max_element(plan.samples.begin(), plan.samples.end()),
                  *std::max_element(plan.samples.begin(), plan.samples.end())));
  if (fastest > 2 * kPi)
    plan.reasons.push_back(
        fmt::format("fringes are finer than a pixel ({:.2g} rad a pixel) near the contacts: a larger contact_radius_um "
                    "leaves these out",
                    fastest));
  Scene one_colour = scene;  // the bandwidth is part of a disc's model
  one_colour.microscope.bandwidth_nm = 0;
  note_illumination(one_colour, value, largest_phase, plan);
  return plan;
}

/// Retardance phases at points fixed relative to the sample, for judging how fast fringes move.
std::vector<double> phases(const Scene& scene, const Theta& theta) {
  const Values<double> value(theta, {});
  std::vector<double> result;
  if (const auto* droplet = std::get_if<Droplet>(&scene.sample); droplet && !looks_round(*droplet)) {
    const BallOptics<double> o = ball_optics(scene, value);
    const RimTable rim(o.sphere.ratio, o.sphere.n_host, 0);
    for (int i = 1; i < 8; ++i)
      for (int k = 0; k < 6; ++k)
        result.push_back(ball_phase(o, rim, rim.rho_max() * o.sphere.radius_um * i / 8, 2.399963 * (6 * i + k)));
  } else if (droplet) {
    const DropletOptics<double> o = droplet_optics(scene, value);
    for (int i = 1; i < 12; ++i) result.push_back(droplet_phase(o, std::asin(std::min(1.0, 1 / o.ratio)) * i / 12));
    result.push_back(o.twist_rad);
  } else if (const auto* crystal = std::get_if<Crystal>(&scene.sample)) {
    double field = 1;
    for (ParameterRef c : crystal->field_legendre) field += value(c);
    result.push_back(kPi * (value(crystal->bias_v) + value.get(crystal->built_in_bias_v, 0)) /
                     value(crystal->half_wave_voltage_v) * field);
  } else if (std::holds_alternative<StressedDisc>(scene.sample)) {
    const DiscOptics<double> o(scene, value);
    for (const auto& [x, y] : {std::pair{0.0, 0.0},
                               {0.0, 0.4},
                               {0.4, 0.0},
                               {0.3, 0.6},
                               {-0.3, 0.6},
                               {0.5, -0.5},
                               {0.0, -0.8},
                               {-0.7, 0.1}}) {
      const StressPair<double> p = o.phases(x, y);
      result.insert(result.end(), {p.normal, p.shear});
    }
  } else if (std::holds_alternative<SampledVolume>(scene.sample)) {
    result = volume_phases(VolumeOptics<double>(scene, value), 24);
  } else if (is_ring_table(scene)) {
    result.push_back(0);  // radii grow steadily with everything: no fringe order to lose
  } else {
    const PlanarOptics<double> o = planar_optics(scene, value);
    for (const auto& [tx, ty] : pilot_directions(scene, value)) result.push_back(planar_phase(o, tx, ty));
    if (const auto* cell = std::get_if<Cell>(&scene.sample)) {
      if (const auto* twisted = std::get_if<TwistedDirector>(&cell->director))
        result.push_back(2 * value.radians(twisted->twist_deg));
      if (const auto* field = std::get_if<FreederickszDirector>(&cell->director))
        result.push_back(2 * value.radians(field->twist_deg));
      if (const auto* helix = std::get_if<HelixDirector>(&cell->director))
        result.push_back(4 * kPi * value(cell->thickness_um) / value(helix->pitch_um));
    }
    result.push_back(value.radians(scene.microscope.compensator_phase_deg));
  }
  return result;
}

Symmetry symmetry_of(const Scene& scene, const RenderPlan& plan, const Values<double>& value) {
  if (!std::holds_alternative<Droplet>(scene.sample) && !cone_half_angle(scene)) return Symmetry::none;
  if (!on_middle_row(scene, value.get(scene.view.center_y_px, 0.5 * (scene.view.height - 1)))) return Symmetry::none;
  return make_pixel_model<double>(scene, plan, value)->symmetry();
}

/// What the literature's birefringence is off by.
void note_material(const Scene& scene, const Theta& theta, RenderPlan& plan) {
  const auto* law = std::get_if<LawIndices>(&scene.material);
  if (!law || law->birefringence_uncertainty <= 0) return;
  double largest_phase = 0;
  for (double phase : phases(scene, theta)) largest_phase = std::max(largest_phase, std::abs(phase));
  const double unsure = largest_phase * law->birefringence_uncertainty;
  plan.model_error = std::hypot(plan.model_error, 0.5 * std::min(1.0, unsure));  // the steepest slope of sin^2(phase/2)
  plan.left_out.push_back(fmt::format(
      "The material's birefringence is known to {:.2g} % only (standard deviation): the largest retardance, {:.3g} "
      "rad, to {:.2g} rad. "
      "Intervals do not contain this unless sample.material.birefringence_factor is fitted with prior_sd: {:.2g}.",
      100 * law->birefringence_uncertainty, largest_phase, unsure, law->birefringence_uncertainty));
}

}  // namespace

RenderPlan plan(const Scene& scene, const Theta& theta, const Observable& observable) {
  check_method(scene);
  check_validity(scene, theta);
  const Values<double> value(theta, {});
  RenderPlan result;
  if (scene.ceiling == Ceiling::wave) {
    result = has_series(scene) && scene.method != "split_step" ? plan_series(scene, value) : plan_wave(scene, value);
    double largest_phase = 0;
    for (const double phase : phases(scene, theta)) largest_phase = std::max(largest_phase, std::abs(phase));
    note_illumination(scene, value, largest_phase, result);
  } else if (std::holds_alternative<Droplet>(scene.sample)) {
    result = plan_droplet(scene, value);
  } else if (std::holds_alternative<Crystal>(scene.sample)) {
    if (scene.method != "auto" && scene.method != "diagonal")
      throw UserError(Where{}, fmt::format("transport method '{}' does not apply to a crystal bar", scene.method),
                      "leave transport.method at auto");
    result.method = "closed_form";
    result.reasons.push_back("a crystal between electrodes is one retarder per pixel: sin^2 in closed form");
    const Crystal& crystal = std::get<Crystal>(scene.sample);
    const double across = value(crystal.bias_v) + value.get(crystal.built_in_bias_v, 0);
    note_illumination(scene, value, std::abs(kPi * across / value(crystal.half_wave_voltage_v)), result);
  } else if (std::holds_alternative<StressedDisc>(scene.sample)) {
    result = plan_disc(scene, value);
  } else if (std::holds_alternative<SampledVolume>(scene.sample)) {
    result = plan_volume(scene, value);
    const std::vector<double> retardances = phases(scene, theta);
    note_illumination(scene, value,
                      *std::max_element(retardances.begin(), retardances.end(),
                                        [](double a, double b) { return std::abs(a) < std::abs(b); }),
                      result);
  } else if (is_ring_table(scene)) {
    if (scene.method != "auto" && scene.method != "diagonal")
      throw UserError(Where{}, fmt::format("transport method '{}' does not apply to a table of rings", scene.method),
                      "leave transport.method at auto");
    if (observable.ring_numbers.empty())
      throw UserError(Where{}, "a plate with screen_distance_um needs a table of ring radii",
                      "micrograph: {image: rings.csv}");
    result.method = "closed_form";
    result.reasons.push_back(
        "the rings of a plate cut normal to its axis lie where the retardance is a whole number of waves: radii in "
        "closed form");
  } else if (observable.quantity != Quantity::intensity) {
    result = plan_retardance(scene, value);
  } else {
    result = plan_planar(scene, value);
  }
  result.observable = observable;
  note_material(scene, theta, result);
  note_ring(scene, value, result);
  const Symmetry symmetry = result.wave ? Symmetry::none : symmetry_of(scene, result, value);
  if (symmetry == Symmetry::half_turn)
    result.reasons.push_back("half a turn about the viewing axis leaves the picture as it is: half of it is computed");
  if (symmetry == Symmetry::mirror)
    result.reasons.push_back("the lower half of the picture is the upper one's mirror image: half of it is computed");
  result.physics = scene.ceiling == Ceiling::e_only        ? "e_only"
                   : scene.ceiling == Ceiling::reflections ? "reflections"
                   : scene.ceiling == Ceiling::wave        ? "wave"
                                                           : "one_way";
  return result;
}

WaveChoice wave_choice(const Scene& scene, const Theta& theta) {
  Scene waves = scene;
  waves.ceiling = Ceiling::wave;
  waves.rays = Rays::straight;
  try {
    const RenderPlan by_waves = plan(waves, theta);
    const double seconds = by_waves.cost_seconds;
    return {seconds, !by_waves.wave, fmt::format("Wave optics of this scene takes about {:.2g} s an image.", seconds)};
  } catch (const UserError& error) {
    return {std::numeric_limits<double>::infinity(), false,
            fmt::format("Wave optics cannot do this scene: {}.", error.problems().front().what)};
  }
}

double ripple_period(const Scene& scene, const Theta& theta, int index) {
  if (scene.ceiling != Ceiling::wave || !has_series(scene) || scene.method == "split_step") return 0;
  if (index != std::get<Droplet>(scene.sample).diameter_um.index) return 0;
  const Values<double> value(theta, {});
  // Light caught under the surface: resonances follow each other by atan(s)/s of the size parameter, s^2 = m^2 - 1 (P.
  // Chylek, J. Opt. Soc. Am. A 7, 1609 (1990)); by one where the sphere is hardly denser.
  const DropletOptics<double> o = droplet_optics(scene, value);
  const double s2 = o.n_o * o.n_e / (o.n_host * o.n_host) - 1, s = std::sqrt(std::max(s2, 1e-6));
  return 2 * std::atan(s) / s / (o.k0 * o.n_host);
}

double fringe_phase_per_unit(const Scene& scene, const Theta& theta, int index) {
  const std::size_t i = static_cast<std::size_t>(index);
  const double h = std::max(1e-6, 1e-5 * std::abs(theta[i]));
  Theta up = theta, down = theta;
  up[i] += h;
  down[i] -= h;
  const std::vector<double> a = phases(scene, up), b = phases(scene, down);
  double largest_change = 0;
  for (std::size_t k = 0; k < a.size(); ++k) largest_change = std::max(largest_change, std::abs(a[k] - b[k]));
  const double slope = largest_change / (2 * h);
  return slope > 1e-9 ? slope : 0;
}

}  // namespace birefit
