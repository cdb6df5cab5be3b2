#pragma once
// How many points pixels take: measured, place by place.

#include "samples/image.h"

namespace birefit {

/// Raises plan.means.samples, and sets plan.means.edge_points and plan.means.defect_points, until more points would
/// change no pilot pixel by more than a quarter of the accuracy: in any ring of pixels of a round sample, along its
/// edges and about its defects. `model`: after tabulate().
void measure_points(const SampleImage<Pack>& model, RenderPlan& plan);

}  // namespace birefit
