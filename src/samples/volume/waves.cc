// How waves go through a sampled field.

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "medium/surround.h"
#include "samples/volume/volume.h"
#include "samples/waves/object.h"
#include "wave/sampled.h"

namespace birefit {
namespace {

template <class S>
SampledOptics<S> sampled_optics(const Scene& scene, const Values<S>& value) {
  const VolumeOptics<S> v(scene, value);
  SampledOptics<S> o;
  o.grid = v.grid.get();
  o.scale = value.get(std::get<SampledVolume>(scene.sample).scale, 1.0);
  o.cos_turn = v.cos_turn, o.sin_turn = v.sin_turn;
  o.n_o = v.n_o, o.n_e = v.n_o + v.birefringence, o.n_host = host_index(scene, value);
  return o;
}

template <class S>
std::unique_ptr<WaveMedium<S>> volume_medium(const Scene& scene, const Values<S>& value, double ramp_um) {
  return std::make_unique<SampledMedium<S>>(sampled_optics(scene, value), ramp_um);
}

WaveObject volume_object(const Scene& scene, const Values<double>& value) {
  const SampledOptics<double> o = sampled_optics(scene, value);
  const VolumeGrid& v = *o.grid;
  const auto side = [&](int nodes, std::size_t i) { return o.scale * v.spacing_um[i] * (nodes - 1); };
  return {o.n_o,
          o.n_e,
          o.n_host,
          o.n_host,
          0.5 * std::max({side(v.nx, 0), side(v.ny, 1), side(v.nz, 2)}),
          sampled_grid(o, wavenumber_per_um(scene, value), value.get(scene.microscope.objective_na, 0.0)),
          fmt::format("box of {:.3g} x {:.3g} x {:.3g} um", side(v.nx, 0), side(v.ny, 1), side(v.nz, 2))};
}

/// Radius of a ball of as much liquid crystal as there is in a box, in its units; none where that is all of the box, or
/// the ball does not fit in.
std::optional<double> radius_of_ball(const VolumeGrid& g) {
  const auto crystal = std::count_if(g.nodes.begin(), g.nodes.end(), is_crystal);
  const double radius = std::cbrt(static_cast<double>(crystal) * g.spacing_um[0] * g.spacing_um[1] * g.spacing_um[2] *
                                  0.75 / std::numbers::pi);
  const auto fits = [&](int nodes, std::size_t i) { return radius < 0.5 * (nodes - 1) * g.spacing_um[i]; };
  if (crystal == 0 || crystal == std::ssize(g.nodes) || !fits(g.nx, 0) || !fits(g.ny, 1) || !fits(g.nz, 2))
    return std::nullopt;
  return radius;
}

/// Of that radius, in a box `share` times as wide as another, its nodes as far apart.
std::shared_ptr<const VolumeGrid> sampled_ball(const VolumeGrid& like, double radius, double share = 1) {
  auto ball = std::make_shared<VolumeGrid>();
  const auto nodes = [&](int n) { return std::max(2, static_cast<int>(std::ceil(share * (n - 1))) + 1); };
  ball->nx = nodes(like.nx), ball->ny = nodes(like.ny), ball->nz = nodes(like.nz);
  ball->spacing_um = like.spacing_um;
  ball->nodes.resize(static_cast<std::size_t>(ball->nx) * static_cast<std::size_t>(ball->ny) *
                     static_cast<std::size_t>(ball->nz));
  for (int k = 0; k < ball->nz; ++k)
    for (int j = 0; j < ball->ny; ++j)
      for (int i = 0; i < ball->nx; ++i) {
        const double x = (i - 0.5 * (ball->nx - 1)) * ball->spacing_um[0],
                     y = (j - 0.5 * (ball->ny - 1)) * ball->spacing_um[1],
                     z = (k - 0.5 * (ball->nz - 1)) * ball->spacing_um[2];
        const double r = std::sqrt(x * x + y * y + z * z);
        ball->nodes[ball->at(i, j, k)] = r > radius ? std::array<double, 6>{}
                                         : r > 0    ? director_tensor(x / r, y / r, z / r)
                                                    : director_tensor(0, 0, 1);
      }
  return ball;
}

/// A ball of as much liquid crystal of full order in the box's middle. Of a smaller one the nodes are as far apart, and
/// fewer: what sampling errs by goes with their distance.
std::optional<RadialTwin> volume_twin(const Scene& scene, const Theta& theta, double scale) {
  const SampledVolume& volume = std::get<SampledVolume>(scene.sample);
  const std::optional<double> radius = radius_of_ball(*volume.grid);
  if (!radius) return std::nullopt;
  const double size = volume.scale ? volume.scale.in(theta) : 1.0;
  RadialTwin twin{{scene}, theta, 2 * scale * size * *radius};
  twin.scenes.front().sample = Droplet{{twin.constant(twin.diameter_um)}, RadialDirector{}};
  twin.scenes.push_back(twin.scenes.front());
  twin.scenes.push_back(scene);
  twin.scenes.back().sample = SampledVolume{sampled_ball(*volume.grid, scale * *radius, scale), volume.scale};
  return twin;
}

}  // namespace

const SampleWaves kVolumeWaves{.object = volume_object,
                               .medium = {volume_medium<double>, volume_medium<Pack>, volume_medium<Dual1>,
                                          volume_medium<Dual2>, volume_medium<Dual4>},
                               .radial_twin = volume_twin};

}  // namespace birefit
