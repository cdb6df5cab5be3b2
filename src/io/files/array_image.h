#pragma once
// Pictures that are arrays of the program that asks.

#include <string>

#include "birefit/in_memory.h"
#include "birefit/io.h"

namespace birefit {

/// What load_image() would read of a file with these samples, which states nothing else. `request.path` is the array's
/// name. Throws UserError: no pixels, too many, colour channels and none chosen, a page.
LoadedImage load_array(const ImageRequest& request, const ArrayImage& array);

/// SHA-256 of the samples, row after row, as 64 hexadecimal digits.
std::string sha256(const ArrayImage& array);

}  // namespace birefit
