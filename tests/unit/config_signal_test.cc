// What load_config makes of tables of signals, and where it says they are wrong.

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdio>
#include <random>
#include <string>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "config_fixture.h"
#include "pictures.h"

namespace birefit {
namespace {
using namespace std::string_literals;

class ConfigSignal : public testing::ConfigFolder {};

const std::string kSignal = R"(signal:
  - {file: a.csv, value: out, columns: {sample.cell.director.freedericksz.voltage_v: volts}, set:
       {microscope.light.wavelength_nm: 500}}
  - {file: b.csv, value: out, columns: {sample.cell.director.freedericksz.voltage_v: volts}, set:
       {microscope.light.wavelength_nm: 600, micrograph.gain: {fit: auto}}, noise: 0.5, every: 2}
sample:
  cell:
    thickness_um: {value: 5, fit: [4, 6]}
    director: {freedericksz: {threshold_v: 1, k33_over_k11: 1.5, eps_ratio: 3, azimuth_deg: 45}}
  material: {ordinary: 1.52, birefringence: 0.2}
microscope: {light: {wavelength_nm: 550}, polarizer_deg: 0, analyzer_deg: 90}
)";

TEST_F(ConfigSignal, GivesEveryRowOfASignalASceneOfItsOwn) {
  write("a.csv", ",volts,out\n0,0.5,1\n1,1,2\n2,2,4\n3,3,8\n");
  write("b.csv", "out,volts\n1,0.5\n2,1\n3,1.5\n4,2\n5,2.5\n");
  const auto config = load(kSignal, ConfigUse::fit);
  ASSERT_EQ(config.job.measurements.size(), 2u);
  const Readings &a = readings(config.job, 0), &b = readings(config.job, 1);
  ASSERT_EQ(a.rows.size(), 4u);
  ASSERT_EQ(b.rows.size(), 3u);
  ASSERT_EQ(config.signals.size(), 2u);
  EXPECT_EQ(config.signals[1].first, 4u);
  EXPECT_EQ(config.signals[1].x, (std::vector<double>{0.5, 1.5, 2.5}));
  const Theta theta = config.job.parameters.values();
  const auto voltage = [&](const Scene& row) {
    return theta[std::get<FreederickszDirector>(std::get<Cell>(row.sample).director).voltage_v.index];
  };
  EXPECT_EQ(a.values[3], 8);
  EXPECT_EQ(voltage(a.rows[3]), 3);
  EXPECT_EQ(voltage(b.rows[1]), 1.5);
  EXPECT_EQ(theta[a.rows[2].microscope.wavelength_nm.index], 500);
  EXPECT_EQ(theta[b.rows[0].microscope.wavelength_nm.index], 600);
  EXPECT_EQ(b.noise->read_counts, 0.5);
  EXPECT_GT(a.noise->read_counts, 0);
  // The first table has the shared gain, the second its own.
  EXPECT_NE(a.gain.index, b.gain.index);
  for (const Readings* table : {&a, &b}) EXPECT_EQ(config.job.parameters[table->gain].lower, 0);
  // Without images: the scene of the first row.
  EXPECT_EQ(load(kSignal).scene.view.width, 1);
}

TEST_F(ConfigSignal, KnowsRowsAsWellAsTheNumberInItsOwnPlace) {
  write("turns.csv", "dial,out\n0,1\n30,2\n60,4\n90,8\n");
  const auto known_to = [&](const std::string& analyser) {
    const auto config = load(R"(signal: {file: turns.csv, value: out, columns: {microscope.analyzer_deg: dial}}
sample:
  cell: {thickness_um: {value: 5, fit: [4, 6]}, director: {uniform: {azimuth_deg: 45, tilt_deg: 0}}}
  material: {ordinary: 1.52, birefringence: 0.2}
microscope: {light: {wavelength_nm: 550}, polarizer_deg: 0, analyzer_deg: )" +
                                 analyser + "}\n",
                             ConfigUse::fit);
    const Readings& table = readings(config.job, 0);
    EXPECT_EQ(table.rows.size(), 4u);
    return config.job.parameters[table.rows[2].microscope.analyzer_deg].known_to.sd;
  };
  EXPECT_EQ(known_to("0"), 1);
  EXPECT_EQ(known_to("{value: 0, exact: true}"), 0);
  EXPECT_EQ(known_to("{value: 0, prior_sd: 0.2}"), 0.2);
}

// Polarizer and analyser turned to angles in no order: neighbouring rows have nothing to do with each other, and what
// they differ by is no noise. Truth: Malus's law of a retarder, by hand.
TEST_F(ConfigSignal, TheNoiseOfATableOfSeveralColumnsIsWhatTheModelLeavesOver) {
  constexpr int kTables = 12, kRows = 40;
  constexpr double kNoise = 4, kThicknessUm = 5, kWavelengthUm = 0.55;
  int inside = 0;
  for (unsigned seed = 1; seed <= kTables; ++seed) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> angle(0, 180);
    std::normal_distribution<double> noise(0, kNoise);
    const double azimuth = angle(random) / 4 + 22.5, birefringence = 0.118 + angle(random) / 180 * 0.02;
    std::string rows = "polarizer,analyser,signal\n";
    for (int i = 0; i < kRows; ++i) {
      const double polarizer = angle(random), analyser = angle(random), deg = M_PI / 180,
                   p = (polarizer - azimuth) * deg, a = (analyser - azimuth) * deg;
      const std::complex<double> turned =
          std::cos(p) * std::cos(a) +
          std::sin(p) * std::sin(a) * std::polar(1.0, 2 * M_PI * kThicknessUm * birefringence / kWavelengthUm);
      rows += std::to_string(polarizer) + "," + std::to_string(analyser) + "," +
              std::to_string(50 + 1000 * std::norm(turned) + noise(random)) + "\n";
    }
    write("turned.csv", rows);
    const auto config = load(R"(signal:
  file: turned.csv
  value: signal
  columns: {microscope.polarizer_deg: polarizer, microscope.analyzer_deg: analyser}
micrograph: {gain: {fit: auto}, offset: {fit: auto}}
sample:
  cell: {thickness_um: {value: 5, exact: true}, director: {uniform: {azimuth_deg: {value: 45, fit: [10, 80]}}}}
  material: {ordinary: 1.5, birefringence: {value: 0.125, fit: [0.113, 0.15]}}
  surround: {index: 1.5}
microscope: {light: {wavelength_nm: {value: 550, exact: true}}}
physics: {ceiling: e_only}
)",
                             ConfigUse::fit);
    const FitResult result = fit(config.job);
    ASSERT_TRUE(result.has_answer()) << seed << ": " << result.verdict;
    for (const auto& [name, truth] : {std::pair("azimuth_deg", azimuth), {"birefringence", birefringence}})
      for (const ParameterEstimate& e : result.parameters)
        if (e.name.ends_with(name)) {
          inside += e.interval95_low <= truth && truth <= e.interval95_high;
          // sqrt(2 / 36): how well 36 degrees of freedom know it; the light is known to 0.3 % beside it.
          if (e.name.ends_with("birefringence")) EXPECT_LT(e.stderr_, 0.003 * e.value) << seed;
        }
    EXPECT_NEAR(result.micrographs[0].noise.read_counts / kNoise, 1, 4 * std::sqrt(0.5 / 36)) << seed;
  }
  // 19 in 20 of 24, and three sd of that many.
  EXPECT_GE(inside, 24 * 0.95 - 3 * std::sqrt(24 * 0.95 * 0.05));
}

