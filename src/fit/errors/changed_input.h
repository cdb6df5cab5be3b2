#pragma once
// What an input that is not what it was stated to be does to the estimates.

#include <string>

#include <Eigen/Dense>

#include "fit/search/optimum.h"

namespace birefit::estimation {

/// InputEffect::step.
double step_of(const std::string& unit, double value);

/// Change of all unknowns, searched first, when table entry `index` is `value`: a short fit by a part of the pixels to
/// the optimum's own picture, from where the first order, `linear`, leads. The first order does not tell it where the
/// picture turns by a good part of a fringe, or where light ends at an edge that lies between pixels: two of its
/// derivatives at one place are as far from it as they like.
Eigen::VectorXd shift_by_input(const Task& task, const Optimum& optimum, int index, double value,
                               const Eigen::VectorXd& linear);

}  // namespace birefit::estimation
