// The right fringe order from bounds several orders wide: random problems of every family, truths anywhere in the
// bounds, starts anywhere else, 0.3 to 5 % of noise. What must not be is a confident wrong number.

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "birefit/fit.h"
#include "birefit/render.h"
#include "core/threads.h"
#include "pictures.h"
#include "random_families.h"

namespace birefit {
namespace {
using namespace testing;

struct Count {
  int problems = 0, right = 0, limits = 0;
  int undecided = 0;      ///< ambiguous, the truth among the minima named or on a curve that leads to one
  int without_right = 0;  ///< ambiguous, and it is not
  int refused = 0;        ///< no answer for other reasons
  /// Of these three: the pictures do tell the parameters, and the truth's chi-square lies kClear and more below that of
  /// every other minimum named.
  int timid = 0;
  int wrong = 0;  ///< an answer with a searched parameter more than five standard errors off
  double seconds = 0;
  int inside = 0, intervals = 0;        ///< 95 % intervals of answers that hold the truth, limits left out
  std::map<std::string, int> warnings;  ///< in how many right answers, names and numbers left out
};
constexpr double kClear = 20;

/// Chi-square of the pixels' noise alone, whatever weights a fit gave its frames.
double chi_square_at(const Posed& posed, const Theta& theta) {
  double sum = 0;
  for (std::size_t g = 0; g < posed.job.measurements.size(); ++g) {
    const Picture& m = picture(posed.job, g);
    const Image shown = render(m.scene, plan(m.scene, posed.job.demand, theta), theta, {}, 1).intensity;
    const auto of = [&](ParameterRef ref) { return theta[static_cast<std::size_t>(ref.index)]; };
    for (std::size_t i = 0; i < shown.values().size(); ++i)
      if (m.mask.values()[i])
        sum += std::pow((m.values.values()[i] - of(m.gain) * shown.values()[i] - of(m.offset)) / posed.noise, 2);
  }
  return sum;
}

/// What the fit calls a standard error on the side where `off` is positive or negative: of a profiled interval, which
/// says that the likelihood is no parabola, as much of it as is one of a normal distribution.
double standard_error(const ParameterEstimate& e, double off) {
  if (!e.profiled) return e.stderr_;
  return (off > 0 ? e.interval95_high - e.value : e.value - e.interval95_low) / 1.96;
}

/// The largest error in standard errors of `of`, of parameters without a limit; infinite where there is none.
double errors_off(const RandomProblem& p, const FitResult& of, const Theta& theta, const Theta& truth) {
  double worst = 0;
  for (const ParameterEstimate& e : of.parameters) {
    if (e.linear || !e.limit.empty()) continue;
    const int k = p.b.table.find(e.name).index;
    const double off = difference(p, k, truth[static_cast<std::size_t>(k)], theta[static_cast<std::size_t>(k)]);
    const double stderr_ = standard_error(e, off);
    worst = std::max(worst, std::isfinite(stderr_) ? std::abs(off) / stderr_ : std::numeric_limits<double>::infinity());
  }
  return worst;
}
constexpr double kFar = 5;

bool is_true(const RandomProblem& p, const FitResult& of, const Theta& theta, const std::vector<Theta>& truths) {
  return std::any_of(truths.begin(), truths.end(), [&](const Theta& t) { return errors_off(p, of, theta, t) <= kFar; });
}

/// Errors mean nothing where a minimum is no parabola: two fits that end in the same place are in the same minimum.
bool same_place(const RandomProblem& p, const FitResult& of, const Theta& a, const Theta& b) {
  constexpr double kShare = 0.01;  // of the bounds
  return std::all_of(of.parameters.begin(), of.parameters.end(), [&](const ParameterEstimate& e) {
    const auto k = static_cast<std::size_t>(p.b.table.find(e.name).index);
    return e.linear || std::abs(difference(p, static_cast<int>(k), a[k], b[k])) <= kShare * (e.upper - e.lower);
  });
}

/// Whether two places lie on one curve that the pictures cannot tell the points of: from the one to the other, held at
/// steps of what differs most while the rest follows, chi-square stays within reach of the higher end. A minimum named
/// on such a curve names all of it.
bool in_one_valley(const RandomProblem& p, const Posed& posed, const FitResult& of, const Theta& from,
                   const Theta& named) {
  constexpr int kSteps = 12;
  constexpr double kReach = 9.2;   // chi-square of two parameters at 99 %
  constexpr double kShare = 0.15;  // of the bounds, that the others may follow by in a step
  FitJob job = posed.job;
  job.options.values_only = true;
  int along = -1;
  double most = 0;
  for (const ParameterEstimate& e : of.parameters) {
    if (e.linear) continue;
    const int k = p.b.table.find(e.name).index;
    const auto at = static_cast<std::size_t>(k);
    const double far = std::abs(difference(p, k, named[at], from[at])) / (e.upper - e.lower);
    if (far > most) most = far, along = k;
  }
  if (along < 0) return true;
  const auto at = static_cast<std::size_t>(along);
  const double whole = difference(p, along, named[at], from[at]);
  const double highest = std::max(chi_square_at(posed, from), chi_square_at(posed, named));
  job.parameters[along].free = false;
  Theta theta = from;
  for (int step = 1; step <= kSteps; ++step) {
    for (const ParameterEstimate& e : of.parameters) {
      const int k = p.b.table.find(e.name).index;
      if (e.linear || k == along) continue;
      Parameter& other = job.parameters[k];
      const double here = theta[static_cast<std::size_t>(k)], reach = kShare * (e.upper - e.lower);
      other.value = here;
      other.lower = std::max(e.lower, here - reach);
      other.upper = std::min(e.upper, here + reach);
    }
    job.parameters[along].value = from[at] + whole * step / kSteps;
    theta = fit(job).theta;
    if (chi_square_at(posed, theta) > highest + kReach) return false;
  }
  return same_place(p, of, theta, named);
}

struct Outcome {
  FitResult found, from_truth;
  double chi_square = 0, truth_chi_square = 0;  ///< at what was found, and where a fit from the truth ends
  bool wrong = false, limit = false, named = false, timid = false;
  double off = 0;
  bool right() const { return found.has_answer() && !wrong; }
};

/// The same pictures with bounds about the truth, and the start there: this fit cannot end anywhere else.
FitJob near_truth(const Posed& posed) {
  FitJob job = posed.job;
  constexpr double kShare = 0.08;
  for (int k = 0; k < job.parameters.size(); ++k) {
    Parameter& of = job.parameters[k];
    if (!of.free || of.linear) continue;
    const double truth = posed.truth[static_cast<std::size_t>(k)], reach = kShare * (of.upper - of.lower);
    of.value = truth;
    of.lower = std::max(of.lower, truth - reach);
    of.upper = std::min(of.upper, truth + reach);
  }
  return job;
}

Outcome solve_one(const RandomProblem& p, const Posed& posed) {
  Outcome o;
  o.found = fit(posed.job);
  const std::vector<Theta> truths = equivalents(p, posed.truth);
  o.off = std::numeric_limits<double>::infinity();
  for (const Theta& truth : truths) o.off = std::min(o.off, errors_off(p, o.found, o.found.theta, truth));
  o.wrong = !(o.off <= kFar);
  o.limit = std::any_of(o.found.parameters.begin(), o.found.parameters.end(),
                        [](const ParameterEstimate& e) { return !e.limit.empty(); });
  if (o.right()) return o;
  o.from_truth = fit(near_truth(posed));
  o.chi_square = chi_square_at(posed, o.found.theta);
  o.truth_chi_square = chi_square_at(posed, o.from_truth.theta);
  // A rival in the truth's other numbers is as good as the truth, and no mistake; in the very truth's it is the truth.
  double others = std::numeric_limits<double>::infinity();
  const auto named = [&](const Theta& theta) {
    const bool true_one =
        is_true(p, o.from_truth, theta, {posed.truth}) || same_place(p, o.found, theta, o.from_truth.theta);
    o.named = o.named || true_one || is_true(p, o.from_truth, theta, truths);
    if (!true_one) others = std::min(others, chi_square_at(posed, theta));
  };
  o.named = !o.wrong;
  named(o.found.theta);
  for (const RivalMinimum& rival : o.found.rivals) named(rival.theta);
  const auto leads_to = [&](const Theta& theta) { return in_one_valley(p, posed, o.found, o.from_truth.theta, theta); };
  if (!o.named && o.found.ambiguous)
    o.named = leads_to(o.found.theta) || std::any_of(o.found.rivals.begin(), o.found.rivals.end(),
                                                     [&](const RivalMinimum& rival) { return leads_to(rival.theta); });
  o.timid = !o.found.has_answer() && o.from_truth.identifiable && o.truth_chi_square < others - kClear;
  return o;
}

void describe(const RandomProblem& p, const Posed& posed, const Outcome& o, const std::string& name, int number) {
  const FitResult& r = o.found;
  const char* how = r.ambiguous       ? o.named ? "undecided" : "AMBIGUOUS WITHOUT THE RIGHT ONE"
                    : !r.has_answer() ? "no answer"
                                      : "WRONG";
  std::printf(
      "  %s %d, noise %.4f, lamp %.4f, %s%s: %.1f standard errors off, chi-square %.1f, from the truth %.1f, of %d;",
      name.c_str(), number, posed.noise / kProblemGain, p.lamp_jitter, how, o.timid ? " (timid)" : "", o.off,
      o.chi_square, o.truth_chi_square, r.degrees_of_freedom);
  for (const ParameterEstimate& e : r.parameters) {
    if (e.linear) continue;
    const ParameterEstimate* true_one = find_estimate(o.from_truth, e.name);
    if (e.profiled) std::printf(" [%.6g, %.6g]", e.interval95_low, e.interval95_high);
    std::printf(" %s %.6g +- %.2g (truth %.6g, from there %.6g +- %.2g)", e.name.c_str(), e.value, e.stderr_,
                posed.truth[static_cast<std::size_t>(p.b.table.find(e.name).index)], true_one->value,
                true_one->stderr_);
  }
  for (const RivalMinimum& rival : r.rivals) {
    std::printf(" rival %.2g (chi-square %.1f) at", rival.odds, chi_square_at(posed, rival.theta));
    for (const ParameterEstimate& e : r.parameters)
      if (!e.linear) std::printf(" %.6g", rival.theta[static_cast<std::size_t>(p.b.table.find(e.name).index)]);
  }
  std::printf(" %s\n", r.has_answer() || r.ambiguous ? r.covariance_kind.c_str() : r.verdict.c_str());
}

/// A warning without what differs from picture to picture.
std::string kind_of(const std::string& warning) {
  std::string kind;
  const std::size_t name = warning.find(": ");
  for (const char c : warning.substr(name == std::string::npos ? 0 : name + 2))
    if (!std::isdigit(static_cast<unsigned char>(c)) && std::string("+-.e").find(c) == std::string::npos) kind += c;
  return kind;
}

void count_intervals(const RandomProblem& p, const FitResult& of, const std::vector<Theta>& truths, Count& count) {
  const Theta& truth = *std::min_element(truths.begin(), truths.end(), [&](const Theta& a, const Theta& b) {
    return errors_off(p, of, of.theta, a) < errors_off(p, of, of.theta, b);
  });
  for (const ParameterEstimate& e : of.parameters) {
    if (e.linear || !e.limit.empty()) continue;
    const int k = p.b.table.find(e.name).index;
    const double true_one = e.value + difference(p, k, truth[static_cast<std::size_t>(k)], e.value);
    ++count.intervals;
    count.inside += true_one >= e.interval95_low && true_one <= e.interval95_high;
  }
}

Count solve(const Family& family, int problems, int first = 1, Ceiling ceiling = Ceiling::one_way) {
  Count count;
  std::mutex mutex;
  parallel_for(problems, 0, [&](int i) {
    RandomProblem p = draw(family, first + i);
    const Posed posed = pose(p, family.name, ceiling);
    const Outcome o = solve_one(p, posed);
    const std::scoped_lock lock(mutex);
    ++count.problems;
    count.seconds += o.found.seconds;
    count.timid += o.timid;
    if (o.found.ambiguous) {
      ++(o.named ? count.undecided : count.without_right);
    } else if (!o.found.has_answer()) {
      ++count.refused;
    } else if (o.wrong) {
      ++count.wrong;
    } else {
      ++(o.limit ? count.limits : count.right);
      std::set<std::string> kinds;
      for (const std::string& warning : o.found.warnings) kinds.insert(kind_of(warning));
      for (const std::string& kind : kinds) ++count.warnings[kind];
    }
    if (o.found.has_answer()) count_intervals(p, o.found, equivalents(p, posed.truth), count);
    if (!o.right()) describe(p, posed, o, family.name, first + i);
    std::fflush(stdout);
  });
  std::printf(
      "  %s: %d problems, %d right, %d limits, %d undecided, %d ambiguous without the right one, %d without an answer, "
      "%d WRONG; "
      "%d timid; %.1f %% of %d intervals hold the truth; %.2f s each\n",
      family.name.c_str(), count.problems, count.right, count.limits, count.undecided, count.without_right,
      count.refused, count.wrong, count.timid, 100.0 * count.inside / std::max(1, count.intervals), count.intervals,
      count.seconds / std::max(1, count.problems));
  for (const auto& [words, number] : count.warnings)
    if (10 * number > count.right) std::printf("    warned %d times: %.200s\n", number, words.c_str());
  return count;
}

/// What the rules for all families ask of counts.
void expect_sound(const Family& family, const Count& count) {
  EXPECT_EQ(count.wrong, 0);
  EXPECT_LE(count.timid, count.problems / 10);
  constexpr int kEnough = 100;  // of right answers, to say how often something stands in them
  for (const auto& [words, number] : count.warnings)
    if (count.right >= kEnough && 20 * number > count.right)
      ADD_FAILURE() << family.name << ": " << number << " times " << words;
}

class GlobalSearch : public ::testing::TestWithParam<Family> {};

TEST_P(GlobalSearch, FindsTheOrder) {
  if (GetParam().quick == 0) GTEST_SKIP() << "one takes seconds: only in the long tests";
  expect_sound(GetParam(), solve(GetParam(), GetParam().quick));
}

// Between two rings of this droplet the retardance has its maximum: planned by what changes from one end of a pixel to
// the other, one point served as the mean of pixels there, 0.04 wrong, and the fit left the truth by 11 standard errors
// when it was planned anew.
TEST(PixelMeansInAFit, APictureWhoseRetardanceTurnsBackWithinAPixel) {
  const Count count = solve(family("DropletInAField"), 1, 1617);
  EXPECT_EQ(count.right, 1);
}

// The modulus of these helices may be anything from nothing to its limit, and the pitch goes with it: at nothing, where
// light answers to the modulus' square, no derivative says so, and the pitch was 7 to 54 errors off.
TEST(LimitsInAFit, OthersPayForWhatIsOnlyKnownToBeBelowALimit) {
  for (const int number : {157, 355, 608, 684, 719}) {
    const Count count = solve(family("HelixCell"), 1, number);
    EXPECT_EQ(count.limits, 1) << number;
  }
}

// The tilt may have been a limit, which is looked for along its profile; where that had left the problem, the
// rotation's own interval was no longer asked for, and its likelihood is flat on one side: the truth lay 5.1 standard
// errors off.
TEST(ProfilesInAFit, AreThoseOfTheFitWhateverProfileCameBefore) {
  const Count count = solve(family("UniformCell"), 1, 434);
  EXPECT_EQ(count.right, 1);
}

// A lamp's jitter, three times the noise of bright frames and not shown by the sum of squares of all of them: the pitch
// was 6.6 errors off.
TEST(LampsInAFit, AJitterThatFewFramesShowIsInTheErrors) {
  const Count count = solve(family("HelixCell"), 1, 2012);
  EXPECT_EQ(count.right, 1);
}

// Valleys that run across the axes of the grid have no point below its neighbours along every axis where they are
// lowest: the truth, 592 units of chi-square below the best place found (355), or as good as what was found (90, 485),
// was not among the minima named.
TEST(ScanInAFit, FindsValleysAcrossTheGrid) {
  EXPECT_EQ(solve(family("TwistedCell"), 1, 355).right, 1);
  for (const int problem : {90, 485}) EXPECT_EQ(solve(family("TwistedCell"), 1, problem).undecided, 1) << problem;
}

// What counts a truth as named must be able to say no: between two minima that are as good as each other lies a ridge.
TEST(OneValley, IsNotWhereTwoMinimaLieApart) {
  for (const int problem : {90, 485}) {
    RandomProblem p = draw(family("TwistedCell"), problem);
    const Posed posed = pose(p, "TwistedCell", Ceiling::one_way);
    const FitResult found = fit(posed.job);
    ASSERT_FALSE(found.rivals.empty()) << problem;
    EXPECT_FALSE(in_one_valley(p, posed, found, found.theta, found.rivals.front().theta)) << problem;
  }
}

// Two valleys as good as each other: by plans a third of the noise of a frame's mean off, one of them was no minimum.
TEST(ScanInAFit, IsMadeByPlansFinerThanTheMeanOfAFrame) {
  const Count count = solve(family("TwistedCell"), 1, 476);
  EXPECT_EQ(count.undecided, 1);
}

// Two azimuths describe this helix as well as each other. Eight starts of twelve led into the one, none of the others
// went on, and on the eight pixels of the search the two were within five errors of each other: the answer was ten
// standard errors off.
TEST(ScanInAFit, LeavesRoomForValleysThatFewStartsLeadInto) {
  EXPECT_EQ(solve(family("HelixCell"), 1, 879).undecided, 1);
}

// The start is below the threshold, where one step describes the field; by plans for it no place near the truth, at
// three times the threshold, described anything: the answer, with misfit, was thousands of standard errors off.
TEST(ScanInAFit, IsMadeOnceMoreByPlansForWhereTheFieldIsStrong) {
  EXPECT_EQ(solve(family("FieldCell"), 1, 42).right, 1);
}

// The region lies within the disc, and its own middle is 2 pixels from the disc's, as far as fringes near the loads are
// apart: no place described the picture, and the fit gave no answer to what it can tell to a thousandth.
TEST(ScanInAFit, TakesTheCentreFromARegionWithinTheSample) { EXPECT_EQ(solve(family("Disc"), 1, 258).right, 1); }

// Two twists that are as good as each other, less than a step of the grid apart.
TEST(ScanInAFit, KeepsMinimaThatLieWithinAStep) {
  for (const int problem : {45, 538}) EXPECT_EQ(solve(family("TwistedCell"), 1, problem).undecided, 1) << problem;
}

// Where every pixel is rays of its own, places are looked at in a quarter of the pixels that the minima are told by.
// The solver does not get here from the start: of places in the wrong order it gave no answer, or one 760 errors off.
TEST(ScanInAFit, FindsAtAGlanceWhatPixelsOfTheirOwnRaysTell) {
  for (const int problem : {6, 7}) EXPECT_EQ(solve(family("BipolarDroplet"), 1, problem).right, 1) << problem;
}

// Of small droplets pictures know diameter times birefringence a hundred times better than either: the solver goes
// along a bent valley, and ends where a step gains next to nothing of chi-square. All that may be left of the way, a
// hundred such steps, is a thirtieth of a standard error.
TEST(SolverInAFit, EndsWhereAFitFromThereEnds) {
  const Family small{
      "Small", [](RandomProblem& p) {
        Scene s = seen(p, 40, 0.08);
        s.view.center_x_px = p.anywhere("center_x", 18, 22);
        s.view.center_y_px = p.anywhere("center_y", 18, 22);
        Droplet sample;
        sample.diameter_um = p.anywhere("diameter_um", 1.2, 2.6);
        s.sample = sample;
        s.material = ConstantIndices{p.b.fixed("ordinary", 1.52), p.anywhere("birefringence", 0.03, 0.2)};
        s.surround_index = p.b.fixed("surround", 1.5);
        p.least_noise = 0.02;
        p.scenes.push_back(s);
      }};
  int compared = 0;
  for (int number = 1; number <= 8; ++number) {
    RandomProblem p = draw(small, number);
    Posed posed = pose(p, small.name);
    const FitResult first = fit(posed.job);
    for (int k = 0; k < posed.job.parameters.size(); ++k)
      posed.job.parameters[k].value = first.theta[static_cast<std::size_t>(k)];
    const FitResult again = fit(posed.job);
    for (const ParameterEstimate& e : first.parameters) {
      if (e.linear || e.at_bound || !std::isfinite(e.stderr_)) continue;
      EXPECT_NEAR(find_estimate(again, e.name)->value, e.value, 0.03 * e.stderr_) << number << " " << e.name;
      ++compared;
    }
  }
  EXPECT_GT(compared, 20);
}

class LongGlobalSearch : public GlobalSearch {};
TEST_P(LongGlobalSearch, IsNeverConfidentlyWrong) {
  const Count count = solve(GetParam(), problems_or(GetParam().many), first_problem());
  expect_sound(GetParam(), count);
  // Straight rays through a droplet are held to their interval: of two thousand intervals 95 % scatter by half a
  // percent.
  if (GetParam().name != std::string("Droplet") || count.intervals < 2000) return;
  EXPECT_GE(count.inside, 0.93 * count.intervals);
  EXPECT_LE(count.inside, 0.97 * count.intervals);
}

// The same on pictures by wave optics, for the families that are finite: 100 of each. Ripples of large droplets may be
// as likely as each other.
class LongWaveSearch : public GlobalSearch {};
TEST_P(LongWaveSearch, IsNeverConfidentlyWrong) {
  const Count count = solve(GetParam(), problems_or(100), first_problem(), Ceiling::wave);
  EXPECT_EQ(count.wrong, 0);
  EXPECT_LE(count.without_right, count.problems / 100);
  EXPECT_LE(count.undecided, count.problems / 20);
}

// The lowest chi-square of this shell lies in a resonance 0.6 nm wide that follows the noise, 17 of its standard errors
// from the truth: the valley around it is the likelier answer.
TEST(WaveSearch, AResonanceThatFollowsTheNoiseIsNotTheAnswer) {
  const Count count = solve(family("Shell"), 1, 69, Ceiling::wave);
  EXPECT_EQ(count.right, 1);
}

// A problem's own symmetries and periods leave its pictures as they are.
class RandomProblems : public GlobalSearch {};
TEST_P(RandomProblems, SymmetriesShowTheSamePictures) {
  for (int number = 1; number <= 3; ++number) {
    RandomProblem p = draw(GetParam(), number);
    const Posed posed = pose(p, GetParam().name);
    std::vector<Theta> others = equivalents(p, posed.truth);
    for (const auto& [parameter, period] : p.period) {
      others.push_back(posed.truth);
      others.back()[static_cast<std::size_t>(parameter)] += period;
    }
    Demand demand = p.demand;
    demand.intensity_accuracy = 1e-5;
    for (const Scene& scene : p.scenes) {
      const auto shown = [&](const Theta& theta) {
        return render(scene, plan(scene, demand, theta), theta, {}, 1).intensity.values();
      };
      const std::vector<double> expected = shown(posed.truth);
      for (const Theta& other : others) {
        const std::vector<double> values = shown(other);
        for (std::size_t i = 0; i < values.size(); ++i) ASSERT_NEAR(values[i], expected[i], 1e-4) << number << " " << i;
      }
    }
  }
}

// What an independent model shows is what the program shows, to a tenth of the least noise.
TEST_P(RandomProblems, PicturesAreTheProgramsToo) {
  for (int number = 1; number <= 10; ++number) {
    RandomProblem p = draw(GetParam(), number);
    const Theta truth = p.b.table.values();
    for (std::size_t g = 0; g < p.light.size(); ++g) {
      const Scene& scene = p.scenes[g];
      Demand demand = p.demand;
      demand.intensity_accuracy = 1e-5;
      const std::vector<double> values = render(scene, plan(scene, demand, truth), truth, {}, 1).intensity.values();
      for (std::size_t i = 0; i < values.size(); ++i) {
        if (!p.masks.empty() && !p.masks[g].values()[i]) continue;
        ASSERT_NEAR(values[i], p.light[g][i], 3e-4) << number << " " << g;
      }
    }
  }
}

std::string family_name(const ::testing::TestParamInfo<Family>& info) { return info.param.name; }
const auto kFinite = ::testing::Values(family("Droplet"), family("DropletInAField"), family("Shell"));
INSTANTIATE_TEST_SUITE_P(Families, RandomProblems, ::testing::ValuesIn(families()), family_name);
INSTANTIATE_TEST_SUITE_P(Families, GlobalSearch, ::testing::ValuesIn(families()), family_name);
INSTANTIATE_TEST_SUITE_P(Finite, LongWaveSearch, kFinite, family_name);
INSTANTIATE_TEST_SUITE_P(Families, LongGlobalSearch, ::testing::ValuesIn(families()), family_name);

}  // namespace
}  // namespace birefit
