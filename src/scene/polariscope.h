#pragma once
// A circular polariscope as a list of parts.

#include <string>

#include "birefit/scene.h"

namespace birefit {

/// Quarter-wave plates at 45 degrees from the polarizer, which they turn with, crossed with each other: no isoclinics.
/// Each is a plate and a mount of its own: constant(name, NumberSpec, value) makes a number that is known as its
/// NumberSpec says, of the names before.phase_deg, before.turned_deg, behind.phase_deg, behind.turned_deg.
template <class Constant>
void make_circular_polariscope(Microscope& microscope, const Constant& constant) {
  const auto plate = [&](const std::string& name, double turned_deg) {
    return Retarder{.phase_deg = constant(name + ".phase_deg", numbers::angle().known_within(3), 90),
                    .retardance_nm = {},
                    .azimuth_deg = microscope.polarizer_deg,
                    .turned_deg = constant(name + ".turned_deg", numbers::dial(), turned_deg)};
  };
  microscope.before = {plate("before", 45)};
  microscope.behind = {plate("behind", -45)};
}

}  // namespace birefit
