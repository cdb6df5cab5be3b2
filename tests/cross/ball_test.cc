// Droplets and shells without symmetry about the view, against closed forms, tables and the symmetric model.

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "birefit/render.h"
#include "independent_droplet.h"
#include "medium/families/radial.h"
#include "reference_table.h"
#include "samples/sphere/ball.h"
#include "scene_builder.h"

namespace birefit {
namespace {
using namespace testing;

constexpr double kPi = std::numbers::pi;

/// A 10 um droplet of E12 on 64 x 64 pixels between crossed polarizers.
struct Ball {
  TableBuilder b;
  Scene scene;
  Demand demand;
  explicit Ball(double host = 1.5, double polarizer_deg = 0) {
    scene.microscope.wavelength_nm = b.fixed("wavelength_nm", 590);
    scene.microscope.polarizer_deg = b.fixed("polarizer_deg", polarizer_deg);
    scene.microscope.analyzer_deg = b.fixed("analyzer_deg", polarizer_deg + 90);
    scene.surround_index = b.fixed("host", host);
    ConstantIndices m;
    m.ordinary = b.fixed("ordinary", 1.52);
    m.birefringence = b.fixed("birefringence", 0.22);
    scene.material = m;
    scene.view.width = scene.view.height = 64;
    scene.view.pixel_size_um = b.fixed("pixel_size_um", 0.19);
    scene.view.center_x_px = b.fixed("x", 31.5);
    scene.view.center_y_px = b.fixed("y", 31.5);
    scene.view.rotation_deg = b.fixed("rotation", 0);
  }
  Image image(Droplet d) {
    d.diameter_um = b.fixed("diameter_um", 10);
    scene.sample = d;
    const Theta theta = b.table.values();
    return render(scene, plan(scene, demand, theta), theta, {}, 1).intensity;
  }
};
// Nested spheres solved once more by bisection elsewhere; printed with nine digits.
TEST(Ball, EccentricShellDirectorAgreesWithTheTable) {
  const ReferenceTable table(data_path("physics/shell_eccentric_director.csv"));
  ASSERT_GT(table.size(), 10u);
  for (std::size_t row = 0; row < table.size(); ++row) {
    const auto at = [&](const char* name) { return table.number(row, name); };
    const NestedField<double> field{{at("core_dx") / 100, at("core_dy") / 100, at("core_dz") / 100}, 0.87};
    const Vec3<double> n = field.at(Vec3<double>{at("x") / 100, at("y") / 100, at("z") / 100});
    EXPECT_NEAR(n.x, at("nx"), 2e-9);
    EXPECT_NEAR(n.y, at("ny"), 2e-9);
    EXPECT_NEAR(n.z, at("nz"), 2e-9);
  }
}

TEST(Ball, EccentricShellIsNormalToBothSpheres) {
  const NestedField<double> field{{0.1, -0.15, 0.12}, 0.7};
  for (double polar : {0.3, 1.2, 2.6})
    for (double azimuth : {0.0, 1.9, 4.0}) {
      const Vec3<double> u{std::sin(polar) * std::cos(azimuth), std::sin(polar) * std::sin(azimuth), std::cos(polar)};
      const Vec3<double> outer = field.at(u),
                         inner = field.at(Vec3<double>{0.1 + 0.7 * u.x, -0.15 + 0.7 * u.y, 0.12 + 0.7 * u.z});
      for (const Vec3<double>& n : {outer, inner}) EXPECT_NEAR(n.x * u.x + n.y * u.y + n.z * u.z, 1, 1e-12);
    }
}

// The 5CB shell of the table (200 um, wall 13 um) along unrefracted chords, by the column that the image uses.
TEST(Ball, ConcentricShellRetardanceAgreesWithTheTable) {
  const ReferenceTable table(data_path("physics/radial_chord_retardance.csv"));
  int rows = 0;
  for (std::size_t row = 0; row < table.size(); ++row) {
    const double core = table.number(row, "R_in_um");
    if (!(core > 0)) continue;
    ++rows;
    const double radius = table.number(row, "R_out_um"), b = table.number(row, "b_over_R") * radius,
                 n_o = table.number(row, "no"), n_e = table.number(row, "ne");
    const double from = b < core ? std::sqrt(core * core - b * b) : 0, half = std::sqrt(radius * radius - b * b);
    const ShellLaw<double> law{b, from, half - from, n_o * n_o, n_e * n_e};
    double sum = 0;
    constexpr int kNodes = 4000;  // midpoints of a smooth function: 1e-8 of it
    for (int i = 0; i < kNodes; ++i) {
      const OpticalPoint<double> p = law.at((i + 0.5) / kNodes);
      sum += retardance_per_length(p) * p.depth_slope_um / kNodes;
    }
    EXPECT_NEAR(sum, table.number(row, "retardance_um"), 1e-6 * sum + 2e-10) << "b/R " << table.number(row, "b_over_R");
  }
  EXPECT_GE(rows, 10);
}

// The same hedgehog as a droplet in no field along +x, which is not symmetric to the program, and as one that is. Each
// is held to 1e-4; pixel means take different points where fringes are fine, 1e-3 near the rim.
TEST(Ball, HedgehogIsTheSameFromAllSides) {
  Ball one, other;
  AxialDirector none;
  none.reduced_field = one.b.fixed("e", 0);
  none.field_azimuth_deg = one.b.fixed("azimuth", 20);
  Droplet d;
  d.director = none;
  const Image a = one.image(d), b = other.image(Droplet{});
  double worst = 0;
  for (int r = 0; r < 64; ++r)
    for (int c = 0; c < 64; ++c) {
      const double rho = std::hypot(c - 31.5, r - 31.5) * 0.19;
      if (rho > 0.6 && rho < 4.3) worst = std::max(worst, std::abs(a(c, r) - b(c, r)));
    }
  EXPECT_LT(worst, 5e-4);
}

// A core that is off the middle by nothing.
TEST(Ball, EccentricShellTendsToTheConcentricOne) {
  Ball one, other;
  ShellDirector centred, shifted;
  centred.wall_um = other.b.fixed("wall_um", 1.5);
  shifted.wall_um = one.b.fixed("wall_um", 1.5);
  for (int i = 0; i < 3; ++i)
    shifted.offset_um[static_cast<std::size_t>(i)] = one.b.fixed("offset" + std::to_string(i), 1e-7);
  Droplet a, b;
  a.director = shifted, b.director = centred;
  const Image first = one.image(a), second = other.image(b);
  double worst = 0;
  for (int r = 0; r < 64; ++r)
    for (int c = 0; c < 64; ++c) {
      const double rho = std::hypot(c - 31.5, r - 31.5) * 0.19;
      // Not the pixels of the core's edge (its image at 3.5 um times 1.52/1.50), whose kink each averages by its own
      // points.
      if (rho > 0.6 && std::abs(rho - 3.5) > 0.4 && rho < 4.3)
        worst = std::max(worst, std::abs(first(c, r) - second(c, r)));
    }
  EXPECT_LT(worst, 5e-4);
}

// Poles far away: a ball of uniform axis. In a host of its ordinary index nothing is refracted, and tangential E alone
// gives I = sin^2(2 azimuth) sin^2(k0 dn S), S = sqrt(R^2 - rho^2).
TEST(Ball, BipolarWithDistantPolesIsAUniformBall) {
  Ball ball(1.52);
  ball.demand.ceiling = Ceiling::e_only;
  BipolarDirector poles;
  poles.azimuth_deg = ball.b.fixed("azimuth", 30);
  poles.pole_distance = ball.b.fixed("distance", 1e5);
  Droplet d;
  d.director = poles;
  const Image image = ball.image(d);
  for (int r = 20; r < 40; r += 3)
    for (int c = 20; c < 40; c += 3) {
      // Mean over the pixel by 8 x 8 midpoints; the fringes are wide here.
      double mean = 0;
      for (int s = 0; s < 64; ++s) {
        const double x = (c - 31.5 + (s % 8 - 3.5) / 8) * 0.19, y = (31.5 - r - (s / 8 - 3.5) / 8) * 0.19;
        mean += std::pow(std::sin(kPi / 3) * std::sin(2 * kPi / 0.59 * 0.22 * std::sqrt(25 - x * x - y * y)), 2) / 64;
      }
      EXPECT_NEAR(image(c, r), mean, 2e-3) << c << " " << r;  // pixel means of 2 x 2 points here: (0.3 rad)^2 / 50
    }
}

TEST(Ball, BipolarFollowsTheSurfaceAndThePolesAxis) {
  const BipolarField<double> field{{0.6, 0.0, 0.8}, 1.0};
  for (double polar : {0.4, 1.5, 2.2})
    for (double azimuth : {0.3, 2.0, 5.0}) {
      const Vec3<double> u{std::sin(polar) * std::cos(azimuth), std::sin(polar) * std::sin(azimuth), std::cos(polar)};
      const Vec3<double> n = field.at(u), axial = field.at(Vec3<double>{0.3 * 0.6, 0.0, 0.3 * 0.8});
      EXPECT_NEAR(n.x * u.x + n.y * u.y + n.z * u.z, 0, 1e-10);
      EXPECT_NEAR(axial.x * 0.6 + axial.z * 0.8, 1, 1e-12);
    }
}

// A field in the image plane leaves two mirrors: the image between crossed polarizers along and across it has both.
TEST(Ball, FieldInTheImagePlaneLeavesTwoMirrors) {
  Ball ball;
  AxialDirector axial;
  axial.reduced_field = ball.b.fixed("e", 8);
  axial.field_azimuth_deg = ball.b.fixed("azimuth", 0);
  Droplet d;
  d.director = axial;
  const Image image = ball.image(d);
  double worst = 0, along = 0;
  for (int r = 0; r < 64; ++r)
    for (int c = 0; c < 64; ++c) {
      worst = std::max({worst, std::abs(image(c, r) - image(63 - c, r)), std::abs(image(c, r) - image(c, 63 - r))});
      along = std::max(along, std::abs(image(c, r) - image(r, c)));
    }
  EXPECT_LT(worst, 2e-5);  // a fifth of the accuracy: same rays, mirrored
  EXPECT_GT(along, 0.05);  // and not the diagonal ones
}

}  // namespace
}  // namespace birefit
