// The plan of a disc under load.

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "birefit/error.h"
#include "samples/disc/disc.h"
#include "samples/kind.h"
#include "samples/pixels/sampling.h"

namespace birefit {

namespace {

constexpr double kPi = std::numbers::pi;

/// Retardance (rad) of a disc at a place in units of its radius.
double disc_phase(const DiscOptics<double>& o, double x, double y) {
  const StressPair<double> p = o.phases(x, y);
  return std::hypot(p.normal, p.shear);
}

/// Retardances at a few places (rad), by both components of the stress.
std::vector<double> disc_phases(const Scene& scene, const Values<double>& value) {
  std::vector<double> result;
  const DiscOptics<double> o(scene, value);
  for (const auto& [x, y] :
       {std::pair{0.0, 0.0}, {0.0, 0.4}, {0.4, 0.0}, {0.3, 0.6}, {-0.3, 0.6}, {0.5, -0.5}, {0.0, -0.8}, {-0.7, 0.1}}) {
    const StressPair<double> p = o.phases(x, y);
    result.insert(result.end(), {p.normal, p.shear});
  }
  return result;
}

RenderPlan plan_disc(const Planning& planning) {
  const Scene& scene = planning.scene;
  const Values<double>& value = planning.value;
  check_closed_form(planning.demand, "a photoelastic disc");
  if (!scene.view.pixel_size_um)
    throw UserError(Where{}, "a disc needs micrograph.pixel_size_um", "the size of a pixel on the disc");
  RenderPlan plan = planning.start();
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
    return samples_for(std::max(gradient[i], gradient[i + 1]), plan.demand.intensity_accuracy);
  });
  plan.means.samples.push_back(1);  // outside
  const double fastest = *std::max_element(gradient.begin(), gradient.end());
  plan.reasons.push_back(
      fmt::format("the retardance reaches {:.3g} rad outside the contacts and changes by up to {:.2g} rad a pixel; "
                  "pixel means from up to {} x {} points",
                  largest_phase, fastest, *std::max_element(plan.means.samples.begin(), plan.means.samples.end()),
                  *std::max_element(plan.means.samples.begin(), plan.means.samples.end())));
  if (fastest > 2 * kPi)
    plan.reasons.push_back(
        fmt::format("fringes are finer than a pixel ({:.2g} rad a pixel) near the contacts: a larger contact_radius_um "
                    "leaves these out",
                    fastest));
  return plan;
}

Traits disc_traits(const Scene& scene) {
  const StressedDisc& disc = std::get<StressedDisc>(scene.sample);
  return {.round = Traits::Round{disc.diameter_um, disc.load_azimuth_deg},
          .strips = Traits::Strips::rows,
          .isoclinics = true};
}

std::unique_ptr<Zone> disc_zone(const Scene& scene, const Theta& theta) {
  return std::make_unique<DiscZone>(scene, theta);
}

}  // namespace

const SampleKind kDisc{.name = "disc",
                       .is = is_sample<StressedDisc>,
                       .plan = plan_disc,
                       .phases_rad = disc_phases,
                       .sums_wavelengths = disc_sums_wavelengths,
                       .sums_line = true,
                       .traits = disc_traits,
                       .zone = disc_zone};

}  // namespace birefit
