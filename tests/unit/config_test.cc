// What load_config accepts, refuses and makes of a config. Bad input through the whole program: tests/cli/bad_input.sh.

#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "config_fixture.h"
#include "pictures.h"

namespace birefit {
namespace {
using namespace std::string_literals;

namespace fs = std::filesystem;

using ConfigFile = testing::ConfigFolder;

const std::string kRender = R"(image_size_px: [64, 48]
micrograph: {pixel_size_um: 0.25}
sample:
  droplet: {diameter_um: {value: 9.3, fit: [8.5, 10]}, director: {radial: {}}}
  material: {ordinary: 1.52, birefringence: {value: 0.2, fit: [0.1, 0.3], prior_sd: 0.05}}
  surround: {index: 1.43}
microscope: {light: {wavelength_nm: 590}, polarizer_deg: 0, analyzer_deg: 90, objective_na: 0.8}
)";

const std::string kCrystal = R"(micrographs:
  - {image: a.tif, set: {sample.crystal.bias_v: 200}}
  - {image: b.tif, set: {sample.crystal.bias_v: {value: 250, fit: [0, 2000]}}}
micrograph: {roi_px: [2, 4, 30, 28]}
sample: {crystal: {half_wave_voltage_v: {value: 1500, fit: [800, 3000]}, field_along: y}}
microscope: {light: {wavelength_nm: 1550}, polarizer_deg: 0, analyzer_deg: 90}
)";

TEST_F(ConfigFile, ReadsTheThreeFormsOfAParameter) {
  const auto config = load(kRender);
  const ParameterTable& table = config.job.parameters;
  const Parameter& known = table[table.find("sample.material.ordinary")];
  EXPECT_FALSE(known.free);
  EXPECT_EQ(known.value, 1.52);
  const Parameter& fitted = table[table.find("sample.droplet.diameter_um")];
  EXPECT_TRUE(fitted.free);
  EXPECT_EQ(fitted.value, 9.3);
  EXPECT_EQ(fitted.lower, 8.5);
  EXPECT_EQ(fitted.upper, 10);
  EXPECT_EQ(fitted.unit, "um");
  EXPECT_EQ(fitted.physical_lower, 0);
  EXPECT_FALSE(fitted.prior_sd);
  const Parameter& prior = table[table.find("sample.material.birefringence")];
  EXPECT_EQ(prior.prior_sd, 0.05);
}

TEST_F(ConfigFile, RemembersWhereAParameterStands) {
  const auto config = load(kRender);
  const Parameter& parameter = config.job.parameters[config.job.parameters.find("sample.material.ordinary")];
  EXPECT_EQ(parameter.where.line, 5);
  EXPECT_EQ(parameter.where.column, 24);
}

TEST_F(ConfigFile, PutsTheCentreInTheMiddleOfARender) {
  const auto config = load(kRender);
  const Theta theta = config.job.parameters.values();
  EXPECT_EQ(theta[config.scene.view.center_x_px.index], 31.5);
  EXPECT_EQ(theta[config.scene.view.center_y_px.index], 23.5);
  EXPECT_EQ(config.scene.view.width, 64);
  EXPECT_EQ(config.scene.view.height, 48);
}

TEST_F(ConfigFile, AcceptsBothSpellingsOfPolarizerAndAnalyzer) {
  const auto config = load(replaced(replaced(kRender, "polarizer", "polariser"), "analyzer", "analyser"));
  EXPECT_TRUE(config.job.parameters.find("microscope.analyzer_deg"));
  EXPECT_NE(mistakes(replaced(kRender, "polarizer_deg: 0", "polarizer_deg: 0, polariser_deg: 1")).find("same key"),
            std::string::npos);
}

TEST_F(ConfigFile, NamesTheNearestKnownKey) {
  EXPECT_EQ(mistakes(replaced(kRender, "diameter_um", "diametr_um")),
            "config.yaml:4:13: unknown key diametr_um in sample.droplet; did you mean diameter_um?");
}

TEST_F(ConfigFile, SuggestsTheKeyWithItsUnit) {
  EXPECT_NE(mistakes(replaced(kRender, "diameter_um", "diameter")).find("did you mean diameter_um?"),
            std::string::npos);
}

TEST_F(ConfigFile, ReportsEveryMistakeOnceFromTopToBottom) {
  std::string text = replaced(kRender, "[64, 48]", "[0, 48]");
  text = replaced(text, "9.3, fit", "-9.3, fit");
  text = replaced(text, "1.43", "14.3");
  text = replaced(text, "590", "0.59");
  EXPECT_EQ(mistakes(text),
            "config.yaml:1:16: image_size_px must be within [1, 16384]\n"
            "config.yaml:4:34: diameter_um = -9.3 is outside (0, 10000]; did you mean 9.3?\n"
            "config.yaml:6:21: index = 14.3 is outside [1, 4]\n"
            "config.yaml:7:37: wavelength_nm = 0.59 is outside [100, 20000]; did you mean 590? the key is in nm");
}

