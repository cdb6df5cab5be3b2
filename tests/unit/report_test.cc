// fit.json, the summary, the report and the folder they are written to, from a made-up result.

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "birefit/io.h"
#include "io/report/chart.h"
#include "io/report/format.h"
#include "pictures.h"

namespace birefit {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
const std::string kEvil = "<script>alert('1')</script>&\"";

struct Case {
  Config config;
  FitResult result;
};

void add_parameter(Case& c, const std::string& name, const std::string& unit, double value, double error, bool linear) {
  Parameter parameter;
  parameter.name = name;
  parameter.unit = unit;
  parameter.value = value;
  c.config.job.parameters.add(parameter);
  ParameterEstimate estimate;
  estimate.name = name;
  estimate.unit = unit;
  estimate.value = value;
  estimate.stderr_ = error;
  estimate.interval95_low = value - 2 * error;
  estimate.interval95_high = value + 2 * error;
  estimate.start = 1.1 * value;
  estimate.lower = linear ? -kInfinity : 0.5 * value;
  estimate.upper = linear ? kInfinity : 2 * value;
  estimate.linear = linear;
  c.result.parameters.push_back(estimate);
  c.result.names.push_back(name);
  c.result.theta.push_back(value);
}

Case make_case(int micrographs = 1, int width = 48, int height = 40) {
  Case c;
  c.config.path = "jobs/drop.yaml";
  c.config.text = "micrograph: {image: drop.tif}  # caf\xc3\xa9\n";
  add_parameter(c, "sample.material.birefringence", "", 0.21873, 0.00031, false);
  add_parameter(c, "sample.droplet.diameter_um", "um", 9.3021, 0.0048, false);
  add_parameter(c, "micrograph.gain", "", 3012.3, 4.2, true);
  FitResult& r = c.result;
  r.correlation = Eigen::MatrixXd::Identity(3, 3);
  r.correlation(0, 1) = r.correlation(1, 0) = -0.999998;
  r.correlation(0, 2) = r.correlation(2, 0) = 0.3;
  r.covariance = r.correlation;
  r.covariance_kind = "white noise";
  r.interval_degrees_of_freedom = 1900;
  r.converged = true;
  r.chi_square = 1950;
  r.reduced_chi_square = 1.02;
  r.degrees_of_freedom = 1911;
  r.evaluations = 40;
  r.seconds = 0.5;
  r.verdict = "Birefringence is determined.";
  r.solver_report = "Termination: CONVERGENCE";
  r.iterations = {{0, 5000, 1}, {1, 1950, 0.1}};
  r.scans.push_back({"sample.droplet.diameter_um", {8, 9, 10, 11}, {4000, 2500, 2600, 9000}});
  std::mt19937 generator(7);
  std::normal_distribution<double> normal;
  const ParameterRef pixel_size = c.config.job.parameters.add_constant("micrograph.pixel_size_um", 0.2, "um");
  r.theta.push_back(0.2);
  for (int k = 0; k < micrographs; ++k) {
    Picture input;
    MicrographResult m;
    m.name = input.name = "drop" + std::to_string(k) + ".tif";
    input.scene.sample = Droplet{};
    input.scene.view.pixel_size_um = pixel_size;
    input.values = m.fitted = m.sigma = Image(width, height);
    m.residual = Image(width, height, kNaN);
    input.mask = Mask(width, height, 1);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        m.fitted(x, y) = 100 + 50 * std::sin(0.3 * x) * std::sin(0.3 * y);
        m.sigma(x, y) = 2;
        input.values(x, y) = m.fitted(x, y) + 2 * normal(generator);
        if (x < 5) {
          input.mask(x, y) = 0;
          continue;
        }
        m.residual(x, y) = input.values(x, y) - m.fitted(x, y);
        ++m.used;
      }
    m.residual_rms = 2;
    m.signal_range = 100;
    m.plan.method = "diagonal";
    m.plan.physics = "one_way";
    m.plan.reasons = {"The director is radial."};
    m.plan.numerical_error = 1e-5 * (k + 1);
    m.plan.model_error = 0.01;
    input.masked_by_user = 5 * height;
    input.saturated = 3;
    r.micrographs.push_back(std::move(m));
    c.config.job.measurements.push_back(std::move(input));
  }
  return c;
}

json parsed(const Case& c) { return json::parse(fit_json(c.config, c.result)); }

// ---- fit.json -------------------------------------------------------------------------------------------------------

