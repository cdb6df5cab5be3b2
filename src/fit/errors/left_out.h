#pragma once
// What the model leaves out, in the estimates: curved rays, waves, what propagation errs by, another lamp.

#include <limits>
#include <optional>
#include <vector>

#include "fit/search/optimum.h"

namespace birefit::estimation {

/// Standard errors by which rays may shift a parameter before waves are worth their time, or a warning.
inline constexpr double kShiftThatMatters = 0.3;

/// Changes of all unknowns, searched ones first.
struct LeftOut {
  Eigen::MatrixXd propagation;                                        ///< a column for each cause; none without waves
  std::optional<Eigen::VectorXd> by_curved_rays, by_waves, by_light;  ///< where they matter
  /// Those that there are.
  std::vector<Eigen::VectorXd> changes() const {
    std::vector<Eigen::VectorXd> all;
    for (const auto& change : {by_curved_rays, by_waves, by_light})
      if (change) all.push_back(*change);
    return all;
  }
  /// Largest change of a parameter that curved rays would make, in standard errors; 0 where there are none to compare
  /// with, or where they describe the image clearly worse.
  double change_by_curved_rays = 0;
  /// The same for wave optics: what fitting rays to a wave image of these parameters would return; NaN where none was
  /// made.
  double change_by_waves = std::numeric_limits<double>::quiet_NaN();
  std::vector<std::string> warnings;
};

/// Propagation is itself a hundredth to a twentieth of the image away from Maxwell's equations, and samples are not the
/// field. A radial twin has an exact image, too: what the others' differences from it do to the estimates.
void measure_propagation(const Task& task, const Optimum& optimum, LeftOut& left_out);

/// Straight chords shift a birefringence by percents and the residual need not show it (docs/methods.md, "Curved
/// rays"): a short fit with curved rays from where this one ended says by how much. It counts where it is more than the
/// standard errors `sd` and the image does not contradict it.
void foretell_curved_rays(const Task& task, const Optimum& optimum, const Eigen::VectorXd& sd, LeftOut& left_out);

/// Rays of any kind shift what they estimate in droplets of a few wavelengths, and with a free gain the residual need
/// not show it: fitted to a wave image of the parameters found, they return something else. The difference is the bias
/// to expect: it counts where it matters beside the standard errors `sd`.
void foretell_waves(const Task& task, const Optimum& optimum, const Eigen::VectorXd& sd, LeftOut& left_out);

/// Colours that are not described within their noise may have been taken in other light or by another camera than is
/// stated, which shifts all of them the same way and shows little: what light that differs as daylight differs from a
/// lamp would change, as far as it would leave over as much as is left over.
void foretell_light(const Task& task, const Optimum& optimum, LeftOut& left_out);

}  // namespace birefit::estimation
