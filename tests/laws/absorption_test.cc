// Cells and plates that absorb along their axes.

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "birefit/render.h"
#include "scene_builder.h"

namespace birefit {
namespace {

struct DichroicCell : testing::TableBuilder {
  Scene scene;
  Demand demand;
  DichroicCell(double polarizer_deg, double analyzer_deg) {
    demand.intensity_accuracy = 1e-8;
    scene.view.width = scene.view.height = 1;
    scene.surround_index = fixed("index", 1.52);
    scene.microscope.wavelength_nm = fixed("wavelength_nm", 550);
    scene.microscope.polarizer_deg = fixed("polarizer_deg", polarizer_deg);
    scene.microscope.analyzer_deg = fixed("analyzer_deg", analyzer_deg);
    ConstantIndices material;
    material.ordinary = fixed("ordinary", 1.52), material.birefringence = fixed("birefringence", 0.15);
    scene.material = material;
    scene.absorption.emplace_back();
    scene.absorption.front().ordinary = fixed("k_o", 0.004),
    scene.absorption.front().extraordinary = fixed("k_e", 0.02);
  }
  void uniform(double azimuth_deg) {
    Cell cell;
    cell.thickness_um = fixed("thickness", 4);
    UniformDirector director;
    director.azimuth_deg = fixed("azimuth", azimuth_deg), director.tilt_deg = fixed("tilt", 0);
    cell.director = director;
    scene.sample = cell;
  }
  Image picture() const {
    const Theta theta = table.values();
    return render(scene, plan(scene, demand, theta), theta, {}, 1).intensity;
  }
};

// Lambert and Beer: each polarization by its own k, where the medium around has its index.
TEST(Absorption, FallsOffAlongTheAxes) {
  const double depth_um = 4, per_um = 4 * std::numbers::pi / 0.55;
  for (const bool along : {true, false}) {
    DichroicCell s(30, 30);
    s.uniform(along ? 30 : 120);
    s.table[s.scene.surround_index].value = along ? 1.67 : 1.52;
    const double k = along ? 0.02 : 0.004;
    // What a face reflects of a wave whose index differs by i k alone is k^2 / (2 n)^2.
    EXPECT_NEAR(s.picture()(0, 0), std::exp(-k * per_um * depth_um), k * k) << along;
  }
}

// A polarizer: crossed with nothing, a strong dichroic at 45 degrees lets a quarter through of the ordinary wave.
TEST(Absorption, AStrongDichroicPolarizes) {
  DichroicCell s(0, 90);
  s.uniform(45);
  s.table[s.scene.absorption.front().ordinary].value = 0;
  s.table[s.scene.absorption.front().extraordinary].value = 0.3;
  EXPECT_NEAR(s.picture()(0, 0), 0.25, 1e-3);
}

// Cells by the numbers of their material, and slabs by the rows of a table, are read by different code.
TEST(Absorption, IsThatOfASlab) {
  DichroicCell cell(10, 75);
  cell.uniform(40);
  DichroicCell slab(10, 75);
  slab.scene.absorption.clear();
  Slab sample;
  sample.profile.interpolation = SlabProfile::Interpolation::constant;
  const double azimuth = 40 * std::numbers::pi / 180;
  sample.profile.rows.push_back({4, std::cos(azimuth), std::sin(azimuth), 0, 1.52, 1.67, 0.004, 0.02});
  slab.scene.sample = sample;
  EXPECT_NEAR(cell.picture()(0, 0), slab.picture()(0, 0), 1e-8);
  cell.table[cell.scene.absorption.front().extraordinary].value = 0;
  EXPECT_GT(std::abs(cell.picture()(0, 0) - slab.picture()(0, 0)), 0.01);
}

/// A dye that takes blue and red light differently, by three wavelengths.
void dye(DichroicCell& s) {
  const auto add = [&](double nm, double ordinary, double extraordinary) {
    Absorption at;
    at.wavelength_nm = nm;
    at.ordinary = s.fixed("k_o", ordinary), at.extraordinary = s.fixed("k_e", extraordinary);
    s.scene.absorption.push_back(at);
  };
  s.scene.absorption.clear();
  add(450, 0.01, 0.03), add(550, 0.002, 0.02), add(650, 0.001, 0.004);
}

// Linear between the wavelengths that are stated, as at the outermost beyond.
TEST(Absorption, GoesWithTheWavelength) {
  struct At {
    double nm, ordinary, extraordinary;
  };
  for (const At& at : {At{400, 0.01, 0.03}, At{475, 0.008, 0.0275}, At{550, 0.002, 0.02}, At{625, 0.00125, 0.008},
                       At{700, 0.001, 0.004}}) {
    DichroicCell by_wavelength(20, 70), alone(20, 70);
    for (DichroicCell* s : {&by_wavelength, &alone}) {
      s->uniform(50);
      s->table[s->scene.microscope.wavelength_nm].value = at.nm;
    }
    alone.table[alone.scene.absorption.front().ordinary].value = at.ordinary;
    alone.table[alone.scene.absorption.front().extraordinary].value = at.extraordinary;
    dye(by_wavelength);
    EXPECT_NEAR(by_wavelength.picture()(0, 0), alone.picture()(0, 0), 1e-12) << at.nm;
  }
}

// In light of all wavelengths each is taken up by its own k: the sum of lines, the lamp's power even within a filter.
TEST(Absorption, OfAllWavelengthsIsTheSumOfLines) {
  constexpr double kCentre = 560, kWidth = 80;
  DichroicCell s(20, 70);
  s.uniform(50);
  dye(s);
  double lines = 0, all = 0;
  for (double nm = 360; nm < 760; nm += 1) {
    const double x = (nm - kCentre) / kWidth, weight = std::exp(-4 * std::numbers::ln2 * x * x);
    s.table[s.scene.microscope.wavelength_nm].value = nm;
    lines += weight * s.picture()(0, 0), all += weight;
  }
  ChannelLight& light = s.scene.microscope.channel_light.emplace();
  light.filters.push_back({s.fixed("centre_nm", kCentre), s.fixed("fwhm_nm", kWidth), nullptr});
  s.demand.intensity_accuracy = 1e-6;
  EXPECT_NEAR(s.picture()(0, 0), lines / all, 2e-6);  // of the lines' steps, too
}

// Light of a narrow band may lie on a slope or a peak of a dye although it is sharp enough for the retardance.
TEST(Absorption, OfANarrowBandIsTheSumOfLinesWithoutARetardance) {
  constexpr double kCentre = 580, kWidth = 40;
  DichroicCell s(20, 20);
  s.uniform(20);
  dye(s);
  s.table[std::get<ConstantIndices>(s.scene.material).birefringence].value = 0;
  s.demand.model_tolerance = 0, s.demand.intensity_accuracy = 1e-5;
  double lines = 0, all = 0;
  for (double nm = 480; nm <= 680; nm += 1) {
    const double x = (nm - kCentre) / kWidth, weight = std::exp(-4 * std::numbers::ln2 * x * x);
    s.table[s.scene.microscope.wavelength_nm].value = nm;
    lines += weight * s.picture()(0, 0), all += weight;
  }
  s.table[s.scene.microscope.wavelength_nm].value = kCentre;
  const double sharp = s.picture()(0, 0);
  s.scene.microscope.bandwidth_nm = s.fixed("bandwidth_nm", kWidth);
  ASSERT_GT(std::abs(sharp - lines / all), 1e-3);
  // A line is a Gaussian of 1/wavelength: the next order of its width.
  EXPECT_NEAR(s.picture()(0, 0), lines / all, 0.1 * std::abs(sharp - lines / all));
}

TEST(Absorption, HasDerivatives) {
  for (const bool twisted : {false, true}) {
    DichroicCell s(20, 80);
    if (twisted) {
      Cell cell;
      cell.thickness_um = s.fixed("thickness", 5);
      TwistedDirector director;
      director.azimuth_deg = s.fixed("azimuth", 10), director.twist_deg = s.fixed("twist", 75);
      director.pretilt_deg = s.fixed("pretilt", 4);
      cell.director = director;
      s.scene.sample = cell;
    } else {
      Plate plate;
      plate.thickness_um = s.fixed("thickness", 60);
      plate.half_angle_deg = s.fixed("half_angle", 20);
      plate.director.tilt_deg = s.fixed("tilt", 30), plate.director.azimuth_deg = s.fixed("azimuth", 25);
      s.scene.sample = plate;
      s.scene.view.width = s.scene.view.height = 24;
      s.table[s.scene.absorption.front().ordinary].value = 1e-4,
      s.table[s.scene.absorption.front().extraordinary].value = 1e-3;
    }
    Theta theta = s.table.values();
    s.demand.intensity_accuracy = 1e-5;
    const RenderPlan chosen = plan(s.scene, s.demand, theta);
    const std::vector<int> active{s.scene.absorption.front().ordinary.index,
                                  s.scene.absorption.front().extraordinary.index,
                                  s.scene.microscope.wavelength_nm.index};
    const Rendering all = render(s.scene, chosen, theta, active, 1);
    for (std::size_t j = 0; j < active.size(); ++j) {
      const std::size_t at = static_cast<std::size_t>(active[j]);
      const double kept = theta[at], h = 1e-5 * kept;
      theta[at] = kept + h;
      const Image up = render(s.scene, chosen, theta, {}, 1).intensity;
      theta[at] = kept - h;
      const Image down = render(s.scene, chosen, theta, {}, 1).intensity;
      theta[at] = kept;
      double largest = 0, worst = 0;
      for (std::size_t i = 0; i < up.size(); ++i) {
        const double slope = (up.values()[i] - down.values()[i]) / (2 * h);
        largest = std::max(largest, std::abs(slope));
        worst = std::max(worst, std::abs(slope - all.derivatives[j].values()[i]));
      }
      EXPECT_GT(largest, 0);
      // Means of fringes in closed form go by differences between pixels.
      EXPECT_LT(worst, (twisted ? 1e-5 : 3e-3) * largest) << s.table[active[j]].name << " " << twisted;
    }
  }
}

}  // namespace
}  // namespace birefit
