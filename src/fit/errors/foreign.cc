#include "fit/errors/foreign.h"

#include <cmath>

#include <fmt/format.h>

#include "fit/errors/catalogue.h"
#include "fit/weights/settle.h"
#include "samples/kind.h"
#include "scene/values.h"

namespace birefit::estimation {
namespace {

constexpr double kShare = 0.2;

/// Of pixels that `belongs(x, y)` chooses: how many, and chi-square beyond theirs.
template <class Belongs>
std::pair<double, double> theirs(const Optimum& optimum, const Belongs& belongs) {
  const PixelSet& set = optimum.problem->pixels(0);
  const Eigen::VectorXd residual = optimum.problem->noise_whitened_residual(0);
  double count = 0, excess = 0;
  for (std::size_t i = 0; i < set.pixels.size(); ++i)
    if (belongs(set.pixels[i][0], set.pixels[i][1])) {
      ++count;
      excess += std::pow(residual[static_cast<Eigen::Index>(i)], 2) - 1;
    }
  return {count, excess};
}

}  // namespace

double excess_of(const Optimum& optimum) {
  return theirs(optimum, [](int, int) { return true; }).second;
}

bool is_worth_leaving_out(double excess_before, double excess_after) {
  return excess_after < (1 - kShare) * excess_before;
}

std::vector<FitJob> narrower_jobs(const Task& task, const Optimum& optimum) {
  std::vector<FitJob> jobs;
  const auto [all, excess] = theirs(optimum, [](int, int) { return true; });
  if (!task.job.options.leave_out_outliers && is_asked(task.job.options, "specks")) {
    const Outliers specks = outliers_of(task, optimum, 0);
    const auto [count, of_specks] = theirs(optimum, [&](int x, int y) { return specks.pixels(x, y) != 0; });
    if (count > 0 && count < kMostOutliers * all && of_specks > kShare * excess) {
      jobs.push_back(task.job);
      jobs.back().options.leave_out_outliers = true;
    }
  }
  const Scene& scene = task.picture(0).scene;
  if (const ParameterRef diameter = traits_of(scene).sphere_diameter_um;
      diameter && is_asked(task.job.options, "outside")) {
    constexpr double kRadii = 1.08, kFewest = 0.2;  // of the pixels: they have to tell of the sphere by themselves
    const Values<double> value(optimum.theta, {}, nullptr);
    const double radius = kRadii * 0.5 * value(diameter) / value(scene.view.pixel_size_um);
    const double cx = value.get(scene.view.center_x_px, 0.5 * (scene.view.width - 1)),
                 cy = value.get(scene.view.center_y_px, 0.5 * (scene.view.height - 1));
    const auto outside = [&](int x, int y) { return std::hypot(x - cx, y - cy) > radius; };
    const auto [count, of_outside] = theirs(optimum, outside);
    if (of_outside > kShare * excess && all - count > kFewest * all) {
      FitJob& job = jobs.emplace_back(task.job);
      job.warnings.push_back(fmt::format(
          "{}: all outside of the sphere, {:.0f} pixels, was left out, as the model leaves most over there: "
          "a field stop, a neighbour or stray light?",
          task.picture(0).name, count));
      job.misfit.push_back("what is outside of the sphere was left out");
      Mask& mask = std::get<Picture>(job.measurements.front()).mask;
      for (int y = 0; y < mask.height(); ++y)
        for (int x = 0; x < mask.width(); ++x)
          if (outside(x, y)) mask(x, y) = 0;
    }
  }
  return jobs;
}

}  // namespace birefit::estimation
