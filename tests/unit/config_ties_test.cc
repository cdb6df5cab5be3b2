// Numbers of a config that are tied to others: what they begin with, what pictures have for themselves, and what is
// refused.

#include <gmock/gmock.h>

#include "birefit/expression.h"
#include "birefit/fit.h"
#include "config_fixture.h"
#include "io/report/explain.h"

namespace birefit {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class ConfigTies : public testing::ConfigFolder {
 protected:
  static constexpr const char* kCell = R"(image_size_px: [8, 8]
sample:
  cell:
    thickness_um: {value: 5, fit: [4, 6]}
    director: {twisted: {twist_deg: 90, azimuth_deg: 10}}
  material: {ordinary: 1.5, birefringence: 0.12}
microscope:
  light: {wavelength_nm: 550}
  polarizer_deg: 20
  analyzer_deg: 110
)";
  static std::string cell(const std::string& from, const std::string& to) { return replaced(kCell, from, to); }
  static double value(const Config& config, const std::string& name) {
    const ParameterRef ref = config.job.parameters.find(name);
    EXPECT_TRUE(ref) << name;
    return ref ? config.job.parameters.values()[static_cast<std::size_t>(ref.index)] : 0;
  }
};

TEST_F(ConfigTies, BeginAsTheExpressionSays) {
  const Config config = load(cell("analyzer_deg: 110", "analyzer_deg: \"microscope.polarizer_deg + 90 * deg\""));
  EXPECT_EQ(value(config, "microscope.analyzer_deg"), 110);
  const ParameterRef analyzer = config.job.parameters.find("microscope.analyzer_deg");
  ASSERT_TRUE(config.job.parameters.tie_of(analyzer.index));
  EXPECT_FALSE(config.job.parameters[analyzer].free);
  EXPECT_EQ(config.job.parameters[analyzer].known_to.of(110), 0);  // as well as what it follows from
  Theta theta = config.job.parameters.values();
  theta[static_cast<std::size_t>(config.job.parameters.find("microscope.polarizer_deg").index)] = 30;
  config.job.parameters.follow(theta);
  EXPECT_EQ(theta[static_cast<std::size_t>(analyzer.index)], 120);
}

TEST_F(ConfigTies, AreExplainedWithWhatIsReported) {
  const Config config = load(cell("analyzer_deg: 110", "analyzer_deg: \"microscope.polarizer_deg + 90 * deg\"") +
                             "report: {retardance_nm: \"sample.cell.thickness_um * sample.material.birefringence\"}\n");
  const Explanation explanation = explain(config, "");
  EXPECT_THAT(explanation_text(config, explanation),
              AllOf(HasSubstr("Tied       microscope.analyzer_deg"), HasSubstr("Reported   retardance_nm")));
  const std::string json = explanation_json(config, explanation);
  const std::string follows = json.substr(json.find("\"follows\""));
  EXPECT_THAT(follows,
              AllOf(HasSubstr("\"tied\": true, \"start\": 110"), HasSubstr("\"tied\": false, \"start\": 600")));
}

TEST_F(ConfigTies, OfUnitsAloneAreNumbers) {
  EXPECT_EQ(value(load(cell("analyzer_deg: 110", "analyzer_deg: \"pi / 2 * rad\"")), "microscope.analyzer_deg"), 90);
  EXPECT_EQ(value(load(cell("{value: 5, fit: [4, 6]}", "\"5000 * nm\"")), "sample.cell.thickness_um"), 5);
}

TEST_F(ConfigTies, TakeTheFormsThatNumbersHaveAndEndsOfPaths) {
  for (const char* form : {"{value: \"polarizer_deg + 90 * deg\"}", "polarizer_deg + 90 * deg",
                           "'microscope.polarizer_deg + pi / 2 * rad'"}) {
    const Config config = load(cell("analyzer_deg: 110", std::string("analyzer_deg: ") + form));
    EXPECT_NEAR(value(config, "microscope.analyzer_deg"), 110, 1e-12) << form;
  }
  // What is not written has its default; a chain of ties; ties before what they follow from.
  const Config config =
      load(cell("twist_deg: 90, azimuth_deg: 10",
                "twist_deg: \"2 * azimuth_deg\", azimuth_deg: \"twisted.pretilt_deg + polarizer_deg\""));
  EXPECT_EQ(value(config, "sample.cell.director.twisted.twist_deg"), 40);
}

