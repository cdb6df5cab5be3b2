#include "fit/errors/left_out.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include "fit/errors/discrepancy.h"
#include "fit/problem/light.h"
#include "samples/kind.h"
#include "samples/waves/wave.h"

namespace birefit::estimation {
namespace {

struct Shift {
  int index = 0;  ///< in the table
  double change = 0, standard_errors = 0;
};

/// Of the parameters searched for but the centre, the one that another model moves most, in the standard errors `sd`.
Shift largest_shift(const Task& task, const Eigen::VectorXd& shift, const Eigen::VectorXd& sd) {
  Shift most{task.unknowns.searched.front()};
  for (int j = 0; j < std::ssize(task.unknowns.searched); ++j) {
    const int index = task.unknowns.table_index(j);
    if (task.job.parameters[index].name.find("center_px") != std::string::npos || !(sd[j] > 0)) continue;
    if (std::abs(shift[j]) > most.standard_errors * sd[j]) most = {index, shift[j], std::abs(shift[j]) / sd[j]};
  }
  return most;
}

Eigen::VectorXd change_of_unknowns(const Task& task, const Theta& from, const Theta& to) {
  Eigen::VectorXd change(task.unknowns.size());
  for (int j = 0; j < task.unknowns.size(); ++j) {
    const auto index = static_cast<std::size_t>(task.unknowns.table_index(j));
    change[j] = to[index] - from[index];
  }
  return change;
}

/// A short fit of other pictures, or by other plans, from where the optimum is.
SolveOptions few_steps(const Task& task, int steps) {
  SolveOptions few;
  few.max_iterations = steps;
  few.least_gain = 1e-3;  // a thirtieth of a standard error
  few.interrupted = task.job.options.interrupted;
  return few;
}

/// Fits the optimum's model to other values of its pixels: the change of all unknowns, and what the fit misses of the
/// values, RMS over the range of the model's light, of the picture that it misses most of.
struct OtherValues {
  Eigen::VectorXd change;
  double missed = 0;
};
OtherValues change_by_values(const Task& task, const Optimum& optimum, const std::vector<Image>& values, int steps) {
  std::vector<PixelSet> sets;
  std::vector<RenderPlan> plans;
  for (int g = 0; g < task.frames(); ++g) {
    const Frame& frame = optimum.frames[static_cast<std::size_t>(g)];
    const Image& image = values[static_cast<std::size_t>(g)];
    PixelSet set = pixel_set(task.picture(g), frame.sigma, frame.pixels);
    for (std::size_t i = 0; i < set.pixels.size(); ++i)
      set.value[static_cast<Eigen::Index>(i)] = image(set.pixels[i][0], set.pixels[i][1]);
    sets.push_back(std::move(set));
    plans.push_back(frame.plan);
  }
  LeastSquares problem(task, std::move(plans), std::move(sets));
  problem.set_misfit(optimum.problem->misfit());
  Eigen::VectorXd searched = optimum.searched;
  problem.solve(searched, few_steps(task, steps));
  OtherValues other{change_of_unknowns(task, optimum.theta, problem.theta())};
  for (int g = 0; g < task.frames(); ++g) {
    const Eigen::ArrayXd residual = problem.noise_whitened_residual(g).array() * problem.pixels(g).sigma.array();
    const auto [low, high] = problem.intensity_range(g);
    const double range = std::abs(task.gain_of(g, problem.theta())) * (high - low);
    other.missed = std::max(other.missed, std::sqrt(residual.square().mean()) / std::max(range, 1e-300));
  }
  return other;
}

/// The same sensitivity under a lamp that differs as daylight of 6500 K does from a filament: redder by so much for
/// every um.
std::shared_ptr<const SpectralTable> tilted(const SpectralTable& table) {
  constexpr double kPerUm = 9;
  auto other = std::make_shared<SpectralTable>(table);
  for (std::size_t i = 0; i < other->value.size(); ++i)
    other->value[i] *= std::exp(kPerUm * (other->wavelength_um[i] - other->wavelength_um.front()));
  return other;
}

/// The same pixels fitted by straight and by curved rays from where the straight ones' optimum is. `roughly`: only as
/// far as it takes to see that curved rays are no description.
struct CurvedRays {
  Eigen::VectorXd change;  ///< of all unknowns, from straight rays to curved ones
  double ratio = 0;        ///< of the objective by curved rays to that by straight ones
  double worse = 0;        ///< by so much, all pixels counted
  double part = 1;         ///< of the pixels that were fitted
};
CurvedRays compared(const Task& task, const Task& curved_task, const Optimum& optimum, std::size_t most_pixels,
                    bool roughly) {
  std::vector<RenderPlan> plans, straight_plans;
  std::vector<PixelSet> sets;
  // Of large images a part tells it, fitted both ways: what its noise does to a fit, it does to both.
  std::size_t all = 0, used = 0;
  for (const Frame& frame : optimum.frames) all += frame.pixels.size();
  const bool part = all > most_pixels;
  for (int g = 0; g < task.frames(); ++g) {
    const Frame& frame = optimum.frames[static_cast<std::size_t>(g)];
    plans.push_back(curved_task.planned(g, optimum.theta));
    straight_plans.push_back(frame.plan);
    const Pixels pixels =
        part ? subsample(frame.pixels, std::max<std::size_t>(50, most_pixels * frame.pixels.size() / all))
             : frame.pixels;
    used += pixels.size();
    sets.push_back(pixel_set(task.picture(g), frame.sigma, pixels));
  }
  // Few steps come close to a minimum that is there: what is ten times worse after these is not on its way to one.
  constexpr int kSteps = 12, kFirstSteps = 2;
  constexpr double kHopeless = 10, kRoughly = 1e-3;
  SolveOptions few = few_steps(task, kSteps);
  double straight_objective = optimum.problem->objective();
  // At best to a tenth of a chi-square unit, a third of a standard error: integrated rays leave kinks, which a search
  // for more would follow.
  few.function_tolerance = std::max(0.1 / std::max(straight_objective, 1.0), roughly ? kRoughly : 0);
  Theta straight = optimum.theta;
  if (part) {
    LeastSquares problem(task, std::move(straight_plans), sets);
    problem.set_misfit(optimum.problem->misfit());
    Eigen::VectorXd searched = optimum.searched;
    problem.solve(searched, few);
    straight_objective = problem.objective();
    straight = problem.theta();
  }
  LeastSquares problem(curved_task, std::move(plans), std::move(sets));
  problem.set_misfit(optimum.problem->misfit());
  Eigen::VectorXd searched = optimum.searched;
  if (roughly) few.max_iterations = kFirstSteps;
  problem.solve(searched, few);
  if (roughly && problem.objective() < kHopeless * straight_objective) {
    few.max_iterations = kSteps - kFirstSteps;
    problem.solve(searched, few);
  }
  return {change_of_unknowns(task, straight, problem.theta()), problem.objective() / straight_objective,
          (problem.objective() - straight_objective) * static_cast<double>(all) / static_cast<double>(used),
          static_cast<double>(used) / static_cast<double>(all)};
}

/// Standard deviation of `worse`, for the pixels that were left out: a sum over pixels of d^2 + 2 d noise, d what the
/// rays differ by, is worse by `least` and more.
double uncertainty_of_worse(const CurvedRays& rays, double least, double reduced) {
  return 2 * std::sqrt(std::max(std::abs(rays.worse), least) * reduced * (1 / rays.part - 1));
}
constexpr double kClear = 3;

/// Whether a part of the pixels says all there is to say of curved rays: all of them could not make chi-square, which
/// is worse by so much, cross `most`, nor the shift a standard error.
bool is_plain(const CurvedRays& rays, double shift, double most, double reduced) {
  constexpr double kFarBelow = 0.5, kFarAbove = 2;
  const double sd = uncertainty_of_worse(rays, most, reduced);
  if (rays.worse - kClear * sd > most || shift < kFarBelow) return true;
  return rays.worse + kClear * sd < most && shift > kFarAbove;
}

}  // namespace

void measure_propagation(const Task& task, const Optimum& optimum, LeftOut& left_out) {
  left_out.propagation.resize(task.unknowns.size(), 0);
  if (optimum.stopped || !by_waves(optimum.frames)) return;
  std::vector<std::vector<Image>> pictures;  // of each frame, each scene of its twin
  for (int g = 0; g < task.frames(); ++g) {
    const Picture& m = task.picture(g);
    const std::optional<RadialTwin> twin = radial_twin(m.scene, optimum.theta);
    if (!twin) return;
    try {
      pictures.emplace_back();
      for (std::size_t i = 0; i < twin->scenes.size(); ++i) {
        const Scene& scene = twin->scenes[i];
        const RenderPlan chosen = plan(scene, RadialTwin::demand(i, task.job.demand), twin->theta);
        pictures.back().push_back(
            lit(m, optimum.theta, render(scene, chosen, twin->theta, {}, task.job.options.threads).intensity));
      }
    } catch (const UserError& error) {  // too large for the series
      left_out.warnings.push_back(std::string("What wave propagation errs by could not be measured on a ball of this "
                                              "size; the error bars do not contain it. ") +
                                  error.what());
      return;
    }
  }
  const auto causes = std::max_element(pictures.begin(), pictures.end(),
                                       [](const auto& a, const auto& b) { return a.size() < b.size(); })
                          ->size() -
                      1;
  for (std::size_t cause = 0; cause < causes; ++cause) {
    std::vector<Image> values;
    for (int g = 0; g < task.frames(); ++g) {
      const std::vector<Image>& seen = pictures[static_cast<std::size_t>(g)];
      values.push_back(fitted_image(task, optimum.frames, g, optimum.theta));
      Image& image = values.back();
      if (cause + 1 < seen.size())
        for (const auto& [x, y] : optimum.frames[static_cast<std::size_t>(g)].pixels)
          image(x, y) = image(x, y) + (seen[cause](x, y) - seen[cause + 1](x, y));
    }
    constexpr int kNextToLinear = 2;
    left_out.propagation.conservativeResize(Eigen::NoChange, left_out.propagation.cols() + 1);
    left_out.propagation.rightCols(1) = change_by_values(task, optimum, values, kNextToLinear).change;
  }
}

void foretell_curved_rays(const Task& task, const Optimum& optimum, const Eigen::VectorXd& sd, LeftOut& left_out) {
  const auto has_curved = [](const Sight& sight) { return has_curved_rays(sight.picture->scene); };
  const Demand& demand = task.job.demand;
  if (optimum.stopped || demand.rays != Rays::straight || demand.ceiling == Ceiling::wave ||
      task.unknowns.searched.empty() || !std::all_of(task.sights.begin(), task.sights.end(), has_curved))
    return;
  FitJob curved = task.job;
  curved.demand.rays = Rays::eikonal;
  const Task curved_task(curved);
  const double reduced = std::max(1.0, optimum.reduced_chi_square(task));
  // Few pixels, fitted roughly, tell that curved rays do not describe the image; some, of most images, what they
  // change; where that is near a limit it takes all of them.
  constexpr double kWorse = 9, kTimesWorse = 1.1;
  constexpr std::size_t kFewPixels = 1 << 12, kSomePixels = 1 << 14, kPixels = 1 << 17;
  std::size_t all = 0;
  for (const Frame& frame : optimum.frames) all += frame.pixels.size();
  const auto fitted_to = [&](std::size_t pixels, bool roughly) {
    return compared(task, curved_task, optimum, pixels, roughly);
  };
  if (all > 2 * kFewPixels) {
    const CurvedRays few = fitted_to(kFewPixels, true);
    if (few.ratio > kTimesWorse && few.worse - kClear * uncertainty_of_worse(few, 0, reduced) > kWorse * reduced)
      return;
  }
  const bool many = all > 2 * kSomePixels;
  CurvedRays rays = fitted_to(many ? kSomePixels : kPixels, false);
  Shift shift = largest_shift(task, rays.change, sd);
  if (many && !is_plain(rays, shift.standard_errors, kWorse * reduced, reduced)) {
    rays = fitted_to(kPixels, false);
    shift = largest_shift(task, rays.change, sd);
  }
  left_out.change_by_curved_rays = rays.worse < kWorse * reduced ? shift.standard_errors : 0;
  if (left_out.change_by_curved_rays < 1) return;
  const double value = optimum.theta[static_cast<std::size_t>(shift.index)];
  left_out.warnings.push_back(
      fmt::format("Rays are taken as straight. Curved ones (physics.rays: eikonal or auto) would put {} at {:.4g} "
                  "({:+.2g} %, {:.3g} standard errors), with a chi-square {:.3g} times this one. "
                  "The error bars contain this as the error of the model.",
                  task.job.parameters[shift.index].name, value + shift.change, 100 * shift.change / value,
                  left_out.change_by_curved_rays, rays.ratio));
  left_out.by_curved_rays = rays.change;
}

void foretell_waves(const Task& task, const Optimum& optimum, const Eigen::VectorXd& sd, LeftOut& left_out) {
  const auto has_waves = [](const Sight& sight) {
    const Scene& scene = sight.picture->scene;
    return traits_of(scene).sphere_diameter_um && scene.microscope.objective_na;
  };
  const FitJob& job = task.job;
  if (optimum.stopped || job.demand.ceiling != Ceiling::one_way || task.unknowns.searched.empty() ||
      !std::all_of(task.sights.begin(), task.sights.end(), has_waves))
    return;
  constexpr double kMostSeconds = 10;  // for a warning
  const Demand by_waves{.ceiling = Ceiling::wave, .intensity_accuracy = job.demand.intensity_accuracy};
  std::vector<Image> values;
  for (int g = 0; g < task.frames(); ++g) {
    const Picture& micrograph = task.picture(g);
    const Scene& scene = micrograph.scene;
    const WaveChoice choice = wave_choice(scene, by_waves, optimum.theta);
    if (choice.seconds_an_image > (job.options.choose_waves ? job.options.max_seconds : kMostSeconds)) return;
    values.push_back(
        lit(micrograph, optimum.theta,
            render(scene, plan(scene, by_waves, optimum.theta), optimum.theta, {}, job.options.threads).intensity));
  }
  const Eigen::VectorXd change = change_by_values(task, optimum, values, 12).change;
  const Shift shift = largest_shift(task, change, sd);
  left_out.change_by_waves = shift.standard_errors;
  if (left_out.change_by_waves < kShiftThatMatters) return;
  left_out.warnings.push_back(
      fmt::format("Rays are not the image of this sample: fitted to a wave-optical image of the parameters found here, "
                  "rays return {} off by {:+.2g} ({:+.2g} %, "
                  "{:.3g} standard errors). The error bars contain this as the error of the model; physics.ceiling: "
                  "wave does away with it.",
                  job.parameters[shift.index].name, shift.change,
                  100 * shift.change / optimum.theta[static_cast<std::size_t>(shift.index)], left_out.change_by_waves));
  left_out.by_waves = change;
}

void foretell_light(const Task& task, const Optimum& optimum, LeftOut& left_out) {
  const auto in_white_light = [](const Sight& sight) {
    const auto& light = sight.picture->scene.microscope.channel_light;
    return light && light->sensitivity;
  };
  if (optimum.stopped || task.unknowns.searched.empty() || !optimum.misfit.beyond_noise || by_waves(optimum.frames) ||
      !std::all_of(task.sights.begin(), task.sights.end(), in_white_light))
    return;
  std::vector<Image> values;
  double missed = 0;
  for (int g = 0; g < task.frames(); ++g) {
    Scene scene = task.picture(g).scene;
    ChannelLight& light = *scene.microscope.channel_light;
    light.sensitivity = tilted(*light.sensitivity);
    for (Crosstalk& other : scene.microscope.crosstalk) other.sensitivity = tilted(*other.sensitivity);
    const RenderPlan chosen = plan(scene, task.job.demand, optimum.theta);
    values.push_back(lit(task.picture(g), optimum.theta,
                         render(scene, chosen, optimum.theta, {}, task.job.options.threads).intensity));
    missed = std::max(missed, missed_of_contrast(task, optimum, g));
  }
  const OtherValues other = change_by_values(task, optimum, values, 12);
  // As in "Nearly the model": by what is left over, times 1.5.
  constexpr double kFactor = 1.5;
  if (other.missed > 0 && other.change.allFinite())
    left_out.by_light = kFactor * std::min(1.0, missed / other.missed) * other.change;
}

}  // namespace birefit::estimation
