#pragma once
// One fit a droplet, of a picture that shows several.

#include <string>
#include <vector>

#include "birefit/io.h"

namespace birefit {

struct EachDroplet {
  double x_px = 0, y_px = 0;  ///< in the file
  double diameter_um = 0;     ///< as it is seen
  /// The config's values by which it is the one that is fitted, as of `--set`.
  std::vector<std::string> set;
};
/// The droplets that stand apart in the config's picture, the largest first. Throws UserError where it is not one
/// picture of droplets, has a mask, or there are fewer than two.
std::vector<EachDroplet> droplets_in_view(const Config& config);

/// A row for each that was fitted, in their order; one without parameters could not be (`unreadable`).
std::string droplets_csv(const std::vector<EachDroplet>& droplets, const std::vector<FitResult>& results);

}  // namespace birefit
