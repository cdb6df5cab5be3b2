// What is stated of an instrument and nobody knows exactly: with every such number drawn from its uncertainty the 95 %
// intervals hold what they say, and what is off by more is found, named, or there is no answer.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <functional>
#include <random>
#include <vector>

#include "birefit/fit.h"
#include "scene_builder.h"

namespace birefit {
namespace {
using namespace testing;

constexpr int kSize = 64;
constexpr double kGain = 900, kOffset = 100, kNoise = 8;

/// A scene, its fitted numbers with their truth, and its stated ones with their uncertainty.
struct Stated {
  TableBuilder b;
  Scene scene;
  Demand demand;
  struct Fitted {
    ParameterRef ref;
    double truth, start;
  };
  std::vector<Fitted> fitted;
  std::vector<ParameterRef> stated;
  ParameterRef gain, offset;

  ParameterRef fit(const std::string& name, double truth, double start, double low, double high) {
    fitted.push_back({b.fitted(name, truth, low, high), truth, start});
    return fitted.back().ref;
  }
  ParameterRef known(const std::string& name, double value, double sd) {
    stated.push_back(b.fixed(name, value));
    b.table[stated.back()].known_to.sd = sd;
    return stated.back();
  }
};

/// A radial droplet under an objective of 0.8, whose depth of field is 0.7 um.
Stated droplet(Ceiling ceiling) {
  Stated s;
  s.demand.ceiling = ceiling;
  birefit::Droplet droplet;
  droplet.diameter_um = s.fit("diameter_um", 9.3, 9.5, 7.5, 11);
  s.scene.sample = droplet;
  s.scene.material = ConstantIndices{s.known("ordinary", 1.52, 0.01), s.fit("birefringence", 0.22, 0.2, 0.1, 0.3)};
  s.scene.surround_index = s.known("surround", 1.47, 0.01);
  s.scene.microscope.wavelength_nm = s.known("wavelength_nm", 590, 0.003 * 590);
  s.scene.microscope.polarizer_deg = s.known("polarizer_deg", 10, 1);
  s.scene.microscope.analyzer_deg = s.known("analyzer_deg", 100, 1);
  if (ceiling == Ceiling::wave) {
    s.scene.microscope.objective_na = s.known("objective_na", 0.8, 0.024);
    s.scene.microscope.focus_um = s.known("focus_um", 0, 0.68);
  }
  s.scene.view.width = s.scene.view.height = kSize;
  s.scene.view.pixel_size_um = s.known("pixel_size_um", 0.2, 0.001);
  s.scene.view.center_x_px = s.fit("center_x", 31.7, 32, 26, 37);
  s.scene.view.center_y_px = s.fit("center_y", 31.2, 32, 26, 37);
  s.scene.view.rotation_deg = s.b.fixed("rotation", 0);
  s.gain = s.b.linear("gain", kGain);
  s.offset = s.b.linear("offset", kOffset);
  return s;
}

struct Count {
  int answers = 0, intervals = 0, inside = 0;
};

/// Fits of pictures made with `changed` numbers, as they are stated.
FitResult fit_changed(const Stated& of, const std::function<void(Stated&, std::mt19937_64&)>& change, unsigned seed,
                      double noise = kNoise) {
  std::mt19937_64 random(seed);
  Stated nature = of;
  change(nature, random);
  const Theta theta = nature.b.table.values();
  Image counts = render(nature.scene, plan(nature.scene, nature.demand, theta), theta, {}, 1).intensity;
  std::normal_distribution<double> normal;
  for (double& v : counts.values()) v = kOffset + kGain * v + noise * normal(random);
  Stated believed = of;
  for (const Stated::Fitted& f : believed.fitted) believed.b.table[f.ref].value = f.start;
  FitJob job;
  job.demand = of.demand;
  job.measurements.push_back(micrograph_of("droplet", of.scene, counts.values(), of.gain, of.offset, {noise, 0}));
  job.options.threads = 1;
  job.parameters = believed.b.table;
  return birefit::fit(job);
}

void add(const Stated& of, const FitResult& result, Count& count) {
  if (!result.has_answer()) return;
  ++count.answers;
  for (const Stated::Fitted& f : of.fitted) {
    const ParameterEstimate* e = find_estimate(result, of.b.table[f.ref].name);
    ++count.intervals;
    count.inside += e->interval95_low <= f.truth && f.truth <= e->interval95_high;
  }
}

void draw(Stated& s, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  for (const ParameterRef ref : s.stated) {
    Parameter& p = s.b.table[ref];
    p.value += p.known_to.of(p.value) * normal(random);
  }
}

void expect_drawn_numbers_leave_intervals_that_hold(unsigned pictures) {
  for (const Ceiling ceiling : {Ceiling::one_way, Ceiling::wave}) {
    const Stated of = droplet(ceiling);
    Count count;
    for (unsigned seed = 1; seed <= pictures; ++seed) add(of, fit_changed(of, draw, seed), count);
    std::printf("  %s: %d answers of %u pictures, %d of %d intervals hold\n",
                ceiling == Ceiling::wave ? "waves" : "rays", count.answers, pictures, count.inside, count.intervals);
    // Nineteen in twenty, and three sd of that many pictures, whose intervals miss together.
    EXPECT_GE(count.inside, count.intervals * (0.95 - 3 * std::sqrt(0.05 * 0.95 / count.answers)));
    // One in twenty may be refused, and three sd of that many.
    EXPECT_GE(count.answers, pictures * 0.95 - 3 * std::sqrt(0.05 * 0.95 * pictures));
  }
}
TEST(StatedNumbers, DrawnFromTheirUncertaintyLeaveIntervalsThatHold) {
  expect_drawn_numbers_leave_intervals_that_hold(7);
}
TEST(LongStatedNumbers, DrawnFromTheirUncertaintyLeaveIntervalsThatHold) {
  expect_drawn_numbers_leave_intervals_that_hold(60);
}

// Each would move the diameter by ten standard errors and more were it taken as exact.
TEST(StatedNumbers, AreFoundWhereThePictureTellsThem) {
  const Stated of = droplet(Ceiling::wave);
  for (const auto& [name, by] : {std::pair("focus_um", 0.5), {"focus_um", -1.2}, {"objective_na", -0.02}}) {
    const FitResult r = fit_changed(
        of, [&](Stated& s, std::mt19937_64&) { s.b.table[s.b.table.find(name)].value += by; }, 3);
    ASSERT_TRUE(r.has_answer()) << name << " " << by << ": " << r.verdict;
    Count count;
    add(of, r, count);
    EXPECT_EQ(count.inside, count.intervals) << name << " " << by;
    const auto found =
        std::find_if(r.stated.begin(), r.stated.end(), [name = name](const StatedNumber& n) { return n.name == name; });
    ASSERT_TRUE(found != r.stated.end() && found->fitted) << name;
    EXPECT_NEAR(found->value, found->stated + by, 4 * found->stderr_) << name;
    // Far more is told of it than was known.
    EXPECT_LT(found->stderr_, 0.3 * found->known_to);
    EXPECT_EQ(r.misfit.empty(), std::abs(found->away()) <= kContradicted);
  }
}

// An analyser ten degrees from where it is stated: ten standard deviations. In noise that leaves it unknown by about
// one of them a normal prior would hold it half way; Student's lets it go.
TEST(StatedNumbers, ThatAreContradictedAreNamedAndLetGo) {
  const Stated of = droplet(Ceiling::one_way);
  double in_noise = 0;  // standard error over noise
  for (const double noise : {kNoise, 5 * kNoise}) {
    const FitResult r = fit_changed(
        of, [](Stated& s, std::mt19937_64&) { s.b.table[s.b.table.find("analyzer_deg")].value += 10; }, 5, noise);
    ASSERT_TRUE(r.has_answer()) << r.verdict;
    EXPECT_EQ(r.grade(), "answer with misfit");
    EXPECT_NE(r.verdict.find("analyzer_deg is fitted as"), std::string::npos) << r.verdict;
    const auto found =
        std::find_if(r.stated.begin(), r.stated.end(), [](const StatedNumber& n) { return n.name == "analyzer_deg"; });
    ASSERT_NE(found, r.stated.end());
    // The picture's noise alone is in the error: the prior has let go, and nothing that it holds is left over.
    if (in_noise == 0) in_noise = found->stderr_ / noise;
    EXPECT_NEAR(found->stderr_ / noise / in_noise, 1, 0.2);
    EXPECT_NEAR(found->value, 110, 3 * found->stderr_);
    Count count;
    add(of, r, count);
    EXPECT_EQ(count.inside, count.intervals);
  }
}

// Light through a cell knows the product of its thickness and its birefringence alone.
TEST(StatedNumbers, ThatLeaveNoTraceAreInTheErrors) {
  Stated of;
  Cell cell;
  cell.thickness_um = of.known("thickness_um", 2, 0.01);
  cell.director = UniformDirector{.azimuth_deg = of.b.fixed("azimuth", 45)};
  of.scene.sample = cell;
  of.scene.material = ConstantIndices{of.b.fixed("ordinary", 1.52), of.fit("birefringence", 0.06, 0.065, 0.05, 0.07)};
  of.scene.microscope.wavelength_nm = of.b.fixed("wavelength_nm", 590);
  of.scene.microscope.polarizer_deg = of.b.fixed("polarizer_deg", 0);
  of.scene.microscope.analyzer_deg = of.b.fixed("analyzer_deg", 90);
  of.scene.view.width = of.scene.view.height = kSize;
  of.scene.view.rotation_deg = of.b.fixed("rotation", 0);
  of.gain = of.b.fixed("gain", kGain);
  of.offset = of.b.fixed("offset", kOffset);
  const FitResult r = fit_changed(
      of, [](Stated&, std::mt19937_64&) {}, 7);
  of.b.table[of.stated[0]].known_to = {};
  const FitResult exact = fit_changed(
      of, [](Stated&, std::mt19937_64&) {}, 7);
  ASSERT_TRUE(r.has_answer() && exact.has_answer()) << r.verdict;
  const ParameterEstimate *with = find_estimate(r, "birefringence"), *without = find_estimate(exact, "birefringence");
  // To first order in half a per cent.
  EXPECT_NEAR(with->stderr_ / std::hypot(without->stderr_, 0.005 * with->value), 1, 0.01);
  EXPECT_NEAR(with->value, without->value, 1e-6 * with->value);
  ASSERT_EQ(r.stated.size(), 1u);
  EXPECT_FALSE(r.stated[0].fitted);
  EXPECT_NEAR(r.stated_covariance(0, 0), std::pow(0.005 * with->value, 2), 0.02 * std::pow(0.005 * with->value, 2));
  // Of an exact one nothing is in the errors.
  EXPECT_TRUE(exact.stated.empty());
}

}  // namespace
}  // namespace birefit
