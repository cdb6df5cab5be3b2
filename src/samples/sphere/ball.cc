#include "samples/sphere/ball.h"

#include <algorithm>

#include <fmt/format.h>

#include "instrument/exposure.h"
#include "samples/pixels/sampling.h"
#include "samples/sphere/ball_core.h"
#include "samples/tables/radial_table.h"
#include "samples/tables/round_view.h"
#include "transport/intensity_distance.h"
#include "transport/magnus.h"

namespace birefit {

namespace {

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

}  // namespace

template <class S>
Mat2<S> ball_jones(const BallOptics<S>& o, const DropletRay<S>& r, const S& ca, const S& sa,
                   const TransportMethod<S>& method, const Mesh& mesh) {
  return jones_of(o, BallMedium<S>(o.sphere, S(1.0)), identity<S>(), r, ca, sa, method, mesh, S(1.0));
}

namespace {

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
    return std::make_unique<BallRaysIn<S, R>>(scene, plan, Values<S>(value.theta(), active), value, light, up, places);
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

template <class S>
class BallImage final : public SampleImage<S> {
 public:
  using P = PlainOf<S>;
  /// core_apart: a shell's core is a disc of its own, beside which the wall's light is continued.
  BallImage(const Scene& scene, const RenderPlan& plan, const Values<S>& value, const BeamMaker& light, bool core_apart)
      : scene_(scene),
        plan_(plan),
        optics_(ball_optics(scene, value, continuity_of(plan.demand))),
        rim_(rim_table(optics_.sphere)),
        light_(light.in(value).line),
        view_(scene, value),
        edge_um_(optics_.sphere.radius_um * rim_edge(rim_, optics_.sphere)),
        inverse_edge_(inverse(edge_um_)),
        by_inverse_edge_(inverse_edge_),
        inverse_radius_(inverse(optics_.sphere.radius_um)),
        core_apart_(core_apart),
        map_(plan.disc) {
    if (shell_in(optics_)) {
      plain_ = ball_optics(scene, value.template as<P>(), continuity_of(plan.demand));
      core_map_ = DiscMap(plan.disc, true);
      const auto table = [&]<class T>(const BallOptics<T>& o, const T& edge_um, int panels) {
        return RadialTable<T>(panels, 3, 1, [&](const P& v, T* out) {
          const DropletRay<T> ray = trace(o.sphere, rim_, T(edge_um * (P(1.0) - v * v)));
          const Vec3<T>& offset = shell_in(o)->offset;
          const T bent = 1.0 - ray.cos_deflection;
          out[0] = ray.sin_in - ray.sin_deflection * offset.z, out[1] = bent * offset.x, out[2] = bent * offset.y;
        });
      };
      constexpr double kExact = 1e-9;
      constexpr int kMostPanels = 64;
      int panels = 4;
      while ((reach_ = table(plain_, plain(edge_um_), panels)).tail() > kExact && panels < kMostPanels) panels *= 2;
      if constexpr (ScalarTraits<S>::derivatives > 0) reach_and_slopes_ = table(optics_, edge_um_, panels);
    }
    find_poles();
    std::vector<int> steps;
    for (const DiscSquare& q : plan.disc) steps.push_back(q.steps);
    std::sort(steps.begin(), steps.end());
    steps.erase(std::unique(steps.begin(), steps.end()), steps.end());
    for (const DiscSquare& q : plan.disc)
      mesh_of_.push_back(
          static_cast<std::size_t>(std::lower_bound(steps.begin(), steps.end(), q.steps) - steps.begin()));
    for (const int n : steps) meshes_.push_back(ball_mesh(optics_, n));
    if (meshes_.empty()) meshes_.push_back(ball_mesh(optics_, plan.steps));
    passing_ = PassingLight<S>(value(scene.view.pixel_size_um), optics_.sphere.radius_um, light_.open());
    const S center_x = value(scene.view.center_x_px), center_y = value(scene.view.center_y_px),
            pixel_um = value(scene.view.pixel_size_um);
    bool moves = false;
    if constexpr (ScalarTraits<S>::derivatives > 0)
      for (const S* x : std::initializer_list<const S*>{&center_x, &center_y, &pixel_um, &optics_.sphere.radius_um})
        for (const P& d : x->d) moves = moves || lane(d, 0) != 0;
    rays_of_table_ = ball_rays(scene, plan, value, light, optics_, rim_, false);
    rays_ = ball_rays(scene, plan, value, light, optics_, rim_, moves);
    // A field along an axis in the image plane is turned into itself.
    const auto turned = [](const auto& field) {
      if constexpr (requires { field.axis; })
        return stays_at(field.axis.z, 0.0);
      else
        return false;
    };
    const auto reflected = [](const auto& field) {
      if constexpr (requires { field.axis; })
        return mirrored(field.axis.x, field.axis.y, field.axis.z);
      else
        return stays_at(field.offset.y, 0.0);
    };
    if (centred(scene, center_x, center_y) && std::visit(turned, optics_.field))
      symmetry_ = Symmetry::half_turn;
    else if (on_middle_row(scene, center_y) && light_.mirrored() && std::visit(reflected, optics_.field))
      symmetry_ = Symmetry::mirror;
  }
  Symmetry symmetry() const override { return symmetry_; }
  void light(const P& column, const P& row, S* out) const override {
    const auto place = view_.at(column, row);
    const auto inside = place.rho_um < plain(edge_um_) * P(1 - 1e-12);
    out[0] = S(0.0);
    if (!birefit::none(inside)) out[0] = select(inside, through(place, inside), S(0.0));
  }
  int edges() const override { return shell_in(optics_) ? 2 : 1; }
  P beyond_edge(int edge, const P& column, const P& row) const override {
    const auto place = view_.at(column, row);
    const P fraction = place.rho_um * plain(inverse_edge_);
    if (edge == 0) return P(1.0) - fraction * fraction;
    P core_x, core_y;
    seen_at_core(root(max_of(P(1.0) - place.rho_um * plain(inverse_edge_), P(0.0))), P(place.x * place.inverse_rho),
                 P(place.y * place.inverse_rho), core_x, core_y);
    const double half_core_px =
        0.5 * lane(plain(shell_in(plain_)->core), 0) * lane(plain(optics_.sphere.radius_um), 0) / view_.pixel_um();
    // beyond the sphere's rim there is none
    return P(half_core_px) *
           select(place.rho_um < plain(edge_um_), P(1.0) - core_x * core_x - core_y * core_y, P(-1.0));
  }
  std::optional<EdgeCircle> circle(int edge) const override {
    if (edge > 0) return {};
    return view_.circle(edge_um_);
  }
  const std::vector<std::array<double, 2>>& defects() const override { return defects_; }
  S rim(const P& column, const P& row) const override {
    return view_.within(column, row, inverse_edge_, by_inverse_edge_);
  }
  bool has_passing_light() const override { return !passing_.dark(); }
  void passing(const P& column, const P& row, S* out) const override {
    out[0] = passing_.mean(view_, view_.at(column, row));
  }
  Mesh mesh(int steps) const { return ball_mesh(optics_, steps); }
  double edge_um() const { return lane(plain(edge_um_), 0); }
  /// Light at a place of a PolarTable.
  S light_at(const DiscSquare& square, const P& v, const P& cos_azimuth, const P& sin_azimuth, const Mesh& mesh) const {
    return square.of_core ? rays_of_table_->in_core(v, cos_azimuth, sin_azimuth, mesh)
                          : rays_of_table_->at_fraction(v, cos_azimuth, sin_azimuth, mesh, core_apart_);
  }
  void tabulate(SampleImage<S>::Wanted wanted, int threads) override {
    if (wanted != SampleImage<S>::Wanted::picture) return;
    std::vector<DiscSquare> squares = plan_.disc;
    if (!core_apart_)  // it was when the picture was planned
      for (DiscSquare& q : squares) q.smooth = q.smooth && !q.of_core;
    table_ = PolarTable<S>(squares, kGivenUp * plan_.demand.intensity_accuracy, threads,
                           [this](int square, const P& v, const P& c, const P& s) {
                             const std::size_t i = static_cast<std::size_t>(square);
                             return light_at(plan_.disc[i], v, c, s, meshes_[mesh_of_[i]]);
                           });
  }