TEST_F(ConfigFile, RefusesNumbersThatAreNone) {
  for (const char* word :
       {".nan", "nan", ".inf", "-.inf", "1e999", "0x10", "1_000", "abc", "\"590\"", "true", "[590]", "", "5 90"})
    EXPECT_NE(mistakes(replaced(kRender, "590", word)).find("wavelength_nm"), std::string::npos) << word;
}

TEST_F(ConfigFile, UnderstandsADecimalCommaAndAUnitInTheValue) {
  EXPECT_NE(mistakes(replaced(kRender, "{light: {wavelength_nm: 590}", "{light: {wavelength_nm: 590nm}"))
                .find("did you mean 590?"),
            std::string::npos);
  const std::string block = "accuracy:\n  intensity: 0,01\n";
  EXPECT_NE(mistakes(kRender + block).find("did you mean 0.01? write a decimal point"), std::string::npos);
}

TEST_F(ConfigFile, RefusesBoundsThatExcludeTheStart) {
  EXPECT_NE(mistakes(replaced(kRender, "value: 9.3", "value: 11"))
                .find("diameter_um = 11 is outside its fit bounds [8.5, 10]"),
            std::string::npos);
}

TEST_F(ConfigFile, AllowsABoundAtThePhysicalLimit) {
  EXPECT_EQ(mistakes(replaced(kRender, "[8.5, 10]", "[0, 10]")), "");
}

TEST_F(ConfigFile, StatesHowWellANumberIsKnown) {
  const auto known_to = [&](const std::string& wavelength) {
    const Config config =
        load(replaced(kRender, "wavelength_nm: 590", "wavelength_nm: " + wavelength), ConfigUse::render);
    const Parameter& p = config.job.parameters[config.scene.microscope.wavelength_nm];
    return p.known_to.of(p.value);
  };
  EXPECT_NEAR(known_to("590"), 0.003 * 590, 1e-12);
  EXPECT_NEAR(known_to("{value: 600}"), 0.003 * 600, 1e-12);
  EXPECT_EQ(known_to("{value: 590, prior_sd: 4}"), 4);
  EXPECT_EQ(known_to("{value: 590, exact: true}"), 0);
  EXPECT_NE(mistakes(replaced(kRender, "wavelength_nm: 590", "wavelength_nm: {value: 590, exact: true, prior_sd: 1}"))
                .find("is exact and has a prior_sd"),
            std::string::npos);
  EXPECT_NE(mistakes(replaced(kRender, "wavelength_nm: 590", "wavelength_nm: {value: 590, exact: quite}"))
                .find("exact must be true or false"),
            std::string::npos);
  EXPECT_NE(
      mistakes(replaced(kRender, "wavelength_nm: 590", "wavelength_nm: {value: 590, fit: [500, 600], exact: true}"))
          .find("is fitted and exact"),
      std::string::npos);
}

TEST_F(ConfigFile, RefusesAliases) {
  EXPECT_NE(mistakes("a: &x 1\nb: *x\n").find("config.yaml:1:4: anchors and aliases are not supported"),
            std::string::npos);
}

TEST_F(ConfigFile, RefusesDeepNestingOfEveryKind) {
  for (const std::string& unit : {std::string("["), std::string("{a: "), std::string("- ")}) {
    std::string text = "sample:\n  ";
    for (int i = 0; i < 10000; ++i) text += unit;
    EXPECT_NE(mistakes(text).find("nested deeper than 64 levels"), std::string::npos) << unit;
  }
}

TEST_F(ConfigFile, CountsNoBracketsInQuotesAndComments) {
  const std::string brackets(100, '[');
  EXPECT_EQ(mistakes(kRender + "# " + brackets + "\n"), "");
  EXPECT_NE(mistakes(kRender + "extra: \"" + brackets + "\"\n").find("unknown key extra"), std::string::npos);
}

