// Light that is no line, for every kind of sample: the picture is the sum of its lines.

#include <cmath>
#include <memory>
#include <numbers>
#include <utility>

#include <gtest/gtest.h>

#include "every_kind.h"
#include "instrument/channel_light.h"
#include "instrument/spectrum.h"
#include "scene_builder.h"

namespace birefit {
namespace {

using testing::Kind;

constexpr double kPlanck = 2900, kCentreNm = 545, kFwhmNm = 60;

/// An incandescent lamp behind a filter of 60 nm, as the eye sees its brightness.
void light_up(Kind& kind) {
  ChannelLight& light = kind.scene.microscope.channel_light.emplace();
  light.lamp.planck_k = kind.number("planck_k", kPlanck);
  light.filters.push_back({kind.number("centre_nm", kCentreNm), kind.number("fwhm_nm", kFwhmNm), nullptr});
  light.sensitivity = std::make_shared<SpectralTable>(colour_matching(1));
}
double weight_at(double nm) {
  const double x = (nm - kCentreNm) / kFwhmNm, um = 1e-3 * nm;
  const double lamp = std::pow(um, -5) / std::expm1(14387.768775 / (um * kPlanck));
  return lamp * std::exp(-4 * std::log(2.0) * x * x) * value_at(colour_matching(1), um);
}

/// The same scene in light of one wavelength, by all else of the plan; waves by a plan of their own.
class LinePictures {
 public:
  LinePictures(const Kind& kind, RenderPlan chosen)
      : demand_(kind.demand), scene_(kind.scene), theta_(kind.table.values()), plan_(std::move(chosen)) {
    scene_.microscope.channel_light.reset();
    plan_.wavelengths = nullptr;
  }
  Image operator()(double nm) {
    theta_[static_cast<std::size_t>(scene_.microscope.wavelength_nm.index)] = nm;
    return render(scene_, plan_.wave ? plan(scene_, demand_, theta_) : plan_, theta_, {}, 1).intensity;
  }