 private:
  /// Where boojums are seen: at polar angles psi where rays of that angle of incidence come in, at psi - 2 (psi - psi')
  /// from the axis where they leave.
  void find_poles() {
    const auto* bipolar = std::get_if<BipolarField<S>>(&optics_.field);
    if (!bipolar) return;
    const auto number = [](const S& x) { return lane(plain(x), 0); };
    const double across = std::hypot(number(bipolar->axis.x), number(bipolar->axis.y)),
                 polar = std::atan2(across, std::abs(number(bipolar->axis.z))), m = number(optics_.sphere.ratio);
    if (across < 1e-9) return;  // in the middle, which has points of its own
    const double towards = number(bipolar->axis.z) < 0 ? -1 : 1;
    const EdgeCircle circle = view_.circle(optics_.sphere.radius_um);
    for (const bool leaves : {true, false}) {
      const auto beside = [&](double psi) {
        return std::abs((leaves ? 2 * std::asin(std::min(1.0, m * std::sin(psi))) - psi : psi) - polar);
      };
      // The nearest of a few angles, then of those between its neighbours.
      constexpr int kAngles = 200, kHalvings = 60;
      const double step = rim_.psi_max() / kAngles;
      double nearest = 0;
      for (int i = 1; i <= kAngles; ++i)
        if (beside(step * i) < beside(nearest)) nearest = step * i;
      double low = std::max(0.0, nearest - step), high = std::min(rim_.psi_max(), nearest + step);
      for (int i = 0; i < kHalvings; ++i) {
        const double third = (high - low) / 3;
        (beside(low + third) < beside(high - third) ? high : low) +=
            beside(low + third) < beside(high - third) ? -third : third;
      }
      const double radius = circle.radius * rim_.rho_over_radius(0.5 * (low + high));
      const double sign = (leaves ? 1 : -1) * towards * radius / across;
      defects_.push_back({circle.column + sign * number(bipolar->axis.x), circle.row - sign * number(bipolar->axis.y)});
    }
  }
  /// place_at_core() at a fraction 1 - v^2 of the way to the disc's edge.
  void seen_at_core(const P& v, const P& c, const P& s, P& x, P& y) const {
    const P basis[3] = {P(1.0), c, s};
    place_at_core(*shell_in(plain_), reach_.template sum<3>(v, basis), c, s, x, y);
  }
  /// The same with derivatives; angle: of the azimuth, its value is not read.
  void seen_at_core(const S& v, const P& c, const P& s, const S& angle, S& x, S& y) const {
    if constexpr (ScalarTraits<S>::derivatives > 0) {
      const P basis[3] = {P(1.0), c, s}, turned[3] = {P(0.0), -s, c};
      typename RadialTable<S>::Slopes slopes;
      S reach = reach_and_slopes_.template sum<3>(plain(v), basis, turned, &slopes);
      for (std::size_t j = 0; j < reach.d.size(); ++j)
        reach.d[j] = reach.d[j] + slopes.by_v * v.d[j] + slopes.turned * angle.d[j];
      place_at_core(*shell_in(optics_), reach, angle.chain(c, -s), angle.chain(s, c), x, y);
    }
  }
  template <class T>
  static void place_on_disc(const T& x, const T& y, const T& fraction, T& v, T& turn) {
    P inverse_major;
    turn = T(disc::turn_of(plain(x), plain(y), inverse_major));
    const P to_rim = root(max_of(P(P(1.0) - plain(fraction)), P(1e-15)));  // rounding may have left the disc
    v = T(to_rim);
    if constexpr (ScalarTraits<T>::derivatives > 0) {
      v = fraction.chain(to_rim, P(-0.5) * inverse(to_rim));
      for (std::size_t j = 0; j < turn.d.size(); ++j)
        turn.d[j] = (x.value * y.d[j] - y.value * x.d[j]) * (inverse_major * inverse_major);
    }
  }
  /// Distance from the centre and azimuth as the centre moves; the angle's value is not asked for.
  struct Moving {
    S rho_um, angle;
  };
  Moving moving(const typename CentredView<S>::Place& place, const P& rho_um) const {
    Moving m{S(rho_um), S(P(0.0))};
    view_.add_moves(place, P(1.0), P(0.0), m.rho_um);
    view_.add_moves(place, P(0.0), P(1.0), m.angle);
    return m;
  }
  template <class Mask>
  S through(const typename CentredView<S>::Place& place, const Mask& inside) const {
    const P c = place.x * place.inverse_rho, s = place.y * place.inverse_rho,
            rho_um = select(inside, place.rho_um, P(0.5) * plain(edge_um_));
    const auto by_ray = [&](const Mesh& mesh) {
      // The middle itself has no azimuth: a place beside it that no picture tells from it.
      constexpr double kBesideUm = 1e-5;
      const auto middle = place.rho_um < P(kBesideUm);
      const auto seen = CentredView<S>::around(select(middle, P(kBesideUm), place.x), place.y);
      const Moving m = moving(seen, select(middle, seen.rho_um, rho_um));
      return rays_->at_place(m.rho_um * inverse_radius_, seen.x * seen.inverse_rho, seen.y * seen.inverse_rho, m.angle,
                             mesh);
    };
    if (plan_.disc.empty()) return by_ray(meshes_[0]);
    P v_around, turn_around;
    place_on_disc<P>(place.x, place.y, rho_um * plain(inverse_edge_), v_around, turn_around);
    P v = v_around, turn = turn_around, square = map_.find(v, turn);
    S v_core, turn_core;
    Mask in_core = inside && !inside;  // none
    if (core_apart_) {
      P core_x, core_y;
      seen_at_core(v, c, s, core_x, core_y);
      in_core = inside && core_x * core_x + core_y * core_y < P(1.0);
      if (!birefit::none(in_core)) {
        S at_x(core_x), at_y(core_y);
        if constexpr (ScalarTraits<S>::derivatives > 0) {
          const Moving m = moving(place, rho_um);
          seen_at_core(S(m.rho_um * inverse_edge_).chain(v, P(-0.5) * inverse(v)), c, s, m.angle, at_x, at_y);
        }
        at_x = select(in_core, at_x, S(0.5)), at_y = select(in_core, at_y, S(0.0));
        place_on_disc<S>(at_x, at_y, root(S(at_x * at_x + at_y * at_y + 1e-18)), v_core, turn_core);
        v = select(in_core, plain(v_core), v), turn = select(in_core, plain(turn_core), turn),
        square = select(in_core, core_map_.find(plain(v_core), plain(turn_core)), square);
      }
    }
    S result(0.0);
    Mask left = inside;
    if (!table_.empty()) {
      typename PolarTable<S>::Slopes by;
      left = table_.read(square, v, turn, inside, result, by);
      if constexpr (ScalarTraits<S>::derivatives > 0) {
        if (!birefit::none(in_core)) {
          const P by_v = select(in_core, by.by_v, P(0.0)), by_turn = select(in_core, by.by_turn, P(0.0));
          for (std::size_t j = 0; j < result.d.size(); ++j)
            result.d[j] = result.d[j] + by_v * v_core.d[j] + by_turn * turn_core.d[j];
          by.by_v = by.by_v - by_v, by.by_turn = by.by_turn - by_turn;
        }
        const P by_fraction = P(-0.5) * by.by_v * inverse(v_around), longer = max_of(max_of(c * c, s * s), P(1e-30));
        view_.add_moves(place, by_fraction * plain(inverse_edge_), by.by_turn * inverse(longer), result);
        by_inverse_edge_.add(by_fraction * rho_um, result);
      }
    }
    if (birefit::none(left)) return result;
    P mesh;
    if constexpr (kLanesOf<S> == 1) {
      mesh = static_cast<double>(mesh_of_[static_cast<std::size_t>(square)]);
    } else {
      double which[kLanes];
      for (int k = 0; k < kLanes; ++k)
        which[k] = static_cast<double>(mesh_of_[static_cast<std::size_t>(lane(square, k))]);
      mesh = Pack::load_unaligned(which);
    }
    for_each_value(mesh, left, [&](double m, const auto& here) {
      result = select(here, by_ray(meshes_[static_cast<std::size_t>(m)]), result);
    });
    return result;
  }

