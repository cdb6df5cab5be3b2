#pragma once
// The block `micrograph` of a config: what it gives to every image.

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "birefit/measurement.h"
#include "io/config/mosaic.h"
#include "io/config/pages.h"
#include "io/config/pixels.h"
#include "io/config/reader.h"

namespace birefit {

/// What the `micrograph:` block gives to every image.
struct MicrographSettings {
  std::optional<std::string> image;
  Where image_where;
  PageChoice page;
  std::string channel;  ///< "rgb": all three, each a picture of its own
  Where channel_where;
  /// Of `rgb`, what a colour has for itself, by its name: maps of parameter paths.
  std::map<std::string, const YamlNode*> channels;
  MosaicSettings mosaic;
  Transfer transfer;
  ParameterRef pixel_size_um;  ///< none: the file's
  ParameterRef gain, offset, center_x, center_y, rotation;
  std::vector<UnevenLight> uneven;
  bool offset_automatic = false;
  std::optional<PixelRect> roi;
  Where roi_where;
  int bin = 1;  ///< pixels of the file along a side of one of the picture
  Where bin_where;
  std::optional<std::string> mask;
  Where mask_where;
  std::optional<double> saturation_counts;
  std::optional<NoiseModel> noise;
  /// Calibration frames: without light; of all light that there is (`parallel` or `flat`); between crossed polarizers.
  std::optional<std::string> dark, light, crossed;
  Where dark_where, light_where, crossed_where;
  bool calibrated() const { return dark || light; }
  bool metadata_ignored = false;  ///< the file's word on objective, light and size counts for nothing
  Where where;
};

/// Of a scene whose sample is read. Mistakes go to the reader's problems.
MicrographSettings read_micrograph(ConfigReader& reader, const Block& root, const Scene& scene, Quantity quantity);
/// The same of each picture that a file makes by its colours; of a single one the settings themselves.
std::vector<MicrographSettings> by_channel(const MicrographSettings& settings);
/// `roi_px` of a block; nothing without it, and with a problem.
std::optional<PixelRect> read_roi(ConfigReader& reader, const Block& block, Where& where);
/// An automatic gain: a negative one would pass off dark fringes as bright ones, half an order away.
void keep_positive(Parameter& gain);
/// The two sizes of a pixel in words: "0.1 x 0.12 um".
std::string not_square(double x_um, double y_um);

}  // namespace birefit
