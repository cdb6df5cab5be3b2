#pragma once
// Rays through a sphere that looks different from all sides of the viewing axis, with no more derivatives than they
// need.

#include <memory>
#include <vector>

#include "instrument/exposure.h"
#include "samples/sphere/ball.h"
#include "samples/sphere/ball_core.h"
#include "transport/magnus.h"

namespace birefit {

/// Amplitude transmission 2 sqrt(Y1 Y2) / (Y1 + Y2) of flux, one surface.
template <class S>
S amplitude_through(const S& y1, const S& y2) {
  return 2.0 * root(y1 * y2) * inverse(y1 + y2);
}

/// How derivatives by what a ray knows make derivatives by parameters: R's derivative j is the sum over i of by[j][i]
/// times S's derivative i.
template <class S, class R>
struct Directions {
  using P = PlainOf<R>;
  static constexpr std::size_t kFrom = static_cast<std::size_t>(ScalarTraits<S>::derivatives),
                               kTo = static_cast<std::size_t>(ScalarTraits<R>::derivatives);
  std::array<std::array<P, kFrom>, kTo> by;
  Directions() {
    for (auto& row : by)
      for (P& x : row) x = P(0.0);
  }
  R operator()(const S& x) const {
    R r(plain(x));
    if constexpr (kFrom > 0 && kTo > 0)
      for (std::size_t j = 0; j < kTo; ++j)
        for (std::size_t i = 0; i < kFrom; ++i) r.d[j] = r.d[j] + by[j][i] * x.d[i];
    return r;
  }
};

/// What a picture's parameters change beside the way of a ray and the director: all a ray needs to know of them is said
/// by UniformMedium.
template <class R>
struct BallMedium {
  UniformMedium<R> inside;
  R n_o, n_e, n_host;
  /// `unit_um`: the unit of length of the rays' columns.
  BallMedium(const DropletOptics<R>& o, const R& unit_um)
      : inside{o.k0 * unit_um, o.n_o * o.n_o, o.n_e * o.n_e}, n_o(o.n_o), n_e(o.n_e), n_host(o.n_host) {}
};

/// The retarder in R of a ray in S.
template <class S, class R>
Su2<R> retarder_of(const Column<S>& column, Continuity continuity, const BallMedium<R>& medium,
                   const Directions<S, R>& up, const TransportMethod<S>& method, const Mesh& mesh) {
  const bool magnus = method.info().magnus;
  if constexpr (ScalarTraits<R>::derivatives == 0) {
    return magnus ? magnus_retarder<S>(method.info().order, column, continuity, medium.inside, mesh)
                  : method.retarder(column, Ray<S>{medium.inside.k0, S(0.0), S(0.0), continuity}, mesh);
  } else {
    using P = PlainOf<S>;
    using V = WithMedium<S>;
    if constexpr (std::is_same_v<S, R>)
      if (!magnus) return method.retarder(column, Ray<S>{medium.inside.k0, S(0.0), S(0.0), continuity}, mesh);
    const Su2<V> u = magnus_retarder<V>(
        method.info().order, column, continuity,
        {plain(medium.inside.k0), plain(medium.inside.ordinary), plain(medium.inside.extraordinary)}, mesh);
    Directions<V, R> all;
    const P twice = 2.0 * inverse(plain(medium.inside.k0)), ordinary = twice * plain(medium.inside.ordinary),
            extraordinary = twice * plain(medium.inside.extraordinary);
    constexpr std::size_t n = Directions<S, R>::kFrom;
    for (std::size_t j = 0; j < all.by.size(); ++j) {
      for (std::size_t i = 0; i < n; ++i) all.by[j][i] = up.by[j][i];
      all.by[j][n] = medium.inside.ordinary.d[j] + ordinary * medium.inside.k0.d[j];
      all.by[j][n + 1] = medium.inside.extraordinary.d[j] + extraordinary * medium.inside.k0.d[j];
    }
    return {all(u.w), all(u.x), all(u.y), all(u.z)};
  }
}

/// ball_jones() of a ray in S, the derivatives of R in the medium. `p_scale`: of the field in the plane of incidence
/// behind the sphere.
template <class S, class R>
Mat2<R> jones_of(const BallOptics<S>& o, const BallMedium<R>& medium, const Directions<S, R>& up,
                 const DropletRay<S>& r, const S& ca, const S& sa, const TransportMethod<S>& method, const Mesh& mesh,
                 const S& p_scale) {
  R t_p[2] = {R(1.0), R(1.0)}, t_s[2] = {R(1.0), R(1.0)};
  const Continuity continuity = o.sphere.continuity;
  const Su2<R> retarder = with_ball_column(o, r, ca, sa, [&](const auto& column) {
    if (continuity == Continuity::e_and_h) {
      const R cos_out = up(r.cos_out), cos_in = up(r.cos_in), p_host = medium.n_host * inverse(cos_out),
              s_host = medium.n_host * cos_out;
      if (o.normal_anchoring) {  // as in droplet_jones
        const R kappa = medium.n_host * up(r.sin_out),
                inside = max_of(medium.n_e * medium.n_e - kappa * kappa, R(1e-14));
        t_p[0] = t_p[1] = amplitude_through<R>(p_host, medium.n_o * medium.n_e * inverse_root(inside));
        t_s[0] = t_s[1] = amplitude_through<R>(s_host, medium.n_o * cos_in);
      } else {
        // The index each polarization has along the ray; what the surface couples between them is left out: of second
        // order in birefringence and in the angle of incidence.
        const double ends[2] = {0.0, 1.0};
        OpticalPoint<S> face[2];
        column.sample(ends, face);
        const R eo = medium.inside.ordinary, de = medium.inside.extraordinary - eo;
        for (int i = 0; i < 2; ++i) {
          const R x2 = up(S(face[i].axis.x * face[i].axis.x)), y2 = up(S(face[i].axis.y * face[i].axis.y)),
                  z2 = up(S(face[i].axis.z * face[i].axis.z));
          const R slant = de * z2, over = inverse(eo + slant), across = de * (1.0 - slant * over);
          t_p[i] = amplitude_through<R>(p_host, root(eo + across * x2) * inverse(cos_in));
          t_s[i] = amplitude_through<R>(s_host, root(eo + across * y2) * cos_in);
        }
      }
    }
    return retarder_of(column, continuity, medium, up, method, mesh);
  });
  const R p_behind = up(p_scale), c = up(ca), s = up(sa);
  Mat2<R> j = matrix(retarder);
  j = {(p_behind * t_p[1] * t_p[0]) * j.a, (p_behind * t_p[1] * t_s[0]) * j.b, (t_s[1] * t_p[0]) * j.c,
       (t_s[1] * t_s[0]) * j.d};
  // From (p, s) = (radial, azimuthal) to x, y.
  const Mat2<R> right{c * j.a - s * j.b, s * j.a + c * j.b, c * j.c - s * j.d, s * j.c + c * j.d};
  return {c * right.a - s * right.c, c * right.b - s * right.d, s * right.a + c * right.c, s * right.b + c * right.d};
}

template <class S>
Directions<S, S> identity() {
  Directions<S, S> r;
  for (std::size_t j = 0; j < r.by.size(); ++j) r.by[j][j] = PlainOf<S>(1.0);
  return r;
}

/// Rays of one picture, with its derivatives R.
template <class R>
class BallRays {
 public:
  using P = PlainOf<R>;
  virtual ~BallRays() = default;
  /// Light through the sphere as it is seen at a fraction 1 - v^2 of the way to the disc's edge; `beside`: continued
  /// where a core is in its way.
  virtual R at_fraction(const P& v, const P& cos_azimuth, const P& sin_azimuth, const Mesh&, bool beside) const = 0;
  /// Light through the core, past its middle at 1 - v^2 of its radius; derivatives are those at this place in the core.
  virtual R in_core(const P& v, const P& cos_azimuth, const P& sin_azimuth, const Mesh&) const = 0;
  /// The same at a distance from its middle, in radii of the sphere; angle: value as in cos, sin, and how it moves.
  virtual R at_place(const R& rho, const P& cos_azimuth, const P& sin_azimuth, const R& angle, const Mesh&) const = 0;
};

/// S: derivatives by what moves a ray or turns the director, fewer than R asks for: `up` joins the two. With `places`,
/// its last two are by the place a ray is seen at. S = R: everything by parameters.
template <class S, class R>
class BallRaysIn final : public BallRays<R> {
 public:
  using P = PlainOf<R>;
  BallRaysIn(const Scene& scene, const RenderPlan& plan, const Values<S>& value, const Values<R>& all,
             const BeamMaker& light, const Directions<S, R>& up, bool places)
      : optics_(ball_optics(scene, value, continuity_of(plan.demand))),
        medium_(in_radii(droplet_optics(scene, all))),
        light_(light.in(all).line),
        rim_(rim_table(optics_.sphere)),
        method_(transport_method<S>(plan.method)),
        aplanatic_(scene.microscope.aplanatic),
        edge_(rim_edge(rim_, optics_.sphere)),
        up_(up),
        places_(places) {
    optics_.sphere.radius_um = S(1.0);  // the medium's k0 knows how long that is
    beside_ = beside_core(optics_);
  }
  R at_fraction(const P& v, const P& c, const P& s, const Mesh& mesh, bool beside) const override {
    return light(beside ? beside_ : optics_, edge_ * S(P(1.0) - v * v), S(c), S(s), mesh, up_);
  }
  R in_core(const P& v, const P& c, const P& s, const Mesh& mesh) const override {
    const P fraction = P(1.0) - v * v;
    const SeenAt<S> seen =
        seen_of_core(*shell_in(optics_), optics_.sphere.ratio, rim_, S(fraction * c), S(fraction * s));
    return light(optics_, seen.rho, seen.cos_azimuth, seen.sin_azimuth, mesh, up_);
  }
  R at_place(const R& rho, const P& c, const P& s, const R& angle, const Mesh& mesh) const override {
    if constexpr (ScalarTraits<S>::derivatives == 0) {
      return light(optics_, S(plain(rho)), S(c), S(s), mesh, up_);
    } else if constexpr (std::is_same_v<S, R>) {
      return light(optics_, rho, angle.chain(c, -s), angle.chain(s, c), mesh, up_);
    } else {
      S place(plain(rho)), cs(c), sn(s);
      if (!places_) return light(optics_, place, cs, sn, mesh, up_);
      constexpr std::size_t n = Directions<S, R>::kFrom;
      Directions<S, R> up = up_;
      if constexpr (n >= 2) {
        place.d[n - 2] = P(1.0), cs.d[n - 1] = -s, sn.d[n - 1] = c;
        for (std::size_t j = 0; j < up.by.size(); ++j) up.by[j][n - 2] = rho.d[j], up.by[j][n - 1] = angle.d[j];
      }
      return light(optics_, place, cs, sn, mesh, up);
    }
  }

