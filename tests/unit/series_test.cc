// Series: what several fits know together about what they share, and how frames are found, ordered and joined to their
// table.

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <fmt/format.h>

#include "birefit/series.h"
#include "pictures.h"

namespace birefit {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

Posterior scalar(double mean, double variance) {
  return {{"x"}, Eigen::VectorXd::Constant(1, mean), Eigen::MatrixXd::Constant(1, 1, variance), 100};
}

TEST(Combine, OneNumberIsTheWeightedMean) {
  const SharedEstimate shared = combine({scalar(1, 1), scalar(3, 0.25), scalar(2, 4)}, std::nullopt);
  const double weights = 1 + 4 + 0.25, mean = (1 * 1 + 3 * 4 + 2 * 0.25) / weights;
  EXPECT_NEAR(shared.posterior.mean[0], mean, 1e-12);
  EXPECT_NEAR(shared.posterior.covariance(0, 0), 1 / weights, 1e-12);
  EXPECT_NEAR(shared.chi_square, std::pow(1 - mean, 2) + 4 * std::pow(3 - mean, 2) + 0.25 * std::pow(2 - mean, 2),
              1e-12);
  EXPECT_EQ(shared.chi_square_degrees, 2);
  EXPECT_TRUE(shared.consistent);
}

// Ten fits hold the prior N(5, 0.5) each: data of variance 1 at l make posteriors of variance 1/3 at (l + 10)/3.
TEST(Combine, APriorCountsOnce) {
  std::vector<Posterior> fits;
  double sum = 0, squares = 0;
  const auto data = [](int i) { return 4 + 0.3 * i; };
  for (int i = 0; i < 10; ++i) fits.push_back(scalar((data(i) + 2 * 5) / 3, 1.0 / 3)), sum += data(i);
  const SharedEstimate shared = combine(fits, scalar(5, 0.5));
  const double mean = (sum + 2 * 5) / 12;
  EXPECT_NEAR(shared.posterior.mean[0], mean, 1e-12);
  EXPECT_NEAR(shared.posterior.covariance(0, 0), 1.0 / 12, 1e-12);
  for (int i = 0; i < 10; ++i) squares += std::pow(data(i) - mean, 2);
  EXPECT_NEAR(shared.chi_square, squares + 2 * std::pow(5 - mean, 2), 1e-11);
  EXPECT_EQ(shared.chi_square_degrees, 10);
}

// Fits that hold next to nothing but the prior change nothing and are no observations.
TEST(Combine, FitsWithoutInformationOfTheirOwnAreNoObservations) {
  const SharedEstimate shared =
      combine({scalar(5, 0.5 * (1 - 1e-13)), scalar(5, 0.5), scalar(6, 0.25)}, scalar(5, 0.5));
  EXPECT_NEAR(shared.posterior.mean[0], 6, 1e-9);
  EXPECT_NEAR(shared.posterior.covariance(0, 0), 0.25, 1e-9);
  EXPECT_EQ(shared.chi_square_degrees, 1);
}

TEST(Combine, FitsThatDisagreeWidenTheCommonError) {
  const SharedEstimate shared = combine({scalar(0, 1), scalar(10, 1)}, std::nullopt);
  EXPECT_FALSE(shared.consistent);
  EXPECT_NEAR(shared.chi_square, 50, 1e-12);
  EXPECT_NEAR(shared.posterior.covariance(0, 0), 0.5 * 50, 1e-10);
  EXPECT_EQ(shared.posterior.degrees_of_freedom, 1);
}

// y_i = a x + b_i + noise, a shared: the combination of lines fitted one by one is the least-squares solution of all at
// once.
TEST(Combine, LinearFitsOneByOneAreTheJointFit) {
  constexpr int kFits = 4, kRows = 12;
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(kFits * kRows, kFits + 1);
  Eigen::VectorXd values(kFits * kRows);
  std::vector<Posterior> fits, slopes;
  for (int f = 0; f < kFits; ++f) {
    Eigen::MatrixXd rows = Eigen::MatrixXd::Ones(kRows, 2);
    Eigen::VectorXd y(kRows);
    for (int i = 0; i < kRows; ++i) {
      rows(i, 1) = f + 0.1 * i * (1 + f);
      y[i] = 1000 * f + 2e-3 * rows(i, 1) + 1e-3 * normal(random);
    }
    rows /= 1e-3, y /= 1e-3;  // to unit variance
    all.block(f * kRows, 0, kRows, 1) = rows.col(1);
    all.block(f * kRows, f + 1, kRows, 1) = rows.col(0);
    values.segment(f * kRows, kRows) = y;
    const Eigen::MatrixXd covariance = (rows.transpose() * rows).llt().solve(Eigen::MatrixXd::Identity(2, 2));
    fits.push_back({{"own", "slope"}, covariance * (rows.transpose() * y), covariance, 10});
    slopes.push_back(*marginal(fits.back(), {"slope"}));
  }
  const Eigen::MatrixXd covariance =
      (all.transpose() * all).llt().solve(Eigen::MatrixXd::Identity(kFits + 1, kFits + 1));
  const Eigen::VectorXd joint = covariance * (all.transpose() * values);
  const SharedEstimate shared = combine(slopes, std::nullopt);
  EXPECT_NEAR(shared.posterior.mean[0], joint[0], 1e-9 * std::abs(joint[0]) + 1e-3 * std::sqrt(covariance(0, 0)));
  EXPECT_NEAR(shared.posterior.covariance(0, 0) / covariance(0, 0), 1, 1e-7);
  for (int f = 0; f < kFits; ++f) {
    const Posterior one = informed(fits[f], shared);
    EXPECT_NEAR(one.mean[0], joint[f + 1], 1e-3 * std::sqrt(covariance(f + 1, f + 1)));
    EXPECT_NEAR(one.covariance(0, 0) / covariance(f + 1, f + 1), 1, 1e-6);
    EXPECT_NEAR(one.covariance(0, 1) / covariance(f + 1, 0), 1, 1e-6);
    EXPECT_NEAR(one.mean[1], shared.posterior.mean[0], 1e-12);
  }
}

/// A folder for one test.
class SeriesFiles : public ::testing::Test {
 protected:
  SeriesFiles() : folder_(fs::temp_directory_path() / fmt::format("birefit-series-{}", ::getpid())) {
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "frames");
  }
  ~SeriesFiles() override { fs::remove_all(folder_); }