/// Signals of a plate between polarizers that are turned, by Malus's law; `crossed`: by so much.
std::string turned_plate(double azimuth_deg, double phase, double crossed_deg, double noise, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> gaussian(0, noise);
  std::string rows = "polarizer,analyser,signal\n";
  for (double polarizer = 0; polarizer < 180; polarizer += 3) {
    const double deg = M_PI / 180, p = (polarizer - azimuth_deg) * deg, a = p + crossed_deg * deg;
    const std::complex<double> turned = std::cos(p) * std::cos(a) + std::sin(p) * std::sin(a) * std::polar(1.0, phase);
    rows += std::to_string(polarizer) + "," + std::to_string(polarizer + crossed_deg) + "," +
            std::to_string(50 + 1000 * std::norm(turned) + gaussian(random)) + "\n";
  }
  return rows;
}
const std::string kTurnedPlate = R"(signal:
  file: turned.csv
  value: signal
  noise: NOISE
  columns: {microscope.polarizer_deg: polarizer, microscope.analyzer_deg: analyser}
micrograph: {gain: {fit: auto}, offset: {fit: auto}}
sample:
  cell: {thickness_um: {value: THICKNESS, exact: true}, director: {uniform: UNIFORM}}
  material: {ordinary: {value: 1.5, exact: true}, birefringence: BIREFRINGENCE}
  surround: {index: {value: 1.5, exact: true}}
microscope:
  light: {wavelength_nm: {value: 550, exact: true}}
  polarizer_deg: {value: 0, exact: true}
  analyzer_deg: {value: 0, exact: true}
physics: {ceiling: e_only}
)";
double phase_of(double thickness_um, double birefringence) { return 2 * M_PI * thickness_um * birefringence / 0.55; }