 private:
  R light(const BallOptics<S>& optics, const S& rho, const S& c, const S& s, const Mesh& mesh,
          const Directions<S, R>& up) const {
    const DropletRay<S> ray = trace(optics.sphere, rim_, rho);
    S tube = ray.cos_out * ray.cos_twice * inverse(ray.slope_um);
    if (!aplanatic_) tube = tube * inverse(ray.cos_twice);
    const Mat2<R> j = jones_of(optics, medium_, up, ray, c, s, method_, mesh, aplanatic_ ? S(1.0) : ray.cos_twice);
    return up(tube) * light_.of(j);
  }
  BallOptics<S> optics_, beside_;
  static BallMedium<R> in_radii(const DropletOptics<R>& o) { return {o, o.radius_um}; }
  BallMedium<R> medium_;
  Line<R> light_;
  RimTable rim_;
  const TransportMethod<S>& method_;
  bool aplanatic_;
  S edge_;  ///< of the disc, in radii
  Directions<S, R> up_;
  bool places_;
};

/// Everything that decides how a ray goes and what director it meets, in radii of the sphere.
template <class R>
std::vector<R> ways(const BallOptics<R>& o, const RimTable& rim) {
  std::vector<R> list{o.sphere.ratio, rim_edge(rim, o.sphere)};
  std::visit(
      [&](const auto& field) {
        if constexpr (requires { field.axis; }) list.insert(list.end(), {field.axis.x, field.axis.y, field.axis.z});
        if constexpr (requires { field.pole_distance; }) list.push_back(field.pole_distance);
        if constexpr (requires { field.field->e(); }) list.insert(list.end(), {field.field->e(), field.field->ring()});
        if constexpr (requires { field.core; })
          list.insert(list.end(), {field.offset.x, field.offset.y, field.offset.z, field.core});
      },
      o.field);
  return list;
}

/// Rays with no more derivatives than they need: parameters that move none (the wavelength, the size) have no
/// direction, those that move all alike (both indices through their ratio) share one. With `places`, rays that know how
/// the disc moves.
template <class R>
std::unique_ptr<BallRays<R>> ball_rays(const Scene& scene, const RenderPlan& plan, const Values<R>& value,
                                       const BeamMaker& light, const BallOptics<R>& optics, const RimTable& rim,
                                       [[maybe_unused]] bool places) {
  const auto in = [&]<class S>(const std::vector<int>& active,
                               const Directions<S, R>& up) -> std::unique_ptr<BallRays<R>> {
    return std::make_unique<BallRaysIn<S, R>>(scene, plan, Values<S>(value.theta(), active, value.memo()), value, light,
                                              up, places);
  };
  constexpr std::size_t n = static_cast<std::size_t>(ScalarTraits<R>::derivatives);
  if constexpr (n > 0) {
    const std::vector<R> all = ways(optics, rim);
    const auto product = [&all](std::size_t i, std::size_t j) {
      double sum = 0;
      for (const R& x : all) sum += lane(x.d[i], 0) * lane(x.d[j], 0);
      return sum;
    };
    std::vector<int> active;             // one parameter a direction
    std::vector<std::size_t> of_active;  // which derivative of R it is
    std::array<std::size_t, n> direction{};
    std::array<double, n> by{};
    for (std::size_t j = 0; j < value.active().size(); ++j) {
      const double length = product(j, j);
      if (length == 0) continue;
      direction[j] = active.size(), by[j] = 1;
      for (std::size_t i = 0; i < active.size(); ++i) {
        const double along = product(j, of_active[i]) / product(of_active[i], of_active[i]);
        double beside = 0;
        for (const R& x : all) beside += square(lane(x.d[j], 0) - along * lane(x.d[of_active[i]], 0));
        if (beside < 1e-24 * length) direction[j] = i, by[j] = along;
      }
      if (direction[j] < active.size()) continue;
      active.push_back(value.active()[j]);
      of_active.push_back(j);
    }
    const std::size_t needed = active.size() + (places ? 2 : 0);
    const auto fewer = [&]<class S>() {
      Directions<S, R> up;
      for (std::size_t j = 0; j < n; ++j)
        if (by[j] != 0) up.by[j][direction[j]] = PlainOf<R>(by[j]);
      return in.template operator()<S>(active, up);
    };
    if (transport_method<R>(plan.method).info().magnus && needed < n) {
      if (needed == 0) return in.template operator()<Pack>({}, {});
      if constexpr (n > 1)
        if (needed == 1) return fewer.template operator()<Dual1>();
      if constexpr (n > 2)
        if (needed == 2) return fewer.template operator()<Dual2>();
    }
  }
  return in.template operator()<R>(value.active(), identity<R>());
}

}  // namespace birefit
