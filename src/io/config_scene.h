#pragma once
// The parts of a config that describe the scene: sample, material, surround, microscope, accuracy, physics, transport.

#include "birefit/scene.h"
#include "io/config_reader.h"

namespace birefit {

/// Everything of a Scene but its view. Mistakes go to the reader's problems; the scene then holds stand-ins.
Scene read_scene(ConfigReader& reader, const Block& root);

}  // namespace birefit
