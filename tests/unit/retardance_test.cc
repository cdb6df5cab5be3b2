// Tables of what a cell's retardance is, and what they say about themselves.

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "birefit/error.h"
#include "birefit/fit.h"
#include "birefit/render.h"
#include "fit/weights/rows.h"
#include "scene_builder.h"

namespace birefit {
namespace {
using namespace testing;

struct TiltedCell {
  TableBuilder b;
  Scene scene;
  Observable observable;
  ParameterRef thickness, birefringence, tilt, wavelength;
  TiltedCell(double n_o, double dn, double tilt_deg, Quantity quantity) {
    Cell cell;
    cell.thickness_um = thickness = b.fixed("thickness_um", 12);
    UniformDirector director;
    director.azimuth_deg = b.fixed("azimuth_deg", 33);
    director.tilt_deg = tilt = b.fixed("tilt_deg", tilt_deg);
    cell.director = director;
    scene.sample = cell;
    scene.material = ConstantIndices{b.fixed("ordinary", n_o), birefringence = b.fixed("birefringence", dn)};
    scene.surround_index = b.fixed("surround", 1);
    scene.microscope.wavelength_nm = wavelength = b.fixed("wavelength_nm", 600);
    scene.microscope.polarizer_deg = b.fixed("polarizer_deg", 0);
    scene.microscope.analyzer_deg = b.fixed("analyzer_deg", 0);
    scene.view.width = scene.view.height = 1;
    observable.quantity = quantity;
  }
  double value() const { return value(b.table.values()); }
  double value(const Theta& theta) const {
    return render(scene, plan(scene, theta, observable), theta, {}, 1).intensity(0, 0);
  }
};

/// (n_eff - n_o) d of an axis at `tilt` to the layer: 1/n_eff^2 = cos^2 / n_e^2 + sin^2 / n_o^2.
double path(double n_o, double dn, double tilt_deg, double d) {
  const double n_e = n_o + dn, c = std::cos(tilt_deg * M_PI / 180), s = std::sin(tilt_deg * M_PI / 180);
  return d * (1 / std::sqrt(c * c / (n_e * n_e) + s * s / (n_o * n_o)) - n_o);
}

TEST(Retardance, IsThatOfTheIndexEllipsoid) {
  for (const double dn : {0.2, 1e-6, 0.0, -0.15})
    for (const double tilt : {0.0, 35.0, 90.0}) {
      const double expected = path(1.52, dn, tilt, 12), allowed = 1e-13;  // rounding of 18 um of path
      EXPECT_NEAR(TiltedCell(1.52, dn, tilt, Quantity::retardance_um).value(), expected, allowed) << dn << " " << tilt;
      EXPECT_NEAR(TiltedCell(1.52, dn, tilt, Quantity::retardance_waves).value(), expected / 0.6, allowed);
      EXPECT_NEAR(TiltedCell(1.52, dn, tilt, Quantity::birefringence).value(), expected / 12, allowed);
    }
}

TEST(Retardance, HasItsDerivatives) {
  const TiltedCell cell(1.52, 0.2, 35, Quantity::retardance_waves);
  const Theta theta = cell.b.table.values();
  const std::vector<int> active{cell.thickness.index, cell.birefringence.index, cell.tilt.index, cell.wavelength.index};
  const Rendering r = render(cell.scene, plan(cell.scene, theta, cell.observable), theta, active, 1);
  for (std::size_t j = 0; j < active.size(); ++j) {
    Theta up = theta, down = theta;
    const std::size_t i = static_cast<std::size_t>(active[j]);
    const double h = 1e-4 * theta[i];
    up[i] += h, down[i] -= h;
    const double difference = (cell.value(up) - cell.value(down)) / (2 * h);
    EXPECT_NEAR(r.derivatives[j](0, 0), difference, 1e-6 * std::abs(difference)) << j;  // h^2 of the curvature
  }
}

TEST(Retardance, IsNotOneNumberWhereTheAxisTurns) {
  TiltedCell cell(1.52, 0.2, 0, Quantity::retardance_um);
  std::get<Cell>(cell.scene.sample).director =
      TwistedDirector{cell.b.fixed("twist_deg", 90), cell.b.fixed("azimuth", 0), cell.b.fixed("pretilt_deg", 0)};
  EXPECT_THROW(plan(cell.scene, cell.b.table.values(), cell.observable), UserError);
}

/// A table of retardances with noise, its thickness known beforehand as `prior` +- 4 um; true: 40 um.
FitResult fitted_with_prior(double prior, double noise) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal(0, noise);
  TiltedCell cell(1.5, 0.01, 0, Quantity::retardance_waves);
  Parameter& thickness = cell.b.table[cell.thickness];
  thickness.free = true, thickness.value = prior, thickness.lower = 1, thickness.upper = 5000, thickness.prior_sd = 4;
  FitJob job;
  Readings table;
  table.name = "table";
  table.observable = cell.observable;
  table.gain = cell.b.fixed("gain", 1), table.offset = cell.b.fixed("offset", 0);
  table.noise = NoiseModel{noise, 0};
  table.values.resize(12);
  for (int i = 0; i < 12; ++i) {
    Scene scene = cell.scene;
    const double nm = 450 + 20 * i;
    scene.microscope.wavelength_nm = cell.b.fixed("wavelength" + std::to_string(i), nm);
    table.rows.push_back(scene);
    table.lines.push_back(i + 2);
    table.values[i] = 0.01 * 40 / (1e-3 * nm) + normal(random);
  }
  job.measurements = {table};
  job.parameters = cell.b.table;
  return fit(job);
}

// What is known beforehand and what the data say: in accord, at odds with the data the stronger, at odds with the prior
// the stronger.
TEST(Retardance, APriorThatTheDataContradictIsNamed) {
  const FitResult right = fitted_with_prior(43, 0.01);
  EXPECT_TRUE(right.has_answer());
  EXPECT_EQ(right.verdict.find("contradict"), std::string::npos) << right.verdict;
  EXPECT_NEAR(right.parameters[0].value, 40, 4 * right.parameters[0].stderr_);
  const FitResult by_data = fitted_with_prior(90, 0.01);
  EXPECT_NE(by_data.verdict.find("thickness_um contradicts what was known of it"), std::string::npos)
      << by_data.verdict;
  EXPECT_NEAR(by_data.parameters[0].value, 40, 2);
  const FitResult by_prior = fitted_with_prior(700, 0.03);
  EXPECT_NE(by_prior.verdict.find("contradict"), std::string::npos) << by_prior.verdict;
}

TEST(Rows, SlipsAndTheWayThereShow) {
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal(0, 0.01);
  std::vector<double> x, same, loop;
  for (int i = 0; i < 120; ++i) {
    const double way = i < 60 ? i : 119 - i;
    x.push_back(way);
    const double curve = std::sin(0.05 * way), noise = normal(random);
    same.push_back(curve + noise);
    loop.push_back(curve + (i < 60 ? 0 : 0.15 * std::sin(M_PI * way / 60)) + noise);
  }
  EXPECT_TRUE(look_at_rows(x, same).outliers.empty());
  EXPECT_FALSE(look_at_rows(x, same).hysteretic());
  EXPECT_GT(look_at_rows(x, same).compared, 80);
  EXPECT_TRUE(look_at_rows(x, loop).hysteretic());
  same[17] += 0.3, same[90] -= 0.3;
  EXPECT_EQ(look_at_rows(x, same).outliers, (std::vector<std::size_t>{17, 90}));
  // One way only: nothing to compare.
  x.resize(60), loop.resize(60);
  EXPECT_EQ(look_at_rows(x, loop).compared, 0);
}

/// A table of a planar cell of 12 um and ordinary index 1.52, whose birefringence is fitted.
struct CellTable {
  TableBuilder b;
  Readings table;
  ParameterRef thickness = b.fixed("thickness_um", 12), zero = b.fixed("zero", 0), air = b.fixed("air", 1);
  ParameterRef ordinary = b.fixed("ordinary", 1.52), birefringence = b.fitted("birefringence", 0.16, 0.05, 0.35);
  std::vector<double> values;

