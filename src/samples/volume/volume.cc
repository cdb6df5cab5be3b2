#include "samples/volume/volume.h"

#include <algorithm>

#include "instrument/exposure.h"
#include "medium/counting_column.h"
#include "medium/families/volume.h"
#include "medium/indices.h"

namespace birefit {

template <class S>
VolumeOptics<S>::VolumeOptics(const Scene& scene, const Values<S>& value, Continuity of_light)
    : grid(std::get<SampledVolume>(scene.sample).grid), continuity(of_light) {
  const S scale = value.get(std::get<SampledVolume>(scene.sample).scale, 1.0);
  const Indices<S> n = material_indices<S>(scene.material, value, wavelength_um(scene, value));
  n_o = n.ordinary;
  birefringence = n.extraordinary - n.ordinary;
  k0 = wavenumber_per_um(scene, value);
  center_x_px = value(scene.view.center_x_px);
  center_y_px = value(scene.view.center_y_px);
  const S px = value(scene.view.pixel_size_um) * inverse(scale);
  nodes_per_px_x = px * (1 / grid->spacing_um[0]);
  nodes_per_px_y = px * (1 / grid->spacing_um[1]);
  depth_um = scale * (grid->spacing_um[2] * (grid->nz - 1));
  sin_cos(value.radians(scene.view.rotation_deg), sin_turn, cos_turn);
  for (int k = 1; k + 1 < grid->nz; ++k) breaks.push_back(static_cast<double>(k) / (grid->nz - 1));
}

template <class S>
Su2<S> volume_retarder(const VolumeOptics<S>& o, const S& x, const S& y, const TransportMethod<S>& method,
                       const Mesh& mesh) {
  const VolumeColumn<S> column(*o.grid, o.breaks, x, y, o.cos_turn, o.sin_turn, o.n_o, o.birefringence, o.depth_um);
  return method.retarder(column, {o.k0, S(0.0), S(0.0), o.continuity}, mesh);
}

Mat2<double> volume_jones(const VolumeOptics<double>& o, double column, double row,
                          const TransportMethod<double>& method, const Mesh& mesh) {
  double x, y;
  o.place(column, row, x, y);
  if (!(x >= 0 && y >= 0 && x <= o.grid->nx - 1 && y <= o.grid->ny - 1)) return Mat2<double>::identity();
  return matrix(volume_retarder(o, x, y, method, mesh));
}

std::pair<double, double> volume_place(const VolumeGrid& grid, int ray) {
  // The plastic number's powers fill a square evenly; not quite to the edges.
  const double a = std::fmod(0.5 + 0.7548776662466927 * ray, 1.0), b = std::fmod(0.5 + 0.5698402909980532 * ray, 1.0);
  return {(0.005 + 0.985 * a) * (grid.nx - 1), (0.005 + 0.985 * b) * (grid.ny - 1)};
}

std::vector<double> volume_phases(const VolumeOptics<double>& o, int rays, double dx, double dy) {
  std::vector<double> phases;
  std::vector<double> u;
  for (int k = 0; k + 1 < o.grid->nz; ++k) u.push_back((k + 0.5) / (o.grid->nz - 1));
  std::vector<OpticalPoint<double>> p(u.size());
  for (int i = 0; i < rays; ++i) {
    const auto [x, y] = volume_place(*o.grid, i);
    const VolumeColumn<double> column(*o.grid, o.breaks, x + dx, y + dy, 1.0, 0.0, o.n_o, o.birefringence, o.depth_um);
    column.sample(u, p.data());
    double sum = 0;
    for (const auto& point : p)
      sum += retardance_per_length(point) * point.depth_slope_um / static_cast<double>(p.size());
    phases.push_back(o.k0 * sum);
  }
  return phases;
}

int volume_samples(const VolumeOptics<double>& o, const TransportMethod<double>& method, const Mesh& mesh) {
  const auto [x, y] = volume_place(*o.grid, 0);
  const VolumeColumn<double> column(*o.grid, o.breaks, x, y, 1.0, 0.0, o.n_o, o.birefringence, o.depth_um);
  const CountingColumn<double> counted(column);
  try {
    method.retarder(counted, {o.k0, 0.0, 0.0, o.continuity}, mesh);
  } catch (const std::logic_error&) {
    return 1000000;
  }
  return static_cast<int>(counted.count());
}

namespace {

template <class S>
class VolumeImage final : public SampleImage<S> {
 public:
  using P = PlainOf<S>;
  VolumeImage(const Scene& scene, const RenderPlan& plan, const Values<S>& value, const BeamMaker& light)
      : optics_(scene, value, continuity_of(plan.demand)),
        method_(transport_method<S>(plan.method)),
        mesh_(plan.mesh.empty() ? uniform_mesh(plan.steps, optics_.breaks) : plan.mesh),
        light_(light.in(value).line) {}
  void light(const P& column, const P& row, S* out) const override {
    S x, y;
    optics_.place(S(column), S(row), x, y);
    const P right(optics_.grid->nx - 1.0), top(optics_.grid->ny - 1.0);
    const auto beside = plain(x) < P(0.0) || plain(y) < P(0.0) || plain(x) > right || plain(y) > top;
    const S inside_x = select(beside, S(0.0), x), inside_y = select(beside, S(0.0), y);
    out[0] = select(beside, light_.open(), light_.of(volume_retarder(optics_, inside_x, inside_y, method_, mesh_)));
  }

 private:
  VolumeOptics<S> optics_;
  const TransportMethod<S>& method_;
  Mesh mesh_;
  Line<S> light_;
};

}  // namespace

template <class S>
std::unique_ptr<SampleImage<S>> make_volume_image(const Scene& scene, const RenderPlan& plan, const Values<S>& value,
                                                  const BeamMaker& light) {
  return std::make_unique<VolumeImage<S>>(scene, plan, value, light);
}
#define BIREFIT_INSTANTIATE(S)                                                                                     \
  template struct VolumeOptics<S>;                                                                                 \
  template Su2<S> volume_retarder<S>(const VolumeOptics<S>&, const S&, const S&, const TransportMethod<S>&,        \
                                     const Mesh&);                                                                 \
  template std::unique_ptr<SampleImage<S>> make_volume_image<S>(const Scene&, const RenderPlan&, const Values<S>&, \
                                                                const BeamMaker&);
BIREFIT_FOR_EACH_SCALAR(BIREFIT_INSTANTIATE)

}  // namespace birefit
