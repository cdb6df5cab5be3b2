#pragma once
// Images as NumPy's arrays.

#include <span>
#include <string>

#include "birefit/image.h"

namespace birefit {

/// What numpy.save writes of an array of float64, (rows, columns) of one channel, (rows, columns, channels) of several
/// of one size: a file .npy, to the bit.
std::string encode_npy(std::span<const Image> channels);

}  // namespace birefit
