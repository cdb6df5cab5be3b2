#pragma once
// The pictures that whole frames are timed on: the source paper's three scenes and a droplet whose modes couple.

#include <string>
#include <vector>

#include "birefit/scene.h"

namespace birefit::study {

/// 500 x 500 pixels between crossed polarizers.
struct FrameScene {
  std::string name;
  ParameterTable table;
  Scene scene;
  /// eight (a slab given as a profile: seven) that a fit might search, the likeliest first
  std::vector<int> parameters;
};
/// hedgehog (E12, 9 um), twisted_droplet, e44_plate (0.8 mm under heat, cone of 15 degrees), evaluation_slab (0.45 mm,
/// the same cone).
std::vector<FrameScene> frame_scenes();

}  // namespace birefit::study
