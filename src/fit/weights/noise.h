#pragma once
// How much one pixel's value scatters: from the user's noise model, or from the image itself.

#include <vector>

#include "birefit/fit.h"

namespace birefit::estimation {

/// Read and photon noise (in counts) from the differences between neighbouring pixels, whatever the fringes do.
/// With `fitted` (the model's image in the same values) the differences are those of the residual, which no fringe
/// fills: fringes finer than about six pixels look like noise in the image itself.
/// `squares`: by mean squares in place of medians, in units of what each pixel expects, which tells a variance 1.6
/// times as well where the model leaves nothing over, and is misled by what it leaves.
NoiseModel estimate_noise(const Picture& micrograph, const Image* fitted = nullptr, bool squares = false);
/// Those of the pixels that a mask leaves, as far as they are numbers.
std::vector<double> usable_values(const Picture& picture);
/// Mean variance of the usable pixels' values under a model.
double mean_variance(const Picture& micrograph, const NoiseModel& noise, const Image& signal);

/// What rounding does to pictures of even light that were taken by one camera (units of the values).
struct CoarseCodes {
  double step = 0;       ///< of neighbouring codes, all pictures together; 0: values are not rounded, or calibrated
  double shared_sd = 0;  ///< of an error that all pixels of a picture share: less, the more of a code noise is
  double pixel_sd = 0;   ///< of a pixel's value about its light: noise and rounding
};
CoarseCodes coarse_codes(const std::vector<const Picture*>& pictures);

/// Mean of the usable pixels of each 3 x 3 neighbourhood: a first guess of the signal.
Image smoothed(const Picture& micrograph);

/// Standard deviation of every pixel's value, given the signal (units of the values); never zero.
Image standard_deviation(const Picture& micrograph, const NoiseModel& noise, const Image& signal);

}  // namespace birefit::estimation