// Between parallel polarizers a thin plate takes 0.4 % of the light at most: the rows know gain + offset a thousand
// times better than either. Nobody asked for them: the azimuth is in the phase of what is taken.
TEST_F(ConfigSignal, GainAndOffsetThatActOnlyTogetherKeepNoAzimuthBack) {
  write("turned.csv", turned_plate(37, phase_of(1, 0.011), 0, 0.05, 3));
  std::string text = kTurnedPlate;
  for (const auto& [from, to] : {std::pair("NOISE", "0.05"),
                                 {"THICKNESS", "1"},
                                 {"UNIFORM", "{azimuth_deg: {value: 30, fit: [5, 85]}, tilt_deg: 0}"},
                                 {"BIREFRINGENCE", "{value: 0.011, exact: true}"}})
    text = replaced(text, from, to);
  const FitResult result = fit(load(text, ConfigUse::fit).job);
  EXPECT_TRUE(result.has_answer()) << result.verdict;
  const ParameterEstimate& azimuth = result.parameters[0];
  // A modulation of 2 about noise of 0.05 in 60 rows.
  EXPECT_LT(azimuth.stderr_, 0.5);
  EXPECT_LT(std::abs(azimuth.value - 37), 4 * azimuth.stderr_);
}

/// What lets the field along its azimuth fall behind by a phase, both in degrees.
Eigen::Matrix2cd plate(double phase_deg, double azimuth_deg) {
  const Eigen::Matrix2d turn = Eigen::Rotation2Dd(azimuth_deg * M_PI / 180).toRotationMatrix();
  const Eigen::Vector2cd along(std::polar(1.0, phase_deg * M_PI / 180), 1);
  return turn * along.asDiagonal() * turn.transpose();
}

/// Light that swings there.
Eigen::Vector2cd along(double deg) { return Eigen::Vector2cd(std::cos(deg * M_PI / 180), std::sin(deg * M_PI / 180)); }

// Rows of an analyser behind a circular polariscope whose plates are each off by themselves, by 3 degrees in phase and
// by 1 on their mounts, as are both dials: intervals hold as often as they say. With one phase for both plates, and
// mounts that are exact, 78 of 98 did.
TEST_F(ConfigSignal, PlatesOfACircularPolariscopeAreOffEachByItself) {
  constexpr int kTables = 100;
  constexpr double kWavelengthNm = 546.1, kNoise = 3;
  int inside = 0, answers = 0;
  for (unsigned seed = 1; seed <= kTables; ++seed) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> share(0, 1);
    std::normal_distribution<double> normal;
    const double azimuth = 180 * share(random), retardance = 40 + 200 * share(random), polarizer = normal(random),
                 zero = normal(random);
    const Eigen::Matrix2cd parts = plate(90 + 3 * normal(random), polarizer - 45 + normal(random)) *
                                   plate(360 * retardance / kWavelengthNm, azimuth + normal(random)) *
                                   plate(90 + 3 * normal(random), polarizer + 45 + normal(random));
    std::string rows = "analyser,signal\n";
    for (int dial = 0; dial < 180; dial += 15)
      rows += std::to_string(dial) + "," +
              std::to_string(50 + 1000 * std::norm(along(dial + zero).dot(parts * along(polarizer))) +
                             kNoise * normal(random)) +
              "\n";
    write("turned.csv", rows);
    const auto config = load(R"(signal: {file: turned.csv, value: signal, columns: {microscope.analyzer_deg: analyser}}
micrograph: {gain: {fit: auto}, offset: {fit: auto}}
sample:
  cell: {thickness_um: {value: 1, fit: [0.05, 2.7]}, director: {uniform: {azimuth_deg: )" +
                                 std::to_string(azimuth) +
                                 R"(}}}
  material: {ordinary: 1.5, birefringence: {value: 0.1, exact: true}}
  surround: {index: 1.5}
microscope: {light: {wavelength_nm: 546.1}, polarizer_deg: 0, analyzer_deg: 0, quarter_wave: true}
physics: {ceiling: e_only}
)",
                             ConfigUse::fit);
    const FitResult result = fit(config.job);
    if (!result.has_answer()) continue;  // a sample whose axes hide it
    ++answers;
    const ParameterEstimate& thickness = result.parameters[0];
    const double truth = retardance / 100;
    inside += thickness.interval95_low <= truth && truth <= thickness.interval95_high;
  }
  // 19 in 20, and three sd of that many; one table in ten may have no answer.
  EXPECT_GE(inside, answers * 0.95 - 3 * std::sqrt(answers * 0.95 * 0.05));
  EXPECT_GE(answers, 0.9 * kTables);
  RecordProperty("inside", inside), RecordProperty("answers", answers);
}

/// A plate at 45 degrees between linear polarizers, of 150 to 400 nm.
const std::string kLinear = R"(signal: {file: turned.csv, value: signal, columns: {microscope.analyzer_deg: analyser}}
micrograph: {offset: {value: 0, exact: true}}
sample:
  cell: {thickness_um: {value: 2.5, fit: [1.5, 4]}, director: {uniform: {azimuth_deg: 45}}}
  material: {ordinary: 1.5, birefringence: {value: 0.1, exact: true}}
  surround: {index: 1.5}