/// Keys of fit.json's own, not those that are names of parameters.
void collect_keys(const json& node, bool names, std::set<std::string>& keys) {
  if (node.is_array())
    for (const json& item : node) collect_keys(item, false, keys);
  if (!node.is_object()) return;
  for (const auto& [key, value] : node.items()) {
    if (!names) keys.insert(key);
    collect_keys(value, !names && (key == "parameters" || key == "weights" || key == "shift"), keys);
  }
}

TEST(FitJson, EveryKeyIsInItsDocument) {
  Case c = make_case(2);
  FitResult& r = c.result;
  c.config.fingerprint = "0123456789abcdef";
  c.config.job.prior = JointPrior{};
  r.rivals.push_back({});
  r.branches.push_back({});
  r.directions.push_back({});
  r.inputs.push_back({});
  r.derived.push_back({});
  r.strips.push_back({});
  r.coverage = Coverage{};
  r.coverage->parameters.push_back({});
  r.samples = Samples{};
  r.samples->parameters.push_back({});
  r.frame_scatter = JointPrior::FrameScatter{};
  r.parameters[0].limit = "upper";
  r.parameters[0].prior_sd = 1;
  std::set<std::string> keys;
  collect_keys(parsed(c), false, keys);
  EXPECT_GT(keys.size(), 100u);
  std::ifstream file(BIREFIT_SOURCE_DIR "/docs/fit_json.md");
  const std::string document(std::istreambuf_iterator<char>(file), {});
  for (const std::string& key : keys) EXPECT_THAT(document, HasSubstr("`" + key + "`"));
}

TEST(FitJson, TwoRunsDifferInWhatIsOfTheRunAlone) {
  Case c = make_case();
  json first = parsed(c);
  c.result.seconds = 77;
  json second = parsed(c);
  EXPECT_EQ(second["run"]["seconds"], 77);
  EXPECT_NE(first, second);
  first.erase("run"), second.erase("run");
  EXPECT_EQ(first, second);
  EXPECT_EQ(first["schema"], 1);
  EXPECT_EQ(first["made_by"]["files"][0]["file"], "jobs/drop.yaml");
  EXPECT_EQ(first["made_by"]["files"][0]["sha256"].get<std::string>().size(), 64u);
}

TEST(FitJson, HasTheKeysOthersDependOn) {
  const json j = parsed(make_case());
  for (const char* key : {"schema",        "config",       "converged",          "ambiguous",
                          "rivals",        "identifiable", "directions",         "parameters",
                          "correlation",   "covariance",   "covariance_kind",    "interval_degrees_of_freedom",
                          "frame_scatter", "chi_square",   "reduced_chi_square", "degrees_of_freedom",
                          "residual_rms",  "pixels",       "micrographs",        "model",
                          "evaluations",   "made_by",      "warnings",           "verdict",
                          "interrupted"})
    EXPECT_TRUE(j.contains(key)) << key;
  const json& p = j["parameters"]["sample.droplet.diameter_um"];
  for (const char* key : {"value", "stderr", "unit", "start", "bounds", "at_bound", "limit", "interval_95", "prior"})
    EXPECT_TRUE(p.contains(key)) << key;
  EXPECT_EQ(p["value"], 9.3021);
  EXPECT_EQ(p["unit"], "um");
  EXPECT_EQ(p["prior"], nullptr);
  EXPECT_EQ(p["limit"], nullptr);
  EXPECT_EQ(j["covariance"]["names"][2], "micrograph.gain");
  EXPECT_EQ(j["covariance"]["matrix"][0][1], -0.999998);
  EXPECT_EQ(j["interval_degrees_of_freedom"], 1900);
  EXPECT_EQ(j["frame_scatter"], nullptr);
  EXPECT_EQ(j["warnings"], json::array());
  EXPECT_EQ(j["rivals"], json::array());
}

TEST(FitJson, WritesNullForWhatIsNotANumber) {
  Case c = make_case();
  c.result.parameters[0].stderr_ = kNaN;
  c.result.parameters[0].interval95_high = kInfinity;
  c.result.covariance(0, 0) = kNaN;
  c.result.reduced_chi_square = kInfinity;
  c.result.interval_degrees_of_freedom = kInfinity;
  const json j = parsed(c);
  EXPECT_EQ(j["parameters"]["sample.material.birefringence"]["stderr"], nullptr);
  EXPECT_EQ(j["parameters"]["sample.material.birefringence"]["interval_95"][1], nullptr);
  EXPECT_EQ(j["parameters"]["micrograph.gain"]["bounds"], json::parse("[null, null]"));
  EXPECT_EQ(j["covariance"]["matrix"][0][0], nullptr);
  EXPECT_EQ(j["reduced_chi_square"], nullptr);
  EXPECT_EQ(j["interval_degrees_of_freedom"], nullptr);
}

