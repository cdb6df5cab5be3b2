#include "io/report/explain.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include <fmt/format.h>

#include "birefit/expression.h"
#include "birefit/forecast.h"
#include "core/printable.h"
#include "io/results/picture.h"
#include "io/results/work.h"

namespace birefit {
namespace {

std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : printable(text)) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + "\"";
}

std::string quoted(const std::vector<std::string>& list) {
  std::string out = "[";
  for (const std::string& text : list) out += (out.size() > 1 ? ", " : "") + quoted(text);
  return out + "]";
}

std::string json_number(double x) { return std::isfinite(x) ? fmt::format("{}", x) : "null"; }

/// Of one image, or of what leaves in all directions of light, on one thread.
double seconds_an_image(const Config& config, const RenderPlan& chosen, const Theta& theta) {
  const Scene& scene = config.scene;
  if (scene.microscope.directions.empty())
    return forecast_image(scene, demand_of_picture(config), theta, config.observable);
  using Clock = std::chrono::steady_clock;
  const auto begin = Clock::now();
  jones(scene, chosen, theta);
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

bool fits_something(const ParameterTable& table) {
  bool fitted = false;
  for (int i = 0; i < table.size(); ++i) fitted = fitted || table[i].free;
  return fitted;
}

std::string size_text(const Config& config) {
  const View& view = config.scene.view;
  std::string text = fmt::format("Image      {} x {} pixels", view.width, view.height);
  if (const ParameterRef size = view.pixel_size_um)
    text += fmt::format(" of {:g} um", size.in(config.job.parameters.values()));
  if (view.file.bin > 1) text += fmt::format(", each the mean of {0} x {0} pixels of the file", view.file.bin);
  if (view.whole_width() >= view.width + 1 || view.whole_height() >= view.height + 1)
    text += fmt::format(", of the region from ({}, {}) on of the file's {} x {} pixels", view.file.x0, view.file.y0,
                        view.file.width, view.file.height);
  return text;
}

std::string fitted_text(const Config& config) {
  const ParameterTable& table = config.job.parameters;
  const Theta theta = table.values();
  std::string text;
  for (int i = 0; i < table.size(); ++i) {
    const Parameter& parameter = table[i];
    if (!parameter.free) continue;
    text += (text.empty() ? "Fitted     " : "           ") + parameter.name;
    if (parameter.linear) {
      text += " (linear: solved exactly)\n";
      continue;
    }
    text += fmt::format(" from {:g} {}", parameter.value, parameter.unit);
    const double phase = fringe_phase_per_unit(config.scene, config.job.demand, table, theta, i);
    const double span = parameter.upper - parameter.lower;
    if (phase * span > 1)
      text += fmt::format(", forms fringes: {:.3g} rad between its bounds, scanned before the solver", phase * span);
    text += "\n";
  }
  return text.empty() ? "Fitted     nothing\n" : text;
}

/// What is tied and what is to be reported, with their values at the start.
struct Following {
  std::string name, expression, unit;
  double value = 0;
  bool tied = false;
};
std::vector<Following> following(const FitJob& job) {
  const ParameterTable& table = job.parameters;
  const Theta theta = table.values();
  std::vector<Following> list;
  for (const int index : table.tied())
    if (const std::string& name = table[index].name; name.find("].row[") == std::string::npos)
      list.push_back(
          {name, table.tie_of(index)->law->text(), table[index].unit, theta[static_cast<std::size_t>(index)], true});
  for (const Derived& derived : job.derived)
    list.push_back({derived.name, derived.tie.law->text(), derived.unit, table.value_of(derived.tie, theta), false});
  return list;
}

std::string following_text(const FitJob& job) {
  std::string text;
  const Following* before = nullptr;
  const std::vector<Following> list = following(job);
  for (const Following& one : list) {
    const char* what = before && before->tied == one.tied ? "           " : one.tied ? "Tied       " : "Reported   ";
    text += fmt::format("{}{} = {} = {:g}{}{}\n", what, one.name, printable(one.expression), one.value,
                        one.unit.empty() ? "" : " ", one.unit);
    before = &one;
  }
  return text;
}

std::string expected_text(const Outlook& expected) {
  std::string text = fmt::format("Expected   at the start values, noise {}:\n", expected.noise);
  for (const ParameterEstimate& p : expected.parameters)
    if (!p.linear)
      text += std::isfinite(p.stderr_) ? fmt::format("           {} to +- {:.2g} {}\n", p.name, p.stderr_, p.unit)
                                       : fmt::format("           {} not determined\n", p.name);
  for (const FisherDirection& direction : expected.directions)
    if (!direction.identifiable && !direction.words.empty())
      text += "           Not identifiable: " + direction.words + "\n";
  return text;
}

}  // namespace

