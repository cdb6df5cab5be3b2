// birefit view: a page on which a config's parameters are tried by hand.

#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>

#include <fmt/format.h>
#include <unistd.h>

#include "app/commands.h"
#include "birefit/io.h"
#include "core/printable.h"
#ifdef BIREFIT_VIEW
#include "view/server.h"
#endif

namespace birefit {
namespace {

struct ViewArguments {
  std::string config;
  std::vector<std::string> set;
  int threads = -1, port = 0;
};

#ifdef BIREFIT_VIEW
/// By its name: an image has the ending of one.
bool is_config(const std::filesystem::path& path) {
  const std::string ending = path.extension().string();
  return ending == ".yaml" || ending == ".yml" || ending.empty();
}

int run_view(const ViewArguments& arguments) {
  view::Session session(arguments.threads);
  std::optional<view::Beginning> beginning;
  if (is_config(arguments.config))
    session.open(load_config(arguments.config, ConfigUse::fit, std::nullopt, arguments.set));
  else
    beginning.emplace(arguments.config);
  const view::Server server(session, arguments.port, beginning ? &*beginning : nullptr);
  std::cout << server.address() << std::endl;
  std::cerr << "birefit: open this address in a browser of this machine; Ctrl-C ends\n";
  // The signal that ends the terminal's work ends this, too.
  for (;;) ::pause();
}
#else
int run_view(const ViewArguments&) {
  throw UserError({}, "this birefit was built without `view`",
                  "build it where cpp-httplib is installed (Debian: libcpp-httplib-dev)");
}
#endif

}  // namespace

Command add_view_command(CLI::App& app) {
  CLI::App* command = app.add_subcommand("view", "a page in the browser to look at a config and try its parameters");
  auto arguments = std::make_shared<ViewArguments>();
  command->add_option("CONFIG", arguments->config, "the config (YAML), or an image to make one for")->required();
  add_set_option(*command, arguments->set);
  command->add_option("--port", arguments->port, "port on 127.0.0.1; default: one that is free")
      ->check(CLI::Range(0, 65535));
  add_threads_option(*command, arguments->threads);
  return {command, [arguments] { return run_view(*arguments); }};
}

}  // namespace birefit
