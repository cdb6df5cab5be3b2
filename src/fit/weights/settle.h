#pragma once
// From a minimum to the fit: weights, plans, outliers and misfit follow the parameters until nothing changes. Each
// takes an optimum and returns a better one; an interruption anywhere leaves something to report.

#include "fit/search/optimum.h"

namespace birefit::estimation {

/// Part of an image that dust and scratches may cover at most.
inline constexpr double kMostOutliers = 0.1;

/// Usable pixels whose light the codes reach, by the fitted picture: within a few deviations of an end that cuts noise
/// off, what is left of it is not centred. Chosen by the values, their noise would choose them.
Pixels pixels_in_range(const Task& task, const Optimum& optimum, int frame);
/// Without what is not in range.
Optimum with_settled_range(const Task& task, Optimum optimum);
/// The noise by the residual, where that is clearly lower, and the weights by the fitted signal: from the data
/// themselves they pull a fit low, as bright outliers get small weights.
Optimum with_settled_weights(const Task& task, Optimum optimum);
/// Plans as fine as the model needs where the fit ended.
Optimum with_settled_plans(const Task& task, Optimum optimum);
/// Without what stands out of the residual, where the job asks for that: the loss min(z^2, limit^2), z of a pixel or of
/// its neighbourhood. Every round judges all pixels anew, so that what a bad start made stand out comes back.
Optimum with_settled_outliers(const Task& task, Optimum optimum);
/// What is more than noise, frame by frame and between frames, in the weights.
Optimum with_settled_misfit(const Task& task, Optimum optimum);

/// What stands out of a micrograph's residual, among all its usable pixels.
Outliers outliers_of(const Task& task, const Optimum& optimum, int frame);

}  // namespace birefit::estimation
