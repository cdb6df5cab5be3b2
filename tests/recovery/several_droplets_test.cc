// Several pictures of one droplet that depart from the model alike. The pictures are birefit's own, and what a camera
// or its software does to them is done here: what is tested is the estimation.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "droplet_96.h"

namespace birefit {
namespace {
using namespace testing;

/// The same droplet in two pictures, the second with both polarizers turned by 45 degrees.
FitResult fit_two_droplets(const std::function<void(Image&)>& camera, unsigned seed) {
  Droplet96 d;
  Random random(seed);
  FitJob job;
  Scene turned = d.scene;
  turned.microscope.polarizer_deg = d.b.fixed("polarizer_2", 45);
  turned.microscope.analyzer_deg = d.b.fixed("analyzer_2", 135);
  for (const Scene& scene : {d.scene, turned}) {
    d.scene = scene;
    Image counts = d.light();
    for (double& v : counts.values()) v = kOffset + kGain * v;
    expose(counts, random);
    camera(counts);
    job.measurements.push_back(micrograph_of("picture", scene, counts.values(), d.gain, d.offset, {3, 1}));
    std::get<Picture>(job.measurements.back()).noise.reset();
  }
  for (const auto& [ref, start] : {std::pair(d.diameter, 9.2), {d.birefringence, 0.21}, {d.center_x, 47.0}})
    d.b.table[ref].value = start;
  job.parameters = d.b.table;
  job.options.threads = 1;
  return fit(job);
}

/// Every pixel becomes the middle one of itself and its neighbours.
void median_of_nine(Image& counts) {
  const Image before = counts;
  for (int y = 1; y + 1 < counts.height(); ++y)
    for (int x = 1; x + 1 < counts.width(); ++x) {
      std::array<double, 9> around;
      for (int i = 0; i < 9; ++i) around[static_cast<std::size_t>(i)] = before(x + i % 3 - 1, y + i / 3 - 1);
      std::nth_element(around.begin(), around.begin() + 4, around.end());
      counts(x, y) = around[4];
    }
}

// Two pictures that depart from the model alike do not scatter: what each misses is charged and refused as of one. A
// median of nine pixels flattens fringes; charged by the pictures' scatter alone birefringence was 1.6 half-widths off.
TEST(SeveralPictures, ThatDepartAlikeAreChargedAsOne) {
  const auto half_widths_off = [](const FitResult& r, const char* name, double truth) {
    const ParameterEstimate* p = find_estimate(r, name);
    return std::abs(p->value - truth) /
           (truth > p->value ? p->interval95_high - p->value : p->value - p->interval95_low);
  };
  for (const unsigned seed : {1u, 2u, 3u}) {
    const FitResult clean = fit_two_droplets([](Image&) {}, seed);
    EXPECT_EQ(clean.grade(), "answer") << clean.verdict;
    const FitResult filtered = fit_two_droplets(median_of_nine, seed);
    if (!filtered.has_answer()) continue;
    EXPECT_LT(half_widths_off(filtered, "diameter_um", kDiameter), 1.5) << filtered.verdict;
    EXPECT_LT(half_widths_off(filtered, "birefringence", kBirefringence), 1.5) << filtered.verdict;
  }
}

}  // namespace
}  // namespace birefit
