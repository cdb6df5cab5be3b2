#pragma once
// Pictures by wave optics: droplets, shells and sampled fields, Ceiling::wave.

#include <optional>
#include <vector>

#include "samples/planning.h"
#include "wave/imaging.h"

namespace birefit {

struct WavePlan {
  WaveGrid grid;
  WaveImaging imaging;
  double radius_um = 0;  ///< of the sphere it was made for, half the longest side of a box
  double ramp_um = 0;    ///< of its surfaces
  double objective_na = 0;
};

/// A sphere as it is seen: exactly, by the series; by propagation; and, of sampled fields, by propagation through
/// samples.
struct RadialTwin {
  std::vector<Scene> scenes;  ///< in that order
  Theta theta;                ///< of all of them: the scene's, constants of the twin behind it

  /// Of scenes[i], all else as in `of`.
  static Demand demand(std::size_t i, Demand of) {
    of.ceiling = Ceiling::wave, of.rays = Rays::straight;
    of.method = i == 0 ? "series" : "split_step";
    return of;
  }
};
/// Of a sphere, one of the same size and indices whose axis is radial (shells: concentric). Of a sampled field with
/// host in its box, a ball of as much liquid crystal of full order in the box's middle, sampled at the same nodes. None
/// of anything else.
std::optional<RadialTwin> radial_twin(const Scene& scene, const Theta& theta);

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

/// The whole picture and its derivatives by `active` (indices of theta), images and all resized to fit.
void render_wave(const Scene& scene, const WavePlan& plan, const BeamMaker& light, const Theta& theta,
                 const std::vector<int>& active, int threads, Rendering& into);

}  // namespace birefit
