// What a result says of the numbers that were stated, and of a misfit that is left.

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "fit/errors/changed_input.h"
#include "fit/errors/report.h"
#include "fit/errors/verdict.h"

namespace birefit::estimation {
namespace {

void add_effect(const Parameter& of, double value, double known_to, const Eigen::VectorXd& shift_per_unit,
                FitResult& result) {
  InputEffect effect{of.name, of.unit, value, step_of(of.unit, value), known_to, {}};
  const Eigen::VectorXd shift = effect.step * shift_per_unit;
  effect.shift.assign(shift.begin(), shift.end());
  if (effect.step > 0) result.inputs.push_back(std::move(effect));
}

/// The estimate of an unknown once nuisances have left; null of those.
const ParameterEstimate* estimate_at(const Task& task, const FitResult& result, int unknown) {
  const std::string& name = task.job.parameters[task.unknowns.table_index(unknown)].name;
  const auto found = std::find_if(result.parameters.begin(), result.parameters.end(),
                                  [&](const ParameterEstimate& p) { return p.name == name; });
  return found == result.parameters.end() ? nullptr : &*found;
}

}  // namespace

Eigen::MatrixXd stated_covariance(const Task& task, const Covariances& covariances) {
  const Eigen::Index all = task.unknowns.size();
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(all, all);
  const Eigen::MatrixXd& shift = covariances.stated.shift;
  if (shift.size() > 0) sum += shift * shift.transpose();
  // One lamp and one camera, like a number that is stated, are the same in other fits of the set-up.
  if (covariances.of_light.size() > 0) sum += covariances.of_light;
  for (std::size_t j = 0; j < task.unknowns.searched.size(); ++j) {
    if (!task.searched(j).nuisance) continue;
    // Another draw of what is stated would move the prior's mean, and the estimates by this for each of its deviations.
    const Eigen::VectorXd by_prior =
        covariances.of_noise.covariance.col(static_cast<Eigen::Index>(j)) / *task.searched(j).prior_sd;
    sum += by_prior * by_prior.transpose();
  }
  return sum;
}

void report_stated(const Task& task, const Optimum& optimum, const Covariances& covariances, FitResult& result) {
  const Stated& found = covariances.stated;
  const auto searched = static_cast<Eigen::Index>(task.unknowns.searched.size());
  const Eigen::Index all = task.unknowns.size();
  const Eigen::MatrixXd information = covariances.factor.transpose() * covariances.factor;
  std::vector<Eigen::Index> estimates;
  for (Eigen::Index j = 0; j < all; ++j)
    if (!task.job.parameters[task.unknowns.table_index(static_cast<int>(j))].nuisance) estimates.push_back(j);
  const Eigen::LDLT<Eigen::MatrixXd> own(Eigen::MatrixXd(information(estimates, estimates)));
  for (Eigen::Index j = 0; j < searched; ++j) {
    const Parameter& parameter = task.searched(static_cast<std::size_t>(j));
    if (!parameter.nuisance) continue;
    const ParameterEstimate& estimate = result.parameters[static_cast<std::size_t>(j)];
    // Were it otherwise and all that is stated beside it as it is.
    if (estimates.size() > 0) {
      Eigen::VectorXd shift = Eigen::VectorXd::Zero(all);
      shift(estimates) = -own.solve(Eigen::VectorXd(information(estimates, j)));
      add_effect(parameter, estimate.value, *parameter.prior_sd, shift, result);
    }
    result.stated.push_back({.name = parameter.name,
                             .unit = parameter.unit,
                             .stated = parameter.value,
                             .known_to = *parameter.prior_sd,
                             .fitted = true,
                             .value = estimate.value,
                             .stderr_ = estimate.stderr_,
                             .most_of = {},
                             .share = 0});
  }
  std::vector<StatedNumber> others;
  for (Eigen::Index i = 0; i < found.sd.size(); ++i) {
    const int index = found.index[static_cast<std::size_t>(i)];
    StatedNumber number{.name = task.job.parameters[index].name,
                        .unit = task.job.parameters[index].unit,
                        .stated = optimum.theta[static_cast<std::size_t>(index)],
                        .known_to = found.sd[i],
                        .fitted = false,
                        .value = 0,
                        .stderr_ = 0,
                        .most_of = {},
                        .share = 0};
    add_effect(task.job.parameters[index], number.stated, found.sd[i], found.shift.col(i) / found.sd[i], result);
    for (Eigen::Index j = 0; j < searched; ++j) {
      const double variance = result.covariance(j, j), share = std::pow(found.shift(j, i), 2) / variance;
      if (task.searched(static_cast<std::size_t>(j)).nuisance || !(share > number.share)) continue;
      number.share = share;
      number.most_of = task.searched(static_cast<std::size_t>(j)).name;
    }
    others.push_back(std::move(number));
  }
  std::stable_sort(others.begin(), others.end(),
                   [](const StatedNumber& a, const StatedNumber& b) { return a.share > b.share; });
  result.stated.insert(result.stated.end(), others.begin(), others.end());
}

void leave_nuisances(const Task& task, FitResult& result) {
  std::vector<int> kept;
  for (int j = 0; j < task.unknowns.size(); ++j)
    if (!task.job.parameters[task.unknowns.table_index(j)].nuisance) kept.push_back(j);
  if (static_cast<int>(kept.size()) == task.unknowns.size()) return;
  const auto keep = [&](auto& list) {
    if (list.size() != static_cast<std::size_t>(task.unknowns.size())) return;
    std::remove_reference_t<decltype(list)> left;
    for (const int j : kept) left.push_back(std::move(list[static_cast<std::size_t>(j)]));
    list = std::move(left);
  };
  const std::vector<std::string> all = result.names;
  const auto is_kept = [&](const std::string& name) {
    return std::any_of(kept.begin(), kept.end(), [&](int j) { return all[static_cast<std::size_t>(j)] == name; });
  };
  keep(result.parameters);
  keep(result.names);
  result.covariance = Eigen::MatrixXd(result.covariance(kept, kept));
  result.correlation = Eigen::MatrixXd(result.correlation(kept, kept));
  result.stated_covariance = Eigen::MatrixXd(result.stated_covariance(kept, kept));
  for (InputEffect& input : result.inputs) keep(input.shift);
  for (DerivedEstimate& derived : result.derived)
    if (derived.by.size() == task.unknowns.size()) derived.by = Eigen::VectorXd(derived.by(kept));
  std::vector<int> searched;
  for (const int j : kept)
    if (j < static_cast<int>(task.unknowns.searched.size())) searched.push_back(j);
  for (Strip& strip : result.strips)
    for (std::vector<double>* list : {&strip.value, &strip.stderr_}) {
      std::vector<double> left;
      for (const int j : searched)
        if (static_cast<std::size_t>(j) < list->size()) left.push_back((*list)[static_cast<std::size_t>(j)]);
      *list = std::move(left);
    }
  for (FisherDirection& direction : result.directions)
    std::erase_if(direction.weights, [&](const auto& weight) { return !is_kept(weight.first); });
}

void judge_misfit(const Task& task, const Optimum& optimum, const Covariances& covariances, FitResult& result) {
  result.misfit = task.job.misfit;
  for (const StatedNumber& number : result.stated)
    if (std::abs(number.away()) > kContradicted)
      result.misfit.push_back(fmt::format(
          "{} is fitted as {}{}, {:.2g} times what it was thought to be known to away from the {:.6g} that are stated",
          number.name, with_error(number.value, number.stderr_), number.unit.empty() ? "" : " " + number.unit,
          std::abs(number.away()), number.stated));
  for (const Departure& d : result.departures)
    if (std::abs(d.value) > kContradicted * d.usual && std::abs(d.value) > kContradicted * d.stderr_)
      result.misfit.push_back(fmt::format("the picture looks like one with {} {:.2g}{}, {:.2g} times what is usual",
                                          d.words, d.value, d.unit.empty() ? "" : " " + d.unit,
                                          std::abs(d.value) / d.usual));
  // A noise that is estimated a tenth too small is no misfit of the model, nor is a discrepancy that errors hardly
  // feel.
  constexpr double kOfNote = 1.2, kOfVariance = 0.2;
  bool felt = false;
  for (Eigen::Index j = 0; covariances.discrepancy() && j < optimum.searched.size(); ++j)
    if (const auto at = estimate_at(task, result, static_cast<int>(j)); at && at->unit != "px")
      felt = felt || std::pow(covariances.by_discrepancy[j], 2) - covariances.of_noise.covariance(j, j) >
                         kOfVariance * std::pow(at->stderr_, 2);
  const MisfitFound& found = optimum.misfit;
  if (felt || ((found.beyond_noise || found.frames_scatter) && result.reduced_chi_square > kOfNote))
    result.misfit.push_back("the model leaves over what noise does not explain");
  for (const MicrographResult& m : result.micrographs)
    if (m.outliers > 0) {
      result.misfit.push_back("pixels were left out because they stood out of the residual");
      break;
    }
}

}  // namespace birefit::estimation

namespace birefit {

std::string FitResult::grade() const {
  if (!converged || interrupted) return "not converged";
  if (!described) return "not described";
  if (ambiguous) return "ambiguous";
  if (!identifiable) return "not identifiable";
  if (pinned) return "at a bound";
  return misfit.empty() ? "answer" : "answer with misfit";
}

}  // namespace birefit
