#pragma once
// Director fields from files: NumPy arrays (.npy, .npz), VTK's image data (.vti) and legacy files (.vtk), the text of
// open-Qmin. Formats: docs/configuration.md, "Sampled fields".

#include <memory>
#include <string>
#include <vector>

#include "birefit/volume.h"
#include "io/fields/request.h"

namespace birefit {

struct LoadedVolume {
  std::shared_ptr<const VolumeGrid> grid;
  double bulk_order = 1;              ///< what the order was divided by
  std::vector<std::string> warnings;  ///< directors that were not of unit length, ..
};

/// Throws UserError naming the file, the array and, for a bad value, the place [x, y, z] of the first (nodes, from 0).
LoadedVolume load_volume(const VolumeRequest& request);

}  // namespace birefit
