#pragma once
// From image files to the pictures of a fit: what calibration frames, masks, regions and mosaics make of their pixels.

#include <optional>
#include <string>
#include <vector>

#include "io/config/micrograph.h"
#include "io/images/mask.h"

namespace birefit {

/// The calibration frames as what a micrograph needs of them.
struct Calibration {
  int width = 0, height = 0;  ///< of the files; all else is of the region that was read
  Image dark;                 ///< counts in linear light; empty: nothing is subtracted
  int dark_bits = 0;          ///< that counts of the dark frame are stored in: 8 or 16; 0: other values, or no frame
  Image light;                ///< the frame of light less dark; empty: nothing divides
  Mask usable;
  Mask saturated;
  double crossed_median = 0, crossed_sd = 0;
  bool has_crossed = false;
  std::string name;  ///< of its first frame, for messages about its size
  Where where;
};

/// An image file as the settings ask for it, with the reader's remarks among the warnings; none with a problem.
std::optional<LoadedImage> try_load(ConfigReader& reader, const MicrographSettings& settings,
                                    const std::filesystem::path& file, PageChoice page, const Where& where);
/// The frames that the settings name; none with a problem.
std::optional<Calibration> load_calibration(ConfigReader& reader, const MicrographSettings& settings);
/// The mask that the settings name; none without, and with a problem.
std::optional<LoadedMask> load_user_mask(ConfigReader& reader, const MicrographSettings& settings);
/// The reader's remarks on a file, to the warnings.
void say(ConfigReader& reader, const std::filesystem::path& file, const std::vector<std::string>& notes);
/// The picture with its pixels, or those that a mosaic holds; none when a problem left nothing to work with.
std::vector<Picture> pictures_of(ConfigReader& reader, const MicrographSettings& settings,
                                 const Calibration* calibration, const LoadedMask* user_mask, LoadedImage image,
                                 const Where& where, const Picture& micrograph);
/// Replaces a reference everywhere in a scene, or in a picture with its light.
void replace_ref(Scene& scene, ParameterRef from, ParameterRef to);
void replace_ref(Picture& micrograph, ParameterRef from, ParameterRef to);

}  // namespace birefit
