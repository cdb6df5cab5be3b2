#include "fit/errors/samples.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <utility>

#include "core/robust.h"
#include "fit/search/scan.h"

namespace birefit::estimation {
namespace {

constexpr double kImpossible = -std::numeric_limits<double>::infinity();

Eigen::VectorXd standard_normal(Eigen::Index n, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  Eigen::VectorXd z(n);
  for (double& one : z) one = normal(random);
  return z;
}

/// Length of a draw from Student's t over that of the normal it is made of.
double student_stretch(double freedom, std::mt19937_64& random) {
  if (!std::isfinite(freedom)) return 1;
  return std::sqrt(freedom / std::chi_squared_distribution<double>(freedom)(random));
}

/// Of the searched unknowns, the linear ones integrated out.
class Posterior {
 public:
  Posterior(const Task& task, LeastSquares& problem, double freedom)
      : task_(task), problem_(problem), freedom_(freedom), least_(problem.objective()) {}

  Eigen::Index size() const { return problem_.searched_size(); }
  double freedom() const { return freedom_; }

  /// ln of the density, but for a constant.
  double operator()(const Eigen::VectorXd& x) {
    for (Eigen::Index j = 0; j < x.size(); ++j) {
      const Parameter& parameter = task_.searched(static_cast<std::size_t>(j));
      if (!(x[j] >= parameter.lower && x[j] <= parameter.upper)) return kImpossible;
    }
    try {
      problem_.evaluate(x, false);
    } catch (const std::exception&) {  // no such scene
      return kImpossible;
    }
    const double above = problem_.objective() - least_;
    if (!std::isfinite(above)) return kImpossible;
    // Weights that are known by few observations: Student's t of as many degrees of freedom, all unknowns together.
    const double p = static_cast<double>(size());
    const double likelihood = std::isfinite(freedom_)
                                  ? -0.5 * (freedom_ + p) * std::log1p(std::max(above, -0.5 * freedom_) / freedom_)
                                  : -0.5 * above;
    const Eigen::MatrixXd& linear = problem_.linear_information();
    const double volume = linear.size() ? linear.ldlt().vectorD().array().max(1e-300).log().sum() : 0;
    return likelihood - 0.5 * volume;
  }

  /// The linear unknowns where these are the searched ones.
  Eigen::VectorXd linear_at(const Eigen::VectorXd& x, std::mt19937_64& random) {
    problem_.evaluate(x, false);
    const Eigen::MatrixXd& information = problem_.linear_information();
    const Eigen::Index l = information.rows();
    Eigen::VectorXd linear(l);
    for (Eigen::Index j = 0; j < l; ++j)
      linear[j] = problem_.theta()[static_cast<std::size_t>(task_.unknowns.linear[static_cast<std::size_t>(j)])];
    const Eigen::LLT<Eigen::MatrixXd> root(information);
    if (l == 0 || root.info() != Eigen::Success) return linear;
    double stretch = 1;
    if (std::isfinite(freedom_)) {
      const double p = static_cast<double>(size()), above = std::max(problem_.objective() - least_, -0.5 * freedom_);
      stretch = std::sqrt((freedom_ + above) / (freedom_ + p)) * student_stretch(freedom_ + p, random);
    }
    return linear + stretch * root.matrixU().solve(standard_normal(l, random));
  }

 private:
  const Task& task_;
  LeastSquares& problem_;
  double freedom_, least_;
};

/// What the posterior looks like near the minima that are known: Student's t about each. Its tails are heavier, so that
/// no place is hard to reach.
class Guess {
 public:
  void add(const Eigen::VectorXd& centre, const Eigen::MatrixXd& covariance, double weight) {
    constexpr double kWider = 1.1;
    const Eigen::LLT<Eigen::MatrixXd> root(kWider * kWider * covariance);
    if (root.info() == Eigen::Success && weight > 0) modes_.push_back({centre, root.matrixL(), weight});
  }
  bool empty() const { return modes_.empty(); }

