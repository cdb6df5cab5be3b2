// The pitch of a cholesteric cell from six grey levels. Truth: the closed form of a uniform twist at normal incidence
// (with E = R(alpha) E', alpha = alpha_0 + q z, dE'/dz = (i k dn/2 sigma_z + q epsilon) E' but for the common phase),
// which ceiling e_only is exactly.

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <complex>
#include <random>

#include "birefit/fit.h"
#include "scene_builder.h"

namespace birefit {
namespace {
using namespace testing;

constexpr double kThickness = 12, kBirefringence = 0.1, kGain = 1000, kNoise = 10;

double light(double pitch_um, double azimuth_deg, double polarizer_deg, double analyzer_deg, double wavelength_um) {
  const double degree = M_PI / 180, half = M_PI * kBirefringence * kThickness / wavelength_um,
               turn = 2 * M_PI * kThickness / pitch_um, x = std::hypot(half, turn);
  const double c = std::cos(x), s = std::sin(x) / x, in = polarizer_deg * degree - azimuth_deg * degree,
               out = analyzer_deg * degree - azimuth_deg * degree - turn;
  const std::complex<double> along(c, s * half);
  const std::complex<double> ex = along * std::cos(in) + turn * s * std::sin(in),
                             ey = -turn * s * std::cos(in) + std::conj(along) * std::sin(in);
  return std::norm(std::cos(out) * ex + std::sin(out) * ey);
}

FitJob pitch_job(double pitch_um, double azimuth_deg, std::mt19937_64& random) {
  TableBuilder b;
  HelixDirector helix;
  std::uniform_real_distribution<double> between(-1, 1);
  const double sign = pitch_um > 0 ? 1 : -1, size = std::abs(pitch_um);
  helix.pitch_um =
      b.fitted("pitch_um", pitch_um * (1 + 0.1 * between(random)), std::min(sign * 0.8 * size, sign * 1.25 * size),
               std::max(sign * 0.8 * size, sign * 1.25 * size));
  helix.azimuth_deg = b.fitted("azimuth_deg", azimuth_deg + 5 * between(random), azimuth_deg - 20, azimuth_deg + 20);
  Scene scene;
  scene.sample = Cell{b.fixed("thickness_um", kThickness), helix};
  scene.material = ConstantIndices{b.fixed("ordinary", 1.5), b.fixed("birefringence", kBirefringence)};
  scene.surround_index = b.fixed("surround", 1.5);
  scene.view.width = scene.view.height = 1;
  scene.view.rotation_deg = b.fixed("rotation_deg", 0);
  const ParameterRef gain = b.fixed("gain", kGain), offset = b.fixed("offset", 0);
  FitJob job;
  std::normal_distribution<double> noise(0, kNoise);
  for (const double wavelength_nm : {480.0, 560.0, 650.0})
    for (const std::array<double, 2>& between_deg : {std::array{0.0, 90.0}, {30.0, 75.0}}) {
      Scene here = scene;
      const std::string name = std::to_string(wavelength_nm) + " " + std::to_string(between_deg[0]);
      here.microscope.wavelength_nm = b.fixed("wavelength_nm " + name, wavelength_nm);
      here.microscope.polarizer_deg = b.fixed("polarizer_deg " + name, between_deg[0]);
      here.microscope.analyzer_deg = b.fixed("analyzer_deg " + name, between_deg[1]);
      job.measurements.push_back(micrograph_of(
          name, here,
          {kGain * light(pitch_um, azimuth_deg, between_deg[0], between_deg[1], wavelength_nm / 1000) + noise(random)},
          gain, offset, {kNoise, 0}));
    }
  job.parameters = b.table;
  job.demand.ceiling = Ceiling::e_only;
  job.options.threads = 1;
  return job;
}

// Both hands; spreads of 60 numbers are known to 9 %.
TEST(HelixRecovery, PitchAndAzimuthScatterAsTheirErrorsSay) {
  std::mt19937_64 random(31);
  Spread pitch, azimuth;
  for (int i = 0; i < 60; ++i) {
    const double of = (i % 2 ? -1 : 1) * std::uniform_real_distribution<double>(14, 30)(random),
                 at = std::uniform_real_distribution<double>(10, 60)(random);
    const FitResult r = fit(pitch_job(of, at, random));
    ASSERT_TRUE(r.has_answer()) << of << ' ' << at << ": " << r.verdict;
    pitch.add(find_estimate(r, "pitch_um")->value - of, find_estimate(r, "pitch_um")->stderr_);
    azimuth.add(find_estimate(r, "azimuth_deg")->value - at, find_estimate(r, "azimuth_deg")->stderr_);
    // A hundredth of the light at slopes of some ten radians: known to a few per cent at the worst.
    EXPECT_LT(pitch.stderr_.back(), 0.05 * std::abs(of));
  }
  for (const Spread* s : {&pitch, &azimuth}) {
    EXPECT_LT(s->worst(), 5);
    EXPECT_NEAR(s->ratio(), 1, 0.3);
    EXPECT_LT(std::abs(s->bias()), 4 / std::sqrt(60.0));
  }
}

}  // namespace
}  // namespace birefit
