#pragma once
// A fit between its stages: where it stands, by which weights, and what it met on the way.

#include "fit/problem/frame.h"
#include "fit/search/search.h"
#include "fit/weights/outliers.h"

namespace birefit::estimation {

/// More than noise, as the residual shows it.
struct MisfitFound {
  double lamp_jitter = 0;       ///< share by which the lamp's brightness scatters from frame to frame
  double lamp_share = 0;        ///< of the variance of the frame's mean that it makes most of, where frames show it
  Eigen::VectorXd lamp_wider;   ///< LampJitter::wider; empty without such a jitter
  double frame_sd = 0;          ///< of the model intensity, common to a frame, and beyond the lamp's jitter
  double frame_dof = 0;         ///< degrees of freedom behind both
  bool frames_scatter = false;  ///< measured between this fit's own frames
  double largest_area = 1;      ///< pixels that share one misfit
  bool beyond_noise = false;    ///< in some micrograph
  double row_length = 1;        ///< neighbouring rows of a table that share one misfit
};

struct Optimum {
  Frames frames;
  std::unique_ptr<LeastSquares> problem;  ///< evaluated at `searched`, with derivatives
  Eigen::VectorXd searched;
  Theta theta;                            ///< the whole table there
  std::vector<Eigen::VectorXd> rivals;    ///< other minima that a subsample could not exclude
  std::optional<Eigen::VectorXd> better;  ///< a lower place that was met after all
  std::vector<Outliers> left_out;         ///< of each micrograph
  MisfitFound misfit;
  bool explained = false;          ///< looked at, and noise explains all that is left over here
  std::optional<Theta> came_from;  ///< the optimum without the catalogue of departures, where that was asked

  double per_pixel = 1;  ///< objective of the last solution over its pixels
  bool converged = false;
  bool stopped = false;  ///< interrupted, or beaten: nothing is solved any more
  bool possible = true;  ///< false: the search ended where the scene cannot be
  std::string solver_report;
  std::vector<Iteration> iterations;
  std::vector<std::string> warnings;
  int evaluations = 0;  ///< of pictures, the problem's own not included

  /// Of the data, in units of the noise; priors not included.
  double chi_square(const Task& task) const;
  int degrees_of_freedom(const Task& task) const;
  /// Priors included.
  double reduced_chi_square(const Task& task) const;
};

/// Solves from `searched` with the optimum's problem. Labelled steps are the ones that the report draws.
SolveSummary solve(const Task& task, Optimum& optimum, Eigen::VectorXd& searched, const std::string& label,
                   int max_iterations = 0);
/// Solves from where the optimum is, which moves.
void solve_again(const Task& task, Optimum& optimum, const std::string& label);
/// The problem anew, of changed plans, weights or pixels.
void rebuild(const Task& task, Optimum& optimum);

/// From the search's minima to one on all pixels, by the likelihood or, among a sphere's ripples, by the evidence. What
/// has been `beaten` stays where the search left it.
Optimum best_minimum(const Task& task, const Minima& minima, bool beaten);

/// Between one ripple of a sphere's image and the next, of a searched unknown; 0 where it has none.
double ripple_period_of(const Task& task, const Theta& theta, std::size_t j);
bool has_ripples(const Task& task, const Theta& theta);
/// -2 ln of the likelihood where `problem` was evaluated last, but for a constant. Of several frames, each with its
/// mean: these may scatter as a lamp does, or by more, at the price of their smaller likelihood, whatever the problem's
/// weights are, which have been settled elsewhere.
double deviance(const Task& task, const LeastSquares& problem);
/// -2 ln of a minimum's evidence.
double score(const Task& task, const Candidate& minimum);
/// What the best minimum has least of. Only of a sphere's ripples, which are alike but for their width, is that the
/// evidence: a minimum that is flat because fringes have an extremum there takes up all bounds.
double rank(const Task& task, const Theta& theta, const Candidate& minimum);

}  // namespace birefit::estimation
