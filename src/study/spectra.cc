#include "study/spectra.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <memory>
#include <numbers>

#include <fmt/format.h>

#include "birefit/render.h"
#include "instrument/channel_light.h"
#include "instrument/coherence.h"
#include "instrument/colour.h"
#include "study/timing.h"

namespace birefit {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
/// Accuracy of the picture of each wavelength: of the truth, and where rules are compared.
constexpr double kTruth = 1e-8, kOfLines = 1e-6;

/// A table of one function of the CIE's observer.
std::shared_ptr<const SpectralTable> observer(int function) {
  return std::make_shared<SpectralTable>(colour_matching(function));
}

/// A sample between crossed polarizers in light of illuminant E, as the observer's X, Y and Z see it.
struct WhiteScene {
  std::string name;
  ParameterTable table;
  Scene scene;
  Demand demand{.ceiling = Ceiling::e_only};
  double reach_um = 20;  ///< path differences that the truth must resolve

  ParameterRef fixed(const std::string& key, double value) { return table.add_constant(key, value); }
  explicit WhiteScene(std::string called) : name(std::move(called)) {
    scene.view.width = scene.view.height = 1;
    scene.surround_index = fixed("surround", 1.5);
    scene.microscope.wavelength_nm = fixed("wavelength_nm", 550);
    scene.microscope.polarizer_deg = fixed("polarizer_deg", 0);
    scene.microscope.analyzer_deg = fixed("analyzer_deg", 90);
    scene.microscope.channel_light.emplace();
  }
  /// One absorption band at 210 nm, a nematic's.
  void material(double birefringence) {
    scene.material =
        ConstantIndices{fixed("ordinary", 1.52), fixed("birefringence", birefringence), fixed("resonance_nm", 210)};
  }
  Cell& cell(double thickness_um) {
    Cell layer;
    layer.thickness_um = fixed("thickness_um", thickness_um);
    scene.sample = layer;
    return std::get<Cell>(scene.sample);
  }
  void plate(double retardance_um) {
    UniformDirector director;
    director.tilt_deg = fixed("tilt_deg", 0), director.azimuth_deg = fixed("azimuth_deg", 45);
    cell(retardance_um / 0.1).director = director;
    material(0.1);
  }
  void twisted(double thickness_um, double twist_deg) {
    TwistedDirector director;
    director.twist_deg = fixed("twist_deg", twist_deg);
    director.azimuth_deg = fixed("azimuth_deg", 20);
    director.pretilt_deg = fixed("pretilt_deg", 0);
    cell(thickness_um).director = director;
    material(0.18);
  }
  void droplet(double diameter_um, int pixels) {
    Droplet ball;
    ball.diameter_um = fixed("diameter_um", diameter_um);
    scene.sample = ball;
    scene.view.width = scene.view.height = pixels;
    scene.view.pixel_size_um = fixed("pixel_size_um", 1.1 * diameter_um / pixels);
    scene.view.center_x_px = fixed("center_x", 0.5 * pixels - 0.4);
    scene.view.center_y_px = fixed("center_y", 0.5 * pixels - 0.3);
    material(0.15);
  }
  Scene of_function(int function) const {
    Scene one = scene;
    one.microscope.channel_light->sensitivity = observer(function);
    return one;
  }
};

/// What one rule for all three functions makes of the picture.
using Colours = std::array<Image, 3>;

/// As planned, or by these wavelengths instead.
RenderPlan by_rule(RenderPlan planned, std::shared_ptr<const WavelengthRule> rule) {
  planned.wavelengths = std::move(rule);
  planned.of_wavelengths.clear();
  return planned;
}

/// As many wavelengths as the spectra and fringes have detail.
std::shared_ptr<const WavelengthRule> every_detail(const Microscope& microscope, const Theta& theta, double reach_um) {
  const SpectralSum fine = channel_of(microscope, theta, reach_um);
  auto rule = std::make_shared<WavelengthRule>();
  rule->weight = fine.weight.front();
  for (const double um : fine.wavelength_um) rule->wavelength_nm.push_back(1000 * um);
  return rule;
}

/// Equal steps in the wavelength over the table, as hand-written sums have them.
std::shared_ptr<const WavelengthRule> steps_of_wavelength(const SpectralTable& table, double step_nm) {
  auto rule = std::make_shared<WavelengthRule>();
  double sum = 0;
  for (double nm = 400; nm <= 700 + 1e-9; nm += step_nm) {
    rule->wavelength_nm.push_back(nm);
    rule->weight.push_back(value_at(Spectrum(table), 1e-3 * nm));
    sum += rule->weight.back();
  }
  for (double& weight : rule->weight) weight /= sum;
  return rule;
}

double worst_of(const Colours& a, const Colours& b) {
  double worst = 0;
  for (std::size_t c = 0; c < 3; ++c)
    for (std::size_t i = 0; i < a[c].size(); ++i)
      worst = std::max(worst, std::abs(a[c].values()[i] - b[c].values()[i]));
  return worst;
}

/// Values are shares of the white, which is (1, 1, 1) of illuminant E.
double farthest_colour(const Colours& a, const Colours& b) {
  const Xyz white{1, 1, 1};
  const auto colour = [&](const Colours& of, std::size_t i) {
    return lab_of({of[0].values()[i], of[1].values()[i], of[2].values()[i]}, white);
  };
  double farthest = 0;
  for (std::size_t i = 0; i < a[0].size(); ++i) farthest = std::max(farthest, ciede2000(colour(a, i), colour(b, i)));
  return farthest;
}

class Measured {
 public:
  Measured(const WhiteScene& s, std::vector<SpectrumPoint>& points) : s_(s), points_(points), theta_(s.table.values()) {
    for (int c = 0; c < 3; ++c) scenes_[static_cast<std::size_t>(c)] = s.of_function(c);
    Demand exact = s.demand, of_lines = s.demand;
    exact.intensity_accuracy = kTruth, of_lines.intensity_accuracy = kOfLines;
    for (std::size_t c = 0; c < 3; ++c) {
      plans_[c] = plan(scenes_[c], exact, theta_);
      truth_[c] = picture(c, every_detail(scenes_[c].microscope, theta_, s.reach_um));
      plans_[c] = plan(scenes_[c], of_lines, theta_);
    }
  }
  template <class RuleOf>
  void add(const std::string& rule, const std::string& effort, const RuleOf& rule_of) {
    std::array<std::shared_ptr<const WavelengthRule>, 3> rules;
    for (std::size_t c = 0; c < 3; ++c) rules[c] = rule_of(c);
    Colours seen;
    const double seconds = study::seconds_of([&] {
      for (std::size_t c = 0; c < 3; ++c) seen[c] = picture(c, rules[c]);
    });
    record(rule, effort, static_cast<int>(rules[0]->size()), seconds, seen);
  }
  void planned(double accuracy) {
    Demand demand = s_.demand;
    demand.intensity_accuracy = accuracy;
    std::array<RenderPlan, 3> plans;
    for (std::size_t c = 0; c < 3; ++c) plans[c] = plan(scenes_[c], demand, theta_);
    Colours seen;
    const double seconds = study::seconds_of([&] {
      for (std::size_t c = 0; c < 3; ++c) seen[c] = render(scenes_[c], plans[c], theta_, {}, 1).intensity;
    });
    const auto& rule = plans[0].wavelengths;
    record("planned", fmt::format("{:.0e}", accuracy), rule ? static_cast<int>(rule->size()) : 1, seconds, seen);
  }
  /// Of a plate at 45 degrees: (1 - Re chi)/2 by the channels' degree of coherence.
  void closed_form(double retardance_um) {
    const Channels channels(EqualEnergy{}, {}, {colour_matching(0), colour_matching(1), colour_matching(2)});
    const SpectralSum fine = channels.fine(s_.reach_um);
    const auto& material = std::get<ConstantIndices>(s_.scene.material);
    const double resonance2 = std::pow(1e-3 * material.resonance_nm.in(theta_), 2);
    std::vector<double> t;
    for (const double um : fine.wavelength_um) {
      constexpr double kSodium2 = 0.5893 * 0.5893;
      t.push_back(um * (kSodium2 - resonance2) / (kSodium2 * (um * um - resonance2)));
    }
    const Coherence coherence(fine, t, s_.reach_um);
    Colours seen;
    for (Image& image : seen) image = Image(1, 1, 0);
    constexpr int kMany = 1000;
    const double seconds = study::seconds_of([&] {
      for (int i = 0; i < kMany; ++i)
        for (std::size_t c = 0; c < 3; ++c) seen[c](0, 0) = 0.5 * coherence.at(c, retardance_um).loss;
    });
    record("closed form", "", 0, seconds / kMany, seen);
  }
  const Scene& scene(std::size_t c) const { return scenes_[c]; }
  const Theta& theta() const { return theta_; }

