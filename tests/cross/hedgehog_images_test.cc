// The peers' voxel images of a radial droplet approach the straight-ray closed form at first order in their voxels.

#include <gtest/gtest.h>

#include "birefit/fit.h"
#include "medium/families/radial.h"
#include "profiles.h"
#include "reference_table.h"
#include "scene_builder.h"

namespace birefit {
namespace {
using namespace testing;

/// Relative RMS of a raw I45 image against straight unrefracted chords: 9 um, 1.52/1.74 in 1.52, box 12.8 um, 590 nm.
/// flux: every ray enters and leaves its column through flat faces, Fresnel 4 n_o n_eff/(n_o + n_eff)^2 on the e wave.
double relative_rms(const std::string& file, bool flux) {
  const Image image = read_pfm(data_path("peers/images/" + file));
  const int n = image.width();
  const double box = 12.8, radius = 4.5, n_o = 1.52, n_e = 1.74, k0 = 2 * std::numbers::pi / 0.59;
  double sum = 0, size = 0;
  for (int r = 0; r < n; ++r)
    for (int c = 0; c < n; ++c) {
      const double x = (c - (n - 1) / 2.0) * box / n, y = ((n - 1) / 2.0 - r) * box / n;
      const double b = std::hypot(x, y);
      double expected = 0;
      if (b < radius) {
        const double half = std::sqrt(radius * radius - b * b);
        LawColumn<double, RadialLaw<double>> column(
            RadialLaw<double>{Chord<double>(b, half, radius), n_o * n_o, n_e * n_e});
        column.planar = true;
        const Su2<double> u = Diagonal<double>().retarder(column, {k0, 0, 0, Continuity::e_and_h}, uniform_mesh(32));
        const double sin2 = b * b / (radius * radius);  // angle of axis and ray where the ray enters
        const double n_eff = 1 / std::sqrt((1 - sin2) / (n_o * n_o) + sin2 / (n_e * n_e));
        const double t = flux ? 4 * n_o * n_eff / std::pow(n_o + n_eff, 2) : 1;
        const std::complex<double> e(u.w * t, u.z * t), o(u.w, -u.z);
        // polarizer at 45 degrees, analyser crossed: |e - o|^2 cos^2(2 azimuth) / 4
        expected = 0.25 * std::norm(e - o) * std::pow(std::cos(2 * std::atan2(y, x)), 2);
      }
      sum += std::pow(image(c, r) - expected, 2);
      size += expected * expected;
    }
  return std::sqrt(sum / size);
}

TEST(PeerHedgehog, VoxelImagesApproachTheClosedFormsAtFirstOrder) {
  const double pure_50 = relative_rms("droplet_n152_jones_nz50_raw_I45.pfm", false);
  const double pure_200 = relative_rms("droplet_n152_jones_nz200_raw_I45.pfm", false);
  EXPECT_LT(pure_200, 0.03);  // their README: 0.021 at 200 slices, 0.089 at 50
  EXPECT_GT(pure_50 / pure_200, 3.0);
  EXPECT_LT(pure_50 / pure_200, 5.5);
  const double flux_50 = relative_rms("droplet_n152_tmm2x2_1_nz50_raw_I45.pfm", true);
  const double flux_200 = relative_rms("droplet_n152_tmm2x2_1_nz200_raw_I45.pfm", true);
  EXPECT_LT(flux_200, 0.035);
  EXPECT_GT(flux_50 / flux_200, 2.5);
}

Scene scene_of_beam_propagation(TableBuilder& b, int size, double diameter_um, double birefringence) {
  Scene scene;
  Droplet droplet;
  droplet.diameter_um = b.fitted("diameter_um", diameter_um, 8, 10);
  scene.sample = droplet;
  scene.material = ConstantIndices{b.fixed("ordinary", 1.52), b.fitted("birefringence", birefringence, 0.15, 0.3)};
  scene.surround_index = b.fixed("index", 1.52);
  scene.microscope.wavelength_nm = b.fixed("wavelength_nm", 590);
  scene.microscope.polarizer_deg = b.fixed("polarizer_deg", 45);
  scene.microscope.analyzer_deg = b.fixed("analyzer_deg", 135);
  scene.microscope.objective_na = b.fixed("objective_na", 0.8);
  scene.view.width = scene.view.height = size;
  scene.view.pixel_size_um = b.fixed("pixel_size_um", 12.8 / size);
  scene.view.center_x_px = scene.view.center_y_px = b.fixed("center", 0.5 * (size - 1));
  return scene;
}

/// Diameter, birefringence and gain of the beam-propagation image (wide-angle, 200 slices, NA 0.8, focused on the mid
/// plane), by one ray model. Its own errors are 1 to 5 % of Maxwell's; 2 % stands for the noise.
FitResult fit_of_beam_propagation(Rays rays, bool choose = false) {
  const Image image = read_pfm(data_path("peers/images/droplet_n152_bpm_nz200_centreNA0.8_I45.pfm"));
  TableBuilder b;
  const Scene scene = scene_of_beam_propagation(b, image.width(), 9.1, 0.21);
  FitJob job;
  const ParameterRef gain = b.linear("gain", 1), offset = b.fixed("offset", 0);
  job.measurements.push_back(micrograph_of("bpm", scene, image.values(), gain, offset, {0.02, 0}));
  job.parameters = b.table;
  job.demand.rays = rays;
  job.options.choose_rays = choose;
  return fit(job);
}

/// Relative RMS of that image from the model's at the true numbers.
double distance_from_beam_propagation(Rays rays) {
  const Image image = read_pfm(data_path("peers/images/droplet_n152_bpm_nz200_centreNA0.8_I45.pfm"));
  TableBuilder b;
  const Scene scene = scene_of_beam_propagation(b, image.width(), 9, 0.22);
  const Theta theta = b.table.values();
  const Image ours = render(scene, plan(scene, {.rays = rays}, theta), theta, {}, 1).intensity;
  double sum = 0, size = 0;
  for (std::size_t i = 0; i < image.size(); ++i)
    sum += std::pow(ours.values()[i] - image.values()[i], 2), size += std::pow(image.values()[i], 2);
  return std::sqrt(sum / size);
}

TEST(PeerHedgehog, CurvedRaysAreFourTimesNearerToBeamPropagation) {
  const double straight = distance_from_beam_propagation(Rays::straight),
               curved = distance_from_beam_propagation(Rays::eikonal);
  EXPECT_NEAR(straight, 0.36, 0.03);  // their README
  EXPECT_LT(curved, straight / 3.5);
}

// What straight rays get wrong on a droplet of 23 wavelengths is their straightness more than their being rays.
TEST(PeerHedgehog, CurvedRaysFindWhatBeamPropagationWasGiven) {
  const FitResult straight = fit_of_beam_propagation(Rays::straight), curved = fit_of_beam_propagation(Rays::eikonal);
  const auto off = [](const FitResult& r, const char* name, double truth) {
    return find_estimate(r, name)->value / truth - 1;
  };
  for (const auto& [name, r] : {std::pair{"straight", &straight}, {"curved", &curved}})
    std::printf("  %s rays: diameter %.3f um, birefringence %.4f, gain %.3f, reduced chi-square %.2f\n", name,
                find_estimate(*r, "diameter_um")->value, find_estimate(*r, "birefringence")->value,
                find_estimate(*r, "gain")->value, r->reduced_chi_square);
  EXPECT_LT(off(straight, "birefringence", 0.22), -0.05);
  // Diffraction remains, and 1 to 5 % of the image's own errors.
  EXPECT_NEAR(off(curved, "birefringence", 0.22), 0, 0.005);
  EXPECT_NEAR(off(curved, "diameter_um", 9), 0, 0.006);
  EXPECT_NEAR(off(curved, "gain", 1), 0, 0.02);
  EXPECT_LT(curved.chi_square, 0.25 * straight.chi_square);
  // The straight fit says so.
  EXPECT_TRUE(std::any_of(straight.warnings.begin(), straight.warnings.end(),
                          [](const std::string& w) { return w.find("Curved") != std::string::npos; }));
}

// `rays: auto`: curved rays are taken where they describe the image better, and left where they do not.
TEST(PeerHedgehog, AFitGoesOverToCurvedRaysOnlyWhereTheyAreNoWorse) {
  const FitResult chosen = fit_of_beam_propagation(Rays::straight, true),
                  curved = fit_of_beam_propagation(Rays::eikonal);
  EXPECT_NEAR(find_estimate(chosen, "birefringence")->value, find_estimate(curved, "birefringence")->value,
              0.01 * curved.parameters[0].stderr_);
  TableBuilder b;
  const Scene scene = scene_of_beam_propagation(b, 128, 9, 0.22);
  FitJob job;
  const ParameterRef gain = b.linear("gain", 1), offset = b.fixed("offset", 0);
  const Theta theta = b.table.values();
  const Image image = render(scene, plan(scene, theta), theta, {}, 1).intensity;
  job.measurements.push_back(micrograph_of("straight", scene, image.values(), gain, offset, {0.02, 0}));
  job.parameters = b.table;
  job.options.choose_rays = true;
  const FitResult straight = fit(job);
  EXPECT_NEAR(find_estimate(straight, "birefringence")->value, 0.22, 1e-4);
  EXPECT_FALSE(std::any_of(straight.warnings.begin(), straight.warnings.end(),
                           [](const std::string& w) { return w.find("Curved") != std::string::npos; }));
}

}  // namespace
}  // namespace birefit
