// birefit render: the forward image at the config's values.

#include <array>
#include <filesystem>
#include <iostream>
#include <memory>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "app/commands.h"
#include "app/output.h"
#include "birefit/io.h"
#include "core/printable.h"
#include "instrument/colour.h"
#include "io/files/file.h"
#include "io/results/picture.h"
#include "io/results/work.h"

namespace birefit {
namespace {

struct RenderArguments {
  std::string config;
  std::vector<std::string> set;
  std::string out;
  int threads = 0;
  bool quiet = false;
};

int run_render(const RenderArguments& arguments) {
  Problems problems;
  Config config;
  try {
    config = load_config(arguments.config, ConfigUse::render, std::nullopt, arguments.set);
  } catch (const UserError& error) {
    problems.add(error);
  }
  try {
    check_replaces_none(arguments.out, config.inputs);
    check_output_file(arguments.out, {".exr", ".tif", ".tiff", ".npy", ".png"});
  } catch (const UserError& error) {
    problems.add(error);
  }
  problems.throw_if_any();

  const Theta theta = config.job.parameters.values();
  const auto [chosen, size] = do_work(config, memory_to_render(config.scene), [&] {
    const std::vector<RenderPlan> plans = plans_of(config, theta);
    std::vector<Image> channels;
    for (Rendering& rendering : render_config(config, plans, theta, {}, arguments.threads))
      channels.push_back(std::move(rendering.intensity));
    // As cameras write what is to be looked at.
    if (channels.size() > 1 && std::filesystem::path(arguments.out).extension() == ".png")
      for (Image& channel : channels)
        for (double& value : channel.values()) value = srgb_code(value);
    const ParameterRef pixel = config.scene.view.pixel_size_um;
    const double pixel_size_um = pixel ? pixel.in(theta) : 0;
    write_file(arguments.out, encode_channels(channels, arguments.out, pixel_size_um));
    return std::pair(plans.back(), std::array{channels[0].width(), channels[0].height()});
  });
  if (!arguments.quiet) {
    print_warnings(config.job.warnings);
    print_warnings(config.job.taken_as_exact);
    print_warnings(chosen.warnings);
    print_warnings(chosen.left_out);
    std::cout << fmt::format("{}: {} x {} pixels, method {} ({}), numerical error {:.1e}, model error {:.1e}\n",
                             printable(arguments.out), size[0], size[1], chosen.method, chosen.physics,
                             chosen.numerical_error, chosen.model_error);
  }
  return kExitDone;
}

}  // namespace

Command add_render_command(CLI::App& app) {
  CLI::App* command = app.add_subcommand("render", "the forward image at the config's values");
  auto arguments = std::make_shared<RenderArguments>();
  command->add_option("CONFIG", arguments->config, "the config (YAML)")->required();
  add_set_option(*command, arguments->set);
  command->add_option("--out", arguments->out, "image to write: .exr, .tif (float), .npy (double) or .png (16 bit)")
      ->required();
  add_threads_option(*command, arguments->threads);
  command->add_flag("-q,--quiet", arguments->quiet, "print nothing");
  return {command, [arguments] { return run_render(*arguments); }};
}

}  // namespace birefit
