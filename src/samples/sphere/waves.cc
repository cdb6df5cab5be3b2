// How waves go through a sphere.

#include <fmt/format.h>

#include "samples/sphere/ball.h"
#include "samples/sphere/plan.h"
#include "samples/sphere/series.h"
#include "samples/waves/object.h"
#include "wave/sphere.h"

namespace birefit {
namespace {

template <class S>
SphereOptics<S> sphere_optics(const Scene& scene, const Values<S>& value) {
  const Droplet& droplet = std::get<Droplet>(scene.sample);
  SphereOptics<S> o;
  const auto take = [&](const DropletOptics<S>& d) {
    o.radius_um = d.radius_um, o.n_o = d.n_o, o.n_e = d.n_e, o.n_host = d.n_host;
  };
  if (const auto* radial = std::get_if<RadialDirector>(&droplet.director)) {
    take(droplet_optics(scene, value));
    o.field = RadialField<S>{static_cast<bool>(radial->twist_deg), value.radians(radial->twist_deg)};
    return o;
  }
  if (const auto* axial = std::get_if<AxialDirector>(&droplet.director); axial && !axial->field_azimuth_deg) {
    const DropletOptics<S> d = droplet_optics(scene, value);
    take(d);
    o.field = TiltedAxialField<S>{{S(0.0), S(0.0), S(1.0)}, d.axial};
    return o;
  }
  if (const auto* shell = std::get_if<ShellDirector>(&droplet.director)) {
    o.has_core = true;
    const DropletOptics<S> d = droplet_optics(scene, value);
    o.core_um = d.radius_um - value(shell->wall_um);
    o.core_index = shell->core_index ? value(shell->core_index) : d.n_host;
    if (!shell->offset_um[0]) {
      take(d);
      o.field = RadialField<S>{false, S(0.0)};
      return o;
    }
  }
  const BallOptics<S> ball = ball_optics(scene, value);
  take(ball.sphere);
  std::visit([&](const auto& field) { o.field = field; }, ball.field);
  if (const auto* nested = std::get_if<NestedField<S>>(&ball.field))
    o.core_offset_um = {o.radius_um * nested->offset.x, o.radius_um * nested->offset.y, o.radius_um * nested->offset.z};
  return o;
}

template <class S>
std::unique_ptr<WaveMedium<S>> sphere_medium(const Scene& scene, const Values<S>& value, double ramp_um) {
  return std::make_unique<SphereMedium<S>>(sphere_optics(scene, value), ramp_um);
}

WaveObject sphere_object(const Scene& scene, const Values<double>& value) {
  const SphereOptics<double> o = sphere_optics(scene, value);
  return {o.n_o,
          o.n_e,
          o.n_host,
          o.has_core ? o.core_index : o.n_host,
          o.radius_um,
          sphere_grid(o, wavenumber_per_um(scene, value), value.get(scene.microscope.objective_na, 0.0)),
          fmt::format("sphere of {:.3g} um", 2 * o.radius_um),
          o.has_core};
}

/// Of the same indices, its axis radial; a shell's core in the middle.
std::optional<RadialTwin> sphere_twin(const Scene& scene, const Theta& theta, double scale) {
  RadialTwin twin{{scene}, theta, 0};
  const auto number = [&](ParameterRef ref) { return ref.in(theta); };
  Droplet& droplet = std::get<Droplet>(twin.scenes.front().sample);
  twin.diameter_um = scale * number(droplet.diameter_um);
  auto* shell = std::get_if<ShellDirector>(&droplet.director);
  if (scale != 1) {
    droplet.diameter_um = twin.constant(twin.diameter_um);
    if (shell) shell->wall_um = twin.constant(scale * number(shell->wall_um));
  }
  if (shell)
    shell->offset_um = {};
  else
    droplet.director = RadialDirector{};
  twin.scenes.push_back(twin.scenes.front());
  return twin;
}

}  // namespace

const SampleWaves kSphereWaves{.object = sphere_object,
                               .medium = {sphere_medium<double>, sphere_medium<Pack>, sphere_medium<Dual1>,
                                          sphere_medium<Dual2>, sphere_medium<Dual4>},
                               .radial_twin = sphere_twin,
                               .has_series = has_series,
                               .plan_series = plan_series,
                               .series_ripple_period = series_ripple_period};

}  // namespace birefit