  void write(const std::string& name, const std::string& text) { std::ofstream(folder_ / name) << text; }
  /// A crystal's image: gain 1000, offset 100, noise 2; its field grows by 40 % from the middle to the upper edge.
  void expose(const std::string& name, double volts, unsigned seed) {
    constexpr double kHalfWave = 1500, kTilt = 0.4;
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    Image image(32, 32);
    for (int y = 0; y < 32; ++y)
      for (int x = 0; x < 32; ++x) {
        const double t = 2 * (y + 0.5) / 32 - 1;
        image(x, y) = 1000 * std::pow(std::sin(std::numbers::pi / 2 * volts / kHalfWave * (1 + kTilt * t)), 2) + 100 +
                      2 * normal(random);
      }
    save_image(image, folder_ / "frames" / name);
  }
  /// The rest of a config, around a `micrographs:` block.
  std::string config(const std::string& micrographs) {
    return micrographs + R"(
micrograph:
  illumination: {x: 0, y: 0, square: 0}
  background: {x: 0, y: 0, square: 0}
  gain: )" +
           gain_ + R"(
  offset: {fit: auto}
  noise: {read_counts: 2}
sample:
  crystal:
    half_wave_voltage_v: {value: 1400, fit: [1000, 2500]}
    bias_v: 700
    field_along: y
    electrodes_px: )" +
           electrodes_ + R"(
    field_legendre: [)" +
           tilt_ + R"(]
microscope:
  light: {wavelength_nm: 1550}
  polarizer_deg: 0
  analyzer_deg: 90
)";
  }
  void compare_with_the_joint_fit(bool gains);
  std::string problem_of(const std::string& text) {
    write("series.yaml", text);
    try {
      load_series(folder_ / "series.yaml");
    } catch (const UserError& error) {
      return error.what();
    }
    return "none";
  }

  fs::path folder_;
  std::string tilt_ = "{value: 0.3, fit: [0.1, 0.7]}";
  std::string gain_ = "{fit: auto}";
  std::string electrodes_ = "[{value: -0.5, exact: true}, {value: 31.5, exact: true}]";
};