TEST(FitJson, AddsUpPixelsAndTakesTheWorstErrors) {
  const json j = parsed(make_case(3));
  EXPECT_EQ(j["pixels"]["used"], 3 * 43 * 40);
  EXPECT_EQ(j["pixels"]["masked"], 3 * 5 * 40);
  EXPECT_EQ(j["pixels"]["saturated"], 9);
  EXPECT_EQ(j["micrographs"].size(), 3u);
  EXPECT_DOUBLE_EQ(j["residual_rms"].get<double>(), 0.02) << "as a fraction of the signal range";
  EXPECT_EQ(j["micrographs"][1]["residual_rms"], 2) << "in the micrograph's units";
  EXPECT_DOUBLE_EQ(j["model"]["numerical_error"].get<double>(), 3e-5);
  EXPECT_EQ(j["model"]["method"], "diagonal");
}

TEST(FitJson, HoldsLimitsPriorsRivalsAndFrameScatter) {
  Case c = make_case();
  c.result.parameters[0].limit = "upper";
  c.result.parameters[0].limit_value = 0.22;
  c.result.parameters[1].prior_value = 9.3;
  c.result.parameters[1].prior_sd = 0.1;
  c.result.rivals.push_back({{0.25, 8.1, 3000}, 1960, 0.006});
  c.result.frame_scatter = JointPrior::FrameScatter{0.004, 3};
  const json j = parsed(c);
  EXPECT_EQ(j["parameters"]["sample.material.birefringence"]["limit"],
            json::parse(R"({"side": "upper", "value": 0.22})"));
  EXPECT_EQ(j["parameters"]["sample.droplet.diameter_um"]["prior"], json::parse(R"({"value": 9.3, "sd": 0.1})"));
  EXPECT_EQ(j["rivals"][0]["parameters"]["sample.droplet.diameter_um"], 8.1);
  EXPECT_EQ(j["frame_scatter"]["intensity_sd"], 0.004);
}

TEST(FitJson, IsValidWhateverBytesTheConfigHolds) {
  Case c = make_case();
  c.config.text = "bad \xff\xfe utf-8 \x01 \"quoted\"";
  c.result.micrographs[0].name = "\xc3(.tif";
  EXPECT_TRUE(parsed(c).is_object());
}

// ---- numbers and summary --------------------------------------------------------------------------------------------

TEST(FormatValue, ShowsTwoDigitsOfTheError) {
  EXPECT_EQ(format_value(9.30214, 0.0048), "9.3021");
  EXPECT_EQ(format_error(0.00483), "0.0048");
  EXPECT_EQ(format_value(9.30214, 0.0996), "9.30");
  EXPECT_EQ(format_error(0.0996), "0.10");
  EXPECT_EQ(format_value(1523.4, 127), "1520");
  EXPECT_EQ(format_error(127), "130");
  EXPECT_EQ(format_value(-0.02, 1.3), "-0.0");
  EXPECT_EQ(format_value(0.218731234, kNaN), "0.218731");
  EXPECT_EQ(format_value(1.23456e-7, 4.4e-9), "1.235e-07");
  EXPECT_EQ(format_value(kNaN, 1), "not known");
}

TEST(Summary, ReadsLikeLmfit) {
  Case c = make_case();
  c.result.warnings = {"The bandwidth is not modelled."};
  const std::string text = summary(c.result);
  EXPECT_THAT(text,
              HasSubstr("sample.droplet.diameter_um    = 9.3021 +/- 0.0048 um (0.052 %) [95%: 9.2925 .. 9.3117]"));
  EXPECT_THAT(text, HasSubstr("reduced chi-square 1.02"));
  EXPECT_THAT(text, HasSubstr("-0.9999980  birefringence and diameter_um"));
  EXPECT_THAT(text, Not(HasSubstr("birefringence and gain"))) << "0.3 is not worth a line";
  EXPECT_THAT(text, HasSubstr("Birefringence is determined.\nwarning: The bandwidth is not modelled."));
}