TEST_F(ConfigFile, WavesNeedAnApertureAndASphere) {
  const std::string without = replaced(kRender, ", objective_na: 0.8", ""), &with_objective = kRender;
  EXPECT_NE(mistakes(without + "physics: {ceiling: wave}\n").find("ceiling: wave needs microscope.objective_na"),
            std::string::npos);
  EXPECT_EQ(mistakes(with_objective + "physics: {ceiling: wave}\n"), "");
  EXPECT_NE(mistakes(with_objective + "physics: {ceiling: wave, rays: straight}\n").find("rays has no meaning"),
            std::string::npos);
  EXPECT_NE(mistakes(with_objective + "physics: {max_seconds: -1}\n").find("max_seconds"), std::string::npos);
  const std::string defocused = replaced(with_objective, "objective_na: 0.8", "objective_na: 0.8, focus_um: 2");
  EXPECT_EQ(mistakes(defocused), "");
  EXPECT_NE(mistakes(defocused + "physics: {ceiling: one_way}\n").find("defocus needs wave optics"), std::string::npos);
}

// The file is missing too: all mistakes are told at once.
TEST_F(ConfigFile, WavesOfASampledFieldNeedApertureAndSurround) {
  const std::string rays =
      "image_size_px: [8, 8]\nmicrograph: {pixel_size_um: 0.1}\n"
      "sample:\n  volume: {file: none.npy, spacing_um: [0.1, 0.1, 0.1]}\n  material: {ordinary: 1.52, birefringence: "
      "0.1}\n"
      "microscope: {light: {wavelength_nm: 590}, polarizer_deg: 0, analyzer_deg: 90}\n";
  const std::string told = mistakes(rays + "physics: {ceiling: wave}\n");
  EXPECT_NE(told.find("ceiling: wave needs sample.surround"), std::string::npos) << told;
  EXPECT_NE(told.find("ceiling: wave needs microscope.objective_na"), std::string::npos) << told;
  const std::string complete =
      replaced(replaced(rays, "0.1}\nmicroscope", "0.1}\n  surround: {index: 1.5}\nmicroscope"), "analyzer_deg: 90}",
               "analyzer_deg: 90, objective_na: 0.5}");
  EXPECT_EQ(mistakes(complete + "physics: {ceiling: wave}\n").find("ceiling"), std::string::npos);
  EXPECT_EQ(mistakes(rays).find("surround"), std::string::npos);
  EXPECT_EQ(mistakes(complete).find("surround"), std::string::npos);  // rays leave it alone
}

TEST_F(ConfigFile, SpheresWithAnApertureAreDoneByWavesUnlessToldOtherwise) {
  const std::string without = replaced(kRender, ", objective_na: 0.8", ""), &with_objective = kRender;
  const auto ceiling = [&](const std::string& text) { return load(text).job.demand.ceiling; };
  EXPECT_EQ(ceiling(without), Ceiling::one_way);
  EXPECT_EQ(ceiling(with_objective), Ceiling::wave);
  EXPECT_EQ(ceiling(with_objective + "physics: {rays: straight}\n"), Ceiling::one_way);
  EXPECT_EQ(ceiling(with_objective + "physics: {max_seconds: 0}\n"), Ceiling::one_way);
  EXPECT_EQ(ceiling(with_objective + "transport: {method: diagonal}\n"), Ceiling::one_way);
  // What only waves can do is no matter of cost.
  EXPECT_EQ(ceiling(with_objective + "transport: {method: split_step}\nphysics: {max_seconds: 0}\n"), Ceiling::wave);
  EXPECT_EQ(ceiling(replaced(with_objective, "objective_na: 0.8", "objective_na: 0.8, focus_um: 2") +
                    "physics: {max_seconds: 0}\n"),
            Ceiling::wave);
}

TEST_F(ConfigFile, SaysWhatComesLater) {
  EXPECT_NE(mistakes(kRender + "physics: {ceiling: reflections}\n").find("cells and slabs"), std::string::npos);
}

TEST_F(ConfigFile, ListsTheKnownMaterials) {
  const std::string text = R"(image_size_px: [8, 8]
sample:
  cell: {thickness_um: 5, director: {uniform: {azimuth_deg: 45}}}
  material: {name: unobtainium}
microscope: {light: {wavelength_nm: 590}, polarizer_deg: 0, analyzer_deg: 90}
)";
  EXPECT_NE(mistakes(text).find("E44-steinberg2020"), std::string::npos);
}

TEST_F(ConfigFile, NeedsAPixelSizeForADroplet) {
  EXPECT_NE(mistakes(replaced(kRender, "{pixel_size_um: 0.25}", "{}")).find("pixel_size_um"), std::string::npos);
}

TEST_F(ConfigFile, RefusesADropletOfAnotherScaleThanTheImage) {
  EXPECT_NE(mistakes(replaced(kRender, "{value: 9.3, fit: [8.5, 10]}", "9300")).find("did you mean 9.3?"),
            std::string::npos);
  EXPECT_NE(mistakes(replaced(kRender, "{value: 9.3, fit: [8.5, 10]}", "0.0093")).find("did you mean 9.3?"),
            std::string::npos);
}

