#pragma once
// A circular polariscope as a list of parts.

#include "birefit/scene.h"

namespace birefit {

/// Quarter-wave plates at 45 degrees from the polarizer, which they turn with, crossed with each other: no isoclinics.
/// `ninety_deg`: a constant of 90.
inline void make_circular_polariscope(Microscope& microscope, ParameterRef ninety_deg) {
  microscope.before = {Retarder{
      .phase_deg = ninety_deg, .retardance_nm = {}, .azimuth_deg = microscope.polarizer_deg, .turned_deg = 45}};
  microscope.behind = {Retarder{
      .phase_deg = ninety_deg, .retardance_nm = {}, .azimuth_deg = microscope.polarizer_deg, .turned_deg = -45}};
}

}  // namespace birefit
