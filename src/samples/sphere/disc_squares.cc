// How a sphere's disc is parted: mesh steps by place, and where its light is interpolated.

#include <algorithm>

#include <fmt/format.h>

#include "samples/choices.h"
#include "samples/sphere/ball_image.h"
#include "transport/intensity_distance.h"

namespace birefit {
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
        within_(points_within(plan.means.samples, plan.means.bin_px)) {
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
      const std::size_t bin = std::min(plan_.means.samples.size() - 1,
                                       static_cast<std::size_t>(std::hypot(middle[0], middle[1]) / plan_.means.bin_px));
      points = share_ * area * square(static_cast<double>(plan_.means.samples[bin]));
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
        std::clamp(edge_px_ * (1 - v * v) / plan_.means.bin_px, 0.0, static_cast<double>(within_.size() - 1));
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
      choices(plan).disc.push_back(q);
      error = std::max(error, changes[i]);
      if (q.smooth) smooth_error = std::max(smooth_error, errors[i]);
      const double here = q.smooth ? kRays : q.points;
      rays += here;
      work += here * q.steps;
    }
    open = std::move(next);
  }
  plan.numerical_error = std::max(plan.numerical_error, error) + smooth_error;
  const auto [fewest, most] =
      std::minmax_element(choices(plan).disc.begin(), choices(plan).disc.end(),
                          [](const DiscSquare& a, const DiscSquare& b) { return a.steps < b.steps; });
  const auto smooth =
      std::count_if(choices(plan).disc.begin(), choices(plan).disc.end(), [](const DiscSquare& q) { return q.smooth; });
  plan.reasons.push_back(fmt::format("steps by place on the disc, as its rays need: {} to {}, {:.0f} a ray in the mean",
                                     fewest->steps, most->steps, work / std::max(rays, 1.0)));
  plan.reasons.push_back(fmt::format(
      "the droplet does not look the same from all sides of the viewing axis: {} of {} parts of the disc are smooth "
      "enough to be interpolated from {} rays each{}, elsewhere one ray a point; {:.0f} rays instead of {:.0f}",
      smooth, choices(plan).disc.size(), kRays, smooth > 0 ? fmt::format(" (to {:.1e})", smooth_error) : "", rays,
      points_of.all()));
}

int StepsByPlace::at(double fraction, double x, double y) const {
  if (choices(plan_).disc.empty()) return plan_.steps;
  double inverse_major;
  const double turn = disc::turn_of(x, y, inverse_major);
  return choices(plan_).disc[static_cast<std::size_t>(map_.find(std::sqrt(std::max(0.0, 1 - fraction)), turn))].steps;
}

}  // namespace birefit
