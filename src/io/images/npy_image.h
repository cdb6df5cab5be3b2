#pragma once
// Images as NumPy's arrays, files .npy.

#include <span>
#include <string>

#include "birefit/io.h"

namespace birefit {

/// What numpy.save writes of an array of float64, (rows, columns) of one channel, (rows, columns, channels) of several
/// of one size: a file .npy, to the bit.
std::string encode_npy(std::span<const Image> channels);

/// How many pictures such a file holds: of (pictures, rows, columns) or (pictures, rows, columns, channels), up to four
/// channels; 0 where it holds none.
std::size_t npy_pictures(const std::filesystem::path& file);

/// What load_image() promises of such a file. Work and memory are of the rows that are asked for; of an array whose
/// first index runs fastest, of the whole file.
LoadedImage load_npy(const ImageRequest& request);

}  // namespace birefit
