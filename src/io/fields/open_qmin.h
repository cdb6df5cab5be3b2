#pragma once
// The text that open-Qmin writes: a line a lattice site, x y z Qxx Qxy Qxz Qyy Qyz type S, with Q = 3/2 S (n n - 1/3).
// https://github.com/sussmanLab/open-Qmin

#include <string>

#include "io/fields/raw_volume.h"

namespace birefit::fields {

RawVolume read_open_qmin(const std::string& content, const VolumeRequest& request);

}  // namespace birefit::fields
