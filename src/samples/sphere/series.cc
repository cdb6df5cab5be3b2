#include "samples/sphere/series.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include "core/threads.h"
#include "instrument/exposure.h"
#include "samples/choices.h"
#include "samples/pixels/pixel_mean.h"
#include "samples/sphere/droplet.h"
#include "samples/tables/radial_table.h"
#include "samples/tables/round_view.h"
#include "samples/waves/objective.h"
#include "wave/radial_series.h"
#include "wave/tilted_series.h"

namespace birefit {
namespace {

/// The series knows single numbers, not lanes.
template <class S>
struct SingleOf {
  using Type = double;
  static double of(const S& x) { return lane(plain(x), 0); }
};
template <int N>
struct SingleOf<Dual<Pack, N>> {
  using Type = Dual<double, N>;
  static Type of(const Dual<Pack, N>& x) {
    Type r(lane(x.value, 0));
    for (int j = 0; j < N; ++j) r.d[static_cast<std::size_t>(j)] = lane(x.d[static_cast<std::size_t>(j)], 0);
    return r;
  }
};

/// The picture along its radius, of the axis' direction or of the condenser's.
template <class Single>
struct SeriesFields {
  struct Direction {
    double weight;
    bool mirrored;  ///< stands for its mirror image by the picture's x, too
    std::optional<TiltedRadialImage<Single>> image;
  };
  std::optional<RadialImage<Single>> axis;
  std::vector<Direction> directions;
};

template <class S>
class SeriesImage final : public SampleImage<S> {
 public:
  using P = PlainOf<S>;
  using Single = typename SingleOf<S>::Type;
  SeriesImage(const Scene& scene, const RenderPlan& plan, const Values<S>& value, const BeamMaker& light)
      : optics_(droplet_optics(scene, value)),
        reach_um_(choices(plan).series_reach_um),
        panels_(choices(plan).radial_panels),
        na_(value(scene.microscope.objective_na)),
        pupil_(scene.microscope.aplanatic ? Pupil::aplanatic : Pupil::focal_plane),
        focus_um_(value.get(scene.microscope.focus_um, 0.0)),
        light_(light.in(value).line),
        view_(scene, value, light_),
        rings_(plan.condenser_rings) {
    if (rings_ > 0) {
      const CondenserDisc<S> disc = condenser_disc(scene.microscope, value, true);
      const auto single = [](const S& x) { return SingleOf<S>::of(x); };
      condenser_ = {single(disc.radius), single(disc.inner_radius), {Single(0.0), Single(0.0)}};
    }
    symmetry_ = round_symmetry(scene, value, light_.line(), false);
    RadialBall<Single> ball;
    const auto one = [](const S& x) { return SingleOf<S>::of(x); };
    if (optics_.director == DropletOptics<S>::Director::shell)
      ball.layers.push_back({one(optics_.core_um), one(optics_.core_index), one(optics_.core_index)});
    ball.layers.push_back({one(optics_.radius_um), one(optics_.n_o), one(optics_.n_e)});
    ball.n_host = one(optics_.n_host);
    ball.k0 = one(optics_.k0);
    series_ = radial_series(ball);
  }

  void tabulate(typename SampleImage<S>::Wanted, int threads) override {
    const SeriesFields<Single> fields = series_fields(threads);
    table_ = RadialTable<S>(panels_, light_.functions(true), threads,
                            [&](const P& v, S* out) { terms(fields, v * P(reach_um_), out); });
  }

  Symmetry symmetry() const override { return symmetry_; }

  void light(const P& column, const P& row, S* out) const override {
    const auto place = view_.at(column, row);
    const auto basis = RoundView<S>::basis(place);
    const P v = place.rho_um * P(1 / reach_um_);
    if constexpr (ScalarTraits<S>::derivatives == 0) {
      out[0] = table_.sum(light_.functions(true), v, basis.data());
    } else {
      typename RadialTable<S>::Slopes slopes;
      const auto turned = RoundView<S>::turned(place);
      out[0] = table_.sum(light_.functions(true), v, basis.data(), turned.data(), &slopes);
      view_.add_moves_and_turns(place, slopes.by_v * P(1 / reach_um_), slopes.turned, out[0]);
    }
  }

