// Curved rays of droplets and shells against independent integration (tests/data/physics/README.md) and limits.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdio>
#include <map>
#include <memory>
#include <numbers>
#include <vector>

#include "birefit/fit.h"
#include "independent_droplet.h"
#include "independent_rays.h"
#include "instrument/exposure.h"
#include "medium/families/axial_equilibrium.h"
#include "rays/eikonal.h"
#include "reference_table.h"
#include "samples/kind.h"
#include "scene_builder.h"
#include "study/ball_scene.h"

namespace birefit {
namespace {
using namespace testing;

/// Radius 1, wavenumber 1.
template <class S>
DropletOptics<S> droplet(double n_o, double n_e, double n_host) {
  DropletOptics<S> o;
  o.radius_um = S(1.0);
  o.n_o = S(n_o), o.n_e = S(n_e), o.n_host = S(n_host);
  o.k0 = S(1.0);
  return o;
}
template <class S>
DropletOptics<S> shell(double n_o, double n_e, double n_host, double core, double core_index) {
  DropletOptics<S> o = droplet<S>(n_o, n_e, n_host);
  o.director = DropletOptics<S>::Director::shell;
  o.core_um = S(core), o.core_index = S(core_index);
  return o;
}
template <class S>
DropletOptics<S> in_field(double n_o, double n_e, double n_host, const S& e, const S& ring, bool has_ring) {
  DropletOptics<S> o = droplet<S>(n_o, n_e, n_host);
  o.director = DropletOptics<S>::Director::axial;
  o.axial = std::make_shared<const AxialField<S>>(e, ring, has_ring);
  return o;
}

double degrees(double rad) { return rad * 180 / std::numbers::pi; }

// ---- tables of closed forms and integrations made elsewhere (tests/data/physics/README.md) -------------------------

// Where the ray leaves and its optical path, by Runge-Kutta that met the closed form's angle within 2e-5
// degrees: 3.5e-7 of the radius, n_e times that of the path.
TEST(EikonalDroplet, RaysLeaveWhereIndependentOnesDo) {
  const ReferenceTable table(data_path("physics/hedgehog_eray.csv"));
  for (std::size_t row = 0; row < table.size(); ++row) {
    const double n_o = table.number(row, "no"), b = table.number(row, "b_over_R");
    const MeridionalRay<double> ray = meridional_ray({1.0, table.number(row, "ne") / n_o}, true, std::asin(b));
    // The table's light runs along -y.
    EXPECT_NEAR(ray.exit_rho, table.number(row, "exit_x_over_R"), 1.05e-6) << b;
    EXPECT_NEAR(ray.exit_z, -table.number(row, "exit_y_over_R"), 1.05e-6) << b;
    const double angle = degrees(std::atan2(-ray.exit_z, ray.exit_rho));
    EXPECT_NEAR(angle, table.number(row, "closed_form_exit_angle_deg"), 3e-6) << b;
    EXPECT_NEAR(angle, table.number(row, "rk4_exit_angle_deg"), 6e-5) << b;  // three times the difference stated
    EXPECT_NEAR(n_o * ray.path, table.number(row, "optical_path_over_R"), 1.05e-6 * table.number(row, "ne")) << b;
  }
}

/// Of a straight chord at distance b, surround index n_o: Simpson's rule on b sinh(u).
double chord_retardance(double n_o, double n_e, double b) {
  const double most = std::asinh(std::sqrt(1 - b * b) / b);
  constexpr int kPieces = 2000;
  double total = 0;
  for (int i = 0; i <= kPieces; ++i) {
    // sin^2 of the angle between ray and axis
    const double u = most * i / kPieces, s2 = 1 / (std::cosh(u) * std::cosh(u));
    const double f = (n_o * n_e / std::sqrt(n_e * n_e + (n_o * n_o - n_e * n_e) * s2) - n_o) * b * std::cosh(u);
    total += f * (i == 0 || i == kPieces ? 1 : i % 2 ? 4 : 2);
  }
  return 2 * total * most / kPieces / 3;
}

// Seen on the exit surface: the ray's phase there over that of the ordinary wave, less what a straight chord through
// that place retards. Printed with six digits.
TEST(EikonalDroplet, RaysOnTheExitSurfaceDifferFromChordsAsIndependentOnes) {
  const ReferenceTable table(data_path("physics/hedgehog_eray_vs_chord.csv"));
  for (std::size_t row = 0; row < table.size(); ++row) {
    const double n_o = table.number(row, "no"), n_e = table.number(row, "ne"), b = table.number(row, "b_entry_over_R");
    const MeridionalRay<double> ray = meridional_ray({1.0, n_e / n_o}, true, std::asin(b));
    EXPECT_NEAR(ray.exit_rho, table.number(row, "exit_x_over_R"), 1.5e-6) << b;
    EXPECT_NEAR(ray.exit_z, -table.number(row, "exit_y_over_R"), 1.5e-6) << b;
    EXPECT_NEAR(ray.exit_rho - b, table.number(row, "lateral_shift_over_R"), 1.5e-6) << b;
    const double ahead = n_o * (ray.path - ray.exit_z - std::sqrt(1 - b * b));
    EXPECT_NEAR(ahead - chord_retardance(n_o, n_e, ray.exit_rho), table.number(row, "path_error_straight_chord_over_R"),
                1.5e-6)
        << b;
  }
}

// Seen in the mid plane. Printed with six digits; near the rim the chord's retardance changes fast with the place,
// which is rounded, too.
TEST(EikonalDroplet, RaysInTheMidPlaneDifferFromChordsAsIndependentOnes) {
  const ReferenceTable table(data_path("physics/hedgehog_eray_midplane.csv"));
  for (std::size_t row = 0; row < table.size(); ++row) {
    const double n_o = table.number(row, "no"), n_e = table.number(row, "ne"), b = table.number(row, "b_entry_over_R");
    const DropletOptics<double> o = droplet<double>(n_o, n_e, n_o);
    const MeridionalRay<double> exact = meridional_ray({1.0, n_e / n_o}, true, std::asin(b));
    const double seen = exact.impact / std::cos(exact.turn_rad);
    EXPECT_NEAR(seen, table.number(row, "apparent_b_midplane_over_R"), 1.5e-6) << b;
    EXPECT_NEAR(degrees(exact.turn_rad), table.number(row, "exit_angle_deg"), 1.5e-6) << b;
    const EikonalRay<double> ray = EikonalFan<double>(o, true, 0).at(seen);
    ASSERT_GT(ray.amplitude, 0) << b;
    EXPECT_NEAR(degrees(std::asin(ray.sin_turn)), degrees(exact.turn_rad), 1e-7) << b;
    const double chord = chord_retardance(n_o, n_e, seen),
                 difference = ray.phase_rad - EikonalFan<double>(o, false, 0).at(seen).phase_rad - chord;
    EXPECT_NEAR(chord, table.number(row, "chord_retardance_over_R"), 1.5e-6) << b;
    EXPECT_NEAR(difference, table.number(row, "path_error_straight_chord_over_R"), 1.5e-6) << b;
    EXPECT_NEAR(difference / chord, table.number(row, "relative_error"), 1.5e-6 + 1.5e-6 / chord) << b;
  }
}

// ---- fans against rays by the Hamiltonian alone --------------------------------------------------------------------

IndependentRays independent(double n_o, double n_e, double n_host, bool extraordinary) {
  IndependentRays rays;
  rays.n_o = n_o, rays.n_e = n_e, rays.n_host = n_host, rays.extraordinary = extraordinary;
  rays.director = [](const IndependentRays::Vector& r) {
    const double size = std::sqrt(IndependentRays::dot(r, r));
    return IndependentRays::Vector{r[0] / size, r[1] / size, r[2] / size};
  };
  return rays;
}
/// Of the fan at the place where the independent ray is seen. `path` and `amplitude`: allowed differences.
void expect_the_same(const EikonalFan<double>& fan, const IndependentRays& rays, double b, double path,
                     double amplitude) {
  const auto ray = rays.trace(b);
  ASSERT_TRUE(ray) << b;
  const EikonalRay<double> here = fan.at(ray->image_radius);
  EXPECT_NEAR(here.phase_rad, ray->path, path) << b;
  EXPECT_NEAR(here.sin_turn, std::sin(ray->turn), 10 * path) << b;
  EXPECT_NEAR(here.amplitude, rays.amplitude(b), amplitude) << b;
}

// A core of lower, of the host's and of higher index; rays through it and beside it, both modes. Runge-Kutta steps of
// 1e-3 leave 1e-9.
TEST(EikonalDroplet, FansOfShellsAreThoseOfTheHamiltonian) {
  for (const double core_index : {1.40, 1.45, 1.60})
    for (const bool extraordinary : {true, false}) {
      const EikonalFan<double> fan(shell<double>(1.53, 1.71, 1.45, 0.7, core_index), extraordinary, 0);
      IndependentRays rays = independent(1.53, 1.71, 1.45, extraordinary);
      rays.core = 0.7, rays.core_index = core_index;
      for (const double b : {0.05, 0.2, 0.45, 0.6, 0.9, 0.97}) {
        SCOPED_TRACE(::testing::Message() << "core index " << core_index << (extraordinary ? ", p" : ", s"));
        expect_the_same(fan, rays, b, 1e-8, 1e-6);
      }
    }
}

// The liquid crystal of the equilibrium that the fan reads, too. Steps to 1e-8 and polynomials to 1e-6 are what the fan
// claims; the elements' kinks make of that 1e-5 in the width of ray tubes. Closer to the axis tubes are widened.
TEST(EikonalDroplet, FansOfDropletsInAFieldAreThoseOfTheHamiltonian) {
  struct Case {
    double e, ring, host;
    std::vector<double> b;
  };
  for (const Case& c : {Case{5, 0, 1.52, {0.2, 0.3, 0.5, 0.7, 0.85, 0.95}}, Case{5, 0, 1.43, {0.2, 0.4, 0.7, 0.9}},
                        Case{6, 0.5, 1.52, {0.1, 0.4, 0.7, 0.85}}}) {
    SCOPED_TRACE(::testing::Message() << "e " << c.e << ", ring " << c.ring << ", host " << c.host);
    const EikonalFan<double> fan(in_field<double>(1.52, 1.74, c.host, c.e, c.ring, c.ring > 0), true, 0);
    IndependentRays rays = independent(1.52, 1.74, c.host, true);
    const auto equilibrium = known_axial_equilibrium(c.e, c.ring, false);
    rays.director = [&](const IndependentRays::Vector& r) {
      const double rho = std::hypot(r[0], r[1]) + 1e-12, theta = equilibrium->theta(rho, std::abs(r[2]) + 1e-12),
                   s = std::sin(theta) / rho;
      return IndependentRays::Vector{s * r[0], s * r[1], std::cos(theta) * (r[2] < 0 ? -1 : 1)};
    };
    for (const double b : c.b) expect_the_same(fan, rays, b, 1e-6, 2e-4);
  }
}

// Integrated in a field of no strength, the rays are those of the cone.
TEST(EikonalDroplet, WithoutFieldIntegratedRaysAreTheClosedForm) {
  const EikonalFan<double> closed(droplet<double>(1.52, 1.74, 1.45), true, 0),
      integrated(in_field<double>(1.52, 1.74, 1.45, 0, 0, false), true, 0);
  EXPECT_GT(closed.rays(), 0);
  for (const double rho : {0.01, 0.05, 0.2, 0.5, 0.8, 0.95}) {
    const EikonalRay<double> a = closed.at(rho), b = integrated.at(rho);
    EXPECT_NEAR(a.phase_rad, b.phase_rad, 1e-6) << rho;
    EXPECT_NEAR(a.sin_turn, b.sin_turn, 1e-6) << rho;
    EXPECT_NEAR(a.amplitude, b.amplitude, 1e-5) << rho;
  }
}

// ---- limits --------------------------------------------------------------------------------------------------------

TEST(EikonalDroplet, AShellWithAVanishingCoreIsTheHedgehog) {
  for (const bool extraordinary : {true, false}) {
    const EikonalFan<double> hedgehog(droplet<double>(1.52, 1.74, 1.45), extraordinary, 0),
        core(shell<double>(1.52, 1.74, 1.45, 1e-4, 1.3), extraordinary, 0);
    for (const double rho : {0.001, 0.01, 0.3, 0.6, 0.9}) {
      const EikonalRay<double> a = hedgehog.at(rho), b = core.at(rho);
      EXPECT_NEAR(a.phase_rad, b.phase_rad, 1e-9) << rho;
      EXPECT_NEAR(a.sin_turn, b.sin_turn, 1e-9) << rho;
      EXPECT_NEAR(a.amplitude, b.amplitude, 1e-8) << rho;
    }
  }
}

// One index everywhere: nothing turns, delays or reflects.
TEST(EikonalDroplet, AMatchedShellWithoutBirefringenceIsNotThere) {
  for (const bool extraordinary : {true, false}) {
    const EikonalFan<double> fan(shell<double>(1.5, 1.5, 1.5, 0.6, 1.5), extraordinary, 0);
    for (const double rho : {0.05, 0.4, 0.58, 0.62, 0.9}) {
      const EikonalRay<double> ray = fan.at(rho);
      EXPECT_NEAR(ray.phase_rad, 0, 1e-10) << rho;
      EXPECT_NEAR(ray.sin_turn, 0, 1e-10) << rho;
      EXPECT_NEAR(ray.amplitude, 1, 1e-9) << rho;
    }
  }
}

// As the birefringence vanishes both modes run on the ordinary ray.
TEST(EikonalDroplet, WithoutBirefringenceBothModesAreOne) {
  const DropletOptics<double> o = droplet<double>(1.52, 1.52, 1.43);
  const EikonalFan<double> p(o, true, 0), s(o, false, 0);
  for (double rho : {0.05, 0.4, 0.8}) {
    EXPECT_NEAR(p.at(rho).phase_rad, s.at(rho).phase_rad, 1e-10);
    EXPECT_NEAR(p.at(rho).cos_turn, s.at(rho).cos_turn, 1e-10);
  }
}

// A ray of L = host sin(psi) reaches the core where L < n_e core, and enters it where L < core index core.
TEST(EikonalDroplet, RaysThatACoreReflectsDoNotArrive) {
  const MeridionalDroplet<double> d{1.0, 1.71 / 1.53, 0.5, 1.0 / 1.53};
  const auto arrives = [&](double momentum) { return meridional_ray(d, true, std::asin(momentum)).arrives; };
  EXPECT_TRUE(arrives(0.5 / 1.53 - 0.05));
  EXPECT_FALSE(arrives(0.5 / 1.53 + 1e-3));
  EXPECT_FALSE(arrives(0.5 * 1.71 / 1.53 - 1e-3));
  EXPECT_TRUE(arrives(0.5 * 1.71 / 1.53 + 1e-3));
}

// What the objective does not collect leaves its place dark, and nothing is not a number.
TEST(EikonalDroplet, RaysThatDoNotArriveAreDark) {
  const DropletOptics<double> o = shell<double>(1.53, 1.71, 1.53, 0.5, 1.0);
  const EikonalFan<double> fan(o, true, 0), objective(o, true, 0.3);
  int dark = 0;
  for (double rho = 0; rho < 1.2; rho += 1e-3) {
    const EikonalRay<double> ray = fan.at(rho), collected = objective.at(rho);
    EXPECT_TRUE(std::isfinite(ray.amplitude) && std::isfinite(ray.phase_rad)) << rho;
    EXPECT_EQ(collected.amplitude > 0, ray.amplitude > 0 && std::abs(1.53 * ray.sin_turn) <= 0.3) << rho;
    dark += rho < 0.9 && collected.amplitude == 0;
  }
  EXPECT_GT(dark, 0);
  const EikonalFan<double> ring(in_field<double>(1.52, 1.74, 1.45, 10, 0.92, true), true, 0);
  for (double rho = 0; rho < 1.2; rho += 1e-3) EXPECT_TRUE(std::isfinite(ring.at(rho).amplitude)) << rho;
}

// ---- derivatives ---------------------------------------------------------------------------------------------------

/// Central differences over h and h/2, extrapolated.
template <class F>
std::array<double, 3> by_differences(const F& f, double h) {
  const auto central = [&](double step) {
    const EikonalRay<double> up = f(step), down = f(-step);
    return std::array{(up.phase_rad - down.phase_rad) / (2 * step), (up.amplitude - down.amplitude) / (2 * step),
                      (up.sin_turn - down.sin_turn) / (2 * step)};
  };
  const auto coarse = central(h), fine = central(h / 2);
  std::array<double, 3> result;
  for (std::size_t k = 0; k < 3; ++k) result[k] = (4 * fine[k] - coarse[k]) / 3;
  return result;
}
/// Numbers of a droplet: radius, n_o, n_e, n_host, then core and its index, or field and ring.
using Numbers = std::array<double, 6>;
template <class S, class Make>
DropletOptics<S> moved(const Make& make, const Numbers& x, int index, double by) {
  std::array<S, 6> s;
  for (std::size_t k = 0; k < 6; ++k) {
    s[k] = S(x[k] + (static_cast<int>(k) == index ? by : 0.0));
    if constexpr (ScalarTraits<S>::derivatives > 0)
      if (static_cast<int>(k) == index) s[k].d[0] = Pack(1.0);
  }
  DropletOptics<S> o = make(s);
  o.radius_um = s[0], o.n_o = s[1], o.n_e = s[2], o.n_host = s[3];
  return o;
}
template <class Make>
void expect_gradients(const Make& make, const Numbers& x, const std::vector<int>& indices,
                      const std::vector<double>& places, double h, double allowed) {
  for (const int index : indices)
    for (const bool extraordinary : {true, false})
      for (const double rho : places) {
        const EikonalFan<Dual1> fan(moved<Dual1>(make, x, index, 0), extraordinary, Dual1(0.0));
        const EikonalRay<Dual1> ray = fan.at(Dual1(rho));
        const auto differences = by_differences(
            [&](double by) { return EikonalFan<double>(moved<double>(make, x, index, by), extraordinary, 0).at(rho); },
            h);
        const double slopes[3] = {lane(ray.phase_rad.d[0], 0), lane(ray.amplitude.d[0], 0), lane(ray.sin_turn.d[0], 0)};
        ASSERT_GT(lane(plain(ray.amplitude), 0), 0) << rho;
        for (std::size_t k = 0; k < 3; ++k)
          EXPECT_NEAR(slopes[k], differences[k], allowed * (1 + std::abs(differences[k])))
              << "number " << index << ", function " << k << ", place " << rho << (extraordinary ? ", p" : ", s");
      }
}

TEST(EikonalDroplet, DerivativesOfClosedFormsAreThoseOfDifferences) {
  const auto hedgehog = [](auto& s) { return droplet<std::decay_t<decltype(s[0])>>(0, 0, 0); };
  expect_gradients(hedgehog, {5, 1.52, 1.74, 1.43, 0, 0}, {0, 1, 2, 3}, {0.3, 2.2, 4.5}, 1e-3, 1e-6);
  const auto wall = [](auto& s) {
    using S = std::decay_t<decltype(s[0])>;
    DropletOptics<S> o = shell<S>(0, 0, 0, 0, 0);
    o.core_um = s[4], o.core_index = s[5];
    return o;
  };
  expect_gradients(wall, {5, 1.53, 1.71, 1.45, 3.5, 1.4}, {0, 1, 2, 3, 4, 5}, {0.3, 2.0, 3.0, 4.4, 4.7}, 1e-3, 1e-6);
}

// Steps and kinks between elements leave 1e-8 of a value and 1e-5 of a tube, which differences over 0.01 make a hundred
// times larger.
TEST(EikonalDroplet, DerivativesOfIntegratedRaysAreThoseOfDifferences) {
  const auto field = [](auto& s) {
    using S = std::decay_t<decltype(s[0])>;
    return in_field<S>(0, 0, 0, s[4], s[5], lane(plain(s[5]), 0) > 0);
  };
  expect_gradients(field, {5, 1.52, 1.74, 1.45, 5, 0}, {0, 1, 2, 3, 4}, {0.6, 2.2, 4.2}, 1e-2, 1e-3);
  expect_gradients(field, {5, 1.52, 1.74, 1.52, 6, 0.5}, {2, 4, 5}, {1.2, 3.8}, 1e-2, 2e-3);
}

// ---- pictures ------------------------------------------------------------------------------------------------------

/// An E12 droplet in a host of its ordinary index, 128 x 128 pixels, with the birefringence free or known.
struct Job {
  TableBuilder b;
  Scene scene;
  Demand demand;
  ParameterRef birefringence;
  Job(double diameter_um, Rays rays, bool free, int size) {
    Droplet d;
    d.diameter_um = b.fixed("diameter_um", diameter_um);
    scene.sample = d;
    demand.rays = rays;
    birefringence = free ? b.fitted("birefringence", 0.215, 0.19, 0.24) : b.fixed("birefringence", 0.22);
    ConstantIndices m;
    m.ordinary = b.fixed("ordinary", 1.52);
    m.birefringence = birefringence;
    scene.material = m;
    scene.surround_index = b.fixed("index", 1.52);
    scene.microscope.wavelength_nm = b.fixed("wavelength_nm", 590);
    scene.microscope.polarizer_deg = b.fixed("polarizer_deg", 0);
    scene.microscope.analyzer_deg = b.fixed("analyzer_deg", 90);
    scene.view.width = scene.view.height = size;
    scene.view.pixel_size_um = b.fixed("pixel_size_um", 1.1 * diameter_um / size);
    scene.view.center_x_px = b.fixed("center_x", 0.5 * size - 0.6);
    scene.view.center_y_px = b.fixed("center_y", 0.5 * size - 0.2);
  }
};

/// Birefringence from the image of curved rays, the middle of the droplet (0.1 to 0.7 R), by a model of `rays`;
/// `read_counts`: noise, of 3000 counts of light.
FitResult fit_of(double diameter_um, Rays rays, int size, double read_counts = 4) {
  const Job truth(diameter_um, Rays::eikonal, false, size);
  const Theta theta = truth.b.table.values();
  const Image image = render(truth.scene, plan(truth.scene, truth.demand, theta), theta, {}, 1).intensity;
  std::vector<double> counts;
  for (double i : image.values()) counts.push_back(100 + 3000 * i);
  Job job(diameter_um, rays, true, size);
  Picture m = micrograph_of("image", job.scene, camera(counts, 0.5, read_counts, 3), job.b.linear("gain", 3000),
                            job.b.linear("offset", 100), {read_counts, 0.5});
  for (int r = 0; r < size; ++r)
    for (int c = 0; c < size; ++c) {
      const double radius = std::hypot(c - (0.5 * size - 0.6), r - (0.5 * size - 0.2)) *
                            job.b.table[job.scene.view.pixel_size_um].value / (diameter_um / 2);
      if (radius < 0.1 || radius > 0.7) m.mask(c, r) = 0;
    }
  FitJob fit_job;
  fit_job.parameters = job.b.table;
  fit_job.demand = job.demand;
  fit_job.measurements = {m};
  return fit(fit_job);
}
ParameterEstimate fitted(double diameter_um, Rays rays) {
  return *find_estimate(fit_of(diameter_um, rays, 128), "birefringence");
}

// physics.md of the design: chord fits come out about 0.2 dn too low, relative, whatever the size: -4 % for E12.
TEST(EikonalDroplet, StraightChordsFittedToCurvedRaysGiveFourPercentTooLittleAtAnySize) {
  for (double diameter_um : {9.3, 30.0}) {
    const ParameterEstimate chord = fitted(diameter_um, Rays::straight), curved = fitted(diameter_um, Rays::eikonal);
    EXPECT_NEAR(chord.value / 0.22 - 1, -0.04, 0.012) << diameter_um;
    // What lies along the birefringence shows in no residual: the error bar holds it because the fit compares with
    // curved rays, and pays for a discrepancy of the size that is left over.
    EXPECT_LT(chord.interval95_low, 0.22) << diameter_um;
    EXPECT_GT(chord.interval95_high, 0.22) << diameter_um;
    EXPECT_GT(chord.stderr_, 0.9 * std::abs(chord.value - 0.22)) << diameter_um;
    EXPECT_LT(std::abs(curved.value - 0.22), 4 * curved.stderr_) << diameter_um;
  }
}

// A fit of straight chords says where curved rays would put the birefringence: on all pixels of a small image, on a
// part of a large one (680 x 680, of which 140,000 pixels are used).
TEST(EikonalDroplet, AFitOfChordsForetellsTheBirefringenceOfCurvedRays) {
  for (const int size : {128, 680}) {
    const FitResult result = fit_of(9.3, Rays::straight, size);
    double foretold = 0;
    for (const std::string& warning : result.warnings)
      if (const std::size_t at = warning.find("would put birefringence at "); at != std::string::npos)
        foretold = std::stod(warning.substr(at + 27));
    EXPECT_NEAR(foretold, 0.22, 0.0005) << size;
    EXPECT_LT(find_estimate(result, "birefringence")->value, 0.217) << size;
  }
}

// A part of a large picture says first whether curved rays are worth the rest. In noise of 5 % the picture at the
// chords' parameters is many times worse by curved rays than by straight ones, and no worse at their own.
TEST(EikonalDroplet, CurvedRaysOfALargeNoisyPictureAreNotGivenUpAtOnce) {
  const FitResult result = fit_of(9.3, Rays::straight, 200, 150);
  EXPECT_TRUE(std::any_of(result.warnings.begin(), result.warnings.end(), [](const std::string& warning) {
    return warning.find("would put birefringence at ") != std::string::npos;
  }));
  const ParameterEstimate estimate = *find_estimate(result, "birefringence");
  EXPECT_LT(estimate.value, 0.217);
  EXPECT_LT(estimate.interval95_low, 0.22);
  EXPECT_GT(estimate.interval95_high, 0.22);
}

// Of shells and of droplets in a field, too, a fit of chords finds out that curved rays matter, and goes over to them.
TEST(EikonalDroplet, AFitOfAnyOfTheseSamplesGoesOverToCurvedRays) {
  for (const bool wall : {true, false}) {
    const auto job_of = [&](Rays rays, bool free) {
      Job job(10, rays, free, 96);
      AxialDirector axial;
      if (wall)
        std::get<Droplet>(job.scene.sample).director =
            ShellDirector{job.b.fixed("wall_um", 2), {}, job.b.fixed("core_index", 1.45)};
      else
        axial.reduced_field = job.b.fixed("reduced_field", 3), std::get<Droplet>(job.scene.sample).director = axial;
      return job;
    };
    const Job truth = job_of(Rays::eikonal, false);
    const Theta theta = truth.b.table.values();
    std::vector<double> counts;
    const Image picture = render(truth.scene, plan(truth.scene, truth.demand, theta), theta, {}, 1).intensity;
    for (const double i : picture.values()) counts.push_back(100 + 3000 * i);
    Job job = job_of(Rays::straight, true);
    Picture m = micrograph_of("image", job.scene, camera(counts, 0.5, 4, 3), job.b.linear("gain", 3000),
                              job.b.linear("offset", 100), {4, 0.5});
    for (int r = 0; r < 96; ++r)
      for (int c = 0; c < 96; ++c)
        if (std::hypot(c - 47.4, r - 47.8) * job.b.table[job.scene.view.pixel_size_um].value > 4) m.mask(c, r) = 0;
    FitJob fit_job;
    fit_job.parameters = job.b.table;
    fit_job.demand = job.demand;
    fit_job.measurements = {m};
    fit_job.options.choose_rays = true;
    const FitResult result = fit(fit_job);
    const ParameterEstimate estimate = *find_estimate(result, "birefringence");
    EXPECT_NEAR(estimate.value, 0.22, 5e-4) << wall;
    EXPECT_LT(std::abs(estimate.value - 0.22), 4 * estimate.stderr_) << wall;
    const auto& reasons = result.micrographs[0].plan.reasons;
    EXPECT_TRUE(std::any_of(reasons.begin(), reasons.end(), [](const std::string& r) {
      return r.find("curved rays were chosen") != std::string::npos;
    })) << wall;
  }
}

/// A droplet or shell of 9 um, 96 x 96 pixels a little off its middle, seen by an aperture.
struct Seen {
  TableBuilder b;
  Scene scene;
  Demand demand{.rays = Rays::eikonal};
  Seen(double host, double wall_um, double field, double ring, double na, double analyzer_deg,
       double core_index = 1.45) {
    Droplet d;
    d.diameter_um = b.fitted("diameter_um", 9, 8, 10);
    if (wall_um > 0)
      d.director = ShellDirector{b.fitted("wall_um", wall_um, 0.1, 4), {}, b.fixed("core_index", core_index)};
    if (field > 0) {
      AxialDirector axial;
      axial.reduced_field = b.fitted("reduced_field", field, 1, 20);
      if (ring > 0) axial.ring_radius = b.fitted("ring_radius", ring, 0.1, 0.99);
      d.director = axial;
    }
    scene.sample = d;
    ConstantIndices m;
    m.ordinary = b.fixed("ordinary", 1.52);
    m.birefringence = b.fitted("birefringence", 0.2, 0.1, 0.3);
    scene.material = m;
    scene.surround_index = b.fitted("index", host, 1.3, 1.6);
    scene.microscope.wavelength_nm = b.fixed("wavelength_nm", 590);
    scene.microscope.polarizer_deg = b.fixed("polarizer_deg", 0);
    scene.microscope.analyzer_deg = b.fixed("analyzer_deg", analyzer_deg);
    if (na > 0) scene.microscope.objective_na = b.fixed("objective_na", na);
    scene.microscope.aplanatic = true;
    scene.view.width = scene.view.height = 96;
    scene.view.pixel_size_um = b.fixed("pixel_size_um", 0.125);
    scene.view.center_x_px = b.fixed("center_x", 47.2);
    scene.view.center_y_px = b.fixed("center_y", 48.1);
  }
};

// Tables between the places where light begins or ends, read everywhere, against a ray of either mode for every point;
// within an eighth of a pixel of such a place the picture passes from one side to the other.
TEST(EikonalDroplet, PicturesAreTheRaysAtEveryPoint) {
  struct Case {
    double host, wall, core_index, field, ring, allowed;
  };
  // Closed forms: a thousandth of the accuracy asked. In a field elements of the director have kinks between them, and
  // beside a ring nothing is smooth for long.
  for (const auto& [host, wall, core_index, field, ring, allowed] : {Case{1.52, 0, 0, 0, 0, 1e-7},
                                                                     {1.43, 0, 0, 0, 0, 1e-7},
                                                                     {1.45, 1.3, 1.45, 0, 0, 1e-7},
                                                                     {1.45, 1.3, 1.60, 0, 0, 1e-7},
                                                                     {1.45, 1.3, 1.80, 0, 0, 1e-7},
                                                                     {1.52, 0, 0, 3, 0, 1e-5},
                                                                     {1.52, 0, 0, 8, 0.85, 1e-3}})
    for (const double na : {0.0, 0.35, 0.8})
      for (const double analyzer_deg : {90.0, 70.0}) {
        SCOPED_TRACE(::testing::Message() << "host " << host << ", wall " << wall << ", core " << core_index
                                          << ", field " << field << ", NA " << na << ", analyser " << analyzer_deg);
        const Seen s(host, wall, field, ring, na, analyzer_deg, core_index);
        const Theta theta = s.b.table.values();
        const RenderPlan chosen = plan(s.scene, s.demand, theta);
        const Values<double> value(theta, {});
        const Exposure exposure = exposure_of(s.scene.microscope);
        const auto model = make_image<double>(s.scene, chosen, value, exposure.directions.front());
        model->tabulate(SampleImage<double>::Wanted::picture, 1);
        const DropletOptics<double> o = droplet_optics(s.scene, value);
        const EikonalFan<double> fan_p(o, true, na), fan_s(o, false, na);
        const double between = std::cos(analyzer_deg * std::numbers::pi / 180), px = value(s.scene.view.pixel_size_um);
        double worst = 0;
        for (int i = 0; i < 4000; ++i) {
          const double rho = 5.2 * (i + 0.5) / 4000, azimuth = 2.399963 * i;
          bool beside = std::abs(rho - o.radius_um) < px;  // light that passes by
          for (const auto* fan : {&fan_p, &fan_s})
            for (const double end : fan->ends_um()) beside = beside || std::abs(rho - end) < px / 8;
          if (beside) continue;
          const EikonalRay<double> p = fan_p.at(rho), r = fan_s.at(rho);
          const std::complex<double> a = std::polar(p.amplitude, p.phase_rad - r.phase_rad), d = r.amplitude;
          // From x to the analyser's direction by way of the radial and the azimuthal one.
          const double c = std::cos(azimuth), n = std::sin(azimuth), alpha = std::acos(between) - azimuth;
          const double expected = std::norm(a * c * std::cos(alpha) - d * n * std::sin(alpha)) +
                                  (rho > o.radius_um ? between * between : 0);
          const double column = 47.2 + rho * c / px, row = 48.1 - rho * n / px;
          // a pixel's mean; pixels that the rim meets are left out
          double light, beside_it = 0;
          model->light(column, row, &light);
          if (model->has_passing_light()) model->passing(column, row, &beside_it);
          worst = std::max(worst, std::abs(light + beside_it - expected));
        }
        EXPECT_LT(worst, allowed);
        EXPECT_LT(worst, 3 * chosen.numerical_error);  // which knows 64 places a part
        EXPECT_LT(chosen.numerical_error, 3 * allowed);
      }
}

// What enters, less what surfaces reflect and the aperture stops, is in the picture: half of it in either polarization,
// rays of the extraordinary mode that are seen beyond the ordinary one's rim, too. Rays by themselves, over the angle
// of incidence; pixels of 1/36 of the radius leave 1e-3.
TEST(EikonalDroplet, LightThatEntersIsInThePicture) {
  for (const double host : {1.52, 1.43})
    for (const double na : {0.0, 0.35, 0.8}) {
      double light = 0;
      for (const double analyzer_deg : {0.0, 90.0}) {
        Seen s(host, 0, 0, 0, na, analyzer_deg);
        s.scene.view.width = s.scene.view.height = 150;
        s.b.table[s.scene.view.center_x_px].value = s.b.table[s.scene.view.center_y_px].value = 74.3;
        const Theta theta = s.b.table.values();
        const Image image = render(s.scene, plan(s.scene, s.demand, theta), theta, {}, 1).intensity;
        for (int r = 0; r < image.height(); ++r)
          for (int c = 0; c < image.width(); ++c) {
            const double rho = std::hypot(c - 74.3, r - 74.3) * 0.125;
            light += image(c, r) - (analyzer_deg == 0 ? std::clamp((rho - 4.5) / 0.125 + 0.5, 0.0, 1.0) : 0);
          }
      }
      double expected = 0;
      constexpr int kRays = 20000;
      const MeridionalDroplet<double> d{host / 1.52, 1.72 / 1.52};
      for (const bool extraordinary : {true, false})
        for (int i = 0; i < kRays; ++i) {
          const double psi = (i + 0.5) / kRays * std::numbers::pi / 2;
          const MeridionalRay<double> ray = meridional_ray(d, extraordinary, psi);
          if (ray.arrives && ray.impact / std::cos(ray.turn_rad) > 0 &&
              (na == 0 || host * std::abs(std::sin(ray.turn_rad)) <= na))
            expected += ray.flux * std::sin(psi) * std::cos(psi) * std::numbers::pi / 2 / kRays;
        }
      EXPECT_NEAR(light * 0.125 * 0.125 / (std::numbers::pi * 4.5 * 4.5), expected, 1e-3) << host << ", " << na;
    }
}

// The aperture, the rims, the core's edge and a ring's shadow move with the parameters, and pixels know it: differences
// of pictures, over squares of 8 x 8 pixels, of which single ones feel the points where they are sampled. Beside a ring
// fringes are finer than these; an aperture keeps most of that light out.
TEST(EikonalDroplet, DerivativesKnowWhereLightBeginsAndEnds) {
  struct Case {
    double host, wall, core_index, field, ring;
    std::vector<double> apertures;
    double allowed;
  };
  for (const auto& [host, wall, core_index, field, ring, apertures, allowed] :
       {Case{1.50, 0, 0, 0, 0, {0, 0.35}, 0.03},
        {1.43, 0, 0, 0, 0, {0, 0.35}, 0.03},
        {1.45, 1.3, 1.45, 0, 0, {0, 0.45}, 0.05},
        {1.45, 1.3, 1.60, 0, 0, {0, 0.45}, 0.05},
        {1.50, 0, 0, 3, 0, {0, 0.35}, 0.03},
        {1.50, 0, 0, 8, 0.85, {0.35}, 0.06}})
    for (const double na : apertures) {
      const Seen s(host, wall, field, ring, na, 70, core_index);
      Theta theta = s.b.table.values();
      const RenderPlan chosen = plan(s.scene, s.demand, theta);
      for (int index = 0; index < s.b.table.size(); ++index) {
        if (!s.b.table[index].free) continue;
        const Image slope = render(s.scene, chosen, theta, {index}, 1).derivatives[0];
        const std::size_t k = static_cast<std::size_t>(index);
        const double at = theta[k], h = 2e-3 * at;
        const auto moved = [&](double by) {
          theta[k] = at + by;
          Image image = render(s.scene, chosen, theta, {}, 1).intensity;
          theta[k] = at;
          return image;
        };
        const Image up = moved(h), down = moved(-h);
        // Over squares of 8 x 8 pixels.
        std::map<std::size_t, std::pair<double, double>> squares;
        for (std::size_t i = 0; i < slope.size(); ++i) {
          auto& [here, by_differences] = squares[i % 96 / 8 + 12 * (i / 96 / 8)];
          here += slope.values()[i], by_differences += (up.values()[i] - down.values()[i]) / (2 * h);
        }
        double difference = 0, size = 0;
        for (const auto& [place, slopes] : squares)
          difference += square(slopes.first - slopes.second), size += square(slopes.second);
        EXPECT_LT(std::sqrt(difference / size), allowed)
            << s.b.table[index].name << ", host " << host << ", wall " << wall << ", field " << field << ", NA " << na;
      }
    }
}

/// RMS of the difference from the picture by wave optics over the RMS of that.
double error_of(const Scene& scene, const Theta& theta, Rays rays) {
  const Image exact = render(scene, plan(scene, {.ceiling = Ceiling::wave}, theta), theta).intensity,
              image = render(scene, plan(scene, {.rays = rays}, theta), theta).intensity;
  double difference = 0, size = 0;
  for (std::size_t i = 0; i < exact.values().size(); ++i) {
    difference += square(image.values()[i] - exact.values()[i]);
    size += square(exact.values()[i]);
  }
  return std::sqrt(difference / size);
}

// Figures for docs/methods.md are printed.
TEST(EikonalDroplet, CurvedRaysAreNearerToTheExactPictureOfAShell) {
  for (const double host : {1.52, 1.45})
    for (const double birefringence : {0.05, 0.18})
      for (const double radius : {10.0, 15.0}) {
        study::Ball ball{radius, birefringence, host, 0.8};
        ball.wall_um = 0.3 * radius;
        const study::BallScene scene(ball);
        const Theta theta = scene.table.values();
        const double straight = error_of(scene.scene, theta, Rays::straight),
                     curved = error_of(scene.scene, theta, Rays::eikonal);
        std::printf(
            "shell of %g um, wall %g um, birefringence %g, in %g: relative RMS error of straight rays %.2f, of curved "
            "rays %.2f\n",
            radius, ball.wall_um, birefringence, host, straight, curved);
        EXPECT_LT(curved, straight);
      }
}

// By propagation, which is within a few per cent itself.
TEST(EikonalDroplet, CurvedRaysAreNearerToThePropagatedPictureOfADropletInAField) {
  for (const double e : {3.0, 10.0})
    for (const double radius : {4.5, 9.0}) {
      study::Ball ball{radius, 0.22, 1.52, 0.8};
      study::BallScene b(ball);
      AxialDirector axial;
      axial.reduced_field = b.table.add_constant("reduced_field", e);
      std::get<Droplet>(b.scene.sample).director = axial;
      const Theta theta = b.table.values();
      const double straight = error_of(b.scene, theta, Rays::straight),
                   curved = error_of(b.scene, theta, Rays::eikonal);
      std::printf(
          "droplet of %g um, reduced field %g, birefringence 0.22: relative RMS error of straight rays %.2f, of curved "
          "rays %.2f\n",
          radius, e, straight, curved);
      EXPECT_LT(curved, straight);
    }
}

/// A picture's derivatives within `reach_um` of the centre: at the rim it ends with a step, which points see on either
/// side of.
void expect_picture_gradients(const Scene& scene, const ParameterTable& table, const std::vector<int>& active,
                              double reach_um, double h, double allowed) {
  const Theta theta = table.values();
  const RenderPlan planned = plan(scene, theta);
  const Rendering rendering = render(scene, planned, theta, active, 1);
  for (std::size_t j = 0; j < active.size(); ++j) {
    const std::size_t at = static_cast<std::size_t>(active[j]);
    const auto central = [&](double step) {
      Theta up = theta, down = theta;
      up[at] += step, down[at] -= step;
      const Image a = render(scene, planned, up, {}, 1).intensity, b = render(scene, planned, down, {}, 1).intensity;
      std::vector<double> slopes(a.values().size());
      for (std::size_t i = 0; i < slopes.size(); ++i) slopes[i] = (a.values()[i] - b.values()[i]) / (2 * step);
      return slopes;
    };
    const std::vector<double> coarse = central(h), fine = central(h / 2);
    double worst = 0, size = 0;
    for (std::size_t i = 0; i < fine.size(); ++i) {
      const double x = static_cast<double>(i % static_cast<std::size_t>(scene.view.width)) -
                       theta[static_cast<std::size_t>(scene.view.center_x_px.index)];
      const double y = static_cast<double>(i / static_cast<std::size_t>(scene.view.width)) -
                       theta[static_cast<std::size_t>(scene.view.center_y_px.index)];
      if (std::hypot(x, y) * theta[static_cast<std::size_t>(scene.view.pixel_size_um.index)] > reach_um) continue;
      worst += square(rendering.derivatives[j].values()[i] - (4 * fine[i] - coarse[i]) / 3);
      size += square(fine[i]);
    }
    ASSERT_GT(size, 0);
    EXPECT_LT(std::sqrt(worst / size), allowed) << table[active[j]].name;
  }
}

TEST(EikonalDroplet, PicturesHaveTheirDerivatives) {
  Job job(10, Rays::eikonal, true, 48);
  Droplet& d = std::get<Droplet>(job.scene.sample);
  AxialDirector axial;
  axial.reduced_field = job.b.fitted("reduced_field", 4, 0, 20);
  d.director = axial;
  expect_picture_gradients(
      job.scene, job.b.table,
      {job.birefringence.index, axial.reduced_field.index, d.diameter_um.index, job.scene.view.center_x_px.index}, 4.5,
      2e-3, 2e-3);
}

// Panels of a fan meet: near image radii at which neighbours once left a gap of a millionth, where it was dark.
TEST(EikonalDroplet, PanelsOfAFanLeaveNoGap) {
  struct Seam {
    double e, ring, rho;
  };
  for (const Seam& c :
       {Seam{6, 0.5, 0.4894114}, {20, 0, 0.8729129}, {2, 0.2, 0.2036611}, {2, 0.2, 0.5227348}, {8, 0.9, 0.9243815}}) {
    const EikonalFan<double> fan(in_field<double>(1.52, 1.74, 1.52, c.e, c.ring, c.ring > 0), true, 0);
    for (int k = -300; k <= 300; ++k)
      EXPECT_GT(fan.at(c.rho + 1e-8 * k).amplitude, 0.1) << c.e << " " << c.ring << " " << c.rho + 1e-8 * k;
  }
}

}  // namespace
}  // namespace birefit
