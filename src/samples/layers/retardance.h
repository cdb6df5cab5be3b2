#pragma once
// A cell's retardance itself, where a table has it in place of an intensity: no polarizer, no light.

#include "samples/planning.h"

namespace birefit {

/// Nodes that hold the retardance to rounding. Throws UserError where the axis turns about the light: there it is not
/// one number.
RenderPlan plan_retardance(const Planning&);
template <class S>
std::unique_ptr<SampleImage<S>> make_retardance_image(const Scene&, const RenderPlan&, const Values<S>&,
                                                      const BeamMaker&);

}  // namespace birefit
