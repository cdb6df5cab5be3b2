// What the fit takes as exact, and what the estimates owe to it.

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <set>

#include "fit/errors/report.h"
#include "medium/references.h"

namespace birefit::estimation {
namespace {

/// Known numbers that all micrographs read.
std::vector<int> shared_inputs(const Task& task) {
  std::map<int, int> readers;
  for (int g = 0; g < task.frames(); ++g) {
    std::set<int> read;
    for_each_ref(task.picture(g).scene, [&](const ParameterRef& ref) {
      if (!ref || task.job.parameters[ref].free) return;
      const bool of_a_vector =
          task.job.parameters[ref].name.find(".axis.") != std::string::npos;  // no quantity by itself
      if (!of_a_vector) read.insert(ref.index);
    });
    for (const int index : read) ++readers[index];
  }
  std::vector<int> inputs;
  for (const auto& [index, number] : readers)
    if (number == task.frames()) inputs.push_back(index);
  return inputs;
}

/// The optimum's own picture as the measurement, and an input that is not what it was made with: what a fit makes of
/// that, by a part of the pixels. The first order does not tell it where the picture turns by a good part of a fringe,
/// or where light ends at an edge that lies between pixels: two of its derivatives at one place are as far from it as
/// they like.
class ChangedInput {
 public:
  ChangedInput(const Task& task, const Optimum& optimum, int index, double value)
      : optimum_(optimum), job_(changed(task.job, index, value)), task_(job_) {
    std::vector<RenderPlan> plans;
    std::vector<PixelSet> sets;
    std::size_t all = 0;
    for (const Frame& frame : optimum.frames) all += frame.pixels.size();
    for (int g = 0; g < task.frames(); ++g) {
      const Frame& frame = optimum.frames[static_cast<std::size_t>(g)];
      const std::size_t share = std::max<std::size_t>(1, kPixels * frame.pixels.size() / std::max<std::size_t>(all, 1));
      const Image picture = fitted_image(task, optimum.frames, g, optimum.theta);
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

  static constexpr std::size_t kPixels = 4000;  // as of a scan
  const Optimum& optimum_;
  FitJob job_;
  Task task_;
  std::unique_ptr<LeastSquares> problem_;
};

}  // namespace

void weigh_inputs(const Task& task, const Optimum& optimum, const Inverse& of_noise, FitResult& result) {
  if (optimum.stopped || task.unknowns.searched.empty() || by_waves(optimum.frames)) return;
  std::vector<InputEffect> effects;
  const Eigen::ArrayXd sd = of_noise.covariance.diagonal().array().cwiseMax(0).sqrt();
  const bool determined =
      std::none_of(of_noise.undetermined.begin(), of_noise.undetermined.end(), [](bool u) { return u; });
  const std::vector<int> inputs = shared_inputs(task);
  const Eigen::MatrixXd columns = optimum.problem->intensity_by(inputs);
  for (std::size_t k = 0; k < inputs.size(); ++k) {
    const Parameter& p = task.job.parameters[inputs[k]];
    const double value = optimum.theta[static_cast<std::size_t>(inputs[k])];
    InputEffect effect{p.name, p.unit, value, p.unit == "deg" || p.unit == "px" ? 1.0 : 0.01 * std::abs(value), {}};
    if (!(effect.step > 0)) continue;
    Eigen::VectorXd shift =
        optimum.problem->shift_by(effect.step * columns.col(static_cast<Eigen::Index>(k)), of_noise.covariance);
    constexpr double kOfNote = 0.5;  // standard errors: what is less is not named
    const bool of_note = (shift.array().abs() > kOfNote * sd).head(optimum.searched.size()).any();
    if (shift.allFinite() && of_note && determined)
      shift = ChangedInput(task, optimum, inputs[k], value + effect.step).shift(task, shift);
    if (!shift.allFinite()) continue;
    effect.shift.assign(shift.begin(), shift.end());
    effects.push_back(std::move(effect));
  }
  const auto weight = [&](const InputEffect& effect) {
    double most = 0;
    for (std::size_t j = 0; j < task.unknowns.searched.size(); ++j)
      if (const double sd = result.parameters[j].stderr_; sd > 0) most = std::max(most, std::abs(effect.shift[j]) / sd);
    return most;
  };
  constexpr double kOfNote = 0.1;
  std::erase_if(effects, [&](const InputEffect& effect) { return weight(effect) < kOfNote; });
  std::stable_sort(effects.begin(), effects.end(),
                   [&](const InputEffect& a, const InputEffect& b) { return weight(a) > weight(b); });
  result.inputs = std::move(effects);
}

}  // namespace birefit::estimation
