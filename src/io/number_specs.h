#pragma once
// What numbers of a config may be, by kind.

#include "io/config_reader.h"

namespace birefit {

inline NumberSpec open_length(double upper_um) {
  NumberSpec spec;
  spec.unit = "um";
  spec.lower = 0;
  spec.lower_open = true;
  spec.upper = upper_um;
  spec.physical_lower = 0;
  return spec;
}

inline NumberSpec angle() {
  NumberSpec spec;
  spec.unit = "deg";
  spec.lower = -36000;  // a hundred turns: more is a typing error
  spec.upper = 36000;
  return spec;
}

inline NumberSpec angle_within(double lower, double upper) {
  NumberSpec spec;
  spec.unit = "deg";
  spec.lower = lower;
  spec.upper = upper;
  return spec;
}

inline NumberSpec index_spec() {
  NumberSpec spec;
  spec.lower = 1;
  spec.upper = 4;
  return spec;
}

inline NumberSpec number_within(double lower, double upper) {
  NumberSpec spec;
  spec.lower = lower;
  spec.upper = upper;
  return spec;
}

inline NumberSpec aperture() {
  NumberSpec spec;
  spec.lower = 0;
  spec.lower_open = true;
  spec.upper = 1.6;
  spec.percent = true;
  return spec;
}

inline NumberSpec kelvin() {
  NumberSpec spec;
  spec.unit = "K";
  spec.lower = 100;
  spec.upper = 2000;
  return spec;
}

}  // namespace birefit