  /// Largest difference between the table and the series, over places that are no nodes of it.
  double table_error() const {
    const SeriesFields<Single> fields = series_fields(1);
    double error = 0;
    for (int i = 0; i < 60; ++i) {
      const double turn = (i + 0.5) * 0.6180339887498949, v = turn - std::floor(turn);
      std::array<S, RoundView<S>::kMostTerms> f;
      terms(fields, P(v * reach_um_), f.data());
      for (std::size_t t = 0; t < static_cast<std::size_t>(light_.functions(true)); ++t) {
        std::array<P, RoundView<S>::kMostTerms> basis;
        basis.fill(P(0.0));
        basis[t] = P(1.0);
        const S read = table_.sum(light_.functions(true), P(v), basis.data());
        error = std::max(error, std::abs(lane(plain(read) - plain(f[t]), 0)));
      }
    }
    return error;
  }

 private:
  SeriesFields<Single> series_fields(int threads) const {
    SeriesFields<Single> fields;
    const Single na = SingleOf<S>::of(na_), focus = SingleOf<S>::of(focus_um_);
    if (rings_ == 0) {
      fields.axis.emplace(series_, na, focus, reach_um_, pupil_);
      return fields;
    }
    const auto angle = [&](const Single& aperture) {
      return std::asin(std::min(1.0, plain(aperture) / plain(series_.n_host)));
    };
    const ScatteringTable<Single> amplitudes(series_, angle(na) + angle(condenser_.radius) + 1e-6);
    std::vector<DiscRule::Node> nodes = DiscRule(rings_).nodes;
    std::erase_if(nodes, [](const DiscRule::Node& n) { return n.sin_azimuth < -1e-9; });  // mirror images are there
    fields.directions.resize(nodes.size());
    parallel_for(static_cast<int>(nodes.size()), threads, [&](int i) {
      const DiscRule::Node& node = nodes[static_cast<std::size_t>(i)];
      auto& direction = fields.directions[static_cast<std::size_t>(i)];
      direction.weight = node.weight, direction.mirrored = node.sin_azimuth > 1e-9;
      direction.image.emplace(series_, amplitudes, DiscRule::kappa(node, condenser_), na, focus, reach_um_, pupil_);
    });
    return fields;
  }
  /// part(k) of every lane, gathered.
  template <class Part>
  static S in_lanes(const Part& part) {
    if constexpr (kLanesOf<S> == 1) {
      return part(std::size_t{0});
    } else {
      alignas(64) double values[kLanes];
      const auto gather = [&](const auto& of) {
        for (std::size_t k = 0; k < kLanes; ++k) values[k] = of(part(k));
        return Pack::load_aligned(values);
      };
      if constexpr (ScalarTraits<S>::derivatives > 0) {
        S r(gather([](const Single& x) { return x.value; }));
        for (std::size_t j = 0; j < r.d.size(); ++j) r.d[j] = gather([j](const Single& x) { return x.d[j]; });
        return r;
      } else {
        return gather([](const Single& x) { return x; });
      }
    }
  }
  void terms(const SeriesFields<Single>& fields, const P& rho_um, S* f) const {
    constexpr std::size_t kWide = static_cast<std::size_t>(kLanesOf<S>);
    if (fields.axis) {
      // In the (radial, azimuthal) frame the Jones matrix is diagonal, (1 + A0) +- A2.
      std::array<RadialAmplitudes<Single>, kWide> a;
      for (std::size_t k = 0; k < kWide; ++k) a[k] = (*fields.axis)(Single(lane(rho_um, static_cast<int>(k))));
      const Complex<S> direct(1.0 + in_lanes([&](std::size_t k) { return a[k].a0.re; }),
                              in_lanes([&](std::size_t k) { return a[k].a0.im; })),
          turned(in_lanes([&](std::size_t k) { return a[k].a2.re; }),
                 in_lanes([&](std::size_t k) { return a[k].a2.im; }));
      light_.terms({direct + turned, {}, {}, direct - turned}, S(1.0), true, f);
      return;
    }
    // All directions together look the same all around, each by itself does not: its Jones matrix on the x axis, where
    // the radial direction is x, is as good as any.
    const int count = light_.functions(true);
    for (int t = 0; t < count; ++t) f[t] = S(0.0);
    const auto add = [&](const Mat2<S>& j, double weight) {
      S of_one[RoundView<S>::kMostTerms];
      light_.terms(j, S(weight), false, of_one);
      for (int t = 0; t < count; ++t) f[t] = f[t] + of_one[t];
    };
    for (const auto& direction : fields.directions) {
      std::array<Mat2<Single>, kWide> m;
      for (std::size_t k = 0; k < kWide; ++k) m[k] = (*direction.image)(lane(rho_um, static_cast<int>(k)));
      const auto entry = [&](Complex<Single> Mat2<Single>::*which) {
        return Complex<S>(in_lanes([&](std::size_t k) { return (m[k].*which).re; }),
                          in_lanes([&](std::size_t k) { return (m[k].*which).im; }));
      };
      const Mat2<S> j{entry(&Mat2<Single>::a), entry(&Mat2<Single>::b), entry(&Mat2<Single>::c),
                      entry(&Mat2<Single>::d)};
      const Complex<S> none;
      add(j, direction.weight);
      if (direction.mirrored) add({j.a, none - j.b, none - j.c, j.d}, direction.weight);
    }
  }

