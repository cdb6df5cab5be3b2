// birefit new: commented configs to start from, alone, with pictures to try them on, or filled in from an image.

#include <algorithm>
#include <cctype>
#include <iostream>
#include <memory>
#include <string>

#include <fmt/format.h>

#include "app/commands.h"
#include "app/demo.h"
#include "birefit/error.h"
#include "io/kinds/from_image.h"
#include "io/kinds/kinds.h"

namespace birefit {
namespace {

struct NewArguments {
  std::string kind;
  std::string demo;
  std::string image;
};

std::string list_kinds() {
  std::string out;
  for (const Kind& kind : kinds()) out += fmt::format("  {:<14}{}\n", kind.name, kind.words);
  return out;
}

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

/// The kind of a name; of another word people use for it an error names the kind.
const Kind& kind_of(const std::string& word) {
  const std::string asked = lower(word);
  std::string names, meant;
  for (const Kind& kind : kinds()) {
    if (kind.name == asked) return kind;
    names += (names.empty() ? "" : ", ") + kind.name;
    if (lower(kind.words).find(asked) != std::string::npos) meant += (meant.empty() ? "" : " or ") + kind.name;
  }
  throw UserError(
      {}, "new " + word + ": unknown kind",
      meant.empty() ? "known: " + names + "; `birefit new` says what they are for" : "did you mean " + meant + "?");
}

int run_new(const NewArguments& arguments) {
  if (arguments.kind.empty()) {
    std::cout
        << "Kinds of samples, and what people call them:\n"
        << list_kinds()
        << "birefit new KIND prints a config, --demo DIR makes one with pictures to try it on, --image FILE fills "
           "in what the file tells.\n";
    return kExitDone;
  }
  const Kind& kind = kind_of(arguments.kind);
  if (!arguments.demo.empty()) {
    make_demo(kind, arguments.demo);
    return kExitDone;
  }
  if (arguments.image.empty()) {
    std::cout << kind.config;
    return kExitDone;
  }
  const FilledConfig filled = config_from_image(kind, arguments.image);
  std::cout << filled.text;
  for (const std::string& found : filled.found) std::cerr << "found: " << found << "\n";
  for (const std::string& missing : filled.missing) std::cerr << "missing: " << missing << "\n";
  std::string assumed;
  for (const std::string& number : filled.assumed) assumed += (assumed.empty() ? "" : ", ") + number;
  if (!assumed.empty()) std::cerr << "assumed, as no image tells it: " << assumed << "\n";
  return kExitDone;
}

}  // namespace

Command add_new_command(CLI::App& app) {
  CLI::App* command = app.add_subcommand("new", "a commented config to start from; without KIND: the kinds");
  auto arguments = std::make_shared<NewArguments>();
  command->add_option("KIND", arguments->kind, "droplet, shell, cell, ..: `birefit new` lists them");
  CLI::Option* demo =
      command->add_option("--demo", arguments->demo, "make this folder, with the config and pictures that it runs on");
  command->add_option("--image", arguments->image, "fill in what this image tells, and say what is missing")
      ->excludes(demo);
  command->footer("Kinds:\n" + list_kinds());
  return {command, [arguments] { return run_new(*arguments); }};
}

}  // namespace birefit
