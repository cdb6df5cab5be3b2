#pragma once
// Pictures by wave optics: droplets, shells and sampled fields, Ceiling::wave.

#include <optional>
#include <vector>

#include "samples/waves/object.h"
#include "wave/imaging.h"

namespace birefit {

struct WavePlan {
  WaveGrid grid;
  WaveImaging imaging;
  double radius_um = 0;  ///< of the sphere it was made for, half the longest side of a box
  double ramp_um = 0;    ///< of its surfaces
  double objective_na = 0;
};

/// Of a sphere, one of the same size and indices whose axis is radial (shells: concentric). Of a sampled field with
/// host in its box, a ball of as much liquid crystal of full order in the box's middle, sampled at the same nodes. None
/// of anything else.
/// All lengths `scale` times the scene's, the focus (where it is given) excepted.
std::optional<RadialTwin> radial_twin(const Scene& scene, const Theta& theta, double scale = 1);

/// RMS of the difference from the exact picture over the RMS of that; where it is darker than 1e-12 of the incident
/// light, which nothing tells from darkness, over 1e-12.
double picture_error(const Image& image, const Image& exact);

/// See image_by_march and march_error of birefit/render.h; `picture` renders the exact one.
Image marched_picture(const Scene& scene, const BeamMaker& light, const Theta& theta, int threads);
double march_error_on_twin(const Scene& scene, const BeamMaker& light, const Theta& theta, int threads,
                           const RenderPicture& picture);

/// The plan of one picture. Throws UserError when the scene is neither sphere nor sampled field, the numerical aperture
/// is missing or above the host's index, or the propagation would need more memory than there should be.
RenderPlan plan_wave(const Planning&);

/// The whole picture by a plan of propagation and its derivatives by `active` (indices of theta), images and all
/// resized to fit.
void render_wave(const Scene& scene, const RenderPlan& plan, const BeamMaker& light, const Theta& theta,
                 const std::vector<int>& active, int threads, Rendering& into);

}  // namespace birefit
