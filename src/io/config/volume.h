#pragma once
// The sampled director field of a config: `volume`.

#include "birefit/scene.h"
#include "io/config/reader.h"

namespace birefit {

SampledVolume read_sampled_volume(ConfigReader& reader, const Block& sample);

}  // namespace birefit
