#pragma once
// A radial droplet of 9.3 um in 96 x 96 pixels, and the counts of a camera: what is done to its pictures is the test's.

#include <algorithm>
#include <optional>
#include <random>

#include "birefit/fit.h"
#include "birefit/render.h"
#include "scene_builder.h"

namespace birefit::testing {

inline constexpr int kSize = 96;
inline constexpr double kGain = 1000, kOffset = 40, kDiameter = 9.3, kBirefringence = 0.22;

/// A droplet and the job to fit it; the table's values are the truth until start() is called.
struct Droplet96 {
  TableBuilder b;
  Scene scene;
  Picture m;
  std::optional<Scene> nature;  ///< where it is not what the fit takes it for
  Demand natural;               ///< how nature makes its picture
  ParameterRef diameter, birefringence, center_x, center_y, polarizer, analyzer, gain, offset;

  Droplet96() {
    birefit::Droplet droplet;
    droplet.diameter_um = diameter = b.fitted("diameter_um", kDiameter, 8.7, 9.9);
    scene.sample = droplet;
    scene.material = ConstantIndices{b.fixed("ordinary", 1.52),
                                     birefringence = b.fitted("birefringence", kBirefringence, 0.15, 0.30)};
    scene.surround_index = b.fixed("surround", 1.43);
    scene.microscope.wavelength_nm = b.fixed("wavelength_nm", 590);
    scene.microscope.polarizer_deg = polarizer = b.fixed("polarizer_deg", 0);
    scene.microscope.analyzer_deg = analyzer = b.fixed("analyzer_deg", 90);
    scene.view.width = scene.view.height = kSize;
    scene.view.pixel_size_um = b.fixed("pixel_size_um", 0.13);
    scene.view.center_x_px = center_x = b.fitted("center_x", 47.7, 42, 53);
    scene.view.center_y_px = center_y = b.fitted("center_y", 47.2, 42, 53);
    scene.view.rotation_deg = b.fixed("rotation", 0);
    gain = b.linear("gain", kGain);
    offset = b.linear("offset", kOffset);
  }
  /// Intensity of a pixel with the table's values.
  Image light() const {
    const Theta theta = b.table.values();
    const Scene& seen = nature ? *nature : scene;
    return render(seen, plan(seen, natural, theta), theta, {}, 1).intensity;
  }
};

using Random = std::mt19937_64;
/// Counts with photon and read noise.
inline void expose(Image& counts, Random& random) {
  std::normal_distribution<double> normal;
  for (double& v : counts.values())
    v = static_cast<double>(std::poisson_distribution<long>(std::max(v, 0.0))(random)) + 3 * normal(random);
}

}  // namespace birefit::testing