TEST_F(SeriesFiles, NumbersInNamesCountAsNumbers) {
  for (const char* name : {"f10.tif", "f2.tif", "f1.tif", "f02b.tif", "a.tif"}) expose(name, 700, 1);
  write("series.yaml", config("micrographs: {files: \"frames/*.tif\"}"));
  std::vector<std::string> names;
  for (const SeriesFrame& frame : load_series(folder_ / "series.yaml").frames) names.push_back(frame.name);
  EXPECT_THAT(names, ElementsAre("a", "f1", "f2", "f02b", "f10"));
}

TEST_F(SeriesFiles, FramesFollowTheirTable) {
  expose("f1.tif", 700, 1);
  expose("f2.tif", 800, 2);
  write("table.csv", "time_s, file, sample.crystal.bias_v\n1.5, f2.tif, 800\n2.5, frames/f1.tif, 700\n");
  write("series.yaml", config("micrographs: {files: \"frames/*.tif\", set_from: table.csv, along: time_s}"));
  const ImageSeries series = load_series(folder_ / "series.yaml");
  ASSERT_EQ(series.frames.size(), 2u);
  EXPECT_EQ(series.frames[0].name, "f2");
  EXPECT_EQ(series.columns.at(series.along.value()).name, "time_s");
  const Config first = load_frame(series, 0);
  const ParameterRef bias = std::get<Crystal>(picture(first.job, 0).scene.sample).bias_v;
  EXPECT_EQ(first.job.parameters[bias].value, 800);
  EXPECT_FALSE(first.job.parameters[bias].free);
}

/// `gains`: sharing must narrow the first frame's own parameter, or there would be nothing to compare.
void SeriesFiles::compare_with_the_joint_fit(bool gains) {
  const std::vector<double> volts{650, 700, 780};
  std::string rows = "file,sample.crystal.bias_v\n", joint = "micrographs:\n";
  for (std::size_t i = 0; i < volts.size(); ++i) {
    const std::string name = fmt::format("f{}.tif", i);
    expose(name, volts[i], 10 + static_cast<unsigned>(i));
    rows += fmt::format("{},{}\n", name, volts[i]);
    joint += fmt::format(
        "  - {{image: frames/{}, set: {{sample.crystal.bias_v: {}, micrograph.gain: {}, micrograph.offset: "
        "{{fit: auto}},"
        " sample.crystal.half_wave_voltage_v: {{value: 1400, fit: [1000, 2500]}}}}}}\n",
        name, volts[i], gain_);
  }
  const std::string tilt = "sample.crystal.field_legendre[1]", half_wave = "sample.crystal.half_wave_voltage_v";
  write("table.csv", rows);
  write("series.yaml",
        config(fmt::format("micrographs: {{files: \"frames/*.tif\", set_from: table.csv, shared: [\"{}\"]}}", tilt)));
  write("joint.yaml", config(joint));
  const ImageSeries series = load_series(folder_ / "series.yaml");
  std::vector<std::optional<FitResult>> fits;
  for (std::size_t i = 0; i < volts.size(); ++i) {
    Config frame = load_frame(series, i);
    if (i > 0) start_from(frame, *fits.back());
    fits.push_back(fit(frame.job));
  }
  const SeriesResult result = settle_series(series, fits);
  const FitResult all = fit(load_config(folder_ / "joint.yaml", ConfigUse::fit).job);
  ASSERT_TRUE(result.has_answer());
  ASSERT_TRUE(all.has_answer()) << all.verdict;
  const auto estimate = [](const FitResult& of, const std::string& name) {
    for (const ParameterEstimate& p : of.parameters)
      if (p.name == name) return p;
    ADD_FAILURE() << name;
    return ParameterEstimate{};
  };
  const ParameterEstimate exact = estimate(all, tilt);
  for (std::size_t i = 0; i < volts.size(); ++i) {
    // Posteriors are Gaussian to lowest order: here two hundredths of an error and of its size are left, five times
    // that with five times the noise.
    const ParameterEstimate shared = estimate(*result.frames[i], tilt), own = estimate(*result.frames[i], half_wave),
                            joint_own = estimate(all, fmt::format("micrographs[{}].{}", i, half_wave)),
                            alone = estimate(*result.alone[i], half_wave);
    EXPECT_NEAR(shared.value, exact.value, 0.1 * exact.stderr_);
    EXPECT_NEAR(shared.stderr_ / exact.stderr_, 1, 0.05);
    EXPECT_NEAR(own.value, joint_own.value, 0.1 * joint_own.stderr_);
    EXPECT_NEAR(own.stderr_ / joint_own.stderr_, 1, 0.05);
    if (gains && i == 0) {
      EXPECT_LT(own.stderr_, 0.9 * alone.stderr_);
    }
  }
}