TEST_F(ConfigFile, GivesTheCrystalItsSlowAxisHalfwayFromTheField) {
  const std::string text = R"(image_size_px: [8, 8]
sample:
  {crystal: {half_wave_voltage_v: 1500, bias_v: 700, field_along: x, field_legendre: [0.1, {value: 0, fit: [-1, 1]}]}}
microscope: {light: {wavelength_nm: 1550}, polarizer_deg: 0, analyzer_deg: 90}
)";
  const auto config = load(text);
  const auto& crystal = std::get<Crystal>(config.scene.sample);
  EXPECT_EQ(config.job.parameters[crystal.slow_axis_deg].value, 45);
  EXPECT_FALSE(crystal.electrode_low_px);
  EXPECT_TRUE(config.job.parameters[config.job.parameters.find("sample.crystal.field_legendre[2]")].free);
}

TEST_F(ConfigFile, SharesWhatNoMicrographSets) {
  save("a.tif", counts(100, 1));
  save("b.tif", counts(200, 2));
  const auto config = load(kCrystal, ConfigUse::fit);
  ASSERT_EQ(config.job.measurements.size(), 2u);
  const auto& a = picture(config.job, 0);
  const auto& b = picture(config.job, 1);
  const auto& table = config.job.parameters;
  const auto &first = std::get<Crystal>(a.scene.sample), &second = std::get<Crystal>(b.scene.sample);
  EXPECT_EQ(first.half_wave_voltage_v, second.half_wave_voltage_v);
  EXPECT_EQ(a.gain, b.gain);
  EXPECT_EQ(table[first.bias_v].value, 200);
  EXPECT_FALSE(table[first.bias_v].free);
  EXPECT_EQ(table[second.bias_v].name, "micrographs[1].sample.crystal.bias_v");
  EXPECT_TRUE(table[second.bias_v].free);
  EXPECT_EQ(table[second.bias_v].physical_lower, 0);
  EXPECT_TRUE(table[a.gain].linear && table[a.gain].free && table[a.gain].automatic);
  // The bar's edges are the electrodes: rows 4..27, edge to edge.
  EXPECT_EQ(table[first.electrode_low_px].value, 3.5);
  EXPECT_EQ(table[first.electrode_high_px].value, 27.5);
  EXPECT_EQ(a.outside_roi, 32 * 32 - 28 * 24);
}

// Two pictures of one droplet, each with a focus of its own: what a scene reads is an unknown where it is to be fitted,
// and may be set for an image.
TEST_F(ConfigFile, TheFocusIsAParameterLikeAnyOther) {
  save("a.tif", counts(100, 1));
  save("b.tif", counts(200, 2));
  const std::string one = replaced(kRender, "image_size_px: [64, 48]\n", ""),
                    fitted =
                        replaced(one, "objective_na: 0.8", "objective_na: 0.8, focus_um: {value: 0.5, fit: [-2, 2]}");
  const auto alone = load(replaced(fitted, "{pixel_size_um", "{image: a.tif, pixel_size_um"), ConfigUse::fit);
  EXPECT_TRUE(alone.job.parameters[picture(alone.job, 0).scene.microscope.focus_um].free);
  const auto two =
      load("micrographs:\n  - {image: a.tif}\n  - {image: b.tif, set: {microscope.focus_um: -1}}\n" + fitted,
           ConfigUse::fit);
  const ParameterTable& table = two.job.parameters;
  const ParameterRef a = picture(two.job, 0).scene.microscope.focus_um,
                     b = picture(two.job, 1).scene.microscope.focus_um;
  EXPECT_TRUE(table[a].free);
  EXPECT_EQ(table[a].value, 0.5);
  EXPECT_FALSE(table[b].free);
  EXPECT_EQ(table[b].value, -1);
  // The shared one on the mid plane, one image's not: waves, or an error.
  const std::string own = "micrographs:\n  - {image: a.tif}\n  - {image: b.tif, set: {microscope.focus_um: -1}}\n" +
                          replaced(one, "objective_na: 0.8", "objective_na: 0.8, focus_um: 0");
  EXPECT_EQ(load(own + "physics: {max_seconds: 0}\n", ConfigUse::fit).job.demand.ceiling, Ceiling::wave);
  EXPECT_NE(mistakes(own + "physics: {ceiling: one_way}\n", ConfigUse::fit).find("defocus needs wave optics"),
            std::string::npos);
}

