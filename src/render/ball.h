#pragma once
// A sphere whose picture is not the same from all sides of the viewing axis: its own ray for every point of the image.

#include "medium/families/ball.h"
#include "render/droplet.h"
#include "render/polar_table.h"

namespace birefit {

/// Whether the droplet's director looks the same from all sides of the viewing axis (render/droplet.h) or needs this
/// file.
bool looks_round(const Droplet& droplet);

template <class S>
struct BallOptics {
  DropletOptics<S> sphere;  ///< geometry and indices; its director is not used
  BallField<S> field;
  bool normal_anchoring = true;
};
/// Equal steps and the breaks of the rays' columns.
template <class S>
Mesh ball_mesh(const BallOptics<S>& o, int steps) {
  return uniform_mesh(steps, std::visit([](const auto& field) { return ball_breaks(field); }, o.field));
}
template <class S>
BallOptics<S> ball_optics(const Scene& scene, const Values<S>& value);

/// Calls f(column) with the medium along the ray that is seen at the azimuth (cos, sin).
template <class S, class F>
auto with_ball_column(const BallOptics<S>& o, const DropletRay<S>& r, const S& cos_azimuth, const S& sin_azimuth,
                      const F& f) {
  const BallRay<S> ray{r.sin_in,    r.cos_in,    r.sin_deflection,  r.cos_deflection,
                       cos_azimuth, sin_azimuth, o.sphere.radius_um};
  return std::visit(
      [&](const auto& field) {
        return f(BallColumn<S, std::decay_t<decltype(field)>>(field, ray, o.sphere.n_o * o.sphere.n_o,
                                                              o.sphere.n_e * o.sphere.n_e));
      },
      o.field);
}
/// Jones matrix in the image's x, y with the surface's transmissions at both ends, common phase left out.
template <class S>
Mat2<S> ball_jones(const BallOptics<S>&, const DropletRay<S>&, const S& cos_azimuth, const S& sin_azimuth,
                   const TransportMethod<S>&, const Mesh&);

/// Divides the disc into squares with their own steps, and finds those that are smooth: interpolated to `target` of the
/// incident intensity. To be called with method and samples planned; sets the error, too.
void plan_disc_squares(const Scene&, const Values<double>&, double target, RenderPlan& plan);
/// Mesh steps of a plan's rays by place.
class StepsByPlace {
 public:
  explicit StepsByPlace(const RenderPlan& plan) : plan_(plan), map_(plan.disc) {}
  /// Of the ray that is seen at (x, y), `fraction` of the way to the edge.
  int at(double fraction, double x, double y) const;

 private:
  const RenderPlan& plan_;
  DiscMap map_;
};
/// See outgrown().
bool outgrown_disc(const std::vector<DiscSquare>& now, const std::vector<DiscSquare>& before);

template <class S>
std::unique_ptr<PixelModel<S>> make_ball_model(const Scene&, const RenderPlan&, const Values<S>&);

}  // namespace birefit
