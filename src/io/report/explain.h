#pragma once
// What would run for a config, why, what it is expected to cost and to err, and what its pictures can tell: for people
// and for programs.

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "birefit/io.h"

namespace birefit {

/// All that `birefit explain` says.
struct Explanation {
  RenderPlan plan;
  std::vector<std::string> warnings;  ///< of the config and of the plan, and what is left out
  double seconds = 0;                 ///< of an image, on one thread
  double fit_seconds = std::numeric_limits<double>::quiet_NaN();  ///< NaN: nothing is fitted to pictures
  double memory = 0;                ///< bytes of a fit, or of a picture where nothing is fitted
  bool fits_pictures = false;       ///< there are pictures, and something is fitted to them
  std::optional<Outlook> expected;  ///< none: nothing is fitted to pictures, or it would take over a minute
  std::vector<Shot> next;           ///< which image to take next, where that was asked for
  std::string next_for;             ///< and the parameter
};

/// Of a config read for ConfigUse::plan. `next`: the parameter that the next image is to tell of; "": not asked for.
/// Throws UserError like plan() and next_shots().
Explanation explain(const Config& config, const std::string& next = {});
/// In lines for people, the last one ended.
std::string explanation_text(const Config& config, const Explanation& explanation);
/// The same as JSON.
std::string explanation_json(const Config& config, const Explanation& explanation);

}  // namespace birefit