Explanation explain(const Config& config, const std::string& next) {
  const Theta theta = config.job.parameters.values();
  Explanation e;
  e.plan = plan(config.scene, demand_of_picture(config), theta, config.observable);
  e.warnings = config.job.warnings;
  for (const auto& more : {config.job.taken_as_exact, e.plan.warnings, e.plan.left_out})
    e.warnings.insert(e.warnings.end(), more.begin(), more.end());
  const bool fitted = fits_something(config.job.parameters);
  e.memory = fitted ? memory_to_fit(config.job) : memory_to_render(config.scene);
  // A profile's directions and the rows of a table make no picture.
  const bool picture = !config.job.measurements.empty() && config.scene.microscope.directions.empty() &&
                       config.scene.view.width * config.scene.view.height > 1;
  e.fits_pictures = picture && fitted;
  constexpr double kMostSeconds = 60;  // images with derivatives
  e.seconds = seconds_an_image(config, e.plan, theta);
  if (e.fits_pictures) e.fit_seconds = forecast_fit(config.job);
  if (e.fits_pictures && e.seconds * config.job.parameters.size() < kMostSeconds) e.expected = outlook(config.job);
  e.next_for = next;
  if (!next.empty()) e.next = next_shots(config.job, next);
  return e;
}

std::string explanation_json(const Config& config, const Explanation& e) {
  const ParameterTable& table = config.job.parameters;
  const Theta theta = table.values();
  std::string free, next, follows;
  for (const Following& one : following(config.job))
    follows += fmt::format("{}\n    {{\"name\": {}, \"expression\": {}, \"unit\": {}, \"tied\": {}, \"start\": {}}}",
                           follows.empty() ? "" : ",", quoted(one.name), quoted(one.expression), quoted(one.unit),
                           one.tied, json_number(one.value));
  for (const Shot& shot : e.next)
    next += fmt::format("{}\n    {{\"shot\": {}, \"stderr\": {}}}", next.empty() ? "" : ",", quoted(shot.words),
                        json_number(shot.stderr_));
  for (int i = 0; i < table.size(); ++i) {
    if (!table[i].free) continue;
    const double phase = table[i].linear ? 0 : fringe_phase_per_unit(config.scene, config.job.demand, table, theta, i);
    free += fmt::format(
        "{}\n    {{\"name\": {}, \"unit\": {}, \"start\": {}, \"linear\": {}, \"fringe_rad_per_unit\": {}}}",
        free.empty() ? "" : ",", quoted(table[i].name), quoted(table[i].unit), table[i].value, table[i].linear, phase);
    for (const ParameterEstimate& p : e.expected ? e.expected->parameters : std::vector<ParameterEstimate>{})
      if (p.name == table[i].name)
        free.insert(free.size() - 1, fmt::format(", \"expected_stderr\": {}", json_number(p.stderr_)));
  }
  return fmt::format(
      "{{\n  \"method\": {},\n  \"physics\": {},\n  \"reasons\": {},\n  \"numerical_error\": {},\n  \"model_error\": "
      "{},\n"
      "  \"cost_seconds\": {},\n  \"fit_seconds\": {},\n  \"memory_bytes\": {:.0f},\n  \"warnings\": {},\n  "
      "\"identifiable\": {},\n  "
      "\"next\": [{}],\n  \"parameters\": "
      "[{}],\n  \"follows\": [{}]\n}}\n",
      quoted(e.plan.method), quoted(e.plan.physics), quoted(e.plan.reasons), e.plan.numerical_error, e.plan.model_error,
      e.seconds, json_number(e.fit_seconds), e.memory, quoted(e.warnings),
      e.expected ? (e.expected->identifiable ? "true" : "false") : "null", next, free, follows);
}

std::string explanation_text(const Config& config, const Explanation& e) {
  std::string text = size_text(config);
  text += fmt::format("\nPhysics    {}\nMethod     {}\n", e.plan.physics, e.plan.method);
  for (const std::string& reason : e.plan.reasons) text += "           " + reason + "\n";
  text += fmt::format("Errors     numerical {:.1e}, model {:.1e} ({})\n", e.plan.numerical_error, e.plan.model_error,
                      e.plan.wave ? "RMS over the picture's own RMS" : "intensity, fraction of the incident");
  text += fmt::format("Cost       {:.2g} s an image on one thread\n", e.seconds);
  if (std::isfinite(e.fit_seconds))
    text += "Time       about " + describe_duration(e.fit_seconds) + " to fit, within a factor of three or so\n";
  text += "Memory     about " + describe_memory(e.memory) + "\n";
  text += fitted_text(config) + following_text(config.job);
  if (e.expected)
    text += expected_text(*e.expected);
  else if (e.fits_pictures)
    text += "Expected   not computed: it would take more than a minute\n";
  if (!e.next.empty()) {
    text += fmt::format("Next       one more image beside this, for {}:\n", e.next_for);
    for (const Shot& shot : e.next) text += fmt::format("           to +- {:.2g}  {}\n", shot.stderr_, shot.words);
  }
  for (const std::string& warning : e.warnings) text += "Warning    " + printable(warning) + "\n";
  return text;
}

}  // namespace birefit
