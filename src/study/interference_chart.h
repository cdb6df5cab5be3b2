#pragma once
// The interference colours of one's own lamp, polarizers and camera (the chart of Michel-Levy), and the retardance that
// a picture's colours say. docs/methods.md, "Spectrum".

#include <array>
#include <vector>

#include "birefit/image.h"
#include "birefit/parameters.h"
#include "birefit/scene.h"
#include "instrument/interference_colour.h"

namespace birefit {

/// A retardance and what is seen of it.
struct ChartColour {
  double retardance_um = 0;
  std::vector<double> channels;        ///< the camera's, fractions of what it records without sample and polarizers
  Lab eye;                             ///< the CIE's observer's, against the lamp's white between parallel polarizers
  std::array<double, 3> screen{};      ///< codes of sRGB, the lamp looking white; may leave [0, 1]
  double double_um = 0, distance = 0;  ///< the most alike farther than kApartUm away, and its CIEDE2000
};
/// Nearer than this a colour is the same fringe.
inline constexpr double kApartUm = 0.1;

/// From 0 up to `up_to_um` in steps of `step_um`. `scenes`: the same with the light of each channel (all have a
/// channel_light); retardances are at 589.3 nm, with the dispersion of the scene's material, if it has indices.
/// UserError where the lamp does not cover what an eye sees.
std::vector<ChartColour> interference_chart(const std::vector<Scene>& scenes, const Theta& theta, double up_to_um,
                                            double step_um);

/// The curve of the cameras' channels alone.
ColourCurve camera_curve(const std::vector<Scene>& scenes, const Theta& theta, double up_to_um);

/// Of every pixel; NaN where it is not used.
struct RetardanceMap {
  Image retardance_um, error_um;  ///< the likeliest, its standard error
  Image rival_um, rival_odds;     ///< the next likely and its odds against it; NaN and 0 without
  /// What the likeliest leaves of the channels, in units of the noise. Where that is less likely than 1 in 1000 the
  /// colour is that of no retardance, and errors and odds are those of a noise as large as what is left.
  Image chi_square;
  std::size_t used = 0, settled = 0;  ///< pixels; those whose rival is less likely than one in twenty
  std::size_t unlike = 0;             ///< pixels of such colours
};
/// `channels`: pictures of one size as fractions of white; `mask`: 1 = used; `noise`: standard deviation of each.
RetardanceMap retardance_map(const ColourCurve& curve, const std::vector<Image>& channels, const Mask& mask,
                             double noise, int threads);

}  // namespace birefit
