// Curved rays of the radial droplet against independent integration (tests/data/physics/README.md) and limits.

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "birefit/fit.h"
#include "independent_droplet.h"
#include "reference_table.h"
#include "render/eikonal.h"
#include "scene_builder.h"

namespace birefit {
namespace {
using namespace testing;

DropletOptics<double> droplet(double n_o, double n_e, double n_host) {
  DropletOptics<double> o;
  o.radius_um = 1;
  o.n_o = n_o, o.n_e = n_e, o.n_host = n_host;
  o.ratio = n_host / n_o;
  o.k0 = 1;
  return o;
}

// The table's rays enter at b and are seen at its apparent radius under its exit angle; its path error is the eikonal phase
// difference less that of a straight chord at the same place. Printed with six digits.
TEST(EikonalDroplet, RaysAgreeWithIndependentOnes) {
  const ReferenceTable table(data_path("physics/hedgehog_eray_midplane.csv"));
  for (std::size_t row = 0; row < table.size(); ++row) {
    const double n_o = table.number(row, "no"), n_e = table.number(row, "ne"), b = table.number(row, "b_entry_over_R");
    const DropletOptics<double> o = droplet(n_o, n_e, n_o);
    const double seen = table.number(row, "apparent_b_midplane_over_R");
    if (!(seen < 0.999)) continue;
    const EikonalRay<double> ray = eikonal_ray(o, eikonal_fan(o, true), seen, 0);
    ASSERT_GT(ray.amplitude, 0) << b;
    EXPECT_NEAR(std::acos(ray.cos_turn) * 180 / std::numbers::pi, std::abs(table.number(row, "exit_angle_deg")), 1e-4 + 60e-6 / (1 - seen)) << b;
    const double difference = ray.phase_rad - eikonal_ray(o, eikonal_fan(o, false), seen, 0).phase_rad;
    const double chord = table.number(row, "chord_retardance_over_R");
    EXPECT_NEAR(difference - chord, table.number(row, "path_error_straight_chord_over_R"), 3e-6 / (1 - seen)) << b;
  }
}

// As the birefringence vanishes both modes run on the ordinary ray.
TEST(EikonalDroplet, WithoutBirefringenceBothModesAreOne) {
  const DropletOptics<double> o = droplet(1.52, 1.52, 1.43);
  for (double rho : {0.05, 0.4, 0.8}) {
    const EikonalRay<double> p = eikonal_ray(o, eikonal_fan(o, true), rho, 0), s = eikonal_ray(o, eikonal_fan(o, false), rho, 0);
    EXPECT_NEAR(p.phase_rad, s.phase_rad, 1e-12);
    EXPECT_NEAR(p.cos_turn, s.cos_turn, 1e-12);
  }
}

/// An E12 droplet in a host of its ordinary index, 128 x 128 pixels, with the birefringence free or known.
struct Job {
  TableBuilder b;
  Scene scene;
  ParameterRef birefringence;
  Job(double diameter_um, Rays rays, bool free, int size) {
    Droplet d;
    d.diameter_um = b.fixed("diameter_um", diameter_um);
    scene.sample = d;
    scene.rays = rays;
    birefringence = free ? b.fitted("birefringence", 0.215, 0.19, 0.24) : b.fixed("birefringence", 0.22);
    ConstantIndices m;
    m.ordinary = b.fixed("ordinary", 1.52);
    m.birefringence = birefringence;
    scene.material = m;
    scene.surround_index = b.fixed("index", 1.52);
    scene.microscope.wavelength_nm = b.fixed("wavelength_nm", 590);
    scene.microscope.polarizer_deg = b.fixed("polarizer_deg", 0);
    scene.microscope.analyzer_deg = b.fixed("analyzer_deg", 90);
    scene.view.width = scene.view.height = size;
    scene.view.pixel_size_um = 1.1 * diameter_um / size;
    scene.view.center_x_px = b.fixed("center_x", 0.5 * size - 0.6);
    scene.view.center_y_px = b.fixed("center_y", 0.5 * size - 0.2);
  }
};

/// Birefringence from the image of curved rays, the middle of the droplet (0.1 to 0.7 R), by a model of `rays`.
FitResult fit_of(double diameter_um, Rays rays, int size) {
  const Job truth(diameter_um, Rays::eikonal, false, size);
  const Theta theta = truth.b.table.values();
  const Image image = render(truth.scene, plan(truth.scene, theta), theta, {}, 1).intensity;
  std::vector<double> counts;
  for (double i : image.values()) counts.push_back(100 + 3000 * i);
  Job job(diameter_um, rays, true, size);
  Micrograph m = micrograph_of("image", job.scene, camera(counts, 0.5, 4, 3), job.b.linear("gain", 3000), job.b.linear("offset", 100), {4, 0.5});
  for (int r = 0; r < size; ++r)
    for (int c = 0; c < size; ++c) {
      const double radius = std::hypot(c - (0.5 * size - 0.6), r - (0.5 * size - 0.2)) * job.scene.view.pixel_size_um / (diameter_um / 2);
      if (radius < 0.1 || radius > 0.7) m.mask(c, r) = 0;
    }
  FitJob fit_job;
  fit_job.parameters = job.b.table;
  fit_job.micrographs = {m};
  return fit(fit_job);
}
ParameterEstimate fitted(double diameter_um, Rays rays) { return *find_estimate(fit_of(diameter_um, rays, 128), "birefringence"); }

// physics.md of the design: chord fits come out about 0.2 dn too low, relative, whatever the size: -4 % for E12.
TEST(EikonalDroplet, StraightChordsFittedToCurvedRaysGiveFourPercentTooLittleAtAnySize) {
  for (double diameter_um : {9.3, 30.0}) {
    const ParameterEstimate chord = fitted(diameter_um, Rays::straight), curved = fitted(diameter_um, Rays::eikonal);
    EXPECT_NEAR(chord.value / 0.22 - 1, -0.04, 0.012) << diameter_um;
    // The residual gives away a part of it only: fits compare with curved rays for a reason.
    EXPECT_GT(std::abs(chord.value - 0.22), 5 * chord.stderr_) << diameter_um;
    EXPECT_LT(std::abs(curved.value - 0.22), 4 * curved.stderr_) << diameter_um;
  }
}

// A fit of straight chords says where curved rays would put the birefringence: on all pixels of a small image, on a part of a
// large one (680 x 680, of which 140,000 pixels are used).
TEST(EikonalDroplet, AFitOfChordsForetellsTheBirefringenceOfCurvedRays) {
  for (const int size : {128, 680}) {
    const FitResult result = fit_of(9.3, Rays::straight, size);
    double foretold = 0;
    for (const std::string& warning : result.warnings)
      if (const std::size_t at = warning.find("would put birefringence at "); at != std::string::npos) foretold = std::stod(warning.substr(at + 27));
    EXPECT_NEAR(foretold, 0.22, 0.0005) << size;
    EXPECT_LT(find_estimate(result, "birefringence")->value, 0.217) << size;
  }
}

}  // namespace
}  // namespace birefit
