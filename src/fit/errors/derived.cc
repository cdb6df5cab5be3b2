// Numbers that follow from others, with the errors that these have together.

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <random>
#include <utility>

#include "birefit/expression.h"
#include "fit/errors/report.h"
#include "fit/problem/shared_zeros.h"

namespace birefit::estimation {
namespace {

/// What a number owes to all that is not exact.
struct Owed {
  Eigen::VectorXd by;    ///< d(number)/d(unknown)
  double variance = 0;   ///< of the number
  double by_stated = 0;  ///< the part of it that is no estimate: by what is stated and not fitted
};

using ValueAt = std::function<double(const Theta&)>;

bool is_stated(const Stated& stated, int index) {
  return std::find(stated.index.begin(), stated.index.end(), index) != stated.index.end();
}

/// No unknown that it follows from is without an error, or a limit: a slope of 0 makes neither known.
bool all_known(const Task& task, const FitResult& result, const Tie& tie) {
  for (const int of : tie.of)
    for (const int root : task.job.parameters.roots(of)) {
      const int j = task.unknowns.of_entry(root);
      if (j < 0) continue;
      const ParameterEstimate& p = result.parameters[static_cast<std::size_t>(j)];
      if (!std::isfinite(p.stderr_) || !p.limit.empty()) return false;
    }
  return true;
}

/// To first order in the unknowns. What is stated moves these with it, as far as a fit went: a retardance is known far
/// better than the thickness that was stated, if the birefringence has made up for it.
Owed owed(const Task& task, const Covariances& covariances, const FitResult& result,
          const std::vector<TieSlope>& slopes, const ValueAt& value_at) {
  const Stated& stated = covariances.stated;
  Owed owed;
  owed.by = Eigen::VectorXd::Zero(task.unknowns.size());
  double alone = 0;  // what nothing fitted depends on
  for (const TieSlope& slope : slopes) {
    const int j = task.unknowns.of_entry(slope.index);
    if (j >= 0) owed.by[j] = slope.by;
    const Parameter& parameter = task.job.parameters[slope.index];
    if (j < 0 && !is_stated(stated, slope.index))
      alone += std::pow(slope.by * parameter.known_to.of(parameter.value), 2);
  }
  const double together = owed.by.dot(result.covariance * owed.by);
  double apart = 0, stated_variance = alone;
  const double value = value_at(result.theta);
  for (Eigen::Index i = 0; i < stated.sd.size() && stated.shift.size() > 0; ++i) {
    apart += std::pow(owed.by.dot(stated.shift.col(i)), 2);
    Theta otherwise = result.theta;
    otherwise[static_cast<std::size_t>(stated.index[static_cast<std::size_t>(i)])] += stated.sd[i];
    for (int j = 0; j < task.unknowns.size(); ++j)
      otherwise[static_cast<std::size_t>(task.unknowns.table_index(j))] += stated.shift(j, i);
    task.job.parameters.follow(otherwise);
    stated_variance += std::pow(value_at(otherwise) - value, 2);
  }
  owed.variance = std::max(0.0, together - apart) + stated_variance;
  owed.by_stated = stated_variance;
  return owed;
}

/// What a tie follows from and nothing fitted depends on, and how well it is known: entry, sd. A slope of 0 counts.
std::vector<std::pair<int, double>> known_alone(const Task& task, const Stated& stated, const Tie& tie) {
  std::map<int, double> alone;
  for (const int of : tie.of)
    for (const int root : task.job.parameters.roots(of)) {
      const Parameter& parameter = task.job.parameters[root];
      const bool elsewhere = task.unknowns.of_entry(root) >= 0 || is_stated(stated, root);
      if (const double sd = parameter.known_to.of(parameter.value); !elsewhere && sd > 0) alone[root] = sd;
    }
  return {alone.begin(), alone.end()};
}

/// What the numbers may as well be: draws from their normal distribution, for what is not straight over their errors
/// (at an extremum the first order is nothing at all).
class Draws {
 public:
  Draws(const Task& task, const Covariances& covariances, const FitResult& result)
      : task_(task), count_(task.job.parameters.tied().size() > kManyTies ? kFew : kMany) {
    const Stated& stated = covariances.stated;
    const bool shifts = stated.shift.size() > 0;
    Eigen::MatrixXd apart = result.covariance;
    if (shifts) apart -= stated.shift * stated.shift.transpose();
    // In units of each one's error: counts and indices beside each other would drown in rounding.
    const Eigen::VectorXd sd = result.covariance.diagonal().cwiseMax(1e-300).cwiseSqrt();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> of(sd.cwiseInverse().asDiagonal() * apart *
                                                            sd.cwiseInverse().asDiagonal());
    const Eigen::MatrixXd root =
        sd.asDiagonal() * of.eigenvectors() * of.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
    std::normal_distribution<double> normal;
    for (int k = 0; k < count_; ++k) {
      Theta theta = result.theta;
      Eigen::VectorXd z(task.unknowns.size());
      for (double& one : z) one = normal(random_);
      Eigen::VectorXd moved = root * z;
      for (Eigen::Index i = 0; i < stated.sd.size() && shifts; ++i) {
        const double by = normal(random_);
        theta[static_cast<std::size_t>(stated.index[static_cast<std::size_t>(i)])] += by * stated.sd[i];
        moved += by * stated.shift.col(i);
      }
      for (int j = 0; j < task.unknowns.size(); ++j) {
        const ParameterEstimate& p = result.parameters[static_cast<std::size_t>(j)];
        double& value = theta[static_cast<std::size_t>(task.unknowns.table_index(j))];
        value = std::clamp(value + moved[j], std::min(p.lower, value), std::max(p.upper, value));
      }
      task.job.parameters.follow(theta);
      thetas_.push_back(std::move(theta));
    }
  }
  std::size_t size() const { return thetas_.size(); }
  /// Deviations of a number from `value`, sorted, of draws that have one. `alone`: what nothing fitted depends on, and
  /// how well it is known.
  std::vector<double> deviations(const ValueAt& value_at, double value,
                                 const std::vector<std::pair<int, double>>& alone) {
    std::vector<double> all;
    std::normal_distribution<double> normal;
    for (const Theta& drawn : thetas_) {
      Theta theta = drawn;
      for (const auto& [index, sd] : alone) theta[static_cast<std::size_t>(index)] += sd * normal(random_);
      if (!alone.empty()) task_.job.parameters.follow(theta);
      if (const double by = value_at(theta) - value; std::isfinite(by)) all.push_back(by);
    }
    std::sort(all.begin(), all.end());
    return all;
  }

