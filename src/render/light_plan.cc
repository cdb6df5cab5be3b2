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

/// Twice as many wavelengths until the means over a few pixels change no more, twice: echoes between the faces of a
/// layer go by longer ways than its retardance, and of two rules that are too coarse for them one may agree with the
/// other by chance. Pictures with echoes are of one pixel's work.
void settle_on_means(const Scene& scene, const Theta& theta, const LightProbe& probe, RenderPlan& plan) {
  constexpr int kMost = 4000;
  const double allowed = 0.25 * plan.demand.intensity_accuracy;
  // Gauss nodes grow dear with their number, and beyond some dozens equal steps are as good (methods.md, "Spectrum").
  constexpr int kMostGauss = 60;
  const auto rule = [&](int n) {
    return wavelength_rule(scene.microscope, theta, n > kMostGauss ? 0 : plan.wavelengths->reach_um, n);
  };
  std::shared_ptr<const WavelengthRule> settled = plan.wavelengths;
  Eigen::VectorXd before = probe.means(plan);
  double change = 0;
  for (int n = 2 * static_cast<int>(plan.wavelengths->size()) + 1, agree = 0; n <= kMost && agree < 2; n = 2 * n + 1) {
    RenderPlan finer = plan;
    finer.wavelengths = rule(n);
    const Eigen::VectorXd now = probe.means(finer);
    change = (now - before).cwiseAbs().maxCoeff();
    agree = change <= allowed ? agree + 1 : 0;
    if (agree < 2) settled = finer.wavelengths;
    before = now;
  }
  plan.wavelengths = settled;
  if (change > allowed) plan.numerical_error += change;
}

}  // namespace

std::optional<LightBand> light_band(const Microscope& microscope, const Theta& theta) {
  const bool narrow = !microscope.channel_light;
  if (narrow && !(microscope.bandwidth_nm && microscope.bandwidth_nm.in(theta) > 0)) return std::nullopt;
  LightBand band;
  band.narrow = narrow;
  const auto ends = band_um(channel_of(microscope, theta).fine());
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
  const double spread = known || !band.narrow
                            ? deviation
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
  // Polynomials as high as the nodes need are integrated by a sum as fine as the fringes are.
  constexpr double kReachUm = 20;
  double reach_um = std::max(kReachUm, 1.5 * short_end * band.low_um / (2 * std::numbers::pi));
  const double share = 0.5 * plan.demand.intensity_accuracy;  // of the error, for the sum
  int nodes = gauss_nodes(cycles, share);
  if (band.narrow) {
    // The nodes of a Gaussian lie the farther apart the fewer they are, and equal steps do with fewer where many
    // fringes are to be lost: over the line's foot of 17 deviations, wider in 1/wavelength by 1.4 at most, as near as
    // the fringes and a tail of 1e-5 ask.
    constexpr double kFewDeviations = 6, kFoot = 17 * 1.4, kTail = 0.76;
    const bool even = deviation > kFewDeviations;
    nodes = even ? static_cast<int>(std::ceil(kFoot * (deviation / (2 * std::numbers::pi) + kTail)))
                 : line_nodes(deviation) + 3;
    if (even) reach_um = 0;
  }
  plan.wavelengths = wavelength_rule(m, theta, reach_um, nodes);
  if (plan.demand.ceiling == Ceiling::reflections) settle_on_means(scene, theta, probe, plan);
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
