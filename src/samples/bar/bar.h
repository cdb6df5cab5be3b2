#pragma once
// A cubic crystal bar between electrodes.

#include "samples/planning.h"

namespace birefit {

struct SampleKind;  // samples/kind.h

template <class S>
std::unique_ptr<SampleImage<S>> make_bar_image(const Scene&, const RenderPlan&, const Values<S>&, const BeamMaker&);
/// What the list of kinds (samples/kinds.def) holds of it.
extern const SampleKind kBar;

}  // namespace birefit
