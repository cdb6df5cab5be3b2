// What several pictures have in common and nobody states: the zeros of the dials that their angles are read off, the
// drift of their lamp. Truth: the closed matrix of a uniform twist, in code of its own.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <random>
#include <string>

#include "birefit/fit.h"
#include "independent_cell.h"
#include "scene_builder.h"

namespace birefit {
namespace {
using namespace testing;

constexpr int kSide = 12, kPictures = 16;
constexpr double kGain = 1000, kOffset = 50, kNoise = 10, kDialDeg = 1, kLampDrift = 0.005;

struct Zeros {
  double polarizer_deg = 0, analyzer_deg = 0, azimuth_deg = 0;
};
struct Series {
  int pictures = kPictures;
  double dials_known_to_deg = kDialDeg;
  bool twist_known = false;
  double drift = 0;  ///< of the lamp, from the first to the last, as a share
  double code = 0;   ///< what values are rounded to multiples of; 0: they are not
  double noise = kNoise;
  double spread = 0;  ///< of wavelengths from first to last about the middle one, as a share
  double bent = 0;    ///< of the birefringence over these, its mean kept, as a share
};

/// Twist and birefringence of a cell between polarizers at random angles, all of them off by the zeros.
FitResult fit_of(const IndependentCell& cell, const Zeros& zeros, std::mt19937_64& random, const Series& setup = {}) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> angle(0, 180);
  TableBuilder b;
  const auto dial = [&](const std::string& name, double value) {
    const ParameterRef ref = b.fixed(name, value);
    b.table[ref].known_to.sd = setup.dials_known_to_deg;
    return ref;
  };
  Scene scene;
  Cell as_stated;
  as_stated.thickness_um = b.fixed("thickness_um", cell.thickness_um);
  as_stated.director = TwistedDirector{
      .twist_deg = setup.twist_known ? b.fixed("twist_deg", cell.twist_deg) : b.fitted("twist_deg", 85, 60, 120),
      .azimuth_deg = dial("azimuth_deg", cell.azimuth_deg),
      .pretilt_deg = b.fixed("pretilt_deg", 0)};
  scene.sample = as_stated;
  scene.material = ConstantIndices{b.fixed("ordinary", 1.5), b.fitted("birefringence", 0.12, 0.09, 0.17)};
  scene.surround_index = b.fixed("surround", 1.5);
  scene.microscope.wavelength_nm = b.fixed("wavelength_nm", 1000 * cell.wavelength_um);
  scene.view.width = scene.view.height = kSide;
  scene.view.rotation_deg = b.fixed("rotation", 0);
  const ParameterRef gain = b.linear("gain", 900), offset = b.linear("offset", 0);
  b.table[gain].known_to.share = kLampDrift;
  IndependentCell seen = cell;
  seen.azimuth_deg += zeros.azimuth_deg;
  FitJob job;
  for (int k = 0; k < setup.pictures; ++k) {
    const double lamp = 1 + setup.drift * (static_cast<double>(k) / (setup.pictures - 1) - 0.5);
    const double p = angle(random), a = angle(random);
    Scene here = scene;
    const std::string name = "micrographs[" + std::to_string(k) + "].microscope.";
    here.microscope.polarizer_deg = dial(name + "polarizer_deg", p);
    here.microscope.analyzer_deg = dial(name + "analyzer_deg", a);
    const double along = 2.0 * k / (setup.pictures - 1) - 1;
    seen.wavelength_um = cell.wavelength_um * (1 + setup.spread * along);
    seen.birefringence = cell.birefringence * (1 + setup.bent * (along * along - 1.0 / 3));
    here.microscope.wavelength_nm = b.fixed(name + "wavelength_nm", 1000 * seen.wavelength_um);
    const double light = seen.intensity(p + zeros.polarizer_deg, a + zeros.analyzer_deg);
    std::vector<double> values(kSide * kSide);
    for (double& v : values) {
      v = kOffset + lamp * kGain * light + setup.noise * normal(random);
      if (setup.code > 0) v = setup.code * std::round(v / setup.code);
    }
    Picture picture = micrograph_of(name, here, std::move(values), gain, offset, {setup.noise, 0});
    if (setup.code > 0) picture.noise.reset();  // estimated from the pictures, as a user would
    job.measurements.push_back(std::move(picture));
  }
  job.parameters = b.table;
  job.demand.ceiling = Ceiling::e_only;
  job.options.threads = 1;
  return fit(job);
}

/// Intervals of twist and birefringence of random cells, `series_of(random)` and `zeros_of(random)` for each.
template <class SetupOf, class ZerosOf>
void expect_intervals_hold(int problems, unsigned seed, const SetupOf& series_of, const ZerosOf& zeros_of) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> twist(70, 110), birefringence(0.11, 0.15);
  int answers = 0, inside = 0;
  for (int problem = 0; problem < problems; ++problem) {
    IndependentCell cell;
    cell.twist_deg = twist(random), cell.birefringence = birefringence(random);
    const Zeros zeros = zeros_of(random);
    const FitResult r = fit_of(cell, zeros, random, series_of(random));
    if (!r.has_answer()) continue;
    ++answers;
    inside += holds(r, "twist_deg", cell.twist_deg) + holds(r, "birefringence", cell.birefringence);
  }
  std::printf("  %d answers of %d, %d of %d intervals hold\n", answers, problems, inside, 2 * answers);
  // 95 %, and three sd of that many: the two of a cell move together.
  EXPECT_GE(inside, 2 * answers * (0.95 - 3 * std::sqrt(0.05 * 0.95 / std::max(1, answers))));
  EXPECT_GE(answers, problems * 4 / 5);
}
Zeros no_zeros(std::mt19937_64&) { return {}; }

