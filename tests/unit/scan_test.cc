// The search: how finely it looks, and which minima it names.

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "bar.h"
#include "birefit/fit.h"
#include "birefit/render.h"
#include "fit/problem/frame.h"
#include "fit/problem/least_squares.h"
#include "fit/search/phases.h"
#include "fit/search/scan.h"
#include "scene_builder.h"

namespace birefit {
namespace {

using namespace testing;

TEST(Fit, MirrorMinimaInsideTheBoundsAreAmbiguous) {
  Bar bar(700, 0);
  bar.free(bar.bias, 500, 0, 3000);
  Picture& micrograph = bar.add_image(30, 30, bar.bias, true);
  micrograph.noise = NoiseModel{0.01, 0, false};
  Gaussian gaussian(12);
  expose(micrograph, 1, 0, 700, 0, [&](int, int, double) { return 0.01 * gaussian(); });
  const FitResult result = fit(bar.job);
  EXPECT_TRUE(result.ambiguous);
  ASSERT_EQ(result.rivals.size(), 1u);
  // sin^2 is even about the half-wave voltage: the two minima are each other's mirror image.
  EXPECT_NEAR(result.theta[bar.bias.index] + result.rivals[0].theta[bar.bias.index], 2 * kHalfWave, 0.01);
  EXPECT_NEAR(result.rivals[0].odds, 1, 0.01);
  EXPECT_NEAR(result.rivals[0].likelihood_ratio, 1, 0.01);
  EXPECT_FALSE(result.has_answer());
}

// sin^2(phase / 2) is the same at phase and 2 pi - phase, the phase goes as 1/V of the half-wave voltage V: two minima
// as likely as each other, of which the one at the lower voltage is narrower by the square of the phases' ratio. So are
// its odds.
TEST(Fit, OddsOfANarrowMinimumAreSmaller) {
  Bar bar(700, 0);
  bar.free(bar.half_wave, kHalfWave, 400, 3000);
  Picture& micrograph = bar.add_image(30, 30, bar.bias, true);
  micrograph.noise = NoiseModel{0.01, 0, false};
  Gaussian gaussian(12);
  expose(micrograph, 1, 0, 700, 0, [&](int, int, double) { return 0.01 * gaussian(); });
  const FitResult result = fit(bar.job);
  ASSERT_EQ(result.rivals.size(), 1u);
  const double here = result.theta[bar.half_wave.index], there = result.rivals[0].theta[bar.half_wave.index];
  EXPECT_NEAR(1 / here + 1 / there, 2.0 / 700, 1e-8);
  EXPECT_NEAR(result.rivals[0].likelihood_ratio, 1, 0.01);
  EXPECT_NEAR(result.rivals[0].odds, std::pow(there / here, 2), 0.01 * std::pow(there / here, 2));
  EXPECT_TRUE(result.ambiguous);
}

// phase = pi V/V_half (1 + c): linear in V, fastest at the least V_half; along V_half fastest at the largest V and next
// to the least V_half, so that steps have to be unequal.
TEST(Scan, FringePhasesAreThoseOfTheFastestFringes) {
  Bar bar(700, 0.4);
  bar.free(bar.bias, 650, 100, 1400);
  bar.free(bar.half_wave, 1500, 800, 4000);
  bar.free_linear();
  bar.add_image(4, 4, bar.bias);
  const estimation::Task task(bar.job);
  const estimation::Unknowns& unknowns = task.unknowns;
  const Theta theta = bar.job.parameters.values();
  const std::unique_ptr<estimation::LeastSquares> problem =
      estimation::problem_of(task, estimation::prepare(task).frames, {{}});
  const std::vector<estimation::PicturePhase> fringes = estimation::picture_phases(*problem, task, theta);
  ASSERT_EQ(fringes.size(), 2u);
  for (std::size_t j = 0; j < 2; ++j) {
    const Parameter& parameter = bar.job.parameters[unknowns.searched[j]];
    const auto exact = [&](double from, double to) {
      return std::numbers::pi * 1.4 *
             (unknowns.searched[j] == bar.bias.index ? (to - from) / 800 : 1400 * (1 / from - 1 / to));
    };
    EXPECT_EQ(fringes[j].at(parameter.lower), 0);
    const double step = (parameter.upper - parameter.lower) / 50;
    for (double from = parameter.lower; from + step <= parameter.upper; from += step) {
      const double said = fringes[j].at(from + step) - fringes[j].at(from);
      // Never less; more by how much the rate changes within a sixteenth of the bounds: (1000/800)^2.
      EXPECT_GE(said, exact(from, from + step) * (1 - 1e-6)) << parameter.name << ' ' << from;
      EXPECT_LE(said, exact(from, from + step) * 1.5626) << parameter.name << ' ' << from;
    }
  }
}

// Of what forms no fringes the pictures say how often they turn: a planar cell between crossed polarizers is sin^2(2
// azimuth), which goes through twice its range of 1 a turn, and 1/sqrt(8) is its standard deviation: 4 sqrt(2) a turn
// of 90 degrees, nearly 2 pi.
TEST(Scan, AnglesTurnThePictureAsMalusSays) {
  testing::TableBuilder b;
  Scene s;
  s.microscope.wavelength_nm = b.fixed("wavelength_nm", 590);
  s.microscope.polarizer_deg = b.fixed("polarizer_deg", 0);
  s.microscope.analyzer_deg = b.fixed("analyzer_deg", 90);
  s.view.width = s.view.height = 2;
  s.view.rotation_deg = b.fixed("rotation_deg", 0);
  Cell cell;
  cell.thickness_um = b.fixed("thickness_um", 2);
  UniformDirector director;
  director.azimuth_deg = b.fitted("azimuth_deg", 20, 0, 180);
  director.tilt_deg = b.fixed("tilt_deg", 0);
  cell.director = director;
  s.sample = cell;
  s.material = ConstantIndices{b.fixed("ordinary", 1.5), b.fixed("birefringence", 0.1)};
  s.surround_index = b.fixed("surround", 1.5);
  const ParameterRef gain = b.linear("gain", 1), offset = b.linear("offset", 0);
  FitJob job;
  job.measurements.push_back(testing::micrograph_of("cell", s, std::vector<double>(4, 0.5), gain, offset, {0.01, 0}));
  job.parameters = b.table;
  const estimation::Task task(job);
  const std::unique_ptr<estimation::LeastSquares> problem =
      estimation::problem_of(task, estimation::prepare(task).frames, {{}});
  const estimation::PicturePhase phase = estimation::picture_phases(*problem, task, b.table.values()).front();
  // Both ends of the range are counted in the standard deviation, where 24 intervals should have 24 places.
  const double exact = 2 * 4 * std::sqrt(2.0);
  EXPECT_NEAR(phase.total(), exact, exact / 24);
  EXPECT_FALSE(phase.of_fringes);
}

// And the grid that is made of them: no two neighbours a radian apart, however large the droplet and weak the field.
TEST(Scan, NoStepIsLongerThanARadian) {
  ParameterTable table;
  const auto add = [&](const char* name, double value, double lower, double upper) {
    Parameter p;
    p.name = name, p.value = value, p.lower = lower, p.upper = upper, p.free = upper > lower;
    return table.add(p);
  };
  FitJob job;
  Picture m;
  m.name = "droplet";
  Droplet droplet;
  droplet.diameter_um = add("diameter_um", 6, 5.5, 16);
  AxialDirector axial;
  axial.reduced_field = add("reduced_field", 30, 1, 39);
  droplet.director = axial;
  m.scene.sample = droplet;
  m.scene.material = ConstantIndices{add("ordinary", 1.52, 0, 0), add("birefringence", 0.3, 0, 0)};
  m.scene.surround_index = add("surround", 1.5, 0, 0);
  m.scene.microscope.wavelength_nm = add("wavelength_nm", 590, 0, 0);
  m.scene.microscope.polarizer_deg = add("polarizer_deg", 0, 0, 0);
  m.scene.microscope.analyzer_deg = add("analyzer_deg", 90, 0, 0);
  m.scene.view.width = m.scene.view.height = 32;
  m.scene.view.pixel_size_um = add("pixel_size_um", 0.6, 0, 0);
  m.scene.view.center_x_px = m.scene.view.center_y_px = add("center", 15.5, 0, 0);
  m.scene.view.rotation_deg = add("rotation_deg", 0, 0, 0);
  m.noise = NoiseModel{0.01, 0, false};
  job.parameters = table;
  m.values = render(m.scene, plan(m.scene, table.values()), table.values(), {}, 1).intensity;
  m.mask = Mask(32, 32, 1);
  job.measurements.push_back(m);
  const FitResult result = fit(job);
  ASSERT_EQ(result.scans.size(), 2u);
  for (const ScanTrace& scan : result.scans) {
    const int index = table.find(scan.name).index;
    double widest = 0, narrowest = 1e9;
    for (std::size_t i = 1; i < scan.value.size(); ++i) {
      Theta theta = table.values();
      theta[static_cast<std::size_t>(droplet.diameter_um.index)] = 16;
      const double step = scan.value[i] - scan.value[i - 1];
      theta[static_cast<std::size_t>(index)] = 0.5 * (scan.value[i] + scan.value[i - 1]);
      // The rate in the middle for the step. It may be a little larger between two of the 17 places where the scan asks
      // for it.
      EXPECT_LT(fringe_phase_per_unit(m.scene, {}, theta, index) * step, 1.05)
          << scan.name << ' ' << theta[static_cast<std::size_t>(index)];
      widest = std::max(widest, step), narrowest = std::min(narrowest, step);
    }
    if (index == axial.reduced_field.index) {
      EXPECT_GT(widest, 2 * narrowest);  // a field's fringes are fast where it is weak
    }
  }
}

}  // namespace
}  // namespace birefit
