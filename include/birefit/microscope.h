#pragma once
// What lights and images a sample.

#include <optional>
#include <variant>
#include <vector>

#include "birefit/light.h"
#include "birefit/number_spec.h"
#include "birefit/parameters.h"

namespace birefit {

/// A direction in the outside medium.
struct Direction {
  double theta_deg = 0;    ///< from +z, [0, 90)
  double azimuth_deg = 0;  ///< of the plane of incidence, from +x
};

/// Uniaxial crystals that plates are cut from (indices: src/instrument/plate_crystal.h).
enum class PlateCrystal { none, quartz, magnesium_fluoride, calcite };

/// A lossless plate between a polarizer and the sample: the field along its slow axis is behind the other by the phase.
struct Retarder {
  static constexpr const char* kKey = "retarder";
  /// Either of phase (at the light's wavelength) and retardance, and the azimuth of the slow axis from +x.
  ParameterRef phase_deg, retardance_nm, azimuth_deg;
  /// Added to the azimuth where given: of a plate that turns with a polarizer, which it is mounted on at an angle.
  ParameterRef turned_deg;
  /// The retardance is that at `at_nm` and goes with the crystal's birefringence; none: the same at all wavelengths.
  PlateCrystal crystal = PlateCrystal::none;
  double at_nm = 589.3;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("phase_deg", self.phase_deg, numbers::angle().left_out().known_within(3),
                 "at the light's wavelength; or");
    visit.number("retardance_nm", self.retardance_nm, numbers::within(-1e5, 1e5, "nm").left_out().known_within(5),
                 "the same at all wavelengths, or a crystal's at one");
    visit.number("azimuth_deg", self.azimuth_deg, numbers::dial(), "of the slow axis, from +x");
    visit.number("turned_deg", self.turned_deg, numbers::dial().of_short_forms(), "of the slow axis, from a polarizer");
  }
};
/// Turns the polarization by angle_deg, counter-clockwise in the image.
struct Rotator {
  static constexpr const char* kKey = "rotator";
  ParameterRef angle_deg;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("angle_deg", self.angle_deg, numbers::angle(),
                 "by which it turns the polarization, counter-clockwise");
  }
};
/// A plate whose optic axis is its normal, tilted in the light (Berek's compensator): none of the faces' losses.
struct TiltedPlate {
  static constexpr const char* kKey = "berek";
  /// The tilt turns the normal from the light towards the azimuth, from +x.
  ParameterRef thickness_um, tilt_deg, azimuth_deg;
  PlateCrystal crystal = PlateCrystal::magnesium_fluoride;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("thickness_um", self.thickness_um, numbers::length_um(1e5), "of the plate");
    visit.number("tilt_deg", self.tilt_deg, numbers::within(-80, 80, "deg"), "of its normal against the light, in air");
    visit.number("azimuth_deg", self.azimuth_deg, numbers::dial(), "of the plane in which it is tilted, from +x");
  }
};
/// What light meets between a polarizer and the sample.
using PolarizingPart = std::variant<Retarder, Rotator, TiltedPlate>;

/// Koehler illumination: plane waves that do not interfere, of all directions whose transverse wavevector over k0 lies
/// within a circle, or between two circles, with equal shares of the light.
struct Condenser {
  /// Radii of the circles. inner_na not given: 0, the full circle; below na.
  ParameterRef na, inner_na;
  /// Where the circles' middle lies, as a direction in air: from +z, and the azimuth of its plane from +x. Not given:
  /// 0.
  ParameterRef tilt_deg, tilt_azimuth_deg;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("na", self.na, numbers::positive(1.6).in_percent().known_within_share(0.1), "of the condenser");
    visit.number("inner_na", self.inner_na, numbers::within(0, 1.6).left_out(),
                 "of a stop in its middle: directions between the two apertures");
    visit.number("tilt_deg", self.tilt_deg, numbers::within(-80, 80, "deg").left_out(),
                 "between the middle of its directions and the axis, in air");
    visit.number("tilt_azimuth_deg", self.tilt_azimuth_deg, numbers::angle().left_out(),
                 "of the plane in which it is tilted, from +x");
  }
};

/// Light, polarizers and lenses, from the lamp to the camera; azimuths from +x, counter-clockwise in the image.
struct Microscope {
  ParameterRef wavelength_nm;  ///< vacuum; with `channel_light` one of its wavelengths, which pictures do not depend on
  std::optional<ChannelLight> channel_light;  ///< not given: a line of this wavelength
  std::vector<Crosstalk> crosstalk;           ///< with `channel_light`: other channels' light in this one
  ParameterRef polarizer_deg;                 ///< not given: none, the light that comes in is unpolarized
  ParameterRef analyzer_deg;                  ///< not given: none, all that leaves the sample is seen
  /// Flux that is let through along the polarizer over flux across it, both as they come in; >= 1; not given: ideal.
  ParameterRef polarizer_extinction_ratio, analyzer_extinction_ratio;
  /// Between polarizer and sample, between sample and analyser; in the order in which light meets them.
  std::vector<PolarizingPart> before, behind;
  /// FWHM of a line that is Gaussian in wavelength; not given: not stated, a single wavelength. Without channel_light.
  ParameterRef bandwidth_nm;
  /// Not given: light of one direction. Summed over for layers and by wave optics; of other samples and rays it enters
  /// the model error.
  std::optional<Condenser> condenser;
  /// Not given: not stated. Waves: the objective's band limit; droplet rays leaving steeper than this are lost.
  ParameterRef objective_na;
  /// focal plane, from the middle of the sample along the light; not given: 0. Ceiling::wave only
  ParameterRef focus_um;
  bool aplanatic = false;             ///< imaging: focal_plane (default) or aplanatic, docs/conventions.md
  std::vector<Direction> directions;  ///< slab scenes

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("light.wavelength_nm", self.wavelength_nm, numbers::within(100, 20000, "nm").known_within_share(0.003),
                 "vacuum");
    visit.number("light.bandwidth_nm", self.bandwidth_nm, numbers::within(0, 5000, "nm").left_out(),
                 "FWHM of the line");
    visit.inside("light", self.channel_light);
    visit.inside("camera.crosstalk", self.crosstalk);
    visit.number("polarizer_deg", self.polarizer_deg, numbers::dial(), "from +x");
    visit.number("analyzer_deg", self.analyzer_deg, numbers::dial(), "from +x");
    visit.number("polarizer_extinction_ratio", self.polarizer_extinction_ratio,
                 numbers::within(1, 1e12).physical().left_out(), "flux along over flux across");
    visit.number("analyzer_extinction_ratio", self.analyzer_extinction_ratio,
                 numbers::within(1, 1e12).physical().left_out(), "flux along over flux across");
    visit.number("objective_na", self.objective_na,
                 numbers::positive(1.6).in_percent().left_out().known_within_share(0.03), "of the objective");
    visit.inside("condenser", self.condenser);
    visit.number("focus_um", self.focus_um, numbers::within(-1000, 1000, "um").left_out().known_within(0.3),
                 "plane in focus, from the mid plane along the light");
    visit.inside("before", self.before);
    visit.inside("behind", self.behind);
  }
};

}  // namespace birefit