  const Scene& scene_;
  const RenderPlan& plan_;
  BallOptics<S> optics_;
  /// of a shell, and reach_at_core() by v, which is one function, one times the cosine and one times the sine of the
  /// azimuth
  BallOptics<P> plain_;
  RadialTable<P> reach_;
  RadialTable<S> reach_and_slopes_;
  RimTable rim_;
  std::vector<Mesh> meshes_;          ///< from the fewest steps on
  std::vector<std::size_t> mesh_of_;  ///< which of them, by square of the disc; none: the first
  Symmetry symmetry_ = Symmetry::none;
  Line<S> light_;
  CentredView<S> view_;
  PassingLight<S> passing_;
  S edge_um_, inverse_edge_;
  Sensitivity<S> by_inverse_edge_;
  S inverse_radius_;
  std::unique_ptr<BallRays<S>> rays_of_table_, rays_;
  std::vector<std::array<double, 2>> defects_;
  bool core_apart_;
  DiscMap map_, core_map_;
  PolarTable<S> table_;
};

}  // namespace

namespace {

/// How many mesh steps the rays of one square take: a defect, a wall that is seen from the side, takes many and little
/// of the picture.
class StepsOfSquare {
 public:
  StepsOfSquare(const Scene& scene, const RenderPlan& plan, const Values<double>& value)
      : optics_(ball_optics(scene, value.as<Pack>(), continuity_of(plan.demand))),
        beside_(beside_core(optics_)),
        rim_(rim_table(optics_.sphere)),
        method_(transport_method<Pack>(plan.method)),
        target_(0.25 * plan.demand.intensity_accuracy) {
    std::visit(
        [&](const auto& field) {
          if (ball_breaks(field).size() == 1) return;
          // A ring of defects, seen from the side across the field's axis: rays that all but touch it. Those that touch
          // it where it turns away are harder still, and only by chance among the pilots.
          target_ *= 0.1;
          if constexpr (requires { field.axis; })
            for (const double sign : {-1.0, 1.0})
              for (const double aside : {-1e-4, 1e-4}) {  // either may lie in another square
                const double x = lane(field.axis.x, 0), y = lane(field.axis.y, 0), c = sign * (-y + aside * x),
                             s = sign * (x + aside * y);
                double inverse_major;
                grazing_.push_back({disc::turn_of(c, s, inverse_major), c, s});
              }
        },
        optics_.field);
  }
  /// Until two more refinements change no pilot ray by more than a quarter of the accuracy: one alone may agree by
  /// chance. `change`: by how much they do.
  int operator()(const DiscSquare& square, bool beside, double& change) const {
    // Between breaks all have the same number: others would be the same mesh again.
    const int unit = static_cast<int>(ball_mesh(optics_, 1).size()) - 1;
    int n = unit, m = 2 * unit;
    Rays coarse = rays(square, beside, n), fine = rays(square, beside, m);
    for (double first = distance(coarse, fine);;) {
      const int finer = m + std::max(unit, (m / 8 * 2 + unit - 1) / unit * unit);
      Rays finest = rays(square, beside, finer);
      const double second = distance(fine, finest);
      change = std::max(first, second);
      if (change <= target_) return n;
      if (finer > kMost) return finer;
      n = m, m = finer, first = second;
      fine = std::move(finest);
    }
  }

