#pragma once
// The forward model: render(scene, parameters, theta) is a pure function.

#include <array>
#include <string>
#include <vector>

#include <Eigen/Dense>

#include "birefit/plan.h"
#include "birefit/scene.h"

namespace birefit {

/// Rays that the kernels carry side by side: doubles in a SIMD register of the machine they were compiled for.
int rays_side_by_side();

/// Chooses the cheapest method that holds the demanded accuracy within the demanded physics, at the values of theta.
/// Throws UserError when a method asked for by name cannot do the scene.
/// `observable`: what the values of the picture are, where they are not intensities; its one pixel, or one for every
/// ring.
RenderPlan plan(const Scene& scene, const Demand& demand, const Theta& theta, const Observable& observable = {});
/// As exactly and by the physics that a Demand has by itself.
inline RenderPlan plan(const Scene& scene, const Theta& theta, const Observable& observable = {}) {
  return plan(scene, {}, theta, observable);
}

/// The picture of a droplet, shell or sampled field by Maxwell's equations, marched through (src/wave/march.h):
/// independent of the propagation of Ceiling::wave, and much slower. Throws UserError like plan().
Image image_by_march(const Scene& scene, const Theta& theta, int threads = 0);
/// What it errs by on the scene's radial twin, a sphere of the same size whose picture is known exactly, as RMS of the
/// difference over the RMS of the picture; light reflected twice is left out. Throws UserError where there is none.
double march_error(const Scene& scene, const Theta& theta, int threads = 0);

/// A plan that resolves more than the one a solver worked with, or resolves it elsewhere.
bool asks_for_more(const RenderPlan& now, const RenderPlan& before);
/// The light is read from a table over the radius; else a point of the picture may be a ray of its own.
bool has_radial_table(const RenderPlan& plan);

/// Rays::eikonal knows the scene: radial droplets without twist, shells whose core is in the middle, droplets in a
/// field along the view.
bool has_curved_rays(const Scene& scene);

/// What Ceiling::wave would cost where it is not yet chosen, all else as demanded.
struct WaveChoice {
  double seconds_an_image = 0;  ///< without derivatives, one thread; infinite where wave optics cannot do the scene
  bool series = false;          ///< by the exact series
  std::string words;            ///< a sentence: how long, or why not
};
/// The cost of Ceiling::wave for the scene at theta, whatever ceiling and rays `demand` names.
WaveChoice wave_choice(const Scene& scene, Demand demand, const Theta& theta);

/// Renders scene.view; every pixel is the mean over its area. `active` lists theta indices to differentiate by (angles
/// in degrees, lengths in the unit of the parameter). Same bits whatever the number of threads (0 = all cores).
Rendering render(const Scene& scene, const RenderPlan& plan, const Theta& theta, const std::vector<int>& active = {},
                 int threads = 0);
/// The same into images that are there already: fresh memory costs as much as the image itself.
void render(const Scene& scene, const RenderPlan& plan, const Theta& theta, const std::vector<int>& active, int threads,
            Rendering& into);

/// What render_pixels() returns.
struct PixelRendering {
  Eigen::VectorXd intensity;    ///< one a pixel, as Rendering::intensity
  Eigen::MatrixXd derivatives;  ///< (i, j): d intensity[i] / d theta[active[j]]
};
/// The same as render() at chosen pixels only, (column, row) pairs, in their order. Used by the coarse scan.
PixelRendering render_pixels(const Scene& scene, const RenderPlan& plan, const Theta& theta,
                             const std::vector<std::array<int, 2>>& pixels, const std::vector<int>& active = {},
                             int threads = 0);
/// Whether the whole picture takes less time than these of its pixels: it has tables, symmetries, and rows in which
/// pixels share rays.
bool picture_is_cheaper(const Scene& scene, const RenderPlan& plan, const std::vector<std::array<int, 2>>& pixels);

/// Slab scenes: one row per microscope direction; others: per pixel.
std::vector<JonesRow> jones(const Scene& scene, const RenderPlan& plan, const Theta& theta);

/// Light caught within a sphere ripples its image: how far theta[index], its diameter (um), goes from one ripple to the
/// next where the scene is computed by the exact series; 0 for other parameters and scenes. A fit has a shallow minimum
/// in each, and between them.
double ripple_period(const Scene& scene, const Demand& demand, const Theta& theta, int index);

/// Largest change of retardance phase (rad) anywhere in the image per unit of theta[index]; 0 when the parameter forms
/// no fringes. The coarse scan steps by less than a radian of it. Of `demand` only the memo is used.
double fringe_phase_per_unit(const Scene& scene, const Demand& demand, const Theta& theta, int index);
/// The same of an entry of a table together with all that is tied to it: no more than the sum of what each does.
double fringe_phase_per_unit(const Scene& scene, const Demand& demand, const ParameterTable& table, const Theta& theta,
                             int index);
/// ripple_period() of an entry that moves the diameter by itself or through a tie.
double ripple_period(const Scene& scene, const Demand& demand, const ParameterTable& table, const Theta& theta,
                     int index);

}  // namespace birefit
