#pragma once
// Draws from the posterior about an optimum, for what no interval about one value can say: several minima, bounds,
// valleys that are bent.

#include "fit/search/optimum.h"

namespace birefit::estimation {

/// FitOptions::samples draws of the parameters of `result`; nothing where there are none, or the problem has no finite
/// posterior. The likelihood is that of the optimum's weights with `freedom` degrees of freedom, integrated over the
/// linear unknowns; the prior is flat within the bounds, or what was stated. `beyond`: the covariance, of all unknowns,
/// that the errors have and those weights have not; it is drawn as a normal and added. Minima to begin with are the
/// optimum and the result's rivals. Moves the problem and brings it back. Deterministic.
std::optional<Samples> draw_samples(const Task& task, Optimum& optimum, const FitResult& result,
                                    const Eigen::MatrixXd& beyond);

}  // namespace birefit::estimation