 private:
  static constexpr int kPilots = 16, kMost = 512;
  using Rays = std::vector<Mat2<double>>;

  Rays rays(const DiscSquare& square, bool beside, int steps) const {
    const BallOptics<Pack>& optics = beside ? beside_ : optics_;
    const Mesh mesh = ball_mesh(optics_, steps);
    Rays result;
    for (int i = 0; i < kPilots; i += kLanes) {
      alignas(64) double vs[kLanes], cs[kLanes], ss[kLanes];
      for (int k = 0; k < kLanes; ++k) {
        // The plastic number leaves no gaps in two dimensions.
        const auto part = [&](double turn) { return 0.5 + turn * (i + k) - std::floor(0.5 + turn * (i + k)); };
        vs[k] = std::clamp(disc::v_in(square, part(0.7548776662466927)), 1e-6, 1 - 1e-6);
        disc::direction_of(disc::turn_in(square, part(0.5698402909980532)), cs[k], ss[k]);
        for (const Grazing& g : grazing_)
          if ((i + k) % 2 == 0 && g.turn > disc::turn_in(square, 0) && g.turn < disc::turn_in(square, 1))
            cs[k] = g.cos, ss[k] = g.sin;
      }
      const Pack v = Pack::load_aligned(vs), fraction = Pack(1.0) - v * v, c = Pack::load_aligned(cs),
                 s = Pack::load_aligned(ss);
      const SeenAt<Pack> seen = square.of_core ? seen_of_core(*shell_in(optics), optics.sphere.ratio, rim_,
                                                              Pack(fraction * c), Pack(fraction * s))
                                               : SeenAt<Pack>{rim_.rho_max() * fraction, c, s};
      const Mat2<Pack> j =
          ball_jones<Pack>(optics, trace<Pack>(optics.sphere, rim_, optics.sphere.radius_um * seen.rho),
                           seen.cos_azimuth, seen.sin_azimuth, method_, mesh);
      for (int k = 0; k < kLanes; ++k) {
        const auto z = [&](const Complex<Pack>& x) { return Complex<double>(lane(x.re, k), lane(x.im, k)); };
        result.push_back({z(j.a), z(j.b), z(j.c), z(j.d)});
      }
    }
    return result;
  }
  static double distance(const Rays& a, const Rays& b) {
    double worst = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
      const double d = intensity_distance(a[i], b[i]);
      if (!std::isfinite(d)) return 1e300;
      worst = std::max(worst, d);
    }
    return worst;
  }