// A camera's own curve, here light = code^2, by a table: values are proportional to light, whatever its unit.
TEST_F(ConfigFile, LinearisesByACurve) {
  const Image codes = counts(100, 1);
  save("a.tif", codes);
  save("b.tif", counts(200, 2));
  std::string curve = "code,light\n";
  for (int code = 0; code <= 400; code += 10)
    curve += std::to_string(code) + "," + std::to_string(3 * code * code) + "\n";
  write("curve.csv", curve);
  const std::string with = replaced(kCrystal, "[2, 4, 30, 28]}", "[2, 4, 30, 28], transfer: {file: curve.csv}}");
  const auto config = load(with, ConfigUse::fit);
  const Image& light = picture(config.job, 0).values;
  ASSERT_EQ(light.width(), 28);
  const auto square_of = [&](int x, int y) { return codes(x + 2, y + 4) * codes(x + 2, y + 4); };
  const double scale = light(0, 0) / square_of(0, 0);
  for (int y = 0; y < light.height(); ++y)
    for (int x = 0; x < light.width(); ++x)
      EXPECT_NEAR(light(x, y) / square_of(x, y), scale, 1e-3 * scale) << x << " " << y;
  EXPECT_EQ(config.inputs.size(), 3u);
  write("curve.csv", "code,light\n0,0\n100,5\n200,4\n");
  EXPECT_NE(mistakes(with, ConfigUse::fit).find("curve.csv:4: neither code nor light may fall"), std::string::npos)
      << mistakes(with, ConfigUse::fit);
  write("curve.csv", "counts,light\n0,0\n100,5\n200,9\n");
  EXPECT_NE(mistakes(with, ConfigUse::fit).find("two columns, code and light"), std::string::npos);
}

TEST_F(ConfigFile, ReadsUnevenLightAndGivesAFrameItsOwn) {
  save("a.tif", counts(100, 1));
  save("b.tif", counts(200, 2));
  const auto with = [](const std::string& text) { return "micrograph: {roi_px: [2, 4, 30, 28], " + text + "}\n"; };
  const std::string plain = "micrograph: {roi_px: [2, 4, 30, 28]}\n",
                    uneven = with("illumination: {x: {fit: auto}, square: -20}, background: {y: {fit: auto}}");
  const std::string frame = replaced(kCrystal, "set: {sample.crystal.bias_v: 200}",
                                     "set: {sample.crystal.bias_v: 200, micrograph.background.y: {fit: auto}}");
  const auto config = load(replaced(frame, plain, uneven), ConfigUse::fit);
  const ParameterTable& table = config.job.parameters;
  const auto &a = picture(config.job, 0).uneven, &b = picture(config.job, 1).uneven;
  ASSERT_EQ(a.size(), 3u);
  EXPECT_EQ(table[a[0].coefficient].name, "micrograph.illumination.x");
  EXPECT_TRUE(a[0].of_intensity && table[a[0].coefficient].free && table[a[0].coefficient].linear);
  EXPECT_EQ(a[0].shape, UnevenLight::Shape::x);
  EXPECT_EQ(table[a[0].coefficient].value, 0);
  EXPECT_EQ(a[1].shape, UnevenLight::Shape::square);
  EXPECT_FALSE(table[a[1].coefficient].free);
  EXPECT_EQ(table[a[1].coefficient].value, -20);
  EXPECT_FALSE(a[2].of_intensity);
  EXPECT_EQ(a[0].coefficient, b[0].coefficient);
  // One of the frames has a background of its own, whichever `set` named it.
  EXPECT_FALSE(a[2].coefficient == b[2].coefficient);
  EXPECT_NE(mistakes(replaced(frame, plain, with("background: {z: 1}")), ConfigUse::fit)
                .find("unknown key z in micrograph.background"),
            std::string::npos);
}

TEST_F(ConfigFile, KnowsTheParametersThatSetMayName) {
  save("a.tif", counts(100, 1));
  save("b.tif", counts(200, 2));
  EXPECT_NE(mistakes(replaced(kCrystal, "set: {sample.crystal.bias_v: 200}", "set: {sample.crystal.bias: 200}"),
                     ConfigUse::fit)
                .find("did you mean sample.crystal.bias_v?"),
            std::string::npos);
}

TEST_F(ConfigFile, TurnsCountsIntoTransmission) {
  Image dark(32, 32, 100), parallel(32, 32, 1100), crossed(32, 32, 120), image(32, 32, 600);
  parallel(10, 12) = 100;  // no light here
  for (auto& [name, frame] : {std::pair<const char*, Image&>("d.tif", dark),
                              {"p.tif", parallel},
                              {"c.tif", crossed},
                              {"a.tif", image},
                              {"b.tif", image}})
    save(name, frame);
  const auto config = load(kCrystal + "calibration: {dark: d.tif, parallel: p.tif, crossed: c.tif}\n", ConfigUse::fit);
  const Picture& a = picture(config.job, 0);
  EXPECT_DOUBLE_EQ(a.values(9, 8), 0.5);
  EXPECT_DOUBLE_EQ(a.variance_scale(9, 8), 1e-6);
  EXPECT_EQ(a.mask(10 - 2, 12 - 4), 0);  // the picture is the region
  EXPECT_EQ(a.dead, 1);
  const Parameter& offset = config.job.parameters[a.offset];
  EXPECT_DOUBLE_EQ(offset.value, 0.02);
  ASSERT_TRUE(offset.prior_sd);
  EXPECT_GT(*offset.prior_sd, 0);
}

