// What a sphere can do, and its picture in whatever way it is planned.

#include <stdexcept>

#include "samples/choices.h"
#include "samples/curved/eikonal_image.h"
#include "samples/kind.h"
#include "samples/sphere/ball.h"
#include "samples/sphere/droplet.h"
#include "samples/sphere/plan.h"
#include "samples/sphere/series.h"

namespace birefit {

template <class S>
std::unique_ptr<SampleImage<S>> make_sphere_image(const Scene& scene, const RenderPlan& plan, const Values<S>& value,
                                                  const BeamMaker& light) {
  if (choices(plan).series_reach_um > 0) return make_series_image(scene, plan, value, light);
  if (looks_round(std::get<Droplet>(scene.sample)))
    return plan.demand.rays == Rays::eikonal ? make_eikonal_image(scene, plan, value, light)
                                             : make_droplet_image(scene, plan, value, light);
  if constexpr (kForTablesOnly<S>)
    throw std::logic_error("a ray a point takes fewer derivatives at once");
  else
    return make_ball_image(scene, plan, value, light);
}
#define BIREFIT_INSTANTIATE(S)                                                                                     \
  template std::unique_ptr<SampleImage<S>> make_sphere_image<S>(const Scene&, const RenderPlan&, const Values<S>&, \
                                                                const BeamMaker&);
BIREFIT_FOR_EACH_SCALAR_OF_TABLES(BIREFIT_INSTANTIATE)

namespace {

bool sphere_has_curved_rays(const Scene& scene) { return rays_stay_meridional(std::get<Droplet>(scene.sample)); }
Traits sphere_traits(const Scene& scene) {
  const ParameterRef diameter_um = std::get<Droplet>(scene.sample).diameter_um;
  return {.sphere_diameter_um = diameter_um, .round = Traits::Round{diameter_um, scene.microscope.polarizer_deg}};
}

ManyDirections sphere_directions(const Scene&, const RenderPlan& plan) {
  if (plan.wave) return ManyDirections::summed;
  return choices(plan).series_reach_um > 0 ? ManyDirections::by_sample : ManyDirections::never;
}

}  // namespace

const SampleKind kSphere{.name = "sphere",
                         .is = is_sample<Droplet>,
                         .plan = plan_sphere,
                         .pilots = sphere_pilots,
                         .phases_rad = sphere_phases,
                         .note = note_sphere,
                         .jones = add_sphere_jones,
                         .symmetric = always,
                         .sums_wavelengths = droplet_sums_wavelengths,
                         .directions = sphere_directions,
                         .passes_axis = true,
                         .curved_rays = sphere_has_curved_rays,
                         .waves = &kSphereWaves,
                         .traits = sphere_traits};

}  // namespace birefit
