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

/// d(intensity)/d(size of a pixel), which is no parameter: by differences.
Eigen::VectorXd intensity_by_pixel_size(const Task& task, const Optimum& optimum, double pixel_um) {
  constexpr double kStep = 1e-4;
  Eigen::VectorXd by(optimum.problem->pixel_rows());
  Eigen::Index row = 0;
  for (int g = 0; g < task.frames(); ++g) {
    const Frame& frame = optimum.frames[static_cast<std::size_t>(g)];
    std::array<Image, 2> images;
    for (const std::size_t side : {0, 1}) {
      Scene scene = task.picture(g).scene;
      scene.view.pixel_size_um *= 1 + (side ? kStep : -kStep);
      images[side] = render(scene, frame.plan, optimum.theta, {}, task.job.options.threads).intensity;
    }
    for (const auto& [x, y] : frame.pixels) by[row++] = (images[1](x, y) - images[0](x, y)) / (2 * kStep * pixel_um);
  }
  return by;
}

/// The optimum's own picture as the measurement, and an input that is not what it was made with: what a fit makes of
/// that, by a part of the pixels. The first order does not tell it where the picture turns by a good part of a fringe,
/// or where light ends at an edge that lies between pixels: two of its derivatives at one place are as far from it as
/// they like.
class ChangedInput {
 public:
  ChangedInput(const Task& task, const Optimum& optimum, const std::function<void(FitJob&)>& change)
      : optimum_(optimum), job_(changed(task.job, change)), task_(job_) {
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
  static FitJob changed(FitJob job, const std::function<void(FitJob&)>& change) {
    change(job);
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
  const auto add = [&](const std::string& name, const std::string& unit, double value, const Eigen::VectorXd& by,
                       const std::function<void(FitJob&, double)>& change) {
    InputEffect effect{name, unit, value, unit == "deg" || unit == "px" ? 1.0 : 0.01 * std::abs(value), {}};
    Eigen::VectorXd shift = optimum.problem->shift_by(effect.step * by, of_noise.covariance);
    const Eigen::ArrayXd sd = of_noise.covariance.diagonal().array().cwiseMax(0).sqrt();
    constexpr double kOfNote = 0.5;  // standard errors: what is less is not named
    const bool of_note = (shift.array().abs() > kOfNote * sd).head(optimum.searched.size()).any();
    const bool determined =
        std::none_of(of_noise.undetermined.begin(), of_noise.undetermined.end(), [](bool u) { return u; });
    if (shift.allFinite() && of_note && determined && effect.step > 0)
      shift = ChangedInput(task, optimum, [&](FitJob& job) { change(job, effect.step); }).shift(task, shift);
    if (shift.allFinite()) effect.shift.assign(shift.begin(), shift.end());
    if (effect.step > 0 && !effect.shift.empty()) effects.push_back(std::move(effect));
  };
  const std::vector<int> inputs = shared_inputs(task);
  const Eigen::MatrixXd columns = optimum.problem->intensity_by(inputs);
  for (std::size_t k = 0; k < inputs.size(); ++k) {
    const Parameter& p = task.job.parameters[inputs[k]];
    add(p.name, p.unit, optimum.theta[static_cast<std::size_t>(inputs[k])], columns.col(static_cast<Eigen::Index>(k)),
        [&, index = inputs[k]](FitJob& job, double step) {
          job.parameters[index].value = optimum.theta[static_cast<std::size_t>(index)] + step;
        });
  }
  const double pixel_um = task.picture(0).scene.view.pixel_size_um;
  const bool shared = std::all_of(task.sights.begin(), task.sights.end(), [&](const Sight& sight) {
    return sight.picture->scene.view.pixel_size_um == pixel_um;
  });
  if (pixel_um > 0 && shared)
    add("micrograph.pixel_size_um", "um", pixel_um, intensity_by_pixel_size(task, optimum, pixel_um),
        [](FitJob& job, double step) {
          for_each_scene(job.measurements, [&](Scene& scene) { scene.view.pixel_size_um += step; });
        });
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
