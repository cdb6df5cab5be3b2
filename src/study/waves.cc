// When is a ray an image? Radial droplets by every model against their exact series.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "birefit/parameters.h"
#include "birefit/render.h"
#include "birefit/study.h"
#include "samples/waves/wave.h"
#include "study/ball_scene.h"

namespace birefit {
namespace {

using study::Ball;

double seconds_of(const std::function<void()>& work) {
  work();  // tables and memory
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

std::vector<WavePoint> measure_waves(bool quick, const std::function<void(const std::string&)>& say) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  std::vector<WavePoint> points;
  const auto measure = [&](const Ball& ball, bool efforts) {
    const study::BallScene b(ball);
    const std::string name = fmt::format("dn {:g} in {:g}", ball.birefringence, ball.host);
    const double radius = ball.radius_um, na = ball.objective_na;
    const Theta theta = b.table.values();
    const Scene& scene = b.scene;
    const RenderPlan series = plan(scene, {.ceiling = Ceiling::wave}, theta);
    Image exact;
    const double exact_seconds = seconds_of([&] { exact = render(scene, series, theta).intensity; });
    points.push_back({name, radius, na, "series", "", exact_seconds, 0, kNan});
    for (const Rays rays : {Rays::straight, Rays::eikonal}) {
      const RenderPlan by_rays = plan(scene, {.rays = rays}, theta);
      Image image;
      const double seconds = seconds_of([&] { image = render(scene, by_rays, theta).intensity; });
      points.push_back({name, radius, na, rays == Rays::straight ? "straight" : "eikonal", "", seconds,
                        picture_error(image, exact), kNan});
    }
    RenderPlan propagated = plan(scene, {.ceiling = Ceiling::wave, .method = "split_step"}, theta);
    const WavePlan planned = *propagated.wave;
    for (const double finer : {1.0, 0.7, 1.4, 2.0}) {
      if (finer != 1 && !efforts) break;
      auto changed = std::make_shared<WavePlan>(planned);
      const double box = planned.grid.nx * planned.grid.step_um;
      changed->grid.nx = changed->grid.ny = fast_fft_size(static_cast<int>(planned.grid.nx * finer));
      changed->ramp_um = changed->grid.step_um = box / changed->grid.nx;
      changed->grid.slabs = std::max(4, static_cast<int>(planned.grid.slabs * finer));
      propagated.wave = changed;
      Image image;
      const double seconds = seconds_of([&] { image = render(scene, propagated, theta).intensity; });
      points.push_back({name, radius, na, "split_step", finer == 1 ? "" : fmt::format("{:g} times as fine", finer),
                        seconds, picture_error(image, exact),
                        finer == 1 ? propagated.model_error + propagated.numerical_error : kNan});
    }
    if (radius > 7) return;
    Image image;
    const double seconds = seconds_of([&] { image = image_by_march(scene, theta); });
    points.push_back({name, radius, na, "march", "", seconds, picture_error(image, exact), kNan});
  };
  const std::vector<double> radii = quick ? std::vector<double>{2, 4.5} : std::vector<double>{2, 3, 4.5, 7, 10, 15};
  for (const auto& [birefringence, host] : {std::pair{0.22, 1.43}, {0.22, 1.52}, {0.03, 1.535}})
    for (const double radius : radii) {
      if (say) say(fmt::format("waves: dn {:g} in {:g}, radius {:g} um", birefringence, host, radius));
      measure({radius, birefringence, host, 0.4}, false);
    }
  if (say) say("waves: efforts");
  if (!quick) measure({4.5, 0.22, 1.52, 0.8}, true);
  return points;
}

}  // namespace birefit