  DropletOptics<S> optics_;
  double reach_um_;
  int panels_;
  S na_;
  Pupil pupil_;
  S focus_um_;
  RoundLight<S> light_;
  RoundView<S> view_;
  int rings_;
  CondenserDisc<Single> condenser_;  ///< with rings_ > 0
  Symmetry symmetry_;
  RadialSeries<Single> series_;
  RadialTable<S> table_;
};

}  // namespace

bool has_series(const Scene& scene) {
  // Light from all around a slanted direction makes no round picture.
  if (scene.microscope.condenser && scene.microscope.condenser->tilt_deg) return false;
  const Droplet& droplet = std::get<Droplet>(scene.sample);
  if (const auto* radial = std::get_if<RadialDirector>(&droplet.director)) return !radial->twist_deg;
  const auto* shell = std::get_if<ShellDirector>(&droplet.director);
  return shell && !shell->offset_um[0];
}

RenderPlan plan_series(const Scene& scene, const Demand& demand, const Values<double>& value, const BeamMaker& light) {
  const DropletOptics<double> o = droplet_optics(scene, value);
  check_objective(scene, value, o.n_host);
  const double na = value(scene.microscope.objective_na), px = value(scene.view.pixel_size_um);
  RenderPlan plan;
  plan.demand = demand;
  plan.method = "series";
  plan.physics = "wave";
  const double size = o.k0 * std::max({o.n_o, o.n_e, o.n_host}) * o.radius_um;
  if (size > 1000)
    throw UserError(
        Where{},
        fmt::format("a sphere of {:.3g} um is too large for the exact series ({:.0f} radians of phase; up to 1000)",
                    2 * o.radius_um, size),
        "check diameter_um, or use ceiling: one_way");
  // To the farthest corner, and a tenth more: the centre may be fitted.
  const double cx = value(scene.view.center_x_px), cy = value(scene.view.center_y_px);
  choices(plan).series_reach_um = 1.1 * px *
                                  (2 + std::hypot(std::max(std::abs(cx), std::abs(scene.view.width - 1 - cx)),
                                                  std::max(std::abs(cy), std::abs(scene.view.height - 1 - cy))));
  plan.reasons.push_back(
      "a sphere with a radial axis has an exact solution of Maxwell's equations, cheaper than any other wave optics: "
      "its series");
  // Intensity has no wavevector beyond twice the aperture's: panels of a few radians of that.
  const double target = std::max(1e-3 * plan.demand.intensity_accuracy, 1e-11),
               finest = 2 * o.k0 * na * choices(plan).series_reach_um;
  double error = 0;
  for (choices(plan).radial_panels = std::max(2, static_cast<int>(finest / 8));;
       choices(plan).radial_panels += std::max(1, choices(plan).radial_panels / 4)) {
    SeriesImage<double> image(scene, plan, value, light);
    image.tabulate(SampleImage<double>::Wanted::picture, 1);
    error = image.table_error();
    if (error <= target || choices(plan).radial_panels > finest) break;
  }
  plan.reasons.push_back(fmt::format("its field at {} radii serves all pixels (interpolated to {:.1e})",
                                     choices(plan).radial_panels * RadialTable<double>::kPoints, error));
  // Pixels on a spiral over the sphere and what the focus spreads around it; few stand for many, hence thrice the
  // worst.
  const double over = std::min(choices(plan).series_reach_um / 1.1,
                               o.radius_um + 1 + std::abs(value.get(scene.microscope.focus_um, 0.0)) * na / o.n_host) /
                      px;
  const Values<Pack> lanes = value.as<Pack>();
  SeriesImage<Pack> image(scene, plan, lanes, light);
  image.tabulate(SampleImage<Pack>::Wanted::picture, 1);
  constexpr int kPixels = 96;
  double left = 0;
  plan.means.samples = {1};
  for (int& n = plan.means.samples[0];; n += n < 4 ? 1 : 2) {
    left = 0;
    for (int i = 0; i < kPixels; ++i) {
      const double radius = over * (i + 0.5) / kPixels, azimuth = 2.399963 * i,
                   column = std::round(cx + radius * std::cos(azimuth)),
                   row = std::round(cy + radius * std::sin(azimuth));
      if (column < 0 || row < 0 || column >= scene.view.width || row >= scene.view.height) continue;
      left = std::max(
          left, 3 * std::abs(lane(
                        mean_over_one_pixel(image, column, row, n) - mean_over_one_pixel(image, column, row, 16), 0)));
    }
    if (left <= 0.5 * plan.demand.intensity_accuracy || n >= 8) break;
  }
  plan.numerical_error = 2 * error + left;
  plan.reasons.push_back(fmt::format("pixel means from {0} x {0} points, measured: they are good to {1:.1e}",
                                     plan.means.samples[0], left));
  if (plan.numerical_error > plan.demand.intensity_accuracy)
    plan.warnings.push_back(fmt::format(
        "Pixels as large as these ({:.3g} um) average over so many fringes that their means are good to {:.1e} only.",
        px, plan.numerical_error));
  const double radii = choices(plan).radial_panels * RadialTable<double>::kPoints,
               points = static_cast<double>(scene.view.width) * scene.view.height * plan.means.samples[0] *
                        plan.means.samples[0];
  // more radii take more orders; measured with eight lanes
  plan.cost_seconds = radii * (1e-6 + 2e-9 * radii) + 2.5e-9 * points;
  return plan;
}

double series_ripple_period(const Scene& scene, const Values<double>& value, int index) {
  if (index != std::get<Droplet>(scene.sample).diameter_um.index) return 0;
  // Light caught under the surface: resonances follow each other by atan(s)/s of the size parameter, s^2 = m^2 - 1 (P.
  // Chylek, J. Opt. Soc. Am. A 7, 1609 (1990)); by one where the sphere is hardly denser.
  const DropletOptics<double> o = droplet_optics(scene, value);
  const double s2 = o.n_o * o.n_e / (o.n_host * o.n_host) - 1, s_root = std::sqrt(std::max(s2, 1e-6));
  return 2 * std::atan(s_root) / s_root / (o.k0 * o.n_host);
}

template <class S>
std::unique_ptr<SampleImage<S>> make_series_image(const Scene& scene, const RenderPlan& plan, const Values<S>& value,
                                                  const BeamMaker& light) {
  return std::make_unique<SeriesImage<S>>(scene, plan, value, light);
}
#define BIREFIT_INSTANTIATE(S)                                                                                     \
  template std::unique_ptr<SampleImage<S>> make_series_image<S>(const Scene&, const RenderPlan&, const Values<S>&, \
                                                                const BeamMaker&);
BIREFIT_FOR_EACH_SCALAR_OF_TABLES(BIREFIT_INSTANTIATE)

}  // namespace birefit
