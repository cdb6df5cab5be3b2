#include "fit/errors/rivals.h"

#include <algorithm>
#include <cmath>

namespace birefit::estimation {
namespace {

/// Far apart in the standard errors of either, or else they are two places of one valley. (At an extremum of the
/// fringes one alone calls everything near.)
bool one_valley(const Candidate& a, const Candidate& b) {
  return separation(a, b.searched) < 5 && separation(b, a.searched) < 5;
}

/// The minima that are left with the final weights, each once; the lowest of all becomes `main`.
std::vector<Candidate> distinct_minima(const Task& task, Optimum& optimum, Candidate& main) {
  std::vector<Candidate> others;
  for (Eigen::VectorXd x : optimum.rivals) {
    solve(task, optimum, x, "", 30);
    Candidate rival{x, deviance(task, *optimum.problem), projected_information(*optimum.problem)};
    if (optimum.stopped) break;
    if (one_valley(main, rival)) {
      if (rival.objective < main.objective) std::swap(main, rival);
      continue;
    }
    const Theta& theta = optimum.problem->theta();
    if (rank(task, theta, rival) < rank(task, theta, main)) std::swap(main, rival);
    const bool known =
        std::any_of(others.begin(), others.end(), [&](const Candidate& other) { return one_valley(other, rival); });
    if (!known) others.push_back(std::move(rival));
  }
  return others;
}

}  // namespace

Rivals weigh_rivals(const Task& task, Optimum& optimum) {
  Rivals rivals;
  LeastSquares& problem = *optimum.problem;
  if (!optimum.stopped && !optimum.rivals.empty()) {
    Candidate main{optimum.searched, deviance(task, problem), projected_information(problem)};
    const bool rippled = has_ripples(task, problem.theta());
    std::vector<Candidate> others = distinct_minima(task, optimum, main);
    // Of a dip and the valley it lies in, the valley, whose interval holds both.
    constexpr double kHeld = 2, kWorthHolding = 0.05;
    const auto valley = std::find_if(others.begin(), others.end(), [&](const Candidate& rival) {
      return rippled && separation(rival, main.searched) < kHeld &&
             score(task, rival) - score(task, main) < -2 * std::log(kWorthHolding);
    });
    if (valley != others.end()) std::swap(main, *valley);
    for (const Candidate& rival : others) {
      RivalMinimum minimum;
      minimum.likelihood_ratio = std::exp(-0.5 * (rival.objective - main.objective));
      minimum.odds = std::exp(-0.5 * (score(task, rival) - score(task, main)));
      // Among a sphere's many resonances one always follows the noise, a dip too narrow to be likely. Elsewhere neither
      // measure alone dismisses a rival: at an extremum of the fringes a minimum is no parabola, and its share no more
      // than a guess.
      minimum.counts = rippled ? minimum.odds > kAmbiguousOdds && separation(main, rival.searched) >= kHeld
                               : std::max(minimum.odds, minimum.likelihood_ratio) > kAmbiguousOdds;
      if (!(std::max(minimum.odds, minimum.likelihood_ratio) > 1e-3)) continue;
      problem.evaluate(rival.searched, false);
      minimum.theta = problem.theta();
      for (int g = 0; g < task.frames(); ++g) minimum.chi_square += problem.frame_misfit(g).chi_square;
      minimum.chi_square += problem.prior_chi_square();
      rivals.minima.push_back(std::move(minimum));
    }
    std::stable_sort(rivals.minima.begin(), rivals.minima.end(),
                     [](const RivalMinimum& a, const RivalMinimum& b) { return a.odds > b.odds; });
    optimum.searched = main.searched;
  }
  problem.evaluate(optimum.searched, true);
  optimum.theta = problem.theta();
  return rivals;
}

}  // namespace birefit::estimation
