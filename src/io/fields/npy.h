#pragma once
// NumPy arrays: .npy, and several of them in a .npz.
// https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html

#include <string>

#include "io/fields/raw_volume.h"

namespace birefit::fields {

RawVolume read_npy(const std::string& content, const VolumeRequest& request);
/// The array `request.array`, else n, Q, director or the only one there is; with it S and domain_mask where they are.
RawVolume read_npz(const std::string& content, const VolumeRequest& request);

}  // namespace birefit::fields
