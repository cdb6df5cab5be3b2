// Colour pictures of radial droplets in white light, made one wavelength after the other by a program that shares no
// code with the fit: unknown white balance and black level, a lamp that is known to 3 % only.

#include <cmath>
#include <memory>
#include <random>

#include <gtest/gtest.h>

#include "independent_colour.h"
#include "reference_table.h"
#include "scene_builder.h"

namespace birefit {
namespace {

using namespace testing;

std::shared_ptr<const SpectralTable> sensitivity(const CameraRows& camera, std::size_t colour) {
  auto table = std::make_shared<SpectralTable>();
  for (const auto& row : camera) {
    table->wavelength_um.push_back(1e-3 * row[0]);
    table->value.push_back(row[colour + 1]);
  }
  return table;
}

TEST(ColourRecovery, DropletsOfUnknownWhiteBalance) {
  constexpr int kSize = 48;
  constexpr double kStatedLamp = 2900, kNoise = 3, kResonance = 225;
  const CameraRows camera = camera_rows(data_path("instrument/camera/nikon_d5100.csv"));
  int inside = 0, asked = 0;
  const int problems = problems_or(3);
  for (int n = first_problem(); n < first_problem() + problems; ++n) {
    std::mt19937_64 random(static_cast<unsigned>(7000 + n));
    const auto between = [&](double low, double high) {
      return std::uniform_real_distribution<double>(low, high)(random);
    };
    std::normal_distribution<double> normal;
    IndependentColourDroplet seen;
    seen.birefringence = between(0.1, 0.25), seen.resonance_nm = kResonance;
    seen.planck_k = kStatedLamp * (1 + 0.03 * normal(random));
    seen.droplet.surfaces = true;
    seen.droplet.diameter_um = between(7, 13), seen.droplet.n_o = 1.52, seen.droplet.n_host = 1.5;
    seen.droplet.center_x_px = between(22, 25), seen.droplet.center_y_px = between(22, 25);
    seen.droplet.pixel_um = 0.32;
    const auto pictures = seen.pictures(camera, kSize);

    TableBuilder t;
    Droplet droplet;
    droplet.diameter_um = t.fitted("diameter_um", seen.droplet.diameter_um * between(0.85, 1.15), 5, 16);
    ConstantIndices material;
    material.ordinary = t.fixed("ordinary", 1.52);
    material.birefringence = t.fitted("birefringence", seen.birefringence * between(0.8, 1.2), 0.05, 0.35);
    material.resonance_nm = t.fixed("resonance_nm", kResonance);
    Scene scene;
    scene.sample = droplet, scene.material = material, scene.surround_index = t.fixed("index", 1.5);
    scene.view.width = scene.view.height = kSize;
    scene.view.pixel_size_um = t.fixed("pixel_size_um", seen.droplet.pixel_um);
    scene.view.center_x_px = t.fitted("x", 23.5, 18, 29), scene.view.center_y_px = t.fitted("y", 23.5, 18, 29);
    scene.microscope.polarizer_deg = t.fixed("polarizer_deg", 0);
    scene.microscope.analyzer_deg = t.fixed("analyzer_deg", 90);
    const ParameterRef lamp = t.fixed("planck_k", kStatedLamp);
    t.table[lamp].known_to.share = 0.03;
    FitJob job;
    for (std::size_t c = 0; c < 3; ++c) {
      Picture picture;
      picture.name = std::string(1, "rgb"[c]);
      picture.scene = scene;
      Microscope& m = picture.scene.microscope;
      m.wavelength_nm = t.fixed("wavelength_nm", 550);
      m.channel_light.emplace();
      m.channel_light->lamp.planck_k = lamp;
      m.channel_light->sensitivity = sensitivity(camera, c);
      picture.gain = t.linear("gain", 800), picture.offset = t.linear("offset", 20);
      picture.values = Image(kSize, kSize);
      picture.mask = Mask(kSize, kSize, 1);
      const double gain = between(600, 1000), offset = between(5, 30);
      for (std::size_t i = 0; i < picture.values.size(); ++i)
        picture.values.values()[i] = gain * pictures[c][i] + offset + kNoise * normal(random);
      picture.noise = NoiseModel{.read_counts = kNoise};
      job.measurements.push_back(std::move(picture));
    }
    job.parameters = t.table;
    const FitResult result = fit(job);
    ASSERT_TRUE(result.has_answer()) << n << ": " << result.verdict;
    for (const auto& [name, truth] :
         {std::pair("diameter_um", seen.droplet.diameter_um), std::pair("birefringence", seen.birefringence)})
      for (const ParameterEstimate& p : result.parameters)
        if (p.name == name) {
          ++asked;
          inside += p.interval95_low <= truth && truth <= p.interval95_high;
          // The sum of the one and of the other wavelengths, and pixels of 36 points, agree to 1e-3 of the light.
          EXPECT_NEAR(p.value, truth, 5 * p.stderr_ + 1e-3 * truth) << n << " " << name << ": " << result.verdict;
        }
  }
  EXPECT_EQ(asked, 2 * problems);
  EXPECT_GE(inside, asked - 2 - asked / 10);
}

}  // namespace
}  // namespace birefit
