// Cells and slabs seen along one direction, plates in a converging cone.

#include "medium/build.h"
#include "render/planar.h"
#include "render/pixel_model.h"
#include "transport/methods.h"

namespace birefit {

template <class S>
PlanarOptics<S> planar_optics(const Scene& scene, const Values<S>& value) {
  PlanarOptics<S> o;
  o.column = std::make_unique<CachedColumn<S>>(
      make_planar_column<S>(scene.sample, scene.material, value, value.radians(scene.view.rotation_deg)));
  o.k0 = wavenumber_per_um(scene, value);
  o.n_host = value.get(scene.surround_index, 1.0);
  o.continuity = scene.ceiling == Ceiling::e_only ? Continuity::e_only : Continuity::e_and_h;
  return o;
}

template <class S>
Mat2<S> planar_jones(const PlanarOptics<S>& o, const TransportMethod<S>& method, const Mesh& mesh, const S& tx,
                     const S& ty) {
  // t = tan(incidence) (cos azimuth, sin azimuth), c = cos(incidence)
  const S c = 1.0 / sqrt(tx * tx + ty * ty + 1.0);
  const Ray<S> ray{o.k0, o.n_host * c * tx, o.n_host * c * ty, o.continuity};
  const Mat2<S> m = method.transmission(*o.column, ray, mesh, o.n_host);
  // The s, p pair unrolled into the lab plane: E_t = e - g (e.t) t, g = (1 - c)/t^2, and back with (1/c - 1)/t^2.
  const S g = c * c / (c + 1.0), back = c / (c + 1.0);
  const auto unroll = [&](const Complex<S>& ex, const Complex<S>& ey, const S& f, Complex<S>& x, Complex<S>& y) {
    const Complex<S> along = f * (tx * ex + ty * ey);
    x = ex + tx * along;
    y = ey + ty * along;
  };
  const auto image_of = [&](const S& ex, const S& ey, Complex<S>& x, Complex<S>& y) {
    const S along = g * (ex * tx + ey * ty);
    const S ix = ex - along * tx, iy = ey - along * ty;
    const Complex<S> ox = ix * m.a + iy * m.b, oy = ix * m.c + iy * m.d;
    unroll(ox, oy, back, x, y);
  };
  Mat2<S> r;
  image_of(S(1.0), S(0.0), r.a, r.c);
  image_of(S(0.0), S(1.0), r.b, r.d);
  return r;
}

template <class S>
FringePoint<S> planar_fringe(const PlanarOptics<S>& o, const Mesh& mesh, const Polarizers<S>& polarizers, const S& tx,
                             const S& ty) {
  const S c = 1.0 / sqrt(tx * tx + ty * ty + 1.0);
  const Ray<S> ray{o.k0, o.n_host * c * tx, o.n_host * c * ty, o.continuity};
  const ModalTransfer<S> m = Diagonal<S>::modal(*o.column, ray, mesh);
  const FaceFactors<S> faces = lossless_faces<S>(*o.column, ray, o.n_host);
  // The polarizer's field rolled onto the plane of incidence (see planar_jones) and through the entry face.
  const S g = c * c / (c + 1.0) * (polarizers.px * tx + polarizers.py * ty);
  const S ix = polarizers.px - g * tx, iy = polarizers.py - g * ty;
  const S ex = faces.entry.a * ix + faces.entry.b * iy, ey = faces.entry.c * ix + faces.entry.d * iy;
  // The analyser seen from inside the exit face.
  const S back = c / (c + 1.0) * (polarizers.ax * tx + polarizers.ay * ty);
  const S ax = polarizers.ax + back * tx, ay = polarizers.ay + back * ty;
  const S wx = ax * faces.exit.a + ay * faces.exit.c, wy = ax * faces.exit.b + ay * faces.exit.d;
  const S f = 1.0 / (m.first.ox * m.first.ey - m.first.ex * m.first.oy);
  const S amplitude_o = f * (m.first.ey * ex - m.first.ex * ey) * (wx * m.last.ox + wy * m.last.oy);
  const S amplitude_e = f * (m.first.ox * ey - m.first.oy * ex) * (wx * m.last.ex + wy * m.last.ey);
  return {amplitude_o * amplitude_o + amplitude_e * amplitude_e, 2.0 * amplitude_o * amplitude_e, m.phase_e - m.phase_o};
}

namespace {

template <class S>
class PlanarModel final : public PixelModel<S> {
 public:
  using P = PlainOf<S>;
  PlanarModel(const Scene& scene, const RenderPlan& plan, const Values<S>& value)
      : optics_(planar_optics(scene, value)),
        method_(transport_method<S>(plan.method)),
        mesh_(plan.mesh.empty() ? uniform_mesh(plan.steps, optics_.column->breaks) : plan.mesh),
        polarizers_(polarizers(scene, value)) {
    if (const auto* plate = std::get_if<Plate>(&scene.sample)) {
      conoscopic_ = true;
      const S half = value.radians(plate->half_angle_deg, 15);
      tan_per_px_ = sin(half) / cos(half) * (2.0 / std::min(scene.view.width, scene.view.height));
      center_x_ = value.get(scene.view.center_x_px, 0.5 * (scene.view.width - 1));
      center_y_ = value.get(scene.view.center_y_px, 0.5 * (scene.view.height - 1));
    }
    // The first ray fills the column's cache; a cell or slab needs no other.
    S tx(0.0), ty(0.0);
    if (!scene.microscope.directions.empty()) {
      const Direction& d = scene.microscope.directions.front();
      const double t = std::tan(d.theta_deg * std::numbers::pi / 180), a = d.azimuth_deg * std::numbers::pi / 180;
      tx = S(t * std::cos(a));
      ty = S(t * std::sin(a));
    }
    constant_ = intensity_of(planar_jones(optics_, method_, mesh_, tx, ty));
    if (plan.fringe_means) planar_fringe(optics_, mesh_, polarizers_, tx, ty);
    optics_.column->freeze();
  }
  S intensity(const P& column, const P& row) const override {
    if (!conoscopic_) return constant_;
    const S tx = (S(column) - center_x_) * tan_per_px_, ty = (center_y_ - S(row)) * tan_per_px_;
    return intensity_of(planar_jones(optics_, method_, mesh_, tx, ty));
  }
  FringePoint<S> fringe(const P& column, const P& row) const override {
    return planar_fringe(optics_, mesh_, polarizers_, (S(column) - center_x_) * tan_per_px_,
                         (center_y_ - S(row)) * tan_per_px_);
  }

