// The block `microscope` of a config: polarizers, parts, and what structs say of their numbers.

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <string>

#include <gtest/gtest.h>

#include "birefit/io.h"
#include "io/config/described.h"
#include "medium/references.h"

namespace birefit {
namespace {

namespace fs = std::filesystem;

class MicroscopeConfig : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("birefit-microscope-" + std::to_string(::getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  /// A droplet between `polarizers`, with more keys of the microscope.
  birefit::Config load(const std::string& more,
                       const std::string& polarizers = "polarizer_deg: 10, analyzer_deg: 100") {
    std::ofstream file(folder_ / "config.yaml");
    file << "image_size_px: [64, 48]\nmicrograph: {pixel_size_um: 0.25}\n"
            "sample:\n  droplet: {diameter_um: 9.3, director: {radial: {}}}\n"
            "  material: {ordinary: 1.52, birefringence: 0.2}\n  surround: {index: 1.43}\n"
            "microscope: {light: {wavelength_nm: 590}, "
         << polarizers << more << "}\n";
    file.close();
    return load_config(folder_ / "config.yaml", ConfigUse::render);
  }
  std::string mistakes(const std::string& more,
                       const std::string& polarizers = "polarizer_deg: 10, analyzer_deg: 100") {
    try {
      load(more, polarizers);
    } catch (const UserError& error) {
      return error.what();
    }
    return {};
  }
  static double value(const birefit::Config& config, ParameterRef ref) { return config.job.parameters[ref].value; }

  fs::path folder_;
};

TEST_F(MicroscopeConfig, ListsOfPartsInTheOrderOfTheLight) {
  const auto config = load(
      ", before: [{quarter_wave: {azimuth_deg: 55}}, {rotator: {angle_deg: 3}}],"
      " behind: [{retarder: {phase_deg: 30, azimuth_deg: 10}}, {full_wave: {azimuth_deg: 45, made_for_nm: 530}}]");
  const Microscope& m = config.scene.microscope;
  ASSERT_EQ(m.before.size(), 2u);
  ASSERT_EQ(m.behind.size(), 2u);
  const Retarder& quarter = std::get<Retarder>(m.before[0]);
  EXPECT_EQ(value(config, quarter.phase_deg), 90);
  EXPECT_EQ(value(config, quarter.azimuth_deg), 55);
  EXPECT_EQ(value(config, std::get<Rotator>(m.before[1]).angle_deg), 3);
  EXPECT_EQ(value(config, std::get<Retarder>(m.behind[0]).phase_deg), 30);
  EXPECT_EQ(config.job.parameters[std::get<Retarder>(m.behind[0]).phase_deg].name,
            "microscope.behind[1].retarder.phase_deg");
  const Retarder& red = std::get<Retarder>(m.behind[1]);
  EXPECT_FALSE(red.phase_deg);
  EXPECT_EQ(value(config, red.retardance_nm), 530);
}

TEST_F(MicroscopeConfig, PlatesOfCrystals) {
  const auto config = load(
      ", before: [{quarter_wave: {azimuth_deg: 55, made_for_nm: 550, crystal: quartz}},"
      " {retarder: {retardance_nm: 900, azimuth_deg: 3, crystal: calcite, at_nm: 600}}],"
      " behind: [{berek: {thickness_um: 1400, tilt_deg: {value: 3, fit: [-10, 10]}, azimuth_deg: 45}}]");
  const Microscope& m = config.scene.microscope;
  const Retarder& quarter = std::get<Retarder>(m.before.at(0));
  EXPECT_EQ(quarter.crystal, PlateCrystal::quartz);
  EXPECT_EQ(quarter.at_nm, 550);
  EXPECT_EQ(value(config, quarter.retardance_nm), 137.5);
  EXPECT_EQ(std::get<Retarder>(m.before.at(1)).at_nm, 600);
  EXPECT_EQ(std::get<TiltedPlate>(m.behind.at(0)).crystal, PlateCrystal::magnesium_fluoride);
  EXPECT_TRUE(config.job.parameters.find("microscope.behind[1].berek.tilt_deg"));
}

TEST_F(MicroscopeConfig, ACondenserAndItsShortForm) {
  const auto config = load(", condenser: {na: 0.3, inner_na: 0.1, tilt_deg: 4}");
  ASSERT_TRUE(config.scene.microscope.condenser);
  EXPECT_EQ(value(config, config.scene.microscope.condenser->inner_na), 0.1);
  const auto by_short_form = load(", condenser_na: 0.2");
  EXPECT_EQ(value(by_short_form, by_short_form.scene.microscope.condenser->na), 0.2);
  EXPECT_FALSE(load("").scene.microscope.condenser);
}

TEST_F(MicroscopeConfig, ShortFormsAreParts) {
  const auto circular = load(", quarter_wave: true");
  const auto& [before, behind] = std::pair(circular.scene.microscope.before, circular.scene.microscope.behind);
  ASSERT_EQ(before.size(), 1u);
  ASSERT_EQ(behind.size(), 1u);
  std::set<int> numbers;
  for (const auto& [part, turned] : {std::pair(before[0], 45), std::pair(behind[0], -45)}) {
    const Retarder& plate = std::get<Retarder>(part);
    EXPECT_EQ(plate.azimuth_deg, circular.scene.microscope.polarizer_deg);
    EXPECT_EQ(value(circular, plate.turned_deg), turned);
    EXPECT_EQ(value(circular, plate.phase_deg), 90);
    // As of parts that are listed: each plate is off by itself, in its phase and on its mount.
    EXPECT_EQ(circular.job.parameters[plate.turned_deg].known_to.sd, 1);
    EXPECT_EQ(circular.job.parameters[plate.phase_deg].known_to.sd, 3);
    numbers.insert({plate.turned_deg.index, plate.phase_deg.index});
  }
  EXPECT_EQ(numbers.size(), 4u);
  const auto compensated = load(", compensator: {phase_deg: 20, azimuth_deg: 30}");
  ASSERT_EQ(compensated.scene.microscope.behind.size(), 1u);
  EXPECT_TRUE(compensated.job.parameters.find("microscope.compensator.phase_deg"));
}

TEST_F(MicroscopeConfig, NoneIsNoPolarizer) {
  const auto unpolarized = load("", "polarizer_deg: none, analyzer_deg: 100");
  EXPECT_FALSE(unpolarized.scene.microscope.polarizer_deg);
  EXPECT_TRUE(unpolarized.scene.microscope.analyzer_deg);
  EXPECT_FALSE(load("", "polarizer_deg: 10, analyser_deg: none").scene.microscope.analyzer_deg);
  for (const char* polarizers : {"polarizer_deg: none, analyzer_deg: 100", "polarizer_deg: 10, analyzer_deg: none",
                                 "polarizer_deg: none, analyzer_deg: none"}) {
    const auto config = load("", polarizers);
    EXPECT_NO_THROW(plan(config.scene, config.job.demand, config.job.parameters.values())) << polarizers;
  }
}

TEST_F(MicroscopeConfig, MistakesHaveTheirPlaceAndAHint) {
  const auto says = [&](const std::string& more, const std::string& words,
                        const std::string& polarizers = "polarizer_deg: 10, analyzer_deg: 100") {
    const std::string said = mistakes(more, polarizers);
    EXPECT_NE(said.find(words), std::string::npos) << more << "\n" << said;
    EXPECT_NE(said.find("config.yaml:7:"), std::string::npos) << said;
  };
  says(", behind: {retarder: {phase_deg: 3, azimuth_deg: 1}}", "must be a list of parts");
  says(", condenser: {na: 0.3}, condenser_na: 0.3", "is short for condenser");
  says(", condenser: {inner_na: 0.3}", "condenser");
  says(", before: [{quarter_wave: {azimuth_deg: 1, crystal: quartz}}]", "made for one wavelength");
  says(", before: [{retarder: {retardance_nm: 100, azimuth_deg: 1, at_nm: 500}}]", "the same at all wavelengths");
  says(", before: [{retarder: {phase_deg: 100, azimuth_deg: 1, crystal: calcite}}]", "a phase is given");
  says(", behind: [{retarder: {phase_deg: 3, azimuth_deg: 1}, rotator: {angle_deg: 1}}]",
       "must hold one part, found 2");
  says(", before: [{rotater: {angle_deg: 1}}]", "did you mean rotator?");
  says(", before: [{retarder: {azimuth_deg: 1}}]", "phase_deg or retardance_nm");
  says(", before: [{retarder: {phase_deg: 1, retardance_nm: 2, azimuth_deg: 1}}]", "beside retardance_nm");
  says(", before: [{rotator: {angle_deg: 1, azimuth_deg: 1}}]", "unknown key azimuth_deg");
  says(", quarter_wave: true, before: [{rotator: {angle_deg: 1}}]", "quarter_wave: true stands for");
  says(", analyzer_extinction_ratio: 0.5", "is outside [1, ");
  says(", polarizer_extinction_ratio: 500", "not there", "polarizer_deg: none, analyzer_deg: 100");
}

/// Rows of a table of docs/configuration.md.
template <class T>
void add_rows(const std::string& path, std::vector<std::string>& rows) {
  T object;
  each_number(object, [&](const char* key, const NumberSpec& spec, const char* words, ParameterRef*) {
    const std::string fallback = spec.fallback ? show(*spec.fallback) : spec.optional ? "" : "required";
    rows.push_back("| `" + path + "." + key + "` | " + spec.unit + " | " + fallback + " | " + range_of(spec) + " | " +
                   words + " |");
  });
}

// The document's table of numbers is what the structs say of them.
TEST(DescribedNumbers, StandInTheDocumentAsTheyAre) {
  std::vector<std::string> rows;
  each_kind<decltype(Droplet::director)>(
      [&]<class D>(const D*) { add_rows<D>(std::string("droplet.director.") + D::kKey, rows); });
  add_rows<ShellDirector>("shell", rows);
  each_kind<decltype(Cell::director)>(
      [&]<class D>(const D*) { add_rows<D>(std::string("cell.director.") + D::kKey, rows); });
  add_rows<Crystal>("crystal", rows);
  add_rows<StressedDisc>("disc", rows);
  add_rows<HeatStep>("plate.heat", rows);
  add_rows<SideCamera>("view.camera", rows);
  each_kind<PolarizingPart>([&]<class Part>(const Part*) { add_rows<Part>(Part::kKey, rows); });
  add_rows<Microscope>("microscope", rows);
  add_rows<Lamp>("microscope.light.lamp", rows);
  add_rows<LightFilter>("microscope.light.filters", rows);
  add_rows<View>("micrograph", rows);
  std::ifstream file(fs::path(BIREFIT_SOURCE_DIR) / "docs/configuration.md");
  std::stringstream text;
  text << file.rdbuf();
  for (const std::string& row : rows) EXPECT_NE(text.str().find(row + "\n"), std::string::npos) << row;
}

// Whatever a struct describes can be fitted: the search for references finds it.
TEST(DescribedNumbers, AreReferencesOfTheScene) {
  const auto found = [](const Scene& scene) {
    std::set<int> indices;
    for_each_ref(scene, [&](const ParameterRef& ref) { indices.insert(ref.index); });
    return indices;
  };
  const auto check = [&]<class T>(const auto& place) {
    T object;
    int next = 100;
    each_number(object, [&](const char*, const NumberSpec&, const char*, ParameterRef* ref) {
      if (ref) ref->index = next++;
    });
    Scene scene;
    place(scene, object);
    const std::set<int> indices = found(scene);
    for (int index = 100; index < next; ++index) EXPECT_TRUE(indices.count(index)) << index - 100;
  };
  each_kind<decltype(Droplet::director)>([&]<class D>(const D*) {
    check.template operator()<D>([](Scene& scene, const D& director) { scene.sample = Droplet{{1}, director}; });
  });
  each_kind<decltype(Cell::director)>([&]<class D>(const D*) {
    check.template operator()<D>([](Scene& scene, const D& director) { scene.sample = Cell{{1}, director}; });
  });
  each_kind<PolarizingPart>([&]<class Part>(const Part*) {
    check.template operator()<Part>([](Scene& scene, const Part& part) { scene.microscope.behind = {part}; });
  });
}

}  // namespace
}  // namespace birefit
