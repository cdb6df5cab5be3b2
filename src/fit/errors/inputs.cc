// What the fit takes as exact, and what the estimates owe to it.

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "fit/errors/report.h"
#include "medium/references.h"

namespace birefit::estimation {
namespace {

/// Known numbers that all micrographs read.
std::vector<int> shared_inputs(const Task& task) {
  std::map<int, int> readers;
  for (const Micrograph& m : task.job.micrographs) {
    std::set<int> read;
    for_each_ref(m.scene, [&](const ParameterRef& ref) {
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
      Scene scene = task.micrograph(g).scene;
      scene.view.pixel_size_um *= 1 + (side ? kStep : -kStep);
      images[side] = render(scene, frame.plan, optimum.theta, {}, task.job.options.threads).intensity;
    }
    for (const auto& [x, y] : frame.pixels) by[row++] = (images[1](x, y) - images[0](x, y)) / (2 * kStep * pixel_um);
  }
  return by;
}

}  // namespace

void weigh_inputs(const Task& task, const Optimum& optimum, const Inverse& of_noise, FitResult& result) {
  if (optimum.stopped || task.unknowns.searched.empty() || by_waves(optimum.frames)) return;
  std::vector<InputEffect> effects;
  const auto add = [&](const std::string& name, const std::string& unit, double value, const Eigen::VectorXd& by) {
    InputEffect effect{name, unit, value, unit == "deg" || unit == "px" ? 1.0 : 0.01 * std::abs(value), {}};
    const Eigen::VectorXd shift = optimum.problem->shift_by(effect.step * by, of_noise.covariance);
    if (shift.allFinite()) effect.shift.assign(shift.begin(), shift.end());
    if (effect.step > 0 && !effect.shift.empty()) effects.push_back(std::move(effect));
  };
  const std::vector<int> inputs = shared_inputs(task);
  const Eigen::MatrixXd columns = optimum.problem->intensity_by(inputs);
  for (std::size_t k = 0; k < inputs.size(); ++k) {
    const Parameter& p = task.job.parameters[inputs[k]];
    add(p.name, p.unit, optimum.theta[static_cast<std::size_t>(inputs[k])], columns.col(static_cast<Eigen::Index>(k)));
  }
  const double pixel_um = task.micrograph(0).scene.view.pixel_size_um;
  const std::vector<Micrograph>& micrographs = task.job.micrographs;
  const bool shared = std::all_of(micrographs.begin(), micrographs.end(),
                                  [&](const Micrograph& m) { return m.scene.view.pixel_size_um == pixel_um; });
  if (pixel_um > 0 && shared)
    add("micrograph.pixel_size_um", "um", pixel_um, intensity_by_pixel_size(task, optimum, pixel_um));
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
