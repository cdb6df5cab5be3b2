#pragma once
// Materials that follow a law: from a file of refractiveindex.info, inline coefficients, a preset, with temperature.

#include "birefit/scene.h"
#include "io/config/reader.h"

namespace birefit {

/// Keys of `material:` that only law materials have, beside ordinary, birefringence, name and temperature_k.
const std::vector<std::string>& law_material_keys();
/// Whether the block asks for one of these.
bool is_law_material(const Block& material);
Material read_law_material(ConfigReader& reader, const Block& material, const Sample& sample);
/// Keys of form birefringence, one of which, `structure`, asks for it.
const std::vector<std::string>& form_material_keys();
Material read_form_material(ConfigReader& reader, const Block& material);
/// `surround: {file: ..}`.
std::optional<Dispersion> read_surround_file(ConfigReader& reader, const Block& surround);
/// When the microscope has been read too: wavelength and temperatures with their bounds within what the laws cover,
/// indices that a transparent medium can have.
void check_material_ranges(ConfigReader& reader, const Block& root, const Scene& scene);

}  // namespace birefit
