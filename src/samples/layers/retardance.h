#pragma once
// A cell's retardance itself, where a table has it in place of an intensity: no polarizer, no light.

#include "samples/planning.h"

namespace birefit {

struct SampleKind;  // samples/kind.h

template <class S>
std::unique_ptr<SampleImage<S>> make_retardance_image(const Scene&, const RenderPlan&, const Values<S>&,
                                                      const BeamMaker&);
/// What the list of kinds (samples/kinds.def) holds of it.
extern const SampleKind kRetardance;

}  // namespace birefit
