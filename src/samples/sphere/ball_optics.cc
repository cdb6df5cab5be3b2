#include "samples/sphere/ball_optics.h"

#include "medium/families/planar.h"

namespace birefit {

template <class S>
BallOptics<S> ball_optics(const Scene& scene, const Values<S>& value, Continuity continuity) {
  const Droplet& droplet = std::get<Droplet>(scene.sample);
  BallOptics<S> o;
  o.sphere = droplet_optics(scene, value, continuity);
  const S rotation = value.radians(scene.view.rotation_deg);
  const S inverse_radius = inverse(o.sphere.radius_um);
  if (const auto* bipolar = std::get_if<BipolarDirector>(&droplet.director)) {
    o.field = BipolarField<S>{
        axis_from_angles<S>(value.radians(bipolar->tilt_deg), value.radians(bipolar->azimuth_deg) + rotation),
        value.get(bipolar->pole_distance, 1.0)};
    o.normal_anchoring = false;
  } else if (const auto* axial = std::get_if<AxialDirector>(&droplet.director)) {
    o.field = TiltedAxialField<S>{axis_from_angles<S>(S(0.0), value.radians(axial->field_azimuth_deg) + rotation),
                                  o.sphere.axial};
  } else {
    const ShellDirector& shell = std::get<ShellDirector>(droplet.director);
    const Vec3<S> offset{value.get(shell.offset_um[0], 0.0) * inverse_radius,
                         value.get(shell.offset_um[1], 0.0) * inverse_radius,
                         value.get(shell.offset_um[2], 0.0) * inverse_radius};
    o.field = NestedField<S>{rotated(offset, rotation), 1.0 - value(shell.wall_um) * inverse_radius};
  }
  return o;
}

#define BIREFIT_INSTANTIATE(S) template BallOptics<S> ball_optics<S>(const Scene&, const Values<S>&, Continuity);
BIREFIT_FOR_EACH_SCALAR(BIREFIT_INSTANTIATE)

}  // namespace birefit
