#pragma once
// What an image without structure would leave: the yardstick of every description.

#include <optional>

#include "fit/problem/least_squares.h"
#include "fit/problem/task.h"

namespace birefit::estimation {

/// Chi-square of images without structure but that of uneven light, frames that share an offset sharing the constant;
/// nothing where the model is such an image itself.
std::optional<double> chi_square_of_a_constant(const Task& task, const LeastSquares& problem);

}  // namespace birefit::estimation
