#pragma once
// Which wavelengths a picture is summed over. docs/methods.md, "Spectrum".

#include <array>
#include <functional>
#include <optional>

#include <Eigen/Dense>

#include "birefit/plan.h"
#include "birefit/scene.h"

namespace birefit {

/// The microscope's light where it is more than a line.
struct LightBand {
  double low_um = 0, high_um = 0;  ///< between which nearly all of it is
  bool narrow = false;             ///< a line with a bandwidth
};
/// Nothing of a single wavelength. UserError where lamp, filters and camera make no light.
std::optional<LightBand> light_band(const Microscope&, const Theta&);

/// What light_plan() asks of the planner.
struct LightProbe {
  std::function<double(const Theta&)> phase;  ///< the largest retardance (rad), parts of the microscope with it
  /// Means over a few pixels by a plan.
  std::function<Eigen::VectorXd(const RenderPlan&)> means;
};
/// Adds the wavelengths that hold the plan's accuracy to the plan of a line, or what leaving them out errs by.
/// `sums_line`: the sample knows a line's bandwidth itself.
void plan_wavelengths(const Scene&, const Theta&, const LightBand&, bool sums_line, const LightProbe&, RenderPlan&);

}  // namespace birefit