TEST_F(ConfigFile, ExcludesAndCountsNonFiniteAndIsolatedPixels) {
  Image a = counts(100, 1), b = counts(200, 2);
  a(10, 10) = std::nan("");
  a(20, 20) = 5000;
  save("a.tif", a);
  save("b.tif", b);
  const auto config = load(kCrystal, ConfigUse::fit);
  EXPECT_EQ(picture(config.job, 0).non_finite, 1);
  EXPECT_EQ(picture(config.job, 0).dead, 1);
  EXPECT_EQ(picture(config.job, 0).mask(20 - 2, 20 - 4), 0);
  EXPECT_EQ(picture(config.job, 1).dead, 0);
}

TEST_F(ConfigFile, KeepsTheCrestsOfFineFringes) {
  // Rings of four pixels a period on a dark ground, nearly without noise: nothing here is a broken pixel.
  Image a(96, 96), b = counts(200, 2, 96, 96);
  for (int y = 0; y < 96; ++y)
    for (int x = 0; x < 96; ++x) {
      const double r = std::hypot(x - 47.3, y - 48.1);
      a(x, y) = 20 + (r < 30 ? 1000 * std::pow(std::sin(M_PI * r / 4), 2) : 0) + (x * 7 + y * 13) % 3;
    }
  save("a.tif", a);
  save("b.tif", b);
  const auto config = load(replaced(kCrystal, "[2, 4, 30, 28]", "[0, 0, 96, 96]"), ConfigUse::fit);
  EXPECT_EQ(picture(config.job, 0).dead, 0);
}

TEST_F(ConfigFile, ReadsAJointPrior) {
  save("a.tif", counts(100, 1));
  save("b.tif", counts(200, 2));
  write("fit.json", R"({"converged": true, "parameters": {"sample.crystal.half_wave_voltage_v": {"value": 1490},
    "micrograph.gain": {"value": 0.77}}, "interval_degrees_of_freedom": 4,
    "frame_scatter": {"intensity_sd": 0.01, "degrees_of_freedom": 3},
    "covariance": {"names": ["micrograph.gain", "sample.crystal.half_wave_voltage_v"],
      "matrix": [[1e-4, 0.9e-2], [0.9e-2, 1]]}})");
  const std::string prior =
      "prior: {from: fit.json, parameters: [sample.crystal.half_wave_voltage_v, micrograph.gain]}\n";
  const auto config = load(kCrystal + prior, ConfigUse::fit);
  ASSERT_TRUE(config.job.prior);
  EXPECT_EQ(config.job.prior->mean[0], 1490);
  EXPECT_EQ(config.job.prior->covariance(0, 0), 1);
  EXPECT_EQ(config.job.prior->covariance(1, 0), 0.9e-2);
  EXPECT_EQ(config.job.prior->degrees_of_freedom, 4);
  EXPECT_EQ(config.job.prior->frame_scatter->intensity_sd, 0.01);
  const auto& table = config.job.parameters;
  EXPECT_EQ(table[table.find("sample.crystal.half_wave_voltage_v")].value, 1490);
  EXPECT_NE(mistakes(kCrystal + replaced(prior, "micrograph.gain", "micrograph.offset"), ConfigUse::fit)
                .find("micrograph.offset was not fitted in fit.json"),
            std::string::npos);
}

TEST_F(ConfigFile, ReadsAProfileInAnyColumnOrder) {
  write("profile.csv", "n_e,n_o,az,ay,ax,depth_um\n1.7,1.5,0,0,2,1\n1.7,1.5,0,1,1,2.5\n");
  const auto config = load("sample: {slab: {profile: profile.csv}}\nmicroscope: {light: {wavelength_nm: 590}}\n");
  const auto& rows = std::get<Slab>(config.scene.sample).profile.rows;
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(rows[0].ax, 1);
  EXPECT_DOUBLE_EQ(rows[1].ay, std::sqrt(0.5));
  EXPECT_EQ(rows[1].depth_um, 2.5);
  EXPECT_EQ(rows[0].k_e, 0);
}