TEST(Summary, TellsLimitsBoundsAndUnknownErrors) {
  Case c = make_case();
  c.result.parameters[0].limit = "upper";
  c.result.parameters[0].limit_value = 0.0123;
  c.result.parameters[1].at_bound = true;
  c.result.parameters[2].stderr_ = kNaN;
  const std::string text = summary(c.result);
  EXPECT_THAT(text,
              AllOf(HasSubstr("< 0.0123 (95 % upper limit"), HasSubstr("AT ITS BOUND"), HasSubstr("+/- not known")));
  EXPECT_THAT(text, Not(HasSubstr("nan")));
}

// ---- report ---------------------------------------------------------------------------------------------------------

TEST(Report, EscapesEverythingOfTheUsers) {
  Case c = make_case();
  c.config.path = "jobs/" + kEvil + ".yaml";
  c.config.text = kEvil;
  picture(c.config.job, 0).name = c.result.micrographs[0].name = kEvil;
  c.result.verdict = c.result.solver_report = c.result.covariance_kind = kEvil;
  c.result.warnings = {kEvil};
  c.result.parameters[1].name = c.result.names[1] = c.result.scans[0].name = kEvil;
  c.result.parameters[1].unit = kEvil;
  c.result.directions.push_back({{}, 1, false, kEvil});
  c.result.rivals.push_back({c.result.theta, 1, 1});
  c.result.micrographs[0].plan.method = c.result.micrographs[0].plan.physics = kEvil;
  c.result.micrographs[0].plan.reasons = c.result.micrographs[0].plan.warnings = {kEvil};
  c.config.job.prior = JointPrior{kEvil, {kEvil}, {}, {}, 3, {}};
  const std::string html = report_html(c.config, c.result);
  EXPECT_EQ(html.find("<script"), std::string::npos);
  EXPECT_EQ(html.find("alert('1')"), std::string::npos);
  EXPECT_THAT(html, HasSubstr("&lt;script&gt;alert(&#39;1&#39;)&lt;/script&gt;&amp;&quot;"));
}

TEST(Report, NeedsNoNetworkAndNoScript) {
  const std::string html = report_html(make_case().config, make_case().result);
  for (const char* forbidden : {"http://", "https://", "<script", "<link", "url(", "@import", "javascript:"})
    EXPECT_EQ(html.find(forbidden), std::string::npos) << forbidden;
  EXPECT_THAT(html, HasSubstr("data:image/png;base64,"));
  EXPECT_THAT(html, HasSubstr("Content-Security-Policy"));
}

TEST(Report, ShowsEverySection) {
  const Case c = make_case(2);
  const std::string html = report_html(c.config, c.result);
  for (const char* part :
       {"Measured", "Fitted", "Residual", "Profile", "Parameters", "95 % interval", "Correlations", "Convergence",
        "unit normal", "The scan before the solver", "What the data determine", "Model", "Data", "Provenance",
        "Config as read", "CONVERGENCE", "drop1.tif", "The director is radial."})
    EXPECT_THAT(html, HasSubstr(part));
  const auto without_run = [](const std::string& text) {
    return std::regex_replace(text, std::regex("<dt>run</dt><dd>.*</dd>"), "");
  };
  EXPECT_EQ(without_run(html), without_run(report_html(c.config, c.result))) << "same result, same bytes";
}

// What made it, when, and of which files: as fit.json has it under made_by and run.
TEST(Report, SaysWhereItComesFrom) {
  const Case c = make_case();
  const std::string html = report_html(c.config, c.result);
  EXPECT_THAT(html, ::testing::ContainsRegex("<dt>program</dt><dd>birefit [0-9.]+, Fourier transforms by "));
  EXPECT_THAT(html, ::testing::ContainsRegex("<dt>run</dt><dd>[0-9-]+T[0-9:]+Z on "));
  EXPECT_THAT(html, ::testing::ContainsRegex("<code>[0-9a-f]{64}</code>"));
}

// A closed <details> is not on paper.
TEST(Report, HasTheConfigOnPaper) {
  EXPECT_THAT(report_html(make_case().config, make_case().result), HasSubstr("<details open><summary>Config as read"));
}

TEST(Report, IsDarkOnDarkScreensAndWhiteOnPaper) {
  const std::string html = report_html(make_case().config, make_case().result);
  EXPECT_THAT(html, HasSubstr("@media screen and (prefers-color-scheme: dark)"));
  EXPECT_THAT(html, HasSubstr("@media print"));
}

