#include "study/stress_waves.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <fmt/format.h>

#include "birefit/error.h"
#include "birefit/render.h"
#include "core/quadrature.h"
#include "samples/choices.h"
#include "samples/waves/wave.h"
#include "study/ball_scene.h"
#include "wave/radial_series.h"

namespace birefit::study {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity(), kNan = std::numeric_limits<double>::quiet_NaN();

struct Trap {
  std::string sweep;
  double value;
  Ball ball;
};

std::vector<Trap> wave_traps(bool quick) {
  std::vector<Trap> all;
  Ball usual;
  usual.radius_um = 2;
  usual.pixels = 40;
  const auto sweep = [&](const std::string& name, const std::vector<double>& values, const auto& change) {
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (quick && i > 0 && i + 1 < values.size() && i % 3 != 0) continue;  // the ends and some between
      Ball ball = usual;
      change(ball, values[i]);
      all.push_back({name, values[i], ball});
    }
  };
  for (const double host : {1.43, 1.52})
    sweep(fmt::format("wave_radius_um in {:g}", host),
          quick ? std::vector<double>{0.3, 1, 4.5} : std::vector<double>{0.3, 0.6, 1, 2, 3, 4.5, 7, 10, 12},
          [&](Ball& b, double x) { b.radius_um = x, b.host = host; });
  // 1.59 is the mean index of the droplet, where nothing but its birefringence shows.
  for (const double birefringence : {0.22, 0.02})
    sweep(fmt::format("wave_host_index dn {:g}", birefringence),
          {1.0, 1.2, 1.33, 1.45, 1.5, 1.52, 1.56, 1.59, 1.65, 1.74, 1.8, 1.9, 2.1},
          [&](Ball& b, double x) { b.host = x, b.birefringence = birefringence; });
  // In 1.52 the last of it is no picture at all, in the others what the surfaces alone do to polarized light.
  for (const double host : {1.45, 1.52, 1.6})
    sweep(fmt::format("wave_birefringence in {:g}", host),
          {0.3, 0.1, 0.03, 1e-2, 1e-3, 1e-5, 0.0, -1e-5, -1e-3, -1e-2, -0.1, -0.2},
          [&](Ball& b, double x) { b.birefringence = x, b.host = host; });
  for (const double host : {1.33, 1.52})
    sweep(fmt::format("wave_objective_na in {:g}", host),
          {0.05, 0.1, 0.2, 0.4, 0.8, 1.0, 1.2, host - 0.02, host - 1e-3, host - 1e-6},
          [&](Ball& b, double x) { b.objective_na = x, b.host = host; });
  for (const double na : {0.4, 0.8})
    sweep(fmt::format("wave_focus_um na {:g}", na), {-15, -10, -5, -2, 2, 5, 10, 15},
          [&](Ball& b, double x) { b.focus_um = x, b.objective_na = na; });
  for (const double host : {1.33, 1.52, 1.6})
    sweep(fmt::format("wave_wall_um in {:g}", host), {1.9, 1, 0.5, 0.3, 0.2, 0.1, 0.05, 1e-3},
          [&](Ball& b, double x) { b.wall_um = x, b.host = host; });
  sweep("wave_analyzer_deg", {135, 134.99, 134, 130, 90, 45}, [](Ball& b, double x) { b.analyzer_deg = x; });
  sweep("wave_pixels_across", {400, 100, 30, 10, 6, 3, 2}, [](Ball& b, double x) { b.pixels = static_cast<int>(x); });
  // Directors without a series.
  usual.radius_um = quick ? 1 : 1.5;
  for (const double host : quick ? std::vector<double>{1.43} : std::vector<double>{1.43, 1.52, 1.7}) {
    sweep(fmt::format("wave_bipolar_dn in {:g}", host), {0.22, 0.05, 1e-2, 1e-3, -0.1},
          [&](Ball& b, double x) { b.tilt_deg = 30, b.birefringence = x, b.host = host; });
    sweep(fmt::format("wave_twist_deg in {:g}", host), {1, 30, 90, 180},
          [&](Ball& b, double x) { b.twist_deg = x, b.host = host; });
    sweep(fmt::format("wave_offset_um in {:g}", host), {1e-3, 0.1, 0.2, 0.25},
          [&](Ball& b, double x) { b.wall_um = 0.4, b.offset_um = x, b.host = host; });
  }
  return all;
}

