#pragma once
// What the instrument and the sample are stated to be, and nobody knows exactly.

#include <vector>

#include <Eigen/Dense>

#include "fit/search/optimum.h"

namespace birefit::estimation {

/// Numbers that are read and not fitted, with a standard deviation (Parameter::known_to), about an optimum. In units
/// of that deviation: each shifts the unknowns (searched first), and the picture tells something of it once they have
/// followed.
struct Stated {
  std::vector<int> index;       ///< in the parameter table
  Eigen::VectorXd sd;           ///< in their own units
  Eigen::MatrixXd shift;        ///< d(unknowns)/d(number), a column each
  Eigen::MatrixXd information;  ///< that the pictures have of them, the noise's weights; the prior's would be 1
  Eigen::VectorXd pull;         ///< half the gradient of chi-square by them
};
/// To first order; `covariance` of the unknowns by the problem's weights.
Stated linear_stated_numbers(const Task& task, LeastSquares& problem, const Theta& theta,
                             const Eigen::MatrixXd& covariance);
/// The same, but that a shift of half a standard error or more is found by a short fit; not by waves, where that is too
/// dear.
Stated stated_numbers(const Task& task, const Optimum& optimum, const Eigen::MatrixXd& covariance);
/// What they add to the covariance where each is fitted along as far as the pictures tell it.
Eigen::MatrixXd covariance_by(const Stated& stated);

/// Those that the pictures know themselves, where it matters: fitted beside the unknowns they leave them smaller
/// errors, or describe the pictures better than by chance.
struct WorthFitting {
  std::vector<int> numbers;  ///< table indices
  bool better = false;       ///< the pictures want them elsewhere: other minima may be the best then
  bool bent = false;         ///< the estimates follow them along no straight line: other minima may be as good
};
WorthFitting worth_fitting(const Task& task, const Optimum& optimum);

/// Those that the pictures tell anything of, by the weights of noise alone.
std::vector<int> told_numbers(const Task& task, const Optimum& optimum);

/// Standard deviations that a stated number may be fitted away from what is stated: a wrong model would run off with
/// it.
inline constexpr double kFarthestStated = 12;

/// The job with these free, about what is stated, as nuisances.
FitJob with_nuisances(const FitJob& job, const std::vector<int>& numbers);

/// Places that a search of the narrow task has found, as the wider one has them: what is free there alone is as in
/// `theta`.
Minima widened(const Task& wider, const Task& narrow, const Theta& theta, Minima minima);

/// From the optimum without them, for a few steps: errors are what changes.
Optimum with_nuisances_from(const Task& wider, const Task& narrow, Optimum optimum);
/// Where to look for the best minimum with them: at the places that a search without them has found and that could be
/// the best there, at all of these, or at places spread over what is asked for as well, one a turn of the pictures.
enum class From { in_reach, all_found, everywhere };
/// From places of the narrow task (`minima`), whose best need not be the best with them; the focus from one and two
/// standard deviations to either side as well. Pixels that the wider job masks are left out.
Optimum best_with_nuisances(const Task& wider, const Task& narrow, const Optimum& optimum, const Minima& minima,
                            From from = From::in_reach);

/// With what is stated without being written: the zeros of dials that frames are read off (fit/problem/shared_zeros.h);
/// the focus, where an objective is stated that is not exact, and no focus: set by eye within the depth of field,
/// wavelength index / (2 NA^2), or 0.3 um if that is more.
FitJob with_all_stated(FitJob job);
/// Whether there is any.
bool has_more_stated(const FitJob& job);

}  // namespace birefit::estimation
