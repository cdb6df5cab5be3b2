#include "fit/errors/changed_input.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

namespace birefit::estimation {
namespace {

/// The optimum's own picture as the measurement, and an input that is not what it was made with.
class ChangedInput {
 public:
  ChangedInput(const Task& task, const Optimum& optimum, int index, double value)
      : optimum_(optimum), job_(changed(task.job, index, value)), task_(job_) {
    std::vector<RenderPlan> plans;
    std::vector<PixelSet> sets;
    std::size_t all = 0;
    for (const Frame& frame : optimum.frames) all += frame.pixels.size();
    all_ = static_cast<double>(all);
    const Frames frames = as_rough_as_they_may_be(task, optimum);
    for (int g = 0; g < task.frames(); ++g) {
      const Frame& frame = frames[static_cast<std::size_t>(g)];
      const std::size_t most = has_own_rays(task, frame, g) ? kPixelsOfOwnRays : kPixels,
                        share = std::max<std::size_t>(1, most * frame.pixels.size() / std::max<std::size_t>(all, 1));
      const Image picture = fitted_image(task, frames, g, optimum.theta);
      PixelSet set = pixel_set(task.picture(g), frame.sigma, subsample(frame.pixels, share));
      for (std::size_t i = 0; i < set.pixels.size(); ++i)
        set.value[static_cast<Eigen::Index>(i)] = picture(set.pixels[i][0], set.pixels[i][1]);
      sets.push_back(std::move(set));
      plans.push_back(frame.plan);
    }
    problem_ = std::make_unique<LeastSquares>(task_, std::move(plans), std::move(sets));
    problem_->set_misfit(optimum.problem->misfit());
  }

  /// Solved for from where the first order leads.
  Eigen::VectorXd shift(const Task& task, const Eigen::VectorXd& linear) {
    Eigen::VectorXd searched = optimum_.searched + linear.head(optimum_.searched.size());
    for (Eigen::Index j = 0; j < searched.size(); ++j) {
      const Parameter& parameter = task.searched(static_cast<std::size_t>(j));
      searched[j] = std::clamp(searched[j], parameter.lower, parameter.upper);
    }
    SolveOptions few;
    few.max_iterations = 15;
    few.function_tolerance = 1e-6;
    few.least_gain = 1e-3 * static_cast<double>(problem_->pixel_rows()) / all_;  // a thirtieth of a standard error
    few.interrupted = task.job.options.interrupted;
    problem_->solve(searched, few);
    Eigen::VectorXd change(linear.size());
    for (int j = 0; j < task.unknowns.size(); ++j) {
      const auto at = static_cast<std::size_t>(task.unknowns.table_index(j));
      change[j] = problem_->theta()[at] - optimum_.theta[at];
    }
    return change;
  }

 private:
  static FitJob changed(FitJob job, int index, double value) {
    job.parameters[index].value = value;
    job.prior.reset();
    return job;
  }

  /// Both pictures, with the input and without, are made alike: what a plan is off by cancels.
  static Frames as_rough_as_they_may_be(const Task& task, const Optimum& optimum) {
    constexpr double kRough = 3e-3;
    Frames frames = optimum.frames;
    for (int g = 0; g < task.frames(); ++g) {
      Frame& frame = frames[static_cast<std::size_t>(g)];
      if (has_own_rays(task, frame, g)) frame.plan = task.planned(g, optimum.theta, kRough);
    }
    return frames;
  }

  // As of a scan. There is no noise in them that many would average.
  static constexpr std::size_t kPixels = 4000, kPixelsOfOwnRays = 600;
  const Optimum& optimum_;
  FitJob job_;
  Task task_;
  std::unique_ptr<LeastSquares> problem_;
  double all_ = 1;  ///< pixels of the fit
};

}  // namespace

double step_of(const std::string& unit, double value) {
  return unit == "deg" || unit == "px" ? 1.0 : 0.01 * std::abs(value);
}

Eigen::VectorXd shift_by_input(const Task& task, const Optimum& optimum, int index, double value,
                               const Eigen::VectorXd& linear) {
  return ChangedInput(task, optimum, index, value).shift(task, linear);
}

}  // namespace birefit::estimation
