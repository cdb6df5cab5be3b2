#include "fit/weights/settle.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "fit/weights/noise.h"

namespace birefit::estimation {
namespace {

bool is_cut(const Picture& picture) { return std::isfinite(picture.cut_below) || std::isfinite(picture.cut_above); }

/// The noise of the frames whose residual is clearly quieter than their image was. True where one is.
bool lower_noise(const Task& task, Optimum& optimum) {
  // What the image's own differences call noise may be fringes. Those of the residual may hold misfit: both are upper
  // bounds, and the fit takes the residual's when it is clearly lower.
  constexpr double kClearly = 0.8;
  bool lower = false;
  for (int g = 0; g < task.frames() && !optimum.stopped; ++g) {
    Frame& frame = optimum.frames[static_cast<std::size_t>(g)];
    if (!frame.noise.estimated || frame.noise_of_all) continue;
    const Picture& micrograph = task.picture(g);
    const Image image = fitted_image(task, optimum.frames, g, optimum.theta);
    const NoiseModel again = estimate_noise(micrograph, &image);
    if (mean_variance(micrograph, again, image) >= kClearly * mean_variance(micrograph, frame.noise, image)) continue;
    frame.noise = again;
    frame.sigma = standard_deviation(micrograph, again, image);
    lower = true;
  }
  return lower;
}

}  // namespace

Pixels pixels_in_range(const Task& task, const Optimum& optimum, int g) {
  const Picture& micrograph = task.picture(g);
  const Image& sigma = optimum.frames[static_cast<std::size_t>(g)].sigma;
  // Standard deviations of a pixel of the file: it is there that codes end.
  const double reach_in_sigma = 3.0 * micrograph.scene.view.file.bin;
  Pixels pixels = usable_pixels(micrograph, sigma);
  if (!is_cut(micrograph)) return pixels;
  const Image fitted = fitted_image(task, optimum.frames, g, optimum.theta);
  std::erase_if(pixels, [&](const std::array<int, 2>& at) {
    const double reach = reach_in_sigma * sigma(at[0], at[1]), value = fitted(at[0], at[1]);
    return value < micrograph.cut_below + reach || value > micrograph.cut_above - reach;
  });
  return pixels;
}

Optimum with_settled_range(const Task& task, Optimum optimum) {
  constexpr int kRounds = 2;
  for (int round = 0; round < kRounds && !optimum.stopped; ++round) {
    bool changed = false;
    for (int g = 0; g < task.frames(); ++g) {
      Frame& frame = optimum.frames[static_cast<std::size_t>(g)];
      if (!is_cut(task.picture(g))) continue;
      Pixels pixels = pixels_in_range(task, optimum, g);
      // A fit of what is hardly seen would follow the few pixels that are left.
      if (pixels.size() < usable_pixels(task.picture(g), frame.sigma).size() / 10 || pixels == frame.pixels) continue;
      frame.pixels = std::move(pixels);
      changed = true;
    }
    if (!changed) break;
    rebuild(task, optimum);
    solve_again(task, optimum, "without what the codes cut off");
  }
  return optimum;
}

Optimum with_settled_weights(const Task& task, Optimum optimum) {
  if (lower_noise(task, optimum)) {
    rebuild(task, optimum);
    optimum.iterations.clear();  // chi-square in other units; the report draws one curve
    solve_again(task, optimum, "noise from the residual");
  }
  for (int pass = 0; pass < 3 && !optimum.stopped; ++pass) {
    const bool by_signal = std::any_of(optimum.frames.begin(), optimum.frames.end(),
                                       [](const Frame& f) { return f.noise.counts_per_photon != 0; });
    if (pass > 0 && !by_signal) break;  // the weights do not depend on the signal
    // Nor do they matter to what a model misses by many times its noise, once they are the fitted signal's; where one
    // of several frames seems missed, its own weights may be all that is wrong.
    constexpr double kMissed = 10;
    const bool missed = task.frames() == 1 && optimum.per_pixel > kMissed;
    if (pass > 0 && missed) break;
    for (int g = 0; g < task.frames(); ++g) {
      Frame& frame = optimum.frames[static_cast<std::size_t>(g)];
      frame.sigma =
          standard_deviation(task.picture(g), frame.noise, fitted_image(task, optimum.frames, g, optimum.theta));
    }
    const Candidate before{optimum.searched, 0, projected_information(*optimum.problem)};
    rebuild(task, optimum);
    solve_again(task, optimum, "reweighted");
    constexpr double kStill = 0.02;  // standard errors, as a misfit makes them
    if (separation(before, optimum.searched) < kStill * (missed ? std::sqrt(optimum.per_pixel) : 1)) break;
  }
  return optimum;
}

Optimum with_settled_plans(const Task& task, Optimum optimum) {
  for (int round = 0; round < 2 && !optimum.stopped; ++round) {
    bool grown = false;
    for (int g = 0; g < task.frames(); ++g) {
      RenderPlan& planned = optimum.frames[static_cast<std::size_t>(g)].plan;
      try {
        RenderPlan now = task.planned(g, optimum.theta);
        if (!asks_for_more(now, planned)) continue;
        planned = std::move(now);
        grown = true;
      } catch (const UserError& error) {
        // Bounds that each are possible need not be so together.
        optimum.possible = false;
        optimum.warnings.push_back("The search ended where the scene cannot be: " + error.problems().front().what +
                                   ". Narrower bounds keep it away from there.");
        return optimum;
      }
    }
    if (!grown) break;
    task.say("the model needs finer steps here: solving once more");
    rebuild(task, optimum);
    solve_again(task, optimum, "replanned");
  }
  return optimum;
}

Outliers outliers_of(const Task& task, const Optimum& optimum, int g) {
  const Picture& micrograph = task.picture(g);
  const Image& sigma = optimum.frames[static_cast<std::size_t>(g)].sigma;
  const Image fitted = fitted_image(task, optimum.frames, g, optimum.theta);
  Image whitened(fitted.width(), fitted.height());
  Mask used(fitted.width(), fitted.height(), 0);
  for (const auto& [x, y] : pixels_in_range(task, optimum, g)) {
    used(x, y) = 1;
    whitened(x, y) = (micrograph.values(x, y) - fitted(x, y)) / sigma(x, y);
  }
  return find_outliers(whitened, used);
}

namespace {

/// Judges a frame's pixels anew; true where others are left out than before.
bool leave_out(const Task& task, Optimum& optimum, int g, bool first_round) {
  const Picture& micrograph = task.picture(g);
  Frame& frame = optimum.frames[static_cast<std::size_t>(g)];
  Outliers& before = optimum.left_out[static_cast<std::size_t>(g)];
  Outliers found = outliers_of(task, optimum, g);
  const Pixels usable = pixels_in_range(task, optimum, g);
  // So much cannot be dust: then the model is wrong, and leaving out what shows it would hide that.
  if (found.count > kMostOutliers * static_cast<double>(usable.size())) {
    if (first_round || before.count > 0)
      optimum.warnings.push_back(
          fmt::format("{}: {:.2g} % of the pixels stand out of the residual, more than dust would: none was left out. "
                      "Mask what is foreign, or change the model.",
                      micrograph.name, 100.0 * found.count / static_cast<double>(usable.size())));
    found = {};
  }
  if (found.count == before.count && (found.count == 0 || found.pixels.values() == before.pixels.values()))
    return false;
  frame.pixels.clear();
  for (const auto& [x, y] : usable)
    if (found.count == 0 || !found.pixels(x, y)) frame.pixels.push_back({x, y});
  if (frame.noise.estimated && !frame.noise_of_all) {  // a scratch looks like noise
    Picture seen = micrograph;
    for (std::size_t i = 0; found.count > 0 && i < seen.mask.values().size(); ++i)
      if (found.pixels.values()[i]) seen.mask.values()[i] = 0;
    const Image fitted = fitted_image(task, optimum.frames, g, optimum.theta);
    frame.noise = estimate_noise(seen, &fitted);
    frame.sigma = standard_deviation(seen, frame.noise, fitted);
  }
  before = std::move(found);
  return true;
}

}  // namespace

Optimum with_settled_outliers(const Task& task, Optimum optimum) {
  optimum.left_out.assign(static_cast<std::size_t>(task.frames()), {});
  if (!task.job.options.leave_out_outliers || are_rows(optimum.frames)) return optimum;
  constexpr int kMostRounds = 10;
  for (int round = 0; round < kMostRounds && !optimum.stopped; ++round) {
    bool changed = false;
    for (int g = 0; g < task.frames(); ++g) changed = leave_out(task, optimum, g, round == 0) || changed;
    if (!changed) break;
    rebuild(task, optimum);
    solve_again(task, optimum, "without outliers");
  }
  return optimum;
}

}  // namespace birefit::estimation
