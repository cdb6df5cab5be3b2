#pragma once
// What was measured, in memory: pictures, and tables of readings.

#include <limits>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Dense>

#include "birefit/image.h"
#include "birefit/observable.h"
#include "birefit/parameters.h"
#include "birefit/scene.h"

namespace birefit {

/// Variance of one pixel's counts: read_counts^2 + counts_per_photon * max(signal counts - black_counts, 0).
struct NoiseModel {
  double read_counts = 0;        ///< >= 0
  double counts_per_photon = 0;  ///< >= 0
  bool estimated = false;        ///< from the image itself
  double black_counts = 0;       ///< the signal up to which there is read noise alone: a camera's black level
};

/// What light adds across an image: `coefficient`, in units of the values, times a shape; to the gain (uneven
/// illumination, vignetting) or to the offset (a tilted background).
struct UnevenLight {
  /// X right, Y up, from the middle of the image, 1 at its edge along the longer side; square: X^2 + Y^2.
  enum class Shape { x, y, square };
  ParameterRef coefficient;
  Shape shape = Shape::x;
  bool of_intensity = false;  ///< added to the gain
  /// From the middle to the edge of what is seen, where that is a part of a file's image.
  bool over_region = false;
};

/// What lenses, cameras and resampling do to a picture beside gain and offset: `coefficient`, in units of the values
/// per unit of the effect, times how the model's light changes by it.
struct PictureEffect {
  /// What it is, with the unit of the effect.
  enum class Kind {
    blur,              ///< by its variance (px^2); < 0: sharpened
    gamma,             ///< light to the power of 1 + gamma
    curve,             ///< light times 1 + curve (light - 1)
    stretch_x,         ///< about the centre, wider by it and as much lower
    stretch_diagonal,  ///< the same, longer along the diagonal from the upper left
    growth,            ///< about the centre, wider and higher by it
  };
  ParameterRef coefficient;
  Kind kind = Kind::blur;
};

/// One micrograph. Values are counts, or transmission when calibration frames were given.
struct Picture {
  std::string name;  ///< for reports: the file name
  Scene scene;
  Image values;
  Mask mask;  ///< 1 = usable; dead, saturated, non-finite, user-masked and out-of-ROI pixels are 0
  /// calibration: variance of a value per variance of a count, (1/(parallel - dark))^2; else empty
  Image variance_scale;
  ParameterRef gain, offset;           ///< linear: value = gain * intensity + offset; several pictures may share one
  std::vector<UnevenLight> uneven;     ///< linear as well
  std::vector<PictureEffect> effects;  ///< to first order linear as well
  std::optional<NoiseModel> noise;     ///< in counts; else estimated from the image
  /// Where the codes of the file end and many pixels lie there, in units of the values: what was darker or brighter is
  /// not known. Pixels whose light a fit finds that near to an end are left out; by default no end is.
  double cut_below = -std::numeric_limits<double>::infinity(), cut_above = std::numeric_limits<double>::infinity();
  /// Pixel counts by reason, for the report.
  int masked_by_user = 0, outside_roi = 0, saturated = 0, dead = 0, non_finite = 0;
};

/// A table of numbers. Every row is a measurement of its own, in a scene of its own; the radii of rings are all of one
/// scene, `rows` then having one entry.
struct Readings {
  std::string name;       ///< of the table: the file name
  Observable observable;  ///< what the values are
  std::vector<Scene> rows;
  std::vector<int> lines;           ///< of the rows in the file, for messages
  Eigen::VectorXd values;           ///< one a row, or one a ring
  ParameterRef gain, offset;        ///< linear: value = gain * observable + offset
  std::optional<NoiseModel> noise;  ///< in units of the values; needed where rows are measurements of their own
  bool noise_at_most = false;       ///< read off neighbouring rows, which differ by their signal, too
};

/// What one gain and offset belong to.
using Measurement = std::variant<Picture, Readings>;

/// Calls what(scene) for every scene of measurements.
template <class Measurements, class What>
void for_each_scene(Measurements& measurements, What&& what) {
  for (auto& measurement : measurements) {
    if (auto* picture = std::get_if<Picture>(&measurement))
      what(picture->scene);
    else
      for (auto& scene : std::get<Readings>(measurement).rows) what(scene);
  }
}

/// The picture that a frame of the measurements is, counted as FitResult::micrographs counts them: every row of a table
/// is a frame, the rings of a scene together are one. Null where it is no picture.
inline const Picture* picture_at(const std::vector<Measurement>& measurements, std::size_t frame) {
  for (const Measurement& measurement : measurements) {
    const Readings* readings = std::get_if<Readings>(&measurement);
    const std::size_t frames = readings ? readings->rows.size() : 1;
    if (frame < frames) return std::get_if<Picture>(&measurement);
    frame -= frames;
  }
  return nullptr;
}

}  // namespace birefit
