#pragma once
// How much one pixel's value scatters: from the user's noise model, or from the image itself.

#include "birefit/fit.h"

namespace birefit::estimation {

/// Read and photon noise (in counts) from the differences between neighbouring pixels, whatever the fringes do.
NoiseModel estimate_noise(const Micrograph& micrograph);

/// Mean of the usable pixels of each 3 x 3 neighbourhood: a first guess of the signal.
Image smoothed(const Micrograph& micrograph);

/// Standard deviation of every pixel's value, given the signal (units of the values); never zero.
Image standard_deviation(const Micrograph& micrograph, const NoiseModel& noise, const Image& signal);

}  // namespace birefit::estimation
