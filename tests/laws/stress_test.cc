// The law of every method in every trap: its answer is within its own estimate, or flagged.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <fmt/format.h>

#include "birefit/study.h"
#include "transport/method.h"

namespace birefit {
namespace {

using Points = std::vector<StressPoint>;

void expect_answers_within_their_own_estimate_or_flagged(const Points& points) {
  std::map<std::string, int> answered;
  int judged = 0;
  for (const StressPoint& p : points) {
    SCOPED_TRACE(fmt::format("{} {:g} {}", p.sweep, p.value, p.method));
    EXPECT_FALSE(std::isnan(p.estimate));
    EXPECT_LT(p.samples, 3e6);  // bounded work
    if (!p.flag.empty()) continue;
    EXPECT_TRUE(std::isfinite(p.estimate));
    ++answered[p.method];
    if (std::isnan(p.error)) continue;  // nobody knows the truth here
    ++judged;
    EXPECT_LE(p.error, p.estimate + 1e-10);  // the truth is known to 1e-11
  }
  EXPECT_GT(judged, 150);
  // Flagging everything is no answer: the workhorses answer nearly everywhere.
  const int places = static_cast<int>(
      std::count_if(points.begin(), points.end(), [](const StressPoint& p) { return p.method == "magnus4"; }));
  EXPECT_GT(answered["magnus4"], 0.8 * places);
  EXPECT_GT(answered["magnus6"], 0.8 * places);
}

void expect_every_known_trap(const Points& points) {
  std::set<std::string> swept, methods;
  for (const StressPoint& p : points) {
    swept.insert(p.sweep);
    methods.insert(p.method);
  }
  for (const char* trap : {"impact_um",
                           "rim_gap",
                           "axis_passes_ray",
                           "birefringence",
                           "c2_parameter",
                           "pole_birefringence",
                           "gap_to_total_reflection",
                           "thickness_um",
                           "pitch_um",
                           "absorption_k",
                           "host_index",
                           "turn_width_um",
                           "step_beside_node",
                           "kink_beside_node",
                           "sub_layer_width",
                           "crossed_polarizer_deg",
                           "parallel_polarizer_deg",
                           "light_retardance_um",
                           "light_twist_deg",
                           "light_fwhm_nm",
                           "light_echo_fwhm_nm",
                           "light_diameter_um",
                           "wave_radius_um in 1.43",
                           "wave_host_index dn 0.02",
                           "wave_birefringence in 1.52",
                           "wave_objective_na in 1.33",
                           "wave_focus_um na 0.8",
                           "wave_wall_um in 1.33",
                           "wave_analyzer_deg",
                           "wave_pixels_across",
                           "wave_bipolar_dn in 1.43",
                           "wave_twist_deg in 1.43",
                           "wave_offset_um in 1.43"})
    EXPECT_TRUE(swept.contains(trap)) << trap;
  for (const TransportMethod<double>* method : transport_methods<double>())
    EXPECT_TRUE(methods.contains(method->info().name)) << method->info().name;
  for (const char* waves : {"series of a ball", "split_step of a ball", "march of a ball"})
    EXPECT_TRUE(methods.contains(waves)) << waves;
}

// An estimate that always says 1 would obey the law too: the median of estimate over error stays below 100.
void expect_sharp_estimates(const Points& points) {
  std::map<std::string, std::vector<double>> sharpness;
  for (const StressPoint& p : points)  // a planned picture states what was asked for, no estimate of its own
    if (p.flag.empty() && p.error > 1e-10 && p.sweep.find("_polarizer_deg") == std::string::npos &&
        !p.sweep.starts_with("light_"))
      sharpness[p.method].push_back(p.estimate / p.error);
  for (auto& [method, ratios] : sharpness) {
    std::nth_element(ratios.begin(), ratios.begin() + static_cast<long>(ratios.size() / 2), ratios.end());
    std::printf("  %-20s median estimate/error %.1f of %zu\n", method.c_str(), ratios[ratios.size() / 2],
                ratios.size());
    EXPECT_LT(ratios[ratios.size() / 2], 100) << method;
  }
  EXPECT_GE(sharpness.size(), 6u);
}

// One test, because the sweeps take the better part of a minute.
TEST(Stress, EveryMethodKeepsItsWordInEveryTrap) {
  const Points points = measure_stress(true);
  expect_answers_within_their_own_estimate_or_flagged(points);
  expect_every_known_trap(points);
  expect_sharp_estimates(points);
}

}  // namespace
}  // namespace birefit
