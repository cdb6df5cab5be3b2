#pragma once
// A cubic crystal bar between electrodes.

#include "samples/planning.h"

namespace birefit {

RenderPlan plan_bar(const Planning&);
/// The retardance where the field is largest (rad).
std::vector<double> bar_phases(const Scene&, const Values<double>&);
template <class S>
std::unique_ptr<SampleImage<S>> make_bar_image(const Scene&, const RenderPlan&, const Values<S>&, const BeamMaker&);

}  // namespace birefit
