#include "samples/sphere/ball_image.h"
#include "samples/choices.h"

#include <algorithm>

namespace birefit {

template <class S>
Mat2<S> ball_jones(const BallOptics<S>& o, const DropletRay<S>& r, const S& ca, const S& sa,
                   const TransportMethod<S>& method, const Mesh& mesh) {
  return jones_of(o, BallMedium<S>(o.sphere, S(1.0)), identity<S>(), r, ca, sa, method, mesh, S(1.0));
}

template <class S>
std::unique_ptr<SampleImage<S>> make_ball_image(const Scene& scene, const RenderPlan& plan, const Values<S>& value,
                                                const BeamMaker& light) {
  // A fit may have moved the core since.
  const bool core_apart = std::any_of(choices(plan).disc.begin(), choices(plan).disc.end(),
                                      [](const DiscSquare& q) { return q.of_core; }) &&
                          [&] {
                            const BallOptics<double> o = ball_optics(scene, value.template as<double>());
                            return core_has_disc(o, rim_table(o.sphere));
                          }();
  return std::make_unique<BallImage<S>>(scene, plan, value, light, core_apart);
}
#define BIREFIT_INSTANTIATE(S)                                                                                   \
  template Mat2<S> ball_jones<S>(const BallOptics<S>&, const DropletRay<S>&, const S&, const S&,                 \
                                 const TransportMethod<S>&, const Mesh&);                                        \
  template std::unique_ptr<SampleImage<S>> make_ball_image<S>(const Scene&, const RenderPlan&, const Values<S>&, \
                                                              const BeamMaker&);
BIREFIT_FOR_EACH_SCALAR(BIREFIT_INSTANTIATE)

}  // namespace birefit
