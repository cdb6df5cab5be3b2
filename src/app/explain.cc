// birefit explain: which model and method would run, why, what it is expected to cost and to err.

#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>

#include <fmt/format.h>

#include "app/commands.h"
#include "birefit/io.h"
#include "io/report/explain.h"
#include "io/results/work.h"
#include "samples/waves/wave.h"

namespace birefit {
namespace {

struct ExplainArguments {
  std::string config;
  std::vector<std::string> set;
  std::string next;
  bool json = false, check = false;
};

void print_check(const Config& config, const RenderPlan& chosen) {
  const Theta theta = config.job.parameters.values();
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

int print_explanation(const ExplainArguments& arguments, const Config& config) {
  const Explanation explanation = explain(config, arguments.next);
  std::cout << (arguments.json ? explanation_json(config, explanation) : explanation_text(config, explanation));
  if (arguments.check) print_check(config, explanation.plan);
  return kExitDone;
}

int run_explain(const ExplainArguments& arguments) {
  const Config config = load_config(arguments.config, ConfigUse::plan, std::nullopt, arguments.set);
  return do_work(config, memory_to_render(config.scene), [&] { return print_explanation(arguments, config); });
}

}  // namespace

Command add_explain_command(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("explain", "which model and method would run, why, and what it costs and errs");
  auto arguments = std::make_shared<ExplainArguments>();
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
