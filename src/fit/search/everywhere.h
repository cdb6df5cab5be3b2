#pragma once
// Minima of pictures that are described by nothing near what is stated: numbers that are fitted along turn pictures as
// well as what is asked for, so that places are spread over all of them.

#include <vector>

#include "fit/search/scan.h"

namespace birefit::estimation {

/// Distinct minima, best first, from `starts`, from the best of places spread over what is asked for (several a turn of
/// the pictures) and what is stated (two standard deviations to either side), and from one fringe order beside the best
/// of these along whatever turns fringes, as long as that finds a better one. `theta`: all other numbers.
ScanResult minima_everywhere(LeastSquares& problem, const Task& task, const Theta& theta,
                             std::vector<Eigen::VectorXd> starts);

}  // namespace birefit::estimation
