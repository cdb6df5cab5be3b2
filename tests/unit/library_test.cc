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

}  // namespace
}  // namespace birefit