  struct Grazing {
    double turn, cos, sin;
  };
  BallOptics<Pack> optics_, beside_;
  RimTable rim_;
  const TransportMethod<Pack>& method_;
  double target_;
  std::vector<Grazing> grazing_;
};

/// Largest error of the table in one of its squares.
double error_in(const BallImage<Pack>& image, const PolarTable<Pack>& table, const DiscSquare& square, int number) {
  const Mesh mesh = image.mesh(square.steps);
  double error = 0;
  for (const double around : {0.02, 0.31, 0.55, 0.77, 0.98}) {  // none a Chebyshev point, the ends among them
    const double turn = disc::turn_in(square, around);
    double c, s;
    disc::direction_of(turn, c, s);
    for (int first = 0; first < 8; first += kLanes) {
      alignas(64) double place[kLanes];
      for (int k = 0; k < kLanes; ++k) place[k] = disc::v_in(square, 0.01 + 0.98 * std::min(first + k, 7) / 7);
      const Pack v = Pack::load_aligned(place), exact = image.light_at(square, v, Pack(c), Pack(s), mesh);
      Pack read;
      PolarTable<Pack>::Slopes none_asked;
      if (!none(table.read(Pack(number), v, Pack(turn), v < Pack(2.0), read, none_asked))) return 1.0;
      for (int k = 0; k < kLanes; ++k) {
        const double off = std::abs(lane(exact, k) - lane(read, k));
        if (!std::isfinite(off)) return 1e300;
        error = std::max(error, off);
      }
    }
  }
  return error;
}

/// How many points of a picture lie in parts of its disc, were every point to have a ray of its own.
class PointsOfSquares {
 public:
  PointsOfSquares(const Scene& scene, const RenderPlan& plan, const Values<double>& value, const RimTable& rim)
      : plan_(plan),
        optics_(ball_optics(scene, value)),
        rim_(rim),
        within_(points_within(plan.samples, plan.sampling_bin_px)) {
    radius_px_ = optics_.sphere.radius_um / value(scene.view.pixel_size_um);
    edge_px_ = radius_px_ * rim.rho_max();
    share_ = std::min(
        1.0, static_cast<double>(scene.view.width) * scene.view.height / (std::numbers::pi * square(edge_px_)));
    core_apart_ = core_has_disc(optics_, rim);
  }
  bool core_apart() const { return core_apart_; }
  double all() const { return share_ * within_.back(); }
  /// `beside`: share of the square's places that lie outside of the core.
  double operator()(const DiscSquare& q, double& beside) const {
    beside = 1;
    double points = 0;
    if (q.of_core) {
      // The area of a parallelogram in the picture, and the points of its middle.
      const auto at = [&](double across, double around) { return seen(q, across, around); };
      const std::array<double, 2> a = at(0, 0.5), b = at(1, 0.5), c = at(0.5, 0), d = at(0.5, 1), middle = at(0.5, 0.5);
      const double area = std::abs((b[0] - a[0]) * (d[1] - c[1]) - (b[1] - a[1]) * (d[0] - c[0]));
      const std::size_t bin = std::min(
          plan_.samples.size() - 1, static_cast<std::size_t>(std::hypot(middle[0], middle[1]) / plan_.sampling_bin_px));
      points = share_ * area * square(static_cast<double>(plan_.samples[bin]));
    } else {
      points = (inside(disc::v_in(q, 0)) - inside(disc::v_in(q, 1))) / disc::sectors(q.level);
      if (core_apart_) points *= beside = share_beside(q);
    }
    return points;
  }