microscope: {light: {wavelength_nm: 546.1}, polarizer_deg: 0, analyzer_deg: 0}
physics: {ceiling: e_only}
report: {retardance_um: "thickness_um * birefringence"}
)";
/// What kLinear's analyser sees of this plate, all off by `off` times what each is known to.
std::string seen_by_analyser(double retardance_nm, double noise, double off, std::mt19937_64& random, int step = 15) {
  std::normal_distribution<double> normal;
  const double wavelength = 546.1 * (1 + 0.003 * off * normal(random)), polarizer = off * normal(random),
               zero = off * normal(random), azimuth = 45 + off * normal(random);
  const Eigen::Matrix2cd parts = plate(360 * retardance_nm / wavelength, azimuth);
  std::string rows = "analyser,signal\n";
  for (int dial = 0; dial < 180; dial += step)
    rows += std::to_string(dial) + "," +
            std::to_string(1000 * std::norm(along(dial + zero).dot(parts * along(polarizer))) +
                           1000 * noise * normal(random)) +
            "\n";
  return rows;
}

// Near half a wave light hardly answers to a retardance, and less on the side of the half wave: the interval is that of
// the likelihood, and what follows from the number alone has the same, though the light that moves it is stated.
TEST_F(ConfigSignal, WhatFollowsFromOneNumberHasItsInterval) {
  std::mt19937_64 random(1);
  write("turned.csv", seen_by_analyser(281, 0.003, 0, random));
  const FitResult result = fit(load(kLinear, ConfigUse::fit).job);
  const ParameterEstimate& thickness = result.parameters[0];
  ASSERT_TRUE(thickness.profiled) << result.verdict;
  ASSERT_EQ(result.derived.size(), 1u);
  EXPECT_NEAR(result.derived[0].interval95_low, 0.1 * thickness.interval95_low, 1e-12);
  EXPECT_NEAR(result.derived[0].interval95_high, 0.1 * thickness.interval95_high, 1e-12);
}

// With the birefringence stated, which the thickness makes up for, light still knows the retardance alone: by the same
// likelihood.
TEST_F(ConfigSignal, WhatFollowsFromFittedAndStatedHasTheLikelihoodOfWhatIsSeen) {
  std::mt19937_64 random(1);
  write("turned.csv", seen_by_analyser(281, 0.003, 0, random));
  const auto retardance = [&](const std::string& text) {
    const FitResult result = fit(load(text, ConfigUse::fit).job);
    EXPECT_TRUE(result.parameters[0].profiled) << result.verdict;
    return result.derived.at(0);
  };
  const DerivedEstimate alone = retardance(kLinear),
                        stated = retardance(replaced(kLinear, "{value: 0.1, exact: true}", "0.1"));
  // The likelihood's two halves differ, and how much wider either is than the other is told to a tenth.
  const auto low = [](const DerivedEstimate& d) { return d.value - d.interval95_low; };
  const auto high = [](const DerivedEstimate& d) { return d.interval95_high - d.value; };
  EXPECT_GT(std::abs(std::log(low(alone) / high(alone))), 0.2);
  EXPECT_NEAR(low(stated) / low(alone), 1, 0.15);
  EXPECT_NEAR(high(stated) / high(alone), 1, 0.15);
}

// Noise that was read off rows is known by as many rows: what they leave over counts where it is more.
TEST_F(ConfigSignal, NoiseReadOffRowsIsNoBetterKnownThanByThem) {
  int more = 0;
  for (unsigned seed = 1; seed <= 12; ++seed) {
    std::mt19937_64 random(seed);
    write("turned.csv", seen_by_analyser(200, 0.003, 0, random, 3));
    const FitResult read = fit(load(kLinear, ConfigUse::fit).job);
    if (read.frame_scatter) continue;
    const std::string noise = std::to_string(read.micrographs[0].noise.read_counts);
    const FitResult stated =
        fit(load(replaced(kLinear, "value: signal,", "value: signal, noise: " + noise + ","), ConfigUse::fit).job);
    // Errors by what is stated are the same in both.
    const auto of_noise = [](const FitResult& r) { return r.covariance(0, 0) - r.stated_covariance(0, 0); };
    // What is stated may be exceeded by a lamp's jitter as well, up to a tenth here; what is read holds it already.
    const bool scaled = read.covariance_kind.starts_with("scaled by reduced chi-square");
    const double scale = scaled ? read.reduced_chi_square : 1, ratio = of_noise(read) / of_noise(stated);
    EXPECT_LT(ratio, scale + 0.05) << seed << ": " << read.covariance_kind;
    EXPECT_GT(ratio, 0.9 * scale) << seed << ": " << read.covariance_kind;
    more += scaled;
  }
  EXPECT_GE(more, 3);
}

