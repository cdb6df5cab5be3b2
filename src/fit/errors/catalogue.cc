#include "fit/errors/catalogue.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "fit/errors/discrepancy.h"
#include "fit/problem/effects.h"
#include "samples/kind.h"

namespace birefit::estimation {
namespace {

const std::string kPrefix = "departure.";

/// Beside a picture's gain: what it is called, the unit, the standard deviation that it has among pictures, and how a
/// picture looks that has so much of it.
struct Kind {
  const char* name;
  const char* unit;
  double sd;
  const char* words;
};
struct Uneven {
  Kind kind;
  UnevenLight::Shape shape;
  bool of_intensity;
};
constexpr Uneven kUneven[] = {
    {{"light_x", "", 0.02, "light that grows to the right by"}, UnevenLight::Shape::x, true},
    {{"light_y", "", 0.02, "light that grows upwards by"}, UnevenLight::Shape::y, true},
    {{"light_square", "", 0.02, "light that grows outwards by"}, UnevenLight::Shape::square, true},
    {{"background_x", "", 0.01, "a background that grows to the right by"}, UnevenLight::Shape::x, false},
    {{"background_y", "", 0.01, "a background that grows upwards by"}, UnevenLight::Shape::y, false},
    {{"background_square", "", 0.01, "a background that grows outwards by"}, UnevenLight::Shape::square, false}};
struct Effect {
  Kind kind;
  PictureEffect::Kind effect;
};
constexpr Effect kEffects[] = {
    {{"blur", "px^2", 0.15, "a blur whose variance is"}, PictureEffect::Kind::blur},
    {{"gamma", "", 0.03, "a camera's gamma off by"}, PictureEffect::Kind::gamma},
    {{"curve", "", 0.03, "a camera's curve bent by"}, PictureEffect::Kind::curve},
    {{"stretch_x", "", 0.003, "all of it wider, and as much lower, by"}, PictureEffect::Kind::stretch_x},
    {{"stretch_diagonal", "", 0.003, "all of it stretched along its falling diagonal by"},
     PictureEffect::Kind::stretch_diagonal}};

const char* words_of(const std::string& name) {
  for (const Uneven& one : kUneven)
    if (name == one.kind.name) return one.kind.words;
  for (const Effect& one : kEffects)
    if (name == one.kind.name) return one.kind.words;
  return "";
}

/// Whether these are several exposures of one view, of what is not the same all over: what light and camera depart by
/// is the same in all of them.
bool are_alike(const Task& task) {
  bool even = true;
  const Picture& first = task.picture(0);
  for (int g = 0; g < task.frames(); ++g) {
    const Picture& picture = task.picture(g);
    if (picture.gain.index != first.gain.index || picture.values.width() != first.values.width() ||
        picture.values.height() != first.values.height() || picture.values.height() == 1 ||
        traits_of(picture.scene).round.has_value() != traits_of(first.scene).round.has_value())
      return false;
    even = even && traits_of(picture.scene).even;
  }
  return !even;
}

/// Of bars at several voltages whose charge is not given it is a number, stated as none; nothing where it is given.
ParameterRef with_charge(FitJob& job, const Theta& theta) {
  constexpr double kOfHalfWave = 0.03;  // a standard deviation
  std::vector<Crystal*> bars;
  for_each_scene(job.measurements, [&](Scene& scene) {
    if (Crystal* bar = std::get_if<Crystal>(&scene.sample); bar && !bar->built_in_bias_v) bars.push_back(bar);
  });
  if (bars.size() < 2 || bars.size() != job.measurements.size()) return {};
  const ParameterRef charge = job.parameters.add_constant("sample.crystal.built_in_bias_v", 0, "V");
  job.parameters[charge].known_to.sd = kOfHalfWave * std::abs(bars.front()->half_wave_voltage_v.in(theta));
  for (Crystal* bar : bars) bar->built_in_bias_v = charge;
  return charge;
}

}  // namespace

bool is_asked(const FitOptions& options, std::string_view departure) {
  return std::none_of(options.not_asked.begin(), options.not_asked.end(),
                      [&](const std::string& without) { return departure.starts_with(without); });
}

bool asks_catalogue(const Task& task, Optimum& optimum) {
  constexpr double kHopeless = 0.1;
  if (optimum.stopped || !task.picture(0).effects.empty()) return false;
  if (task.frames() > 1 && !are_alike(task)) return false;
  const Traits traits = traits_of(task.picture(0).scene);
  if (!traits.round && task.frames() > 1) return optimum.misfit.beyond_noise;
  if (!traits.round && !traits.directions) return false;
  if (!(missed_of_all(task, optimum) < kHopeless)) return false;
  if (task.frames() > 1 && !traits.sphere_diameter_um) return false;  // a calibration's loads
  optimum.explained = !leaves_discrepancy(task, optimum);
  return !optimum.explained;
}

bool believes_catalogue(double missed_before, double missed_after) {
  constexpr double kNearly = 0.02, kAll = 0.1;
  return missed_before < kNearly || missed_after < kAll * missed_before;
}

FitJob with_catalogue(const Task& task, const Optimum& optimum) {
  std::vector<int> numbers = told_numbers(task, optimum);
  FitJob wider = task.job;
  if (is_asked(task.job.options, "charge"))
    if (const ParameterRef charge = with_charge(wider, optimum.theta)) numbers.push_back(charge.index);
  wider = with_nuisances(wider, numbers);
  const double gain = std::abs(task.gain_of(0, optimum.theta));
  double brightest = 0;  // of all pictures: one camera's curve is bent over what they show together
  for (int g = 0; g < task.frames(); ++g) brightest = std::max(brightest, optimum.problem->intensity_range(g)[1]);
  const auto term = [&](const Kind& kind, double unit = 1) {
    Parameter parameter;
    parameter.name = kPrefix + kind.name;
    parameter.unit = kind.unit;
    parameter.free = parameter.nuisance = parameter.linear = true;
    parameter.prior_sd = kind.sd * gain * unit;
    return wider.parameters.add(std::move(parameter));
  };
  const Picture& first = task.picture(0);
  for (const Uneven& one : kUneven) {
    const bool fitted = std::any_of(first.uneven.begin(), first.uneven.end(), [&](const UnevenLight& own) {
      return own.shape == one.shape && own.of_intensity == one.of_intensity;
    });
    if (fitted || !is_asked(task.job.options, one.kind.name)) continue;
    const ParameterRef coefficient = term(one.kind);
    for (Measurement& of : wider.measurements)
      std::get<Picture>(of).uneven.push_back({coefficient, one.shape, one.of_intensity, true});
  }
  for (const Effect& one : kEffects) {
    const bool of_camera = one.effect == PictureEffect::Kind::gamma || one.effect == PictureEffect::Kind::curve;
    if ((!traits_of(first.scene).round && !of_camera) || !is_asked(task.job.options, one.kind.name)) continue;
    const bool bent = one.effect == PictureEffect::Kind::curve && brightest > 0;
    const ParameterRef coefficient = term(one.kind, bent ? 1 / brightest : 1);
    for (Measurement& of : wider.measurements) std::get<Picture>(of).effects.push_back({coefficient, one.effect});
  }
  return wider;
}

Eigen::VectorXd shift_by_aspect(const Task& task, const Optimum& optimum, const Eigen::MatrixXd& covariance) {
  const Picture& picture = task.picture(0);
  const double gain = std::abs(task.gain_of(0, optimum.theta));
  double stretch = 0;
  for (const PictureEffect& effect : picture.effects)
    if (effect.kind == PictureEffect::Kind::stretch_x || effect.kind == PictureEffect::Kind::stretch_diagonal)
      stretch = std::hypot(stretch, optimum.theta[static_cast<std::size_t>(effect.coefficient.index)] / gain);
  if (!(gain > 0) || !(stretch > 0)) return {};
  const Eigen::VectorXd& light = optimum.problem->intensity();
  Eigen::VectorXd change(light.size());
  Eigen::Index begin = 0;
  for (int g = 0; g < task.frames(); ++g) {
    const PixelSet& set = optimum.problem->pixels(g);
    const KnownLight known(task.picture(g).scene.view, optimum.theta, set.pixels,
                           light.segment(begin, set.value.size()));
    for (const auto& [x, y] : set.pixels)
      change[begin++] = stretch * effect_at(PictureEffect::Kind::growth, known, x, y);
  }
  return optimum.problem->shift_by(change, covariance);
}

std::vector<Departure> departures_of(const Task& task, const FitResult& result) {
  std::vector<Departure> departures;
  const double gain = std::abs(task.gain_of(0, result.theta));
  for (const ParameterEstimate& estimate : result.parameters)
    if (estimate.name.starts_with(kPrefix) && estimate.prior_sd && gain > 0) {
      const std::string name = estimate.name.substr(kPrefix.size());
      departures.push_back({name, estimate.unit, words_of(name), estimate.value / gain, estimate.stderr_ / gain,
                            *estimate.prior_sd / gain});
    }
  return departures;
}

}  // namespace birefit::estimation
