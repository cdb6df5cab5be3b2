// What of a table follows from the rest of it.

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>
#include <utility>

#include "birefit/expression.h"
#include "birefit/parameters.h"

namespace birefit {
namespace {

std::vector<double> operands(const Tie& tie, const Theta& theta) {
  std::vector<double> numbers;
  for (const int index : tie.of) numbers.push_back(theta.at(static_cast<std::size_t>(index)));
  return numbers;
}

}  // namespace

void ParameterTable::tie(int index, Tie tie) {
  const bool itself = std::find(tie.of.begin(), tie.of.end(), index) != tie.of.end();
  if (itself || tie_at_.contains(index) || tie.of.size() != tie.law->names().size() || parameters_.at(index).free)
    throw std::logic_error("a tie that cannot be worked out in its turn");
  // Before what follows from it.
  const auto later = std::find_if(ties_.begin(), ties_.end(), [&](const auto& other) {
    return std::find(other.second.of.begin(), other.second.of.end(), index) != other.second.of.end();
  });
  for (const int of : tie.of)
    if (const auto at = tie_at_.find(of);
        at != tie_at_.end() && ties_.begin() + static_cast<std::ptrdiff_t>(at->second) >= later)
      throw std::logic_error("ties in a circle, or one before what it follows from");
  ties_.insert(later, {index, std::move(tie)});
  for (std::size_t k = 0; k < ties_.size(); ++k) tie_at_[ties_[k].first] = k;
}

std::vector<int> ParameterTable::tied() const {
  std::vector<int> all;
  for (const auto& [index, tie] : ties_) all.push_back(index);
  return all;
}

const Tie* ParameterTable::tie_of(int index) const {
  const auto found = tie_at_.find(index);
  return found == tie_at_.end() ? nullptr : &ties_[found->second].second;
}

double ParameterTable::value_of(const Tie& tie, const Theta& theta) const {
  return tie.law->value(operands(tie, theta));
}

void ParameterTable::follow(Theta& theta) const {
  for (const auto& [index, tie] : ties_) {
    const Parameter& parameter = parameters_[static_cast<std::size_t>(index)];
    const double value = value_of(tie, theta);
    theta[static_cast<std::size_t>(index)] =
        std::isfinite(value) ? std::clamp(value, parameter.lower, parameter.upper) : parameter.value;
  }
}

bool ParameterTable::is_held(int index, const Theta& theta) const {
  const Tie* tie = tie_of(index);
  if (!tie) return false;
  const Parameter& parameter = parameters_[static_cast<std::size_t>(index)];
  const double value = value_of(*tie, theta);
  return !std::isfinite(value) || value < parameter.lower || value > parameter.upper;
}

std::vector<TieSlope> ParameterTable::slopes(int index, const Theta& theta) const {
  const Tie* tie = tie_of(index);
  if (!tie) return {{index, 1}};
  if (is_held(index, theta)) return {};
  return slopes(*tie, theta);
}

std::vector<TieSlope> ParameterTable::slopes(const Tie& tie, const Theta& theta) const {
  std::vector<double> own;
  tie.law->value(operands(tie, theta), own);
  std::map<int, double> sum;
  for (std::size_t k = 0; k < tie.of.size(); ++k)
    for (const TieSlope& slope : slopes(tie.of[k], theta))
      if (const double by = own[k] * slope.by; by != 0) sum[slope.index] += by;
  std::vector<TieSlope> all;
  for (const auto& [index, by] : sum) all.push_back({index, by});
  return all;
}

std::vector<int> ParameterTable::roots(int index) const {
  const Tie* tie = tie_of(index);
  if (!tie) return {index};
  std::set<int> all;
  for (const int of : tie->of)
    for (const int root : roots(of)) all.insert(root);
  return {all.begin(), all.end()};
}

std::pair<double, double> ParameterTable::reach(int index) const {
  constexpr std::size_t kMostCorners = 10;  // of two to that power
  std::vector<int> moving;
  for (const int root : roots(index))
    if (const Parameter& p = parameters_[static_cast<std::size_t>(root)];
        p.free && std::isfinite(p.lower) && std::isfinite(p.upper) && moving.size() < kMostCorners)
      moving.push_back(root);
  Theta theta = values();
  std::pair<double, double> reach{theta[static_cast<std::size_t>(index)], theta[static_cast<std::size_t>(index)]};
  for (std::size_t corner = 0; corner < (std::size_t{1} << moving.size()); ++corner) {
    for (std::size_t k = 0; k < moving.size(); ++k) {
      const Parameter& p = parameters_[static_cast<std::size_t>(moving[k])];
      theta[static_cast<std::size_t>(moving[k])] = corner >> k & 1 ? p.upper : p.lower;
    }
    follow(theta);
    const double value = theta[static_cast<std::size_t>(index)];
    reach = {std::min(reach.first, value), std::max(reach.second, value)};
  }
  return reach;
}

}  // namespace birefit
