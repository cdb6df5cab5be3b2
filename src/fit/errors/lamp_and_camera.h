#pragma once
// What lamp and camera do to all pictures of a fit alike, and no number of the scene stands for.

#include <Eigen/Dense>

#include "fit/search/optimum.h"

namespace birefit::estimation {

/// What they add to the covariance of the unknowns: each by as much as is usual, and as far as the pictures tell.
/// - A lamp drifts from the first of several pictures of one gain to the last (Parameter::known_to of the gain).
/// - Light is not even over a flat sample that is not the same all over: along x, y and outwards, 2 % at the edge of
///   the longer side (0.2 % where a calibration frame has divided it out), and so a background, by 1 % (0.1 %) of the
///   gain; unless the picture's own is stated.
/// - A camera's values are not proportional to light, in pictures of a flat sample: light to the power of 1 + gamma,
///   0.3 %; not where gains are exact.
struct LampAndCamera {
  Eigen::MatrixXd covariance;   ///< of all unknowns, the searched ones first; empty: nothing
  bool of_drift_alone = false;  ///< nothing but the lamp's drift is in it
};
/// By the weights of the problem; `covariance` of the unknowns by the same.
LampAndCamera by_lamp_and_camera(const Task& task, const Optimum& optimum, const Eigen::MatrixXd& covariance);
/// Of pictures that are yet to come: what it is on the average, when light and camera are as usual. Empty: nothing.
Eigen::MatrixXd foretold_by_lamp_and_camera(const Task& task, const LeastSquares& problem,
                                            const Eigen::MatrixXd& covariance);

}  // namespace birefit::estimation