TEST(Report, SaysInWordsWhatItsPicturesShow) {
  const Case c = make_case();
  const std::string html = report_html(c.config, c.result);
  const std::regex picture(R"rx(<svg class="(image|chart)"[^>]*aria-label="([^"]*)")rx");
  int images = 0, charts = 0;
  for (std::sregex_iterator at(html.begin(), html.end(), picture), end; at != end; ++at) {
    ++((*at)[1] == "image" ? images : charts);
    EXPECT_THAT((*at)[2].str(),
                ::testing::ContainsRegex((*at)[1] == "image" ? "pixels, .* from " : "Against .* from "));
  }
  EXPECT_EQ(images, 3);
  EXPECT_GE(charts, 2);
}

// Frames of an even cell have no range of their own: that of all of them serves.
TEST(Summary, OfEvenImagesTheirOwnRangeIsThatOfAll) {
  FitResult result;
  for (const double level : {100.0, 300.0}) {
    MicrographResult m;
    m.fitted = Image(4, 4, level), m.residual = Image(4, 4, 2.0);
    m.used = 16, m.residual_rms = 2, m.signal_range = 0;
    result.micrographs.push_back(m);
  }
  EXPECT_THAT(summary(result), HasSubstr("residual rms 1 % of the signal range"));
  result.micrographs.pop_back();
  EXPECT_THAT(summary(result), HasSubstr("residual rms 2 (even images have no range)"));
}

TEST(Report, SaysWhyThereIsNoAnswer) {
  Case c = make_case();
  EXPECT_THAT(report_html(c.config, c.result), HasSubstr("badge good"));
  c.result.pinned = true;
  EXPECT_THAT(report_html(c.config, c.result), HasSubstr("No answer: pinned at a bound"));
  c.result.interrupted = true;
  EXPECT_THAT(report_html(c.config, c.result), HasSubstr("No answer: interrupted"));
}

TEST(Report, SurvivesResultsOfFailedFits) {
  const std::regex kBareNan("[ >\",(-]nan[ <\",)]|Mnan|Lnan");  // not those of base64
  Config config;
  EXPECT_THAT(report_html(config, FitResult{}), HasSubstr("</html>"));
  EXPECT_TRUE(json::parse(fit_json(config, FitResult{})).is_object());
  EXPECT_THAT(summary(FitResult{}), Not(HasSubstr("nan")));

  Case c = make_case();
  for (ParameterEstimate& p : c.result.parameters) p.value = p.stderr_ = p.interval95_low = p.interval95_high = kNaN;
  c.result.correlation.setConstant(kNaN);
  c.result.covariance.resize(0, 0);
  c.result.chi_square = c.result.reduced_chi_square = kNaN;
  c.result.theta.assign(3, kNaN);
  c.result.scans[0].chi_square.assign(4, kNaN);
  c.result.iterations = {{0, kNaN, 0}, {1, kInfinity, 0}};
  c.result.micrographs[0].fitted = Image(48, 40, kNaN);
  c.result.micrographs[0].residual = Image(48, 40, kNaN);
  const std::string html = report_html(c.config, c.result);
  EXPECT_THAT(html, HasSubstr("</html>"));
  EXPECT_FALSE(std::regex_search(html, kBareNan));

  Case flat = make_case();
  flat.result.micrographs[0].fitted = picture(flat.config.job, 0).values = Image(48, 40, 5.0);
  flat.result.micrographs[0].residual = flat.result.micrographs[0].sigma = Image(48, 40, 0.0);
  EXPECT_FALSE(std::regex_search(report_html(flat.config, flat.result), kBareNan));
}

TEST(Report, LargeImagesAreShrunk) {
  const Case c = make_case(1, 1500, 1200);
  const std::string html = report_html(c.config, c.result);
  EXPECT_THAT(html, HasSubstr("3 \u00d7 3 averaged for display"));
  EXPECT_LT(html.size(), 3u << 20);
}

TEST(Report, BarsShowTheProfileAlongTheField) {
  Case c = make_case();
  picture(c.config.job, 0).scene.sample = Crystal{};
  EXPECT_THAT(report_html(c.config, c.result), HasSubstr("mean over the columns of every row"));
}

TEST(NiceTicks, AreMultiplesOfOneTwoOrFive) {
  EXPECT_EQ(nice_ticks(0, 1, 5), (std::vector<double>{0, 0.2, 0.4, 2 * 0.2 + 0.2, 0.8, 1}));
  EXPECT_EQ(nice_ticks(-3, 3, 6), (std::vector<double>{-3, -2, -1, 0, 1, 2, 3}));
  EXPECT_EQ(nice_ticks(95, 205, 2), (std::vector<double>{100, 150, 200}));
  EXPECT_TRUE(nice_ticks(1, 1, 5).empty());
  EXPECT_TRUE(nice_ticks(kNaN, 1, 5).empty());
  EXPECT_EQ(tick_label(0.30000000000000004, 0.1), "0.3");
  EXPECT_EQ(tick_label(1500, 500), "1500");
}

// ---- the folder -----------------------------------------------------------------------------------------------------

class WriteResults : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) / ("birefit_results_" + std::to_string(getpid()));
    fs::remove_all(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path folder_;
};

TEST_F(WriteResults, WritesEveryFileAndNothingElse) {
  const Case c = make_case();
  write_results(folder_ / "a" / "b", c.config, c.result);
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder_ / "a" / "b")) names.push_back(entry.path().filename());
  EXPECT_THAT(names, ::testing::UnorderedElementsAre("fit.json", "report.html", "fitted.tif", "residual.tif",
                                                     "config.yaml", "log.txt"));
  std::ifstream echo(folder_ / "a" / "b" / "config.yaml");
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(echo), {}), c.config.text);
  const LoadedImage residual = load_image({folder_ / "a" / "b" / "residual.tif", {}, "", {}});
  EXPECT_TRUE(std::isnan(residual.values(0, 0)));
  EXPECT_FLOAT_EQ(residual.values(20, 20), c.result.micrographs[0].residual(20, 20));
}