 private:
  S intensity_of(const Mat2<S>& j) const {
    return norm(polarizers_.ax * (polarizers_.px * j.a + polarizers_.py * j.b) +
                polarizers_.ay * (polarizers_.px * j.c + polarizers_.py * j.d));
  }
  PlanarOptics<S> optics_;
  const TransportMethod<S>& method_;
  Mesh mesh_;
  Polarizers<S> polarizers_;
  bool conoscopic_ = false;
  S tan_per_px_, center_x_, center_y_, constant_;
};

}  // namespace

template <class S>
std::unique_ptr<PixelModel<S>> make_planar_model(const Scene& scene, const RenderPlan& plan, const Values<S>& value) {
  return std::make_unique<PlanarModel<S>>(scene, plan, value);
}
#define BIREFIT_INSTANTIATE(S)                                                                                      \
  template std::unique_ptr<PixelModel<S>> make_planar_model<S>(const Scene&, const RenderPlan&, const Values<S>&);  \
  template FringePoint<S> planar_fringe<S>(const PlanarOptics<S>&, const Mesh&, const Polarizers<S>&, const S&, const S&); \
  template PlanarOptics<S> planar_optics<S>(const Scene&, const Values<S>&);                                        \
  template Mat2<S> planar_jones<S>(const PlanarOptics<S>&, const TransportMethod<S>&, const Mesh&, const S&, const S&);
BIREFIT_FOR_EACH_SCALAR(BIREFIT_INSTANTIATE)

}  // namespace birefit
