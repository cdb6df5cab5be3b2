#pragma once
// The global part of a fit: which fringe order, which twist? Residuals are full of local minima as far apart as
// pictures take to turn once, so that whatever turns them is scanned, on a subsample of pixels, before any solver
// starts.

#include <functional>
#include <vector>

#include "fit/search/phases.h"

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

/// `problem` holds the subsample, `glance` the same or a part of it, more roughly: places, and the first steps from
/// them, are told by it. `start` is the user's. Every unknown along which pictures have several minima is scanned as
/// finely as they lie (docs/methods.md, "Scan"), on a grid or, where that has too many points, on points spread over
/// the box of all of them. Minima whose objective stays above `hopeless_above` are not polished further: another branch
/// has beaten them.
ScanResult scan(LeastSquares& glance, LeastSquares& problem, const Task& task, const Eigen::VectorXd& start,
                const std::vector<PicturePhase>& phases, double hopeless_above);

/// The lowest objective at `start` and at a few places spread over what scan() would look at: to compare two starts of
/// the other unknowns.
double lowest_of_few(LeastSquares& problem, const Task& task, const Eigen::VectorXd& start,
                     const std::vector<PicturePhase>& phases);

/// The same as scan() from given starts instead of a grid, best first, of which four at most (options.scan_candidates),
/// or `all`, are polished; `steps` of the solver for each before the worst are dropped, and those that `same` finds on
/// the way to a minimum that is already known.
using SameMinimum = std::function<bool(const Eigen::VectorXd&, const Eigen::VectorXd&)>;
ScanResult polish(LeastSquares& problem, const FitJob& job, std::vector<Eigen::VectorXd> starts, int steps,
                  const SameMinimum& same, bool all = false);

/// May a minimum at `objective` still be the best, when that is at `best`? A wrong order stays many times worse, or out
/// of the evidence's reach where few numbers tell all.
bool in_reach(double objective, double best);
/// Pictures that cost next to nothing, of cells without a field: all minima may be looked at.
bool costs_microseconds(const Task& task);

/// |R delta|: how many joint standard errors apart.
double separation(const Candidate& minimum, const Eigen::VectorXd& other);
/// ln of the share of the bounds that a minimum takes up (<= 0): the likelihood's integral around it, as if it were a
/// Gaussian, over its highest value and the width of the bounds, linear unknowns following. A parameter that the data
/// do not know takes up all. With it a likelihood becomes the minimum's evidence.
double log_share(const Eigen::MatrixXd& information, const FitJob& job, const Unknowns& unknowns);
/// R of the searched unknowns with the linear ones following, at the problem's last point.
Eigen::MatrixXd projected_information(const LeastSquares& problem);

}  // namespace birefit::estimation
