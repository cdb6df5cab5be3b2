#include "fit/problem/frame.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "fit/problem/light.h"
#include "fit/weights/noise.h"
#include "samples/kind.h"

namespace birefit::estimation {
namespace {

/// The config's start values, or where it is better informed, what an earlier fit knows.
Theta start_of(const FitJob& job) {
  Theta theta = job.parameters.values();
  if (!job.prior) return theta;
  for (std::size_t i = 0; i < job.prior->names.size(); ++i)
    if (const ParameterRef ref = job.parameters.find(job.prior->names[i]); ref && job.parameters[ref].free)
      theta[static_cast<std::size_t>(ref.index)] = std::clamp(job.prior->mean[static_cast<Eigen::Index>(i)],
                                                              job.parameters[ref].lower, job.parameters[ref].upper);
  job.parameters.follow(theta);
  return theta;
}

/// A frame of one value tells no noise: it has that of the noisiest one.
void borrow_noise(const Task& task, Frames& frames) {
  constexpr double kNone = 1e-4;
  const auto sd = [&](int g) {
    const Image& sigma = frames[static_cast<std::size_t>(g)].sigma;
    return *std::max_element(sigma.values().begin(), sigma.values().end());
  };
  int noisiest = 0;
  for (int g = 1; g < task.frames(); ++g)
    if (sd(g) > sd(noisiest)) noisiest = g;
  for (int g = 0; g < task.frames(); ++g) {
    Frame& frame = frames[static_cast<std::size_t>(g)];
    if (!frame.noise.estimated || !(sd(g) < kNone * sd(noisiest))) continue;
    frame.noise = frames[static_cast<std::size_t>(noisiest)].noise;
    frame.noise_of_all = true;
    frame.sigma = standard_deviation(task.picture(g), frame.noise, smoothed(task.picture(g)));
    frame.pixels = usable_pixels(task.picture(g), frame.sigma);
  }
}

/// Of a pixel's noise: where all pixels share less, each frame's own estimate tells its noise better.
constexpr double kCoarse = 0.1;

/// Where the light is even, every pixel is rounded the same way, and no mean makes that smaller. By all such frames
/// together: in one of them the noise is all of it or none, as its light falls between codes or on one.
void note_rounding(const Task& task, Frames& frames) {
  std::vector<const Picture*> even;
  for (int g = 0; g < task.frames(); ++g)
    if (const Picture& picture = task.picture(g);
        traits_of(picture.scene).even && frames[static_cast<std::size_t>(g)].pixels.size() > 1)
      even.push_back(&picture);
  const CoarseCodes codes = coarse_codes(even);
  if (!(codes.shared_sd > 0)) return;
  for (int g = 0; g < task.frames(); ++g) {
    const Picture& picture = task.picture(g);
    if (std::find(even.begin(), even.end(), &picture) == even.end()) continue;
    Frame& frame = frames[static_cast<std::size_t>(g)];
    frame.rounding_sd = codes.shared_sd;
    if (!frame.noise.estimated || codes.shared_sd < kCoarse * codes.pixel_sd) continue;
    frame.noise = {codes.pixel_sd, 0, true};
    frame.noise_of_all = true;
    frame.sigma = standard_deviation(picture, frame.noise, smoothed(picture));
  }
}

/// Chi-square is made of squares.
void refuse_what_overflows(const Picture& picture) {
  double largest = 0;
  for (std::size_t i = 0; i < picture.values.values().size(); ++i)
    if (const double value = picture.values.values()[i]; picture.mask.values()[i] && std::isfinite(value))
      largest = std::max(largest, std::abs(value));
  if (!std::isfinite(largest * largest))
    throw UserError(Where{},
                    fmt::format("{} has values up to {:.2g}, whose squares no number holds", picture.name, largest),
                    "divide them by a power of ten");
}

}  // namespace

Start prepare(const Task& task) {
  const FitJob& job = task.job;
  if (job.measurements.empty()) throw UserError(Where{}, "there is no image to fit");
  Start start;
  start.theta = start_of(job);
  start.searched.resize(static_cast<Eigen::Index>(task.unknowns.searched.size()));
  for (std::size_t j = 0; j < task.unknowns.searched.size(); ++j)
    start.searched[static_cast<Eigen::Index>(j)] = start.theta[static_cast<std::size_t>(task.unknowns.searched[j])];
  std::size_t used = 0;
  for (int g = 0; g < task.frames(); ++g) {
    const Picture& micrograph = task.picture(g);
    refuse_what_overflows(micrograph);
    Frame frame;
    frame.plan = task.planned(g, start.theta);
    frame.noise = micrograph.noise ? *micrograph.noise : estimate_noise(micrograph);
    frame.sigma = standard_deviation(micrograph, frame.noise, smoothed(micrograph));
    frame.pixels = usable_pixels(micrograph, frame.sigma);
    if (frame.pixels.empty())
      throw UserError(Where{}, micrograph.name + " has no usable pixel", "check mask, roi_px and saturation_counts");
    used += frame.pixels.size();
    start.frames.push_back(std::move(frame));
  }
  borrow_noise(task, start.frames);
  note_rounding(task, start.frames);
  if (used <= static_cast<std::size_t>(task.unknowns.size()))
    throw UserError(Where{}, fmt::format("{} usable pixels cannot determine {} parameters", used, task.unknowns.size()),
                    "check mask and roi_px");
  return start;
}

bool are_rows(const Frames& frames) {
  return std::all_of(frames.begin(), frames.end(), [](const Frame& frame) { return frame.pixels.size() == 1; });
}

bool has_own_rays(const Scene& scene, const RenderPlan& plan) {
  return traits_of(scene).sphere_diameter_um && !has_radial_table(plan) && !plan.wave;
}
bool has_own_rays(const Task& task, const Frame& frame, int g) {
  return has_own_rays(task.picture(g).scene, frame.plan);
}

bool by_waves(const Frames& frames) {
  return std::any_of(frames.begin(), frames.end(), [](const Frame& frame) { return frame.plan.wave != nullptr; });
}

std::vector<Misfit> misfit_of_prior(const Task& task, const Theta& theta) {
  std::vector<Misfit> misfit(static_cast<std::size_t>(task.frames()));
  if (task.job.prior && task.job.prior->frame_scatter)
    for (int g = 0; g < task.frames(); ++g) {
      Misfit& own = misfit[static_cast<std::size_t>(g)];
      own.mean_sd = task.job.prior->frame_scatter->intensity_sd * std::abs(task.gain_of(g, theta));
      own.mean_follows_shape = false;
    }
  return misfit;
}

std::vector<Misfit> misfit_expected(const Task& task, const Frames& frames, const Theta& theta) {
  std::vector<Misfit> misfit = misfit_of_prior(task, theta);
  if (task.frames() < 2) return misfit;
  for (int g = 0; g < task.frames(); ++g) {
    const Picture& micrograph = task.picture(g);
    if (task.observable(g).quantity != Quantity::intensity) continue;  // no lamp in it
    const Pixels& pixels = frames[static_cast<std::size_t>(g)].pixels;
    double sum = 0;
    for (const auto& [x, y] : pixels) sum += micrograph.values(x, y);
    Misfit& own = misfit[static_cast<std::size_t>(g)];
    own.mean_sd = std::hypot(own.mean_sd, kLampJitter * sum / static_cast<double>(pixels.size()));
    own.mean_follows_shape = false;
  }
  return misfit;
}

std::unique_ptr<LeastSquares> problem_of(const Task& task, const Frames& frames, const std::vector<Misfit>& misfit) {
  std::vector<PixelSet> sets;
  std::vector<RenderPlan> plans;
  for (int g = 0; g < task.frames(); ++g) {
    const Frame& frame = frames[static_cast<std::size_t>(g)];
    sets.push_back(pixel_set(task.picture(g), frame.sigma, frame.pixels));
    sets.back().shared_sd = frame.rounding_sd;
    plans.push_back(frame.plan);
  }
  auto problem = std::make_unique<LeastSquares>(task, std::move(plans), std::move(sets));
  problem->set_misfit(misfit);
  return problem;
}

Image fitted_image(const Task& task, const Frames& frames, int frame, const Theta& theta) {
  const Picture& micrograph = task.picture(frame);
  const RenderPlan& plan = frames[static_cast<std::size_t>(frame)].plan;
  return lit(micrograph, theta, render(micrograph.scene, plan, theta, {}, task.job.options.threads).intensity);
}

Frames replanned(const Task& task, Frames frames, const Theta& theta) {
  for (int g = 0; g < task.frames(); ++g) frames[static_cast<std::size_t>(g)].plan = task.planned(g, theta);
  return frames;
}

}  // namespace birefit::estimation
