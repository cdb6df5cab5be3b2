#pragma once
// Which directions of parameter space the image determines, and the whole result in plain words.

#include "fit/errors/statistics.h"
#include "fit/problem/least_squares.h"

namespace birefit::estimation {

/// Fills directions, identifiable and the NaN standard errors from the factor of the whitened Jacobian (priors
/// included), of which `inverse` is the inverse. Needs result.parameters, covariance and interval_degrees_of_freedom.
void judge_identifiability(FitResult& result, const FitJob& job, const Unknowns& unknowns,
                           const Eigen::MatrixXd& factor, const Inverse& inverse);

/// Share of what there is to see that a model may leave unexplained, whatever its errors say (judge_description).
inline constexpr double kMostLeftOver = 0.5;

/// The paragraph, from everything else in the result. `signal` = false: a constant image explains the data as well.
std::string verdict(const FitResult& result, bool signal);

/// A value rounded to two digits of its error, "0.2200 +- 0.0013".
std::string with_error(double value, double error);

}  // namespace birefit::estimation
