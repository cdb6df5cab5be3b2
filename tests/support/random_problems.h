#pragma once
// Problems drawn at random for the global search: truths anywhere in bounds many fringe orders wide, starts anywhere
// else. A problem knows which changes of its parameters no picture shows, so that it can tell a wrong answer from a
// right one in other numbers.

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "birefit/fit.h"
#include "birefit/render.h"
#include "scene_builder.h"

namespace birefit::testing {

constexpr double kProblemGain = 1000;

/// One problem: the table holds the truth until the starts are drawn; a scene a micrograph.
struct RandomProblem {
  TableBuilder b;
  std::vector<Scene> scenes;
  Demand demand;
  /// What each scene shows, by a model that shares no code with the program; empty: the program's own render.
  std::vector<std::vector<double>> light;
  std::vector<Mask> masks;  ///< of each scene; none: all pixels
  std::mt19937_64 random;
  double least_noise = 0.003;                   ///< of the gain
  double lamp_jitter = 0;                       ///< share by which the lamp differs from frame to frame
  bool own_gains = false, own_offsets = false;  ///< one for each frame instead of one for all
  std::map<int, double> period;                 ///< of angles that come back to the same state
  /// Changes of the parameters that leave all pictures as they are; each its own inverse, up to the periods.
  std::vector<std::function<void(Theta&)>> symmetries;

  double between(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); }
  /// Evenly in its logarithm.
  double scaled(double low, double high) { return std::exp(between(std::log(low), std::log(high))); }
  bool chance(double probability) { return between(0, 1) < probability; }
  int count(int low, int high) { return std::uniform_int_distribution<int>(low, high)(random); }
  /// Its truth anywhere between the bounds but for their last twentieth, where a fit would have to say that it is at
  /// one.
  ParameterRef anywhere(const std::string& name, double low, double high) {
    return b.fitted(name, between(low + 0.05 * (high - low), high - 0.05 * (high - low)), low, high);
  }
  /// The same of what cannot be negative: a fit that ends at zero states a limit.
  ParameterRef from_zero(const std::string& name, double high) {
    const ParameterRef ref = anywhere(name, 0, high);
    b.table[ref].physical_lower = 0;
    return ref;
  }
  /// Bounds up to these shares of the truth below and above it.
  ParameterRef around(const std::string& name, double truth, double below, double above) {
    const double low = between(0.3 * below, below), high = between(0.3 * above, above);
    return b.fitted(name, truth, truth * (1 - low), truth * (1 + high));
  }
  /// A length known to a quarter below and a third above.
  ParameterRef length(const std::string& name, double low, double high) {
    return around(name, scaled(low, high), 0.25, 0.3);
  }
  /// An angle about which nothing is known: its bounds lie apart by all that it may be, from anywhere on.
  ParameterRef angle(const std::string& name, double period_deg, double all_deg) {
    const double from = between(-all_deg, 0);
    const ParameterRef ref = anywhere(name, from, from + all_deg);
    period[ref.index] = period_deg;
    return ref;
  }
  ParameterRef angle(const std::string& name, double period_deg) { return angle(name, period_deg, period_deg); }
  double truth_of(ParameterRef ref) const { return b.table[ref].value; }
};

/// A microscope with crossed polarizers and square pictures.
inline Scene seen(RandomProblem& p, int size, double pixel_um) {
  Scene s;
  s.microscope.wavelength_nm = p.b.fixed("wavelength_nm", 590);
  s.microscope.polarizer_deg = p.b.fixed("polarizer_deg", 0);
  s.microscope.analyzer_deg = p.b.fixed("analyzer_deg", 90);
  s.view.width = s.view.height = size;
  s.view.pixel_size_um = p.b.fixed("pixel_size_um", pixel_um);
  s.view.rotation_deg = p.b.fixed("rotation_deg", 0);
  return s;
}

/// A problem as the fit gets it, and what only its maker knows.
struct Posed {
  FitJob job;
  Theta truth;
  double noise = 0;  ///< counts
};

/// Draws the pictures, then the starts.
inline Posed pose(RandomProblem& p, const std::string& name, Ceiling ceiling = Ceiling::one_way) {
  Posed posed;
  for (Scene& scene : p.scenes) {
    if (ceiling != Ceiling::wave) continue;
    p.demand.ceiling = ceiling;
    scene.microscope.objective_na = p.b.fixed("objective_na", p.between(0.4, 0.9));
  }
  posed.noise = kProblemGain * p.scaled(p.least_noise, 0.05);
  posed.truth = p.b.table.values();
  std::normal_distribution<double> normal(0, posed.noise), lamp(0, 1);
  std::vector<std::vector<double>> pictures;
  for (std::size_t g = 0; g < p.scenes.size(); ++g) {
    if (p.light.empty()) {
      Demand demand = p.demand;
      if (ceiling != Ceiling::wave) demand.intensity_accuracy = 1e-5;
      const Scene& scene = p.scenes[g];
      pictures.push_back(render(scene, plan(scene, demand, posed.truth), posed.truth, {}, 1).intensity.values());
    } else {
      pictures.push_back(p.light[g]);
    }
    const double gain = kProblemGain * (p.lamp_jitter > 0 ? 1 + p.lamp_jitter * lamp(p.random) : 1);
    for (double& value : pictures.back()) value = gain * value + normal(p.random);
  }
  const auto linear = [&](const std::string& of, std::size_t g, bool own, double start, double lower) {
    const ParameterRef ref = p.b.linear(own ? of + std::to_string(g) : of, start);
    p.b.table[ref].lower = lower;
    return ref;
  };
  std::vector<ParameterRef> gains, offsets;
  for (std::size_t g = 0; g < p.scenes.size(); ++g) {
    gains.push_back(g == 0 || p.own_gains ? linear("gain", g, p.own_gains, 0.9 * kProblemGain, 0) : gains[0]);
    if (g == 0 || p.own_offsets)
      offsets.push_back(linear("offset", g, p.own_offsets, 5, -std::numeric_limits<double>::infinity()));
    else
      offsets.push_back(offsets[0]);
  }
  for (int k = 0; k < p.b.table.size(); ++k) {
    Parameter& of = p.b.table[k];
    if (of.free && !of.linear) of.value = p.between(of.lower, of.upper);
  }
  for (std::size_t g = 0; g < p.scenes.size(); ++g) {
    posed.job.measurements.push_back(
        micrograph_of(name, p.scenes[g], pictures[g], gains[g], offsets[g], {posed.noise, 0}));
    if (!p.masks.empty()) std::get<Picture>(posed.job.measurements.back()).mask = p.masks[g];
  }
  posed.job.parameters = p.b.table;
  posed.job.demand = p.demand;
  posed.job.options.threads = 1;
  return posed;
}

/// The truth in all the numbers that show the same pictures.
inline std::vector<Theta> equivalents(const RandomProblem& p, const Theta& truth) {
  std::vector<Theta> all{truth};
  for (const auto& symmetry : p.symmetries)
    for (std::size_t i = 0, n = all.size(); i < n; ++i) {
      all.push_back(all[i]);
      symmetry(all.back());
    }
  return all;
}

/// a - b of one parameter, the short way around where it is an angle.
inline double difference(const RandomProblem& p, int parameter, double a, double b) {
  const auto period = p.period.find(parameter);
  return period == p.period.end() ? a - b : std::remainder(a - b, period->second);
}

}  // namespace birefit::testing
