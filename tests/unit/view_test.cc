// What `birefit view` shows beside HTTP: chi-square as the fit has it, the newest picture, configs with other starts.

#include <future>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "config_fixture.h"
#include "fit/trial.h"
#include "io/config/edit.h"
#include "view/session.h"

namespace birefit {
namespace {

using Json = nlohmann::json;
using testing::ConfigFolder;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* kCrystal = R"(micrograph: {image: crystal.tif}
sample:
  crystal:
    half_wave_voltage_v: {value: 1400, fit: [1000, 2500]}  # of the maker
    bias_v: 700
    field_along: y
    electrodes_px: [-0.5, 47.5]
    field_legendre: [{value: 0.3, fit: [0.1, 0.7]}]
microscope:
  light: {wavelength_nm: 1550}
  polarizer_deg: 0
  analyzer_deg: 90
)";

class View : public ConfigFolder {
 protected:
  /// kCrystal with a picture of 1500 V and 0.4, in counts with noise; a pixel is dead.
  Config crystal(int width = 48) {
    const std::string truth =
        replaced(replaced(replaced(kCrystal, "value: 1400", "value: 1500"), "value: 0.3", "value: 0.4"),
                 "micrograph: {image: crystal.tif}", "image_size_px: [" + std::to_string(width) + ", 48]");
    const Config scene = load(truth);
    const Theta theta = scene.job.parameters.values();
    Image light = render(scene.scene, plan(scene.scene, theta), theta).intensity;
    const Image noise = counts(0, 7, width, 48);
    for (std::size_t i = 0; i < light.values().size(); ++i)
      light.values()[i] = 20 + 200 * light.values()[i] + noise.values()[i];
    light(5, 7) = 4000;
    save("crystal.tif", light);
    return load(kCrystal, ConfigUse::fit);
  }
};

TEST_F(View, ChiSquareIsThatOfTheFitWhereTheFitEnded) {
  const Config config = crystal();
  const FitResult result = fit(config.job);
  Trials trials(config.job, result);
  const Trial trial = trials.at(trials.start());
  EXPECT_NEAR(trial.chi_square / result.chi_square, 1, 1e-10);
  EXPECT_NEAR(trial.reduced_chi_square / result.reduced_chi_square, 1, 1e-10);
  const ParameterRef gain = config.job.parameters.find("micrograph.gain");
  EXPECT_NEAR(gain.in(trial.theta) / gain.in(result.theta), 1, 1e-10);
  double worst = 0;
  for (std::size_t i = 0; i < trial.fitted[0].values().size(); ++i)
    worst = std::max(worst, std::abs(trial.fitted[0].values()[i] - result.micrographs[0].fitted.values()[i]));
  EXPECT_LT(worst, 1e-7);  // counts; rounding of gains that differ in their last digits
  EXPECT_TRUE(std::isnan(trials.sigma(0)(5, 7)));
  // Elsewhere it is larger, by the same weights.
  std::vector<double> other = trials.start();
  other[0] += 1;
  EXPECT_GT(trials.at(other).chi_square, trial.chi_square);
}

TEST_F(View, APictureIsPlannedWhereItIs) {
  const Config config = crystal();
  Trials trials(config.job);
  const std::vector<double> values = {1550, 0.5};
  trials.plan_at(values);
  const Trial trial = trials.at(values);
  Theta theta = config.job.parameters.values();
  for (std::size_t j = 0; j < values.size(); ++j) theta[static_cast<std::size_t>(trials.searched()[j])] = values[j];
  const Image light = render(config.scene, plan(config.scene, config.job.demand, theta), theta).intensity;
  const double gain = config.job.parameters.find("micrograph.gain").in(trial.theta),
               offset = config.job.parameters.find("micrograph.offset").in(trial.theta);
  for (std::size_t i = 0; i < light.values().size(); ++i)
    ASSERT_NEAR(trial.fitted[0].values()[i], gain * light.values()[i] + offset, 1e-9);
}

// Of those that wait for a picture only the last one gets it, and the last one always does.
TEST_F(View, TheNewestRequestWins) {
  view::Session session(1);
  session.open(crystal(3000));
  bool passed_over = false;
  for (int attempt = 0; attempt < 20 && !passed_over; ++attempt) {
    std::vector<std::future<std::optional<std::string>>> waiting;
    for (int i = 0; i < 8; ++i)  // all at once: while one is drawn, of those that wait the newest follows
      waiting.push_back(std::async(std::launch::async, [&, i] { return session.draw(0, {1400.0 + i, 0.3}, false); }));
    for (auto& one : waiting) one.wait();
    const auto last = session.draw(0, {1450, 0.3}, false);
    ASSERT_TRUE(last.has_value());
    for (auto& one : waiting) passed_over = !one.get() || passed_over;
  }
  EXPECT_TRUE(passed_over);
}

TEST_F(View, AFitInTheBackgroundMovesTheValuesAndIsToldOf) {
  view::Session session(1);
  session.open(crystal());
  const Json before = Json::parse(session.description());
  session.start_fit({1400, 0.3});
  long state = 0;
  std::size_t line = 0;
  for (bool running = true; running;) {
    const Json news = Json::parse(session.news(state, line, 60));
    state = news["state"], line = news["line"], running = news["running"];
  }
  const Json after = Json::parse(session.description());
  EXPECT_GT(after["version"], before["version"]);
  EXPECT_NEAR(after["parameters"][0]["value"].get<double>(), 1500, 30);
  EXPECT_EQ(after["parameters"][0]["start"], 1400);
  EXPECT_EQ(after["result"]["parameters"][0]["value"], after["parameters"][0]["value"]);
  EXPECT_THAT(session.report(), HasSubstr("<html"));
  // What a fit found is the start of the config that is saved.
  std::vector<double> values;
  for (const Json& p : after["parameters"]) values.push_back(p["value"]);
  EXPECT_THAT(session.config_text(values), HasSubstr("fit: [1000, 2500]}  # of the maker"));
  EXPECT_THAT(session.config_text(values), Not(HasSubstr("value: 1400")));
}

TEST_F(View, NothingIsSavedElsewhere) {
  view::Session session(1);
  session.open(crystal());
  for (const char* name :
       {"../x.yaml", "/x.yaml", "a/x.yaml", ".x.yaml", "x.txt", "", ".yaml", "x\n.yaml", "..\\x.yaml"})
    EXPECT_THROW(session.save(name, {1400, 0.3}, true), UserError) << name;
  EXPECT_EQ(session.save("x.yaml", {1400, 0.3}, false), folder_ / "x.yaml");
  EXPECT_THROW(session.save("x.yaml", {1400, 0.3}, false), UserError);
}

// Where a value has no place in the text the config is written anew: not over what somebody wrote.
TEST_F(View, CommentsAreNotOverwritten) {
  crystal();
  std::filesystem::copy_file(folder_ / "crystal.tif", folder_ / "\u00e4.tif");
  write("own.yaml",
        "# mine\n{micrograph: {image: \u00e4.tif}, sample: {crystal: {half_wave_voltage_v: {value: 1400, fit: [1000, "
        "2500]}, "
        "bias_v: 700, field_along: y, electrodes_px: [-0.5, 47.5], field_legendre: [{value: 0.3, fit: [0.1, 0.7]}]}}, "
        "microscope: {light: {wavelength_nm: 1550}, polarizer_deg: 0, analyzer_deg: 90}}\n");
  view::Session session(1);
  session.open(load_config(folder_ / "own.yaml", ConfigUse::fit));
  EXPECT_THROW(session.save("own.yaml", {1480, 0.3}, true), UserError);
  EXPECT_EQ(session.save("other.yaml", {1480, 0.3}, true), folder_ / "other.yaml");
}

TEST_F(View, RowsAreReplacedInTheirPlace) {
  view::Session session(1);
  session.open(crystal());
  session.set_row(0, {"file"}, {"a.tif"});
  const long seen = Json::parse(session.description())["rows_set"];
  session.set_row(0, {"file"}, {"b.tif"});
  EXPECT_NE(Json::parse(session.news(-1, 0, 0))["rows_set"], seen);
  EXPECT_EQ(Json::parse(session.description())["rows"], Json::parse(R"([["b.tif"]])"));
}

TEST(WithStarts, OnlyNumbersChange) {
  const std::string text =
      "a:  # one\n  x: {value: 9.0, fit: [8, 10.5]}   # two\n  y:\n    value: 3\n    fit: [1, 4]\n";
  EXPECT_EQ(with_starts(text, {{"a.x", 8.25, 8, 10.5}, {"a.y", 2.5, 1, 4}}),
            "a:  # one\n  x: {value: 8.25, fit: [8, 10.5]}   # two\n  y:\n    value: 2.5\n    fit: [1, 4]\n");
}

TEST(WithStarts, WhatTheImageWasAskedForIsWrittenDown) {
  EXPECT_EQ(with_starts("a: {x: {fit: auto}}  # c\n", {{"a.x", 7, 5, 9}}), "a: {x: {value: 7, fit: [5, 9]}}  # c\n");
  EXPECT_EQ(with_starts("a:\n  x:\n    fit: auto  # c\n", {{"a.x", 7, 5, 9}}),
            "a:\n  x:\n    value: 7\n    fit: [5, 9]  # c\n");
}

// What stands there is no 1500, whatever its first characters are; and quotes go with the text that they hold.
TEST(WithStarts, ArithmeticAndQuotesGiveWayToTheNumber) {
  for (const char* written : {"1500 + 3", "\"1500 + 3\"", "'1503'"})
    EXPECT_EQ(
        with_starts("a: {x: {value: " + std::string(written) + ", fit: [1, 2000]}}  # c\n", {{"a.x", 1500, 1, 2000}}),
        "a: {x: {value: 1500, fit: [1, 2000]}}  # c\n");
}

TEST(WithStarts, ACentreIsTwoNumbers) {
  const std::vector<NewStart> centre = {{"m.center_px.x", 7, 5, 9}, {"m.center_px.y", 8, 6, 10}};
  const std::string list = "center_px: [{value: 7, fit: [5, 9]}, {value: 8, fit: [6, 10]}]";
  EXPECT_EQ(with_starts("m:\n  g: 1\n  center_px: {fit: auto}  # c\n", centre), "m:\n  g: 1\n  " + list + "  # c\n");
  EXPECT_EQ(with_starts("# top\nm:\n  g: 1  # c\n", centre), "# top\nm:\n  " + list + "\n  g: 1  # c\n");
  EXPECT_EQ(with_starts("m: {g: 1}\n", centre), "m: {" + list + ", g: 1}\n");
  EXPECT_EQ(with_starts("m: {" + list + "}\n", {{"m.center_px.y", 9.5, 6, 10}}),
            "m: {center_px: [{value: 7, fit: [5, 9]}, {value: 9.5, fit: [6, 10]}]}\n");
}

// Umlauts before it, a quoted number, a key that is not there: found all the same, or set without the comments.
TEST(WithStarts, WhateverTheTextLooksLikeTheValueIsThere) {
  for (const char* text :
       {"a: {n: \"\u00e4\u00f6\", x: {value: 9, fit: [1, 20]}}\n", "a: {x: {value: \"9\", fit: [1, 20]}}\n",
        "a: {y: 1}\n", "a: {x: {fit: auto, other: 1}}\n"}) {
    const std::string changed = with_starts(text, {{"a.x", 7.5, 1, 20}});
    EXPECT_THAT(changed, HasSubstr("7.5")) << text;
  }
}

}  // namespace
}  // namespace birefit
