#pragma once
// How many points pixels take: measured, place by place.

#include "render/pixel_model.h"

namespace birefit {

/// Raises plan.samples, and sets plan.edge_points, until more points would change no pilot pixel by more than an eighth of the accuracy: in every ring of
/// pixels of a round sample, and along its edges. `model`: after tabulate().
void measure_points(const Scene& scene, const PixelModel<Pack>& model, RenderPlan& plan);

}  // namespace birefit