 private:
  /// Pixels from the sphere's middle.
  std::array<double, 2> seen(const DiscSquare& q, double across, double around) const {
    double c, s;
    disc::direction_of(disc::turn_in(q, around), c, s);
    const double fraction = 1 - square(disc::v_in(q, across));
    const SeenAt<double> at = seen_of_core(*shell_in(optics_), optics_.sphere.ratio, rim_, fraction * c, fraction * s);
    return {radius_px_ * at.rho * at.cos_azimuth, radius_px_ * at.rho * at.sin_azimuth};
  }
  double share_beside(const DiscSquare& q) const {
    // A little farther in than the edge: what a fit may come to need.
    constexpr double kMargin = 0.03;
    constexpr int kPlaces = 5;
    int outside = 0;
    for (int i = 0; i < kPlaces; ++i)
      for (int k = 0; k < kPlaces; ++k) {
        const double v = disc::v_in(q, i / (kPlaces - 1.0));
        double c, s, x, y;
        disc::direction_of(disc::turn_in(q, k / (kPlaces - 1.0)), c, s);
        place_at_core(*shell_in(optics_),
                      trace(optics_.sphere, rim_, optics_.sphere.radius_um * rim_.rho_max() * (1 - v * v)), c, s, x, y);
        outside += std::hypot(x, y) > 1 - kMargin;
      }
    return outside / static_cast<double>(kPlaces * kPlaces);
  }
  double inside(double v) const {
    const double bin =
        std::clamp(edge_px_ * (1 - v * v) / plan_.sampling_bin_px, 0.0, static_cast<double>(within_.size() - 1));
    const std::size_t i = std::min(static_cast<std::size_t>(bin), within_.size() - 2);
    return share_ * (within_[i] + (bin - static_cast<double>(i)) * (within_[i + 1] - within_[i]));
  }
  const RenderPlan& plan_;
  BallOptics<double> optics_;
  const RimTable& rim_;
  std::vector<double> within_;  ///< points by bins of the radius
  double radius_px_, edge_px_, share_;
  bool core_apart_;
};

/// A table pays from this share of its rays on: with derivatives a point's own ray costs three times one of the table.
constexpr double kWorth = 0.4;

}  // namespace

