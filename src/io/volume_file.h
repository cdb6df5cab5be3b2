#pragma once
// Director fields from files: NumPy arrays (.npy) and VTK image data (.vti). Formats: docs/configuration.md, "Sampled
// fields".

#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "birefit/error.h"
#include "birefit/volume.h"

namespace birefit {

struct VolumeRequest {
  std::filesystem::path path;
  Where where;                                      ///< of the config entry, for what is wrong with the request
  bool x_first = false;                             ///< .npy: array[x, y, z] instead of array[z, y, x]
  std::optional<std::array<double, 3>> spacing_um;  ///< .npy: needed; .vti: not allowed, the file says it
  /// order of the bulk, in the units of the file's S or Q; 0 = the largest in the file
  double bulk_order = 0;
};

struct LoadedVolume {
  std::shared_ptr<const VolumeGrid> grid;
  double bulk_order = 1;              ///< what the order was divided by
  std::vector<std::string> warnings;  ///< directors that were not of unit length, ..
};

/// Throws UserError naming the file, the array and, for a bad value, the place [x, y, z] of the first (nodes, from 0).
LoadedVolume load_volume(const VolumeRequest& request);

}  // namespace birefit
