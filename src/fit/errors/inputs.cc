// What the fit takes as exact, and what the estimates owe to it.

#include <algorithm>
#include <cmath>

#include "fit/errors/changed_input.h"
#include "fit/errors/report.h"

namespace birefit::estimation {
namespace {

/// Numbers that all micrographs read and that are taken as exact.
std::vector<int> shared_inputs(const Task& task) {
  std::vector<int> inputs = known_to_all_frames(task);
  std::erase_if(inputs, [&](int index) {
    const Parameter& p = task.job.parameters[index];
    const bool of_a_vector = p.name.find(".axis.") != std::string::npos;  // no quantity by itself
    return of_a_vector || p.known_to.of(p.value) > 0;
  });
  return inputs;
}

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
    InputEffect effect{p.name, p.unit, value, step_of(p.unit, value), 0, {}};
    if (!(effect.step > 0)) continue;
    Eigen::VectorXd shift =
        optimum.problem->shift_by(effect.step * columns.col(static_cast<Eigen::Index>(k)), of_noise.covariance);
    constexpr double kOfNote = 0.5;  // standard errors: what is less is not named
    const bool of_note = (shift.array().abs() > kOfNote * sd).head(optimum.searched.size()).any();
    if (shift.allFinite() && of_note && determined)
      shift = shift_by_input(task, optimum, inputs[k], value + effect.step, shift);
    if (!shift.allFinite()) continue;
    effect.shift.assign(shift.begin(), shift.end());
    effects.push_back(std::move(effect));
  }
  result.inputs.insert(result.inputs.end(), effects.begin(), effects.end());
}

void keep_inputs_of_note(const Task& task, FitResult& result) {
  const auto weight = [&](const InputEffect& effect) {
    double most = 0;
    for (std::size_t j = 0; j < task.unknowns.searched.size(); ++j)
      if (const double sd = result.parameters[j].stderr_; sd > 0) most = std::max(most, std::abs(effect.shift[j]) / sd);
    return most;
  };
  constexpr double kOfNote = 0.1;
  std::erase_if(result.inputs, [&](const InputEffect& effect) { return weight(effect) < kOfNote; });
  std::stable_sort(result.inputs.begin(), result.inputs.end(),
                   [&](const InputEffect& a, const InputEffect& b) { return weight(a) > weight(b); });
}

}  // namespace birefit::estimation
