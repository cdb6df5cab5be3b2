#include "render/direction_plan.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "birefit/error.h"
#include "instrument/exposure.h"
#include "medium/surround.h"
#include "samples/planning.h"
#include "samples/waves/wave.h"

namespace birefit {
namespace {

constexpr int kMostRings = 80;

int directions_of(int rings) { return static_cast<int>(DiscRule(rings).nodes.size()); }

/// The whole condenser lies within the medium's wavevectors, and its circles are in order.
void check_disc(const Scene& scene, const Values<double>& value, const CondenserDisc<double>& disc) {
  const double host = host_index(scene, value), reach = disc.radius + std::hypot(disc.middle[0], disc.middle[1]);
  if (reach >= host)
    throw UserError(Where{},
                    fmt::format("the condenser's light reaches a numerical aperture of {:.3g}, and the medium around "
                                "the sample (index {:.4g}) has none from its index on",
                                reach, host),
                    "check microscope.condenser, or state sample.surround");
  if (disc.inner_radius >= disc.radius)
    throw UserError(
        Where{},
        fmt::format("the condenser's inner_na ({:.3g}) is not below its na ({:.3g})", disc.inner_radius, disc.radius),
        "microscope.condenser: directions lie between the two");
}

/// What layers under a condenser show is what both lenses take in.
void note_objective(double na, const CondenserDisc<double>& disc, RenderPlan& plan) {
  const double off_axis = std::hypot(disc.middle[0], disc.middle[1]);
  if (disc.inner_radius >= na || off_axis - disc.radius >= na)
    throw UserError(Where{},
                    fmt::format("the objective (NA {:.3g}) takes in none of the condenser's light, and a layer turns "
                                "none aside",
                                na),
                    "check microscope.objective_na and microscope.condenser");
  if (off_axis > 0 && off_axis + disc.radius > na)
    plan.warnings.push_back(
        fmt::format("The tilted condenser reaches a numerical aperture of {:.3g}, the objective {:.3g}: what lies "
                    "beyond is counted here, and not seen.",
                    off_axis + disc.radius, na));
}

void note_what_is_left_out(const Scene& scene, double na, double largest_phase, RenderPlan& plan) {
  // Layers: the mean phase shift over the cone, n about 1.5. Pictures of droplets change by more, because light of
  // every direction throws them elsewhere: by about 0.8 NA of their RMS through an objective of 0.4
  // (tests/data/instrument/condenser_droplet.csv, beside its own columns on the axis).
  const double shift = largest_phase * na * na / 8;
  const bool sphere = traits_of(scene).sphere_diameter_um.index >= 0;
  const double loss = std::min(0.5, std::max(0.5 * std::abs(shift), sphere ? 0.4 * na : 0.0));
  plan.model_error = std::hypot(plan.model_error, loss);
  if (loss > 1e-3)
    plan.warnings.push_back(fmt::format(
        "The condenser's aperture (NA {:g}) is not modelled here; it changes the intensity by up to about {:.2g}{}.",
        na, loss, sphere ? " (wave optics models it: physics.ceiling: wave)" : ""));
}

}  // namespace

void plan_directions(const Scene& scene, const Values<double>& value, ManyDirections how, double largest_phase,
                     const FewMeans& means, RenderPlan& plan) {
  if (!scene.microscope.condenser) return;
  if (how == ManyDirections::never)
    return note_what_is_left_out(scene, value(scene.microscope.condenser->na), largest_phase, plan);
  // All of it must exist in the medium, whatever the objective takes in.
  check_disc(scene, value, condenser_disc(scene.microscope, value, true));
  const bool layers = how == ManyDirections::summed && !plan.wave;
  const CondenserDisc<double> disc = condenser_disc(scene.microscope, value, !layers);
  const auto rings = [&](int n) {
    RenderPlan trial = plan;
    trial.condenser_rings = n;
    return means(trial);
  };
  const double allowed = plan.demand.intensity_accuracy;
  if (plan.wave) {
    // A whole picture a direction: as many rings as the phase asks for that a direction at the rim gains over half the
    // sample's depth. Held by one droplet of 4 um against the series (tests/cross/condenser_test.cc); not in the error.
    const double gained = 0.5 * wavenumber_per_um(scene, value) * disc.radius * disc.radius * plan.wave->radius_um;
    plan.condenser_rings = 2 + static_cast<int>(std::lround(0.5 * gained));
    plan.cost_seconds *= directions_of(plan.condenser_rings);
    plan.reasons.push_back(fmt::format("the condenser (NA {:.3g}) is a sum over {} directions", disc.radius,
                                       directions_of(plan.condenser_rings)));
    return;
  }
  if (layers && scene.microscope.objective_na) note_objective(value(scene.microscope.objective_na), disc, plan);
  const Eigen::VectorXd axis = rings(0);
  Eigen::VectorXd now = rings(1);
  double changed = (now - axis).cwiseAbs().maxCoeff();
  // One rule may agree with the axis by chance.
  if (changed <= allowed) changed = std::max(changed, (rings(3) - axis).cwiseAbs().maxCoeff());
  if (changed <= allowed) {
    plan.numerical_error += changed;
    plan.reasons.push_back(
        fmt::format("the condenser (NA {:.3g}) changes the intensity by {}: light along the axis stands for all of it",
                    disc.radius, sci(changed)));
    return;
  }
  if (const double share = (now - axis).norm() / now.norm(); share < plan.demand.model_tolerance) {
    plan.model_error = std::hypot(plan.model_error, changed);
    plan.reasons.push_back(
        fmt::format("the condenser (NA {:.3g}) changes the picture by {:.2g} % of its root mean square, less than "
                    "physics.model_tolerance ({:g} %): light along the axis stands for all of it here, not in a fit",
                    disc.radius, 100 * share, 100 * plan.demand.model_tolerance));
    return;
  }
  // Two finer sums must agree with the one that is taken: of fringes between the faces one may by chance.
  double left = changed;
  int n = 1;
  for (int more; n < kMostRings; n += more) {
    more = 1 + n / 4;
    const Eigen::VectorXd finer = rings(n + more);
    left = (finer - now).cwiseAbs().maxCoeff();
    if (left <= 0.5 * allowed) left = std::max(left, (rings(n + 2 * more + 1) - now).cwiseAbs().maxCoeff());
    if (left <= 0.5 * allowed) break;
    now = finer;
  }
  plan.condenser_rings = n;
  plan.numerical_error += left;
  plan.cost_seconds *= directions_of(n);
  plan.reasons.push_back(
      fmt::format("the condenser (NA {:.3g}) changes the intensity by {}: a sum over {} directions, good to {}",
                  disc.radius, sci(changed), directions_of(n), sci(left)));
  if (left > allowed)
    plan.warnings.push_back(fmt::format(
        "Light of the condenser (NA {:.3g}) changes so fast with its direction that {} of them are good to {} only.",
        disc.radius, directions_of(n), sci(left)));
}

}  // namespace birefit
