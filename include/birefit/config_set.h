#pragma once
// Values set from outside a config's file: `--set path=value` of the command line.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "birefit/io.h"

namespace birefit {

/// load_config of a file in which each item of `set`, "path=value", sets or replaces a value (docs/configuration.md,
/// "Command line and files"); Config::text is then the config that this makes, less the file's comments.
Config load_config(const std::filesystem::path& path, ConfigUse use, const std::optional<std::filesystem::path>& image,
                   const std::vector<std::string>& set);

}  // namespace birefit
