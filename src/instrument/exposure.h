#pragma once
// The light that a sample sees: an exposure is made of beams of one direction each, and what they bring is added up
// (src/render). Heavy, as beam.h is: for the sources that make pictures; headers name BeamMaker alone.

#include <vector>

#include "instrument/beam.h"

namespace birefit {

struct WavelengthRule;  // instrument/channel_light.h

/// Light of one direction: all that a sample's picture knows of lamp and polarizing parts.
template <class S>
struct Beam {
  Direction direction;  ///< in the medium around the sample; for kinds that take tilted light
  Line<S> line;
};

/// One direction of light, for a picture or planner to ask in every scalar that it needs: with fewer derivatives, in
/// single numbers, in lanes. Refers to the microscope, which must outlive it.
class BeamMaker {
 public:
  BeamMaker(const Microscope& microscope, Direction direction) : microscope_(&microscope), direction_(direction) {}
  /// The same light for a sample that sums the wavelengths of a rule itself (SampleKind::sums_wavelengths), or, null,
  /// of one. The rule must outlive it.
  BeamMaker with(const WavelengthRule* rule) const {
    BeamMaker light = *this;
    light.rule_ = rule;
    return light;
  }
  const WavelengthRule* rule() const { return rule_; }
  const Microscope& microscope() const { return *microscope_; }
  template <class S>
  Beam<S> in(const Values<S>& value) const {
    return {direction_, Line<S>(*microscope_, value)};
  }

 private:
  const Microscope* microscope_;
  Direction direction_;
  const WavelengthRule* rule_ = nullptr;
};

/// Directions that do not interfere, and their shares of the light, which sum to 1.
struct Exposure {
  std::vector<BeamMaker> directions;
  std::vector<double> weights;
};
/// The microscope's: of one direction, the first that it states, else along its axis. Refers to it.
Exposure exposure_of(const Microscope&);

}  // namespace birefit
