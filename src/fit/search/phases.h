#pragma once
// How pictures turn along each searched unknown: what a grid has to resolve.

#include <vector>

#include "fit/problem/least_squares.h"
#include "fit/problem/task.h"

namespace birefit::estimation {

/// The phase that pictures gain along one searched unknown: linear between values that ascend from its lower to its
/// upper bound. Empty for one that pictures do not depend on, or that has no bounds to scan between.
struct PicturePhase {
  std::vector<double> value, radians;
  bool of_fringes = false;    ///< by the retardance; else by the pictures themselves
  double at(double v) const;  ///< radians from the lower bound on
  double value_at(double radians) const;
  double total() const { return radians.empty() ? 0 : radians.back(); }
};

/// Of every searched unknown. Of what forms fringes, by the retardance: the fastest of all images, and of the other
/// unknowns at `theta` and at either end of what they may be. Of the rest but centres, by the pictures of `problem`,
/// the fastest of a few places of the others: how far they go, |dI| over all pixels, in units of how far they stray
/// from their mean along the unknown. That is the phase where pixels are cosines of many phases, 4 sqrt(2) instead of
/// 2 pi a turn where there is only one, and 2 sqrt(3) where it is a straight line.
std::vector<PicturePhase> picture_phases(LeastSquares& problem, const Task& task, const Theta& theta);

/// Member `index` >= 0 of a sequence that fills the box of [0, 1]^axes evenly however many are taken (J. H. Halton,
/// Numer. Math. 2, 84 (1960)).
std::vector<double> spread_in_box(int index, std::size_t axes);

}  // namespace birefit::estimation