TEST_F(ConfigTies, NumbersAloneAreANumber) {
  const Config config = load(cell("ordinary: 1.5", "ordinary: \"3 / 2\""));
  const ParameterRef ordinary = config.job.parameters.find("sample.material.ordinary");
  EXPECT_EQ(config.job.parameters[ordinary].value, 1.5);
  EXPECT_GT(config.job.parameters[ordinary].known_to.of(1.5), 0);
  EXPECT_FALSE(config.job.parameters.tie_of(ordinary.index));
  const Config bounds = load(cell("fit: [4, 6]", "fit: [2 * 2, 12 / 2]"));
  EXPECT_EQ(bounds.job.parameters[bounds.job.parameters.find("sample.cell.thickness_um")].upper, 6);
  EXPECT_THAT(mistakes(cell("ordinary: 1.5", "ordinary: \"1.5\"")), HasSubstr("write it without quotes"));
}

TEST_F(ConfigTies, SayWhatIsWrongAndWhere) {
  EXPECT_EQ(mistakes(cell("analyzer_deg: 110", "analyzer_deg: \"microscope.polarizr_deg + 90 * deg\"")),
            "config.yaml:10:18: microscope.polarizr_deg is no parameter of this config; did you mean "
            "microscope.polarizer_deg?");
  EXPECT_EQ(mistakes(cell("analyzer_deg: 110", "analyzer_deg: 2 * (polarizer_deg + 90 * deg")),
            "config.yaml:10:46: analyzer_deg = 2 * (polarizer_deg + 90 * deg: the parenthesis of column 5 is not "
            "closed; add )");
  EXPECT_EQ(mistakes(cell("analyzer_deg: 110", "analyzer_deg: polarizer_deg + thickness_um")),
            "config.yaml:10:31: deg and um do not add");
  EXPECT_EQ(mistakes(cell("analyzer_deg: 110", "analyzer_deg: polarizer_deg + 90")),
            "config.yaml:10:31: deg and a pure number do not add; give the number its unit: 2 * deg");
  EXPECT_EQ(mistakes(cell("analyzer_deg: 110", "analyzer_deg: 2 * thickness_um")),
            "config.yaml:10:17: the expression is in um, and not in deg");
  EXPECT_THAT(mistakes(cell("ordinary: 1.5", "ordinary: \"sample.material.birefringence * 100\"")),
              HasSubstr("is 12 at the start, outside [1, 4]"));
  EXPECT_THAT(mistakes(cell("ordinary: 1.5", "ordinary: \"1.5 + log(birefringence - 0.12)\"")),
              HasSubstr("is no number at the start"));
  EXPECT_THAT(mistakes(cell("ordinary: 1.5", "ordinary: {value: \"2 * birefringence\", fit: [1, 2]}")),
              HasSubstr("ordinary is tied to other numbers and has fit"));
  EXPECT_THAT(mistakes(cell("[8, 8]", "[\"2 * polarizer_deg\", 8]")), HasSubstr("an expression that reads others"));
}

// A number that a table sets for all of its rows may follow from what each row has.
TEST_F(ConfigTies, ATablesOwnNumberFollowsItsRows) {
  write("t.csv", "angle,out\n0,0.1\n30,0.4\n60,0.3\n");
  const std::string text =
      replaced(kCell, "image_size_px: [8, 8]\n",
               "signal: {file: t.csv, value: out, noise: 0.01, columns: {microscope.polarizer_deg: angle},\n"
               "  set: {microscope.analyzer_deg: \"microscope.polarizer_deg + 90 * deg\"}}\n");
  const Config config = load(text, ConfigUse::fit);
  const Theta theta = config.job.parameters.values();
  const Readings& table = std::get<Readings>(config.job.measurements.at(0));
  ASSERT_EQ(table.rows.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(table.rows[i].microscope.polarizer_deg.in(theta), 30.0 * static_cast<double>(i));
    EXPECT_EQ(table.rows[i].microscope.analyzer_deg.in(theta), 30.0 * static_cast<double>(i) + 90);
  }
}

TEST_F(ConfigTies, ACircleThroughATablesOwnNumberIsNamed) {
  write("t.csv", "angle,out\n0,0.1\n30,0.4\n60,0.3\n");
  const std::string text =
      replaced(kCell, "image_size_px: [8, 8]\n",
               "signal: {file: t.csv, value: out, noise: 0.01, columns: {microscope.analyzer_deg: angle},\n"
               "  set: {sample.cell.thickness_um: \"2 * polarizer_deg / deg * um\"}}\n");
  EXPECT_THAT(
      mistakes(replaced(text, "polarizer_deg: 20", "polarizer_deg: \"thickness_um / um * deg\""), ConfigUse::fit),
      HasSubstr("tied in a circle"));
}