// About half a wave a picture knows a retardance by its square alone, and does not know the side: an interval that
// holds both, or two minima, and never one of them alone.
TEST_F(ConfigSignal, AboutHalfAWaveIntervalsHoldBothSides) {
  for (const double noise : {0.003, 0.0003}) {
    constexpr int kTables = 40;
    int answers = 0, inside = 0, ambiguous = 0;
    for (unsigned seed = 1; seed <= kTables; ++seed) {
      std::mt19937_64 random(seed);
      const double retardance = std::uniform_real_distribution<double>(261, 285)(random);
      write("turned.csv", seen_by_analyser(retardance, noise, 1, random));
      const FitResult result = fit(load(kLinear, ConfigUse::fit).job);
      ambiguous += result.ambiguous;
      if (!result.has_answer()) continue;
      ++answers;
      const ParameterEstimate& thickness = result.parameters[0];
      const double truth = retardance / 100, middle = (thickness.interval95_low + thickness.interval95_high) / 2;
      inside += thickness.interval95_low <= truth && truth <= thickness.interval95_high;
      EXPECT_LT(std::abs(truth - middle), 2.5 * (thickness.interval95_high - middle)) << seed;
    }
    std::printf("  noise %g: of %d tables %d answers, %d ambiguous, %d intervals hold\n", noise, kTables, answers,
                ambiguous, inside);
    // 19 in 20, and three sd of that many; no other reason than two minima leaves one without an answer.
    EXPECT_GE(inside, answers * 0.95 - 3 * std::sqrt(answers * 0.95 * 0.05));
    EXPECT_EQ(answers + ambiguous, kTables);
    EXPECT_GE(answers, kTables / 2);
  }
}

// A film in air by the interference within it (Airy): fringes know n d to parts in a hundred thousand and their
// contrast n to a per mille. They act together all but wholly, and each is known.
TEST_F(ConfigSignal, AFilmsIndexAndThicknessAreAnAnswerWhereEachIsKnown) {
  constexpr double kIndex = 1.52, kThicknessUm = 12;
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal(0, 0.0003);
  std::string rows = "wavelength_nm,signal\n";
  for (double nm = 500; nm <= 700; nm += 4) {
    const double r = std::pow((kIndex - 1) / (kIndex + 1), 2), finesse = 4 * r / std::pow(1 - r, 2),
                 half = 2 * M_PI * kIndex * kThicknessUm / (1e-3 * nm);
    rows += std::to_string(nm) + "," +
            std::to_string(1 / (1 + finesse * std::pow(std::sin(half), 2)) + normal(random)) + "\n";
  }
  write("film.csv", rows);
  const FitResult result = fit(load(R"(signal:
  file: film.csv
  value: signal
  columns: {microscope.light.wavelength_nm: wavelength_nm}
micrograph: {gain: {fit: auto}, offset: 0}
sample:
  cell: {thickness_um: {value: 11.9, fit: [11.6, 12.4]}, director: {uniform: {azimuth_deg: 0}}}
  material: {ordinary: {value: 1.5, fit: [1.4, 1.65]}, birefringence: 0}
  surround: {index: {value: 1, exact: true}}
microscope: {light: {wavelength_nm: {value: 600, exact: true}}, polarizer_deg: 0, analyzer_deg: 0}
physics: {ceiling: reflections}
)",
                                    ConfigUse::fit)
                                   .job);
  EXPECT_TRUE(result.has_answer()) << result.verdict;
  EXPECT_GT(std::abs(result.correlation(0, 1)), 0.9999);
  for (const auto& [name, truth] : {std::pair("thickness_um", kThicknessUm), {"ordinary", kIndex}})
    for (const ParameterEstimate& e : result.parameters)
      if (e.name.ends_with(name)) EXPECT_LT(std::abs(e.value - truth), 2 * (e.interval95_high - e.value)) << name;
}

