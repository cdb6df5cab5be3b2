#pragma once
// What the image assembly needs of a sample: its light at points of the image, for any scalar.

#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <vector>

#include "birefit/plan.h"
#include "core/scalar.h"
#include "medium/surround.h"
#include "samples/fringe.h"
#include "scene/values.h"

namespace birefit {

class BeamMaker;  // instrument/exposure.h

/// Compiled for pictures that are read from a table and no others (transport/method.h).
template <class S>
inline constexpr bool kForTablesOnly = (ScalarTraits<S>::derivatives > 4);

/// What leaves a picture as it is: half a turn about its middle, or a mirror that exchanges its upper and its lower
/// half.
enum class Symmetry { none, half_turn, mirror };

/// A circle in the picture, in pixels.
struct EdgeCircle {
  double column, row, radius;
};

struct FringeScratch;

/// A sample in light of one direction, at image points (pixel units; docs/conventions.md), one a lane. Light is written
/// in place, out[channel], of which there is one: to return it as a value costs more than to compute it.
template <class S>
class SampleImage {
 public:
  virtual ~SampleImage() = default;
  /// As a fraction of what comes in.
  virtual void light(const PlainOf<S>& column, const PlainOf<S>& row, S* out) const = 0;
  /// The parts of light() as smooth functions; only with plan.means.fringes.
  virtual void fringe(const PlainOf<S>& /*column*/, const PlainOf<S>& /*row*/, FringePoint<S>* /*out*/) const {
    throw std::logic_error("no fringes here");
  }
  /// The same of up to `count` columns of a row from `column` on, read from a table (FringeTable::run); 0 where there
  /// is none.
  virtual int fringe_run(int /*column*/, double /*row*/, int /*count*/, FringeScratch&, double* const* /*out*/) const {
    return 0;
  }
  /// Which fields the derivative of number plane - 1 changes; plane 0 has all.
  virtual FringeFields fringe_fields(int /*plane*/) const { return {}; }
  /// Once tabulated.
  virtual FringeTraits fringe_traits() const { return {}; }
  /// FringePoint::quadrature is zero everywhere.
  virtual bool in_phase() const { return false; }
  /// Lines along which the slope of light() has no bound on one side, like a root's (edge_pixels.h). The first, if
  /// there is any, is the rim of all that light() knows; a second one a core's edge, where it is continuous.
  virtual int edges() const { return 0; }
  /// Positive on the side of that slope, negative on the other, and all but linear across a few pixels of the line,
  /// where it does not end (at a rim). Of a line that is no circle: about the distance, in pixels.
  virtual PlainOf<S> beyond_edge(int /*edge*/, const PlainOf<S>& /*column*/, const PlainOf<S>& /*row*/) const {
    return PlainOf<S>(-1.0);
  }
  /// Places (column, row), apart from the middle, about which light turns within a pixel.
  virtual const std::vector<std::array<double, 2>>& defects() const {
    static const std::vector<std::array<double, 2>> none;
    return none;
  }
  /// Light changes with the azimuth about the middle of circle() as its fourth harmonic does, no faster.
  virtual bool round() const { return false; }
  /// The line, where it is a circle; all circles have the same middle.
  virtual std::optional<EdgeCircle> circle(int /*edge*/) const { return {}; }
  /// beyond_edge() of the rim with its derivatives.
  virtual S rim(const PlainOf<S>& column, const PlainOf<S>& row) const { return S(beyond_edge(0, column, row)); }
  /// The mean over a pixel of the light that goes past the sample, which light() leaves out.
  virtual bool has_passing_light() const { return false; }
  virtual void passing(const PlainOf<S>& /*column*/, const PlainOf<S>& /*row*/, S* out) const { out[0] = S(0.0); }
  /// Of the picture and every derivative.
  virtual Symmetry symmetry() const { return Symmetry::none; }
  enum class Wanted { points, picture };
  /// Once, before the first point: makes the tables that pay for what is wanted.
  virtual void tabulate(Wanted, int /*threads*/) {}
};

/// The axis of the microscope meets the middle row, the middle of the picture.
template <class S>
bool on_middle_row(const Scene& scene, const S& center_y_px) {
  return stays_at(center_y_px, 0.5 * (scene.view.height - 1));
}
template <class S>
bool centred(const Scene& scene, const S& center_x_px, const S& center_y_px) {
  return stays_at(center_x_px, 0.5 * (scene.view.width - 1)) && on_middle_row(scene, center_y_px);
}

/// A line's direction that a mirror y -> -y leaves as it is.
template <class S>
bool mirrored(const S& x, const S& y, const S& z) {
  return stays_at(y, 0.0) || (stays_at(x, 0.0) && stays_at(z, 0.0));
}

}  // namespace birefit