// Rows share what their wavelengths may be off by: the law's range is one of wavelengths all the same.
TEST_F(ConfigTies, RowsThatShareAZeroStayWithinALawsRange) {
  std::string rows = "nm,out\n";
  for (int i = 0; i < 9; ++i) rows += std::to_string(480 + 20 * i) + "," + std::to_string(0.2 + 0.07 * i) + "\n";
  write("t.csv", rows);
  std::string text =
      replaced(kCell, "image_size_px: [8, 8]\n",
               "signal: {file: t.csv, value: out, noise: 0.01, columns: {microscope.light.wavelength_nm: nm}}\n");
  text = replaced(text, "{ordinary: 1.5, birefringence: 0.12}", "{name: 5CB-li2005}");
  const Config config = load(text, ConfigUse::fit);
  EXPECT_NO_THROW(fit(config.job));
}

TEST_F(ConfigTies, QuantitiesAreInTheUnitThatTheirNamesEndIn) {
  const auto reported = [&](const std::string& name, const std::string& law) {
    const Config config = load(kCell + ("report: {" + name + ": \"" + law + "\"}\n"));
    const Derived& derived = config.job.derived.at(0);
    return std::pair(derived.unit, config.job.parameters.value_of(derived.tie, config.job.parameters.values()));
  };
  EXPECT_EQ(reported("p_pa", "3 * MPa").first, "Pa");
  EXPECT_NEAR(reported("p_pa", "3 * MPa").second, 3e6, 1e-3);
  EXPECT_NEAR(reported("drive_kv", "1638 * V").second, 1.638, 1e-12);
  EXPECT_NEAR(reported("drive_mv", "2 * V").second, 2000, 1e-9);
  EXPECT_NEAR(reported("area_mm2", "(1000 * um) * (1000 * um)").second, 1, 1e-12);
  EXPECT_THAT(mistakes(kCell + std::string("report: {a_kv: thickness_um}\n")), HasSubstr("not in kV"));
}

TEST_F(ConfigTies, NameTheCircle) {
  const std::string text =
      cell("twist_deg: 90, azimuth_deg: 10", "twist_deg: 2 * azimuth_deg, azimuth_deg: twist_deg / 2");
  EXPECT_THAT(
      mistakes(text),
      HasSubstr("tied in a circle: sample.cell.director.twisted.twist_deg from "
                "sample.cell.director.twisted.azimuth_deg from sample.cell.director.twisted.twist_deg; give one "
                "of them as a number"));
  EXPECT_THAT(mistakes(cell("azimuth_deg: 10", "azimuth_deg: 2 * azimuth_deg")), HasSubstr("tied in a circle"));
}

TEST_F(ConfigTies, AskForMoreOfAnEndThatSeveralPathsHave) {
  const std::string text = replaced(cell("analyzer_deg: 110", "analyzer_deg: 2 * azimuth_deg"), "polarizer_deg: 20",
                                    "polarizer_deg: 20\n  behind: [{quarter_wave: {azimuth_deg: 45}}]");
  EXPECT_THAT(mistakes(text), HasSubstr("azimuth_deg is the end of several names: microscope.behind[1]"));
}

TEST_F(ConfigTies, CannotFollowWhatIsSolvedFor) {
  const std::string gain = replaced(kCell, "image_size_px", "micrograph: {gain: 3}\nimage_size_px");
  EXPECT_THAT(mistakes(replaced(gain, "ordinary: 1.5", "ordinary: micrograph.gain / 2")),
              HasSubstr("micrograph.gain is solved for once all else is known: nothing can be tied to it"));
  EXPECT_THAT(mistakes(replaced(gain, "gain: 3", "gain: 2 * sample.material.ordinary")),
              HasSubstr("gain is solved for once all else is known: it cannot be tied"));
}

