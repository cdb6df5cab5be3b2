#include "render/ball.h"

#include "medium/build.h"

namespace birefit {

bool looks_round(const Droplet& droplet) {
  if (std::holds_alternative<BipolarDirector>(droplet.director)) return false;
  if (const auto* axial = std::get_if<AxialDirector>(&droplet.director)) return !axial->field_azimuth_deg;
  if (const auto* shell = std::get_if<ShellDirector>(&droplet.director)) return !shell->offset_um[0];
  return true;
}

template <class S>
BallOptics<S> ball_optics(const Scene& scene, const Values<S>& value) {
  const Droplet& droplet = std::get<Droplet>(scene.sample);
  BallOptics<S> o;
  o.sphere = droplet_optics(scene, value);
  const S rotation = value.radians(scene.view.rotation_deg);
  const S inverse_radius = inverse(o.sphere.radius_um);
  if (const auto* bipolar = std::get_if<BipolarDirector>(&droplet.director)) {
    o.field = BipolarField<S>{axis_from_angles<S>(value.radians(bipolar->tilt_deg), value.radians(bipolar->azimuth_deg) + rotation), value.get(bipolar->pole_distance, 1.0)};
    o.normal_anchoring = false;
  } else if (const auto* axial = std::get_if<AxialDirector>(&droplet.director)) {
    o.field = TiltedAxialField<S>{axis_from_angles<S>(S(0.0), value.radians(axial->field_azimuth_deg) + rotation), o.sphere.axial};
  } else {
    const ShellDirector& shell = std::get<ShellDirector>(droplet.director);
    const Vec3<S> offset{value.get(shell.offset_um[0], 0.0) * inverse_radius, value.get(shell.offset_um[1], 0.0) * inverse_radius,
                         value.get(shell.offset_um[2], 0.0) * inverse_radius};
    o.field = NestedField<S>{rotated(offset, rotation), 1.0 - value(shell.wall_um) * inverse_radius};
  }
  return o;
}

namespace {

/// Amplitude transmission 2 sqrt(Y1 Y2) / (Y1 + Y2) of flux, one surface.
template <class S>
S amplitude_through(const S& y1, const S& y2) {
  return 2.0 * root(y1 * y2) * inverse(y1 + y2);
}

}  // namespace

template <class S>
Mat2<S> ball_jones(const BallOptics<S>& o, const DropletRay<S>& r, const S& ca, const S& sa, const TransportMethod<S>& method, const Mesh& mesh,
                   const S& p_scale) {
  const DropletOptics<S>& d = o.sphere;
  const Ray<S> light{d.k0, S(0.0), S(0.0), d.continuity};
  S t_p[2] = {S(1.0), S(1.0)}, t_s[2] = {S(1.0), S(1.0)};
  const Su2<S> retarder = with_ball_column(o, r, ca, sa, [&](const auto& column) {
    if (d.continuity == Continuity::e_and_h) {
      const S p_host = d.n_host * inverse(r.cos_out), s_host = d.n_host * r.cos_out;
      if (o.normal_anchoring) {  // as in droplet_jones
        const S kappa = d.n_host * r.sin_out, inside = max_of(d.n_e * d.n_e - kappa * kappa, S(1e-14));
        t_p[0] = t_p[1] = amplitude_through<S>(p_host, d.n_o * d.n_e * inverse_root(inside));
        t_s[0] = t_s[1] = amplitude_through<S>(s_host, d.n_o * r.cos_in);
      } else {
        // The index each polarization has along the ray; what the surface couples between them is left out: of second order
        // in birefringence and in the angle of incidence.
        const double ends[2] = {0.0, 1.0};
        OpticalPoint<S> face[2];
        column.sample(ends, face);
        for (int i = 0; i < 2; ++i) {
          const S eo = face[i].ordinary, de = face[i].extraordinary - eo;
          const Vec3<S>& a = face[i].axis;
          const S over = inverse(eo + de * a.z * a.z);
          const S e_p = eo + de * a.x * a.x - de * de * a.x * a.x * a.z * a.z * over, e_s = eo + de * a.y * a.y - de * de * a.y * a.y * a.z * a.z * over;
          t_p[i] = amplitude_through<S>(p_host, root(e_p) * inverse(r.cos_in));
          t_s[i] = amplitude_through<S>(s_host, root(e_s) * r.cos_in);
        }
      }
    }
    return method.retarder(column, light, mesh);
  });
  Mat2<S> j = matrix(retarder);
  j = {(p_scale * t_p[1] * t_p[0]) * j.a, (p_scale * t_p[1] * t_s[0]) * j.b, (t_s[1] * t_p[0]) * j.c, (t_s[1] * t_s[0]) * j.d};
  // From (p, s) = (radial, azimuthal) to x, y.
  const Mat2<S> right{ca * j.a - sa * j.b, sa * j.a + ca * j.b, ca * j.c - sa * j.d, sa * j.c + ca * j.d};
  return {ca * right.a - sa * right.c, ca * right.b - sa * right.d, sa * right.a + ca * right.c, sa * right.b + ca * right.d};
}

namespace {

template <class S>
class BallImage final : public PixelModel<S> {
 public:
  using P = PlainOf<S>;
  BallImage(const Scene& scene, const RenderPlan& plan, const Values<S>& value)
      : optics_(ball_optics(scene, value)),
        rim_(lane(plain(optics_.sphere.ratio), 0), lane(plain(optics_.sphere.n_host), 0), scene.microscope.objective_na),
        method_(transport_method<S>(plan.method)),
        mesh_(plan.mesh.empty() ? uniform_mesh(plan.steps) : plan.mesh),
        aplanatic_(scene.microscope.aplanatic),
        light_(polarizers(scene, value)),
        pixel_um_(scene.view.pixel_size_um),
        center_x_(value(scene.view.center_x_px)),
        center_y_(value(scene.view.center_y_px)),
        edge_um_(optics_.sphere.radius_um * rim_.rho_max()) {
    const S between = light_.px * light_.ax + light_.py * light_.ay;
    open_ = between * between;
    // A field along an axis in the image plane is turned into itself.
    const auto in_plane = [](const auto& field) {
      if constexpr (requires { field.axis; })
        return stays_at(field.axis.z, 0.0);
      else
        return false;
    };
    half_turn_ = centred(scene, center_x_, center_y_) && std::visit(in_plane, optics_.field);
  }
  bool half_turn() const override { return half_turn_; }
  S intensity(const P& column, const P& row) const override {
    const S x = (column - center_x_) * pixel_um_, y = (center_y_ - row) * pixel_um_;
    const S rho2 = x * x + y * y + 1e-18, over = inverse_root(rho2), rho = rho2 * over;
    // Light that passes by, averaged over a pixel.
    S result = open_ * min_of(max_of((rho - optics_.sphere.radius_um) * (1 / pixel_um_) + 0.5, S(0.0)), S(1.0));
    const auto inside = plain(rho) < plain(edge_um_) * P(1 - 1e-12);
    const DropletRay<S> ray = trace(optics_.sphere, rim_, S(select(inside, rho, 0.5 * edge_um_)));
    S tube = optics_.sphere.radius_um * ray.cos_out * ray.cos_twice * inverse(ray.slope_um);
    if (!aplanatic_) tube = tube * inverse(ray.cos_twice);
    const Mat2<S> j = ball_jones<S>(optics_, ray, x * over, y * over, method_, mesh_, aplanatic_ ? S(1.0) : ray.cos_twice);
    const Complex<S> out = light_.ax * (light_.px * j.a + light_.py * j.b) + light_.ay * (light_.px * j.c + light_.py * j.d);
    return result + select(inside, S(tube * norm(out)), S(0.0));
  }

 private:
  BallOptics<S> optics_;
  RimTable rim_;
  const TransportMethod<S>& method_;
  Mesh mesh_;
  bool aplanatic_, half_turn_;
  Polarizers<S> light_;
  double pixel_um_;
  S center_x_, center_y_, edge_um_, open_;
};

}  // namespace

template <class S>
std::unique_ptr<PixelModel<S>> make_ball_model(const Scene& scene, const RenderPlan& plan, const Values<S>& value) {
  return std::make_unique<BallImage<S>>(scene, plan, value);
}
#define BIREFIT_INSTANTIATE(S)                                                                                        \
  template BallOptics<S> ball_optics<S>(const Scene&, const Values<S>&);                                              \
  template Mat2<S> ball_jones<S>(const BallOptics<S>&, const DropletRay<S>&, const S&, const S&, const TransportMethod<S>&, \
                                 const Mesh&, const S&);                                                              \
  template std::unique_ptr<PixelModel<S>> make_ball_model<S>(const Scene&, const RenderPlan&, const Values<S>&);
BIREFIT_FOR_EACH_SCALAR(BIREFIT_INSTANTIATE)

}  // namespace birefit
