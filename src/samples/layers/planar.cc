// Cells and slabs seen along one direction, plates and slabs in a converging cone.

#include <algorithm>
#include <mutex>

#include "instrument/exposure.h"
#include "medium/references.h"
#include "samples/choices.h"
#include "samples/image.h"
#include "samples/layers/column.h"
#include "samples/layers/cone_view.h"
#include "samples/layers/planar.h"
#include "samples/tables/fringe_table.h"
#include "transport/methods.h"

namespace birefit {

template <class S>
PlanarOptics<S> planar_optics(const Scene& scene, const Values<S>& value, Continuity continuity) {
  PlanarOptics<S> o;
  o.column = std::make_unique<CachedColumn<S>>(make_planar_column(scene, value));
  o.k0 = wavenumber_per_um(scene, value);
  o.n_host = host_index(scene, value);
  o.continuity = continuity;
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

template <class S, class R>
FringePoint<R> planar_fringe(const PlanarOptics<S>& o, bool coupling, const Mesh& mesh, const R& k0,
                             const Raise<S, R>& raise, const Line<R>& light, const S& tx, const S& ty) {
  using C = Complex<R>;
  const auto raised = [&raise](const Mat2<S>& m) {
    const auto z = [&raise](const Complex<S>& x) { return C(raise(x.re), raise(x.im)); };
    return Mat2<R>{z(m.a), z(m.b), z(m.c), z(m.d)};
  };
  const S c = 1.0 / sqrt(tx * tx + ty * ty + 1.0);
  const Ray<S> ray{o.k0, o.n_host * c * tx, o.n_host * c * ty, o.continuity};
  const ModalTransfer<R> m =
      coupling ? modal_transfer(*o.column, ray, k0, raise, mesh) : diagonal_transfer(*o.column, ray, k0, raise, mesh);
  const Mat2<R> in = inverse(m.first) * raised(entry_factor(*o.column, ray, o.n_host));
  const Mat2<R> out = raised(exit_factor(*o.column, ray, o.n_host)) * m.last;
  // Fields rolled onto the plane of incidence (see planar_jones), those behind seen from inside: over the two waves,
  // what comes of each.
  const R x = raise(tx), y = raise(ty), roll = raise(c * c / (c + 1.0)), unroll = raise(c / (c + 1.0));
  const auto waves = [&](const auto& px0, const auto& py0, const auto& ax0, const auto& ay0) {
    const auto g = roll * (x * px0 + y * py0), back = unroll * (x * ax0 + y * ay0);
    const auto px = px0 - x * g, py = py0 - y * g, ax = ax0 + x * back, ay = ay0 + y * back;
    std::array<C, 2> w{(px * in.a + py * in.b) * (ax * out.a + ay * out.c),
                       (px * in.c + py * in.d) * (ax * out.b + ay * out.d)};
    if (o.column->absorbing) w = {exp(m.log_o.re) * w[0], exp(m.log_e.re) * w[1]};
    return w;
  };
  const R phase = m.log_e.im - m.log_o.im;
  if (light.linear()) {
    const Field<R>&p = light.in().field[0], &a = light.out().field[0];
    const auto [o_wave, e_wave] = waves(p.x.re, p.y.re, a.x.re, a.y.re);
    const C both = R(2.0) * (conj(o_wave) * e_wave);
    return {both.re, phase, norm(o_wave) + norm(e_wave), both.im};
  }
  FringePoint<R> point{R(0.0), phase, R(0.0), R(0.0)};
  for (std::size_t i = 0; i < static_cast<std::size_t>(light.in().count); ++i)
    for (std::size_t j = 0; j < static_cast<std::size_t>(light.out().count); ++j) {
      const Field<R>&p = light.in().field[i], &a = light.out().field[j];
      const R weight = light.in().weight[i] * light.out().weight[j];
      const auto [o_wave, e_wave] = waves(p.x, p.y, conj(a.x), conj(a.y));
      const C both = (2.0 * weight) * (conj(o_wave) * e_wave);
      point.amplitude = point.amplitude + both.re;
      point.mean = point.mean + weight * (norm(o_wave) + norm(e_wave));
      point.quadrature = point.quadrature + both.im;
    }
  return point;
}

namespace {

/// Whether something holds at the nodes and in the middle of every step.
template <class S, class Holds>
bool axes_all(const Column<S>& column, const Mesh& mesh, const Holds& holds) {
  Mesh places(mesh);
  for (std::size_t i = 0; i + 1 < mesh.size(); ++i) places.push_back(0.5 * (mesh[i] + mesh[i + 1]));
  std::vector<OpticalPoint<S>> points(places.size());
  column.sample(places, points.data());
  return std::all_of(points.begin(), points.end(), holds);
}

template <class S>
class PlanarImage final : public SampleImage<S> {
 public:
  using P = PlainOf<S>;
  PlanarImage(const Scene& scene, const RenderPlan& plan, const Values<S>& value, const BeamMaker& maker)
      : scene_(scene),
        value_(value),
        maker_(maker),
        accuracy_(plan.demand.intensity_accuracy),
        optics_(planar_optics(scene, value, continuity_of(plan.demand))),
        method_(transport_method<S>(plan.method)),
        mesh_(plan.mesh.empty() ? uniform_mesh(plan.steps, optics_.column->breaks) : plan.mesh),
        light_(maker.in(value).line),
        coupling_(plan.method == "modal"),
        has_fringes_(plan.means.fringes),
        blocks_(scene.view.width, scene.view.height, std::max(choices(plan).fringe_block_px, 1)),
        tabulated_blocks_(choices(plan).fringe_blocks),
        left_to_rays_(std::find(choices(plan).fringe_blocks.begin(), choices(plan).fringe_blocks.end(), 0) !=
                      choices(plan).fringe_blocks.end()) {
    if (cone_half_angle(scene)) cone_.emplace(scene, value);
    if (!cone_) {
      const auto [tx, ty] = maker.in(value).tangents(optics_.n_host);
      constant_ = light_.of(planar_jones(optics_, method_, mesh_, tx, ty));
    }
    const bool straight = cone_ && cone_->from_front();
    if (straight && centred(scene, cone_->center_x, cone_->center_y) &&
        axes_all(*optics_.column, mesh_, [](const OpticalPoint<S>& p) {
          return stays_at(p.axis.z, 0.0) || (stays_at(p.axis.x, 0.0) && stays_at(p.axis.y, 0.0));
        }))
      symmetry_ = Symmetry::half_turn;
    else if (straight && on_middle_row(scene, cone_->center_y) && light_.mirrored() &&
             axes_all(*optics_.column, mesh_,
                      [](const OpticalPoint<S>& p) { return mirrored(p.axis.x, p.axis.y, p.axis.z); }))
      symmetry_ = Symmetry::mirror;
    if (symmetry_ != Symmetry::none && !tabulated_blocks_.empty())  // the lower half of a picture is copied
      for (int b = 0; b < blocks_.count(); ++b)
        if ((b / blocks_.columns) * blocks_.block_px > scene.view.height / 2 + 2 * FringeBlocks::kRim)
          tabulated_blocks_[static_cast<std::size_t>(b)] = 0;
  }
  void light(const P& column, const P& row, S* out) const override {
    if (!cone_) {
      out[0] = constant_;
      return;
    }
    const auto t = cone_->at(column, row);
    out[0] = light_.of(planar_jones(optics(), method_, mesh_, t.x, t.y));
  }
  void fringe(const P& column, const P& row, FringePoint<S>* out) const override {
    const auto t = cone_->at(column, row);
    out[0] = planar_fringe(optics(), coupling_, mesh_, optics_.k0, Raise<S, S>(), light_, t.x, t.y);
  }
  int fringe_run(int column, double row, int count, FringeScratch& scratch, double* const* out) const override {
    return table_.run(column, row, count, !in_phase(), scratch, out);
  }
  FringeFields fringe_fields(int plane) const override {
    const std::size_t p = static_cast<std::size_t>(plane);
    if (tabulated_blocks_.empty()) return {};
    return plane > 0 && flows_[p - 1] ? FringeFields{.own = 0, .flow = flows_[p - 1]} : table_.fields(p);
  }
  FringeTraits fringe_traits() const override { return traits_; }
  bool in_phase() const override {
    return light_.linear() && !coupling_ && !optics_.column->absorbing && optics_.continuity == Continuity::e_and_h;
  }
  Symmetry symmetry() const override { return symmetry_; }
  void tabulate(typename SampleImage<S>::Wanted wanted, int threads) override {
    if (wanted != SampleImage<S>::Wanted::picture || tabulated_blocks_.empty()) return;
    // Where the cone's middle lies and how wide it is carries fringes along and changes none. Seen from the side a
    // wider cone carries them by other ways than straight away from the middle: its derivative is left to rays.
    const ParameterRef half_angle = scene_.view.camera ? ParameterRef{} : *cone_half_angle(scene_);
    std::vector<std::size_t> places;
    std::vector<int> changing;
    std::vector<int> read;  // by whatever there is in the scene
    for_each_ref(scene_, [&](const ParameterRef& ref) { read.push_back(ref.index); });
    if constexpr (ScalarTraits<S>::derivatives > 0)
      for (std::size_t j = 0; j < value_.active().size(); ++j) {
        const int index = value_.active()[j];
        int carries = 0;
        const auto uses = std::count(read.begin(), read.end(), index);
        for (const ParameterRef& ref : {scene_.view.center_x_px, scene_.view.center_y_px, half_angle})
          carries += ref && ref.index == index;
        if (carries > 0 && carries == uses) {
          const double growth =
              scene_.view.camera ? 0.0 : lane(cone_->tan_per_px.d[j], 0) / lane(plain(cone_->tan_per_px), 0);
          const auto along = [&](const S& centre) { return -lane(centre.d[j], 0) - growth * lane(plain(centre), 0); };
          flows_[j] = {along(cone_->center_x), along(cone_->center_y), growth};
        } else {
          places.push_back(j);
          changing.push_back(index);
        }
      }
    with_scalar_for<S>(changing.size(), [&]<class R>(Type<R>) {
      const std::vector<int> inside = known_inside<R>(changing);
      with_scalar_for<R>(inside.size(), [&]<class T>(Type<T>) { fill_table<R, T>(changing, inside, places, threads); });
    });
  }

 private:
  /// With the medium's samples remembered, from the first ray on: a picture that is all tabulated has none.
  const PlanarOptics<S>& optics() const {
    std::call_once(first_ray_, [&] {
      if (has_fringes_)
        planar_fringe(optics_, coupling_, mesh_, optics_.k0, Raise<S, S>(), light_, S(0.0), S(0.0));
      else
        planar_jones(optics_, method_, mesh_, S(0.0), S(0.0));
      optics_.column->freeze();
    });
    return optics_;
  }
  template <class T>
  struct Type {};
  /// f(Type<T>()) with the scalar of the fewest derivatives, at least n and at most those of Most.
  template <class Most, class F>
  static void with_scalar_for(std::size_t n, const F& f) {
    constexpr int kMost = ScalarTraits<Most>::derivatives;
    if constexpr (kMost > 0) {
      if (n == 0) return f(Type<Pack>());
      if constexpr (kMost > 1)
        if (n == 1) return f(Type<Dual1>());
      if constexpr (kMost > 2)
        if (n == 2) return f(Type<Dual2>());
      if constexpr (kMost > 4)
        if (n <= 4) return f(Type<Dual4>());
    }
    f(Type<Most>());
  }
  /// Which of `changing` medium, host or the direction know; others, the wavelength where nothing is dispersive, the
  /// polarizers, turn what they have done.
  template <class R>
  std::vector<int> known_inside(const std::vector<int>& changing) const {
    std::vector<int> inside;
    if constexpr (ScalarTraits<R>::derivatives > 0) {
      const Values<R> value(value_.theta(), changing, value_.memo());
      const PlanarOptics<R> optics = planar_optics(scene_, value);
      const ConeView<R> cone(scene_, value);
      const auto corner = cone.at(P(0.0), P(0.0)),
                 side = cone.at(P(scene_.view.width - 1.0), P(0.3 * scene_.view.height));
      for (std::size_t j = 0; j < changing.size(); ++j) {
        const auto still = [j](const R& x) { return lane(x.d[j], 0) == 0; };
        const bool outside = still(optics.n_host) && still(corner.x) && still(corner.y) && still(side.x) &&
                             still(side.y) && axes_all(*optics.column, mesh_, [&](const OpticalPoint<R>& p) {
                               return still(p.axis.x) && still(p.axis.y) && still(p.axis.z) && still(p.ordinary) &&
                                      still(p.extraordinary) && still(p.ordinary_im) && still(p.extraordinary_im) &&
                                      still(p.depth_slope_um);
                             });
        if (!outside) inside.push_back(changing[j]);
      }
    }
    return inside;
  }
  /// With rays that carry the derivatives by `changing` and no others, in T those by `inside`.
  template <class R, class T>
  void fill_table(const std::vector<int>& changing, const std::vector<int>& inside,
                  const std::vector<std::size_t>& places, int threads) {
    const Values<R> value(value_.theta(), changing, value_.memo());
    const Values<T> value_inside(value_.theta(), std::is_same_v<R, T> ? changing : inside, value_.memo());
    Raise<T, R> raise;
    if constexpr (!std::is_same_v<R, T>)
      for (std::size_t j = 0; j < inside.size(); ++j)
        raise.to[j] =
            static_cast<std::size_t>(std::find(changing.begin(), changing.end(), inside[j]) - changing.begin());
    const Line<R> light = maker_.in(value).line;
    const R k0 = wavenumber_per_um(scene_, value);
    std::optional<PlanarOptics<T>> own;
    const PlanarOptics<T>& optics = [&]() -> const PlanarOptics<T>& {
      if constexpr (std::is_same_v<T, S> && ScalarTraits<S>::derivatives == 0) {
        return this->optics();
      } else {
        own = planar_optics(scene_, value_inside, optics_.continuity);
        planar_fringe(*own, coupling_, mesh_, k0, raise, light, T(0.0), T(0.0));
        own->column->freeze();
        return *own;
      }
    }();
    const ConeView<T> cone(scene_, value_inside);
    table_ = FringeTable<S>(blocks_, tabulated_blocks_, kGivenUp * accuracy_, threads, places,
                            [&](const P& column, const P& row) {
                              const auto t = cone.at(column, row);
                              return planar_fringe(optics, coupling_, mesh_, k0, raise, light, t.x, t.y);
                            });
    constexpr double kSlopeError = 1e-5;
    traits_.averaged = !left_to_rays_ && table_.complete();
    traits_.even = traits_.averaged && table_.slope_error() < kSlopeError;
    if (traits_.averaged)
      table_.average_means();
    else
      table_.keep_all_fields();
  }
  const Scene& scene_;
  Values<S> value_;
  const BeamMaker& maker_;
  double accuracy_;  ///< of the intensity, demanded
  PlanarOptics<S> optics_;
  const TransportMethod<S>& method_;
  Mesh mesh_;
  Line<S> light_;
  bool coupling_, has_fringes_;
  std::optional<ConeView<S>> cone_;
  mutable std::once_flag first_ray_;
  Symmetry symmetry_ = Symmetry::none;
  FringeBlocks blocks_;
  std::vector<std::uint8_t> tabulated_blocks_;
  bool left_to_rays_;  ///< some of the picture
  FringeTraits traits_;
  FringeTable<S> table_;
  std::array<std::optional<FringeFlow>, ScalarTraits<S>::derivatives> flows_{};  ///< of S's derivatives
  S constant_;
};

}  // namespace

template <class S>
std::unique_ptr<SampleImage<S>> make_planar_image(const Scene& scene, const RenderPlan& plan, const Values<S>& value,
                                                  const BeamMaker& light) {
  return std::make_unique<PlanarImage<S>>(scene, plan, value, light);
}
#define BIREFIT_INSTANTIATE(S)                                                                                     \
  template std::unique_ptr<SampleImage<S>> make_planar_image<S>(const Scene&, const RenderPlan&, const Values<S>&, \
                                                                const BeamMaker&);                                 \
  template PlanarOptics<S> planar_optics<S>(const Scene&, const Values<S>&, Continuity);                           \
  template Mat2<S> planar_jones<S>(const PlanarOptics<S>&, const TransportMethod<S>&, const Mesh&, const S&, const S&);
BIREFIT_FOR_EACH_SCALAR_OF_TABLES(BIREFIT_INSTANTIATE)
#define BIREFIT_INSTANTIATE_RAISED(S, R)                                                                               \
  template FringePoint<R> planar_fringe<S, R>(const PlanarOptics<S>&, bool, const Mesh&, const R&, const Raise<S, R>&, \
                                              const Line<R>&, const S&, const S&);
BIREFIT_FOR_EACH_RAISE(BIREFIT_INSTANTIATE_RAISED)

}  // namespace birefit
