#pragma once
// How a scene is to be computed: by which physics, and how exactly. What is there is the scene's business (scene.h).

#include <memory>
#include <string>

namespace birefit {

class Memo;  // birefit/memo.h

/// The physics ceiling: what a render may leave out (docs/methods.md).
enum class Ceiling {
  one_way,      ///< E and H continuous, backward waves dropped (default)
  e_only,       ///< only tangential E continuous: the source paper's
  reflections,  ///< all of Maxwell's equations in the layers, both faces included; cells and slabs
  /// wave optics: radial droplets and concentric shells exactly, other spheres and sampled fields without reflections.
  /// Needs Microscope::objective_na
  wave,
};

/// How light runs through a droplet: both modes on the refracted straight chord, or each on its own ray (geometrical
/// optics; has_curved_rays in render.h). What follows from the choice: docs/methods.md.
enum class Rays { straight, eikonal };

/// By which physics, how exactly and by which method a scene is computed; the defaults are those of a config.
struct Demand {
  Ceiling ceiling = Ceiling::one_way;
  Rays rays = Rays::straight;        ///< without meaning under Ceiling::wave
  double intensity_accuracy = 1e-4;  ///< numerical error of the intensity the planner must hold; (0, 0.1]
  std::string method = "auto";       ///< or a transport method's name
  /// Of what the microscope adds to light of one line and one direction (a bandwidth, a condenser's aperture), what
  /// changes the picture by less than this is left out, root mean square over the picture's own, measured on a few
  /// pixels; [0, 1). 0: only what changes no pixel by more than intensity_accuracy. A fit takes 0.
  double model_tolerance = 0;
  /// Equilibria that pictures ask for again and again, shared by all that this is passed to. plan() makes one where
  /// there is none; a fit has one for all its plans.
  std::shared_ptr<Memo> memo = nullptr;
};

}  // namespace birefit
