// Jones matrices of a sphere's straight rays.

#include <cmath>
#include <optional>

#include "birefit/error.h"
#include "samples/sphere/ball.h"
#include "samples/sphere/droplet.h"
#include "samples/sphere/plan.h"

namespace birefit {

void add_sphere_jones(const Scene& scene, const RenderPlan& plan, const Values<double>& value, JonesTable& table) {
  const int w = scene.view.width, h = scene.view.height;
  const Mesh mesh = plan.mesh.empty() ? uniform_mesh(plan.steps) : plan.mesh;
  if (plan.demand.rays == Rays::eikonal)
    throw UserError(Where{},
                    "the two polarizations that curved rays bring to one place came by different ways: no Jones "
                    "matrix of one ray",
                    "use `render`, or physics.rays: straight");
  const DropletOptics<double> optics = droplet_optics(scene, value, continuity_of(plan.demand));
  const RimTable rim = rim_table(optics);
  const TransportMethod<double>& method = transport_method<double>(plan.method);
  std::optional<BallOptics<double>> ball;
  const StepsByPlace steps(plan);
  if (!looks_round(std::get<Droplet>(scene.sample))) ball = ball_optics(scene, value, continuity_of(plan.demand));
  for (int r = 0; r < h; ++r)
    for (int c = 0; c < w; ++c) {
      const double x = (c - value(scene.view.center_x_px)) * value(scene.view.pixel_size_um);
      const double y = (value(scene.view.center_y_px) - r) * value(scene.view.pixel_size_um);
      const double rho = std::hypot(x, y), azimuth = std::atan2(y, x);
      const JonesRow row{.row = r, .column = c};
      if (rho >= optics.radius_um * rim.rho_max()) {
        table.add(Mat2<double>::identity(), 0, row);
        continue;
      }
      if (ball) {
        const double edge = optics.radius_um * rim.rho_max();
        table.add(ball_jones<double>(*ball, trace(optics, rim, rho), std::cos(azimuth), std::sin(azimuth), method,
                                     ball_mesh(*ball, steps.at(rho / edge, x, y))),
                  0, row);
        continue;
      }
      // droplet_jones is in (p, s) = (radial, azimuthal): turn it into x, y.
      const DropletRay<double> ray = trace(optics, rim, rho);
      const Mat2<double> local = droplet_jones(optics, ray, method, mesh);
      const double ca = std::cos(azimuth), sa = std::sin(azimuth);
      const Mat2<double> turn{{ca, 0}, {-sa, 0}, {sa, 0}, {ca, 0}}, back{{ca, 0}, {sa, 0}, {-sa, 0}, {ca, 0}};
      table.add(turn * local * back, 0, row);
    }
}

}  // namespace birefit