TEST_F(ConfigFile, NamesTheCellOfABadProfile) {
  write("profile.csv", "depth_um,ax,ay,az,n_o,n_e\n1,0,0,1,1.5,1.7\n1,0,0,0,1.5,x\n");
  const std::string text = "sample: {slab: {profile: profile.csv}}\nmicroscope: {light: {wavelength_nm: 590}}\n";
  EXPECT_EQ(mistakes(text), "profile.csv:3:13: n_e = x is not a finite number");
  write("profile.csv", "depth_um,ax,ay,az,n_o,n_e\n1,0,0,1,1.5,1.7\n1,0,0,0,1.5,1.7\n");
  EXPECT_EQ(mistakes(text),
            "profile.csv:3:1: depth_um = 1 does not grow (the row above has 1)\n"
            "profile.csv:3:3: the axis (ax, ay, az) = (0, 0, 0) has no direction");
}

TEST_F(ConfigFile, RefusesAnImageOptionBesideMicrographs) {
  save("a.tif", counts(100, 1));
  save("b.tif", counts(200, 2));
  EXPECT_THROW(load_config(write("config.yaml", kCrystal), ConfigUse::fit, folder_ / "a.tif"), UserError);
}

// A cone's picture ends where the objective's aperture does: 40 degrees in air need 0.64.
TEST_F(ConfigFile, AConeIsNoWiderThanTheObjectiveTakesIn) {
  save("a.tif", counts(100, 1));
  const auto with = [&](const std::string& na) {
    return mistakes(R"(micrograph: {image: a.tif}
sample:
  plate: {thickness_um: 500, director: {uniform: {azimuth_deg: 20, tilt_deg: 80}}, view: {half_angle_deg: 40}}
  material: {ordinary: 1.54, birefringence: {value: 0.01, fit: [0.005, 0.02]}}
microscope: {light: {wavelength_nm: 550}, polarizer_deg: 0, analyzer_deg: 90, objective_na: )" +
                        na + "}\n",
                    ConfigUse::fit);
  };
  EXPECT_NE(with("0.4").find("needs a numerical aperture of 0.64"), std::string::npos);
  EXPECT_EQ(with("0.65"), "");
}

// Electrodes are read off the picture: a pixel each, wherever they are from; what is stated to be exact is.
TEST_F(ConfigFile, WhereElectrodesAreIsKnownToAPixel) {
  save("a.tif", counts(100, 1));
  const auto known_to = [&](const std::string& roi, const std::string& electrodes) {
    const auto config = load("micrograph: {image: a.tif" + roi + R"(}
sample:
  crystal: {half_wave_voltage_v: 1500, bias_v: 700, field_along: y, field_legendre: [{value: 0, fit: [-1, 1]}])" +
                                 electrodes + R"(}
microscope: {light: {wavelength_nm: 1550}, polarizer_deg: 0, analyzer_deg: 90}
)",
                             ConfigUse::fit);
    const auto& bar = std::get<Crystal>(std::get<Picture>(config.job.measurements.front()).scene.sample);
    const ParameterTable& table = config.job.parameters;
    return std::array{table[bar.electrode_low_px].value, table[bar.electrode_low_px].known_to.sd,
                      table[bar.electrode_high_px].value, table[bar.electrode_high_px].known_to.sd};
  };
  EXPECT_EQ(known_to("", ", electrodes_px: [3, 20]"), (std::array{3.0, 1.0, 20.0, 1.0}));
  EXPECT_EQ(known_to(", roi_px: [0, 2, 32, 30]", ""), (std::array{1.5, 1.0, 29.5, 1.0}));
  EXPECT_EQ(known_to("", ""), (std::array{-0.5, 1.0, 31.5, 1.0}));
  EXPECT_EQ(known_to("", ", electrodes_px: [{value: 3, exact: true}, {value: 20, prior_sd: 0.2}]"),
            (std::array{3.0, 0.0, 20.0, 0.2}));
}

