#pragma once
// The global part of a fit: which fringe order? Residuals of fringes are full of local minima one order apart, so the
// fringe-forming parameters are scanned on a grid, on a subsample of pixels, before any solver starts.

#include <functional>
#include <vector>

#include "fit/problem/least_squares.h"

namespace birefit::estimation {

/// A minimum of the objective on the subsample.
struct Candidate {
  Eigen::VectorXd searched;
  double objective = 0;
  Eigen::MatrixXd information;  ///< R of the projected Jacobian there: |R delta| is a distance in standard errors
};

struct ScanResult {
  std::vector<Candidate> candidates;  ///< distinct, polished, best first; at least one
  std::vector<ScanTrace> traces;
  int points = 0;  ///< of the grid: how many places the objective was looked at
  bool interrupted = false;
};

/// The phase that fringes gain along one searched unknown: linear between values that ascend from its lower to its
/// upper bound. Empty for one that forms no fringes, or has no bounds to scan between.
struct FringePhase {
  std::vector<double> value, radians;
  double at(double v) const;  ///< radians from the lower bound on
};

/// Of every searched unknown, the fastest of all images, and of the others at `theta` and at either end of what they
/// may be.
std::vector<FringePhase> fringe_phases(const FitJob& job, const Unknowns& unknowns, const Theta& theta);

/// `problem` holds the subsample; `start` is the user's. Unknowns that form no fringes, but centres, are scanned
/// coarsely where the grid stays small (docs/methods.md, "Scan"). Minima whose objective stays above `hopeless_above`
/// are not polished further: another branch has beaten them.
ScanResult scan(LeastSquares& problem, const FitJob& job, const Unknowns& unknowns, const Eigen::VectorXd& start,
                const std::vector<FringePhase>& fringes, double hopeless_above);

/// The lowest objective at `start` and at a few places spread over what scan() would look at: to compare two starts of
/// the other unknowns.
double lowest_of_few(LeastSquares& problem, const FitJob& job, const Unknowns& unknowns, const Eigen::VectorXd& start,
                     const std::vector<FringePhase>& fringes);

/// The same as scan() from given starts instead of a grid, best first, of which four at most (options.scan_candidates)
/// are polished; `steps` of the solver for each before the worst are dropped, and those that `same` finds on the way to
/// a minimum that is already known.
using SameMinimum = std::function<bool(const Eigen::VectorXd&, const Eigen::VectorXd&)>;
ScanResult polish(LeastSquares& problem, const FitJob& job, std::vector<Eigen::VectorXd> starts, int steps,
                  const SameMinimum& same);

/// |R delta|: how many joint standard errors apart.
double separation(const Candidate& minimum, const Eigen::VectorXd& other);
/// ln of the share of the bounds that a minimum takes up (<= 0): the likelihood's integral around it, as if it were a
/// Gaussian, over its highest value and the width of the bounds, linear unknowns following. A parameter that the data
/// do not know takes up all. With it a likelihood becomes the minimum's evidence.
double log_share(const Eigen::MatrixXd& information, const FitJob& job, const Unknowns& unknowns);
/// R of the searched unknowns with the linear ones following, at the problem's last point.
Eigen::MatrixXd projected_information(const LeastSquares& problem);

}  // namespace birefit::estimation
