#pragma once
// Pictures by wave optics: droplets and shells, Ceiling::wave.

#include "render/pixel_model.h"
#include "wave/imaging.h"
#include "wave/sphere.h"

namespace birefit {

struct WavePlan {
  WaveGrid grid;
  WaveImaging imaging;
  double radius_um = 0;  ///< of the sphere it was made for
  double ramp_um = 0;    ///< of its surfaces
};

/// Throws UserError where wave optics has no aperture to work with: none given, or one above the host's index.
void check_objective(const Scene& scene, double n_host);

/// The plan of one picture. Throws UserError when the scene is no sphere, the numerical aperture is missing or above the host's index,
/// or the propagation would need more memory than there should be.
RenderPlan plan_wave(const Scene& scene, const Values<double>& value);

/// The whole picture and its derivatives by `active` (indices of theta), images and all resized to fit.
void render_wave(const Scene& scene, const WavePlan& plan, const Theta& theta, const std::vector<int>& active, int threads, Rendering& into);

}  // namespace birefit
