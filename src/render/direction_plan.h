#pragma once
// How many directions of the condenser a picture needs.

#include <functional>

#include <Eigen/Dense>

#include "birefit/scene.h"
#include "samples/kind.h"

namespace birefit {

/// The means over a few pixels by a plan.
using FewMeans = std::function<Eigen::VectorXd(const RenderPlan&)>;

/// Sets plan.condenser_rings where the microscope has a condenser that its kind's picture is a sum over, with error,
/// cost and reasons; 0 where light along the axis makes the same picture within the accuracy asked for. UserError of
/// light that the medium around the sample does not have. Of a picture that is no such sum: what the condenser may
/// change where the largest retardance is so many rad.
void plan_directions(const Scene& scene, const Values<double>& value, ManyDirections how, double largest_phase,
                     const FewMeans& means, RenderPlan& plan);

}  // namespace birefit
