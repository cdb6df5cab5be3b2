#pragma once
// Random problems of samples that make rings: droplets, shells, discs, plates.

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "independent_disc.h"
#include "random_problems.h"
#include "scene/polariscope.h"

namespace birefit::testing {

/// A droplet somewhere near the middle; its edge lies in the image.
inline void droplet(RandomProblem& p, double birefringence_low, double birefringence_high,
                    const std::function<void(Droplet&)>& director) {
  constexpr int kSize = 64;
  Scene s = seen(p, kSize, 0.3);
  s.view.center_x_px = p.anywhere("center_x", 26, 38);
  s.view.center_y_px = p.anywhere("center_y", 26, 38);
  Droplet sample;
  sample.diameter_um = p.anywhere("diameter_um", 5.5, 16);
  director(sample);
  s.sample = sample;
  s.material = ConstantIndices{p.b.fixed("ordinary", 1.52),
                               birefringence_high > birefringence_low
                                   ? p.anywhere("birefringence", birefringence_low, birefringence_high)
                                   : p.b.fixed("birefringence", birefringence_low)};
  s.surround_index = p.b.fixed("surround", 1.5);
  p.least_noise = 0.005;
  p.scenes.push_back(s);
}

inline void radial_droplet(RandomProblem& p) {
  droplet(p, 0.04, 0.4, [](Droplet&) {});
}
inline void droplet_in_a_field(RandomProblem& p) {
  droplet(p, 0.3, 0.3, [&](Droplet& sample) {
    AxialDirector axial;
    axial.reduced_field = p.anywhere("reduced_field", 1, 39);
    sample.director = axial;
  });
}
inline void shell(RandomProblem& p) {
  droplet(p, 0.3, 0.3, [&](Droplet& sample) {
    ShellDirector s;
    s.wall_um = p.anywhere("wall_um", 0.3, 2.5);
    sample.director = s;
  });
}
inline void heated_plate(RandomProblem& p) {
  Scene s = seen(p, 64, 0);
  Plate plate;
  plate.thickness_um = p.b.fixed("thickness_um", 800);
  plate.director.axis = {p.b.fixed("axis.x", -0.353553), p.b.fixed("axis.y", 0.353553), p.b.fixed("axis.z", -0.866025)};
  HeatStep heat;
  heat.fourier_number = p.b.fitted("fourier_number", p.scaled(0.004, 0.25), 0.002, 0.5);
  heat.cold_k = p.b.fixed("cold_k", 278);
  heat.hot_k = p.b.fixed("hot_k", 368);
  plate.heat = heat;
  plate.half_angle_deg = p.b.fixed("half_angle_deg", 8);
  s.sample = plate;
  s.material = E44Steinberg2020{p.b.fixed("temperature_k", 298)};
  s.surround_index = p.b.fixed("surround", 1.0);
  s.microscope.wavelength_nm = p.b.fixed("wavelength_640", 640);
  p.least_noise = 0.005;
  p.scenes.push_back(s);
}

/// A droplet that looks different from all sides: size and material known within bounds, one picture or three.
inline void turned_droplet(RandomProblem& p, double largest_um, const std::function<void(Droplet&)>& director) {
  constexpr int kSize = 48;
  const double diameter = p.scaled(4, largest_um), pixel_um = 1.6 * diameter / kSize, n_o = 1.52;
  const double most = std::min(0.4, 2.5 / diameter);
  Scene s = seen(p, kSize, pixel_um);
  s.view.center_x_px = p.anywhere("center_x", 18, 29);
  s.view.center_y_px = p.anywhere("center_y", 18, 29);
  Droplet sample;
  sample.diameter_um = p.around("diameter_um", diameter, 0.25, 0.3);
  director(sample);
  s.sample = sample;
  const double birefringence = p.scaled(0.02, most);
  s.material =
      ConstantIndices{p.b.fixed("ordinary", n_o), p.chance(0.5) ? p.around("birefringence", birefringence, 0.25, 0.3)
                                                                : p.b.fixed("birefringence", birefringence)};
  s.surround_index = p.b.fixed("surround", p.between(1.46, 1.52));
  const double polarizer = p.chance(0.5) ? 0 : p.between(0, 90);
  s.microscope.polarizer_deg = p.b.fixed("polarizer", polarizer);
  p.own_gains = p.chance(0.5);
  p.own_offsets = p.chance(0.5);
  const bool several = p.chance(0.3);
  for (const double analyzer : several ? std::vector<double>{90, 45, 0} : std::vector<double>{90}) {
    s.microscope.analyzer_deg = p.b.fixed("analyzer", polarizer + analyzer);
    p.scenes.push_back(s);
  }
  if (several && !p.own_gains && p.chance(0.5)) p.lamp_jitter = p.scaled(1e-3, 5e-3);
}

/// The axis has no sign (C17): azimuth + 180 degrees with the tilt reversed is the same droplet. The poles rise out of
/// the picture on either side, so that azimuths of half a turn and tilts of both signs are all there is.
inline void bipolar_droplet(RandomProblem& p) {
  turned_droplet(p, 14, [&](Droplet& sample) {
    BipolarDirector d;
    const bool tilted = p.chance(0.6);
    d.azimuth_deg = p.angle("azimuth_deg", tilted ? 360 : 180, 180);
    d.tilt_deg = tilted ? p.anywhere("tilt_deg", -90, 90) : p.b.fixed("tilt_deg", 0);
    d.pole_distance = p.chance(0.5) ? p.anywhere("pole_distance", 1, 2) : p.b.fixed("pole_distance", p.between(1, 1.5));
    if (tilted)
      p.symmetries.push_back([azimuth = d.azimuth_deg.index, tilt = d.tilt_deg.index](Theta& theta) {
        theta[static_cast<std::size_t>(azimuth)] += 180;
        theta[static_cast<std::size_t>(tilt)] *= -1;
      });
    sample.director = d;
  });
}

/// A field and its opposite do the same to a nematic.
inline void droplet_in_a_field_across(RandomProblem& p) {
  turned_droplet(p, 12, [&](Droplet& sample) {
    AxialDirector axial;
    axial.reduced_field = p.anywhere("reduced_field", 1, 25);
    axial.field_azimuth_deg = p.angle("field_azimuth_deg", 180);
    sample.director = axial;
  });
}

/// The core lies off the middle in the plane of the picture, within the wall.
inline void eccentric_shell(RandomProblem& p) {
  turned_droplet(p, 12, [&](Droplet& sample) {
    const double radius = 0.5 * p.truth_of(sample.diameter_um), wall = radius * p.between(0.2, 0.6);
    // Bounds within which the core cannot leave the sphere: |offset| stays below the thinnest wall.
    const double thinnest = 0.8 * wall, most = thinnest / std::sqrt(2.0) * 0.9;
    ShellDirector s;
    s.wall_um = p.b.fitted("wall_um", wall, thinnest, wall * p.between(1.1, 1.3));
    s.offset_um = {p.anywhere("offset_x", -most, most), p.anywhere("offset_y", -most, most), p.b.fixed("offset_z", 0)};
    sample.director = s;
  });
}

/// Load and its direction, which is the same after half a turn. Of the disc only what lies within the forces' reach.
inline void stressed_disc(RandomProblem& p) {
  constexpr int kSize = 96;
  IndependentDisc model;
  model.um_per_px = 133;
  model.circular = p.chance(0.5);
  Scene s = seen(p, kSize, model.um_per_px);
  s.microscope.wavelength_nm = p.b.fixed("wavelength_546", model.wavelength_nm);
  if (model.circular) make_circular_polariscope(s.microscope, p.b.fixing());
  s.view.center_x_px = p.anywhere("center_x", 46, 49);
  s.view.center_y_px = p.anywhere("center_y", 46, 49);
  StressedDisc disc;
  // Orders in the middle: 8 load C / (pi diameter wavelength) (docs/methods.md).
  const double load = p.scaled(30, 400);
  disc.load_n = p.b.fitted("load_n", load, load * p.between(0.1, 0.7), load * p.between(1.2, 3));
  disc.load_azimuth_deg = p.angle("load_azimuth_deg", 180);
  disc.diameter_um = p.b.fixed("diameter_um", 2 * model.radius_um);
  disc.thickness_um = p.b.fixed("thickness_um", model.thickness_um);
  disc.stress_optic_brewster = p.b.fixed("stress_optic_brewster", model.stress_optic_brewster);
  s.sample = disc;
  model.load_n = load;
  model.load_azimuth_deg = p.truth_of(disc.load_azimuth_deg);
  model.center_x_px = p.truth_of(s.view.center_x_px);
  model.center_y_px = p.truth_of(s.view.center_y_px);
  // Richardson's extrapolation of two midpoint rules.
  const auto mean = [&](int column, int row) {
    return (4 * model.pixel(column, row, 16) - model.pixel(column, row, 8)) / 3;
  };
  Mask mask(kSize, kSize, 0);
  std::vector<double> picture;
  for (int row = 0; row < kSize; ++row)
    for (int column = 0; column < kSize; ++column) {
      const double away = std::hypot(column - 47.5, row - 47.5) * model.um_per_px;
      mask(column, row) = away < 0.8 * model.radius_um;
      picture.push_back(mask(column, row) ? mean(column, row) : 0);
    }
  p.scenes.push_back(s);
  p.masks.push_back(mask);
  p.light.push_back(picture);
}

}  // namespace birefit::testing