TEST(Dials, ZerosDrawnFromTheirUncertaintyLeaveIntervalsThatHold) {
  std::normal_distribution<double> normal(0, kDialDeg);
  expect_intervals_hold(
      25, 17, [](std::mt19937_64&) { return Series{}; },
      [&](std::mt19937_64& random) {
        return Zeros{normal(random), normal(random), normal(random)};
      });
}

// Six pictures, four unknowns: next to nothing is left to tell a drift by.
TEST(Lamp, ADriftDrawnFromItsUncertaintyLeavesIntervalsThatHold) {
  std::normal_distribution<double> drift(0, 2 * kLampDrift);
  expect_intervals_hold(
      60, 23,
      [&](std::mt19937_64& random) {
        return Series{.pictures = 5, .dials_known_to_deg = 0, .drift = drift(random), .noise = 2};
      },
      no_zeros);
}

// Every pixel of an even picture is rounded the same way: no mean makes that smaller.
TEST(FewCodes, RoundingIsInTheErrors) {
  for (const double code : {50.0, 200.0})
    expect_intervals_hold(
        80, 3,
        [&](std::mt19937_64&) {
          return Series{.pictures = 5, .dials_known_to_deg = 0, .code = code, .noise = 0.1 * code};
        },
        no_zeros);
}

// A law that is off by a bow about its mean is no scatter, which many rows would make small.
TEST(Rows, ALawThatIsOffIsPaidFor) {
  expect_intervals_hold(
      30, 29,
      [&](std::mt19937_64&) { return Series{.pictures = 36, .dials_known_to_deg = 0, .spread = 0.3, .bent = 0.04}; },
      no_zeros);
}

// What the pictures tell of a zero is found, and one far beyond its uncertainty is named. (A twist that is not known
// would take it over.)
TEST(Dials, AnAnalyserFarOffIsNamed) {
  std::mt19937_64 random(5);
  const IndependentCell cell;
  const FitResult r = fit_of(cell, {0, 6, 0}, random, {.twist_known = true});
  ASSERT_TRUE(r.has_answer()) << r.verdict;
  EXPECT_TRUE(holds(r, "birefringence", cell.birefringence)) << r.verdict;
  // Turned all together they are as they were: what is found is what polarizers and director have against each other.
  bool named = false;
  for (const StatedNumber& number : r.stated) named = named || std::abs(number.away()) > kContradicted;
  EXPECT_TRUE(named) << r.verdict;
}

}  // namespace
}  // namespace birefit
