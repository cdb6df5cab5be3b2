#pragma once
// What a planner decided for a picture, and what rendering returns.

#include <array>
#include <complex>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "birefit/demand.h"
#include "birefit/image.h"
#include "birefit/observable.h"

namespace birefit {

struct WavePlan;  // grids of wave optics, render/wave.h

/// A part of a droplet's disc (samples/tables/polar_table.h), of 4 x 2^level panels from the rim inwards and 8 x
/// 2^level sectors around.
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
  Demand demand;                     ///< what it holds, where no warning says otherwise
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
  /// (samples/tables/fringe_table.h); 0 = none.
  int fringe_block_px = 0;
  std::vector<std::uint8_t> fringe_blocks;
  /// Droplets that look different from all sides: all of the disc, in squares that have their own `steps`. Empty:
  /// `steps` everywhere.
  std::vector<DiscSquare> disc;
  /// Samples per pixel side by distance from (sampling_center_x_px, _y_px), one entry per sampling_bin_px; 1 = the
  /// point value with a second-order correction to the pixel's mean, n > 1 = n x n Gauss points.
  std::vector<int> samples;
  /// The same of pixels at a sphere's rim or a core's edge, which take Gauss points of their own
  /// (samples/pixels/edge_pixels.h).
  int edge_points = 4;
  int defect_points = 8;  ///< the same about a defect
  double sampling_bin_px = 1;
  double sampling_center_x_px = 0, sampling_center_y_px = 0;
  double series_reach_um = 0;  ///< > 0: the exact series, tabulated out to this image radius
  /// set: the whole picture at once by wave optics, and nothing of the above but the words
  std::shared_ptr<const WavePlan> wave;
};

struct Rendering {
  Image intensity;                 ///< flux behind the analyser over flux behind the polarizer, per pixel
  std::vector<Image> derivatives;  ///< d intensity / d theta[active[j]]
};

/// One row of the `jones` table: complex transmission in the s, p basis of docs/conventions.md.
struct JonesRow {
  double theta_deg = 0, azimuth_deg = 0;  ///< slab scenes
  int row = 0, column = 0;                ///< others
  double wavelength_nm = 0;
  std::complex<double> ss{}, ps{}, sp{}, pp{};  ///< ps: p in, s out
};
}  // namespace birefit
