// The photoelastic disc: stresses against a table and the equations they must fulfil, images against the textbook.

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "birefit/render.h"
#include "independent_disc.h"
#include "medium/families/disc.h"
#include "reference_table.h"
#include "scene/polariscope.h"
#include "scene_builder.h"

namespace birefit {
namespace {

// The table is rounded to 1e-10.
TEST(StressedDisc, StressesOfTheReferenceTable) {
  const testing::ReferenceTable table(testing::data_path("physics/brazilian_disc.csv"));
  for (std::size_t i = 0; i < table.size(); ++i) {
    const double x = table.number(i, "x_over_R"), y = table.number(i, "y_over_R");
    const StressPair<double> s = diametral_stress(x, y);
    EXPECT_NEAR(s.normal, table.number(i, "sxx_tR_over_P") - table.number(i, "syy_tR_over_P"), 4e-10);
    EXPECT_NEAR(s.shear, 2 * table.number(i, "sxy_tR_over_P"), 4e-10);
    EXPECT_NEAR(std::hypot(s.normal, s.shear), table.number(i, "s1_minus_s2"), 4e-10);
    if (std::hypot(s.normal, s.shear) < 1e-6) continue;  // no direction
    const double turn =
        0.5 * std::atan2(s.shear, s.normal) - table.number(i, "alpha_s1_deg_from_x") * std::numbers::pi / 180;
    EXPECT_NEAR(std::sin(turn), 0, 1e-6) << x << " " << y;
  }
}

TEST(StressedDisc, CentreInClosedForm) {
  const StressPair<double> s = diametral_stress(0.0, 0.0);  // sxx = P/(pi R t), syy = -3 P/(pi R t)
  EXPECT_NEAR(s.normal, 4 / std::numbers::pi, 1e-11);
  EXPECT_NEAR(s.shear, 0, 1e-15);
}

// Without body forces, of N = sxx - syy, S = 2 sxy and the mean m = (sxx + syy)/2 the equilibrium is m_x = -(N_x +
// S_y)/2, m_y = (N_y - S_x)/2. Both are differentiated once more: m exists, and it is harmonic (compatibility in plane
// stress).
TEST(StressedDisc, EquilibriumAndCompatibility) {
  const double h = 1e-3;
  for (const auto& [x, y] : {std::pair{0.1, 0.2}, {-0.5, 0.3}, {0.7, -0.4}, {0.05, 0.6}, {-0.3, -0.7}}) {
    const auto at = [&](int i, int j) { return diametral_stress(x + i * h, y + j * h); };
    const auto xx = [&](auto f) { return (f(at(1, 0)) - 2 * f(at(0, 0)) + f(at(-1, 0))) / (h * h); };
    const auto yy = [&](auto f) { return (f(at(0, 1)) - 2 * f(at(0, 0)) + f(at(0, -1))) / (h * h); };
    const auto xy = [&](auto f) { return (f(at(1, 1)) - f(at(1, -1)) - f(at(-1, 1)) + f(at(-1, -1))) / (4 * h * h); };
    const auto n = [](const StressPair<double>& s) { return s.normal; };
    const auto s = [](const StressPair<double>& p) { return p.shear; };
    const double size = std::abs(xx(n)) + std::abs(yy(n)) + std::abs(xy(s));
    // Second differences err by h^2/12 of the fourth derivative, here up to 100 times the second (distance 0.4 from the
    // load).
    EXPECT_NEAR(xy(n) + 0.5 * (yy(s) - xx(s)), 0, 2e-5 * size);
    EXPECT_NEAR(0.5 * (yy(n) - xx(n)) - xy(s), 0, 2e-5 * size);
  }
}

// The mean stress follows from -1/pi at the centre and the equilibrium along a radius; at the rim nothing pulls.
TEST(StressedDisc, RimIsFreeOfTraction) {
  const double h = 1e-5;
  for (double angle_deg : {0.0, 20.0, 45.0, 70.0, 160.0, 230.0}) {
    const double c = std::cos(angle_deg * std::numbers::pi / 180), s = std::sin(angle_deg * std::numbers::pi / 180);
    double mean = -1 / std::numbers::pi;
    const int steps = 4000;
    for (int i = 0; i < steps; ++i) {  // midpoints
      const double r = (i + 0.5) / steps, x = r * c, y = r * s;
      const StressPair<double> e = diametral_stress(x + h, y), w = diametral_stress(x - h, y),
                               n = diametral_stress(x, y + h), b = diametral_stress(x, y - h);
      const double mx = -0.5 * ((e.normal - w.normal) + (n.shear - b.shear)) / (2 * h);
      const double my = 0.5 * ((n.normal - b.normal) - (e.shear - w.shear)) / (2 * h);
      mean += (mx * c + my * s) / steps;
    }
    const StressPair<double> rim = diametral_stress(c, s);
    const double c2 = c * c - s * s, s2 = 2 * c * s;
    EXPECT_NEAR(mean + 0.5 * (rim.normal * c2 + rim.shear * s2), 0, 1e-5) << angle_deg;  // the midpoint rule's error
    EXPECT_NEAR(0.5 * (rim.shear * c2 - rim.normal * s2), 0, 1e-10) << angle_deg;
  }
}

struct DiscScene {
  testing::TableBuilder t;
  Scene scene;
};

DiscScene scene_of(const testing::IndependentDisc& d, int size, double analyzer_deg) {
  DiscScene r;
  StressedDisc disc;
  disc.diameter_um = r.t.fixed("diameter_um", 2 * d.radius_um);
  disc.thickness_um = r.t.fixed("thickness_um", d.thickness_um);
  disc.load_n = r.t.fixed("load_n", d.load_n);
  disc.stress_optic_brewster = r.t.fixed("stress_optic_brewster", d.stress_optic_brewster);
  disc.load_azimuth_deg = r.t.fixed("load_azimuth_deg", d.load_azimuth_deg);
  r.scene.sample = disc;
  r.scene.microscope.wavelength_nm = r.t.fixed("wavelength_nm", d.wavelength_nm);
  r.scene.microscope.polarizer_deg = r.t.fixed("polarizer_deg", d.polarizer_deg);
  r.scene.microscope.analyzer_deg = r.t.fixed("analyzer_deg", analyzer_deg);
  if (d.circular) make_circular_polariscope(r.scene.microscope, r.t.fixing());
  r.scene.view.width = r.scene.view.height = size;
  r.scene.view.pixel_size_um = r.t.fixed("pixel_size_um", d.um_per_px);
  r.scene.view.center_x_px = r.t.fixed("center_x", d.center_x_px);
  r.scene.view.center_y_px = r.t.fixed("center_y", d.center_y_px);
  r.scene.view.rotation_deg = r.t.fixed("rotation_deg", 0);
  return r;
}

// Pixel means away from the edge and the forces, where fringes pass by at up to 4 rad a pixel: of these the 32 x 32
// midpoints of the reference are good to 4^2/(24 * 32^2) of the amplitude, 7e-4.
TEST(StressedDisc, ImagesOfBothPolariscopesAreTheTextbooks) {
  for (bool circular : {false, true})
    for (double azimuth : {90.0, 62.0}) {
      testing::IndependentDisc d;
      d.circular = circular;
      d.load_azimuth_deg = azimuth;
      d.polarizer_deg = 20;
      d.center_x_px = 32.3;
      d.center_y_px = 31.2;
      d.um_per_px = 210;
      const DiscScene s = scene_of(d, 64, 110);
      const Theta theta = s.t.table.values();
      const Image image = render(s.scene, plan(s.scene, theta), theta).intensity;
      const double load = azimuth * std::numbers::pi / 180, radius = d.radius_um / d.um_per_px;
      double worst = 0;
      int compared = 0;
      for (int row = 0; row < 64; row += 2)
        for (int column = 0; column < 64; column += 2) {
          const double east = column - d.center_x_px, north = d.center_y_px - row, r = std::hypot(east, north);
          const double along = (east * std::cos(load) + north * std::sin(load)),
                       to_force = std::sqrt(std::max(0.0, r * r + radius * radius - 2 * std::abs(along) * radius));
          if (r > radius + 1.5) {
            EXPECT_NEAR(image(column, row), 0, 1e-12);
            continue;
          }
          if (r > radius - 1.5 || to_force < 0.4 * radius) continue;
          worst = std::max(worst, std::abs(image(column, row) - d.pixel(column, row, 32)));
          ++compared;
        }
      EXPECT_GT(compared, 300);
      EXPECT_LT(worst, 1e-3) << (circular ? "circular" : "plane") << ", load at " << azimuth;
    }
}

TEST(StressedDisc, ParallelPolarizersAreTheComplementInCircularLight) {
  testing::IndependentDisc d;
  d.um_per_px = 400;
  d.center_x_px = d.center_y_px = 15.5;
  const DiscScene dark = scene_of(d, 32, 90), bright = scene_of(d, 32, 0);
  const Theta theta = dark.t.table.values();
  const RenderPlan p = plan(dark.scene, theta);
  const Image a = render(dark.scene, p, theta).intensity,
              b = render(bright.scene, p, bright.t.table.values()).intensity;
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_NEAR(a.values()[i] + b.values()[i], 1, 1e-12);
}

// Jones matrices multiplied out plate by plate: polarizer, quarter-wave plate at +45 degrees, retarder, the other
// plate, analyser at any angle. On one retarder of known slow axis: the disc's centre, whose slow axis is the x of the
// load's frame.
TEST(StressedDisc, AnyAnalyserBehindTheQuarterWavePlates) {
  using C = std::complex<double>;
  const auto plate = [](double slow_rad, double retardance) {
    const double c = std::cos(2 * slow_rad), s = std::sin(2 * slow_rad);
    const C i(0, std::sin(retardance / 2)), w = std::cos(retardance / 2);
    return std::array<C, 4>{w + i * c, i * s, i * s, w - i * c};
  };
  const auto times = [](const std::array<C, 4>& m, std::array<C, 2> v) {
    return std::array<C, 2>{m[0] * v[0] + m[1] * v[1], m[2] * v[0] + m[3] * v[1]};
  };
  for (double analyzer_deg : {0.0, 25.0, 65.0, 110.0, 150.0})
    for (double load : {100.0, 340.0}) {
      testing::IndependentDisc d;
      d.polarizer_deg = 13;
      d.load_azimuth_deg = 50;
      d.load_n = load;
      d.um_per_px = 1;  // one pixel sees one stress
      d.center_x_px = d.center_y_px = 1;
      DiscScene s = scene_of(d, 3, analyzer_deg);
      const Theta theta = s.t.table.values();
      const double got = render(s.scene, plan(s.scene, theta), theta).intensity(1, 1);
      const double delta = 2 * std::numbers::pi / (d.wavelength_nm * 1e-3) * d.stress_optic_brewster * load * 4 /
                           std::numbers::pi / d.radius_um;
      const double p = 13 * std::numbers::pi / 180, a = analyzer_deg * std::numbers::pi / 180;
      std::array<C, 2> e{std::cos(p), std::sin(p)};
      e = times(plate(p + std::numbers::pi / 4, std::numbers::pi / 2), e);
      e = times(plate((50 - 90) * std::numbers::pi / 180, delta), e);
      e = times(plate(p - std::numbers::pi / 4, std::numbers::pi / 2), e);
      EXPECT_NEAR(got, std::norm(std::cos(a) * e[0] + std::sin(a) * e[1]), 1e-6)
          << analyzer_deg << " " << load;  // over one um of 6 mm
    }
}

// A retardance goes as 1/wavelength: a line of Gaussian shape in 1/wavelength of relative width s is a Gaussian of
// loads of the same relative width. 81 trapezoids out to 6 widths of a Gaussian are exact to rounding (its spectrum
// ends long before theirs).
TEST(StressedDisc, BandwidthIsTheMeanOverTheLine) {
  for (bool circular : {false, true})
    for (double analyzer_deg : {110.0, 65.0}) {
      testing::IndependentDisc d;
      d.circular = circular;
      d.polarizer_deg = 20;
      d.um_per_px = 1000;
      d.center_x_px = d.center_y_px = 5.5;
      const double width = 0.05;
      const auto image = [&](double load, double bandwidth_nm) {
        testing::IndependentDisc one = d;
        one.load_n = load;
        DiscScene s = scene_of(one, 12, analyzer_deg);
        if (bandwidth_nm > 0) s.scene.microscope.bandwidth_nm = s.t.fixed("bandwidth_nm", bandwidth_nm);
        testing::IndependentDisc heavy = d;  // one plan for all loads: the same points within a pixel
        heavy.load_n = 1.3 * d.load_n;
        const DiscScene most = scene_of(heavy, 12, analyzer_deg);
        return render(s.scene, plan(most.scene, most.t.table.values()), s.t.table.values()).intensity;
      };
      const Image broad = image(d.load_n, width * 2.3548200450309493 * d.wavelength_nm);
      std::vector<double> mean(broad.size(), 0);
      double sum = 0;
      for (int i = -40; i <= 40; ++i) {
        const double g = 6.0 * i / 40, w = std::exp(-0.5 * g * g);
        const Image one = image(d.load_n * (1 + width * g), 0);
        for (std::size_t k = 0; k < mean.size(); ++k) mean[k] += w * one.values()[k];
        sum += w;
      }
      double change = 0;
      const Image narrow = image(d.load_n, 0);
      for (std::size_t k = 0; k < mean.size(); ++k) {
        EXPECT_NEAR(broad.values()[k], mean[k] / sum, 1e-8) << circular << " " << analyzer_deg << " pixel " << k;
        change = std::max(change, std::abs(broad.values()[k] - narrow.values()[k]));
      }
      EXPECT_GT(change, 0.05);
    }
}

TEST(StressedDisc, UnevenLightIsAFactor) {
  testing::IndependentDisc d;
  d.um_per_px = 10;  // a pixel is a point: the factor changes by 1/1000 in it
  d.center_x_px = d.center_y_px = 15.5;
  DiscScene even = scene_of(d, 32, 90), uneven = scene_of(d, 32, 90);
  StressedDisc& disc = std::get<StressedDisc>(uneven.scene.sample);
  disc.illumination = {uneven.t.fixed("x", 40), uneven.t.fixed("y", -10), uneven.t.fixed("xx", 300)};
  const RenderPlan p = plan(even.scene, even.t.table.values());
  const Image a = render(even.scene, p, even.t.table.values()).intensity,
              b = render(uneven.scene, p, uneven.t.table.values()).intensity;
  for (int row = 0; row < 32; ++row)
    for (int column = 0; column < 32; ++column) {
      const double x = (column - 15.5) * 10 / d.radius_um, y = (15.5 - row) * 10 / d.radius_um;
      EXPECT_NEAR(b(column, row), a(column, row) * (1 + 40 * x - 10 * y + 300 * x * x), 1e-3 * a(column, row));
    }
}

}  // namespace
}  // namespace birefit