TEST_F(SeriesFiles, SharedParametersAreThoseOfTheJointFit) { compare_with_the_joint_fit(true); }

// Electrodes a pixel off are so in every frame: three frames know a field no better for that than one.
TEST_F(SeriesFiles, WhatIsStatedAlikeIsNotAveragedAway) {
  electrodes_ = "[-0.5, 31.5]";
  compare_with_the_joint_fit(false);
}

// Three frames with the prior in each are not three priors.
TEST_F(SeriesFiles, SharedParametersWithAPriorAreThoseOfTheJointFit) {
  tilt_ = "{value: 0.405, fit: [0.1, 0.7], prior_sd: 0.003}";
  gain_ = "{fit: auto, exact: true}";  // what a residual says of the camera's curve is each frame's own
  compare_with_the_joint_fit(false);
}

TEST_F(SeriesFiles, WhatIsNotFittedCannotBeShared) {
  expose("f1.tif", 700, 1);
  EXPECT_THAT(problem_of(config("micrographs: {files: \"frames/*.tif\", shared: [sample.crystal.bias_v]}")),
              HasSubstr("bias_v is not fitted here"));
  EXPECT_THAT(problem_of(config("micrographs: {files: \"frames/*.tif\", shared: [sample.crystal.half_wave_voltage]}")),
              HasSubstr("did you mean sample.crystal.half_wave_voltage_v?"));
}

TEST_F(SeriesFiles, AFitIsKnownByAllThatDeterminesIt) {
  expose("f1.tif", 700, 1);
  expose("f2.tif", 700, 2);
  write("series.yaml", config("micrographs: {files: \"frames/*.tif\"}"));
  const ImageSeries series = load_series(folder_ / "series.yaml");
  Config frame = load_frame(series, 0);
  const std::string before = fingerprint_of(frame);
  EXPECT_EQ(fingerprint_of(load_frame(series, 0)), before);
  EXPECT_NE(fingerprint_of(load_frame(series, 1)), before);
  const FitResult neighbour = fit(load_frame(series, 1).job);
  start_from(frame, neighbour);
  EXPECT_NE(fingerprint_of(frame), before);
  const ParameterRef half_wave = frame.job.parameters.find("sample.crystal.half_wave_voltage_v");
  EXPECT_EQ(frame.job.parameters[half_wave].value, neighbour.theta.at(static_cast<std::size_t>(half_wave.index)));
  expose("f1.tif", 700, 3);
  EXPECT_NE(fingerprint_of(load_frame(series, 0)), before);
}

TEST_F(SeriesFiles, ARecordedFitIsReadBackToTheBit) {
  expose("f1.tif", 700, 1);
  write("series.yaml", config("micrographs: {files: \"frames/*.tif\"}"));
  const ImageSeries series = load_series(folder_ / "series.yaml");
  Config frame = load_frame(series, 0);
  frame.fingerprint = fingerprint_of(frame);
  const FitResult result = fit(frame.job);
  write("fit.json", fit_json(frame, result));
  const auto record = load_recorded_fit(folder_ / "fit.json");
  ASSERT_TRUE(record);
  EXPECT_EQ(record->fingerprint, frame.fingerprint);
  ASSERT_EQ(record->result.parameters.size(), result.parameters.size());
  for (std::size_t i = 0; i < result.parameters.size(); ++i) {
    EXPECT_EQ(record->result.parameters[i].value, result.parameters[i].value);
    EXPECT_EQ(record->result.parameters[i].stderr_, result.parameters[i].stderr_);
  }
  EXPECT_EQ(record->result.covariance, result.covariance);
  EXPECT_EQ(record->result.has_answer(), result.has_answer());
  const std::string whole = fit_json(frame, result);
  write("fit.json", whole.substr(0, whole.size() / 2));
  EXPECT_FALSE(load_recorded_fit(folder_ / "fit.json"));
}

