#pragma once
// A lamp's brightness differs from frame to frame: by how much, as far as the frames' means tell, and what its being
// known no better does to standard errors.

#include <Eigen/Dense>

namespace birefit::estimation {

/// What each frame's mean says, a row each: in units of its noise, to first order about where a fit stands.
struct FrameMeans {
  Eigen::VectorXd residual;
  Eigen::VectorXd light;       ///< by which a lamp's jitter is to be multiplied; 0 where it does not enter
  Eigen::VectorXd weight;      ///< 1 = by noise alone, with which the fit stands there
  Eigen::MatrixXd jacobian;    ///< of the residual, by all unknowns
  Eigen::MatrixXd covariance;  ///< of these, with those weights
};

/// The jitter as a share of the lamp's brightness, a half-normal prior of `kLampJitter` times the restricted likelihood
/// of the means (H. D. Patterson & R. Thompson, Biometrika 58, 545 (1971)).
struct LampJitter {
  double share = 0;       ///< the posterior's median; where the frames do not show it, at most what they cannot exclude
  bool shown = false;     ///< noise alone would make such a likelihood in one of fifty fits
  Eigen::VectorXd wider;  ///< standard errors of the unknowns over the posterior, in units of those at `share`
};
/// Places at which a jitter is looked at, from none to the largest that still is a lamp's.
inline constexpr int kLampPlaces = 120;
double lamp_place(int i);

LampJitter lamp_jitter(const FrameMeans& means);

}  // namespace birefit::estimation