/// Means over some pixels of the picture by the series evaluated at every one of their points.
double series_error(const Ball& ball, const Image& image) {
  const double k0 = 2 * std::numbers::pi / 0.59, n_o = 1.52, n_e = n_o + ball.birefringence,
               pixel = (2 * ball.radius_um + 4) / ball.pixels;
  RadialBall<double> cut{{}, ball.host, k0};
  if (ball.wall_um > 0) cut.layers.push_back({ball.radius_um - ball.wall_um, ball.host, ball.host});
  cut.layers.push_back({ball.radius_um - 0.5 * (ball.wall_um > 0 ? ball.wall_um : ball.radius_um), n_o, n_e});
  cut.layers.push_back({ball.radius_um, n_o, n_e});
  const int orders = 20 + static_cast<int>(1.3 * series_orders(k0 * ball.host * ball.radius_um));
  const double reach = 0.75 * ball.pixels * pixel;
  const RadialSeries<double> series = radial_series(cut, orders);
  const int nodes =
      static_cast<int>(1.5 * RadialImage<double>(series, ball.objective_na, ball.focus_um, reach).nodes());
  const RadialImage<double> field(series, ball.objective_na, ball.focus_um, reach, Pupil::focal_plane, nodes);
  std::vector<double> u, w;  // intensity has wavevectors up to twice the aperture's
  legendre_nodes(8 + static_cast<int>(0.7 * k0 * ball.objective_na * pixel), u, w);
  constexpr double kRadian = std::numbers::pi / 180;
  const double between = std::cos((ball.analyzer_deg - ball.polarizer_deg) * kRadian),
               sum = (ball.analyzer_deg + ball.polarizer_deg) * kRadian;
  double worst = 0;
  const int chosen = ball.pixels * ball.pixels < 16 ? ball.pixels * ball.pixels : 16;
  for (int i = 0; i < chosen; ++i) {
    // The plastic number's powers fill a square evenly.
    const int column = static_cast<int>(ball.pixels * std::fmod(0.5 + 0.7548776662466927 * i, 1.0)),
              row = static_cast<int>(ball.pixels * std::fmod(0.5 + 0.5698402909980532 * i, 1.0));
    double mean = 0;
    for (std::size_t a = 0; a < u.size(); ++a)
      for (std::size_t b = 0; b < u.size(); ++b) {
        const double x = (column - 0.5 * (ball.pixels - 1) + 0.5 * u[a]) * pixel,
                     y = (0.5 * (ball.pixels - 1) - row + 0.5 * u[b]) * pixel;
        const RadialAmplitudes<double> e = field(std::hypot(x, y));
        const double q = std::cos(2 * std::atan2(y, x) - sum), re = (1 + e.a0.re) * between + e.a2.re * q,
                     im = e.a0.im * between + e.a2.im * q;
        mean += 0.25 * w[a] * w[b] * (re * re + im * im);
      }
    const double error = std::abs(mean - image(column, row));
    worst = error <= kInfinite ? std::max(worst, error) : kInfinite;
  }
  return worst;
}

}  // namespace

void measure_wave_traps(bool quick, const std::function<void(const std::string&)>& say,
                        std::vector<StressPoint>& points) {
  std::string telling;
  for (const Trap& trap : wave_traps(quick)) {
    if (say && trap.sweep != telling) say(telling = trap.sweep);
    const BallScene b(trap.ball);
    const Theta theta = b.table.values();
    // Estimate and image of a method, or why there is none.
    const auto attempt = [&](const std::string& method, const auto& work) {
      StressPoint p{trap.sweep, trap.value, method + " of a ball", kNan, kInfinite, 0, ""};
      Image image;
      try {
        image = work(p);
        // No light is less than none; propagated light is interpolated to 1e-5.
        if (!std::all_of(image.values().begin(), image.values().end(),
                         [&](double x) { return std::isfinite(x) && x >= (method == "series" ? -1e-12 : -1e-5); }))
          p.error = kInfinite;
      } catch (const UserError& error) {
        p.flag = error.problems().front().what;
      } catch (const std::domain_error& error) {
        p.flag = error.what();
      }
      if (!p.flag.empty()) p.estimate = kInfinite;
      points.push_back(p);
      return image;
    };
    const auto planned = [&](const std::string& method) {
      return attempt(method, [&](StressPoint& p) {
        const RenderPlan chosen = plan(b.scene, {.ceiling = Ceiling::wave, .method = method}, theta);
        p.estimate = chosen.numerical_error + chosen.model_error;
        p.samples = chosen.wave
                        ? static_cast<double>(chosen.wave->grid.nx) * chosen.wave->grid.ny * chosen.wave->grid.slabs
                        : choices(chosen).radial_panels;
        return render(b.scene, chosen, theta, {}, 1).intensity;
      });
    };
    const auto judge = [](StressPoint& p, double error) {
      if (p.flag.empty() && !(p.error > 0)) p.error = error;
    };
    const bool exact_known = trap.ball.tilt_deg < 0 && trap.ball.twist_deg == 0 && trap.ball.offset_um == 0;
    Image exact;
    if (exact_known) {
      const Image series = planned("series");
      if (series.size() > 0) judge(points.back(), series_error(trap.ball, series));
      const Demand closer{.ceiling = Ceiling::wave, .intensity_accuracy = 1e-8, .method = "series"};
      exact = render(b.scene, plan(b.scene, closer, theta), theta, {}, 1).intensity;
    }
    const Image propagated = planned("split_step");
    if (exact_known && propagated.size() > 0) judge(points.back(), picture_error(propagated, exact));
    // Slow: in quick runs of the smallest only.
    if (exact_known && trap.ball.radius_um > (quick ? 0.5 : 2)) continue;
    const Image marched = attempt("march", [&](StressPoint& p) {
      const Image image = image_by_march(b.scene, theta, 1);
      p.estimate = 1.5 * march_error(b.scene, theta, 1);
      return image;
    });
    if (exact_known) {
      if (marched.size() > 0) judge(points.back(), picture_error(marched, exact));
      continue;
    }
    // Nobody knows the truth, but the two must not be further apart than both allow.
    const double allowed = points.back().estimate;
    points.pop_back();
    if (marched.size() == 0 || propagated.size() == 0) continue;
    judge(points.back(), picture_error(propagated, marched));
    points.back().estimate += allowed;
  }
}

}  // namespace birefit::study
