#pragma once
// A config with other start values, its comments and all else as the user wrote it.

#include <string>
#include <utility>
#include <vector>

namespace birefit {

/// Where a fitted parameter is to start, and its bounds, which are written where the config left them to the image
/// (`fit: auto`).
struct NewStart {
  std::string name;  ///< the parameter's path
  double value = 0, lower = 0, upper = 0;
};

/// `text`, a config that can be read, with these starts. Only the numbers change; what has no place in the text that
/// could take one is set as `--set` does it, which loses the comments. Numbers are as short as tells them from their
/// neighbours.
std::string with_starts(const std::string& text, const std::vector<NewStart>& starts);

/// `text` with these numbers, by their paths, in place of those that it states as known; paths of others are left
/// alone.
std::string with_numbers(const std::string& text, const std::vector<std::pair<std::string, double>>& numbers);
/// The numbers that a config states as known, by their paths, in its order: what stands alone behind its key.
std::vector<std::pair<std::string, double>> known_numbers(const std::string& text);

}  // namespace birefit