  explicit CellTable(Quantity quantity) {
    table.name = "rows.csv";
    table.observable.quantity = quantity;
    table.gain = b.fixed("gain", 1), table.offset = zero;
  }
  void add_row(ParameterRef tilt_deg, ParameterRef wavelength_nm, double value) {
    Scene scene;
    Cell cell;
    cell.thickness_um = thickness;
    UniformDirector director;
    director.azimuth_deg = zero;
    director.tilt_deg = tilt_deg;
    cell.director = director;
    scene.sample = cell;
    scene.material = ConstantIndices{ordinary, birefringence};
    scene.surround_index = air;
    scene.microscope.wavelength_nm = wavelength_nm;
    scene.microscope.polarizer_deg = scene.microscope.analyzer_deg = zero;
    scene.view.width = scene.view.height = 1;
    table.rows.push_back(scene);
    table.lines.push_back(static_cast<int>(table.rows.size()) + 1);
    values.push_back(value);
  }
  FitResult fitted(double noise) {
    table.values = Eigen::Map<Eigen::VectorXd>(values.data(), std::ssize(values));
    table.noise = NoiseModel{noise, 0, false};
    FitJob job;
    job.measurements.push_back(table);
    job.parameters = b.table;
    job.options.threads = 1;
    return fit(job);
  }
};

/// Path differences against the tilt of the axis, bent by a bow of the part `bow` of their range, with noise of a
/// five-hundredth of that.
FitResult fit_of_tilts(double birefringence, double bow, unsigned seed) {
  constexpr int kRows = 30;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  CellTable cell(Quantity::retardance_um);
  const ParameterRef wavelength = cell.b.fixed("wavelength_nm", 600);
  const double range = path(1.52, birefringence, 0, 12);
  for (int row = 0; row < kRows; ++row) {
    const double tilt = 80.0 * row / (kRows - 1), t = 2.0 * row / (kRows - 1) - 1;
    cell.add_row(cell.b.fixed("tilt" + std::to_string(row), tilt), wavelength,
                 path(1.52, birefringence, tilt, 12) + range * (bow * std::cos(1.5 * M_PI * t) + normal(random) / 500));
  }
  return cell.fitted(range / 500);
}

// What rows miss a law of retardance by in a pattern moves it as that of light does, and beyond 3 % of the range there
// is no answer.
TEST(Rows, OfRetardancesAreChargedForWhatFollowsAPattern) {
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> birefringence(0.1, 0.25);
  int answers = 0, inside = 0;
  constexpr int kTables = 20;
  for (unsigned i = 0; i < kTables; ++i) {
    const double truth = birefringence(random);
    const FitResult r = fit_of_tilts(truth, 0.01, i);
    answers += r.has_answer();
    inside += r.has_answer() && holds(r, "birefringence", truth);
    EXPECT_EQ(fit_of_tilts(truth, 0.1, i).grade(), "not described") << truth;
    EXPECT_EQ(fit_of_tilts(truth, 0, i).grade(), "answer") << truth;
  }
  EXPECT_GE(answers, kTables * 4 / 5);
  EXPECT_GE(inside, answers * 0.95 - 3 * std::sqrt(answers * 0.95 * 0.05));
}

// The wavelengths of a table are read off one scale, all of them off by the same share: however many rows, the
// birefringence is known no better than that.
TEST(Rows, OfWavelengthsHaveOneScale) {
  constexpr int kTables = 40, kRows = 25;
  constexpr double kShare = 0.003, kNoise = 1e-4, kTruth = 0.15;
  std::mt19937_64 random(12);
  std::normal_distribution<double> normal;
  int inside = 0;
  for (int i = 0; i < kTables; ++i) {
    const double scale = 1 + kShare * normal(random);
    CellTable cell(Quantity::retardance_waves);
    for (int row = 0; row < kRows; ++row) {
      Parameter wavelength;
      wavelength.name = "signal[0].row[" + std::to_string(row) + "].microscope.light.wavelength_nm";
      wavelength.value = 450 + 10 * row;
      wavelength.unit = "nm";
      wavelength.known_to.share = kShare;
      cell.add_row(cell.zero, cell.b.table.add(wavelength),
                   path(1.52, kTruth, 0, 12) / (1e-3 * wavelength.value * scale) + kNoise * normal(random));
    }
    const FitResult r = cell.fitted(kNoise);
    ASSERT_TRUE(r.has_answer()) << r.verdict;
    const ParameterEstimate* found = find_estimate(r, "birefringence");
    // Two standard deviations to either side, and a tenth for the t quantile.
    EXPECT_LT(found->interval95_high - found->interval95_low, 2 * 2.2 * kShare * kTruth) << r.verdict;
    inside += found->interval95_low <= kTruth && kTruth <= found->interval95_high;
  }
  EXPECT_GE(inside, kTables * 0.95 - 3 * std::sqrt(kTables * 0.95 * 0.05));
}

}  // namespace
}  // namespace birefit
