// Fits of what polarizing parts are set to: a compensator beside a droplet, a leaking analyser behind a cell.

#include <gtest/gtest.h>

#include <cmath>

#include "birefit/fit.h"
#include "birefit/render.h"
#include "independent_cell.h"
#include "independent_droplet.h"  // camera()
#include "scene_builder.h"

namespace birefit {
namespace {
using namespace testing;

constexpr double kGain = 2000, kOffset = 50;

// The phase and the azimuth of a compensator are found with the droplet's own numbers, from starts that are 20 and 8
// degrees off. (What a plate does to any sample's light is the laws' business, parts_test.cc.)
TEST(PartsRecovery, ACompensatorBesideADroplet) {
  constexpr int kSide = 64;
  constexpr double kPhase = 110, kAzimuth = 33, kDiameter = 7.3, kBirefringence = 0.18;
  TableBuilder b;
  Scene scene;
  Droplet droplet;
  droplet.diameter_um = b.fitted("diameter_um", 7.2, 6, 9);
  scene.sample = droplet;
  scene.material = ConstantIndices{b.fixed("ordinary", 1.52), b.fitted("birefringence", 0.17, 0.1, 0.25)};
  scene.surround_index = b.fixed("surround", 1.47);
  scene.microscope.wavelength_nm = b.fixed("wavelength_nm", 560);
  scene.microscope.polarizer_deg = b.fixed("polarizer_deg", 10);
  scene.microscope.analyzer_deg = b.fixed("analyzer_deg", 100);
  Retarder compensator;
  compensator.phase_deg = b.fitted("phase_deg", kPhase - 20, 30, 180);
  compensator.azimuth_deg = b.fitted("compensator_azimuth_deg", kAzimuth + 8, 0, 60);
  scene.microscope.behind.emplace_back(compensator);
  scene.view.width = scene.view.height = kSide;
  scene.view.pixel_size_um = b.fixed("pixel_size_um", 0.15);
  scene.view.center_x_px = b.fixed("center_x", 31.2), scene.view.center_y_px = b.fixed("center_y", 31.9);
  const ParameterRef gain = b.linear("gain", 1000), offset = b.linear("offset", 0);
  Theta truth = b.table.values();
  const auto set = [&](ParameterRef ref, double value) { truth[static_cast<std::size_t>(ref.index)] = value; };
  set(droplet.diameter_um, kDiameter), set(compensator.phase_deg, kPhase), set(compensator.azimuth_deg, kAzimuth);
  set(std::get<ConstantIndices>(scene.material).birefringence, kBirefringence);
  std::vector<double> mean = render(scene, plan(scene, truth), truth).intensity.values();
  for (double& value : mean) value = kOffset + kGain * value;
  constexpr double kRead = 10, kPerPhoton = 0.5;
  FitJob job;
  job.measurements.push_back(
      micrograph_of("image", scene, camera(mean, kPerPhoton, kRead, 5, false), gain, offset, {kRead, kPerPhoton}));
  job.parameters = b.table;
  job.options.threads = 1;
  const FitResult r = fit(job);
  ASSERT_TRUE(r.has_answer()) << r.verdict;
  for (const auto& [name, value] : {std::pair{"phase_deg", kPhase}, std::pair{"compensator_azimuth_deg", kAzimuth},
                                    std::pair{"diameter_um", kDiameter}, std::pair{"birefringence", kBirefringence}}) {
    const ParameterEstimate* p = find_estimate(r, name);
    EXPECT_LT(std::abs(p->value - value), 5 * p->stderr_) << name << ' ' << p->value << " +- " << p->stderr_;
    EXPECT_LT(p->stderr_, 0.05 * value) << name;
  }
}

// The aperture of the objective, of a droplet by waves: the exact series and propagation.
TEST(PartsRecovery, TheApertureOfADropletByWaves) {
  for (const bool bipolar : {false, true}) {
    constexpr int kSide = 48;
    constexpr double kAperture = 0.62, kDiameter = 4.1;
    TableBuilder b;
    Scene scene;
    Droplet droplet;
    droplet.diameter_um = b.fitted("diameter_um", 4.0, 3.5, 4.6);
    if (bipolar) droplet.director = BipolarDirector{b.fixed("poles_deg", 20), b.fixed("tilt_deg", 0), {}};
    scene.sample = droplet;
    scene.material = ConstantIndices{b.fixed("ordinary", 1.52), b.fixed("birefringence", 0.15)};
    scene.surround_index = b.fixed("surround", 1.5);
    scene.microscope.wavelength_nm = b.fixed("wavelength_nm", 560);
    scene.microscope.polarizer_deg = b.fixed("polarizer_deg", 0);
    scene.microscope.analyzer_deg = b.fixed("analyzer_deg", 90);
    scene.microscope.objective_na = b.fitted("objective_na", 0.58, 0.5, 0.7);
    scene.view.width = scene.view.height = kSide;
    scene.view.pixel_size_um = b.fixed("pixel_size_um", 0.15);
    scene.view.center_x_px = b.fixed("center_x", 23.2), scene.view.center_y_px = b.fixed("center_y", 23.9);
    const ParameterRef gain = b.linear("gain", 1000), offset = b.linear("offset", 0);
    Theta truth = b.table.values();
    truth[static_cast<std::size_t>(droplet.diameter_um.index)] = kDiameter;
    truth[static_cast<std::size_t>(scene.microscope.objective_na.index)] = kAperture;
    std::vector<double> mean = render(scene, plan(scene, {.ceiling = Ceiling::wave}, truth), truth).intensity.values();
    for (double& value : mean) value = kOffset + kGain * value;
    constexpr double kRead = 5, kPerPhoton = 0.5;
    FitJob job;
    job.demand.ceiling = Ceiling::wave;
    job.measurements.push_back(
        micrograph_of("image", scene, camera(mean, kPerPhoton, kRead, 7, false), gain, offset, {kRead, kPerPhoton}));
    job.parameters = b.table;
    job.options.threads = 1;
    const FitResult r = fit(job);
    ASSERT_TRUE(r.has_answer()) << r.verdict;
    const ParameterEstimate* p = find_estimate(r, "objective_na");
    EXPECT_LT(std::abs(p->value - kAperture), 5 * p->stderr_) << bipolar << ' ' << p->value << " +- " << p->stderr_;
    EXPECT_LT(p->stderr_, 0.05) << bipolar;
  }
}

/// A twisted cell behind a leaking analyser at several azimuths; truth by the closed matrix of a uniform twist: the
/// light of the analyser and, divided by the ratio, of one across it.
FitJob leaking_cell(double ratio, bool known_light) {
  constexpr int kSide = 24;
  const IndependentCell truth{5, 0.13, 90, 10, 0.55};
  TableBuilder b;
  Scene scene;
  Cell cell;
  cell.thickness_um = b.fixed("thickness_um", truth.thickness_um);
  TwistedDirector director;
  director.twist_deg = b.fixed("twist_deg", truth.twist_deg);
  director.azimuth_deg = b.fixed("azimuth_deg", truth.azimuth_deg);
  director.pretilt_deg = b.fixed("pretilt_deg", 0);
  cell.director = director;
  scene.sample = cell;
  scene.material = ConstantIndices{b.fixed("ordinary", 1.5), b.fixed("birefringence", truth.birefringence)};
  scene.surround_index = b.fixed("surround", 1.5);
  scene.microscope.wavelength_nm = b.fixed("wavelength_nm", 1000 * truth.wavelength_um);
  scene.microscope.analyzer_extinction_ratio = b.fitted("extinction_ratio", 40, 2, 2000);
  scene.view.width = scene.view.height = kSide;
  const ParameterRef gain = known_light ? b.fixed("gain", kGain) : b.linear("gain", 1500),
                     offset = known_light ? b.fixed("offset", kOffset) : b.linear("offset", 0);
  FitJob job;
  job.demand.ceiling = Ceiling::e_only;
  unsigned long seed = 3;
  for (const double analyzer : {0.0, 30.0, 60.0, 90.0, 120.0}) {
    scene.microscope.polarizer_deg = b.fixed("polarizer_deg", 20);
    scene.microscope.analyzer_deg = b.fixed("analyzer_deg", analyzer);
    const double light = truth.intensity(20, analyzer) + truth.intensity(20, analyzer + 90) / ratio;
    const std::vector<double> mean(kSide * kSide, kOffset + kGain * light);
    job.measurements.push_back(micrograph_of("analyser at " + std::to_string(analyzer), scene,
                                             camera(mean, 0.5, 5, seed++, false), gain, offset, {5, 0.5}));
  }
  job.parameters = b.table;
  job.options.threads = 1;
  return job;
}

TEST(PartsRecovery, TheExtinctionOfAnAnalyserWhereTheLightIsKnown) {
  constexpr double kRatio = 25;
  const FitResult r = fit(leaking_cell(kRatio, true));
  ASSERT_TRUE(r.has_answer()) << r.verdict;
  const ParameterEstimate* p = find_estimate(r, "extinction_ratio");
  EXPECT_LT(std::abs(p->value - kRatio), 5 * p->stderr_) << p->value << " +- " << p->stderr_;
  EXPECT_LT(p->stderr_, 0.2 * kRatio);
}

// A cell loses no light: a leak of 1/X is an offset of 1/X and a loss of gain of as much, and nothing else.
TEST(PartsRecovery, AnExtinctionBesideAFreeGainAndOffsetIsNotIdentifiable) {
  const FitResult r = fit(leaking_cell(25, false));
  EXPECT_FALSE(r.identifiable) << r.verdict;
  const ParameterEstimate* p = find_estimate(r, "extinction_ratio");
  EXPECT_TRUE(std::isnan(p->stderr_)) << p->value << " +- " << p->stderr_;
}

}  // namespace
}  // namespace birefit
