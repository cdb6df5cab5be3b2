#pragma once
// Profile likelihood: where an interval is not value +- t standard errors.

#include <array>
#include <optional>
#include <vector>

#include "fit/problem/least_squares.h"

namespace birefit::estimation {

/// Whether the curvature at the optimum knows a searched unknown, or a prior does: `reach`, so many standard errors,
/// within a quarter of its bounds' width.
bool is_known_there(const FitJob& job, const Parameter& parameter, double reach);

/// How the objective rises when one searched unknown is held away from its best value and all others follow (D. J.
/// Venzon & S. H. Moolgavkar, Appl. Statist. 37, 87 (1988)). Moves `problem`; whoever needs it at the optimum evaluates
/// it there again.
class Profile {
 public:
  /// `covariance` of the searched unknowns at `best`: along it the others start, or from places that profiles of other
  /// unknowns came by, which follow the same valleys.
  Profile(LeastSquares& problem, const FitJob& job, const Unknowns& unknowns, const Eigen::VectorXd& best,
          const Eigen::MatrixXd& covariance, int unknown, std::vector<Eigen::VectorXd> known = {});

  /// Above the objective at the optimum; not minimised further where that is below `enough` already.
  double rise(double value, double enough = -1);
  /// The place between the estimate and `end` where the rise is `allowed`, to 1 % of its root; `end` where it stays
  /// below. By Venzon and Moolgavkar's iteration, by bisection where that fails; where bisection takes more than
  /// sixteen places, the nearest that is beyond.
  double crossing(double end, double allowed);
  /// The places on both sides where the rise is `allowed`, of an unknown that is not known there (is_known_there) while
  /// the data exclude both of its bounds: they answer to its square alone, as to a phase about half a wave or to an
  /// azimuth about the polarizer's. Nothing elsewhere.
  std::optional<std::array<double, 2>> about_turning_point(double allowed);
  /// Of all rises so far; clearly below zero: the estimate was not the minimum.
  double lowest() const;
  const Eigen::VectorXd& lowest_place() const;
  /// All searched unknowns at the place that was asked for nearest to `value`.
  const Eigen::VectorXd& place_nearest(double value) const;
  /// The rise `allowed`^(1/2) standard errors up and down, the others following along straight lines, over `allowed`:
  /// both 1 where the objective is a parabola. Clipped at the bounds.
  std::array<double, 2> straightness(double allowed);

  /// All searched unknowns at all places, those of other profiles first.
  std::vector<Eigen::VectorXd> places() const;
  /// Places that rise() was asked for, in order of value.
  ProfileTrace trace() const;

 private:
  struct Place {
    double value, rise;
    Eigen::VectorXd searched;
  };
  Eigen::VectorXd within_bounds(Eigen::VectorXd x, double value) const;
  Eigen::VectorXd along(const Eigen::VectorXd& from, double value) const;
  /// Where the others are likely to be at `value`: valleys bend, and the places that are known already tell how.
  Eigen::VectorXd start_at(double value);
  std::optional<double> newton_crossing(double end, double allowed);
  double bisected_crossing(double end, double allowed);

  LeastSquares& problem_;
  const FitJob& job_;
  const Unknowns& unknowns_;
  Eigen::VectorXd best_, direction_;  ///< direction_: change of all per change of the one
  double sd_, least_;
  int unknown_;
  std::vector<Eigen::VectorXd> known_;
  std::vector<Place> places_;
};

}  // namespace birefit::estimation
