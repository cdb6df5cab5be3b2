#pragma once
// Director fields whose numbers depend on each other (docs/configuration.md); the others are read as they are
// described.

#include "birefit/scene.h"
#include "io/config_reader.h"

namespace birefit {

/// Each from the block of its key in `parent`. Mistakes go to the reader's problems.
UniformDirector read_uniform(ConfigReader& reader, const Block& parent);
AxialDirector read_axial(ConfigReader& reader, const Block& parent);
FreederickszDirector read_freedericksz(ConfigReader& reader, const Block& parent);
HelixDirector read_helix(ConfigReader& reader, const Block& parent);

}  // namespace birefit
