#pragma once
// What a planner decided for a picture, and what rendering returns.

#include <array>
#include <complex>
#include <memory>
#include <string>
#include <vector>

#include "birefit/demand.h"
#include "birefit/image.h"
#include "birefit/observable.h"

namespace birefit {

struct WavePlan;  // grids of wave optics, render/wave.h

struct SampleChoices;  // what a kind of sample tabulates, samples/choices.h

struct WavelengthRule;  // the wavelengths of a sum and their weights, instrument/channel_light.h

/// How the means over pixels are made of rays.
struct PixelMeans {
  /// Samples per pixel side by distance from (center_x_px, center_y_px), one entry per bin_px; 1 = the point value with
  /// a second-order correction to the pixel's mean, n > 1 = n x n Gauss points.
  std::vector<int> samples;
  double bin_px = 1;
  double center_x_px = 0, center_y_px = 0;
  /// The same of pixels at a sphere's rim or a core's edge, which take Gauss points of their own
  /// (samples/pixels/edge_pixels.h).
  int edge_points = 4;
  int defect_points = 8;  ///< the same about a defect
  /// Pixels with one sample: the mean of a fringe in closed form from one ray a pixel and its neighbours' (plates),
  /// instead of the point value's correction.
  bool fringes = false;
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
  PixelMeans means;
  /// set: the picture is a sum over these wavelengths, all else of the plan holds for each; null: a single line
  std::shared_ptr<const WavelengthRule> wavelengths;
  /// propagated waves: a plan for each of them, whose grids fit it; else empty
  std::vector<RenderPlan> of_wavelengths;
  /// > 0: the picture is a sum over directions of the condenser, this many rings of them; 0: of light along the axis
  int condenser_rings = 0;
  std::shared_ptr<const SampleChoices> own;  ///< the kind's, which nobody else reads; none: its defaults
  /// set: the whole picture at once by wave optics, and nothing of the above but the words
  std::shared_ptr<const WavePlan> wave;
};

/// A picture of a scene's view and how it depends on parameters.
struct Rendering {
  Image intensity;                 ///< flux behind the analyser over flux behind the polarizer, per pixel
  std::vector<Image> derivatives;  ///< d intensity / d theta[active[j]]
};

/// One row of the `jones` table: complex transmission in the s, p basis of docs/conventions.md.
struct JonesRow {
  double theta_deg = 0, azimuth_deg = 0;        ///< slab scenes
  int row = 0, column = 0;                      ///< others
  double wavelength_nm = 0;                     ///< vacuum
  std::complex<double> ss{}, ps{}, sp{}, pp{};  ///< ps: p in, s out
};
}  // namespace birefit