// Two spectra, each of a cell of its own thickness, which one calliper has measured: what it is off by is in the error,
// though no number is the same in both tables.
TEST_F(ConfigSignal, ThicknessesOfTablesAreOffByOneScale) {
  constexpr int kDraws = 24;
  int inside = 0;
  for (unsigned seed = 1; seed <= kDraws; ++seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    const double birefringence = std::uniform_real_distribution<double>(0.1, 0.2)(random),
                 scale = 1 + 0.005 * normal(random);
    for (const auto& [name, thickness] : {std::pair("a.csv", 5.87), {"b.csv", 9.78}}) {
      std::string rows = "nm,signal\n";
      for (int nm = 450; nm <= 650; nm += 5)
        rows += std::to_string(nm) + "," +
                std::to_string(1000 * std::pow(std::sin(M_PI * thickness * scale * birefringence * 1000 / nm), 2) +
                               5 * normal(random)) +
                "\n";
      write(name, rows);
    }
    const FitResult result = fit(load(R"(signal:
  - {file: a.csv, value: signal, columns: {microscope.light.wavelength_nm: nm}, set: {sample.cell.thickness_um: 5.87}}
  - {file: b.csv, value: signal, columns: {microscope.light.wavelength_nm: nm}, set: {sample.cell.thickness_um: 9.78}}
micrograph: {gain: {fit: auto}, offset: {fit: auto}}
sample:
  cell: {thickness_um: 5, director: {uniform: {azimuth_deg: {value: 45, exact: true}}}}
  material: {ordinary: 1.5, birefringence: {value: 0.15, fit: [0.08, 0.22]}}
  surround: {index: 1.5}
microscope:
  light: {wavelength_nm: {value: 550, exact: true}}
  polarizer_deg: {value: 0, exact: true}
  analyzer_deg: {value: 90, exact: true}
physics: {ceiling: e_only}
)",
                                      ConfigUse::fit)
                                     .job);
    ASSERT_TRUE(result.has_answer()) << seed << ' ' << result.verdict;
    inside +=
        result.parameters[0].interval95_low <= birefringence && birefringence <= result.parameters[0].interval95_high;
    // Nothing in the tables tells the scale from the birefringence.
    EXPECT_NEAR(result.parameters[0].stderr_ / (0.005 * birefringence), 1, 0.2) << seed;
  }
  EXPECT_GE(inside, kDraws * 0.95 - 3 * std::sqrt(kDraws * 0.95 * 0.05));
}

// A weak plate behind an analyser whose zero, or a polarizer that is off by a degree, looks like a stronger plate that
// lies nearly along the polarizer: intervals have to bend with what is stated, or two minima are named.
TEST_F(ConfigSignal, AWeakPlateAndDialsThatAreOff) {
  constexpr int kTables = 40;
  int answers = 0, intervals = 0, inside = 0, ambiguous = 0;
  for (unsigned seed = 1; seed <= kTables; ++seed) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> share(0, 1);
    std::normal_distribution<double> normal;
    const double azimuth = 10 + 70 * share(random), birefringence = 1e-4 * (1.2 + 8 * share(random)),
                 polarizer = normal(random), zero = normal(random);
    const Eigen::Matrix2cd parts = plate(360 * birefringence * 50 / 0.5893, azimuth);
    std::string rows = "analyser,signal\n";
    for (int dial = 0; dial <= 180; dial += 5)
      rows += std::to_string(dial) + "," +
              std::to_string(1000 * std::norm(along(dial + zero).dot(parts * along(polarizer))) + normal(random)) +
              "\n";
    write("turned.csv", rows);
    const FitResult result = fit(load(R"(signal: {file: turned.csv, columns: {microscope.analyzer_deg: analyser}}
micrograph: {gain: {fit: auto}, offset: 0}
sample:
  cell: {thickness_um: 50, director: {uniform: {azimuth_deg: {value: 45, fit: [0, 90]}}}}
  material: {ordinary: 1.52, birefringence: {value: 0.001, fit: [0.00002, 0.0058]}}
  surround: {index: 1.52}
microscope: {light: {wavelength_nm: {value: 589.3, exact: true}}, polarizer_deg: 0, analyzer_deg: 0}
)",
                                      ConfigUse::fit)
                                     .job);
    ambiguous += result.ambiguous;
    if (!result.has_answer()) continue;
    ++answers;
    for (const auto& [name, truth] : {std::pair("azimuth_deg", azimuth), {"birefringence", birefringence}})
      for (const ParameterEstimate& e : result.parameters) {
        if (!e.name.ends_with(name)) continue;
        ++intervals;
        inside += e.interval95_low <= truth && truth <= e.interval95_high;
        const double middle = (e.interval95_low + e.interval95_high) / 2;
        EXPECT_LT(std::abs(truth - middle), 2.5 * (e.interval95_high - middle)) << seed << ' ' << name << ' ' << truth;
      }
  }
  std::printf("  of %d tables %d answers, %d ambiguous, %d of %d intervals hold\n", kTables, answers, ambiguous, inside,
              intervals);
  // 19 in 20, and three sd of as many as there are tables, whose two intervals miss together.
  EXPECT_GE(inside, intervals * (0.95 - 3 * std::sqrt(0.05 * 0.95 / answers)));
}

