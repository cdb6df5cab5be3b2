#pragma once
// The picture of such a sphere: rays of a table where it is smooth, elsewhere one a point.

#include <algorithm>
#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "samples/choices.h"
#include "samples/pixels/sampling.h"
#include "samples/sphere/ball_rays.h"
#include "samples/tables/polar_table.h"
#include "samples/tables/radial_table.h"
#include "samples/tables/round_view.h"

namespace birefit {

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
        map_(choices(plan).disc) {
    if (shell_in(optics_)) {
      plain_ = ball_optics(scene, value.template as<P>(), continuity_of(plan.demand));
      core_map_ = DiscMap(choices(plan).disc, true);
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
    for (const DiscSquare& q : choices(plan).disc) steps.push_back(q.steps);
    std::sort(steps.begin(), steps.end());
    steps.erase(std::unique(steps.begin(), steps.end()), steps.end());
    for (const DiscSquare& q : choices(plan).disc)
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
  void tabulate(typename SampleImage<S>::Wanted wanted, int threads) override {
    if (wanted != SampleImage<S>::Wanted::picture) return;
    std::vector<DiscSquare> squares = choices(plan_).disc;
    if (!core_apart_)  // it was when the picture was planned
      for (DiscSquare& q : squares) q.smooth = q.smooth && !q.of_core;
    table_ = PolarTable<S>(squares, kGivenUp * plan_.demand.intensity_accuracy, threads,
                           [this](int square, const P& v, const P& c, const P& s) {
                             const std::size_t i = static_cast<std::size_t>(square);
                             return light_at(choices(plan_).disc[i], v, c, s, meshes_[mesh_of_[i]]);
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
    if (choices(plan_).disc.empty()) return by_ray(meshes_[0]);
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

}  // namespace birefit