TEST_F(SeriesFiles, WhatTheFramesShareShowsInTheFirstThatCanBeRead) {
  write("frames/f1.tif", "");
  expose("f2.tif", 700, 1);
  write("series.yaml", config("micrographs: {files: \"frames/*.tif\"}"));
  ImageSeries series = load_series(folder_ / "series.yaml");
  EXPECT_THAT(series.frames[0].unreadable, HasSubstr("is empty"));
  EXPECT_EQ(first_readable(series), 1u);
  EXPECT_FALSE(open_frame(series, 0));
  EXPECT_EQ(load_config(folder_ / "series.yaml", ConfigUse::plan).scene.view.width, 32);
  fs::remove(folder_ / "frames" / "f2.tif");  // after it was checked
  EXPECT_FALSE(open_frame(series, 1));
  EXPECT_THAT(series.frames[1].unreadable, HasSubstr("does not exist"));
  EXPECT_THAT(problem_of(config("micrographs: {files: \"frames/*.tif\"}")), HasSubstr("is empty"));
}

// Frames that state the same pixel size err by it together: their noise is averaged, that is not.
TEST_F(SeriesFiles, WhatFramesStateAlikeIsNotAveraged) {
  const std::string tilt = "sample.crystal.field_legendre[1]";
  constexpr int kFrames = 4;
  for (int i = 0; i < kFrames; ++i) expose(fmt::format("f{}.tif", i), 700, 1 + static_cast<unsigned>(i));
  write("series.yaml", config(fmt::format("micrographs: {{files: \"frames/*.tif\", shared: [\"{}\"]}}", tilt)));
  const ImageSeries series = load_series(folder_ / "series.yaml");
  std::vector<std::optional<FitResult>> own, with_stated;
  double stated_sd = 0, of_one = 0;
  for (int i = 0; i < kFrames; ++i) {
    FitResult r = fit(load_frame(series, static_cast<std::size_t>(i)).job);
    ASSERT_TRUE(r.has_answer()) << r.verdict;
    r.covariance -= r.stated_covariance;
    r.stated_covariance.setZero();
    own.push_back(r);
    const auto at = std::find(r.names.begin(), r.names.end(), tilt) - r.names.begin();
    if (i == 0) of_one = r.covariance(at, at), stated_sd = 2 * std::sqrt(of_one);
    r.stated_covariance(at, at) = stated_sd * stated_sd;
    r.covariance += r.stated_covariance;
    with_stated.push_back(r);
  }
  const SeriesResult noise = settle_series(series, own), both = settle_series(series, with_stated);
  ASSERT_TRUE(noise.shared && both.shared);
  const double alone = noise.shared->posterior.covariance(0, 0);
  EXPECT_LT(alone, 0.5 * of_one);
  EXPECT_NEAR(both.shared->posterior.covariance(0, 0), alone + stated_sd * stated_sd, 1e-9 * stated_sd * stated_sd);
  EXPECT_NEAR(both.shared->posterior.mean[0], noise.shared->posterior.mean[0], 1e-9 * stated_sd);
  EXPECT_NEAR(both.shared->chi_square, noise.shared->chi_square, 1e-6);
}

TEST_F(SeriesFiles, AFrameWithoutAnAnswerStaysInTheTable) {
  expose("f1.tif", 700, 1);
  expose("f2.tif", 710, 2);
  write("series.yaml", config("micrographs: {files: \"frames/*.tif\"}"));
  const ImageSeries series = load_series(folder_ / "series.yaml");
  FitResult pinned = fit(load_frame(series, 0).job);
  pinned.pinned = true;
  const std::string csv = series_csv(series, settle_series(series, {pinned, std::nullopt}));
  EXPECT_THAT(csv, HasSubstr("frames/f1.tif,"));
  EXPECT_THAT(csv, HasSubstr(",at a bound,"));
  EXPECT_THAT(csv, HasSubstr("frames/f2.tif,,"));
  EXPECT_THAT(csv, HasSubstr(",not done,\n"));
}

}  // namespace
}  // namespace birefit
