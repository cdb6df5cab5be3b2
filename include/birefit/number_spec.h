#pragma once
// What a number of a scene may be: said once, by the struct that has it (describe() in scene.h), and read by the config
// reader, the search for references and the tables of docs/configuration.md.

#include <limits>
#include <optional>
#include <string>

#include "birefit/parameters.h"

namespace birefit {

/// Unit, range, which of its limits are nature's own, and what holds where it is not given.
struct NumberSpec {
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();

  std::string unit;  ///< "um", "nm", "deg", "K", "V", "px" or ""
  double lower = -kInfinity, upper = kInfinity;
  bool lower_open = false, upper_open = false;
  double physical_lower = -kInfinity, physical_upper = kInfinity;  ///< see Parameter
  bool automatic = false;                                          ///< `fit: auto` is accepted
  bool linear = false;                                             ///< gain and offset
  bool percent = false;                                            ///< often given as a percentage by mistake
  bool fixed = false;                                              ///< cannot be fitted
  std::optional<double> fallback;                                  ///< value where it is not given
  bool optional = false;                                           ///< not given: an empty reference
  bool implied = false;                                            ///< by a short form; no key of its own
  Uncertainty known_to;                                            ///< where it is stated without another

  /// The range has the value; a limit that is open is no part of it.
  bool contains(double value) const {
    return (lower_open ? value > lower : value >= lower) && (upper_open ? value < upper : value <= upper);
  }

  /// Has this value where it is not given.
  NumberSpec or_else(double value) const {
    NumberSpec spec = *this;
    spec.fallback = value;
    return spec;
  }
  /// May be left out, for which the struct has a meaning of its own, or which another number makes up for.
  NumberSpec left_out() const {
    NumberSpec spec = *this;
    spec.optional = true;
    return spec;
  }
  /// Configs have no key for it: it comes with a short form, or not at all.
  NumberSpec of_short_forms() const {
    NumberSpec spec = left_out();
    spec.implied = true;
    return spec;
  }
  /// `fit: auto`: pictures tell where to start.
  NumberSpec found_in_pictures() const {
    NumberSpec spec = *this;
    spec.automatic = true;
    return spec;
  }
  /// Often given as a percentage by mistake.
  NumberSpec in_percent() const {
    NumberSpec spec = *this;
    spec.percent = true;
    return spec;
  }
  /// Nobody knows it better than to this standard deviation, in its unit, unless he says so.
  NumberSpec known_within(double sd) const {
    NumberSpec spec = *this;
    spec.known_to.sd = sd;
    return spec;
  }
  /// The same as a share of its value.
  NumberSpec known_within_share(double share) const {
    NumberSpec spec = *this;
    spec.known_to.share = share;
    return spec;
  }
  /// Its lower limit is a physical one.
  NumberSpec physical() const {
    NumberSpec spec = *this;
    spec.physical_lower = lower;
    return spec;
  }
};

/// The kinds of numbers that scenes have, to be narrowed by what NumberSpec offers.
namespace numbers {

/// From lower to upper, both limits allowed.
inline NumberSpec within(double lower, double upper, const char* unit = "") {
  NumberSpec spec;
  spec.unit = unit, spec.lower = lower, spec.upper = upper;
  return spec;
}
/// Above 0, at most `upper`.
inline NumberSpec positive(double upper, const char* unit = "") {
  NumberSpec spec = within(0, upper, unit);
  spec.lower_open = true;
  return spec;
}
/// A length in um, above 0, which is a physical limit.
inline NumberSpec length_um(double upper) { return positive(upper, "um").physical(); }
/// In degrees, up to a hundred turns: more is a typing error.
inline NumberSpec angle() { return within(-36000, 36000, "deg"); }
/// In degrees, within limits.
inline NumberSpec angle(double lower, double upper) { return within(lower, upper, "deg"); }
/// Of refraction: 1 to 4.
inline NumberSpec index() { return within(1, 4); }
/// Read off a mount, or off how the sample lies in it: its zero is as good.
inline NumberSpec dial() { return angle().known_within(1); }
/// Of a table, for about this temperature and wavelength.
inline NumberSpec tabulated_index() { return index().known_within(0.01); }

}  // namespace numbers
}  // namespace birefit
