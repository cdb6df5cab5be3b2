#include "birefit/forecast.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <vector>

#include "core/threads.h"
#include "fit/problem/frame.h"
#include "fit/problem/task.h"
#include "medium/references.h"
#include "samples/kind.h"

namespace birefit {
namespace {

using namespace estimation;
using Clock = std::chrono::steady_clock;

double pixels_of(const View& view) { return static_cast<double>(view.width) * view.height; }

/// The same scene in pixels k times as large, the last ones cut off.
Scene coarser(Scene scene, int k) {
  View& view = scene.view;
  FilePixels& file = view.file;
  if (file.width == 0) file.width = view.width, file.height = view.height;
  file.bin *= k;
  view.width = std::max(1, view.width / k), view.height = std::max(1, view.height / k);
  for_each_number(scene, [&](ParameterRef& place, const NumberSpec& spec) {
    if (spec.unit == "px") place = place.seen(1.0 / k, -0.5 * (k - 1) / k);
  });
  view.pixel_size_um = view.pixel_size_um.seen(k, 0);
  return scene;
}

/// Seconds of a picture on one thread: what all of it shares, and what each of its pixels adds.
struct Cost {
  double shared = 0, a_pixel = 0;
  double of(double pixels) const { return shared + a_pixel * pixels; }
};

/// From pictures of the scene that grow until they tell enough, or are whole.
Cost measure(const Scene& scene, const Demand& demand, const Theta& theta, const Observable& observable,
             const std::vector<int>& active) {
  constexpr double kEnough = 0.15;  // s: what a clock and other programs add then matters little
  constexpr int kSmallest = 24;     // pixels on a side of the first
  const int side = std::max(scene.view.width, scene.view.height);
  Cost cost;
  double before_seconds = 0, before_pixels = 0;
  Rendering image;
  for (int k = std::max(1, side / kSmallest);; k = std::max(1, k / 2)) {
    const Scene small = coarser(scene, k);
    const RenderPlan chosen = plan(small, demand, theta, observable);
    const auto begin = Clock::now();
    render(small, chosen, theta, active, 1, image);
    const double seconds = std::chrono::duration<double>(Clock::now() - begin).count(), pixels = pixels_of(small.view);
    const bool grown = before_pixels > 0 && pixels > before_pixels;
    cost.a_pixel = grown ? std::max(0.0, (seconds - before_seconds) / (pixels - before_pixels)) : seconds / pixels;
    cost.shared = std::max(0.0, seconds - cost.a_pixel * pixels);
    if (k == 1 || (seconds > kEnough && grown) || seconds > 4 * kEnough) return cost;
    before_seconds = seconds, before_pixels = pixels;
  }
}

}  // namespace

double forecast_image(const Scene& scene, const Demand& demand, const Theta& theta, const Observable& observable) {
  if (!scene.microscope.directions.empty()) return 0;
  if (const RenderPlan chosen = plan(scene, demand, theta, observable); chosen.wave && chosen.cost_seconds > 1)
    return chosen.cost_seconds;
  return measure(scene, demand, theta, observable, {}).of(pixels_of(scene.view));
}

double forecast_fit(const FitJob& job) {
  const Task task(job);
  const Theta theta = job.parameters.values();
  // How often a fit looks at what: the solver and the analysis of errors at all pixels with derivatives, the search
  // before them many times at some; and what noise, residuals and reports take of each pixel (s). Found by the shipped
  // configs (docs/methods.md, "How long a fit takes").
  constexpr double kWhole = 90, kScan = 900, kPixel = 1.2e-5;
  constexpr double kRoundsOfZones = 4;  // what is left out of a picture follows the parameters, a fit each time
  const double scanned_each = std::max(50.0, static_cast<double>(job.options.scan_pixels) / std::max(1, task.frames()));
  // Where pixels are rays of their own the search looks at a quarter of them, roughly (search.cc).
  constexpr double kGlance = 0.25, kRough = 1e-2;
  double whole = 0, scanned = 0, pixels = 0;
  bool own_rays = false;
  Cost with_derivatives, plain;
  const View* measured = nullptr;
  for (int g = 0; g < task.frames(); ++g) {
    const Picture& picture = task.picture(g);
    const View& view = picture.scene.view;
    // Pictures of a job that are as large as each other cost alike: the first of them is measured.
    if (!measured || measured->width != view.width || measured->height != view.height) {
      with_derivatives = measure(picture.scene, job.demand, theta, task.observable(g), task.unknowns.searched);
      Demand demand = job.demand;
      own_rays = has_own_rays(picture.scene, task.planned(g, theta, kRough));
      if (own_rays) demand.intensity_accuracy = std::max(demand.intensity_accuracy, kRough);
      plain = measure(picture.scene, demand, theta, task.observable(g), {});
      measured = &view;
    }
    double used = pixels_of(view);
    if (!picture.mask.empty())
      used = static_cast<double>(std::count(picture.mask.values().begin(), picture.mask.values().end(), 1));
    whole += with_derivatives.of(used);
    pixels += used;
    scanned += plain.of(std::min(used, own_rays ? kGlance * scanned_each : scanned_each));
  }
  double rounds = std::max<double>(1, static_cast<double>(job.branches.size()));
  if (task.frames() > 0 && kind_of(task.picture(0).scene).zone) rounds *= kRoundsOfZones;
  const bool searches = !task.unknowns.searched.empty();
  return rounds * (kWhole * whole + (searches ? kScan * scanned : 0)) / thread_count(job.options.threads) +
         kPixel * pixels;
}

}  // namespace birefit