void plan_disc_squares(const Scene& scene, const Values<double>& value, const BeamMaker& light, double target,
                       RenderPlan& plan) {
  const DropletOptics<double> sphere = droplet_optics(scene, value);
  const RimTable rim = rim_table(sphere);
  const PointsOfSquares points_of(scene, plan, value, rim);
  const bool core_apart = points_of.core_apart();
  const BallImage<Pack> image(scene, plan, value.as<Pack>(), light, core_apart);
  const StepsOfSquare steps_of(scene, plan, value);
  constexpr int kRays = PolarTable<Pack>::kRays;

  std::vector<DiscSquare> open;
  for (const bool of_core : {false, true})
    for (int sector = 0; sector < disc::kSectors; ++sector)
      for (int panel = 0; panel < disc::kPanels; ++panel)
        if (!of_core || core_apart) open.push_back({.of_core = of_core, .level = 0, .panel = panel, .sector = sector});
  double error = 0, smooth_error = 0, rays = 0, work = 0;
  while (!open.empty()) {
    std::vector<double> changes(open.size()), errors(open.size(), 0.0);
    const int count = static_cast<int>(open.size());
    parallel_for(count, 0, [&](int b) {
      DiscSquare& q = open[static_cast<std::size_t>(b)];
      double& change = changes[static_cast<std::size_t>(b)];
      double beside;
      q.points = points_of(q, beside);
      q.steps = steps_of(q, false, change);
      if (core_apart && !q.of_core && beside > 0) {
        double change_beside;
        q.steps = std::max(q.steps, steps_of(q, true, change_beside));
        change = std::max(change, change_beside);
      }
      q.smooth = q.points > kWorth * kRays;  // to be tried
    });
    const PolarTable<Pack> table(open, kGivenUp * plan.demand.intensity_accuracy, 0,
                                 [&](int b, const Pack& v, const Pack& c, const Pack& s) {
                                   const DiscSquare& q = open[static_cast<std::size_t>(b)];
                                   return image.light_at(q, v, c, s, image.mesh(q.steps));
                                 });
    parallel_for(count, 0, [&](int b) {
      const std::size_t i = static_cast<std::size_t>(b);
      if (!open[i].smooth) return;
      errors[i] = error_in(image, table, open[i], b);
      open[i].smooth = errors[i] <= target;
    });
    std::vector<DiscSquare> next;
    for (std::size_t i = 0; i < open.size(); ++i) {
      const DiscSquare& q = open[i];
      if (!q.smooth && q.level + 1 < disc::kLevels && q.points > kWorth * 4 * kRays) {
        for (const int down : {0, 1})
          for (const int right : {0, 1})
            next.push_back({.of_core = q.of_core,
                            .level = q.level + 1,
                            .panel = 2 * q.panel + right,
                            .sector = 2 * q.sector + down});
        continue;
      }
      plan.disc.push_back(q);
      error = std::max(error, changes[i]);
      if (q.smooth) smooth_error = std::max(smooth_error, errors[i]);
      const double here = q.smooth ? kRays : q.points;
      rays += here;
      work += here * q.steps;
    }
    open = std::move(next);
  }
  plan.numerical_error = std::max(plan.numerical_error, error) + smooth_error;
  const auto [fewest, most] = std::minmax_element(
      plan.disc.begin(), plan.disc.end(), [](const DiscSquare& a, const DiscSquare& b) { return a.steps < b.steps; });
  const auto smooth = std::count_if(plan.disc.begin(), plan.disc.end(), [](const DiscSquare& q) { return q.smooth; });
  plan.reasons.push_back(fmt::format("steps by place on the disc, as its rays need: {} to {}, {:.0f} a ray in the mean",
                                     fewest->steps, most->steps, work / std::max(rays, 1.0)));
  plan.reasons.push_back(fmt::format(
      "the droplet does not look the same from all sides of the viewing axis: {} of {} parts of the disc are smooth "
      "enough to be interpolated from {} rays each{}, elsewhere one ray a point; {:.0f} rays instead of {:.0f}",
      smooth, plan.disc.size(), kRays, smooth > 0 ? fmt::format(" (to {:.1e})", smooth_error) : "", rays,
      points_of.all()));
}

