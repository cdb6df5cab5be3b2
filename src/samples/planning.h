#pragma once
// What planners of all kinds share. docs/methods.md, "Choosing".

#include <array>
#include <functional>
#include <string>
#include <vector>

#include <Eigen/Dense>

#include "samples/image.h"

namespace birefit {

/// render() on one thread, for planners that measure on pictures.
using RenderPicture = std::function<Image(const Scene&, const RenderPlan&, const Theta&)>;

/// What a kind's planner is given.
struct Planning {
  const Scene& scene;
  const Demand& demand;
  const Values<double>& value;
  const Observable& observable;
  const BeamMaker& light;  ///< of one direction: what of it planners see stands for all
  /// The means over a few pixels (column, row) by a plan, as the picture will have them: render_pixels().
  std::function<Eigen::VectorXd(const RenderPlan&, const std::vector<std::array<int, 2>>&)> means_at;
  RenderPicture picture;

  /// Nothing chosen yet.
  RenderPlan start() const {
    RenderPlan plan;
    plan.demand = demand;
    plan.observable = observable;
    return plan;
  }
};

/// Of the accuracy asked for: the table's error stays far below it, so that neither the image nor its slope shows the
/// panels.
inline constexpr double kTableShare = 1e-3;
/// In two dimensions digits are dearer.
inline constexpr double kSquaresShare = 1e-2;

/// "1.2e-05"
std::string sci(double x);
/// "12 steps", or Gauss nodes.
std::string effort_text(const std::string& method, int steps);
/// Throws UserError where a method was asked for by name that closed forms do not have; `what`: "a crystal bar".
void check_closed_form(const Demand& demand, const std::string& what);
/// points(r): a pixel side, of pixels whose middles are about r pixels from the centre.
void sample_by_radius(RenderPlan& plan, double center_x, double center_y, double bins,
                      const std::function<int(double)>& points);
double reflectance(double n1, double n2);  ///< at normal incidence

}  // namespace birefit
