#pragma once
// The block `microscope` of a config.

#include "birefit/scene.h"
#include "io/config/reader.h"

namespace birefit {

/// Of a scene whose sample and material are read. Mistakes go to the reader's problems.
void read_microscope(ConfigReader& reader, const Block& root, Scene& scene);

}  // namespace birefit