TEST_F(ConfigSignal, LightThatIsStatedIsTakenAsExactAndListed) {
  std::mt19937_64 random(1);
  write("turned.csv", seen_by_analyser(200, 0.003, 0, random));
  const auto listed = [&](const std::string& micrograph) {
    const std::string text = replaced(kLinear, "{offset: {value: 0, exact: true}}", micrograph);
    std::string all;
    for (const std::string& line : load(text, ConfigUse::fit).job.taken_as_exact) all += line;
    return all;
  };
  EXPECT_NE(listed("{gain: 1000, offset: 0}").find("the gain and offset of the table's light"), std::string::npos);
  EXPECT_NE(listed("{gain: {fit: auto}, offset: 0}").find("the offset of the table's light"), std::string::npos);
  EXPECT_EQ(listed("{gain: {fit: auto}, offset: {fit: auto}}").find("of the table's light"), std::string::npos);
}

TEST_F(ConfigSignal, LogarithmsOfLightAreNamed) {
  const auto warns = [&](const std::string& column) {
    write("a.csv", "analyser,\"" + column + "\"\n0,1\n15,2\n30,3\n45,4\n60,5\n");
    std::string text = replaced(kLinear, "turned.csv, value: signal", "a.csv, value: \"" + column + "\"");
    const std::vector<std::string> said = load(text, ConfigUse::fit).job.warnings;
    return std::any_of(said.begin(), said.end(),
                       [](const std::string& line) { return line.find("logarithm of light") != std::string::npos; });
  };
  for (const char* column : {"absorbance", "Absorbance (a.u.)", "OD", "signal (dB)", "power, dBm"})
    EXPECT_TRUE(warns(column)) << column;
  for (const char* column : {"signal", "diode", "model", "odd", "T"}) EXPECT_FALSE(warns(column)) << column;
}

TEST_F(ConfigSignal, SaysWhereASignalIsWrong) {
  write("a.csv", "volts,out\n0.5,1\n-1,2\n2,4\n");
  write("b.csv", "volts,aut\n0.5,1\n1,2\n1.5,3\n");
  EXPECT_EQ(mistakes(kSignal, ConfigUse::fit),
            "config.yaml:4:12: b.csv has no column out; did you mean aut?\n"
            "a.csv:3:1: volts = -1 is outside [0, 100000], the range of sample.cell.director.freedericksz.voltage_v");
  EXPECT_NE(mistakes(replaced(kSignal, "voltage_v: volts", "voltage: volts"), ConfigUse::fit).find("did you mean"),
            std::string::npos);
  EXPECT_NE(mistakes("micrograph: {roi_px: [0, 0, 3, 3]}\n" + kSignal, ConfigUse::fit)
                .find("1:22: micrograph.roi_px is of images"),
            std::string::npos);
  EXPECT_NE(mistakes("image_size_px: [3, 3]\n" + kSignal, ConfigUse::fit).find("image_size_px is given beside signal"),
            std::string::npos);
  EXPECT_NE(mistakes(replaced(kSignal, "columns: {sample.cell.director.freedericksz.voltage_v: volts}, set", "set"),
                     ConfigUse::fit)
                .find("columns"),
            std::string::npos);
}

const std::string kBirefringence = R"(signal:
  file: a.csv
  value: dn
  quantity: birefringence
  columns: {sample.material.temperature_k: {column: celsius, scale: 1, plus: 273.15}}
  where: {kind: nematic, celsius: [0, 50]}
sample:
  cell: {thickness_um: 10, director: {uniform: {azimuth_deg: 0}}}
  material:
    {ordinary: 1.5, birefringence: {value: 0.1, fit: [0, 0.3]}, temperature_k: 300,
     haller: {reference_k: 298, clearing_k: 330, exponent: 0.2}}
microscope: {light: {wavelength_nm: 550}}
)";

// The radii of a table's rings are one measurement, which tells what is expected of a fit as a picture does.
TEST(RingTable, IsReadingsOfOneSceneWithAnOutlook) {
  const Config config = load_config(BIREFIT_SOURCE_DIR "/fit_configs/linbo3_rings.yaml", ConfigUse::plan);
  ASSERT_EQ(config.job.measurements.size(), 1u);
  const Readings& rings = readings(config.job, 0);
  EXPECT_EQ(rings.observable.quantity, Quantity::ring_radius_cm);
  EXPECT_EQ(rings.rows.size(), 1u);
  ASSERT_EQ(static_cast<std::size_t>(rings.values.size()), rings.observable.ring_numbers.size());
  // rings grow outwards
  for (Eigen::Index i = 1; i < rings.values.size(); ++i) EXPECT_GT(rings.values[i], rings.values[i - 1]);
  for (const ParameterEstimate& expected : outlook(config.job).parameters) {
    EXPECT_TRUE(std::isfinite(expected.stderr_)) << expected.name;
    EXPECT_GT(expected.stderr_, 0) << expected.name;
  }
  EXPECT_THROW(next_shots(config.job, "birefringence"), UserError);
}