  Eigen::VectorXd draw(std::mt19937_64& random) const {
    std::vector<double> weights;
    for (const Mode& mode : modes_) weights.push_back(mode.weight);
    const Mode& mode = modes_[std::discrete_distribution<std::size_t>(weights.begin(), weights.end())(random)];
    return mode.centre + student_stretch(kFreedom, random) * (mode.root * standard_normal(mode.centre.size(), random));
  }
  /// ln of the density, but for a constant.
  double operator()(const Eigen::VectorXd& x) const {
    double sum = 0;
    for (const Mode& mode : modes_) {
      const double square = mode.root.triangularView<Eigen::Lower>().solve(x - mode.centre).squaredNorm();
      sum += mode.weight / mode.root.diagonal().prod() *
             std::pow(1 + square / kFreedom, -0.5 * (kFreedom + static_cast<double>(x.size())));
    }
    return std::log(std::max(sum, std::numeric_limits<double>::min()));
  }

 private:
  static constexpr double kFreedom = 5;
  struct Mode {
    Eigen::VectorXd centre;
    Eigen::MatrixXd root;
    double weight = 1;
  };
  std::vector<Mode> modes_;
};

/// Of a minimum, by its curvature; what the data do not know is as wide as its bounds.
Eigen::MatrixXd covariance_at(const Task& task, const LeastSquares& problem) {
  const Eigen::MatrixXd root = projected_information(problem);
  Eigen::MatrixXd information = root.transpose() * root;
  for (Eigen::Index j = 0; j < information.rows(); ++j) {
    const Parameter& parameter = task.searched(static_cast<std::size_t>(j));
    if (const double width = parameter.upper - parameter.lower; std::isfinite(width) && width > 0)
      information(j, j) += 12 / (width * width);  // a flat distribution's variance
  }
  const Eigen::LDLT<Eigen::MatrixXd> solver(information);
  if (solver.info() != Eigen::Success || !solver.isPositive()) return {};
  return solver.solve(Eigen::MatrixXd::Identity(information.rows(), information.cols()));
}

Guess guess_of(const Task& task, Optimum& optimum, const FitResult& result) {
  constexpr double kLeastOdds = 1e-6, kLeastWeight = 0.02;
  Guess guess;
  optimum.problem->evaluate(optimum.searched, true);
  const Eigen::MatrixXd here = covariance_at(task, *optimum.problem);
  if (here.size() == 0 || !here.allFinite()) return guess;
  guess.add(optimum.searched, here, 1);
  for (const RivalMinimum& rival : result.rivals) {
    if (!(std::max(rival.odds, rival.likelihood_ratio) > kLeastOdds)) continue;
    Eigen::VectorXd x(optimum.searched.size());
    for (Eigen::Index j = 0; j < x.size(); ++j)
      x[j] = rival.theta[static_cast<std::size_t>(task.unknowns.searched[static_cast<std::size_t>(j)])];
    optimum.problem->evaluate(x, true);
    if (const Eigen::MatrixXd there = covariance_at(task, *optimum.problem); there.size() > 0 && there.allFinite())
      guess.add(x, there, std::clamp(rival.odds, kLeastWeight, 1.0));
  }
  return guess;
}

/// An ensemble of walkers, each of which either goes along the line to another (J. Goodman and J. Weare, Comm. App.
/// Math. Comp. Sci. 5, 65 (2010)), which follows valleys whatever their shape, or tries a place of the guess's own
/// (Metropolis and Hastings), which crosses between minima.
class Ensemble {
 public:
  Ensemble(Posterior& posterior, const Guess& guess, std::mt19937_64& random)
      : posterior_(posterior), guess_(guess), random_(random) {
    const auto walkers = static_cast<std::size_t>(std::max<Eigen::Index>(8, 2 * (posterior.size() + 1)));
    constexpr int kTries = 200;
    for (int i = 0; at_.size() < walkers && i < kTries * static_cast<int>(walkers); ++i)
      if (Place place = place_at(guess.draw(random)); place.density > kImpossible) at_.push_back(std::move(place));
  }
  std::size_t walkers() const { return at_.size(); }
  const std::vector<std::vector<Eigen::VectorXd>>& steps() const { return steps_; }
  double accepted() const { return tried_ > 0 ? went_ / tried_ : 1; }

  void forget() { steps_.clear(), tried_ = went_ = 0; }
  void step() {
    for (std::size_t i = 0; i < at_.size(); ++i) move(i);
    steps_.emplace_back();
    for (const Place& place : at_) steps_.back().push_back(place.x);
  }

