#pragma once
// A picture as a choice of pixels.

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "birefit/io.h"

namespace birefit {

struct LoadedMask {
  Mask selected;                   ///< 1 = use the pixel; of the region asked for
  int width = 0, height = 0;       ///< of the file's picture
  std::vector<std::string> notes;  ///< the reader's, and what was taken as selected
};

/// Any picture of any depth or lookup table: pixels of value 0 are left out. `load`: load_image() or what takes its
/// place. Throws UserError as it does.
LoadedMask load_mask(const ImageRequest& request,
                     const std::function<LoadedImage(const ImageRequest&)>& load = load_image);

}  // namespace birefit
