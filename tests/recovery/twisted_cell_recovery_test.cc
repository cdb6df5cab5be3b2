// A 90-degree twisted cell: retardance and twist from six uniform images and two of the empty field. Truth: the closed
// matrix of a uniform twist (Yeh & Gu, Optics of Liquid Crystal Displays, 4.1), written here; ceiling e_only, whose
// transport it is exactly.

#include <gtest/gtest.h>

#include <cstdio>
#include <map>

#include "birefit/fit.h"
#include "independent_cell.h"
#include "independent_droplet.h"  // camera()
#include "scene_builder.h"

namespace birefit {
namespace {
using namespace testing;

constexpr int kSide = 32;
constexpr double kGain = 1000, kOffset = 50, kThickness = 5, kBirefringence = 0.13, kTwistDeg = 90, kAzimuthDeg = 10,
                 kWavelength = 0.55;

constexpr IndependentCell kCell{kThickness, kBirefringence, kTwistDeg, kAzimuthDeg, kWavelength};

FitJob cell_job(double counts_per_photon, double read_counts, unsigned long seed) {
  TableBuilder b;
  Scene scene;
  Cell cell;
  cell.thickness_um = b.fixed("thickness_um", kThickness);
  TwistedDirector director;
  director.twist_deg = b.fitted("twist_deg", 80, 60, 120);
  director.azimuth_deg = b.fixed("azimuth_deg", kAzimuthDeg);
  director.pretilt_deg = b.fixed("pretilt_deg", 0);
  cell.director = director;
  scene.sample = cell;
  scene.material = ConstantIndices{b.fixed("ordinary", 1.5), b.fitted("birefringence", 0.12, 0.09, 0.17)};
  scene.surround_index = b.fixed("surround", 1.5);
  scene.microscope.wavelength_nm = b.fixed("wavelength_nm", 1000 * kWavelength);
  scene.view.width = scene.view.height = kSide;
  scene.view.rotation_deg = b.fixed("rotation", 0);
  const ParameterRef gain = b.linear("gain", 900), offset = b.linear("offset", 0);
  FitJob job;
  int k = 0;
  for (const auto& [p, a] :
       {std::pair{0.0, 0.0}, {0.0, 90.0}, {45.0, 45.0}, {45.0, 135.0}, {20.0, 80.0}, {70.0, 10.0}}) {
    Scene here = scene;
    here.microscope.polarizer_deg = b.fixed("polarizer_" + std::to_string(k), p);
    here.microscope.analyzer_deg = b.fixed("analyzer_" + std::to_string(k), a);
    const std::vector<double> mean(kSide * kSide, kOffset + kGain * kCell.intensity(p, a));
    job.measurements.push_back(
        micrograph_of("image " + std::to_string(k), here,
                      camera(mean, counts_per_photon, read_counts, 1000 * seed + static_cast<unsigned long>(k), false),
                      gain, offset, {read_counts, counts_per_photon}));
    ++k;
  }
  // The empty field between parallel and crossed polarizers fixes gain and offset; without it six images between linear
  // polarizers leave three combinations of gain, offset, twist and birefringence that no data can tell apart.
  const ParameterRef none = b.fixed("no_birefringence", 0);
  std::get<ConstantIndices>(scene.material).birefringence = none;
  for (const double a : {0.0, 90.0}) {
    Scene here = scene;
    here.microscope.polarizer_deg = b.fixed("polarizer_" + std::to_string(k), 0);
    here.microscope.analyzer_deg = b.fixed("analyzer_" + std::to_string(k), a);
    const std::vector<double> mean(kSide * kSide, kOffset + (a == 0 ? kGain : 0));
    job.measurements.push_back(
        micrograph_of("empty " + std::to_string(k), here,
                      camera(mean, counts_per_photon, read_counts, 1000 * seed + static_cast<unsigned long>(k), false),
                      gain, offset, {read_counts, counts_per_photon}));
    ++k;
  }
  job.parameters = b.table;
  job.demand.ceiling = Ceiling::e_only;
  job.options.threads = 1;
  return job;
}

std::map<std::string, Spread> recover(double counts_per_photon, double read_counts, int seeds) {
  std::map<std::string, Spread> spread;
  for (int seed = 1; seed <= seeds; ++seed) {
    const FitResult r = fit(cell_job(counts_per_photon, read_counts, static_cast<unsigned long>(seed)));
    EXPECT_TRUE(r.has_answer()) << "seed " << seed << ": " << r.verdict;
    if (seed == 1) std::printf("  covariance: %s\n", r.covariance_kind.c_str());
    for (const auto& [name, value] : {std::pair{"birefringence", kBirefringence}, std::pair{"twist_deg", kTwistDeg},
                                      std::pair{"gain", kGain}, std::pair{"offset", kOffset}}) {
      const ParameterEstimate* p = find_estimate(r, name);
      EXPECT_LT(std::abs(p->value - value), 5 * p->stderr_) << name << " seed " << seed << " " << p->value;
      spread[name].add(p->value - value, p->stderr_);
    }
  }
  for (const auto& [name, s] : spread)
    std::printf("  photon %g read %g %-14s spread/stderr %.3f bias %.2f worst %.2f (stderr %.2g)\n", counts_per_photon,
                read_counts, name.c_str(), s.ratio(), s.bias(), s.worst(), s.stderr_[0]);
  return spread;
}

TEST(TwistedCellRecovery, RetardanceAndTwistAreWithinFiveStandardErrors) { recover(1, 3, 12); }

class LongTwistedCellRecovery : public ::testing::TestWithParam<std::pair<double, double>> {};
TEST_P(LongTwistedCellRecovery, StandardErrorsAreTheSpread) {
  for (const auto& [name, s] : recover(GetParam().first, GetParam().second, 200))
    EXPECT_NEAR(s.ratio(), 1, 0.2) << name;
}
INSTANTIATE_TEST_SUITE_P(ThreeNoiseLevels, LongTwistedCellRecovery,
                         ::testing::Values(std::pair{0.3, 1.5}, std::pair{1.0, 3.0}, std::pair{5.0, 12.0}));

}  // namespace
}  // namespace birefit
