// birefit explain: which model and method would run, why, what it is expected to cost and to err.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iostream>
#include <limits>
#include <memory>
#include <optional>

#include <fmt/format.h>

#include "app/commands.h"
#include "app/watch.h"
#include "app/work.h"
#include "birefit/expression.h"
#include "birefit/forecast.h"
#include "birefit/io.h"
#include "core/printable.h"
#include "samples/waves/wave.h"

namespace birefit {
namespace {

struct Arguments {
  std::string config;
  std::vector<std::string> set;
  std::string next;
  bool json = false, check = false;
};

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
  if (scene.microscope.directions.empty()) return forecast_image(scene, config.job.demand, theta, config.observable);
  using Clock = std::chrono::steady_clock;
  const auto begin = Clock::now();
  jones(scene, chosen, theta);
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

/// What is tied and what is to be reported, with their values at the start.
void say_what_follows(const FitJob& job, const Theta& theta) {
  bool any = false;
  const auto say = [&](const char* what, const std::string& name, const Tie& tie, double value,
                       const std::string& unit) {
    std::cout << fmt::format("{}{} = {} = {:g} {}\n", any ? "           " : what, name, printable(tie.law->text()),
                             value, unit);
    any = true;
  };
  for (const int index : job.parameters.tied())
    if (const std::string& name = job.parameters[index].name; name.find("].row[") == std::string::npos)
      say("Tied       ", name, *job.parameters.tie_of(index), theta[static_cast<std::size_t>(index)],
          job.parameters[index].unit);
  any = false;
  for (const Derived& derived : job.derived)
    say("Reported   ", derived.name, derived.tie, job.parameters.value_of(derived.tie, theta), derived.unit);
}

int explain(const Arguments& arguments, const Config& config, double memory) {
  const ParameterTable& table = config.job.parameters;
  const Theta theta = table.values();
  const RenderPlan chosen = plan(config.scene, config.job.demand, theta, config.observable);
  std::vector<std::string> warnings = config.job.warnings;
  for (const auto& more : {config.job.taken_as_exact, chosen.warnings, chosen.left_out})
    warnings.insert(warnings.end(), more.begin(), more.end());

  // A profile's directions and the rows of a table make no picture.
  const bool picture = !config.job.measurements.empty() && config.scene.microscope.directions.empty() &&
                       config.scene.view.width * config.scene.view.height > 1;
  bool fitted = false;
  for (int i = 0; i < table.size(); ++i) fitted = fitted || table[i].free;
  constexpr double kMostSeconds = 60;  // images with derivatives
  const double seconds = seconds_an_image(config, chosen, theta);
  const double fit_seconds = picture && fitted ? forecast_fit(config.job) : std::numeric_limits<double>::quiet_NaN();
  const bool quick = seconds * table.size() < kMostSeconds;
  const std::optional<Outlook> expected =
      picture && fitted && quick ? std::optional(outlook(config.job)) : std::nullopt;
  const std::vector<Shot> shots = arguments.next.empty() ? std::vector<Shot>{} : next_shots(config.job, arguments.next);

  if (arguments.json) {
    std::string free, next;
    for (const Shot& shot : shots)
      next += fmt::format("{}\n    {{\"shot\": {}, \"stderr\": {}}}", next.empty() ? "" : ",", quoted(shot.words),
                          json_number(shot.stderr_));
    for (int i = 0; i < table.size(); ++i) {
      if (!table[i].free) continue;
      const double phase =
          table[i].linear ? 0 : fringe_phase_per_unit(config.scene, config.job.demand, table, theta, i);
      free += fmt::format(
          "{}\n    {{\"name\": {}, \"unit\": {}, \"start\": {}, \"linear\": {}, \"fringe_rad_per_unit\": {}}}",
          free.empty() ? "" : ",", quoted(table[i].name), quoted(table[i].unit), table[i].value, table[i].linear,
          phase);
      for (const ParameterEstimate& p : expected ? expected->parameters : std::vector<ParameterEstimate>{})
        if (p.name == table[i].name)
          free.insert(free.size() - 1, fmt::format(", \"expected_stderr\": {}", json_number(p.stderr_)));
    }
    std::cout << fmt::format(
        "{{\n  \"method\": {},\n  \"physics\": {},\n  \"reasons\": {},\n  \"numerical_error\": {},\n  \"model_error\": "
        "{},\n"
        "  \"cost_seconds\": {},\n  \"fit_seconds\": {},\n  \"memory_bytes\": {:.0f},\n  \"warnings\": {},\n  "
        "\"identifiable\": {},\n  "
        "\"next\": [{}],\n  \"parameters\": "
        "[{}]\n}}\n",
        quoted(chosen.method), quoted(chosen.physics), quoted(chosen.reasons), chosen.numerical_error,
        chosen.model_error, seconds, json_number(fit_seconds), memory, quoted(warnings),
        expected ? (expected->identifiable ? "true" : "false") : "null", next, free);
    return kExitDone;
  }
  const View& view = config.scene.view;
  std::cout << fmt::format("Image      {} x {} pixels", view.width, view.height);
  if (const ParameterRef size = view.pixel_size_um) std::cout << fmt::format(" of {:g} um", size.in(table.values()));
  if (view.file.bin > 1) std::cout << fmt::format(", each the mean of {0} x {0} pixels of the file", view.file.bin);
  if (view.whole_width() >= view.width + 1 || view.whole_height() >= view.height + 1)
    std::cout << fmt::format(", of the region from ({}, {}) on of the file's {} x {} pixels", view.file.x0,
                             view.file.y0, view.file.width, view.file.height);
  std::cout << fmt::format("\nPhysics    {}\nMethod     {}\n", chosen.physics, chosen.method);
  for (const std::string& reason : chosen.reasons) std::cout << "           " << reason << "\n";
  std::cout << fmt::format("Errors     numerical {:.1e}, model {:.1e} ({})\n", chosen.numerical_error,
                           chosen.model_error,
                           chosen.wave ? "RMS over the picture's own RMS" : "intensity, fraction of the incident");
  std::cout << fmt::format("Cost       {:.2g} s an image on one thread\n", seconds);
  if (std::isfinite(fit_seconds))
    std::cout << "Time       about " << describe_duration(fit_seconds) << " to fit, within a factor of three or so\n";
  std::cout << "Memory     about " << describe_memory(memory) << "\n";
  bool any = false;
  for (int i = 0; i < table.size(); ++i) {
    const Parameter& parameter = table[i];
    if (!parameter.free) continue;
    std::cout << (any ? "           " : "Fitted     ") << parameter.name;
    any = true;
    if (parameter.linear) {
      std::cout << " (linear: solved exactly)\n";
      continue;
    }
    std::cout << fmt::format(" from {:g} {}", parameter.value, parameter.unit);
    const double phase = fringe_phase_per_unit(config.scene, config.job.demand, table, theta, i);
    const double span = parameter.upper - parameter.lower;
    if (phase * span > 1)
      std::cout << fmt::format(", forms fringes: {:.3g} rad between its bounds, scanned before the solver",
                               phase * span);
    std::cout << "\n";
  }
  if (!any) std::cout << "Fitted     nothing\n";
  say_what_follows(config.job, theta);
  if (picture && fitted && !quick) std::cout << "Expected   not computed: it would take more than a minute\n";
  if (expected) {
    std::cout << fmt::format("Expected   at the start values, noise {}:\n", expected->noise);
    for (const ParameterEstimate& p : expected->parameters)
      if (!p.linear)
        std::cout << (std::isfinite(p.stderr_)
                          ? fmt::format("           {} to +- {:.2g} {}\n", p.name, p.stderr_, p.unit)
                          : fmt::format("           {} not determined\n", p.name));
    for (const FisherDirection& direction : expected->directions)
      if (!direction.identifiable && !direction.words.empty())
        std::cout << "           Not identifiable: " << direction.words << "\n";
  }
  if (!shots.empty()) {
    std::cout << fmt::format("Next       one more image beside this, for {}:\n", arguments.next);
    for (const Shot& shot : shots) std::cout << fmt::format("           to +- {:.2g}  {}\n", shot.stderr_, shot.words);
  }
  for (const std::string& warning : warnings) std::cout << "Warning    " << printable(warning) << "\n";
  if (arguments.check) {
    const Image planned = render(config.scene, chosen, theta).intensity, judge = image_by_march(config.scene, theta);
    double difference = 0, size = 0, worst = 0;
    for (std::size_t i = 0; i < judge.values().size(); ++i) {
      const double d = planned.values()[i] - judge.values()[i];
      difference += d * d;
      size += judge.values()[i] * judge.values()[i];
      worst = std::max(worst, std::abs(d));
    }
    std::cout << fmt::format(
        "Check      {:.2g} of the image's RMS (worst pixel {:.2g}) from Maxwell's equations marched through the "
        "sample, which leave out light reflected twice{}\n",
        std::sqrt(difference / size), worst,
        radial_twin(config.scene, theta)
            ? fmt::format(": {:.2g} of a radial twin's exact picture", march_error(config.scene, theta))
            : "");
  }
  return kExitDone;
}

int run_explain(const Arguments& arguments) {
  const Config config = load_config(arguments.config, ConfigUse::plan, std::nullopt, arguments.set);
  const ParameterTable& table = config.job.parameters;
  bool fitted = false;
  for (int i = 0; i < table.size(); ++i) fitted = fitted || table[i].free;
  const double memory = fitted ? memory_to_fit(config.job) : memory_to_render(config.scene);
  return do_work(config, memory_to_render(config.scene), [&] { return explain(arguments, config, memory); });
}

}  // namespace

Command add_explain_command(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("explain", "which model and method would run, why, and what it costs and errs");
  auto arguments = std::make_shared<Arguments>();
  command->add_option("CONFIG", arguments->config, "the config (YAML)")->required();
  add_set_option(*command, arguments->set);
  command->add_option("--next", arguments->next,
                      "which image to take next to know this parameter better: candidates, best first");
  command->add_flag("--json", arguments->json, "for scripts");
  command
      ->add_flag("--check", arguments->check,
                 "droplets, shells and sampled fields: compare the picture with Maxwell's equations, marched through "
                 "the sample (slow)")
      ->excludes("--json");
  return {command, [arguments] { return run_explain(*arguments); }};
}

}  // namespace birefit