TEST_F(ConfigTies, GiveWayToANumberOnTheCommandLine) {
  const auto path = write("config.yaml", cell("analyzer_deg: 110", "analyzer_deg: polarizer_deg + 90 * deg"));
  const Config plain = load_config(path, ConfigUse::render, std::nullopt, {"microscope.analyzer_deg=7"});
  EXPECT_EQ(value(plain, "microscope.analyzer_deg"), 7);
  EXPECT_TRUE(plain.job.parameters.tied().empty());
  const Config moved = load_config(path, ConfigUse::render, std::nullopt, {"microscope.polarizer_deg=7"});
  EXPECT_EQ(value(moved, "microscope.analyzer_deg"), 97);
  const Config tied =
      load_config(path, ConfigUse::render, std::nullopt, {"sample.material.ordinary=1 + 4 * birefringence"});
  EXPECT_DOUBLE_EQ(value(tied, "sample.material.ordinary"), 1.48);
}

/// A fit of pictures of one size.
class PicturesWithTies : public ConfigTies {
 protected:
  std::string pictures(const std::string& list, const std::string& from, const std::string& to) {
    save("a.tif", counts(100, 1, 8, 8));
    save("b.tif", counts(200, 2, 8, 8));
    return replaced(cell(from, to), "image_size_px: [8, 8]\n", "micrographs:\n" + list);
  }
};

TEST_F(PicturesWithTies, HaveTheirOwnOfWhatIsTiedToTheirOwn) {
  const std::string text = pictures(
      "  - {image: a.tif, set: {microscope.polarizer_deg: 0}}\n  - {image: b.tif, set: {microscope.polarizer_deg: "
      "45}}\n",
      "analyzer_deg: 110", "analyzer_deg: polarizer_deg + 90 * deg");
  const Config config = load(text, ConfigUse::fit);
  EXPECT_EQ(value(config, "micrographs[0].microscope.analyzer_deg"), 90);
  EXPECT_EQ(value(config, "micrographs[1].microscope.analyzer_deg"), 135);
  const Theta theta = config.job.parameters.values();
  EXPECT_EQ(std::get<Picture>(config.job.measurements[1]).scene.microscope.analyzer_deg.in(theta), 135);
  // The shared one, which nothing reads, is no number of this fit.
  EXPECT_EQ(config.job.parameters.tied().size(), 2u);
}

TEST_F(PicturesWithTies, MayTieAPicturesNumberToAnothers) {
  const std::string text = pictures(
      "  - {image: a.tif, set: {sample.cell.thickness_um: \"micrographs[1].sample.cell.thickness_um / 2\"}}\n"
      "  - {image: b.tif, set: {sample.cell.thickness_um: {value: 5, fit: [4, 6]}, "
      "microscope.polarizer_deg: \"sample.cell.thickness_um * 4 * deg / um\"}}\n",
      "    thickness_um: {value: 5, fit: [4, 6]}\n", "");
  const Config config = load(text, ConfigUse::fit);
  EXPECT_EQ(value(config, "micrographs[0].sample.cell.thickness_um"), 2.5);
  EXPECT_EQ(value(config, "micrographs[1].microscope.polarizer_deg"), 20);  // of its own thickness
  EXPECT_TRUE(config.job.parameters[config.job.parameters.find("micrographs[1].sample.cell.thickness_um")].free);
}

TEST_F(PicturesWithTies, LetTheSharedNumberActThroughThem) {
  const std::string text = pictures(
      "  - {image: a.tif, set: {sample.cell.thickness_um: sample.cell.thickness_um / 2}}\n"
      "  - {image: b.tif, set: {sample.cell.thickness_um: \"1.5 * sample.cell.thickness_um\"}}\n",
      "wavelength_nm: 550", "wavelength_nm: 550");
  // In a picture's own number its name is the shared one, which nothing but the ties reads.
  const Config config = load(text, ConfigUse::fit);
  EXPECT_EQ(value(config, "micrographs[0].sample.cell.thickness_um"), 2.5);
  EXPECT_EQ(value(config, "micrographs[1].sample.cell.thickness_um"), 7.5);
  EXPECT_TRUE(config.job.parameters[config.job.parameters.find("sample.cell.thickness_um")].free);
  EXPECT_THAT(mistakes(replaced(text, "    thickness_um: {value: 5, fit: [4, 6]}\n", ""), ConfigUse::fit),
              HasSubstr("sample.cell.thickness_um differs from picture to picture, and "
                        "micrographs[0].sample.cell.thickness_um does not"));
}

