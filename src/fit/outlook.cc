// What an image would tell, and which one to take next: the Fisher matrix before any fit.

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <fmt/format.h>

#include "birefit/fit.h"
#include "core/robust.h"
#include "fit/errors/lamp_and_camera.h"
#include "fit/errors/stated.h"
#include "fit/errors/statistics.h"
#include "fit/errors/verdict.h"
#include "fit/problem/least_squares.h"
#include "fit/problem/light.h"
#include "fit/weights/noise.h"
#include "fit/zone.h"
#include "samples/kind.h"
#include "scene/polariscope.h"

namespace birefit {
namespace {

using namespace estimation;

/// Without a noise model and without an image: a camera of 1 % of the range.
constexpr double kAssumedNoise = 0.01;

struct Planned {
  FitJob job;                  ///< gains and offsets at the images' levels
  std::vector<PixelSet> sets;  ///< values: the model's own
  std::vector<RenderPlan> plans;
  std::string noise;
};

const Picture& first_picture(const FitJob& job) { return std::get<Picture>(job.measurements.front()); }

Planned planned(const FitJob& job) {
  Planned p{job, {}, {}, ""};
  std::vector<Picture> seen;
  for (const Sight& sight : sights_of(job)) {
    Picture m = *sight.picture;
    const Theta theta = p.job.parameters.values();
    p.plans.push_back(plan(m.scene, job.demand, theta, sight.observable));
    const Image light = render(m.scene, p.plans.back(), theta, {}, job.options.threads).intensity;
    const auto [low, high] = std::minmax_element(light.values().begin(), light.values().end());
    const double range = *high - *low;
    const bool taken = !m.values.empty();
    if (!taken && m.mask.empty()) m.mask = Mask(light.width(), light.height(), 1);
    m.mask = fitted_pixels(m, theta);
    if (taken) {  // the image's own level; which fringe is where does not matter for that
      const std::vector<double> values = usable_values(m);
      const double dark = quantile(values, 0.005), bright = quantile(values, 0.995);
      if (m.gain && p.job.parameters[m.gain].free && range > 0)
        p.job.parameters[m.gain].value = (bright - dark) / range;
      if (m.offset && p.job.parameters[m.offset].free && !p.job.parameters[m.offset].prior_sd)
        p.job.parameters[m.offset].value = dark - *low * (m.gain ? p.job.parameters[m.gain].value : 1);
    }
    const double gain = m.gain ? p.job.parameters[m.gain].value : 1;
    Picture signal = m;
    signal.values = lit(m, p.job.parameters.values(), light);
    Image sigma;
    std::string words;
    if (m.noise || taken) {
      words = m.noise ? "as the config says" : "as measured in the image";
      sigma = standard_deviation(signal, m.noise ? *m.noise : estimate_noise(m), signal.values);
    } else {
      words = fmt::format("{:g} % of the image's range, assumed: give micrograph.noise for the camera's",
                          100 * kAssumedNoise);
      const double level = std::max(kAssumedNoise * std::abs(gain) * range, 1e-12);
      sigma = Image(light.width(), light.height(), level);
      m.noise = NoiseModel{level, 0, false};  // what another shot has, too
    }
    if (p.noise.empty()) p.noise = words;
    if (m.noise == std::nullopt) m.noise = estimate_noise(m);
    PixelSet set;
    for (int y = 0; y < light.height(); ++y)
      for (int x = 0; x < light.width(); ++x)
        if (m.mask(x, y) && sigma(x, y) > 0) set.pixels.push_back({x, y});
    const auto n = static_cast<Eigen::Index>(set.pixels.size());
    set.value.resize(n);
    set.sigma.resize(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto [x, y] = set.pixels[static_cast<std::size_t>(i)];
      set.value[i] = signal.values(x, y);
      set.sigma[i] = sigma(x, y);
    }
    p.sets.push_back(std::move(set));
    seen.push_back(std::move(m));
  }
  // Masks and noise as they are seen: another shot has the same.
  for (std::size_t g = 0, at = 0; g < p.job.measurements.size(); ++g) {
    if (Picture* own = std::get_if<Picture>(&p.job.measurements[g]))
      *own = std::move(seen[at++]);
    else
      at += std::get<Readings>(p.job.measurements[g]).rows.size();
  }
  return p;
}

struct Information {
  Unknowns unknowns;
  Eigen::MatrixXd factor;
  Inverse inverse;
  Eigen::MatrixXd covariance;  ///< with what is stated and not known exactly
};
Information information(const Planned& p) {
  Information result;
  result.unknowns = Unknowns::of(p.job);
  const Task task(p.job);
  LeastSquares problem(task, p.plans, p.sets);
  Eigen::VectorXd start(static_cast<Eigen::Index>(result.unknowns.searched.size()));
  for (std::size_t j = 0; j < result.unknowns.searched.size(); ++j)
    start[static_cast<Eigen::Index>(j)] = p.job.parameters[result.unknowns.searched[j]].value;
  problem.evaluate(start, true);
  result.factor = problem.factor();
  result.inverse = invert_normal_equations(result.factor);
  result.covariance = result.inverse.covariance;
  const Eigen::MatrixXd stated =
      covariance_by(linear_stated_numbers(task, problem, problem.theta(), result.inverse.covariance));
  if (stated.allFinite()) result.covariance += stated;
  const Eigen::MatrixXd of_light = foretold_by_lamp_and_camera(task, problem, result.inverse.covariance);
  if (of_light.size() > 0) result.covariance += of_light;
  return result;
}

/// The first image's scene, once more, changed by `change`.
FitJob with_shot(const FitJob& job, const std::function<void(Scene&, ParameterTable&)>& change) {
  FitJob more = job;
  Picture shot = first_picture(job);
  shot.name = "next";
  shot.values = {};
  change(shot.scene, more.parameters);
  // The lamp may have changed.
  std::vector<ParameterRef*> lamp{&shot.gain, &shot.offset};
  for (UnevenLight& uneven : shot.uneven) lamp.push_back(&uneven.coefficient);
  for (ParameterRef* ref : lamp)
    if (*ref) {
      Parameter own = more.parameters[*ref];
      own.name += ", next image";
      *ref = more.parameters.add(own);
    }
  more.measurements.push_back(std::move(shot));
  return more;
}

/// With the plates that are mounted on it.
void turn_polarizer(Microscope& microscope, ParameterRef to) {
  for (auto* parts : {&microscope.before, &microscope.behind})
    for (PolarizingPart& part : *parts)
      if (auto* retarder = std::get_if<Retarder>(&part); retarder && retarder->azimuth_deg == microscope.polarizer_deg)
        retarder->azimuth_deg = to;
  microscope.polarizer_deg = to;
}

}  // namespace

Outlook outlook(const FitJob& job) {
  const Planned p = planned(has_more_stated(job) ? with_all_stated(job) : job);
  const Information known = information(p);
  FitResult result;
  result.interval_degrees_of_freedom = std::numeric_limits<double>::infinity();
  for (int j = 0; j < known.unknowns.size(); ++j) {
    const Parameter& parameter = p.job.parameters[known.unknowns.table_index(j)];
    ParameterEstimate estimate;
    estimate.name = parameter.name;
    estimate.unit = parameter.unit;
    estimate.value = estimate.start = parameter.value;
    estimate.lower = parameter.lower;
    estimate.upper = parameter.upper;
    estimate.linear = j >= static_cast<int>(known.unknowns.searched.size());
    if (parameter.prior_sd) estimate.prior_value = parameter.value, estimate.prior_sd = parameter.prior_sd;
    estimate.stderr_ = std::sqrt(known.covariance(j, j));
    result.names.push_back(parameter.name);
    result.parameters.push_back(std::move(estimate));
  }
  result.covariance = known.covariance;
  const Eigen::VectorXd inverse_sd =
      result.covariance.diagonal().unaryExpr([](double v) { return v > 0 ? 1 / std::sqrt(v) : 0.0; });
  result.correlation = inverse_sd.asDiagonal() * result.covariance * inverse_sd.asDiagonal();
  judge_identifiability(result, p.job, known.unknowns, known.factor, known.inverse);
  return {std::move(result.parameters), std::move(result.directions), result.identifiable, p.noise};
}

std::vector<Shot> next_shots(const FitJob& job, const std::string& parameter) {
  for (const Measurement& measurement : job.measurements)
    if (!std::holds_alternative<Picture>(measurement))
      throw UserError(Where{}, "a table of numbers has no next image", "explain --next is for images");
  const Unknowns unknowns = Unknowns::of(job);
  int wanted = -1;
  std::string names;
  for (int j = 0; j < unknowns.size(); ++j) {
    const std::string& name = job.parameters[unknowns.table_index(j)].name;
    const bool ends_so = name.size() > parameter.size() && name.ends_with("." + parameter);
    if (name == parameter || ends_so) wanted = unknowns.table_index(j);
    if (j < static_cast<int>(unknowns.searched.size())) names += (names.empty() ? "" : ", ") + name;
  }
  if (wanted < 0)
    throw UserError(Where{}, fmt::format("--next {}: no parameter that this config fits", parameter),
                    "one of " + names);

  const FitJob base = planned(job).job;  // levels and noise as the images have them
  using Change = std::function<void(Scene&, ParameterTable&)>;
  std::vector<std::pair<std::string, Change>> candidates{{"the same again", [](Scene&, ParameterTable&) {}}};
  const Microscope& now = first_picture(base).scene.microscope;
  const ParameterTable& table = base.parameters;
  const auto known = [&](ParameterRef ref) { return ref && !table[ref].free; };
  const auto constant = [](ParameterTable& t, const char* name, double value) { return t.add_constant(name, value); };
  if (known(now.polarizer_deg) && known(now.analyzer_deg)) {
    const double p = table[now.polarizer_deg].value, a = table[now.analyzer_deg].value;
    for (const double turn : {22.5, 45.0})
      candidates.emplace_back(fmt::format("polarizer and analyser turned together by {:g} deg", turn),
                              [=](Scene& s, ParameterTable& t) {
                                turn_polarizer(s.microscope, constant(t, "next polarizer_deg", p + turn));
                                s.microscope.analyzer_deg = constant(t, "next analyzer_deg", a + turn);
                              });
    for (const double turn : {-45.0, 45.0, 90.0})
      candidates.emplace_back(fmt::format("analyser turned by {:g} deg", turn), [=](Scene& s, ParameterTable& t) {
        s.microscope.analyzer_deg = constant(t, "next analyzer_deg", a + turn);
      });
  }
  if (known(now.wavelength_nm) && !now.channel_light) {
    const double nm = table[now.wavelength_nm].value;
    for (const double other : {450.0, 532.0, 589.0, 633.0, 700.0})
      if (std::abs(other / nm - 1) > 0.05)
        candidates.emplace_back(fmt::format("at {:g} nm", other), [=](Scene& s, ParameterTable& t) {
          s.microscope.wavelength_nm = constant(t, "next wavelength_nm", other);
        });
  }
  const Scene& scene = first_picture(base).scene;
  if (traits_of(scene).isoclinics && now.before.empty() && now.behind.empty())
    candidates.emplace_back("with quarter-wave plates (circular polariscope)", [=](Scene& s, ParameterTable& t) {
      make_circular_polariscope(s.microscope, [&t](const std::string& name, const NumberSpec& spec, double value) {
        const ParameterRef added = t.add_constant("next " + name, value);
        t[added].known_to = spec.known_to;
        return added;
      });
    });
  if (base.demand.ceiling == Ceiling::wave && (!now.focus_um || known(now.focus_um)))
    for (const double by : {-3.0, 3.0}) {
      const double at = (now.focus_um ? table[now.focus_um].value : 0) + by;
      candidates.emplace_back(fmt::format("focused at {:+g} um", at), [=](Scene& s, ParameterTable& t) {
        s.microscope.focus_um = constant(t, "next focus_um", at);
      });
    }
  std::vector<Shot> shots;
  for (const auto& [words, change] : candidates) try {
      const Information both = information(planned(with_shot(base, change)));
      const int j = both.unknowns.of_entry(wanted);
      if (j < 0) continue;
      const double variance = both.inverse.covariance(j, j);
      const bool open = both.inverse.undetermined[static_cast<std::size_t>(j)];
      shots.push_back({words, open ? std::numeric_limits<double>::infinity() : std::sqrt(variance)});
    } catch (const UserError&) {  // a wavelength beyond the material's data, say: no candidate
    }
  std::stable_sort(shots.begin(), shots.end(), [](const Shot& a, const Shot& b) { return a.stderr_ < b.stderr_; });
  return shots;
}

}  // namespace birefit
