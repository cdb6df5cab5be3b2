// Sums over wavelengths and over echoes: what the chart of spectral integration measures must be so.

#include <cmath>
#include <map>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "birefit/render.h"
#include "birefit/study.h"
#include "instrument/channel_light.h"
#include "scene_builder.h"

namespace birefit {
namespace {

TEST(Spectra, RulesErrAsTheyMust) {
  std::map<std::string, double> even_steps;
  int closed_forms = 0;
  for (const SpectrumPoint& p : measure_spectra(true)) {
    SCOPED_TRACE(p.scene + ", " + p.rule + " " + p.effort);
    ASSERT_TRUE(std::isfinite(p.error));
    if (p.rule == "planned") {
      EXPECT_LE(p.error, std::stod(p.effort));
    }
    if (p.rule == "closed form") {
      // Two ways to the same integral, each to rounding.
      EXPECT_LT(p.error, 1e-12);
      ++closed_forms;
    }
    if (p.rule == "even in wavelength") even_steps[p.effort] = std::max(even_steps[p.effort], p.error);
  }
  EXPECT_EQ(closed_forms, 1);
  // Sixteen wavelengths see fringes that five micrometres of retardance do not show.
  EXPECT_GT(even_steps.at("20 nm"), 0.1);
  EXPECT_LT(even_steps.at("5 nm"), 0.01);
}

// A geometric series that ends: each double reflection takes another factor of the reflected shares, R = r^2 of a face,
// of either wave. The sum of amplitudes errs by their last, and the intensity by twice that at the most.
TEST(Spectra, EachDoubleReflectionTakesItsShare) {
  std::map<std::string, double> reflected;
  for (const double surround : {1.43, 1.0})
    for (const char* width : {"1 nm", "40 nm"}) {
      const double r = (1.7 - surround) / (1.7 + surround);
      reflected["echoes in " + std::string(surround == 1 ? "1" : "1.43") + ", " + width] = r * r;
    }
  int seen = 0;
  for (const SpectrumPoint& p : measure_spectra(true)) {
    if (p.rule != "M") continue;
    SCOPED_TRACE(p.scene + ", " + p.effort);
    const int most = std::stoi(p.effort.substr(2));
    EXPECT_LE(p.error, 2 * std::pow(reflected.at(p.scene), most + 1) + 1e-14);
    ++seen;
  }
  EXPECT_EQ(seen, 4 * 7);
}

// Lamps, filters and plates drawn at random: the wavelengths that are planned hold what was asked for.
TEST(Spectra, PlannedWavelengthsHoldWhateverTheLight) {
  std::mt19937 draw(20);
  const auto uniform = [&](double low, double high) { return std::uniform_real_distribution<>(low, high)(draw); };
  const auto spread = [&](double low, double high) { return std::exp(uniform(std::log(low), std::log(high))); };
  for (int problem = 0; problem < 60; ++problem) {
    testing::TableBuilder s;
    Scene scene;
    scene.view.width = scene.view.height = 1;
    scene.surround_index = s.fixed("surround", 1.5);
    scene.microscope.wavelength_nm = s.fixed("wavelength_nm", 550);
    scene.microscope.polarizer_deg = s.fixed("polarizer_deg", 0);
    scene.microscope.analyzer_deg = s.fixed("analyzer_deg", 90);
    ChannelLight& light = scene.microscope.channel_light.emplace();
    if (problem % 3 != 0) light.lamp.planck_k = s.fixed("planck_k", uniform(2000, 7000));
    const double centre = uniform(480, 640), fwhm = spread(2, 120), retardance_um = spread(0.05, 60);
    LightFilter filter;
    filter.centre_nm = s.fixed("centre_nm", centre), filter.fwhm_nm = s.fixed("fwhm_nm", fwhm);
    light.filters = {filter};
    ConstantIndices material;
    material.ordinary = s.fixed("ordinary", 1.52), material.birefringence = s.fixed("birefringence", 0.1);
    material.resonance_nm = s.fixed("resonance_nm", uniform(60, 150));
    scene.material = material;
    Cell cell;
    cell.thickness_um = s.fixed("thickness_um", retardance_um / 0.1);
    UniformDirector director;
    director.tilt_deg = s.fixed("tilt_deg", 0), director.azimuth_deg = s.fixed("azimuth_deg", uniform(10, 80));
    cell.director = director;
    scene.sample = cell;
    const Theta theta = s.table.values();
    const Demand demand{.intensity_accuracy = spread(1e-5, 1e-2)};
    RenderPlan chosen = plan(scene, demand, theta);
    const double seen = render(scene, chosen, theta, {}, 1).intensity(0, 0);
    const SpectralSum fine = channel_of(scene.microscope, theta, 3 * retardance_um + 20);
    auto all = std::make_shared<WavelengthRule>();
    all->weight = fine.weight.front();
    for (const double um : fine.wavelength_um) all->wavelength_nm.push_back(1000 * um);
    chosen.wavelengths = all;
    chosen.of_wavelengths.clear();
    EXPECT_NEAR(seen, render(scene, chosen, theta, {}, 1).intensity(0, 0), demand.intensity_accuracy)
        << retardance_um << " um of retardance, " << fwhm << " nm about " << centre;
  }
}

}  // namespace
}  // namespace birefit
