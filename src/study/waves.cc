// When is a ray an image? Radial droplets by every model against their exact series.

#include <chrono>
#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "birefit/parameters.h"
#include "birefit/render.h"
#include "birefit/study.h"
#include "render/wave.h"

namespace birefit {
namespace {

struct Ball {
  double birefringence, host;
  std::string name() const { return fmt::format("dn {:g} in {:g}", birefringence, host); }
};

struct BallScene {
  ParameterTable table;
  Scene scene;
};
BallScene ball_scene(const Ball& ball, double radius_um, double objective_na) {
  BallScene b;
  b.scene.sample = Droplet{b.table.add_constant("diameter_um", 2 * radius_um), RadialDirector{}};
  b.scene.material = ConstantIndices{b.table.add_constant("ordinary", 1.52), b.table.add_constant("birefringence", ball.birefringence)};
  b.scene.surround_index = b.table.add_constant("index", ball.host);
  b.scene.microscope.wavelength_nm = b.table.add_constant("wavelength_nm", 590);
  b.scene.microscope.polarizer_deg = b.table.add_constant("polarizer_deg", 45);
  b.scene.microscope.analyzer_deg = b.table.add_constant("analyzer_deg", 135);
  b.scene.microscope.objective_na = objective_na;
  b.scene.view.width = b.scene.view.height = 128;
  b.scene.view.pixel_size_um = (2 * radius_um + 4) / 128;
  b.scene.view.center_x_px = b.table.add_constant("center_x", 63.5);
  b.scene.view.center_y_px = b.table.add_constant("center_y", 63.5);
  return b;
}

double relative_rms(const Image& image, const Image& exact) {
  double difference = 0, size = 0;
  for (std::size_t i = 0; i < exact.values().size(); ++i) {
    difference += std::pow(image.values()[i] - exact.values()[i], 2);
    size += exact.values()[i] * exact.values()[i];
  }
  return std::sqrt(difference / size);
}

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
  const auto measure = [&](const Ball& ball, double radius, double na, bool efforts) {
    const BallScene b = ball_scene(ball, radius, na);
    const Theta theta = b.table.values();
    Scene waves = b.scene;
    waves.ceiling = Ceiling::wave;
    const RenderPlan series = plan(waves, theta);
    Image exact;
    const double exact_seconds = seconds_of([&] { exact = render(waves, series, theta).intensity; });
    points.push_back({ball.name(), radius, na, "series", "", exact_seconds, 0, kNan});
    for (const Rays rays : {Rays::straight, Rays::eikonal}) {
      Scene scene = b.scene;
      scene.rays = rays;
      const RenderPlan by_rays = plan(scene, theta);
      Image image;
      const double seconds = seconds_of([&] { image = render(scene, by_rays, theta).intensity; });
      points.push_back({ball.name(), radius, na, rays == Rays::straight ? "straight" : "eikonal", "", seconds, relative_rms(image, exact), kNan});
    }
    waves.method = "split_step";
    RenderPlan propagated = plan(waves, theta);
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
      const double seconds = seconds_of([&] { image = render(waves, propagated, theta).intensity; });
      points.push_back({ball.name(), radius, na, "split_step", finer == 1 ? "" : fmt::format("{:g} times as fine", finer), seconds, relative_rms(image, exact),
                        finer == 1 ? propagated.model_error + propagated.numerical_error : kNan});
    }
    if (radius > 7) return;
    Image image;
    const double seconds = seconds_of([&] { image = image_by_march(waves, theta); });
    points.push_back({ball.name(), radius, na, "march", "", seconds, relative_rms(image, exact), kNan});
  };
  const std::vector<double> radii = quick ? std::vector<double>{2, 4.5} : std::vector<double>{2, 3, 4.5, 7, 10, 15};
  for (const Ball& ball : {Ball{0.22, 1.43}, Ball{0.22, 1.52}, Ball{0.03, 1.535}})
    for (const double radius : radii) {
      if (say) say(fmt::format("waves: {}, radius {:g} um", ball.name(), radius));
      measure(ball, radius, 0.4, false);
    }
  if (say) say("waves: efforts");
  if (!quick) measure({0.22, 1.52}, 4.5, 0.8, true);
  return points;
}

}  // namespace birefit
