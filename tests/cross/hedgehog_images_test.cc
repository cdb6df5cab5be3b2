// The peers' voxel images of a radial droplet approach the straight-ray closed form at first order in their voxels.

#include <gtest/gtest.h>

#include "profiles.h"
#include "reference_table.h"

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
        LawColumn<double, RadialLaw<double>> column(RadialLaw<double>{Chord<double>(b, half, radius), n_o * n_o, n_e * n_e});
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

}  // namespace
}  // namespace birefit
