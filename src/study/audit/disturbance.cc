#include "study/audit/disturbance.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <string_view>
#include <utility>

#include "birefit/render.h"
#include "fit/problem/task.h"
#include "samples/kind.h"
#include "study/audit/picture.h"

namespace birefit::study {
namespace {

struct Span {
  double low, high;
  double range() const { return high - low; }
};
Span span(const Image& light) {
  const auto [low, high] = std::minmax_element(light.values().begin(), light.values().end());
  return {*low, *high};
}

/// Calls what(value, X, Y): right and up, from the middle of the image, 1 at its edge along the longer side.
template <class What>
void for_places(Image& image, const What& what) {
  const double half = 0.5 * (std::max(image.width(), image.height()) - 1);
  for (int y = 0; y < image.height(); ++y)
    for (int x = 0; x < image.width(); ++x)
      what(image(x, y), (x - 0.5 * (image.width() - 1)) / half, (0.5 * (image.height() - 1) - y) / half);
}

bool ends_with_one_of(std::string_view name, std::initializer_list<std::string_view> endings) {
  return std::any_of(endings.begin(), endings.end(), [&](std::string_view end) { return name.ends_with(end); });
}

/// What is stated, by as much as it is off in practice; what leaves no trace by half, once and twice its uncertainty.
Disturbance of_stated(int index, const Parameter& parameter) {
  Disturbance d;
  d.name = parameter.name, d.what = "stated otherwise than it is", d.unit = parameter.unit, d.parameter = index;
  if (ends_with_one_of(parameter.name, {"focus_um"})) {
    d.sizes = {0.1, 0.5, 2};
  } else if (ends_with_one_of(parameter.name, {"objective_na"})) {
    d.sizes = {0.01, 0.025, 0.06}, d.unit = "%", d.of_share = true;
  } else if (ends_with_one_of(parameter.name, {"polarizer_deg", "analyzer_deg"})) {
    d.sizes = {0.5, 2, 10};
  } else if (ends_with_one_of(parameter.name, {"surround.index", "ordinary"})) {
    d.sizes = {0.002, 0.01, 0.02};
  } else {
    const double sd = parameter.known_to.of(parameter.value);
    d.sizes = {0.5 * sd, sd, 2 * sd};
  }
  const auto at = static_cast<std::size_t>(index);
  d.scene = [at, share = d.of_share](Exposure& e, Theta& theta) {
    theta[at] += e.sign * e.size * (share ? theta[at] : 1);
  };
  return d;
}

Theta with(Theta theta, const std::vector<int>& numbers, double more) {
  for (const int index : numbers) theta[static_cast<std::size_t>(index)] += more;
  return theta;
}

/// Of every frame, once.
std::vector<int> numbers_in(const FitJob& job, ParameterRef Microscope::*number) {
  std::vector<int> found;
  for_each_scene(job.measurements, [&](const Scene& scene) {
    const ParameterRef ref = scene.microscope.*number;
    if (ref && std::find(found.begin(), found.end(), ref.index) == found.end()) found.push_back(ref.index);
  });
  return found;
}

void add_mixed(const FitJob& job, std::vector<Disturbance>& all) {
  if (const std::vector<int> wavelengths = numbers_in(job, &Microscope::wavelength_nm); !wavelengths.empty()) {
    Disturbance d{"bandwidth", "standard deviation of the light's wavelengths", "nm", {3, 6, 12}};
    d.mixed = [wavelengths](Exposure& e, const Theta& theta) {
      const double off = std::sqrt(3.0) * e.size;  // Gauss and Hermite's three
      return std::vector<std::pair<double, Theta>>{
          {2.0 / 3, theta}, {1.0 / 6, with(theta, wavelengths, off)}, {1.0 / 6, with(theta, wavelengths, -off)}};
    };
    all.push_back(d);
  }
  if (const std::vector<int> analyzers = numbers_in(job, &Microscope::analyzer_deg); !analyzers.empty()) {
    Disturbance d{"leak", "of the analyser: the other polarization's light", "%", {0.001, 0.003, 0.01}};
    d.mixed = [analyzers](Exposure& e, const Theta& theta) {
      return std::vector<std::pair<double, Theta>>{{1, theta}, {e.size, with(theta, analyzers, 90)}};
    };
    all.push_back(d);
  }
}

/// A number that no table has.
ParameterRef new_number(Theta& theta, double value) {
  theta.push_back(value);
  return {static_cast<int>(theta.size()) - 1};
}

/// Light from more directions and of other wavelengths than is stated, and indices that go with the wavelength.
void add_instrument(const FitJob& job, std::vector<Disturbance>& all) {
  const auto each = [&](const auto& holds) {
    bool all_hold = true;
    for_each_scene(job.measurements, [&](const Scene& scene) { all_hold = all_hold && holds(scene); });
    return all_hold;
  };
  const auto condenser_shows = [&](const Scene& scene) {
    if (scene.microscope.condenser || !scene.microscope.directions.empty()) return false;
    Scene lit = scene;
    Theta theta = job.parameters.values();
    lit.microscope.condenser.emplace().na = new_number(theta, 0.2);
    return plan(lit, job.demand, theta).condenser_rings > 0;
  };
  if (each(condenser_shows)) {
    Disturbance d{"condenser", "light from a cone of this numerical aperture", "", {0.03, 0.1, 0.2}};
    d.added = [](Exposure& e, Scene& scene, Theta& theta) {
      scene.microscope.condenser.emplace().na = new_number(theta, e.size);
    };
    all.push_back(d);
  }
  if (each([](const Scene& scene) {
        return !scene.microscope.channel_light && !scene.microscope.bandwidth_nm &&
               !std::holds_alternative<Crystal>(scene.sample);  // its half-wave voltage is of one wavelength
      })) {
    Disturbance d{"colour channel", "even light of so many wavelengths for one, full width", "nm", {20, 50, 90}};
    d.added = [](Exposure& e, Scene& scene, Theta& theta) {
      scene.microscope.bandwidth_nm = new_number(theta, e.size);
    };
    all.push_back(d);
  }
  if (each([](const Scene& scene) { return scene.microscope.channel_light.has_value(); })) {
    Disturbance d{"lamp", "bluer or redder than stated, in reciprocal temperature", "mired", {5, 25, 150}};
    d.added = [](Exposure& e, Scene& scene, Theta&) {
      // The ratio of two black bodies, by Wien's law.
      auto tint = std::make_shared<SpectralTable>();
      constexpr double kSecondRadiation = 14387.768775, kMired = 1e-6;  // um K, 1/K
      for (double um = 0.3; um < 1.2; um += 0.005) {
        tint->wavelength_um.push_back(um);
        tint->value.push_back(std::exp(-e.sign * e.size * kMired * kSecondRadiation * (1 / um - 1 / 0.55)));
      }
      LightFilter filter;
      filter.table = std::move(tint);
      scene.microscope.channel_light->filters.push_back(std::move(filter));
    };
    all.push_back(d);
    if (each([](const Scene& scene) {
          const auto* constant = std::get_if<ConstantIndices>(&scene.material);
          return constant && !constant->resonance_nm;
        })) {
      Disturbance dispersion{"dispersion", "a birefringence with a resonance at", "nm", {120, 180, 240}};
      dispersion.added = [](Exposure& e, Scene& scene, Theta& theta) {
        std::get<ConstantIndices>(scene.material).resonance_nm = new_number(theta, e.size);
      };
      all.push_back(dispersion);
    }
  }
}

/// Of a bar: a field without any voltage, of charge that its last one has left there.
void add_charge(const FitJob& job, std::vector<Disturbance>& all) {
  bool bars = true;
  for_each_scene(job.measurements, [&](const Scene& scene) {
    const auto* bar = std::get_if<Crystal>(&scene.sample);
    bars = bars && bar && !bar->built_in_bias_v;
  });
  if (!bars) return;
  Disturbance d{"charge", "in the bar, as a share of its half-wave voltage", "%", {0.01, 0.03, 0.1}};
  d.beyond_usual = true;
  d.added = [](Exposure& e, Scene& scene, Theta& theta) {
    auto& bar = std::get<Crystal>(scene.sample);
    bar.built_in_bias_v = new_number(theta, e.sign * e.size * bar.half_wave_voltage_v.in(theta));
  };
  all.push_back(d);
}

void add_light(std::vector<Disturbance>& all) {
  const auto add = [&](const char* name, const char* what, const char* unit, std::array<double, 3> sizes, auto light) {
    Disturbance d{name, what, unit, sizes};
    d.light = [light](Exposure& e, const Scene&, const Theta&, Image& image) { light(e, image); };
    all.push_back(d);
  };
  constexpr std::array<double, 3> kStray = {0.005, 0.03, 0.1}, kUneven = {0.01, 0.04, 0.15};
  add("stray light, tilted", "rising across the picture, of the range", "%", kStray, [](Exposure& e, Image& image) {
    const double range = span(image).range();
    for_places(image, [&](double& v, double x, double) { v += e.size * range * 0.5 * (1 + e.sign * x); });
  });
  add("stray light, humped", "from the middle outwards less, of the range", "%", kStray, [](Exposure& e, Image& image) {
    const double range = span(image).range();
    for_places(image, [&](double& v, double x, double y) { v += e.size * range * std::exp(-2 * (x * x + y * y)); });
  });
  add("field stop", "stray light inside of a round edge, of the range", "%", kStray, [](Exposure& e, Image& image) {
    const double range = span(image).range();
    for_places(image, [&](double& v, double x, double y) {
      v += e.size * range / (1 + std::exp((std::hypot(x, y) - 0.85) / 0.03));
    });
  });
  add("reflection", "the picture again, shifted, of its light", "%", kStray, [](Exposure& e, Image& image) {
    const double ground = level_of_border(image);
    const Image ghost = shifted(image, 0.09 * image.width(), 0.06 * image.height(), ground);
    for (std::size_t i = 0; i < image.size(); ++i) image.values()[i] += e.size * (ghost.values()[i] - ground);
  });
  add("uneven light", "brighter to one side, at the edge", "%", kUneven, [](Exposure& e, Image& image) {
    for_places(image, [&](double& v, double x, double y) { v *= 1 + e.size * (0.8 * e.sign * x + 0.6 * y); });
  });
  add("vignetting", "darker outwards, at the edge", "%", kUneven, [](Exposure& e, Image& image) {
    for_places(image, [&](double& v, double x, double y) { v *= 1 - e.size * (x * x + y * y); });
  });
  add("blur", "standard deviation", "px", {0.3, 0.7, 1.5},
      [](Exposure& e, Image& image) { image = blurred(image, e.size); });
  add("sharpened", "by an unsharp mask of 1 px, its amount", "", {0.2, 0.5, 1}, [](Exposure& e, Image& image) {
    const Image soft = blurred(image, 1);
    for (std::size_t i = 0; i < image.size(); ++i) image.values()[i] += e.size * (image.values()[i] - soft.values()[i]);
  });
  add("dust", "dark spots", "", {1, 3, 10}, [](Exposure& e, Image& image) {
    std::uniform_real_distribution<double> u(0, 1);
    for (int spot = 0; spot < std::lround(e.size); ++spot) {
      const double x0 = u(e.random) * image.width(), y0 = u(e.random) * image.height(), radius = 1 + u(e.random);
      for (int y = 0; y < image.height(); ++y)
        for (int x = 0; x < image.width(); ++x)
          image(x, y) *= 1 - 0.6 * std::exp(-0.5 * (std::pow(x - x0, 2) + std::pow(y - y0, 2)) / (radius * radius));
    }
  });
  Disturbance aspect{"pixel aspect", "wider than high", "%", {0.002, 0.01, 0.05}};
  aspect.light = [](Exposure& e, const Scene& scene, const Theta& theta, Image& image) {
    const auto at = [&](ParameterRef ref, double otherwise) { return ref ? ref.in(theta) : otherwise; };
    image = stretched(image, 0.5 * e.sign * e.size, at(scene.view.center_x_px, 0.5 * (image.width() - 1)),
                      at(scene.view.center_y_px, 0.5 * (image.height() - 1)));
  };
  all.push_back(aspect);
}

void add_neighbour(std::vector<Disturbance>& all) {
  Disturbance d{"neighbour", "another droplet of its kind, from middle to middle", "diameters", {1.3, 1.15, 1.05}};
  d.light = [](Exposure& e, const Scene& scene, const Theta& theta, Image& image) {
    const double diameter = traits_of(scene).sphere_diameter_um.in(theta) / scene.view.pixel_size_um.in(theta);
    const double angle = std::uniform_real_distribution<double>(0, 2 * M_PI)(e.random), ground = level_of_border(image);
    const Image other =
        shifted(image, e.size * diameter * std::cos(angle), e.size * diameter * std::sin(angle), ground);
    for (std::size_t i = 0; i < image.size(); ++i) image.values()[i] += other.values()[i] - ground;
  };
  all.push_back(d);
}

void add_camera(bool even, std::vector<Disturbance>& all) {
  const auto add = [&](const char* name, const char* what, const char* unit, std::array<double, 3> sizes,
                       std::function<void(Exposure&, const Levels&, Image&)> values,
                       std::function<void(Exposure&, const Levels&, Image&)> codes) {
    Disturbance d{name, what, unit, sizes};
    d.values = std::move(values), d.codes = std::move(codes);
    all.push_back(d);
  };
  add("gamma", "light to the power of so much", "", {1.02, 1.1, 1.3},
      [](Exposure& e, const Levels& levels, Image& image) {
        for (double& v : image.values())
          v = levels.dark + levels.range * std::pow(std::max(0.0, (v - levels.dark) / levels.range), e.size);
      },
      {});
  add("black cut", "what is darker is not, of the range", "%", {0.005, 0.02, 0.08}, {},
      [](Exposure& e, const Levels& levels, Image& image) {
        for (double& v : image.values()) v = std::max(v, levels.dark + e.size * levels.range);
      });
  add("saturated", "what is brighter is not, of the range", "%", {0.03, 0.1, 0.25}, {},
      [](Exposure& e, const Levels& levels, Image& image) {
        for (double& v : image.values()) v = std::min(v, levels.dark + (1 - e.size) * levels.range);
      });
  add("few codes", "over the range", "", {60, 16, 6}, {}, [](Exposure& e, const Levels& levels, Image& image) {
    const double step = levels.range / e.size;
    for (double& v : image.values()) v = levels.dark + step * std::round((v - levels.dark) / step);
  });
  if (even) return;
  add("compressed", "as JPEG, its quality", "", {95, 85, 60}, {}, [](Exposure& e, const Levels& levels, Image& image) {
    constexpr double kBlack = 20, kWhite = 220;
    for (double& v : image.values()) v = kBlack + (kWhite - kBlack) * (v - levels.dark) / levels.range;
    image = compressed(image, static_cast<int>(e.size));
    for (double& v : image.values()) v = levels.dark + levels.range * (v - kBlack) / (kWhite - kBlack);
  });
  Disturbance demosaiced{
      "demosaiced", "known at every fourth pixel, between them interpolated, by so much", "%", {0.25, 0.5, 1}};
  demosaiced.codes = [](Exposure& e, const Levels&, Image& image) {
    const Image between = every_fourth(image);
    for (std::size_t i = 0; i < image.size(); ++i)
      image.values()[i] += e.size * (between.values()[i] - image.values()[i]);
  };
  all.push_back(demosaiced);
  Disturbance correlated{"correlated noise", "over a Gaussian of", "px", {0.7, 1.5, 4}};
  correlated.noise = [](Exposure& e, Image& noise) {
    const auto rms = [](const Image& image) {
      return std::sqrt(std::inner_product(image.values().begin(), image.values().end(), image.values().begin(), 0.0));
    };
    const double before = rms(noise);
    noise = blurred(noise, e.size);
    const double after = rms(noise);
    for (double& v : noise.values()) v *= after > 0 ? before / after : 1;
  };
  all.push_back(correlated);
}

void add_lamp(std::vector<Disturbance>& all) {
  const auto scaled = [](const Levels& levels, double by, Image& image) {
    for (double& v : image.values()) v = levels.dark + by * (v - levels.dark);
  };
  Disturbance drift{"lamp drift", "from the first frame to the last", "%", {0.0025, 0.005, 0.02}};
  drift.values = [=](Exposure& e, const Levels& levels, Image& image) {
    scaled(levels, 1 + e.sign * e.size * levels.along, image);
  };
  Disturbance jitter{"lamp jitter", "from frame to frame", "%", {0.001, 0.003, 0.02}};
  jitter.values = [=](Exposure& e, const Levels& levels, Image& image) {
    scaled(levels, 1 + e.size * std::normal_distribution<double>()(e.random), image);
  };
  all.push_back(drift), all.push_back(jitter);
}

}  // namespace

std::vector<Disturbance> disturbances(const FitJob& job) {
  std::vector<Disturbance> all;
  const estimation::Task task(job);
  for (const int index : known_to_all_frames(task)) {
    const Parameter& p = job.parameters[index];
    if (!p.free && !p.linear && p.known_to.of(p.value) > 0) all.push_back(of_stated(index, p));
  }
  bool pictures = true, spheres = true, flat = true;
  for (int g = 0; g < task.frames(); ++g) {
    const Scene& scene = task.picture(g).scene;
    const Traits traits = traits_of(scene);
    pictures = pictures && !traits.even && scene.view.width * scene.view.height > 1;
    spheres = spheres && traits.sphere_diameter_um && scene.view.pixel_size_um;
    flat = flat && !traits.round;
  }
  add_mixed(job, all);
  add_instrument(job, all);
  add_charge(job, all);
  if (pictures) add_light(all);
  if (pictures && spheres) add_neighbour(all);
  add_camera(!pictures, all);
  if (task.frames() > 1) add_lamp(all);
  // A flat sample's retardance and a camera's curve can be taken for each other.
  for (Disturbance& d : all) d.beyond_usual = d.beyond_usual || (flat && d.name == "gamma");
  return all;
}

}  // namespace birefit::study
