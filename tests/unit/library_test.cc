// What a program that links the library meets: configs that are no files, scenes built by hand.

#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "birefit/error.h"
#include "birefit/io.h"
#include "birefit/render.h"

namespace birefit {
namespace {

const char* const kCell =
    "image_size_px: [4, 4]\n"
    "sample:\n"
    "  cell: {thickness_um: 5, director: {uniform: {azimuth_deg: 45}}}\n"
    "  material: {ordinary: 1.5, birefringence: 0.05}\n"
    "  surround: {index: 1.5}\n"
    "microscope: {light: {wavelength_nm: 500}, polarizer_deg: 0, analyzer_deg: 90}\n";

std::string mistakes_of(const std::function<void()>& what) {
  try {
    what();
  } catch (const UserError& error) {
    return error.what();
  }
  return {};
}

// Half a wave of retardance at 45 degrees between crossed polarizers passes all that the surfaces do: 5 um x 0.05 = 250
// nm of 500 nm.
TEST(Library, AConfigMayBeAText) {
  const birefit::Config config = load_config_text(kCell, "cell.yaml", ConfigUse::render);
  const Theta theta = config.job.parameters.values();
  const Image image = render(config.scene, plan(config.scene, config.job.demand, theta), theta).intensity;
  for (const double value : image.values()) EXPECT_NEAR(value, 1.0, 0.01);  // surfaces: ((n - 1.5) / (n + 1.5))^2
}

TEST(Library, MistakesInATextHaveTheNameItWasGiven) {
  std::string text = kCell;
  text.replace(text.find("thickness_um: 5"), 15, "thickness_um: -5");
  EXPECT_NE(mistakes_of([&] { load_config_text(text, "typed.yaml", ConfigUse::render); }).find("typed.yaml:3:"),
            std::string::npos);
}

TEST(Library, AnEmptyReferenceIsSaidWithItsPlace) {
  const birefit::Config config = load_config_text(kCell, "cell.yaml", ConfigUse::render);
  const Theta theta = config.job.parameters.values();
  Scene scene = config.scene;
  std::get<Cell>(scene.sample).thickness_um = {};
  EXPECT_NE(mistakes_of([&] { plan(scene, config.job.demand, theta); }).find("thickness_um is an empty reference"),
            std::string::npos);
  scene = config.scene;
  scene.microscope.wavelength_nm.index = 1000;
  EXPECT_NE(mistakes_of([&] { plan(scene, config.job.demand, theta); }).find("refers to parameter 1000"),
            std::string::npos);
}

// One rule of directions may agree with light along the axis by chance: between echoes of this cell it does.
TEST(Library, ACondenserIsLeftOutByNoChance) {
  const birefit::Config config = load_config_text(R"(image_size_px: [1, 1]
accuracy: {intensity: 1e-5}
physics: {ceiling: reflections, model_tolerance: 0}
microscope:
  light: {wavelength_nm: 471.415}
  polarizer_deg: 156.858
  analyzer_deg: 153.567
  before: [{rotator: {angle_deg: 43.604}}, {retarder: {retardance_nm: 454.164, azimuth_deg: 176.206}}]
  condenser: {na: 0.517}
sample:
  cell:
    thickness_um: 2.416
    director: {freedericksz: {reduced_voltage: 2.727, k33_over_k11: 1.654, k22_over_k11: 0.6, eps_ratio: 3.556,
                               pretilt_deg: 1.326, twist_deg: 5.571, azimuth_deg: 26.014}}
  material: {ordinary: {sellmeier: [[1.239, 0.005]], range_nm: [300, 1000]},
             extraordinary: {sellmeier: [[1.425, 0.009], [0.1, 100]], range_nm: [300, 1000]},
             absorption: {ordinary: 0.006, extraordinary: 0.007}}
  surround: {index: 1.42399}
)",
                                                  "cell.yaml", ConfigUse::render);
  const Theta theta = config.job.parameters.values();
  const RenderPlan planned = plan(config.scene, config.job.demand, theta);
  RenderPlan fine = planned;
  fine.condenser_rings = 24;
  EXPECT_NEAR(render(config.scene, planned, theta, {}, 1).intensity(0, 0),
              render(config.scene, fine, theta, {}, 1).intensity(0, 0), 2e-5);
}

}  // namespace
}  // namespace birefit
