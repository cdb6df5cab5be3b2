#pragma once
// Which pixels of a micrograph take part in a fit, with their values and weights.

#include <array>
#include <cstddef>
#include <vector>

#include "birefit/fit.h"

namespace birefit::estimation {

/// Column and row of every pixel that takes part, in a fixed order.
using Pixels = std::vector<std::array<int, 2>>;

/// The pixels of one micrograph that take part, in a fixed order.
struct PixelSet {
  Pixels pixels;
  Eigen::VectorXd value, sigma;
  double shared_sd = 0;  ///< of an error that is the same in all of them, units of the values
};

/// Pixels the mask leaves and whose value and weight are numbers.
Pixels usable_pixels(const Picture& micrograph, const Image& sigma);

PixelSet pixel_set(const Picture& micrograph, const Image& sigma, Pixels pixels);

/// A fixed part of the pixels that meets every region: multiples of the golden section leave no gap longer than
/// 2.6 times the mean (Knuth, TAOCP 6.4) and, unlike a stride, cannot lock to a row length.
Pixels subsample(const Pixels& pixels, std::size_t wanted);

}  // namespace birefit::estimation
