#pragma once
// The parts of a config that describe the scene: sample, material, surround, microscope, accuracy, physics, transport.

#include "birefit/scene.h"
#include "io/config/reader.h"

namespace birefit {

/// Everything of a Scene but its view. Mistakes go to the reader's problems; the scene then holds stand-ins.
Scene read_scene(ConfigReader& reader, const Block& root);
/// The focus is fitted, or not on the mid plane: something that only waves know.
bool is_defocused(const ConfigReader& reader, const Scene& scene);
/// Says so of a defocused scene that is to be done by rays.
void add_defocus_problem(ConfigReader& reader, const Scene& scene);

}  // namespace birefit
