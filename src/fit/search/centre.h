#pragma once
// Where a picture that looks the same upside down has its middle.

#include <array>
#include <optional>

#include "birefit/image.h"

namespace birefit::estimation {

/// The point (column, row) about which turning by 180 degrees changes the picture least, wherever the sample is in the
/// image: the maximum of sum I(r) I(2c - r), which by Cauchy and Schwarz is c where I(2c - r) = I(r); I is taken from
/// the values at the image's border. Where none of the border is used, the region lies within the sample (a disc inside
/// its rim): the maximum of the same sum over pairs that are both used, at least half of them, in units of their
/// squares. To about a hundredth of the image's longer side. Nothing for an image without usable values or of one
/// value.
std::optional<std::array<double, 2>> centre_of_symmetry(const Image& values, const Mask& used);

}  // namespace birefit::estimation
