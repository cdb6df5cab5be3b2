#pragma once
// `birefit new KIND --image FILE`: the config of a kind with what a file tells filled in.

#include <string>
#include <vector>

#include "app/kinds.h"

namespace birefit {

struct FilledConfig {
  std::string text;
  std::vector<std::string> found;    ///< what the file told
  std::vector<std::string> missing;  ///< what it does not tell and no fit finds out: to be stated before `fit` runs
  std::vector<std::string> assumed;  ///< what the config takes as known: to be looked at
};

/// Throws UserError: the file cannot be read, or the kind takes no image.
FilledConfig config_from_image(const Kind& kind, const std::string& file);

}  // namespace birefit
