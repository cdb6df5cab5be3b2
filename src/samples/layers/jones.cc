// Jones matrices of cells, plates and slabs.

#include <cmath>
#include <numbers>
#include <optional>

#include "samples/layers/cone_view.h"
#include "samples/layers/plan.h"
#include "samples/layers/planar.h"

namespace birefit {

void add_planar_jones(const Scene& scene, const RenderPlan& plan, const Values<double>& value, JonesTable& table) {
  const std::optional<ParameterRef> half_angle = cone_half_angle(scene);
  if (std::holds_alternative<Slab>(scene.sample) && !half_angle) {
    const PlanarOptics<double> optics = planar_optics(scene, value, continuity_of(plan.demand));
    const TransportMethod<double>& method = transport_method<double>(plan.method);
    for (const Direction& d : scene.microscope.directions) {
      const double theta_rad = d.theta_deg * std::numbers::pi / 180, azimuth = d.azimuth_deg * std::numbers::pi / 180;
      const double kappa = optics.n_host * std::sin(theta_rad);
      const Ray<double> ray{optics.k0, kappa * std::cos(azimuth), kappa * std::sin(azimuth), optics.continuity};
      // Each direction gets its own mesh, unless a number of steps was forced.
      const Mesh mesh = plan.mesh.empty() ? uniform_mesh(plan.steps, optics.column->breaks)
                                          : adapted_mesh(*optics.column, ray, plan.demand.intensity_accuracy / 4);
      const double t = std::tan(theta_rad);
      table.add(planar_jones(optics, method, mesh, t * std::cos(azimuth), t * std::sin(azimuth)), azimuth,
                {.theta_deg = d.theta_deg, .azimuth_deg = d.azimuth_deg});
    }
    return;
  }
  const int w = scene.view.width, h = scene.view.height;
  const Mesh mesh = plan.mesh.empty() ? uniform_mesh(plan.steps) : plan.mesh;
  const PlanarOptics<double> optics = planar_optics(scene, value, continuity_of(plan.demand));
  const TransportMethod<double>& method = transport_method<double>(plan.method);
  if (!half_angle) {
    table.add(planar_jones(optics, method, mesh, 0.0, 0.0), 0, {});
    return;
  }
  const ConeView<double> cone(scene, value);
  for (int r = 0; r < h; ++r)
    for (int c = 0; c < w; ++c) {
      const auto [tx, ty] = cone.at(c, r);
      const double azimuth = std::atan2(ty, tx);
      table.add(planar_jones(optics, method, mesh, tx, ty), azimuth,
                {.theta_deg = std::atan(std::hypot(tx, ty)) * 180 / std::numbers::pi,
                 .azimuth_deg = azimuth * 180 / std::numbers::pi,
                 .row = r,
                 .column = c});
    }
}

}  // namespace birefit