// No polarizer, no gain: the table has the birefringence itself. Rows of other kinds, texts and all, are left alone.
TEST_F(ConfigSignal, TakesTheRowsAndUnitsThatASignalAsksFor) {
  write("a.csv",
        "kind,celsius,dn,remark\nnematic,20,0.1,ok\nisotropic,58,0,clear\nnematic,30,0.09,\nnematic,40.5,0.08,"
        "\nnematic,52,0.01,late\nother,none,x,\n");
  const auto config = load(kBirefringence, ConfigUse::fit);
  ASSERT_EQ(config.job.measurements.size(), 1u);
  EXPECT_EQ(config.signals[0].line, (std::vector<int>{2, 4, 5}));
  const Theta theta = config.job.parameters.values();
  const Readings& table = readings(config.job, 0);
  ASSERT_EQ(table.rows.size(), 3u);
  const Scene& last = table.rows[2];
  EXPECT_EQ(theta[static_cast<std::size_t>(std::get<LawIndices>(last.material).temperature_k.index)], 313.65);
  EXPECT_EQ(table.observable.quantity, Quantity::birefringence);
  EXPECT_FALSE(config.job.parameters[table.gain].free);
  EXPECT_EQ(config.job.parameters[table.gain].value, 1);
  EXPECT_EQ(config.job.parameters[table.offset].value, 0);

  EXPECT_NE(mistakes(replaced(kBirefringence, "kind: nematic", "sort: nematic"), ConfigUse::fit)
                .find("a.csv has no column sort"),
            std::string::npos);
  EXPECT_NE(mistakes(replaced(kBirefringence, "kind: nematic", "kind: smectic"), ConfigUse::fit)
                .find("fewer than three rows that `where` lets through"),
            std::string::npos);
  EXPECT_NE(mistakes(replaced(kBirefringence, "[0, 50]", "[50, 0]"), ConfigUse::fit).find("range [low, high]"),
            std::string::npos);
  // Without `kind`: the last row has no temperature, which `where` asks for.
  const auto all = load(replaced(kBirefringence, "kind: nematic, ", ""), ConfigUse::fit);
  EXPECT_EQ(all.signals[0].line, (std::vector<int>{2, 4, 5}));
  EXPECT_NE(all.job.warnings[0].find("a.csv: 1 row without a number left out (line 7)"), std::string::npos);
  write("a.csv", "kind,celsius,dn\nnematic,20,0.1\nnematic,30,1.2.3\nnematic,40,0.08\nnematic,45,0.07\n");
  EXPECT_NE(mistakes(kBirefringence, ConfigUse::fit).find("a.csv:3:12: dn = 1.2.3 is not a finite number"),
            std::string::npos);
  write("a.csv", "kind;celsius;dn\n;K;\nnematic;20,5;0,1\nnematic;30;0,09\nnematic;40;0,08\n");
  EXPECT_EQ(load(kBirefringence, ConfigUse::fit).signals[0].line, (std::vector<int>{3, 4, 5}));
  write("a.csv", "kind;celsius;dn\n;C;\nnematic;20,5;0,1\nnematic;30;0,09\nnematic;40;0,08\n");
  EXPECT_NE(mistakes(replaced(kBirefringence, ", scale: 1, plus: 273.15", ""), ConfigUse::fit)
                .find("celsius is in C by the table's line of units, sample.material.temperature_k in K"),
            std::string::npos);
  // Without a line of units the name may tell.
  for (const char* name : {"T (C)", "temperature_C"}) {
    write("a.csv", "kind,"s + name + ",dn\nnematic,20,0.1\nnematic,30,0.09\nnematic,40,0.08\n");
    const std::string named = replaced(kBirefringence, "celsius", name);
    EXPECT_NE(mistakes(replaced(named, ", scale: 1, plus: 273.15", ""), ConfigUse::fit)
                  .find(name + " is in C by its name, sample.material.temperature_k in K"s),
              std::string::npos);
  }
  EXPECT_NE(mistakes(replaced(kBirefringence, "quantity: birefringence", "quantity: retardance"), ConfigUse::fit)
                .find("retardance_um"),
            std::string::npos);
  EXPECT_NE(mistakes(replaced(kBirefringence, "uniform: {azimuth_deg: 0}",
                              "twisted: {twist_deg: 90, azimuth_deg: 0, pretilt_deg: 0}"),
                     ConfigUse::fit)
                .find("turns about the light"),
            std::string::npos);
  EXPECT_NE(mistakes(replaced(kBirefringence, "  quantity: birefringence\n", ""), ConfigUse::fit).find("polarizer_deg"),
            std::string::npos);
}

}  // namespace
}  // namespace birefit
