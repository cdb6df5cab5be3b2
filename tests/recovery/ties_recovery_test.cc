// Fits in which numbers follow from others: what they find, and the errors of what follows. Truth: the closed matrix of
// a uniform twist, in code of its own.

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <string>

#include "birefit/expression.h"
#include "birefit/fit.h"
#include "independent_cell.h"
#include "scene_builder.h"

namespace birefit {
namespace {
using namespace testing;

constexpr int kSide = 8, kPictures = 10;
constexpr double kGain = 1000, kOffset = 50, kNoise = 5;

/// Pictures between polarizers at several angles of two cells, the second `ratio` times as thick as the first.
struct TwoCells {
  TableBuilder b;
  ParameterRef first, second, birefringence, twist;
  double ratio = 1.5;
  double turn_polarizer_deg = 37, turn_analyzer_deg = 61;  ///< from picture to picture

  double polarizer_of(int k) const { return std::fmod(turn_polarizer_deg * k, 180); }
  double analyzer_of(int k) const { return std::fmod(turn_analyzer_deg * k, 180); }

  FitJob job(unsigned seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    IndependentCell cell;
    FitJob job;
    const ParameterRef gain = b.linear("gain", 900), offset = b.linear("offset", 0);
    for (int k = 0; k < kPictures; ++k) {
      const bool thick = k % 2 == 1;
      Scene scene;
      Cell here;
      here.thickness_um = thick ? second : first;
      here.director = TwistedDirector{.twist_deg = twist, .azimuth_deg = b.fixed("azimuth", cell.azimuth_deg)};
      scene.sample = here;
      scene.material = ConstantIndices{b.fixed("ordinary", 1.5), birefringence};
      scene.surround_index = b.fixed("surround", 1.5);
      scene.microscope.wavelength_nm = b.fixed("wavelength_nm", 1000 * cell.wavelength_um);
      const double polarizer = polarizer_of(k), analyzer = analyzer_of(k);
      scene.microscope.polarizer_deg = b.fixed("polarizer", polarizer);
      scene.microscope.analyzer_deg = b.fixed("analyzer", analyzer);
      scene.view.width = scene.view.height = kSide;
      scene.view.rotation_deg = b.fixed("rotation", 0);
      IndependentCell seen = cell;
      seen.thickness_um *= thick ? ratio : 1;
      std::vector<double> values(kSide * kSide);
      for (double& v : values) v = kOffset + kGain * seen.intensity(polarizer, analyzer) + kNoise * normal(random);
      job.measurements.push_back(micrograph_of("p" + std::to_string(k), scene, values, gain, offset, {kNoise, 0}));
    }
    job.parameters = b.table;
    job.demand.ceiling = Ceiling::e_only;
    job.options.threads = 1;
    return job;
  }
};

std::shared_ptr<Expression> law_of(const std::string& text, const std::vector<std::string>& units,
                                   const std::optional<std::string>& unit) {
  auto law = std::make_shared<Expression>(text);
  law->settle_units(units, unit);
  return law;
}

/// Thickness fitted, birefringence stated; the second thickness is a multiple of the first, in one way or another.
TwoCells with_thickness() {
  TwoCells cells;
  cells.first = cells.b.fitted("thickness", 4.9, 4.5, 5.5);
  cells.birefringence = cells.b.fixed("birefringence", 0.13);
  cells.twist = cells.b.fitted("twist", 85, 60, 120);
  return cells;
}
FitResult with_tied_thickness(unsigned seed, double above = 1e300) {
  TwoCells cells = with_thickness();
  cells.second = cells.b.fixed("second", 7);
  cells.b.table[cells.second].upper = above;
  cells.b.table.tie(cells.second.index, {law_of("1.5 * a.thickness", {"um"}, "um"), {cells.first.index}});
  return fit(cells.job(seed));
}
FitResult with_shared_thickness(unsigned seed) {
  TwoCells cells = with_thickness();
  cells.second = cells.first.seen(1.5, 0);
  return fit(cells.job(seed));
}

const DerivedEstimate& derived(const FitResult& result, const std::string& name) {
  for (const DerivedEstimate& d : result.derived)
    if (d.name == name) return d;
  throw std::out_of_range(name);
}

TEST(TiedNumbers, FitAsOneSharedNumberDoes) {
  const FitResult tied = with_tied_thickness(1), shared = with_shared_thickness(1);
  ASSERT_TRUE(tied.has_answer()) << tied.verdict;
  ASSERT_TRUE(shared.has_answer()) << shared.verdict;
  for (const char* name : {"thickness", "twist"}) {
    const ParameterEstimate &a = *find_estimate(tied, name), &b = *find_estimate(shared, name);
    // The same function by another way: what remains is where the solver stops, far within a standard error.
    EXPECT_NEAR(a.value, b.value, 1e-4 * b.stderr_) << name;
    EXPECT_NEAR(a.stderr_, b.stderr_, 1e-4 * b.stderr_) << name;
    EXPECT_NEAR(a.interval95_high, b.interval95_high, 1e-3 * b.stderr_) << name;
  }
  EXPECT_NEAR(tied.chi_square, shared.chi_square, 1e-6 * shared.chi_square);
  const DerivedEstimate& second = derived(tied, "second");
  EXPECT_TRUE(second.tied);
  EXPECT_DOUBLE_EQ(second.value, 1.5 * find_estimate(tied, "thickness")->value);
  EXPECT_NEAR(second.stderr_, 1.5 * find_estimate(tied, "thickness")->stderr_, 1e-9);
  EXPECT_TRUE(holds(tied, "thickness", 5));
}

/// A parameter that no scene reads: the thickness of both cells follows from it.
TEST(TiedNumbers, LetAParameterActThroughThemAlone) {
  const auto square_root = [](unsigned seed) {
    TwoCells cells = with_thickness();
    const ParameterRef squared = cells.b.fitted("squared", 24, 20, 30);
    cells.first = cells.b.fixed("first", 5);
    cells.second = cells.b.fixed("second", 7);
    for (const auto& [ref, text] :
         {std::pair(cells.first, "sqrt(a.squared)"), std::pair(cells.second, "1.5 * a.squared ^ 0.5")})
      cells.b.table.tie(ref.index, {std::make_shared<Expression>(text), {squared.index}});
    cells.b.table[cells.b.table.find("thickness")].free = false;
    return fit(cells.job(seed));
  };
  const FitResult tied = square_root(2), shared = with_shared_thickness(2);
  ASSERT_TRUE(tied.has_answer()) << tied.verdict;
  const ParameterEstimate &squared = *find_estimate(tied, "squared"), &thickness = *find_estimate(shared, "thickness");
  EXPECT_NEAR(std::sqrt(squared.value), thickness.value, 1e-3 * thickness.stderr_);
  EXPECT_NEAR(derived(tied, "first").stderr_, thickness.stderr_, 1e-2 * thickness.stderr_);
  EXPECT_NEAR(squared.stderr_, 2 * thickness.value * thickness.stderr_, 1e-2 * squared.stderr_);
}

TEST(TiedNumbers, ThatLeaveWhatTheyMayBeAreNoAnswer) {
  const FitResult held = with_tied_thickness(3, 7.3);  // of 7.5
  EXPECT_TRUE(held.pinned);
  EXPECT_FALSE(held.has_answer());
  const DerivedEstimate& second = derived(held, "second");
  EXPECT_TRUE(second.held);
  EXPECT_EQ(second.value, 7.3);
  EXPECT_TRUE(std::isnan(second.stderr_));
  EXPECT_NE(held.verdict.find("second = 1.5 * a.thickness is 7."), std::string::npos) << held.verdict;
}

/// Errors of what follows: J C J^T by hand, and the scatter of draws from the posterior.
TEST(DerivedNumbers, HaveTheErrorsThatParametersHaveTogether) {
  TwoCells cells = with_thickness();
  cells.second = cells.first.seen(1.5, 0);
  FitJob job = cells.job(4);
  const std::vector<int> of{cells.first.index, cells.twist.index};
  job.derived = {
      {"pitch", "um", {law_of("360 * deg * a.thickness / b.twist", {"um", "deg"}, "um"), of}},
      {"constant", "um", {law_of("2 * a.thickness", {"um"}, "um"), {job.parameters.find("surround").index}}}};
  job.options.samples = 2000;
  const FitResult result = fit(job);
  ASSERT_TRUE(result.has_answer()) << result.verdict;
  const double d = find_estimate(result, "thickness")->value, t = find_estimate(result, "twist")->value;
  const DerivedEstimate& pitch = derived(result, "pitch");
  EXPECT_DOUBLE_EQ(pitch.value, 360 * d / t);
  Eigen::VectorXd slopes = Eigen::VectorXd::Zero(result.covariance.rows());
  for (std::size_t k = 0; k < result.names.size(); ++k) {
    if (result.names[k] == "thickness") slopes[static_cast<Eigen::Index>(k)] = 360 / t;
    if (result.names[k] == "twist") slopes[static_cast<Eigen::Index>(k)] = -360 * d / (t * t);
  }
  const double by_hand = std::sqrt(slopes.dot(result.covariance * slopes));
  EXPECT_NEAR(pitch.stderr_, by_hand, 1e-9 * by_hand);
  EXPECT_TRUE(pitch.by.isApprox(slopes, 1e-12));
  EXPECT_EQ(derived(result, "constant").stderr_, 0);  // of what is exact

  ASSERT_TRUE(result.samples);
  const Eigen::MatrixXd& draws = result.samples->values;
  Eigen::ArrayXd drawn(draws.rows());
  for (Eigen::Index i = 0; i < draws.rows(); ++i) drawn[i] = 360 * draws(i, 0) / draws(i, 1);
  const double sd = std::sqrt((drawn - drawn.mean()).square().mean());
  // Of as many draws as are worth a thousand: 2 % and a little of the tails that Student's t has.
  EXPECT_NEAR(sd, pitch.stderr_, 0.1 * pitch.stderr_);
  EXPECT_NEAR(drawn.mean(), pitch.value, 0.1 * pitch.stderr_);
}

/// What is stated to half a percent and what is fitted in its place: the picture knows their product.
TEST(DerivedNumbers, KnowWhatIsStatedAndFittedTogether) {
  const auto retardance = [](double known_to) {
    TwoCells cells;
    cells.first = cells.b.fixed("thickness", 5);
    cells.b.table[cells.first].known_to.share = known_to;
    cells.second = cells.first.seen(1.5, 0);
    cells.birefringence = cells.b.fitted("birefringence", 0.128, 0.12, 0.14);
    cells.twist = cells.b.fitted("twist", 85, 60, 120);
    FitJob job = cells.job(5);
    job.derived = {
        {"retardance",
         "nm",
         {law_of("a.thickness * b.birefringence", {"um", ""}, "nm"), {cells.first.index, cells.birefringence.index}}}};
    return fit(job);
  };
  const FitResult exact = retardance(0), stated = retardance(0.02);
  ASSERT_TRUE(exact.has_answer()) << exact.verdict;
  ASSERT_TRUE(stated.has_answer()) << stated.verdict;
  const double alone = derived(exact, "retardance").stderr_;
  // The birefringence is no better known than the thickness, of which it makes up 2 % by a fit of some iterations; the
  // retardance is as well known as if that were exact.
  EXPECT_GT(find_estimate(stated, "birefringence")->stderr_, 0.018 * 0.13);
  EXPECT_NEAR(derived(stated, "retardance").stderr_, alone, 0.1 * alone);
  EXPECT_NEAR(derived(stated, "retardance").value, 650, 4 * derived(stated, "retardance").stderr_);
}

/// What is stated to a degree moves the estimates through what is tied to it, and so does what is done in its place.
TEST(TiedNumbers, CarryWhatStatedNumbersAreKnownTo) {
  const auto fitted = [](bool tied) {
    TwoCells cells = with_thickness();
    cells.second = cells.first.seen(1.5, 0);
    cells.turn_polarizer_deg = 0, cells.turn_analyzer_deg = 29;
    FitJob job = cells.job(7);
    Parameter dial;
    dial.name = "polarizer_deg", dial.unit = "deg", dial.known_to.sd = 1;
    const ParameterRef polarizer = job.parameters.add(dial);
    int k = 0;
    for_each_scene(job.measurements, [&](Scene& scene) {
      scene.microscope.polarizer_deg = polarizer;
      const double turned = cells.analyzer_of(k++);
      scene.microscope.analyzer_deg = polarizer.seen(1, turned);
      if (!tied) return;
      const ParameterRef analyzer = job.parameters.add_constant("turned" + std::to_string(k), 0, "deg");
      job.parameters.tie(analyzer.index,
                         {law_of("a.dial + " + std::to_string(turned) + " * deg", {"deg"}, "deg"), {polarizer.index}});
      scene.microscope.analyzer_deg = analyzer;
    });
    return fit(job);
  };
  const FitResult tied = fitted(true), shared = fitted(false);
  ASSERT_EQ(tied.grade(), shared.grade()) << tied.verdict << shared.verdict;
  ASSERT_EQ(tied.stated.size(), 1u);
  EXPECT_EQ(tied.stated[0].name, "polarizer_deg");
  for (const char* name : {"thickness", "twist"}) {
    const ParameterEstimate &a = *find_estimate(tied, name), &b = *find_estimate(shared, name);
    EXPECT_NEAR(a.value, b.value, 1e-3 * b.stderr_) << name;
    EXPECT_NEAR(a.stderr_, b.stderr_, 1e-3 * b.stderr_) << name;
  }
}

/// A dial's zero moves what is tied to the dial.
TEST(TiedNumbers, FollowADialThatIsOffByItsZero) {
  const auto fitted = [](bool tied) {
    TwoCells cells = with_thickness();
    cells.second = cells.first.seen(1.5, 0);
    FitJob job = cells.job(6);
    int k = 0;
    for_each_scene(job.measurements, [&](Scene& scene) {
      const double polarizer = cells.polarizer_of(k);
      Parameter dial;
      dial.name = "micrographs[" + std::to_string(k) + "].microscope.polarizer_deg";
      dial.unit = "deg", dial.value = polarizer, dial.known_to.sd = 1;
      scene.microscope.polarizer_deg = job.parameters.add(dial);
      if (tied) {
        const ParameterRef turned = job.parameters.add_constant("turned" + std::to_string(k), 0, "deg");
        job.parameters.tie(turned.index,
                           {law_of(std::to_string(cells.analyzer_of(k)) + " * deg + 0 * a.dial", {"deg"}, "deg"),
                            {scene.microscope.polarizer_deg.index}});
        scene.microscope.analyzer_deg = turned;
      }
      ++k;
    });
    return fit(job);
  };
  // What follows from a dial without being moved by it changes nothing.
  const FitResult tied = fitted(true), plain = fitted(false);
  ASSERT_TRUE(plain.has_answer()) << plain.verdict;
  ASSERT_TRUE(tied.has_answer()) << tied.verdict;
  EXPECT_EQ(tied.stated.size(), plain.stated.size());
  for (const char* name : {"thickness", "twist"}) {
    const ParameterEstimate &a = *find_estimate(tied, name), &b = *find_estimate(plain, name);
    EXPECT_NEAR(a.value, b.value, 1e-2 * b.stderr_) << name;
    EXPECT_NEAR(a.stderr_, b.stderr_, 1e-2 * b.stderr_) << name;
  }
}

}  // namespace
}  // namespace birefit
