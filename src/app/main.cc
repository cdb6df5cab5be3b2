// The program birefit: command line, exit codes, messages. What a command does is in its own file.

#include <algorithm>
#include <cstdio>
#include <exception>
#include <iostream>
#include <vector>

#include <fmt/format.h>

#include "app/commands.h"
#include "birefit/error.h"
#include "birefit/render.h"

namespace birefit {

void add_threads_option(CLI::App& app, int& threads) {
  app.add_option("--threads", threads, "number of threads; 0 = all cores")->check(CLI::Range(0, 1024));
}

void add_set_option(CLI::App& app, std::vector<std::string>& set) {
  app.add_option("--set", set,
                 "PATH=VALUE: another value of the config, for example sample.droplet.diameter_um=9.3; may be repeated")
      ->allow_extra_args(false);
}

namespace {

int run(int argc, char** argv) {
  CLI::App app("Fits birefringence, field and thermal state to polarized micrographs.", "birefit");
  app.set_version_flag("--version",
                       fmt::format("birefit {} ({} rays side by side)", BIREFIT_VERSION, rays_side_by_side()));
  app.require_subcommand(1);
  app.footer(
      "Exit codes: 0 done; 1 the fit has no answer; 2 the input is wrong; 3 an internal error.\n"
      "birefit COMMAND --help tells more; `birefit new droplet > droplet.yaml` makes a config to start from.");
  const std::vector<Command> commands = {add_fit_command(app),    add_series_command(app),  add_render_command(app),
                                         add_jones_command(app),  add_explain_command(app), add_chart_command(app),
                                         add_stress_command(app), add_new_command(app)};
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    const bool known = argc > 1 && std::any_of(commands.begin(), commands.end(),
                                               [&](const Command& c) { return c.app->get_name() == argv[1]; });
    if (argc > 1 && argv[1][0] != '-' && !known) {
      std::cerr << "birefit: unknown command " << argv[1]
                << "; known: fit, series, render, jones, explain, chart, stress and new\n";
      return kExitUserError;
    }
    // Help and version are "errors" of code 0 to CLI11; all others are the user's.
    return app.exit(error, std::cout, std::cerr) == 0 ? kExitDone : kExitUserError;
  }
  const auto chosen = std::find_if(commands.begin(), commands.end(), [](const Command& c) { return c.app->parsed(); });
  return chosen == commands.end() ? kExitUserError : chosen->run();
}

}  // namespace
}  // namespace birefit

int main(int argc, char** argv) {
  try {
    const int code = birefit::run(argc, argv);
    // A full disk or a closed pipe behind stdout shows only here.
    if (std::fflush(stdout) != 0 || !std::cout.flush()) {
      std::cerr << "birefit: stdout cannot be written\n";
      return birefit::kExitUserError;
    }
    return code;
  } catch (const birefit::UserError& error) {
    std::cerr << error.what() << "\n";
    return birefit::kExitUserError;
  } catch (const std::exception& error) {
    std::cerr << "birefit: internal error (a bug in birefit): " << error.what()
              << "\nPlease report it with the config and the image.\n";
    return birefit::kExitInternalError;
  } catch (...) {
    std::cerr << "birefit: internal error (a bug in birefit): unknown exception\n";
    return birefit::kExitInternalError;
  }
}
