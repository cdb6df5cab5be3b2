#pragma once
// Pictures of spheres whose exact series, or whose radial twin's, judges every model of waves.

#include "birefit/parameters.h"
#include "birefit/scene.h"

namespace birefit::study {

/// Ordinary index 1.52, 590 nm. The picture is diameter + 4 um wide.
struct Ball {
  double radius_um = 4.5, birefringence = 0.22, host = 1.52, objective_na = 0.4;
  double wall_um = 0;    ///< of a shell around a core of the host's index; 0: solid
  double offset_um = 0;  ///< of that core, along x and z
  double twist_deg = 0;  ///< of a radial director
  double tilt_deg = -1;  ///< from 0 on: bipolar, its axis so far out of the image plane
  double focus_um = 0, polarizer_deg = 45, analyzer_deg = 135;
  int pixels = 128;
};

struct BallScene {
  ParameterTable table;
  Scene scene;
  explicit BallScene(const Ball& ball) {
    const auto fixed = [&](const char* name, double value) { return table.add_constant(name, value); };
    Droplet droplet{fixed("diameter_um", 2 * ball.radius_um), RadialDirector{}};
    if (ball.twist_deg != 0) droplet.director = RadialDirector{fixed("twist_deg", ball.twist_deg)};
    if (ball.tilt_deg >= 0)
      droplet.director = BipolarDirector{fixed("azimuth_deg", 20), fixed("tilt_deg", ball.tilt_deg), {}};
    if (ball.wall_um > 0) {
      ShellDirector shell;
      shell.wall_um = fixed("wall_um", ball.wall_um);
      if (ball.offset_um != 0)
        shell.offset_um = {fixed("offset_x_um", ball.offset_um), fixed("offset_y_um", 0),
                           fixed("offset_z_um", ball.offset_um)};
      droplet.director = shell;
    }
    scene.sample = droplet;
    scene.material = ConstantIndices{fixed("ordinary", 1.52), fixed("birefringence", ball.birefringence)};
    scene.surround_index = fixed("index", ball.host);
    scene.microscope.wavelength_nm = fixed("wavelength_nm", 590);
    scene.microscope.polarizer_deg = fixed("polarizer_deg", ball.polarizer_deg);
    scene.microscope.analyzer_deg = fixed("analyzer_deg", ball.analyzer_deg);
    scene.microscope.objective_na = fixed("objective_na", ball.objective_na);
    if (ball.focus_um != 0) scene.microscope.focus_um = fixed("focus_um", ball.focus_um);
    scene.view.width = scene.view.height = ball.pixels;
    scene.view.pixel_size_um = fixed("pixel_size_um", (2 * ball.radius_um + 4) / ball.pixels);
    scene.view.center_x_px = fixed("center_x", 0.5 * (ball.pixels - 1));
    scene.view.center_y_px = fixed("center_y", 0.5 * (ball.pixels - 1));
  }
};

}  // namespace birefit::study