// Where a cone's figure lies is set by eye, and a crystal is not cut exactly; what is stated to be exact is.
TEST_F(ConfigFile, FigureOfAConeAndCutOfAPlateAreNotExact) {
  save("a.tif", counts(100, 1));
  const auto known_to = [&](const std::string& centre, const std::string& tilt) {
    const auto config = load("micrograph: {image: a.tif" + centre + R"(}
sample:
  plate: {thickness_um: 500, director: {uniform: {azimuth_deg: 20, tilt_deg: )" +
                                 tilt + R"(}}, view: {half_angle_deg: 20}}
  material: {ordinary: 1.54, birefringence: {value: 0.01, fit: [0.005, 0.02]}}
microscope: {light: {wavelength_nm: 550}, polarizer_deg: 0, analyzer_deg: 90}
)",
                             ConfigUse::fit);
    const ParameterTable& table = config.job.parameters;
    const Scene& scene = std::get<Picture>(config.job.measurements.front()).scene;
    const UniformDirector& director = std::get<Plate>(scene.sample).director;
    return std::array{table[scene.view.center_x_px].known_to.sd, table[scene.view.center_y_px].known_to.sd,
                      table[director.tilt_deg].known_to.sd};
  };
  EXPECT_EQ(known_to("", "80"), (std::array{2.0, 2.0, 0.5}));
  EXPECT_EQ(known_to(", center_px: [15.5, 15.5]", "{value: 80, exact: true}"), (std::array{0.0, 0.0, 0.0}));
}

// One picture that counts as two would halve the variance of what it tells.
TEST_F(ConfigFile, APictureIsListedOnce) {
  save("a.tif", counts(100, 1));
  save("b.tif", counts(200, 2));
  EXPECT_EQ(mistakes(kCrystal, ConfigUse::fit), "");
  for (const char* again : {"a.tif", "./a.tif"})
    EXPECT_NE(mistakes(replaced(kCrystal, "b.tif", again), ConfigUse::fit)
                  .find("config.yaml:3:13: "s + again + " is listed twice: it is one measurement"),
              std::string::npos);
  const std::string regions = replaced(replaced(replaced(kCrystal, "micrograph: {roi_px: [2, 4, 30, 28]}\n", ""),
                                                "image: a.tif,", "image: a.tif, roi_px: [0, 0, 32, 16],"),
                                       "image: b.tif,", "image: a.tif, roi_px: [0, 16, 32, 32],");
  EXPECT_EQ(mistakes(regions, ConfigUse::fit), "");
}

// A field in metres or nm is no picture of a sample.
TEST_F(ConfigFile, AFieldIsAsLargeAsWhatIsSeen) {
  const auto said = [&](const std::string& spacing, const std::string& more = "") {
    return mistakes("image_size_px: [32, 32]\nmicrograph: {pixel_size_um: 0.02}\nsample:\n  volume: {file: " +
                    std::string(BIREFIT_SOURCE_DIR) + "/tests/data/files/field_stored.npz, spacing_um: [" + spacing +
                    "]" + more + "}\n  material: {ordinary: 1.5, birefringence: 0.1}\n  surround: {index: 1.5}\n" +
                    "microscope: {light: {wavelength_nm: 550}, polarizer_deg: 0, analyzer_deg: 90}\n");
  };
  EXPECT_EQ(said("0.2, 0.3, 0.4"), "");
  EXPECT_NE(said("2e-7, 3e-7, 4e-7").find("less than a pixel"), std::string::npos);
  EXPECT_EQ(said("2e-7, 3e-7, 4e-7", ", scale: 1e6"), "");
  EXPECT_NE(said("500, 700, 900").find("a thousand times what is seen"), std::string::npos);
}

// Each names the place and what to do, not what the parser expected.
TEST_F(ConfigFile, SaysWhatIsWrongWithTheYaml) {
  EXPECT_EQ(mistakes("sample:\n\tdroplet: 1\n"),
            "config.yaml:2:1: is indented with a tab; YAML takes spaces only: two for each level");
  EXPECT_EQ(mistakes("sample:\n  \tdroplet: 1\n"),
            "config.yaml:2:3: is indented with a tab; YAML takes spaces only: two for each level");
  EXPECT_EQ(mistakes("sample: {a: 1 b: 2}\n"),
            "config.yaml:1:16: YAML syntax error in the { that opens at 1:9; a comma is missing before this, or the "
            "closing }");
  EXPECT_NE(mistakes("sample: {a: [1, 2}\nb: 3\n").find("in the [ that opens at 1:13"), std::string::npos);
  EXPECT_NE(mistakes("sample: {a: 1\nb: 3\n").find("in the { that opens at 1:9"), std::string::npos);
  EXPECT_NE(mistakes("sample: {a: 1}}\n").find("behind a closing bracket"), std::string::npos);
  EXPECT_NE(mistakes("sample: {a:1}\n").find("1:10: a space is missing behind the colon: a:1; a: 1"),
            std::string::npos);
  EXPECT_NE(mistakes("sample: {value: 9,5}\n").find("decimals have a point"), std::string::npos);
  EXPECT_NE(mistakes("image_size_px: [64 48]\n").find("1:17: a comma is missing in the list: 64 48; [64, ..]"),
            std::string::npos);
  EXPECT_NE(mistakes("sample: droplet: 3\n").find("pairs in one line stand in braces"), std::string::npos);
  EXPECT_NE(mistakes("sample:1\n").find("a space follows each colon"), std::string::npos);
}

}  // namespace
}  // namespace birefit