 private:
  Image picture(std::size_t c, const std::shared_ptr<const WavelengthRule>& rule) const {
    return render(scenes_[c], by_rule(plans_[c], rule), theta_, {}, 1).intensity;
  }
  void record(const std::string& rule, const std::string& effort, int wavelengths, double seconds,
              const Colours& seen) {
    points_.push_back({s_.name, rule, effort, wavelengths, seconds / static_cast<double>(truth_[0].size()),
                       worst_of(seen, truth_), farthest_colour(seen, truth_)});
  }

  const WhiteScene& s_;
  std::vector<SpectrumPoint>& points_;
  Theta theta_;
  std::array<Scene, 3> scenes_;
  std::array<RenderPlan, 3> plans_;
  Colours truth_;
};

void measure_rules(bool quick, const WhiteScene& s, std::vector<SpectrumPoint>& points) {
  Measured measured(s, points);
  const auto rule = [&](double reach_um, int n) {
    return [&measured, reach_um, n](std::size_t c) {
      return wavelength_rule(measured.scene(c).microscope, measured.theta(), reach_um, n);
    };
  };
  for (const int n : quick ? std::vector<int>{8, 30} : std::vector<int>{5, 8, 12, 17, 24, 34, 48, 68})
    measured.add("Gauss", fmt::format("n={}", n), rule(s.reach_um, n));
  for (const int n : quick ? std::vector<int>{20, 60} : std::vector<int>{8, 12, 17, 24, 34, 48, 68, 100, 200, 400})
    measured.add("even in 1/wavelength", fmt::format("n={}", n), rule(0, n));
  for (const double step : quick ? std::vector<double>{20, 5} : std::vector<double>{50, 30, 20, 10, 5, 2, 1})
    measured.add("even in wavelength", fmt::format("{:g} nm", step),
                 [step](std::size_t c) { return steps_of_wavelength(*observer(static_cast<int>(c)), step); });
  for (const double accuracy : quick ? std::vector<double>{1e-3} : std::vector<double>{1e-2, 1e-3, 1e-4, 1e-5, 1e-6})
    measured.planned(accuracy);
  if (s.name.starts_with("plate")) measured.closed_form(5);
}

/// A uniform layer at 45 degrees between crossed polarizers: two waves, each to and fro between the faces. [S4] stops
/// after M double reflections; all of them are a geometric series.
struct EchoedLayer {
  double surround, ordinary = 1.52, extraordinary = 1.7, thickness_um = 10;