 private:
  struct Place {
    Eigen::VectorXd x;
    double density = kImpossible, guessed = 0;
  };
  Place place_at(Eigen::VectorXd x) {
    const double density = posterior_(x), guessed = guess_(x);
    return {std::move(x), density, guessed};
  }
  void move(std::size_t i) {
    std::uniform_real_distribution<double> uniform;
    Place to;
    double odds = 0;
    if (uniform(random_) < 0.5) {
      const std::size_t other = (i + 1 + random_() % (at_.size() - 1)) % at_.size();
      constexpr double kScale = 2;
      const double z = std::pow((kScale - 1) * uniform(random_) + 1, 2) / kScale;
      to = place_at(at_[other].x + z * (at_[i].x - at_[other].x));
      odds = static_cast<double>(posterior_.size() - 1) * std::log(z) + to.density - at_[i].density;
    } else {
      to = place_at(guess_.draw(random_));
      odds = to.density - to.guessed - at_[i].density + at_[i].guessed;
    }
    ++tried_;
    if (std::log(std::max(uniform(random_), std::numeric_limits<double>::min())) < odds) {
      at_[i] = std::move(to);
      ++went_;
    }
  }

  Posterior& posterior_;
  const Guess& guess_;
  std::mt19937_64& random_;
  std::vector<Place> at_;
  std::vector<std::vector<Eigen::VectorXd>> steps_;
  double tried_ = 0, went_ = 0;
};

/// Integrated autocorrelation time of one unknown, of all walkers' chains together; the sum ends at five times itself
/// (A. Sokal, in Functional Integration, Plenum 1997).
double autocorrelation_of(const std::vector<std::vector<Eigen::VectorXd>>& steps, Eigen::Index unknown) {
  constexpr double kWindow = 5;
  const std::size_t count = steps.size(), walkers = steps.front().size();
  double mean = 0;
  for (const auto& step : steps)
    for (const Eigen::VectorXd& x : step) mean += x[unknown] / static_cast<double>(count * walkers);
  const auto product = [&](std::size_t lag) {
    double sum = 0;
    for (std::size_t s = 0; s + lag < count; ++s)
      for (std::size_t w = 0; w < walkers; ++w)
        sum += (steps[s][w][unknown] - mean) * (steps[s + lag][w][unknown] - mean);
    return sum / static_cast<double>((count - lag) * walkers);
  };
  const double variance = product(0);
  if (!(variance > 0)) return 1;
  double time = 1;
  for (std::size_t lag = 1; lag < count / 2 && static_cast<double>(lag) <= kWindow * time; ++lag)
    time += 2 * product(lag) / variance;
  return std::max(1.0, time);
}

double slowest_of(const std::vector<std::vector<Eigen::VectorXd>>& steps, Eigen::Index unknowns) {
  double time = 1;
  for (Eigen::Index j = 0; j < unknowns; ++j) time = std::max(time, autocorrelation_of(steps, j));
  return time;
}

/// A root of the covariance; of what rounding made negative nothing.
Eigen::MatrixXd root_of(const Eigen::MatrixXd& covariance) {
  if (!covariance.allFinite()) return Eigen::MatrixXd::Zero(covariance.rows(), covariance.cols());
  const Eigen::VectorXd sd = covariance.diagonal().cwiseMax(0).cwiseSqrt();
  const Eigen::VectorXd per = sd.unaryExpr([](double s) { return s > 0 ? 1 / s : 0.0; });
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(
      Eigen::MatrixXd(per.asDiagonal() * covariance * per.asDiagonal()));
  return sd.asDiagonal() * axes.eigenvectors() * axes.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
}

/// Back from beyond a bound by as much as it went there.
double inside_bounds(const Parameter& parameter, double value) {
  if (value < parameter.lower) value = 2 * parameter.lower - value;
  if (value > parameter.upper) value = 2 * parameter.upper - value;
  return std::clamp(value, parameter.lower, parameter.upper);
}

void summarise(const FitResult& result, Samples& samples) {
  for (std::size_t j = 0; j < result.parameters.size(); ++j) {
    const auto column = samples.values.col(static_cast<Eigen::Index>(j));
    const std::vector<double> values(column.begin(), column.end());
    samples.parameters.push_back(
        {result.parameters[j].name, median(values), quantile(values, 0.025), quantile(values, 0.975)});
  }
}

}  // namespace

std::optional<Samples> draw_samples(const Task& task, Optimum& optimum, const FitResult& result,
                                    const Eigen::MatrixXd& beyond) {
  const auto wanted = static_cast<std::size_t>(std::max(0, task.job.options.samples));
  if (wanted == 0 || optimum.stopped || task.unknowns.size() == 0 || result.parameters.empty()) return std::nullopt;
  task.say("drawing from the posterior");
  constexpr double kMany = 1e4;  // degrees of freedom: normal to a percent of a percent
  const double freedom = result.interval_degrees_of_freedom;
  optimum.problem->evaluate(optimum.searched, true);
  Posterior posterior(task, *optimum.problem,
                      freedom > 0 && freedom < kMany ? freedom : std::numeric_limits<double>::infinity());
  std::mt19937_64 random(0x9e3779b97f4a7c15u);
  Samples samples;
  std::vector<Eigen::VectorXd> drawn;
  if (posterior.size() == 0) {
    drawn.assign(wanted, Eigen::VectorXd());
    samples.effective = static_cast<double>(wanted);
  } else {
    const Guess guess = guess_of(task, optimum, result);
    optimum.problem->evaluate(optimum.searched, true);
    if (guess.empty()) return std::nullopt;
    Ensemble ensemble(posterior, guess, random);
    if (ensemble.walkers() < 4) return std::nullopt;
    // Until it holds as many independent draws as were asked for; what mixes slower than this is told by `effective`.
    constexpr std::size_t kBurnIn = 30, kLeast = 60, kMostPerDraw = 25;
    const std::size_t walkers = ensemble.walkers(), few = std::max(kLeast, wanted / walkers + 1),
                      most = std::max(kLeast, kMostPerDraw * wanted / walkers + 1);
    for (std::size_t i = 0; i < kBurnIn && !task.interrupted(); ++i) ensemble.step();
    ensemble.forget();
    for (std::size_t goal = few; ensemble.steps().size() < goal && !task.interrupted();) {
      ensemble.step();
      if (ensemble.steps().size() < goal) continue;
      samples.autocorrelation = slowest_of(ensemble.steps(), posterior.size());
      const double needed = samples.autocorrelation * static_cast<double>(wanted) / static_cast<double>(walkers);
      goal = std::max(goal, std::min(most, static_cast<std::size_t>(1.05 * needed) + 1));
    }
    const std::size_t count = ensemble.steps().size() * walkers;
    if (task.interrupted() || count == 0) return std::nullopt;
    samples.accepted = ensemble.accepted();
    samples.effective = std::min(static_cast<double>(wanted), static_cast<double>(count) / samples.autocorrelation);
    for (std::size_t i = 0; i < wanted; ++i) {
      const std::size_t at = (2 * i + 1) * count / (2 * wanted);
      drawn.push_back(ensemble.steps()[at / walkers][at % walkers]);
    }
  }

  std::vector<int> kept;  // of the unknowns; nuisances are in the others' spread
  for (int j = 0; j < task.unknowns.size(); ++j)
    if (!task.job.parameters[task.unknowns.table_index(j)].nuisance) kept.push_back(j);
  const Eigen::MatrixXd root = root_of(beyond);
  samples.values.resize(static_cast<Eigen::Index>(wanted), static_cast<Eigen::Index>(kept.size()));
  for (std::size_t i = 0; i < wanted; ++i) {
    if (task.interrupted()) return std::nullopt;
    Eigen::VectorXd all(task.unknowns.size());
    all << drawn[i], posterior.linear_at(drawn[i], random);
    all += student_stretch(posterior.freedom(), random) * (root * standard_normal(all.size(), random));
    for (std::size_t k = 0; k < kept.size(); ++k)
      samples.values(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) =
          inside_bounds(task.job.parameters[task.unknowns.table_index(kept[k])], all[kept[k]]);
  }
  optimum.problem->evaluate(optimum.searched, true);
  summarise(result, samples);
  return samples;
}

}  // namespace birefit::estimation
