// Sampled fields against closed forms and against a second computation that shares no code.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <functional>
#include <numbers>

#include "birefit/render.h"
#include "birefit/volume.h"
#include "independent_volume.h"
#include "instrument/exposure.h"
#include "medium/families/ball.h"
#include "samples/volume/volume.h"
#include "samples/waves/wave.h"
#include "scene_builder.h"

namespace birefit::testing {
namespace {

constexpr double kPi = std::numbers::pi;

struct Sampled {
  Scene scene;
  Demand demand;
  TableBuilder t;
  Theta theta() const { return t.table.values(); }
};

Sampled sampled(std::shared_ptr<const VolumeGrid> grid, double birefringence, int size, double pixel_um) {
  Sampled s;
  SampledVolume volume;
  volume.grid = std::move(grid);
  s.scene.sample = volume;
  s.scene.material = ConstantIndices{s.t.fixed("ordinary", 1.52), s.t.fixed("birefringence", birefringence)};
  s.scene.microscope.wavelength_nm = s.t.fixed("wavelength_nm", 590);
  s.scene.microscope.polarizer_deg = s.t.fixed("polarizer_deg", 0);
  s.scene.microscope.analyzer_deg = s.t.fixed("analyzer_deg", 90);
  s.scene.view.width = s.scene.view.height = size;
  s.scene.view.pixel_size_um = s.t.fixed("pixel_size_um", pixel_um);
  s.scene.view.center_x_px = s.t.fixed("center_x", 0.5 * (size - 1));
  s.scene.view.center_y_px = s.t.fixed("center_y", 0.5 * (size - 1));
  s.scene.view.rotation_deg = s.t.fixed("rotation_deg", 0);
  return s;
}

template <class Field>
std::shared_ptr<VolumeGrid> grid_of(int nx, int ny, int nz, double spacing_um, const Field& field) {
  auto grid = std::make_shared<VolumeGrid>();
  grid->nx = nx, grid->ny = ny, grid->nz = nz;
  grid->spacing_um = {spacing_um, spacing_um, spacing_um};
  for (int k = 0; k < nz; ++k)
    for (int j = 0; j < ny; ++j)
      for (int i = 0; i < nx; ++i) grid->nodes.push_back(field(i, j, k));
  return grid;
}

std::shared_ptr<VolumeGrid> grid_of(const IndependentVolume& v) {
  return grid_of(v.nx, v.ny, v.nz, v.spacing_um, [&](int i, int j, int k) {
    const std::size_t node = static_cast<std::size_t>((k * v.ny + j) * v.nx + i);
    const auto& n = v.director[node];
    return director_tensor(n[0], n[1], n[2], v.inside[node] ? 1 : 0);
  });
}

/// n_eff - n_o of a ray at this square of the sine of its angle with the axis.
double seen(double n_o, double n_e, double sin_sq) {
  return n_o * n_e / std::sqrt(n_o * n_o * sin_sq + n_e * n_e * (1 - sin_sq)) - n_o;
}

// One axis everywhere is one retarder: sin^2(2 azimuth) sin^2(phase / 2), whatever the order at the nodes is called.
// Half the order has half the birefringence.
TEST(Volume, UniformBoxIsOneRetarder) {
  const double azimuth = 0.6, tilt = 0.35;
  for (double order : {1.0, 0.5}) {
    const auto grid = grid_of(7, 6, 9, 0.9, [&](int, int, int) {
      return director_tensor(std::cos(tilt) * std::cos(azimuth), std::cos(tilt) * std::sin(azimuth), std::sin(tilt),
                             order);
    });
    Sampled s = sampled(grid, 0.11, 12, 0.25);
    s.t.table[s.scene.view.rotation_deg].value = 12;
    const RenderPlan p = plan(s.scene, s.demand, s.theta());
    const Image image = render(s.scene, p, s.theta()).intensity;
    const double phase = 2 * kPi / 0.59 * 8 * 0.9 * seen(1.52, 1.52 + order * 0.11, std::cos(tilt) * std::cos(tilt));
    const double expected = std::pow(std::sin(2 * (azimuth + 12 * kPi / 180)) * std::sin(phase / 2), 2);
    // 1e-12 of full order is added along z (principal_axis), rounding of some ten radians.
    for (double value : image.values()) EXPECT_NEAR(value, expected, 1e-10);
  }
}

// Beside the box there is nothing: Malus' law of the polarizers alone.
TEST(Volume, BesideTheBoxTheFieldIsOpen) {
  Sampled s = sampled(grid_of(4, 4, 4, 0.5, [](int, int, int) { return director_tensor(0.6, 0.8, 0); }), 0.1, 40, 0.2);
  s.t.table[s.scene.microscope.analyzer_deg].value = 30;
  const RenderPlan p = plan(s.scene, s.demand, s.theta());
  const Image image = render(s.scene, p, s.theta()).intensity;
  EXPECT_NEAR(image(0, 0), 0.75, 1e-12);
  EXPECT_NEAR(image(39, 20), 0.75, 1e-12);
  // Pixels 17 to 22 lie in the box whole; not one of them knows its edge.
  for (int i = 17; i <= 22; ++i) EXPECT_NEAR(image(i, 17), image(19, 19), 1e-12) << i;
}

// Ninety degrees of twist between crossed polarizers (Gooch & Tarry, J. Phys. D 8, 1575 (1975)), which is exact for a
// transport that keeps E alone. Between two layers the interpolated axis turns a little unevenly, the same before and
// behind the middle: the error of a layer is of fifth order in its twist, of the cell of fourth; 2^4 from one grid to
// the next, above 10 asked.
TEST(Volume, TwistedBoxIsGoochAndTarrys) {
  double before = 0;
  for (int cells : {8, 16, 32}) {
    const double depth = 6;
    const auto grid = grid_of(3, 3, cells + 1, depth / cells, [&](int, int, int k) {
      const double a = 0.3 + 0.5 * kPi * k / cells;
      return director_tensor(std::cos(a), std::sin(a), 0);
    });
    Sampled s = sampled(grid, 0.09, 3, 0.01);
    s.demand.ceiling = Ceiling::e_only;
    s.demand.intensity_accuracy = 1e-9;
    s.t.table[s.scene.microscope.polarizer_deg].value = 0.3 * 180 / kPi;
    s.t.table[s.scene.microscope.analyzer_deg].value = 0.3 * 180 / kPi + 90;
    const RenderPlan p = plan(s.scene, s.demand, s.theta());
    const double u = 2 * depth * 0.09 / 0.59,
                 expected = 1 - std::pow(std::sin(0.5 * kPi * std::sqrt(1 + u * u)), 2) / (1 + u * u);
    const double error = std::abs(render(s.scene, p, s.theta()).intensity(1, 1) - expected);
    if (before > 0) {
      EXPECT_LT(error, before / 10) << cells;
    }
    before = error;
  }
  EXPECT_LT(before, 1e-6);
}

/// Root mean square of the difference in crossed intensity, over rays between two distances from the middle, to the
/// radial field's.
double ball_error(int n, bool masked, double from_um, double to_um) {
  const double radius = 4, half_side = 4.3, dn = 0.12;
  IndependentVolume v = radial_ball(n, masked ? radius : 100, half_side);
  Sampled s = sampled(grid_of(v), dn, 3, 0.1);
  const VolumeOptics<double> o(s.scene, Values<double>(s.theta(), {}));
  const TransportMethod<double>& method = transport_method<double>("magnus4");
  const Mesh mesh = uniform_mesh(4 * (n - 1), o.breaks);
  double sum = 0;
  int count = 0;
  for (int i = 0; i < 400; ++i) {
    const double b = from_um + (to_um - from_um) * (i + 0.5) / 400, azimuth = 2.399963 * i;
    const double half = masked ? std::sqrt(radius * radius - b * b) : half_side;
    double phase = 0;  // by the midpoint rule: smooth, 2000 points are good to 1e-7
    for (int k = 0; k < 2000; ++k) {
      const double z = half * ((k + 0.5) / 1000 - 1);
      phase += 2 * kPi / 0.59 * seen(1.52, 1.52 + dn, b * b / (b * b + z * z)) * half / 1000;
    }
    const double exact = std::pow(std::sin(2 * azimuth) * std::sin(phase / 2), 2);
    const Mat2<double> j =
        volume_jones(o, 1 + b * std::cos(azimuth) / 0.1, 1 - b * std::sin(azimuth) / 0.1, method, mesh);
    sum += square(norm(j.c) - exact);
    ++count;
  }
  return std::sqrt(sum / count);
}

// The radial field sampled on n^3 nodes. Without a mask the interpolation's error is of second order in the spacing;
// with one the surface is smeared over a cell: first order, at both ends of every ray.
TEST(Volume, RadialBallTendsToTheClosedForm) {
  double inside[3], masked[3];
  const int n[3] = {16, 32, 64};
  for (int i = 0; i < 3; ++i) {
    inside[i] = ball_error(n[i], false, 1.5, 4);
    masked[i] = ball_error(n[i], true, 1.5, 3.8);
    RecordProperty("inside_" + std::to_string(n[i]), std::to_string(inside[i]));
    RecordProperty("masked_" + std::to_string(n[i]), std::to_string(masked[i]));
  }
  const auto order = [](double a, double b) { return std::log2(a / b); };
  // Observed: 2.5e-3, 5.1e-4, 1.5e-4 (orders 2.3 and 1.8) and 0.053, 0.017, 0.0085 (1.6 and 1.0).
  EXPECT_GT(order(inside[0], inside[2]) / 2, 1.8);
  EXPECT_LT(inside[2], 1e-3);
  // Where the nodes fall against the surface is chance, hence from 16 to 64 in one.
  EXPECT_GT(order(masked[0], masked[2]) / 2, 0.8);
}

// The same field by eigenvectors in closed form and complex matrices of thin slices, with any polarizers and turned in
// the image. It leaves out what keeping H continuous adds, as e_only does. 400 slices a cell in turn: midpoints, of
// second order.
TEST(Volume, AgreesWithThinSlices) {
  IndependentVolume v;
  v.nx = 5, v.ny = 4, v.nz = 6;
  v.spacing_um = 0.8;
  for (int i = 0; i < v.nx * v.ny * v.nz; ++i) {
    const double tilt = 0.5 * std::sin(0.9 * i), azimuth = 0.4 * std::cos(1.3 * i) + 0.03 * i;
    v.director.push_back({static_cast<float>(std::cos(tilt) * std::cos(azimuth)),
                          static_cast<float>(std::cos(tilt) * std::sin(azimuth)), static_cast<float>(std::sin(tilt))});
    v.inside.push_back(i % 7 != 3);
  }
  v.birefringence = 0.15;
  v.polarizer_deg = 17, v.analyzer_deg = 71, v.rotation_deg = 25;
  v.center_x_px = 10.3, v.center_y_px = 9.1, v.um_per_px = 0.1;
  v.slices = 400;
  Sampled s = sampled(grid_of(v), 0.15, 21, 0.1);
  s.demand.ceiling = Ceiling::e_only;
  for (const auto& [ref, value] : {std::pair{s.scene.microscope.polarizer_deg, 17.0},
                                   {s.scene.microscope.analyzer_deg, 71.0},
                                   {s.scene.view.rotation_deg, 25.0},
                                   {s.scene.view.center_x_px, 10.3},
                                   {s.scene.view.center_y_px, 9.1}})
    s.t.table[ref].value = value;
  RenderPlan p = plan(s.scene, s.demand, s.theta());
  p.method = "magnus4";
  p.steps = 40 * (v.nz - 1);
  const Theta theta = s.theta();
  const Values<Pack> value(theta, {});
  const Exposure exposure = exposure_of(s.scene.microscope);
  const auto model = make_volume_image<Pack>(s.scene, p, value, exposure.directions.front());
  for (int i = 0; i < 60; ++i) {
    const double column = 4 + 12 * std::fmod(0.7548776662466927 * i, 1.0),
                 row = 4 + 10 * std::fmod(0.5698402909980532 * i, 1.0);
    // Near a crossing of eigenvalues the axis of the model is a little smoother than the exact one.
    Pack light;
    model->light(Pack(column), Pack(row), &light);
    EXPECT_NEAR(lane(light, 0), v.point(column, row), 2e-5) << column << " " << row;
  }
}

// ---- waves ---------------------------------------------------------------------------------------------------------

/// Its picture by waves at NA 0.5, pixels out to 1 um beyond a sphere of that radius.
Sampled sampled_waves(std::shared_ptr<const VolumeGrid> grid, double radius_um, double host) {
  Sampled s = sampled(std::move(grid), 0.18, 48, (2 * radius_um + 2) / 48);
  s.demand.ceiling = Ceiling::wave;
  s.scene.microscope.objective_na = s.t.fixed("objective_na", 0.5);
  s.scene.surround_index = s.t.fixed("index", host);
  return s;
}
/// The same with a droplet of that radius in place of the box.
double error_against_droplet(const Sampled& sampled_scene, const RenderPlan& p, double radius_um,
                             const std::function<void(Sampled&, Droplet&)>& direct) {
  const Theta theta = sampled_scene.theta();
  const Image image = render(sampled_scene.scene, p, theta).intensity;
  Sampled exact = sampled_scene;
  Droplet droplet{exact.t.fixed("diameter_um", 2 * radius_um), RadialDirector{}};
  direct(exact, droplet);
  exact.scene.sample = droplet;
  const Theta with_diameter = exact.theta();
  return picture_error(image,
                       render(exact.scene, plan(exact.scene, exact.demand, with_diameter), with_diameter).intensity);
}

// A radial ball on 64^3 nodes, host outside, by its exact series. Propagation is within 0.01 to 0.02 of the picture's
// RMS (tests/cross/split_step_test.cc). The surface lies half-way between nodes 0.07 um apart where it should lie
// anywhere between them: an error of 0.02 um rms, of both signs over a few hundred cells, so of a thousandth of a
// micrometre on average; where a ring is half as wide as a wavelength, another 0.01.
TEST(Volume, RadialBallByWavesIsItsSeries) {
  for (const double host : {1.47, 1.52, 1.6}) {
    const Sampled s = sampled_waves(grid_of(radial_ball(64, 2, 2.3)), 2, host);
    const RenderPlan p = plan(s.scene, s.demand, s.theta());
    const double error = error_against_droplet(s, p, 2, [](Sampled&, Droplet&) {});
    std::printf("radial ball on 64^3 nodes in %g: %.4f of the picture's RMS from the series\n", host, error);
    EXPECT_LT(error, 0.03) << host;
  }
}

// A field without symmetry, turned in the image: a bipolar droplet whose poles point 30 degrees towards the light's
// end. Both by propagation, so what differs is the sampling; poles on the wrong side in x, y or z cost half of the
// picture or more.
TEST(Volume, TurnedBipolarBallByWavesIsTheDroplet) {
  const double radius = 2, tilt = 30 * kPi / 180, half_side = 2.3;
  const BipolarField<double> field{{std::cos(tilt), 0.0, std::sin(tilt)}, 1.0};
  const int n = 64;
  const double spacing = 2 * half_side / (n - 1);
  const auto grid = grid_of(n, n, n, spacing, [&](int i, int j, int k) {
    const auto at = [&](int m) { return (m - 0.5 * (n - 1)) * spacing / radius; };
    const double x = at(i), y = at(j), z = at(k);
    if (x * x + y * y + z * z > 1) return std::array<double, 6>{};
    const Vec3<double> a = field.at(Vec3<double>{x, y, z});
    return director_tensor(a.x, a.y, a.z);
  });
  Sampled s = sampled_waves(grid, radius, 1.5);
  s.t.table[s.scene.view.rotation_deg].value = 25;
  s.t.table[s.scene.microscope.analyzer_deg].value = 70;
  const RenderPlan p = plan(s.scene, s.demand, s.theta());
  const auto bipolar = [&](double tilt_deg) {
    return error_against_droplet(s, p, radius, [&](Sampled& exact, Droplet& droplet) {
      exact.t.table[exact.scene.view.rotation_deg].value = 0;
      droplet.director = BipolarDirector{exact.t.fixed("azimuth_deg", 25), exact.t.fixed("tilt_deg", tilt_deg), {}};
    });
  };
  const double same = bipolar(30), mirrored = bipolar(-30);
  std::printf("bipolar on 64^3 nodes: %.4f of the picture's RMS from the droplet, %.4f from its mirror image\n", same,
              mirrored);
  EXPECT_LT(same, 0.03);  // as the radial ball's
  EXPECT_LT(same, p.numerical_error + p.model_error);
  EXPECT_GT(mirrored, 5 * same);
}

// Maxwell's equations, marched through the very same samples: both surfaces of the box, too.
TEST(Volume, BoxByWavesAgreesWithTheMarch) {
  const auto grid = grid_of(7, 9, 8, 0.4, [](int i, int j, int k) {
    const double tilt = 0.5 * std::sin(0.5 * i), azimuth = 0.7 * std::cos(0.6 * j) + 0.1 * k;
    return director_tensor(std::cos(tilt) * std::cos(azimuth), std::cos(tilt) * std::sin(azimuth), std::sin(tilt), 0.8);
  });
  const Sampled s = sampled_waves(grid, 1.6, 1.5);
  const Theta theta = s.theta();
  const RenderPlan p = plan(s.scene, s.demand, theta);
  EXPECT_FALSE(p.warnings.empty());  // no ball is like it: its error is not measured
  const double apart = picture_error(render(s.scene, p, theta).intensity, image_by_march(s.scene, theta));
  std::printf("box: propagation and march %.4f of the picture's RMS apart\n", apart);
  EXPECT_LT(apart, 0.04);  // 0.02 of propagation at NA 0.5, 0.01 of the march, and the corners of a box
}

TEST(Volume, WavesAreRefusedWhereSomethingIsMissing) {
  Sampled s = sampled_waves(grid_of(radial_ball(8, 1, 1.2)), 1, 1.5);
  const auto refused = [&](const char* what) {
    try {
      plan(s.scene, s.demand, s.theta());
    } catch (const UserError& error) {
      return error.problems().front().what.find(what) != std::string::npos;
    }
    return false;
  };
  EXPECT_FALSE(refused(""));
  s.demand.method = "series";
  EXPECT_TRUE(refused("radial droplets"));
  s.demand.method = "auto";
  s.scene.microscope.objective_na = {};
  EXPECT_TRUE(refused("objective_na"));
  s.scene.microscope.objective_na = s.t.fixed("objective_na", 0.5);
  s.scene.surround_index = {};
  EXPECT_TRUE(refused("sample.surround"));
  s.scene.surround_index = s.t.fixed("index2", 1.5);
  std::get<SampledVolume>(s.scene.sample).scale = s.t.fixed("scale", 500);
  EXPECT_TRUE(refused("GB"));
}

// The planner's promise: means over pixels within the accuracy asked, where a fine sampling tells them (kinks at cell
// faces, too).
TEST(Volume, PixelMeansHoldTheAccuracy) {
  IndependentVolume v = radial_ball(24, 100, 4);
  Sampled s = sampled(grid_of(v), 0.12, 24, 0.3);
  const RenderPlan p = plan(s.scene, s.demand, s.theta());
  const Image image = render(s.scene, p, s.theta()).intensity;
  RenderPlan fine = p;
  fine.means.samples.assign(1, 8);
  fine.steps = 8 * 23;
  fine.method = "magnus4";
  const Image reference = render(s.scene, fine, s.theta()).intensity;
  double worst = 0;
  for (int r = 0; r < 24; ++r)
    for (int c = 0; c < 24; ++c)
      // a defect is no place for a promise
      if (std::hypot(c - 11.5, r - 11.5) > 3) worst = std::max(worst, std::abs(image(c, r) - reference(c, r)));
  EXPECT_LT(worst, 3 * s.demand.intensity_accuracy);  // measured on a few pixels of each ring
  EXPECT_FALSE(p.left_out.empty());                   // straight rays
}

}  // namespace
}  // namespace birefit::testing
