// A picture read from a table over the radius is the picture of one ray a point, derivatives included: droplets, and
// shells with the kink that a core's edge leaves.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "birefit/render.h"
#include "samples/choices.h"
#include "scene_builder.h"

namespace birefit {
namespace {
using namespace testing;

struct RadialCase {
  const char* name;
  double wall_um;    ///< 0: no core
  double twist_deg;  ///< 0: none
  double host;
  double na;  ///< 0: no limit
  bool tabulated;
  double field = 0, ring = 0;  ///< along the view; 0: none
};

const RadialCase kRadialCases[] = {
    {"droplet", 0, 0, 1.43, 0, true},
    {"twisted droplet", 0, 60, 1.43, 0, true},
    {"thick wall", 2.5, 0, 1.43, 0, true},
    {"thin wall", 0.6, 0, 1.50, 0, true},
    {"small core", 4.2, 0, 1.60, 0, true},
    {"the aperture ends before the core's edge", 0.9, 0, 1.33, 0.3, false},
    {"hedgehog in a field", 0, 0, 1.43, 0, true, 5},
    {"ring in a field", 0, 0, 1.50, 0, true, 9, 0.9},
};

TEST(RadialTable, IsThePictureOfOneRayAPoint) {
  for (const RadialCase& c : kRadialCases) {
    TableBuilder b;
    Scene s;
    Droplet droplet;
    droplet.diameter_um = b.fixed("diameter_um", 9.3);
    if (c.wall_um > 0) {
      ShellDirector shell;
      shell.wall_um = b.fixed("wall_um", c.wall_um);
      droplet.director = shell;
    } else if (c.twist_deg != 0) {
      droplet.director = RadialDirector{b.fixed("twist_deg", c.twist_deg)};
    } else if (c.field > 0) {
      AxialDirector axial;
      axial.reduced_field = b.fixed("reduced_field", c.field);
      if (c.ring > 0) axial.ring_radius = b.fixed("ring_radius", c.ring);
      droplet.director = axial;
    }
    s.sample = droplet;
    const ConstantIndices material{b.fixed("ordinary", 1.52), b.fixed("birefringence", 0.18)};
    s.material = material;
    s.surround_index = b.fixed("surround", c.host);
    s.microscope.wavelength_nm = b.fixed("wavelength_nm", 590);
    s.microscope.polarizer_deg = b.fixed("polarizer_deg", 10);
    s.microscope.analyzer_deg = b.fixed("analyzer_deg", 83);
    if (c.na > 0) s.microscope.objective_na = b.fixed("objective_na", c.na);
    s.view.width = s.view.height = 160;
    s.view.pixel_size_um = b.fixed("pixel_size_um", 0.07);
    s.view.center_x_px = b.fixed("center_x", 80.3);
    s.view.center_y_px = b.fixed("center_y", 78.9);
    std::vector<int> by{droplet.diameter_um.index, material.birefringence.index, s.view.center_x_px.index,
                        s.surround_index.index,
                        // Two combinations of the others: light knows sizes and indices in wavelengths only.
                        material.ordinary.index, s.microscope.wavelength_nm.index};
    if (c.wall_um > 0) by.push_back(std::get<ShellDirector>(droplet.director).wall_um.index);
    if (c.field > 0) by.push_back(std::get<AxialDirector>(droplet.director).reduced_field.index);
    if (c.ring > 0) by.push_back(std::get<AxialDirector>(droplet.director).ring_radius.index);
    const Theta theta = b.table.values();
    const RenderPlan table = plan(s, theta);
    EXPECT_EQ(choices(table).radial_panels > 0, c.tabulated) << c.name;
    RenderPlan rays = table;
    choices(rays).radial_panels = 0;
    const Rendering read = render(s, table, theta, by), direct = render(s, rays, theta, by);
    const auto worst = [](const Image& a, const Image& b) {
      double error = 0;
      for (std::size_t i = 0; i < a.values().size(); ++i)
        error = std::max(error, std::abs(a.values()[i] - b.values()[i]));
      return error;
    };
    double light = 0;
    for (const double v : direct.intensity.values()) light = std::max(light, v);
    EXPECT_GT(light, 0.5) << c.name;
    // The planner builds tables to 1e-3 of the accuracy; ten times that leaves room between the radii it looked at. A
    // director from elements has kinks between them, which polynomials follow to less, their slopes above all.
    const bool elements = c.field > 0;
    EXPECT_LT(worst(read.intensity, direct.intensity), (elements ? 2e-2 : 1e-2) * table.demand.intensity_accuracy)
        << c.name;
    for (std::size_t j = 0; j < by.size(); ++j) {
      // To the accuracy asked for, relative to the largest. Derivatives of a root at its end have no bound: a
      // thousandth of the pixels is left out.
      std::vector<double> error;
      double size = 0;
      for (std::size_t i = 0; i < read.derivatives[j].values().size(); ++i) {
        error.push_back(std::abs(read.derivatives[j].values()[i] - direct.derivatives[j].values()[i]));
        size = std::max(size, std::abs(direct.derivatives[j].values()[i]));
      }
      std::sort(error.begin(), error.end());
      EXPECT_GT(size, 0) << c.name;
      EXPECT_LT(error[error.size() - 1 - error.size() / 1000],
                (elements ? 5 : 1) * table.demand.intensity_accuracy * size)
          << c.name << ", " << b.table[by[j]].name;
    }
  }
}

}  // namespace
}  // namespace birefit
