// A droplet computed by independent_droplet.h, noise drawn by the standard library, fitted by birefit.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <map>

#include "birefit/fit.h"
#include "independent_droplet.h"
#include "scene_builder.h"

namespace birefit {
namespace {
using namespace testing;

constexpr int kSize = 84;
constexpr double kGain = 1000, kOffset = 40;

const IndependentDroplet& truth() {
  static const IndependentDroplet droplet = [] {
    IndependentDroplet d;
    d.center_x_px = 41.7;
    d.center_y_px = 41.2;
    d.pixel_um = 0.15;
    return d;
  }();
  return droplet;
}

/// Noiseless counts. The ring is tabulated in t = sqrt(1 - rho/R), which resolves the rim: linear interpolation between
/// 8,000 nodes is within 1e-5, far below the noise of the brightest pixel (0.03).
const std::vector<double>& mean_counts() {
  static const std::vector<double> counts = [] {
    const IndependentDroplet& d = truth();
    // Grazing rays leave turned by 2 (90 degrees - arcsin m): the image is wider than the droplet.
    const double grazing = 2 * (M_PI / 2 - std::asin(d.n_host / d.n_o));
    const double radius = d.diameter_um / 2 / std::cos(grazing);
    constexpr int kNodes = 8000, kSub = 15;
    std::vector<double> ring(kNodes + 1);
    for (int i = 0; i <= kNodes; ++i) {
      const double t = static_cast<double>(i) / kNodes;
      ring[static_cast<std::size_t>(i)] = d.ring(radius * (1 - t * t));
    }
    std::vector<double> image;
    for (int row = 0; row < kSize; ++row)
      for (int column = 0; column < kSize; ++column) {
        double sum = 0;
        for (int j = 0; j < kSub; ++j)
          for (int i = 0; i < kSub; ++i) {
            const double x = (column - 0.5 + (i + 0.5) / kSub - d.center_x_px) * d.pixel_um;
            const double y = (d.center_y_px - (row - 0.5 + (j + 0.5) / kSub)) * d.pixel_um;
            const double rho2 = x * x + y * y, rho = std::sqrt(rho2);
            if (rho >= radius) continue;
            const double t = std::sqrt(1 - rho / radius) * kNodes;
            const std::size_t k = std::min<std::size_t>(static_cast<std::size_t>(t), kNodes - 1);
            const double f = t - static_cast<double>(k);
            const double sine = rho2 > 0 ? 2 * x * y / rho2 : 0;  // sin 2 phi, polarizer along x
            sum += sine * sine * (ring[k] * (1 - f) + ring[k + 1] * f);
          }
        image.push_back(kOffset + kGain * sum / (kSub * kSub));
      }
    return image;
  }();
  return counts;
}

FitJob droplet_job(double counts_per_photon, double read_counts, unsigned long seed) {
  TableBuilder b;
  Scene scene;
  Droplet droplet;
  droplet.diameter_um = b.fitted("diameter_um", 9.2, 8.7, 9.9);
  scene.sample = droplet;
  scene.material = ConstantIndices{b.fixed("ordinary", 1.52), b.fitted("birefringence", 0.21, 0.15, 0.30)};
  scene.surround_index = b.fixed("surround", 1.43);
  scene.microscope.wavelength_nm = b.fixed("wavelength_nm", 590);
  scene.microscope.polarizer_deg = b.fixed("polarizer_deg", 0);
  scene.microscope.analyzer_deg = b.fixed("analyzer_deg", 90);
  scene.view.width = scene.view.height = kSize;
  scene.view.pixel_size_um = b.fixed("pixel_size_um", 0.15);
  scene.view.center_x_px = b.fitted("center_x", 41, 38, 45);
  scene.view.center_y_px = b.fitted("center_y", 42, 38, 45);
  scene.view.rotation_deg = b.fixed("rotation", 0);
  const ParameterRef gain = b.linear("gain", 900), offset = b.linear("offset", 0);
  FitJob job;
  job.measurements.push_back(micrograph_of("droplet", scene,
                                           camera(mean_counts(), counts_per_photon, read_counts, seed, false), gain,
                                           offset, {read_counts, counts_per_photon}));
  job.parameters = b.table;
  job.options.threads = 1;
  return job;
}

const std::map<std::string, double>& true_values() {
  static const std::map<std::string, double> values{{"diameter_um", 9.3}, {"birefringence", 0.22}, {"center_x", 41.7},
                                                    {"center_y", 41.2},   {"gain", kGain},         {"offset", kOffset}};
  return values;
}

/// Fits `seeds` noisy images and checks that nothing lies beyond 5 standard errors.
std::map<std::string, Spread> recover(double counts_per_photon, double read_counts, int seeds) {
  std::map<std::string, Spread> spread;
  for (int seed = 1; seed <= seeds; ++seed) {
    const FitResult r = fit(droplet_job(counts_per_photon, read_counts, static_cast<unsigned long>(seed)));
    EXPECT_TRUE(r.has_answer()) << "seed " << seed << ": " << r.verdict;
    EXPECT_NEAR(r.reduced_chi_square, 1, 0.1) << "seed " << seed;
    for (const auto& [name, value] : true_values()) {
      const ParameterEstimate* p = find_estimate(r, name);
      if (!p) {
        ADD_FAILURE() << "no estimate of " << name;
        return spread;
      }
      EXPECT_LT(std::abs(p->value - value), 5 * p->stderr_) << name << " seed " << seed;
      spread[name].add(p->value - value, p->stderr_);
    }
  }
  for (const auto& [name, s] : spread)
    std::printf("  photon %g read %g %-14s spread/stderr %.3f bias %.2f worst %.2f (stderr %.2g)\n", counts_per_photon,
                read_counts, name.c_str(), s.ratio(), s.bias(), s.worst(), s.stderr_.empty() ? 0 : s.stderr_[0]);
  return spread;
}

// The two computations agree before any fit is judged: half a percent of the incident light at the worst pixel (the
// rim, where 15 x 15 midpoints and birefit's Gauss points see the end of the light differently), 1e-3 RMS.
TEST(DropletRecovery, TruthIsTheRenderedImage) {
  const FitJob job = droplet_job(1, 3, 1);
  Theta theta = job.parameters.values();
  for (const auto& [name, value] : true_values())
    if (const ParameterRef ref = job.parameters.find(name)) theta[static_cast<std::size_t>(ref.index)] = value;
  const Scene& scene = picture(job, 0).scene;
  const Rendering r = render(scene, plan(scene, theta), theta);
  double sum = 0, worst = 0;
  int at = 0;
  for (std::size_t i = 0; i < r.intensity.size(); ++i) {
    const double d = r.intensity.values()[i] - (mean_counts()[i] - kOffset) / kGain;
    sum += d * d;
    if (std::abs(d) > worst) worst = std::abs(d), at = static_cast<int>(i);
  }
  const double rms = std::sqrt(sum / static_cast<double>(r.intensity.size()));
  std::printf("  render against truth: rms %.2g, worst %.2g at column %d row %d\n", rms, worst, at % kSize, at / kSize);
  EXPECT_LT(rms, 1e-3);
  EXPECT_LT(worst, 5e-3);
}

TEST(DropletRecovery, EveryEstimateIsWithinFiveStandardErrors) { recover(1, 3, 12); }

// All lengths of a picture scale with the size of a pixel, and retardances do with lengths: a known diameter or a known
// birefringence tells it, a picture alone does not.
TEST(DropletRecovery, ThePixelSizeByWhatIsKnownOfTheDroplet) {
  for (const char* known : {"diameter_um", "birefringence", ""}) {
    FitJob job = droplet_job(1, 3, 7);
    Parameter& size = job.parameters[job.parameters.find("pixel_size_um")];
    size.free = true, size.value = 0.148, size.lower = 0.135, size.upper = 0.165;
    if (*known) {
      Parameter& given = job.parameters[job.parameters.find(known)];
      given.free = false, given.value = true_values().at(known);
    }
    const FitResult r = fit(job);
    if (!*known) {
      EXPECT_FALSE(r.identifiable) << r.verdict;
      continue;
    }
    ASSERT_TRUE(r.has_answer()) << known << ": " << r.verdict;
    std::map<std::string, double> truths = true_values();
    truths.erase(known);
    truths["pixel_size_um"] = truth().pixel_um;
    for (const auto& [name, value] : truths) {
      const ParameterEstimate* p = find_estimate(r, name);
      ASSERT_NE(p, nullptr) << name;
      EXPECT_LT(std::abs(p->value - value), 5 * p->stderr_) << name << ", " << known << " known";
    }
    EXPECT_LT(find_estimate(r, "pixel_size_um")->stderr_, 1e-3 * truth().pixel_um);
  }
}

// 200 repetitions know a standard deviation to 1/sqrt(400) = 5 %: 20 % is four of those.
class LongDropletRecovery : public ::testing::TestWithParam<std::pair<double, double>> {};
TEST_P(LongDropletRecovery, StandardErrorsAreTheSpread) {
  const auto [counts_per_photon, read_counts] = GetParam();
  for (const auto& [name, s] : recover(counts_per_photon, read_counts, 200)) {
    EXPECT_NEAR(s.ratio(), 1, 0.2) << name;
  }
}
INSTANTIATE_TEST_SUITE_P(ThreeNoiseLevels, LongDropletRecovery,
                         ::testing::Values(std::pair{0.3, 1.5}, std::pair{1.0, 3.0}, std::pair{5.0, 12.0}));

}  // namespace
}  // namespace birefit
