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
std::pair<double, double> theirs(const Optimum& optimum, const Belongs& belongs, std::size_t frame = 0) {
  const PixelSet& set = optimum.problem->pixels(frame);
  const Eigen::VectorXd residual = optimum.problem->noise_whitened_residual(frame);
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
  double excess = 0;
  for (std::size_t g = 0; g < optimum.frames.size(); ++g)
    excess += theirs(
                  optimum, [](int, int) { return true; }, g)
                  .second;
  return excess;
}

bool is_worth_leaving_out(double excess_before, double excess_after) {
  return excess_after < (1 - kShare) * excess_before;
}

bool are_specks_most(const Task& task, const Optimum& optimum) {
  // What a model leaves over without them is no less than noise; and so little would widen no interval.
  constexpr double kMost = 0.5, kMatters = 0.2;
  if (task.job.options.leave_out_outliers || !is_asked(task.job.options, "specks") || are_rows(optimum.frames))
    return false;
  double all = 0, excess = 0, of_specks = 0;
  for (int g = 0; g < task.frames(); ++g) {
    const auto frame = static_cast<std::size_t>(g);
    const auto [pixels, beyond] = theirs(
        optimum, [](int, int) { return true; }, frame);
    all += pixels, excess += beyond;
  }
  if (!(excess > kMatters * all)) return false;
  for (int g = 0; g < task.frames(); ++g) {
    const Outliers specks = outliers_of(task, optimum, g);
    const auto frame = static_cast<std::size_t>(g);
    const auto [count, beyond] = theirs(
        optimum, [&](int x, int y) { return specks.pixels(x, y) != 0; }, frame);
    if (count < kMostOutliers * static_cast<double>(optimum.problem->pixels(frame).pixels.size())) of_specks += beyond;
  }
  return of_specks > kMost * excess;
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
