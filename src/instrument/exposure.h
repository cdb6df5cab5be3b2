#pragma once
// The light that a sample sees: an exposure is made of beams of one direction each, and what they bring is added up
// (src/render). Heavy, as beam.h is: for the sources that make pictures; headers name BeamMaker alone.

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "instrument/beam.h"

namespace birefit {

struct WavelengthRule;  // instrument/channel_light.h

/// Light of one direction: all that a sample's picture knows of lamp and polarizing parts.
template <class S>
struct Beam {
  Direction direction;          ///< in the medium around the sample; for kinds that take tilted light
  std::array<double, 2> kappa;  ///< its transverse wavevector over k0, instead, where `direction` is along the axis
  Line<S> line;

  /// tan(incidence) times the unit vector of the azimuth, in a host of this index.
  std::array<S, 2> tangents(const S& n_host) const {
    if (direction.theta_deg != 0) {
      const double t = std::tan(direction.theta_deg * std::numbers::pi / 180),
                   a = direction.azimuth_deg * std::numbers::pi / 180;
      return {S(t * std::cos(a)), S(t * std::sin(a))};
    }
    const double square = kappa[0] * kappa[0] + kappa[1] * kappa[1];
    if (square == 0) return {S(0.0), S(0.0)};
    const S over = inverse(root(S(n_host * n_host - square)));
    return {kappa[0] * over, kappa[1] * over};
  }
};

/// One direction of light, for a picture or planner to ask in every scalar that it needs: with fewer derivatives, in
/// single numbers, in lanes. Refers to the microscope, which must outlive it.
class BeamMaker {
 public:
  BeamMaker(const Microscope& microscope, Direction direction, const std::array<double, 2>& kappa = {0, 0})
      : microscope_(&microscope), direction_(direction), kappa_(kappa) {}
  /// The same light for a sample that sums the wavelengths of a rule itself (SampleKind::sums_wavelengths), or, null,
  /// of one. The rule must outlive it.
  BeamMaker with(const WavelengthRule* rule) const {
    BeamMaker light = *this;
    light.rule_ = rule;
    return light;
  }
  const WavelengthRule* rule() const { return rule_; }
  const Microscope& microscope() const { return *microscope_; }
  /// Beam::kappa.
  const std::array<double, 2>& kappa() const { return kappa_; }
  template <class S>
  Beam<S> in(const Values<S>& value) const {
    return {direction_, kappa_, Line<S>(*microscope_, value)};
  }

 private:
  const Microscope* microscope_;
  Direction direction_;
  std::array<double, 2> kappa_;
  const WavelengthRule* rule_ = nullptr;
};

/// Directions that do not interfere, and their shares of the light, which sum to 1.
struct Exposure {
  std::vector<BeamMaker> directions;
  std::vector<double> weights;
};
/// The microscope's: of one direction, the first that it states, else along its axis. Refers to it.
Exposure exposure_of(const Microscope&);

/// The condenser's circles, transverse wavevectors over k0.
template <class S>
struct CondenserDisc {
  S radius, inner_radius;
  std::array<S, 2> middle;
};
/// Of a microscope that has one. `waves`: all of its light; the pupil decides what of it is seen. Else of layers, which
/// turn no light aside: where both lie about the axis, the part that the objective's aperture takes in.
template <class S>
CondenserDisc<S> condenser_disc(const Microscope& microscope, const Values<S>& value, bool waves) {
  const Condenser& condenser = *microscope.condenser;
  const S tilt = value.radians(condenser.tilt_deg), azimuth = value.radians(condenser.tilt_azimuth_deg);
  S sine, unused, across, along;
  sin_cos(tilt, sine, unused);
  sin_cos(azimuth, across, along);
  CondenserDisc<S> disc{value(condenser.na), value.get(condenser.inner_na, 0.0), {sine * along, sine * across}};
  if (!waves && microscope.objective_na)
    disc.radius = select(plain(sine) == 0, min_of(disc.radius, value(microscope.objective_na)), disc.radius);
  return disc;
}

/// Places in the unit circle and their weights, which sum to 1: `rings` Gauss radii by the radius squared, each of
/// max(5, 2 rings + 1) azimuths. Exact for polynomials of degree 2 rings, and, by the fifth azimuth, for what four
/// would miss: the cross that a homeotropic layer shows between polarizers.
struct DiscRule {
  struct Node {
    double square;  ///< of the radius
    double cos_azimuth, sin_azimuth, weight;
  };
  std::vector<Node> nodes;
  explicit DiscRule(int rings);
  /// Transverse wavevector over k0 of a node, between two circles.
  template <class S>
  static std::array<S, 2> kappa(const Node& n, const CondenserDisc<S>& disc) {
    const S inner = disc.inner_radius * disc.inner_radius,
            r = root(S(inner + n.square * (disc.radius * disc.radius - inner)));
    return {disc.middle[0] + n.cos_azimuth * r, disc.middle[1] + n.sin_azimuth * r};
  }
};
/// The condenser's directions at these values; `waves` as of condenser_disc().
Exposure condenser_exposure(const Microscope&, const Values<double>&, int rings, bool waves);

/// What the picture of a condenser changes by with its circles, from the light of the directions on them: the
/// derivative of the mean by parameter `index` is the sum of weight times the picture of each direction, plus `of_mean`
/// times the mean. Source: the derivative of an integral over a region is that of its edge's motion.
struct CondenserSlope {
  Exposure on_circles;
  double of_mean = 0;
};
/// `waves` as of condenser_disc(); of a propagated picture the transverse wavevectors, not their ratio to k0, stay as
/// they are when the wavelength changes: the derivative by the wavelength that this leaves out, too.
CondenserSlope condenser_slope(const Microscope&, const Theta&, int rings, int index, bool waves);
/// How a derivative by it is condenser_slope's: not at all, beside the pictures' own, or altogether.
enum class MovesCondenser { no, partly, alone };
MovesCondenser moves_condenser(const Microscope&, int index, bool waves);

}  // namespace birefit
