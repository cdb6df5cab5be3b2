#pragma once
// `birefit new KIND --image FILE`: the config of a kind with what a file tells filled in.

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "birefit/io.h"
#include "io/kinds/kinds.h"

namespace birefit {

/// What a user says of an image beside what its file tells; nothing of it is needed.
struct Stated {
  std::string file_name;                        ///< what the config calls the image; empty: as it was opened
  double pixel_um = 0;                          ///< of a pixel on the sample; 0: not stated
  std::optional<std::array<double, 3>> circle;  ///< around the object: its centre and radius, in the file's pixels
  std::optional<PixelRect> region;              ///< what of it is to be looked at
};

struct FilledConfig {
  std::string text;
  std::vector<std::string> found;    ///< what the file told
  std::vector<std::string> missing;  ///< what it does not tell and no fit finds out: to be stated before `fit` runs
  std::vector<std::string> assumed;  ///< what the config takes as known: to be looked at
};

/// Throws UserError: the file cannot be read, or the kind takes no image.
FilledConfig config_from_image(const Kind& kind, const std::string& file, const Stated& stated = {});

/// The file as it can be read: its first page, its green channel, where it has several.
struct OpenedImage {
  LoadedImage image;
  bool first_page = false;
};
/// Throws UserError where it cannot be read.
OpenedImage open_image(const std::string& file);

}  // namespace birefit