  /// Amplitude behind it, `most` double reflections, all of them below 0.
  std::complex<double> amplitude(double n, double um, int most) const {
    const double r = (n - surround) / (n + surround);
    const std::complex<double> once = std::polar(1.0, 2 * std::numbers::pi * n * thickness_um / um),
                               echo = r * r * once * once;
    std::complex<double> sum = 1.0 / (1.0 - echo), power = 1;
    if (most >= 0) sum = 0;
    for (int m = 0; m <= most; ++m, power *= echo) sum += power;
    return (1 - r * r) * once * sum;
  }
  double intensity(double um, int most) const {
    return 0.25 * std::norm(amplitude(extraordinary, um, most) - amplitude(ordinary, um, most));
  }
};

void measure_echoes(std::vector<SpectrumPoint>& points) {
  for (const double surround : {1.43, 1.0})
    for (const double fwhm_nm : {1.0, 40.0}) {
      const EchoedLayer layer{surround};
      const SpectralSum light = Channels(GaussianLine{0.59, 1e-3 * fwhm_nm}, {}, {Spectrum(EqualEnergy{})}).fine(100);
      const auto seen = [&](int most) {
        return light.of([&](double um) { return layer.intensity(um, most); }).front();
      };
      const double all = seen(-1);
      for (int most = 0; most <= 6; ++most) {
        double now = 0;
        const double seconds = study::seconds_of([&] { now = seen(most); });
        points.push_back({fmt::format("echoes in {:g}, {:g} nm", surround, fwhm_nm), "M", fmt::format("M={}", most),
                          static_cast<int>(light.size()), seconds, std::abs(now - all), kNaN});
      }
    }
}

}  // namespace

std::vector<SpectrumPoint> measure_spectra(bool quick, const std::function<void(const std::string&)>& say) {
  std::vector<SpectrumPoint> points;
  std::vector<WhiteScene> scenes;
  scenes.emplace_back("plate, 5 um of retardance").plate(5);
  scenes.emplace_back("cell, 90 deg in 10 um").twisted(10, 90);
  if (!quick) scenes.emplace_back("cholesteric, 10 turns in 20 um").twisted(20, 3600);
  scenes.emplace_back("droplet of 20 um").droplet(20, 48);
  for (const WhiteScene& s : scenes) {
    if (say) say("white light: " + s.name);
    measure_rules(quick, s, points);
  }
  measure_echoes(points);
  return points;
}

