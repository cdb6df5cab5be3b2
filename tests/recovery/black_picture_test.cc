// A black picture among others has no noise of its own. Truth: a uniform retarder between polarizers.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <random>
#include <string>

#include "birefit/fit.h"
#include "scene_builder.h"

namespace birefit {
namespace {
using namespace testing;

constexpr int kSide = 24;
constexpr double kThickness = 10, kWavelength = 0.55;

struct Retarder {
  double azimuth_deg, birefringence;

  double intensity(double polarizer_deg, double analyzer_deg) const {
    const double deg = M_PI / 180, p = (polarizer_deg - azimuth_deg) * deg, a = (analyzer_deg - azimuth_deg) * deg,
                 half = M_PI * kThickness * birefringence / kWavelength;
    return std::pow(std::cos(p - a), 2) - std::sin(2 * p) * std::sin(2 * a) * std::pow(std::sin(half), 2);
  }
};

/// Azimuth and birefringence from pictures at these angles, of values that `record` makes of the light.
template <class Record>
FitResult fit_of(const Retarder& truth, const std::vector<std::array<double, 2>>& angles, const Record& record) {
  TableBuilder b;
  Scene scene;
  Cell cell;
  cell.thickness_um = b.fixed("thickness_um", kThickness);
  cell.director =
      UniformDirector{.azimuth_deg = b.fitted("azimuth_deg", 25, 0, 45), .tilt_deg = b.fixed("tilt_deg", 0)};
  scene.sample = cell;
  scene.material = ConstantIndices{b.fixed("ordinary", 1.5), b.fitted("birefringence", 0.012, 0.005, 0.025)};
  scene.surround_index = b.fixed("surround", 1.5);
  scene.microscope.wavelength_nm = b.fixed("wavelength_nm", 1000 * kWavelength);
  scene.view.width = scene.view.height = kSide;
  scene.view.rotation_deg = b.fixed("rotation", 0);
  const ParameterRef gain = b.linear("gain", 200), offset = b.linear("offset", 0);
  FitJob job;
  for (const auto& [p, a] : angles) {
    Scene here = scene;
    const std::string name = "micrographs[" + std::to_string(job.measurements.size()) + "].";
    here.microscope.polarizer_deg = b.fixed(name + "polarizer_deg", p);
    here.microscope.analyzer_deg = b.fixed(name + "analyzer_deg", a);
    std::vector<double> values(kSide * kSide);
    for (double& v : values) v = record(truth.intensity(p, a));
    Picture picture = micrograph_of(name, here, std::move(values), gain, offset, {});
    picture.noise.reset();  // estimated from the images, as a user would
    job.measurements.push_back(std::move(picture));
  }
  job.parameters = b.table;
  job.demand.ceiling = Ceiling::e_only;
  job.options.threads = 1;
  return fit(job);
}

std::vector<std::array<double, 2>> random_angles(int pictures, std::mt19937_64& random) {
  std::uniform_real_distribution<double> angle(0, 180);
  std::vector<std::array<double, 2>> angles;
  for (int k = 0; k < pictures; ++k) angles.push_back({angle(random), angle(random)});
  return angles;
}

// Dark is dark, where a background was subtracted and what was negative is 0.
TEST(BlackPicture, IsOneOfThem) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  const Retarder truth{22, 0.013};
  std::vector<std::array<double, 2>> angles = random_angles(8, random);
  angles.push_back({truth.azimuth_deg, truth.azimuth_deg + 90});
  const FitResult r = fit_of(
      truth, angles, [&](double light) { return light < 1e-9 ? 0 : std::round(200 * light + 2 * normal(random)); });
  ASSERT_TRUE(r.has_answer()) << r.verdict;
  EXPECT_TRUE(holds(r, "azimuth_deg", truth.azimuth_deg)) << r.verdict;
  EXPECT_TRUE(holds(r, "birefringence", truth.birefringence)) << r.verdict;
}

}  // namespace
}  // namespace birefit
