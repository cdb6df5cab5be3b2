// docs/conventions.md, statement by statement, and closed forms of the scenes.

#include <gtest/gtest.h>

#include <numbers>

#include "birefit/render.h"
#include "independent_droplet.h"
#include "medium/families/radial.h"
#include "profiles.h"
#include "reference_table.h"
#include "scene_builder.h"

namespace birefit {
namespace {
using namespace testing;

struct CellCase {
  TableBuilder t;
  Scene scene;
  Demand demand;
};
/// A cell of n_o = 1.5 in a host of 1.5: no reflections for ordinary light.
CellCase cell_case(double birefringence, double thickness_um, double azimuth_deg, double twist_deg,
                   double polarizer_deg, double analyzer_deg, double rotation_deg = 0) {
  CellCase c;
  c.scene.microscope.wavelength_nm = c.t.fixed("wavelength_nm", 600);
  c.scene.microscope.polarizer_deg = c.t.fixed("polarizer_deg", polarizer_deg);
  c.scene.microscope.analyzer_deg = c.t.fixed("analyzer_deg", analyzer_deg);
  c.scene.surround_index = c.t.fixed("index", 1.5);
  ConstantIndices m;
  m.ordinary = c.t.fixed("ordinary", 1.5);
  m.birefringence = c.t.fixed("birefringence", birefringence);
  c.scene.material = m;
  Cell cell;
  cell.thickness_um = c.t.fixed("thickness_um", thickness_um);
  TwistedDirector d;
  d.azimuth_deg = c.t.fixed("azimuth_deg", azimuth_deg);
  d.twist_deg = c.t.fixed("twist_deg", twist_deg);
  d.pretilt_deg = c.t.fixed("pretilt_deg", 0);
  cell.director = d;
  c.scene.sample = cell;
  c.scene.view.width = c.scene.view.height = 2;
  c.scene.view.rotation_deg = c.t.fixed("rotation_deg", rotation_deg);
  c.demand.ceiling = Ceiling::e_only;  // pure retarders: no loss at the faces
  c.demand.intensity_accuracy = 1e-9;
  return c;
}
double intensity(const CellCase& c) {
  const Theta theta = c.t.table.values();
  return render(c.scene, plan(c.scene, c.demand, theta), theta, {}, 1).intensity(0, 0);
}

TEST(Conventions, MalusLawWithoutRetardance) {
  for (double a : {0.0, 17.0, 45.0, 90.0, 133.0})
    EXPECT_NEAR(intensity(cell_case(0, 5, 20, 0, 10, a)), std::pow(std::cos((a - 10) * kDeg), 2), 1e-12);
}

TEST(Conventions, CrossedIntensityOfARetarder) {
  // 0.05 x 4 um = 0.2 um of retardance at 600 nm
  const double delta = 2 * std::numbers::pi * 0.2 / 0.6;
  for (double f : {0.0, 15.0, 45.0, 100.0})
    EXPECT_NEAR(intensity(cell_case(0.05, 4, f, 0, 10, 100)),
                std::pow(std::sin(2 * (f - 10) * kDeg) * std::sin(delta / 2), 2), 1e-9);
}

// A quarter-wave plate with its slow axis at +45 degrees from the polarizer: E_slow lags, i.e. (time exp(-i w t)) it
// has the phase factor +i. x-polarized light becomes (1, i)-like, the counter-clockwise circle; a second quarter-wave
// plate of the same axis then makes it y-polarized, one of opposite axis gives x back.
TEST(Conventions, QuarterWaveHandedness) {
  SlabProfile profile;
  profile.interpolation = SlabProfile::Interpolation::constant;
  const double quarter_um = 0.6 / 4 / 0.05, c = std::sqrt(0.5);
  profile.rows = {{quarter_um, c, c, 0, 1.5, 1.55, 0, 0}};
  auto table = std::make_shared<const ProfileTable>(profile);
  const LawColumn<double, ProfileLaw<double>> column(ProfileLaw<double>{table});
  const Ray<double> ray{2 * std::numbers::pi / 0.6, 0, 0, Continuity::e_only};
  const Mat2<double> t = Magnus4<double>().transfer(column, ray, uniform_mesh(4));
  const std::complex<double> ex(t.a.re, t.a.im), ey(t.c.re, t.c.im);
  // slow at 45: E = (e_s + e_f)/sqrt2 -> (i e_s + e_f)/sqrt2 up to phase: Ey/Ex = (i - 1)/(i + 1) = i
  EXPECT_NEAR(std::abs(ey / ex - std::complex<double>(0, 1)), 0, 1e-9);
}

TEST(Conventions, RotationTurnsTheSampleCounterClockwise) {
  for (double twist : {0.0, 70.0})
    EXPECT_NEAR(intensity(cell_case(0.08, 5, 0, twist, 10, 80, 30)),
                intensity(cell_case(0.08, 5, 30, twist, 10, 80, 0)), 1e-9);
  EXPECT_GT(std::abs(intensity(cell_case(0.08, 5, 30, 0, 10, 70)) - intensity(cell_case(0.08, 5, -30, 0, 10, 70))),
            0.01);
}

TEST(Conventions, PolarizerAnglesAreCounterClockwiseInTheImage) {
  // A droplet between polarizers at 0 and 60 degrees is brightest along the bisector of polarizer and crossed analyser
  // direction; mirroring the image at the horizontal axis is the same as changing the sign of both angles.
  const auto image = [](double analyzer) {
    TableBuilder t;
    Scene s;
    Droplet d;
    d.diameter_um = t.fixed("d", 4);
    s.sample = d;
    ConstantIndices m;
    m.ordinary = t.fixed("o", 1.52);
    m.birefringence = t.fixed("b", 0.1);
    s.material = m;
    s.surround_index = t.fixed("n", 1.5);
    s.microscope.wavelength_nm = t.fixed("l", 600);
    s.microscope.polarizer_deg = t.fixed("P", 0);
    s.microscope.analyzer_deg = t.fixed("A", analyzer);
    s.view.width = s.view.height = 21;
    s.view.pixel_size_um = t.fixed("pixel_size_um", 0.25);
    s.view.center_x_px = t.fixed("x", 10);
    s.view.center_y_px = t.fixed("y", 10);
    const Theta theta = t.table.values();
    return render(s, plan(s, theta), theta, {}, 1).intensity;
  };
  const Image plus = image(60), minus = image(-60);
  double asymmetry = 0;
  for (int r = 0; r < 21; ++r)
    for (int c = 0; c < 21; ++c) {
      EXPECT_NEAR(plus(c, r), minus(c, 20 - r), 1e-12);
      asymmetry = std::max(asymmetry, std::abs(plus(c, r) - plus(c, 20 - r)));
    }
  EXPECT_GT(asymmetry, 0.1);
  // I = cos^2 A - sin 2(A - f) sin(-2f) sin^2(delta/2): with A = 60 degrees and f = +30 (up right) the second term adds
  // sin 60 sin 60, with f = -30 (down right) it is zero.
  EXPECT_GT(plus(15, 7), plus(15, 13));
}

TEST(TwistedCell, FollowsGoochTarryMinima) {
  // 90 degrees between parallel polarizers along the entry director: T = sin^2(pi/2 sqrt(1 + u^2))/(1 + u^2), u = 2 d
  // dn/lambda.
  for (double u : {0.4, 1.0, std::sqrt(3.0), 2.3, std::sqrt(15.0)}) {
    const double dn = u * 0.6 / 2 / 5;
    const double expected = std::pow(std::sin(std::numbers::pi / 2 * std::sqrt(1 + u * u)), 2) / (1 + u * u);
    EXPECT_NEAR(intensity(cell_case(dn, 5, 0, 90, 0, 0)), expected, 1e-7) << "u = " << u;
  }
}

TEST(Crystal, FollowsTheSineSquaredOfTheField) {
  TableBuilder t;
  Scene s;
  Crystal crystal;
  crystal.half_wave_voltage_v = t.fixed("half", 1500);
  crystal.bias_v = t.fixed("bias", 600);
  crystal.slow_axis_deg = t.fixed("axis", 135);
  s.sample = crystal;
  s.microscope.wavelength_nm = t.fixed("l", 1550);
  s.microscope.polarizer_deg = t.fixed("P", 0);
  s.microscope.analyzer_deg = t.fixed("A", 90);
  s.view.width = s.view.height = 4;
  const Theta theta = t.table.values();
  const Image image = render(s, plan(s, theta), theta, {}, 1).intensity;
  for (double v : image.values()) EXPECT_NEAR(v, std::pow(std::sin(std::numbers::pi / 2 * 600 / 1500), 2), 1e-14);
}

TEST(Conventions, AbsorptionDecaysAlongTheLight) {
  SlabProfile profile;
  profile.interpolation = SlabProfile::Interpolation::constant;
  profile.rows = {{10, 1, 0, 0, 1.5, 1.6, 0.002, 0.006}};
  auto table = std::make_shared<const ProfileTable>(profile);
  LawColumn<double, ProfileLaw<double>> column(ProfileLaw<double>{table});
  column.absorbing = true;
  const double k0 = 2 * std::numbers::pi / 0.6;
  const Ray<double> ray{k0, 0, 0, Continuity::e_only};
  const Mat2<double> t = Magnus4<double>().transfer(column, ray, uniform_mesh(4));
  EXPECT_NEAR(std::sqrt(norm(t.a)), std::exp(-k0 * 0.006 * 10), 1e-12);  // along the axis: extraordinary
  EXPECT_NEAR(std::sqrt(norm(t.d)), std::exp(-k0 * 0.002 * 10), 1e-12);
}

TEST(Conventions, IsotropicSlabHasFresnelTransmissionsAndNoCrossTerms) {
  SlabProfile profile;
  profile.interpolation = SlabProfile::Interpolation::constant;
  profile.rows = {{3, 1, 0, 0, 1.5, 1.5, 0, 0}};
  auto table = std::make_shared<const ProfileTable>(profile);
  auto column = std::make_unique<LawColumn<double, ProfileLaw<double>>>(ProfileLaw<double>{table});
  const PlanarOptics<double> o = optics_of(std::move(column), 0.6, 1.0, Continuity::e_and_h);
  const double theta = 40 * kDeg, azimuth = 25 * kDeg, t = std::tan(theta);
  const SpJones j = sp_jones(
      planar_jones<double>(o, Magnus4<double>(), uniform_mesh(2), t * std::cos(azimuth), t * std::sin(azimuth)),
      azimuth);
  const double c1 = std::cos(theta), c2 = std::sqrt(1 - std::pow(std::sin(theta) / 1.5, 2));
  const double ts = 4 * c1 * 1.5 * c2 / std::pow(c1 + 1.5 * c2, 2), tp = 4 * 1.5 * c1 * c2 / std::pow(1.5 * c1 + c2, 2);
  EXPECT_NEAR(std::abs(j.ss), ts, 1e-12);
  EXPECT_NEAR(std::abs(j.pp), tp, 1e-12);
  EXPECT_LT(std::abs(j.sp) + std::abs(j.ps), 1e-12);
}

TEST(RadialDroplet, ChordRetardanceAgrees) {
  const ReferenceTable table(data_path("physics/radial_chord_retardance.csv"));
  int compared = 0;
  for (std::size_t row = 0; row < table.size(); ++row) {
    if (table.number(row, "R_in_um") != 0) continue;
    const double radius = table.number(row, "R_out_um"), b = table.number(row, "b_over_R") * radius;
    const double n_o = table.number(row, "no"), n_e = table.number(row, "ne");
    LawColumn<double, RadialLaw<double>> column(
        RadialLaw<double>{Chord<double>(b, std::sqrt(radius * radius - b * b), radius), n_o * n_o, n_e * n_e});
    column.planar = true;
    const double k0 = 1e-3;  // small enough that the phase never wraps
    const Su2<double> u = Diagonal<double>().retarder(column, {k0, 0, 0, Continuity::e_and_h}, uniform_mesh(128));
    EXPECT_NEAR(2 * std::atan2(u.z, u.w) / k0, table.number(row, "retardance_um"), 2e-9);
    ++compared;
  }
  EXPECT_GT(compared, 10);
}

TEST(RadialDroplet, AgreesWithAnIndependentProgram) {
  IndependentDroplet truth;
  truth.center_x_px = 20.3;
  truth.center_y_px = 18.8;
  truth.pixel_um = 0.3;
  TableBuilder t;
  Scene s;
  Droplet d;
  d.diameter_um = t.fixed("d", 9.3);
  s.sample = d;
  ConstantIndices m;
  m.ordinary = t.fixed("o", 1.52);
  m.birefringence = t.fixed("b", 0.22);
  s.material = m;
  s.surround_index = t.fixed("n", 1.43);
  s.microscope.wavelength_nm = t.fixed("l", 590);
  s.microscope.polarizer_deg = t.fixed("P", 0);
  s.microscope.analyzer_deg = t.fixed("A", 90);
  s.view.width = s.view.height = 40;
  s.view.pixel_size_um = t.fixed("pixel_size_um", 0.3);
  s.view.center_x_px = t.fixed("x", 20.3);
  s.view.center_y_px = t.fixed("y", 18.8);
  const Theta theta = t.table.values();
  const Image image = render(s, plan(s, theta), theta, {}, 1).intensity;
  double worst = 0;
  std::string where;
  for (int r = 0; r < 40; ++r)
    for (int c = 0; c < 40; ++c) {
      const double error = std::abs(image(c, r) - truth.pixel(c, r, 12));
      if (error > worst) where = std::to_string(c) + ", " + std::to_string(r);
      worst = std::max(worst, error);
    }
  // 12 x 12 midpoints err by (phase per pixel)^2/(24 x 144 x 2) = 3e-4 at the steepest fringe of 1.5 rad a pixel.
  EXPECT_LT(worst, 1e-3) << "at " << where;
}

}  // namespace
}  // namespace birefit