 private:
  Demand demand_;
  Scene scene_;
  Theta theta_;
  RenderPlan plan_;
};

TEST(ChannelLight, IsTheSumOfItsLinesForEveryKind) {
  for (Kind& kind : testing::every_kind_small()) {
    SCOPED_TRACE(kind.name);
    if (std::holds_alternative<Crystal>(kind.scene.sample)) continue;  // its half-wave voltage is of one wavelength
    if (std::holds_alternative<Slab>(kind.scene.sample)) continue;     // as plates are, and dear
    light_up(kind);
    const Theta theta = kind.table.values();
    const RenderPlan chosen = plan(kind.scene, kind.demand, theta);
    ASSERT_TRUE(chosen.wavelengths);
    LinePictures line_picture(kind, chosen);
    const Image summed = render(kind.scene, chosen, theta, {}, 1).intensity;
    // The trapezium rule of a smooth function that vanishes at both ends.
    Image lines(summed.width(), summed.height(), 0);
    double all = 0;
    const bool waves = kind.demand.ceiling == Ceiling::wave;
    // Of plates with hundreds of fringes a picture a line costs most: they have laws of their own.
    const bool dear = waves || chosen.wavelengths->size() > 100;
    const double step_nm = dear ? 12 : 5;
    for (double nm = 405; nm < 690; nm += step_nm) {
      const double w = weight_at(nm);
      if (w < 1e-7 * weight_at(kCentreNm)) continue;
      const Image one = line_picture(nm);
      for (std::size_t i = 0; i < lines.size(); ++i) lines.values()[i] += w * one.values()[i];
      all += w;
    }
    double worst = 0;
    for (std::size_t i = 0; i < lines.size(); ++i) {
      ASSERT_TRUE(std::isfinite(summed.values()[i]));
      worst = std::max(worst, std::abs(lines.values()[i] / all - summed.values()[i]));
    }
    // Waves: in grids of their own, and with resonances. Discs: retardances next to the forces have no bound.
    EXPECT_LT(worst, waves ? 1e-2 : dear ? 1e-3 : kind.name == "disc" ? 5e-3 : 2 * kind.demand.intensity_accuracy);
  }
}

/// Of a picture by a number of the light, against differences.
void expect_slope(const Kind& kind, int index, double step) {
  const Theta theta = kind.table.values();
  const RenderPlan chosen = plan(kind.scene, kind.demand, theta);
  const Rendering r = render(kind.scene, chosen, theta, {index}, 1);
  Theta up = theta, down = theta;
  up[static_cast<std::size_t>(index)] += step, down[static_cast<std::size_t>(index)] -= step;
  const Image above = render(kind.scene, chosen, up, {}, 1).intensity,
              below = render(kind.scene, chosen, down, {}, 1).intensity;
  double largest = 0, worst = 0;
  for (std::size_t i = 0; i < above.size(); ++i) {
    const double slope = (above.values()[i] - below.values()[i]) / (2 * step);
    largest = std::max(largest, std::abs(slope));
    worst = std::max(worst, std::abs(slope - r.derivatives[0].values()[i]));
  }
  EXPECT_GT(largest, 0);
  EXPECT_LT(worst, 2e-3 * largest) << kind.table[index].name;
}

// Other channels' light in one, each in units of what it records without a sample: up to a gain, a row of a matrix.
TEST(ChannelLight, ChannelsMixAsTheirPicturesDo) {
  for (Kind& kind : testing::every_kind_small()) {
    if (kind.name != "radial" && kind.name != "cell" && kind.name != "disc") continue;
    SCOPED_TRACE(kind.name);
    if (const ParameterRef load = kind.table.find("load_n")) kind.table[load].value = 40;
    Microscope& m = kind.scene.microscope;
    m.channel_light.emplace().lamp.planck_k = kind.number("planck_k", kPlanck);
    const auto seen_by = [&](int channel) { return std::make_shared<const SpectralTable>(colour_matching(channel)); };
    const auto picture = [&] {
      const Theta theta = kind.table.values();
      return render(kind.scene, plan(kind.scene, kind.demand, theta), theta, {}, 1).intensity;
    };
    std::vector<Image> alone;
    for (const int channel : {0, 1, 2}) m.channel_light->sensitivity = seen_by(channel), alone.push_back(picture());
    m.channel_light->sensitivity = seen_by(0);
    constexpr double kGreen = 0.3, kBlue = -0.1;
    m.crosstalk = {{seen_by(1), kind.number("green", kGreen)}, {seen_by(2), kind.number("blue", kBlue)}};
    const Image mixed = picture();
    double worst = 0;
    for (std::size_t i = 0; i < mixed.size(); ++i) {
      const double expected =
          (alone[0].values()[i] + kGreen * alone[1].values()[i] + kBlue * alone[2].values()[i]) / (1 + kGreen + kBlue);
      worst = std::max(worst, std::abs(mixed.values()[i] - expected));
    }
    EXPECT_LT(worst, kind.name == "disc" ? 5e-3 : 2 * kind.demand.intensity_accuracy);
    expect_slope(kind, m.crosstalk[0].share.index, 0.01);
    expect_slope(kind, m.crosstalk[1].share.index, 0.01);
    expect_slope(kind, m.channel_light->lamp.planck_k.index, 5);
  }
}

TEST(ChannelLight, ItsNumbersHaveDerivatives) {
  for (Kind& kind : testing::every_kind_small()) {
    if (kind.name != "radial" && kind.name != "cell" && kind.name != "volume" && kind.name != "bipolar" &&
        kind.name != "disc")
      continue;
    SCOPED_TRACE(kind.name);
    // So many fringes that no light of many wavelengths shows any have no slopes either.
    if (const ParameterRef load = kind.table.find("load_n")) kind.table[load].value = 40;
    light_up(kind);
    const ChannelLight& light = *kind.scene.microscope.channel_light;
    expect_slope(kind, light.lamp.planck_k.index, 5);
    expect_slope(kind, light.filters[0].centre_nm.index, 0.2);
    expect_slope(kind, light.filters[0].fwhm_nm.index, 0.2);
    expect_slope(kind, kind.four[0], 1e-4 * kind.table[kind.four[0]].value);
  }
}

// A line of finite width: fringes lose contrast as its Fourier transform does.
TEST(ChannelLight, ABandwidthTakesContrastFromFringes) {
  testing::TableBuilder t;
  Scene scene;
  Cell cell;
  cell.thickness_um = t.fixed("thickness_um", 40);
  UniformDirector director;
  director.azimuth_deg = t.fixed("azimuth_deg", 45), director.tilt_deg = t.fixed("tilt_deg", 0);
  cell.director = director;
  scene.sample = cell;
  ConstantIndices material;
  material.ordinary = t.fixed("ordinary", 1.52), material.birefringence = t.fixed("birefringence", 0.2);
  scene.material = material;
  scene.surround_index = t.fixed("index", 1.52);
  Microscope& m = scene.microscope;
  m.polarizer_deg = t.fixed("polarizer_deg", 0), m.analyzer_deg = t.fixed("analyzer_deg", 90);
  m.wavelength_nm = t.fixed("wavelength_nm", 550), m.bandwidth_nm = t.fixed("bandwidth_nm", 10);
  scene.view.width = scene.view.height = 1;
  const double phase = 2 * std::numbers::pi * 40 * 0.2 / 0.55;
  for (const double fwhm : {2.0, 10.0, 30.0}) {
    t.table[m.bandwidth_nm].value = fwhm;
    Demand demand;
    demand.ceiling = Ceiling::e_only;
    const Theta theta = t.table.values();
    const double picture = render(scene, plan(scene, demand, theta), theta, {}, 1).intensity(0, 0);
    // A sum over wavelengths of sin^2(phase / 2) beside the line's shape.
    double sum = 0, all = 0;
    for (int i = -4000; i <= 4000; ++i) {
      const double y = i * 1.25e-3 * fwhm / 550, w = std::exp(-4 * std::log(2.0) * std::pow(550 * y / fwhm, 2)),
                   half = std::sin(0.5 * phase / (1 + y));
      sum += w * half * half, all += w;
    }
    EXPECT_NEAR(picture, sum / all, 2 * demand.intensity_accuracy) << fwhm;
  }
}

// The rule of a channel does not change where its numbers do not, and holds white whatever they are.
TEST(ChannelLight, HoldsWhite) {
  Kind kind = testing::every_kind_small().front();
  light_up(kind);
  Theta theta = kind.table.values();
  const auto rule = wavelength_rule(kind.scene.microscope, theta, 20, 12);
  EXPECT_EQ(rule_at(rule, kind.scene.microscope, theta), rule);
  theta[static_cast<std::size_t>(kind.scene.microscope.channel_light->lamp.planck_k.index)] = 3300;
  const auto hotter = rule_at(rule, kind.scene.microscope, theta);
  EXPECT_NE(hotter, rule);
  EXPECT_EQ(hotter->size(), rule->size());
  double white = 0;
  for (const double w : hotter->weight) white += w;
  EXPECT_NEAR(white, 1, 1e-12);
  for (const std::vector<double>& slope : hotter->slope) {
    double sum = 0;
    for (const double w : slope) sum += w;
    EXPECT_NEAR(sum, 0, 1e-12);
  }
}

}  // namespace
}  // namespace birefit
