#pragma once
// What an image's file states of itself against what the config states.

#include "birefit/io.h"
#include "io/config/reader.h"

namespace birefit {

/// A problem where the file was taken through another objective or in other light than the scene has, unless
/// `micrograph.metadata: ignore` says that the file is wrong; a warning of another pixel size. `name`: of the image.
void compare_metadata(ConfigReader& reader, const LoadedImage& file, const std::string& name, const Where& where,
                      bool ignored, const Scene& scene);

}  // namespace birefit
