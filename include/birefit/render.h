#pragma once
// The forward model: render(scene, parameters, theta) is a pure function.

#include <array>
#include <complex>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Dense>

#include "birefit/image.h"
#include "birefit/observable.h"
#include "birefit/scene.h"

namespace birefit {

struct WavePlan;  // grids of wave optics, render/wave.h

/// A part of a droplet's disc (render/polar_table.h), of 4 x 2^level panels from the rim inwards and 8 x 2^level
/// sectors around.
struct DiscSquare {
  /// of the disc as which a shell's core is seen: the light that passes through it; the others' passes beside it
  bool of_core = false;
  int level = 0, panel = 0, sector = 0;
  int steps = 1;        ///< mesh steps of its rays
  bool smooth = false;  ///< its light is interpolated from a few rays
  double points = 0;    ///< of the picture in it
};

/// What the planner decided, why, and what it expects; fixed for the duration of a fit so that the objective is smooth
/// (but for which pixels lie at a core's edge: their points follow it, which changes a mean by some 1e-4).
struct RenderPlan {
  Observable observable;             ///< what is rendered
  std::string method;                ///< transport method by name
  std::string physics;               ///< the ceiling's name
  std::vector<std::string> reasons;  ///< one sentence for every rung: why it stopped or went on
  /// Expected, of the intensity, as a fraction of the incident; of a propagated wave picture (`wave` set) the RMS error
  /// over the picture's own RMS.
  double numerical_error = 0;
  double model_error = 0;             ///< of what the ceiling leaves out, same unit
  std::vector<std::string> warnings;  ///< what is not modelled and may matter here
  std::vector<std::string> left_out;  ///< what the model leaves out wherever such a sample is computed so
  /// of a picture by wave optics: expected without derivatives, one thread; rays are quick to try
  double cost_seconds = 0;

  // The numerical choices themselves.
  int steps = 1;             ///< equal mesh steps in u (diagonal: Gauss nodes)
  std::vector<double> mesh;  ///< adapted mesh in u, instead of `steps` where not empty
  int radial_panels = 0;     ///< droplets: panels of the table over the radius; 0 = one ray a point
  int centre_panels = 0;     ///< of its innermost part
  /// curved rays: of each part between places where light begins or ends; radial_panels is the most
  std::vector<int> part_panels;
  /// Pixels with one sample: the mean of a fringe in closed form from one ray a pixel and its
  /// neighbours' (plates), instead of the point value's correction.
  bool fringe_means = false;
  /// Which squares of so many pixels (a multiple of 8) have their fringes interpolated from a few rays
  /// (render/fringe_table.h); 0 = none.
  int fringe_block_px = 0;
  std::vector<std::uint8_t> fringe_blocks;
  /// Droplets that look different from all sides: all of the disc, in squares that have their own `steps`. Empty:
  /// `steps` everywhere.
  std::vector<DiscSquare> disc;
  /// Samples per pixel side by distance from (sampling_center_x_px, _y_px), one entry per sampling_bin_px; 1 = the
  /// point value with a second-order correction to the pixel's mean, n > 1 = n x n Gauss points.
  std::vector<int> samples;
  /// The same of pixels at a sphere's rim or a core's edge, which take Gauss points of their own
  /// (render/edge_pixels.h).
  int edge_points = 4;
  int defect_points = 8;  ///< the same about a defect
  double sampling_bin_px = 1;
  double sampling_center_x_px = 0, sampling_center_y_px = 0;
  double series_reach_um = 0;  ///< > 0: the exact series, tabulated out to this image radius
  /// set: the whole picture at once by wave optics, and nothing of the above but the words
  std::shared_ptr<const WavePlan> wave;
};

/// Rays that the kernels carry side by side: doubles in a SIMD register of the machine they were compiled for.
int rays_side_by_side();

/// Chooses the cheapest method that holds scene.intensity_accuracy within scene.ceiling, at the values of theta.
/// Throws UserError when a forced method cannot do the scene.
/// `observable`: what the values of the picture are, where they are not intensities; its one pixel, or one for every
/// ring.
RenderPlan plan(const Scene& scene, const Theta& theta, const Observable& observable = {});

/// The picture of a droplet, shell or sampled field by Maxwell's equations, marched through (src/wave/march.h):
/// independent of the propagation of Ceiling::wave, and much slower. Throws UserError like plan().
Image image_by_march(const Scene& scene, const Theta& theta, int threads = 0);

/// The grids of `before` no longer hold what `now` was made for (wave optics, parts of a disc).
bool outgrown(const RenderPlan& now, const RenderPlan& before);

/// Rays::eikonal knows the scene: radial droplets without twist, shells whose core is in the middle, droplets in a
/// field along the view.
bool has_curved_rays(const Scene& scene);

/// What Ceiling::wave would cost where it is not yet chosen.
struct WaveChoice {
  double seconds_an_image = 0;  ///< without derivatives, one thread; infinite where wave optics cannot do the scene
  bool series = false;          ///< by the exact series
  std::string words;            ///< a sentence: how long, or why not
};
WaveChoice wave_choice(const Scene& scene, const Theta& theta);

struct Rendering {
  Image intensity;                 ///< flux behind the analyser over flux behind the polarizer, per pixel
  std::vector<Image> derivatives;  ///< d intensity / d theta[active[j]]
};

/// Renders scene.view; every pixel is the mean over its area. `active` lists theta indices to differentiate by (angles
/// in degrees, lengths in the unit of the parameter). Same bits whatever the number of threads (0 = all cores).
Rendering render(const Scene& scene, const RenderPlan& plan, const Theta& theta, const std::vector<int>& active = {},
                 int threads = 0);
/// The same into images that are there already: fresh memory costs as much as the image itself.
void render(const Scene& scene, const RenderPlan& plan, const Theta& theta, const std::vector<int>& active, int threads,
            Rendering& into);

/// The same at chosen pixels only (column, row pairs): value[i], derivative(i, j). Used by the coarse scan.
struct PixelRendering {
  Eigen::VectorXd intensity;
  Eigen::MatrixXd derivatives;
};
PixelRendering render_pixels(const Scene& scene, const RenderPlan& plan, const Theta& theta,
                             const std::vector<std::array<int, 2>>& pixels, const std::vector<int>& active = {},
                             int threads = 0);
/// Whether the whole picture takes less time than these of its pixels: it has tables, symmetries, and rows in which
/// pixels share rays.
bool picture_is_cheaper(const Scene& scene, const RenderPlan& plan, const std::vector<std::array<int, 2>>& pixels);

/// One row of the `jones` table: complex transmission in the s, p basis of docs/conventions.md.
struct JonesRow {
  double theta_deg = 0, azimuth_deg = 0;  ///< slab scenes
  int row = 0, column = 0;                ///< others
  double wavelength_nm = 0;
  std::complex<double> ss{}, ps{}, sp{}, pp{};  ///< ps: p in, s out
};
/// Slab scenes: one row per microscope direction; others: per pixel.
std::vector<JonesRow> jones(const Scene& scene, const RenderPlan& plan, const Theta& theta);

/// Light caught within a sphere ripples its image: how far theta[index], its diameter (um), goes from one ripple to the
/// next where the scene is computed by the exact series; 0 for other parameters and scenes. A fit has a shallow minimum
/// in each, and between them.
double ripple_period(const Scene& scene, const Theta& theta, int index);

/// Largest change of retardance phase (rad) anywhere in the image per unit of theta[index]; 0 when the parameter forms
/// no fringes. The coarse scan steps by less than a radian of it.
double fringe_phase_per_unit(const Scene& scene, const Theta& theta, int index);

}  // namespace birefit
