#pragma once
// What a residual that noise does not explain could have done to the parameters.

#include <vector>

#include <Eigen/Dense>

#include "fit/search/optimum.h"

namespace birefit::estimation {

/// The model is not quite the picture's: a smooth discrepancy is left, and what of it lies along a parameter's own
/// pattern shows in no residual. Its size is read off the residual beside, in groups of patterns of like kind, each
/// with a variance of its own by the highest likelihood (empirical Bayes; D. J. C. MacKay, Neural Comput. 4, 415
/// (1992)); what a discrepancy of that size does to the parameters is their covariance. A second opinion: the picture
/// without one of its sectors or rings at a time, or columns and rows, or one of several pictures (M. H. Quenouille,
/// Biometrika 43, 353 (1956)). The larger of the two counts, times 1.5, which is measured, not derived
/// (docs/methods.md, "Nearly the model").
///
/// Covariances of all unknowns, searched first, by either opinion; none where nothing is left over, or where pictures
/// do not change from place to place and rows follow no pattern.
std::vector<Eigen::MatrixXd> covariances_by_discrepancy(const Task& task, const Optimum& optimum);
/// Whether there are any.
bool leaves_discrepancy(const Task& task, const Optimum& optimum);

/// Whether all pictures are of spheres, and no colours of one photograph.
bool are_of_spheres(const Task& task);

/// What the model of a picture misses beyond its noise, as RMS over the range of the model's light.
double missed_of_contrast(const Task& task, const Optimum& optimum, int frame = 0);
/// The same of all pictures, over the range of their light together.
double missed_of_all(const Task& task, const Optimum& optimum);

}  // namespace birefit::estimation
