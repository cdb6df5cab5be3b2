// birefit schema: what configs may hold, as editors read it.

#include <iostream>

#include "app/commands.h"
#include "io/config/schema.h"

namespace birefit {
namespace {

int run_schema() {
  std::cout << config_schema();
  return kExitDone;
}

}  // namespace

Command add_schema_command(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("schema", "a JSON Schema of configs, for editors that complete and check them");
  return {command, run_schema};
}

}  // namespace birefit
