#pragma once
// Images as NumPy's arrays.

#include <string>

#include "birefit/image.h"

namespace birefit {

/// What numpy.save writes of an array of float64 with image.height() rows: a file .npy, to the bit.
std::string encode_npy(const Image& image);

}  // namespace birefit
