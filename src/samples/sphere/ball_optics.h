#pragma once
// What a ray through a sphere without symmetry about the viewing axis meets.

#include "medium/families/ball.h"
#include "rays/sphere_ray.h"
#include "transport/method.h"

namespace birefit {

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
/// `continuity` as of droplet_optics.
template <class S>
BallOptics<S> ball_optics(const Scene& scene, const Values<S>& value, Continuity continuity = Continuity::e_and_h);

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

}  // namespace birefit
