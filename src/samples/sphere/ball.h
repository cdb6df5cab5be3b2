#pragma once
// A sphere whose picture is not the same from all sides of the viewing axis: its own ray for every point of the image.

#include "samples/choices.h"
#include "samples/sphere/ball_optics.h"
#include "samples/tables/polar_table.h"
#include "transport/method.h"

namespace birefit {

/// Jones matrix in the image's x, y with the surface's transmissions at both ends, common phase left out.
template <class S>
Mat2<S> ball_jones(const BallOptics<S>&, const DropletRay<S>&, const S& cos_azimuth, const S& sin_azimuth,
                   const TransportMethod<S>&, const Mesh&);

/// Divides the disc into squares with their own steps, and finds those that are smooth: interpolated to `target` of the
/// incident intensity. To be called with method and samples planned; sets the error, too.
void plan_disc_squares(const Scene&, const Values<double>&, const BeamMaker&, double target, RenderPlan& plan);
/// Mesh steps of a plan's rays by place.
class StepsByPlace {
 public:
  explicit StepsByPlace(const RenderPlan& plan) : plan_(plan), map_(choices(plan).disc) {}
  /// Of the ray that is seen at (x, y), `fraction` of the way to the edge.
  int at(double fraction, double x, double y) const;

 private:
  const RenderPlan& plan_;
  DiscMap map_;
};

template <class S>
std::unique_ptr<SampleImage<S>> make_ball_image(const Scene&, const RenderPlan&, const Values<S>&, const BeamMaker&);

}  // namespace birefit