// Shared numbers may follow from each other one way, and a picture's own the other way round.
TEST_F(PicturesWithTies, ACircleThroughAPicturesOwnNumberIsNamed) {
  const std::string list =
      "  - {image: a.tif, set: {sample.cell.thickness_um: \"2 * polarizer_deg / deg * um\"}}\n  - {image: b.tif}\n";
  EXPECT_THAT(
      mistakes(pictures(list, "polarizer_deg: 20", "polarizer_deg: \"thickness_um / um * deg\""), ConfigUse::fit),
      HasSubstr("tied in a circle"));
}

TEST_F(PicturesWithTies, AskWhichPicturesNumberIsReported) {
  const std::string list =
      "  - {image: a.tif, set: {microscope.polarizer_deg: 0}}\n  - {image: b.tif, set: {microscope.polarizer_deg: "
      "45}}\n";
  const std::string text = pictures(list, "analyzer_deg: 110", "analyzer_deg: 110");
  EXPECT_THAT(mistakes(text + "report: {angle_deg: \"2 * polarizer_deg\"}\n", ConfigUse::fit),
              HasSubstr("polarizer_deg differs from picture to picture; name one: "
                        "micrographs[0].microscope.polarizer_deg"));
  EXPECT_EQ(mistakes(text + "report: {angle_deg: \"2 * micrographs[1].microscope.polarizer_deg\"}\n", ConfigUse::fit),
            "");
}

TEST_F(ConfigTies, ReportTakesItsUnitFromItsName) {
  const auto derived = [&](const std::string& report) {
    const Config config = load(std::string(kCell) + "report: {" + report + "}\n");
    EXPECT_EQ(config.job.derived.size(), 1u);
    const Derived& one = config.job.derived.at(0);
    return std::pair(config.job.parameters.value_of(one.tie, config.job.parameters.values()), one.unit);
  };
  const auto [nm, unit] = derived("retardance_nm: \"thickness_um * birefringence\"");
  EXPECT_DOUBLE_EQ(nm, 600);
  EXPECT_EQ(unit, "nm");
  EXPECT_EQ(derived("retardance: \"thickness_um * birefringence\"").second, "um");
  EXPECT_EQ(derived("waves: \"thickness_um * birefringence / wavelength_nm\"").second, "");
  EXPECT_EQ(derived("same: \"sample.cell.thickness_um\"").first, 5);
  // One letter is a unit of what has one.
  EXPECT_EQ(derived("delta_n: \"birefringence\"").second, "");
  EXPECT_EQ(derived("turn_rad: \"polarizer_deg\"").second, "rad");
  const std::string text = kCell;
  EXPECT_EQ(mistakes(text + "report: {retardance_deg: \"thickness_um * birefringence\"}\n"),
            "config.yaml:11:27: the expression is in um, and not in deg");
  EXPECT_THAT(mistakes(text + "report: {r: \"thicknes_um * 2\"}\n"), HasSubstr("11:14: thicknes_um is no parameter"));
  EXPECT_THAT(mistakes(text + "report: {r: \"2 *\"}\n"), HasSubstr("report.r: the expression ends where"));
  EXPECT_THAT(mistakes(text + "report: {\"<b>\": \"2 * um\"}\n"), HasSubstr("letters, digits and _ only"));
  EXPECT_THAT(mistakes(text + "report: [1]\n"), HasSubstr("report must be a map of names and expressions"));
}

TEST_F(ConfigTies, RowsOfATableHaveTheirOwn) {
  write("sweep.csv", "volts,signal\n1,10\n2,12\n3,17\n4,11\n");
  const Config config = load(R"(
signal:
  file: sweep.csv
  columns: {microscope.polarizer_deg: {column: volts, scale: 10}}
sample:
  cell: {thickness_um: {value: 5, fit: [4, 6]}, director: {twisted: {twist_deg: 90}}}
  material: {ordinary: 1.5, birefringence: 0.12}
microscope:
  light: {wavelength_nm: 550}
  analyzer_deg: "polarizer_deg + 90 * deg"
)",
                             ConfigUse::fit);
  const Readings& readings = std::get<Readings>(config.job.measurements.at(0));
  const Theta theta = config.job.parameters.values();
  ASSERT_EQ(readings.rows.size(), 4u);
  for (int k = 0; k < 4; ++k)
    EXPECT_DOUBLE_EQ(readings.rows[static_cast<std::size_t>(k)].microscope.analyzer_deg.in(theta), 100 + 10 * k);
}

}  // namespace
}  // namespace birefit
