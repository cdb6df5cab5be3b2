#pragma once
// Raw photographs (DNG, CR2, NEF, ..): files whose first picture is a small one for browsing, the real one a mosaic of
// colour filters.

#include <filesystem>
#include <optional>
#include <string>

#include "birefit/image.h"
#include "io/images/tiff_tags.h"

namespace birefit {

/// Is it one by the tags of its first page? A DNG whose first page is the whole picture in colours is none.
bool is_raw_photograph(const TiffTags& tags);

struct RawPhotograph {
  Image counts;         ///< of every photosite, without its black level taken off, rows and columns as on the sensor
  std::string pattern;  ///< "rggb", .., of its first cell; "" = no cells of 2 x 2 (X-Trans, ..)
};

/// By LibRaw, where OpenImageIO was built with it; nothing where it was not, or does not know the camera.
std::optional<RawPhotograph> read_raw_photograph(const std::filesystem::path& path);

}  // namespace birefit
