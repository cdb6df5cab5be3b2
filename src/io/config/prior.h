#pragma once
// The joint Gaussian prior of a config's `prior:` block, from the fit.json of an earlier fit.

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "birefit/parameters.h"

namespace birefit {

/// Reads mean and covariance of the named parameters; each name comes with its place in the config. `where` is the
/// place of the file's name. Throws UserError: unreadable file, no fit.json, a name it does not hold, no finite
/// positive definite covariance.
JointPrior load_prior(const std::filesystem::path& path, const std::vector<std::pair<std::string, Where>>& names,
                      const Where& where, std::vector<std::string>& warnings);

}  // namespace birefit
