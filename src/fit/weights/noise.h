#pragma once
// How much one pixel's value scatters: from the user's noise model, or from the image itself.

#include "birefit/fit.h"

namespace birefit::estimation {

/// Read and photon noise (in counts) from the differences between neighbouring pixels, whatever the fringes do.
/// With `fitted` (the model's image in the same values) the differences are those of the residual, which no fringe
/// fills: fringes finer than about six pixels look like noise in the image itself.
NoiseModel estimate_noise(const Picture& micrograph, const Image* fitted = nullptr);
/// Mean variance of the usable pixels' values under a model.
double mean_variance(const Picture& micrograph, const NoiseModel& noise, const Image& signal);

/// Mean of the usable pixels of each 3 x 3 neighbourhood: a first guess of the signal.
Image smoothed(const Picture& micrograph);

/// Standard deviation of every pixel's value, given the signal (units of the values); never zero.
Image standard_deviation(const Picture& micrograph, const NoiseModel& noise, const Image& signal);

}  // namespace birefit::estimation
