#pragma once
// Material files of refractiveindex.info, as they are there: one ray a file, YAML.

#include <filesystem>
#include <optional>
#include <vector>

#include "birefit/scene.h"
#include "io/config/yaml.h"

namespace birefit {

struct MaterialFile {
  Dispersion law;
  std::vector<double> k_wavelength_um, k;  ///< imaginary part of the index, where the file has one
  std::optional<double> temperature_k;     ///< of its CONDITIONS
};

/// Reads a file of refractiveindex.info: formulas 1 to 9, `tabulated n`, `nk` and `k`. Wavelengths in um. Throws
/// UserError naming the file and line; `asked` is the place that names the file.
MaterialFile load_material_file(const std::filesystem::path& path, const Where& asked);

}  // namespace birefit
