#include "render/light_plan.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>

#include <fmt/format.h>

#include "instrument/channel_light.h"
#include "samples/planning.h"

namespace birefit {
namespace {

/// Standard deviations from the middle of a Gaussian line between the ends of its band.
constexpr double kEndsOfLine = 3.09;
/// Gauss nodes grow dear with their number, and beyond some dozens equal steps are as good (methods.md, "Spectrum").
constexpr int kMostGauss = 60;

/// Twice as many wavelengths until the means over a few pixels change no more, twice: of two rules that are too coarse
/// for them one may agree with the other by chance. Such pictures are of one pixel's work.
void settle_on_means(const Scene& scene, const Theta& theta, const LightProbe& probe, RenderPlan& plan) {
  constexpr int kMost = 4000;
  const double allowed = 0.25 * plan.demand.intensity_accuracy;
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

/// A phase that goes evenly with 1/wavelength between the band's ends, as far as it does there.
struct EvenPhase {
  double low_um, high_um, at_low, at_high;
  double operator()(double um) const {
    return at_low + (at_high - at_low) * (1 / um - 1 / low_um) / (1 / high_um - 1 / low_um);
  }
};

/// What the rule makes of fringes as fast as the scene's, and slower ones, against every detail of the light: the
/// largest error.
double error_of_fringes(const SpectralSum& fine, const WavelengthRule& rule, const EvenPhase& phase) {
  const auto mean = [&](double share, const auto& wavelength_um, const std::vector<double>& weight, double unit) {
    std::complex<double> sum;
    for (std::size_t k = 0; k < weight.size(); ++k)
      sum += weight[k] * std::polar(1.0, share * phase(unit * wavelength_um[k]));
    return sum;
  };
  double worst = 0;
  for (const double share : {1.0, 0.8, 0.6, 0.4, 0.2})
    worst = std::max(worst, std::abs(mean(share, rule.wavelength_nm, rule.weight, 1e-3) -
                                     mean(share, fine.wavelength_um, fine.weight.front(), 1)));
  return worst;
}

/// The rule of n wavelengths, or of more, the first that holds fringes as fast as the scene's: the counts that n is
/// planned by are of lamps and cameras, whose nodes lie closest where a Gaussian filter's lie farthest apart.
void settle_on_fringes(const Microscope& m, const Theta& theta, double finest_um, int n, bool even,
                       const EvenPhase& phase, double allowed, RenderPlan& plan) {
  // Equal steps err by the kinks of tables, too: Gauss nodes follow where those ask for more than dozens.
  constexpr int kMost = 1500, kMostOfKinks = 200;
  const SpectralSum fine = channel_of(m, theta, finest_um);
  double left = std::numeric_limits<double>::infinity();
  const auto look_at = [&](double reach_um, int count) {
    const auto rule = wavelength_rule(m, theta, reach_um, count);
    if (const double error = error_of_fringes(fine, *rule, phase); !plan.wavelengths || error < left)
      plan.wavelengths = rule, left = error;
  };
  for (; left > allowed && n < kMost; n += 1 + n / 4) {
    if (even || n > kMostGauss) look_at(0, n);
    if (!even && left > allowed && n <= kMostOfKinks) look_at(finest_um, n);
  }
  plan.numerical_error += std::max(left, allowed);
}

}  // namespace

std::optional<LightBand> light_band(const Microscope& microscope, const Theta& theta) {
  const bool narrow = !microscope.channel_light;
  if (narrow && !(microscope.bandwidth_nm && microscope.bandwidth_nm.in(theta) > 0)) return std::nullopt;
  LightBand band;
  band.narrow = narrow;
  const auto ends = band_um(channel_of(microscope, theta));
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
  // Echoes go by longer ways than the retardance, and a table of absorption has peaks: what the light's width does to
  // them the retardance does not tell.
  const bool more = plan.demand.ceiling == Ceiling::reflections || scene.absorption.size() > 1;
  if (band.narrow && (!pictures || (!more && (!known || loss <= plan.demand.intensity_accuracy)))) {
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
  const double finest_um = std::max(kReachUm, 1.5 * short_end * band.low_um / (2 * std::numbers::pi));
  const double share = 0.5 * plan.demand.intensity_accuracy;  // of the error, for the sum
  int nodes = gauss_nodes(cycles, share);
  bool even = false;
  if (band.narrow) {
    // The nodes of a Gaussian lie the farther apart the fewer they are, and equal steps do with fewer where many
    // fringes are to be lost: over the line's foot of 17 deviations, wider in 1/wavelength by 1.4 at most, as near as
    // the fringes and a tail of 1e-5 ask.
    constexpr double kFewDeviations = 6, kFoot = 17 * 1.4, kTail = 0.76;
    even = deviation > kFewDeviations;
    nodes = even ? static_cast<int>(std::ceil(kFoot * (deviation / (2 * std::numbers::pi) + kTail)))
                 : line_nodes(deviation) + 3;
  }
  const RenderPlan of_line = plan;
  settle_on_fringes(m, theta, finest_um, nodes, even, {band.low_um, band.high_um, short_end, long_end}, share, plan);
  if (band.narrow && !plan.wave && plan.demand.model_tolerance > 0) {
    const Eigen::VectorXd line = probe.means(of_line), sum = probe.means(plan);
    if (const double left = (sum - line).norm() / sum.norm(); left < plan.demand.model_tolerance) {
      plan = of_line;
      plan.model_error = std::hypot(plan.model_error, (sum - line).cwiseAbs().maxCoeff());
      plan.reasons.push_back(
          fmt::format("the light's bandwidth of {:g} nm changes the picture by {:.2g} % of its root mean square, less "
                      "than physics.model_tolerance ({:g} %): a single wavelength stands for it here, not in a fit",
                      m.bandwidth_nm.in(theta), 100 * left, 100 * plan.demand.model_tolerance));
      return;
    }
  }
  if (more) settle_on_means(scene, theta, probe, plan);
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