int StepsByPlace::at(double fraction, double x, double y) const {
  if (plan_.disc.empty()) return plan_.steps;
  double inverse_major;
  const double turn = disc::turn_of(x, y, inverse_major);
  return plan_.disc[static_cast<std::size_t>(map_.find(std::sqrt(std::max(0.0, 1 - fraction)), turn))].steps;
}

bool outgrown_disc(const std::vector<DiscSquare>& now, const std::vector<DiscSquare>& before) {
  if (now.empty() || before.empty()) return now.empty() != before.empty();
  for (const bool of_core : {false, true}) {
    const DiscMap now_at(now, of_core), before_at(before, of_core);
    for (std::size_t i = 0; i < now_at.cells().size(); ++i) {
      const int new_one = now_at.cells()[i], old_one = before_at.cells()[i];
      if ((new_one < 0) != (old_one < 0)) return true;  // the core has come to be a disc of its own
      if (new_one < 0) break;
      const DiscSquare &a = now[static_cast<std::size_t>(new_one)], &b = before[static_cast<std::size_t>(old_one)];
      if (a.steps > 1.25 * b.steps + 1 || (b.smooth && (!a.smooth || a.level > b.level))) return true;
    }
  }
  return false;
}

template <class S>
std::unique_ptr<SampleImage<S>> make_ball_image(const Scene& scene, const RenderPlan& plan, const Values<S>& value,
                                                const BeamMaker& light) {
  // A fit may have moved the core since.
  const bool core_apart =
      std::any_of(plan.disc.begin(), plan.disc.end(), [](const DiscSquare& q) { return q.of_core; }) && [&] {
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