 private:
  static constexpr std::size_t kManyTies = 50;
  static constexpr int kMany = 4000, kFew = 1000;
  const Task& task_;
  const int count_;
  std::mt19937_64 random_{20231};
  std::vector<Theta> thetas_;
};

double quantile_of_sorted(const std::vector<double>& sorted, double q) {
  return sorted[static_cast<std::size_t>(std::lround(q * static_cast<double>(sorted.size() - 1)))];
}

/// What the parts of a number would make of its error one by one, to first order.
double error_of_parts(const Task& task, const FitResult& result, const std::vector<TieSlope>& slopes) {
  double squares = 0;
  for (const TieSlope& slope : slopes) {
    const Parameter& parameter = task.job.parameters[slope.index];
    const int j = task.unknowns.of_entry(slope.index);
    const double sd = j >= 0 ? std::sqrt(result.covariance(j, j)) : parameter.known_to.of(parameter.value);
    squares += std::pow(slope.by * sd, 2);
  }
  return std::sqrt(squares);
}

/// Errors by draws, where these spread clearly farther than to first order, or on one side clearly less: at a kink, or
/// beside a pole. Not known where some of the draws have no value. `half`: of the interval to first order.
/// `parts`: where parts make up for each other (a thickness and a birefringence, of which the picture knows the
/// product), the little that is left is not for draws to say: they go straight on where the valley bends.
void take_from_draws(const std::vector<double>& deviations, std::size_t drawn, double half, double parts,
                     DerivedEstimate& estimate) {
  constexpr std::size_t kEnough = 500;
  constexpr double kOne = 0.6827, kSpread = 1.1, kReach = 1.15;  // beyond what so many draws scatter by
  constexpr double kCut = 0.7;
  if (drawn < kEnough) return;
  constexpr double kUndefined = 0.025;
  if (static_cast<double>(drawn - deviations.size()) > kUndefined * static_cast<double>(drawn)) {
    estimate.stderr_ = estimate.interval95_low = estimate.interval95_high = std::numeric_limits<double>::quiet_NaN();
    return;
  }
  std::vector<double> sizes;
  for (const double by : deviations) sizes.push_back(std::abs(by));
  std::sort(sizes.begin(), sizes.end());
  const double spread = quantile_of_sorted(sizes, kOne);
  constexpr double kLittle = 0.2;
  if (spread < kLittle * parts) return;
  const double low = quantile_of_sorted(deviations, 0.025), high = quantile_of_sorted(deviations, 0.975);
  const bool cut = low > -kCut * half || high < kCut * half;
  if (!cut && !(spread > kSpread * estimate.stderr_) && !(quantile_of_sorted(sizes, 0.95) > kReach * half)) return;
  estimate.stderr_ = cut ? spread : std::max(estimate.stderr_, spread);
  estimate.interval95_low = estimate.value + std::min(0.0, low);
  estimate.interval95_high = estimate.value + std::max(0.0, high);
}

/// As much wider as the intervals of the numbers that it goes with are, whose likelihood does not fall as a parabola's:
/// by what the regression on each explains, which is nothing where parts make up for each other.
void widen_by_profiles(const FitResult& result, const Eigen::VectorXd& by, double t, DerivedEstimate& estimate) {
  const Eigen::VectorXd together = result.covariance * by;
  double low = 0, high = 0;
  for (Eigen::Index j = 0; j < by.size(); ++j) {
    const ParameterEstimate& p = result.parameters[static_cast<std::size_t>(j)];
    if (!p.profiled || !std::isfinite(p.interval95_high - p.interval95_low) || !(result.covariance(j, j) > 0)) continue;
    const double slope = together[j] / result.covariance(j, j), normal = t * p.stderr_;
    const auto beyond = [&](double half) { return std::max(0.0, half * half - normal * normal) * slope * slope; };
    const double down = beyond(p.value - p.interval95_low), up = beyond(p.interval95_high - p.value);
    low += slope > 0 ? down : up;
    high += slope > 0 ? up : down;
  }
  estimate.interval95_low = estimate.value - std::hypot(estimate.value - estimate.interval95_low, std::sqrt(low));
  estimate.interval95_high = estimate.value + std::hypot(estimate.interval95_high - estimate.value, std::sqrt(high));
}

/// Of one fitted number alone, all else exact: what that number's own interval says, which need not be symmetric.
void take_from_profile(const Task& task, const Stated& stated, const std::vector<TieSlope>& slopes,
                       const ValueAt& value_at, const FitResult& result, DerivedEstimate& estimate) {
  const ParameterTable& table = task.job.parameters;
  const TieSlope* only = nullptr;
  for (const TieSlope& slope : slopes) {
    const bool fitted = task.unknowns.of_entry(slope.index) >= 0;
    const Parameter& parameter = table[slope.index];
    if (!fitted && !is_stated(stated, slope.index) && !(parameter.known_to.of(parameter.value) > 0)) continue;
    if (only || !fitted) return;
    only = &slope;
  }
  if (!only) return;
  const ParameterEstimate& p = result.parameters[static_cast<std::size_t>(task.unknowns.of_entry(only->index))];
  if (!p.profiled) return;
  const auto at = [&](double end) {
    Theta theta = result.theta;
    theta[static_cast<std::size_t>(only->index)] = std::clamp(end, p.lower, p.upper);
    table.follow(theta);
    return value_at(theta);
  };
  const auto [low, high] = std::minmax({at(p.interval95_low), at(p.interval95_high)});
  if (low <= estimate.value && estimate.value <= high) estimate.interval95_low = low, estimate.interval95_high = high;
}

}  // namespace

void report_derived(const Task& task, const Covariances& covariances, FitResult& result) {
  const ParameterTable& table = task.job.parameters;
  const double t = student_t_quantile(0.975, result.interval_degrees_of_freedom), normal = normal_quantile(0.975);
  std::optional<Draws> draws;
  const auto add = [&](const std::string& name, const std::string& unit, const Tie& tie, bool tied, double value,
                       const std::vector<TieSlope>& slopes, const ValueAt& value_at) {
    const Owed of = owed(task, covariances, result, slopes, value_at);
    DerivedEstimate estimate;
    estimate.name = name, estimate.unit = unit, estimate.expression = tie.law->text();
    estimate.tied = tied, estimate.value = value;
    estimate.by = of.by;
    estimate.stderr_ = all_known(task, result, tie) && std::isfinite(value) && std::isfinite(of.variance)
                           ? std::sqrt(of.variance)
                           : std::numeric_limits<double>::quiet_NaN();
    const double half = std::sqrt(t * t * std::max(0.0, of.variance - of.by_stated) + normal * normal * of.by_stated);
    const double reach = std::isfinite(estimate.stderr_) ? half : estimate.stderr_;
    estimate.interval95_low = value - reach;
    estimate.interval95_high = value + reach;
    if (std::isfinite(estimate.stderr_) && std::isfinite(half) && !result.interrupted) {
      if (!draws) draws.emplace(task, covariances, result);
      take_from_draws(draws->deviations(value_at, value, known_alone(task, covariances.stated, tie)), draws->size(),
                      half, error_of_parts(task, result, slopes), estimate);
    }
    if (!std::isnan(estimate.stderr_)) widen_by_profiles(result, of.by, t, estimate);
    if (!std::isnan(estimate.stderr_)) take_from_profile(task, covariances.stated, slopes, value_at, result, estimate);
    result.derived.push_back(std::move(estimate));
  };
  for (const int index : table.tied()) {
    if (table.tie_of(index)->law->text() == kByZero || table.tie_of(index)->law->text() == kByScale) continue;
    const Parameter& parameter = table[index];
    const double value = result.theta[static_cast<std::size_t>(index)];
    const bool of_row = is_of_row(parameter);  // of which there are hundreds
    if (!of_row)
      add(parameter.name, parameter.unit, *table.tie_of(index), true, value, table.slopes(index, result.theta),
          [index](const Theta& theta) { return theta[static_cast<std::size_t>(index)]; });
    if (!table.is_held(index, result.theta)) continue;
    // Beyond it there is no such sample: the data pull across an end that is not the fitted parameters' own.
    result.pinned = true;
    if (of_row) continue;
    DerivedEstimate& held = result.derived.back();
    held.held = true, held.expected = table.value_of(*table.tie_of(index), result.theta);
    held.stderr_ = held.interval95_low = held.interval95_high = std::numeric_limits<double>::quiet_NaN();
  }
  // By name, the second of twelve pictures before the tenth.
  std::stable_sort(result.derived.begin(), result.derived.end(), [](const auto& a, const auto& b) {
    return std::pair(a.name.size(), a.name) < std::pair(b.name.size(), b.name);
  });
  for (const Derived& derived : task.job.derived)
    add(derived.name, derived.unit, derived.tie, false, table.value_of(derived.tie, result.theta),
        table.slopes(derived.tie, result.theta),
        [&](const Theta& theta) { return table.value_of(derived.tie, theta); });
}

}  // namespace birefit::estimation
