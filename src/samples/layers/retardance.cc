#include "samples/layers/retardance.h"

#include <fmt/format.h>

#include "core/quadrature.h"
#include "samples/kind.h"
#include "samples/layers/plan.h"
#include "samples/layers/planar.h"
#include "transport/one_way.h"

namespace birefit {
namespace {

/// Integral of n_eff - n_o along the normal, um.
template <class S>
S path_um(const Column<S>& column, int steps) {
  Mesh mesh = uniform_mesh(steps, column.breaks);
  std::vector<double> u, weight;
  gauss8_nodes(mesh, u, weight);
  std::vector<OpticalPoint<S>> points(u.size());
  column.sample(u, points.data());
  S path(0.0);
  for (std::size_t i = 0; i < u.size(); ++i)
    path = path + weight[i] * (points[i].depth_slope_um * retardance_per_length(points[i]));
  return path;
}

template <class S>
class RetardanceImage final : public SampleImage<S> {
 public:
  RetardanceImage(const Scene& scene, const RenderPlan& plan, const Values<S>& value) {
    value_ = path_um(*planar_optics(scene, value).column, plan.steps);
    if (plan.observable.quantity == Quantity::retardance_waves) value_ = value_ / wavelength_um(scene, value);
    if (plan.observable.quantity == Quantity::birefringence)
      value_ = value_ / value(std::get<Cell>(scene.sample).thickness_um);
  }
  void light(const PlainOf<S>&, const PlainOf<S>&, S* out) const override { out[0] = value_; }

 private:
  S value_;
};

/// Nodes that hold the retardance to rounding. Throws UserError where the axis turns about the light: there it is not
/// one number.
RenderPlan plan_retardance(const Planning& planning) {
  const Scene& scene = planning.scene;
  const Values<double>& value = planning.value;
  const PlanarOptics<double> optics = planar_optics(scene, value);
  if (!std::holds_alternative<Cell>(scene.sample) || !optics.column->planar)
    throw UserError(Where{}, "a retardance is that of a cell whose axis does not turn about the light",
                    "give the signal as an intensity");
  RenderPlan plan = planning.start();
  plan.method = "diagonal";
  // The two indices' difference is what is asked for: relative to itself, of whatever sign and size.
  constexpr int kMost = 4096;
  plan.steps = 1;
  for (double now = path_um(*optics.column, 1);;) {
    const double finer = path_um(*optics.column, 2 * plan.steps);
    plan.numerical_error = std::abs(finer - now) / std::max(std::abs(finer), 1e-300);
    if (plan.numerical_error <= 1e-12 || plan.steps == kMost) break;
    plan.steps *= 2;
    now = finer;
  }
  plan.reasons.push_back(fmt::format(
      "the retardance itself is asked for: the integral of the difference of the indices, {} nodes", 8 * plan.steps));
  return plan;
}

bool is_retardance(const Scene&, const Observable& observable) { return observable.quantity != Quantity::intensity; }

}  // namespace

template <class S>
std::unique_ptr<SampleImage<S>> make_retardance_image(const Scene& scene, const RenderPlan& plan,
                                                      const Values<S>& value, const BeamMaker&) {
  return std::make_unique<RetardanceImage<S>>(scene, plan, value);
}
#define BIREFIT_INSTANTIATE(S)                                                                                         \
  template std::unique_ptr<SampleImage<S>> make_retardance_image<S>(const Scene&, const RenderPlan&, const Values<S>&, \
                                                                    const BeamMaker&);
BIREFIT_FOR_EACH_SCALAR(BIREFIT_INSTANTIATE)

const SampleKind kRetardance{
    .name = "retardance", .is = is_retardance, .plan = plan_retardance, .phases_rad = planar_phases};

}  // namespace birefit