TEST_F(WriteResults, NumbersTheImagesOfSeveralMicrographs) {
  const Case c = make_case(2);
  write_results(folder_, c.config, c.result);
  for (const char* name : {"fitted_0.tif", "fitted_1.tif", "residual_0.tif", "residual_1.tif"})
    EXPECT_TRUE(fs::exists(folder_ / name)) << name;
  EXPECT_FALSE(fs::exists(folder_ / "fitted.tif"));
}

TEST_F(WriteResults, PicturesOfAnEarlierFitGoAway) {
  write_results(folder_, make_case(2).config, make_case(2).result, {".tif", ".npy"});
  EXPECT_TRUE(fs::exists(folder_ / "residual_1.npy"));
  std::ofstream(folder_ / "fitted_by_me.tif") << "x";
  const Case c = make_case();
  write_results(folder_, c.config, c.result);
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder_)) names.push_back(entry.path().filename());
  EXPECT_THAT(names, ::testing::UnorderedElementsAre("fit.json", "report.html", "fitted.tif", "residual.tif",
                                                     "config.yaml", "log.txt", "fitted_by_me.tif"));
  EXPECT_EQ(load_image({folder_ / "fitted.tif", {}, "", {}}).pixel_size_um, 0.2);
}

TEST_F(WriteResults, WhatIsNoFitKeepsItsFiles) {
  fs::create_directories(folder_);
  std::ofstream(folder_ / "fitted_7.tif") << "somebody's";
  const Case c = make_case();
  write_results(folder_, c.config, c.result);
  EXPECT_TRUE(fs::exists(folder_ / "fitted_7.tif"));
}

TEST_F(WriteResults, RefusesAFolderThatIsAFile) {
  std::ofstream(folder_) << "x";
  const Case c = make_case();
  EXPECT_THROW(write_results(folder_, c.config, c.result), UserError);
  EXPECT_THROW(write_results(folder_ / "sub", c.config, c.result), UserError);
}

TEST_F(WriteResults, AFailedRunLeavesTheEarlierResultsUntouched) {
  const Case c = make_case();
  write_results(folder_, c.config, c.result);
  fs::remove(folder_ / "report.html");
  fs::create_directory(folder_ / "report.html");  // cannot be replaced by a file
  Case next = make_case();
  next.result.seconds = 99;
  EXPECT_THROW(write_results(folder_, next.config, next.result), UserError);
  std::ifstream file(folder_ / "fit.json");
  EXPECT_EQ(json::parse(file)["run"]["seconds"], 0.5);
  for (const auto& entry : fs::directory_iterator(folder_))
    EXPECT_NE(entry.path().extension(), ".part") << entry.path();
}

}  // namespace
}  // namespace birefit
