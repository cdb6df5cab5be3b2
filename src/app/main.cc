// The program birefit: command line, exit codes, messages. What a command does is in its own file.

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <iostream>
#include <new>
#include <sstream>
#include <system_error>
#include <vector>

#include <fmt/format.h>

#include "app/commands.h"
#include "app/interrupt.h"
#include "birefit/error.h"
#include "birefit/render.h"
#include "core/printable.h"

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
  const std::vector<Command> commands = {add_fit_command(app),    add_series_command(app),      add_render_command(app),
                                         add_jones_command(app),  add_explain_command(app),     add_chart_command(app),
                                         add_stress_command(app), add_audit_command(app),       add_new_command(app),
                                         add_schema_command(app), add_michel_levy_command(app), add_view_command(app),
                                         add_watch_command(app)};
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    const bool known = argc > 1 && std::any_of(commands.begin(), commands.end(),
                                               [&](const Command& c) { return c.app->get_name() == argv[1]; });
    if (argc > 1 && argv[1][0] != '-' && !known) {
      std::cerr << "birefit: unknown command " << printable(argv[1])
                << "; known: fit, series, render, jones, explain, chart, stress, audit, michel-levy, view, watch, new "
                   "and schema\n";
      return kExitUserError;
    }
    // Help and version are "errors" of code 0 to CLI11; all others are the user's.
    std::ostringstream words;
    const int code = app.exit(error, words, words);
    (code == 0 ? std::cout : std::cerr) << printable_lines(words.str());
    return code == 0 ? kExitDone : kExitUserError;
  }
  const auto chosen = std::find_if(commands.begin(), commands.end(), [](const Command& c) { return c.app->parsed(); });
  return chosen == commands.end() ? kExitUserError : chosen->run();
}

/// The work itself does with the threads there are; reading images takes one.
bool lacks_thread(const std::exception& error) {
  const auto* system = dynamic_cast<const std::system_error*>(&error);
  return system && system->code() == std::errc::resource_unavailable_try_again;
}

}  // namespace
}  // namespace birefit

int main(int argc, char** argv) {
  birefit::catch_signals();
  std::signal(SIGXFSZ, SIG_IGN);  // a limit on the size of files is an error of writing, with words
  // OpenImageIO would make a thread for every core of the machine and fail where a container grants fewer.
  ::setenv("OPENIMAGEIO_THREADS", "1", 0);
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
  } catch (const std::bad_alloc&) {
    std::cerr << "birefit: there is not enough memory for this; give it fewer pixels (roi_px, a crop, binning), or run "
                 "it where there is more\n";
    return birefit::kExitUserError;
  } catch (const std::exception& error) {
    if (birefit::lacks_thread(error)) {
      std::cerr
          << "birefit: the system grants no thread to read images with; raise the limit (ulimit -u, a container's "
             "limit of processes)\n";
      return birefit::kExitUserError;
    }
    std::cerr << "birefit: internal error (a bug in birefit): " << birefit::printable_lines(error.what())
              << "\nPlease report it with the config and the image.\n";
    return birefit::kExitInternalError;
  } catch (...) {
    std::cerr << "birefit: internal error (a bug in birefit): unknown exception\n";
    return birefit::kExitInternalError;
  }
}