namespace study {
namespace {

constexpr double kAsked = 1e-4, kOfTruth = 1e-6;

/// The Y of a picture as planned for 1e-4 against the same with every detail of its light, or, where a wavelength is
/// dear, by equal steps of 1/wavelength, which are good to 1e-6 there.
StressPoint planned_picture(const std::string& sweep, double value, const std::string& what, const WhiteScene& s,
                            bool dear = false) {
  constexpr int kSteps = 400;
  const Theta theta = s.table.values();
  const Scene& scene = s.scene;
  Demand demand = s.demand;
  demand.intensity_accuracy = kOfTruth;
  const RenderPlan exact =
      by_rule(plan(scene, demand, theta), dear ? wavelength_rule(scene.microscope, theta, 0, kSteps)
                                               : every_detail(scene.microscope, theta, s.reach_um));
  const Image truth = render(scene, exact, theta, {}, 1).intensity;
  demand.intensity_accuracy = kAsked;
  const RenderPlan chosen = plan(scene, demand, theta);
  StressPoint p{sweep, value, what, 0, std::max(kAsked, chosen.numerical_error), 0, ""};
  p.samples = chosen.wavelengths ? static_cast<double>(chosen.wavelengths->size()) : 1;
  if (chosen.numerical_error > 2 * kAsked) {
    p.flag = fmt::format("its plan expects {:.1e}", chosen.numerical_error);
    p.error = kNaN, p.estimate = std::numeric_limits<double>::infinity();
    return p;
  }
  const Image image = render(scene, chosen, theta, {}, 1).intensity;
  for (std::size_t i = 0; i < truth.size(); ++i)
    p.error = std::max(p.error, std::abs(image.values()[i] - truth.values()[i]));
  return p;
}

/// A line that is Gaussian in place of the lamp.
void filtered(WhiteScene& s, double fwhm_nm) {
  LightFilter filter;
  filter.centre_nm = s.fixed("centre_nm", 590), filter.fwhm_nm = s.fixed("fwhm_nm", fwhm_nm);
  s.scene.microscope.channel_light->filters = {filter};
}

std::vector<double> some(bool quick, std::vector<double> all) {
  if (!quick) return all;
  return {all.front(), all[all.size() / 2], all.back()};
}

}  // namespace

void measure_light_traps(bool quick, std::vector<StressPoint>& points) {
  const auto add = [&](const std::string& sweep, double value, const std::string& what, const WhiteScene& s,
                       bool dear = false) { points.push_back(planned_picture(sweep, value, what, s, dear)); };
  // Where sums with too few wavelengths see fringes that are not there.
  for (const double um : some(quick, {1e-3, 0.03, 0.3, 1, 3, 7, 10, 15, 20, 30, 50, 80})) {
    WhiteScene s("plate");
    s.plate(um);
    s.scene.microscope.channel_light->sensitivity = observer(1);
    s.reach_um = std::max(20.0, 3 * um);
    add("light_retardance_um", um, "auto of a plate", s);
  }
  for (const double degrees : some(quick, {1, 90, 700, 1800, 3600, 7200, 14400})) {
    WhiteScene s("cell");
    s.twisted(20, degrees);
    s.scene.microscope.channel_light->sensitivity = observer(1);
    s.reach_um = 40;
    add("light_twist_deg", degrees, "auto of a cell", s, true);
  }
  for (const double nm : some(quick, {0.1, 0.3, 1, 3, 10, 30, 60, 100})) {
    WhiteScene s("plate");
    s.plate(30);
    filtered(s, nm);
    s.reach_um = 100;
    add("light_fwhm_nm", nm, "auto of a plate", s);
  }
  // Fringes between the faces, from a line that resolves them all to light that resolves none.
  for (const double nm : some(quick, {0.1, 1, 3, 10, 30, 100})) {
    WhiteScene s("plate");
    s.plate(3);
    s.scene.surround_index = s.fixed("air", 1.0);
    s.demand.ceiling = Ceiling::reflections;
    filtered(s, nm);
    s.reach_um = 400;
    add("light_echo_fwhm_nm", nm, "auto of a plate, reflections", s);
  }
  for (const double um : some(quick, {1, 2, 5, 12, 30, 60})) {
    WhiteScene s("droplet");
    s.demand.ceiling = Ceiling::one_way;
    s.droplet(um, 12);
    s.scene.microscope.channel_light->sensitivity = observer(1);
    s.reach_um = std::max(20.0, 0.6 * um);
    add("light_diameter_um", um, "auto of a droplet", s);
  }
}

}  // namespace study
}  // namespace birefit
