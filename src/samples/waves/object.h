#pragma once
// What a kind of sample has to say for wave optics to make its picture.

#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "samples/planning.h"
#include "wave/split_step.h"

namespace birefit {

/// What planning needs to know of a sphere or box.
struct WaveObject {
  double n_o, n_e, n_host, core_index;
  double radius_um;  ///< of the sphere, half the longest side of a box
  WaveGrid grid;
  std::string what;       ///< "sphere of 9 um"
  bool has_core = false;  ///< light leaves a wall for it
};

/// A sphere as it is seen: exactly, by the series; by propagation; and, of sampled fields, by propagation through
/// samples.
struct RadialTwin {
  std::vector<Scene> scenes;  ///< in that order
  Theta theta;                ///< of all of them: the scene's, constants of the twin behind it
  double diameter_um;

  /// Of scenes[i], all else as in `of`.
  static Demand demand(std::size_t i, Demand of) {
    of.ceiling = Ceiling::wave, of.rays = Rays::straight;
    of.method = i == 0 ? "series" : "split_step";
    return of;
  }
  /// A number of its own behind the scene's.
  ParameterRef constant(double value) {
    theta.push_back(value);
    return {static_cast<int>(theta.size()) - 1};
  }
};

template <class S>
using MakeWaveMedium = std::unique_ptr<WaveMedium<S>> (*)(const Scene&, const Values<S>&, double ramp_um);

struct SampleWaves {
  /// `value`: of a scene with an aperture and a surround.
  WaveObject (*object)(const Scene&, const Values<double>& value);
  std::tuple<MakeWaveMedium<double>, MakeWaveMedium<Pack>, MakeWaveMedium<Dual1>, MakeWaveMedium<Dual2>,
             MakeWaveMedium<Dual4>>
      medium;
  /// See radial_twin() of samples/waves/wave.h.
  std::optional<RadialTwin> (*radial_twin)(const Scene&, const Theta&, double scale);
  /// Whether the picture has an exact series, its plan (Throws UserError like plan_wave) and its image; null: never.
  bool (*has_series)(const Scene&) = nullptr;
  RenderPlan (*plan_series)(const Scene&, const Demand&, const Values<double>&, const BeamMaker&) = nullptr;
  /// Distance of neighbouring resonances in the parameter of this index (its unit); 0 where it moves none.
  double (*series_ripple_period)(const Scene&, const Values<double>&, int index) = nullptr;
};

}  // namespace birefit
