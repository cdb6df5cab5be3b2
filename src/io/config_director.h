#pragma once
// Director fields of cells in an applied field: `freedericksz` and `helix` of docs/configuration.md.

#include "birefit/scene.h"
#include "io/config_reader.h"

namespace birefit {

FreederickszDirector read_freedericksz(ConfigReader& reader, const Block& parent);
HelixDirector read_helix(ConfigReader& reader, const Block& parent);

}  // namespace birefit
