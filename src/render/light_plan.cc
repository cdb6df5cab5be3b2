#include "render/light_plan.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "instrument/channel_light.h"
#include "samples/planning.h"

namespace birefit {
namespace {

/// Standard deviations from the middle of a Gaussian line between the ends of its band.
constexpr double kEndsOfLine = 3.09;

/// More wavelengths until the means over a few pixels change no more: echoes between the faces of a layer go by longer
/// ways than its retardance.
void settle_on_means(const Scene& scene, const Theta& theta, const LightBand& band, const LightProbe& probe,
                     RenderPlan& plan) {
  Eigen::VectorXd before = probe.means(plan);
  for (;;) {
    const int n = static_cast<int>(plan.wavelengths->size()), more = n + n / 2 + 3;
    if (more > static_cast<int>(band.fine.size()) / 4) return;
    RenderPlan finer = plan;
    finer.wavelengths = wavelength_rule(scene.microscope, theta, band.fine, more);
    const Eigen::VectorXd now = probe.means(finer);
    const double change = (now - before).cwiseAbs().maxCoeff();
    if (change <= plan.demand.intensity_accuracy) return;
    plan.wavelengths = finer.wavelengths;
    before = now;
  }
}

}  // namespace

std::optional<LightBand> light_band(const Microscope& microscope, const Theta& theta) {
  const bool narrow = !microscope.channel_light;
  if (narrow && !(microscope.bandwidth_nm && microscope.bandwidth_nm.in(theta) > 0)) return std::nullopt;
  LightBand band;
  band.narrow = narrow;
  band.fine = channel_of(microscope, theta).fine();
  const auto ends = band_um(band.fine);
  band.low_um = ends[0], band.high_um = ends[1];
  return band;
}

void plan_wavelengths(const Scene& scene, const Theta& theta, const LightBand& band, bool sums_line,
                      const LightProbe& probe, RenderPlan& plan) {
  const Microscope& m = scene.microscope;
  if (band.narrow && sums_line) return;
  const double short_end = probe.phase(at_wavelength(m, theta, band.low_um)),
               long_end = probe.phase(at_wavelength(m, theta, band.high_um)), turned = std::abs(short_end - long_end),
               cycles = turned / (2 * std::numbers::pi), deviation = turned / (2 * kEndsOfLine);
  // Phases that are stated for the light there is, whatever its wavelength, do not say how they vary within it.
  const bool known = turned > 0;
  const double spread = known ? deviation
                              : short_end * m.bandwidth_nm.in(theta) / (2.3548200450309493 * m.wavelength_nm.in(theta));
  const double loss = 0.5 * (1 - std::exp(-0.5 * spread * spread));
  const bool pictures = plan.observable.quantity == Quantity::intensity;
  if (band.narrow && (!pictures || !known || loss <= plan.demand.intensity_accuracy)) {
    plan.model_error = std::hypot(plan.model_error, loss);
    if (loss > 1e-3)
      plan.warnings.push_back(
          fmt::format("The light's bandwidth of {:g} nm is not modelled here; it changes the "
                      "intensity by up to {:.2g}.",
                      m.bandwidth_nm.in(theta), loss));
    return;
  }
  const double share = 0.5 * plan.demand.intensity_accuracy;  // of the error, for the sum
  constexpr double kFewDeviations = 4;                        // as far as counts for lines were measured
  int nodes = gauss_nodes(cycles, share);
  if (band.narrow && deviation < kFewDeviations) nodes = std::min(nodes, line_nodes(deviation) + 3);
  nodes = std::clamp(nodes, 1, static_cast<int>(band.fine.size()) / 4);
  plan.wavelengths = wavelength_rule(m, theta, band.fine, nodes);
  if (plan.demand.ceiling == Ceiling::reflections) settle_on_means(scene, theta, band, probe, plan);
  plan.numerical_error += share;
  plan.cost_seconds *= static_cast<double>(plan.wavelengths->size());
  plan.reasons.push_back(fmt::format(
      "the light reaches from {:.0f} to {:.0f} nm, over which the largest retardance goes through {:.2g} fringes: the "
      "picture is a sum over {} wavelengths",
      1000 * band.low_um, 1000 * band.high_um, cycles, plan.wavelengths->size()));
  if (!band.narrow && plan.method == "series")
    plan.left_out.push_back(
        "A perfect sphere has resonances narrower than the distance of these wavelengths: in white light they are "
        "known to about 1 % of the picture. No real droplet is round enough to show them.");
}

}  // namespace birefit
