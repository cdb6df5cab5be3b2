#include "io/config/metadata.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace birefit {
namespace {

/// A number that the config states and does not fit; 0 of any other.
double stated(const ConfigReader& reader, ParameterRef ref) {
  if (!ref || reader.table[ref].free || reader.table.tie_of(ref.index)) return 0;
  return ref.in(reader.table.values());
}

}  // namespace

void compare_metadata(ConfigReader& reader, const LoadedImage& file, const std::string& name, const Where& where,
                      bool ignored, const Scene& scene) {
  if (ignored) return;
  // As far off as engravings and names of filters are from what they stand for, and no farther.
  constexpr double kSameNa = 0.02, kSameLight = 0.03, kSameSize = 0.05;
  const auto refuse = [&](const std::string& of_file, const std::string& of_config) {
    reader.problems.add(where, fmt::format("{}: by its OME metadata {}, and {}", name, of_file, of_config),
                        "correct the one that is wrong; micrograph: {metadata: ignore} takes the config's word");
  };
  const double na = stated(reader, scene.microscope.objective_na);
  if (na > 0 && file.objective_na > 0 && std::abs(file.objective_na / na - 1) > kSameNa)
    refuse(fmt::format("it was taken through an objective of NA {:g}", file.objective_na),
           fmt::format("microscope.objective_na is {:g}", na));
  const double nm = scene.microscope.channel_light ? 0 : stated(reader, scene.microscope.wavelength_nm);
  const double width = scene.microscope.bandwidth_nm ? stated(reader, scene.microscope.bandwidth_nm) : 0;
  if (nm > 0 && file.emission_nm > 0 && std::abs(file.emission_nm - nm) > std::max(kSameLight * nm, 0.5 * width))
    refuse(fmt::format("it was taken in light of {:g} nm", file.emission_nm),
           fmt::format("microscope.light.wavelength_nm is {:g}", nm));
  const double um = scene.view.file.bin == 1 ? stated(reader, scene.view.pixel_size_um) : 0;
  if (um > 0 && file.pixel_size_um > 0 && std::abs(file.pixel_size_um / um - 1) > kSameSize)
    reader.warnings.push_back(
        fmt::format("{}: the file states pixels of {:.4g} um, the config of {:.4g} um: the "
                    "config's are taken.",
                    name, file.pixel_size_um, um));
}

}  // namespace birefit
