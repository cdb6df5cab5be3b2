#pragma once
// Pictures in other light than the microscope's own, and by other means than lanes: what the picture is measured
// against.

#include "birefit/render.h"
#include "instrument/exposure.h"

namespace birefit {

/// render() and render_pixels() of birefit/render.h in this light, by a plan of the same scene.
void render(const Scene& scene, const RenderPlan& plan, const Exposure& exposure, const Theta& theta,
            const std::vector<int>& active, int threads, Rendering& into);
PixelRendering render_pixels(const Scene& scene, const RenderPlan& plan, const Exposure& exposure, const Theta& theta,
                             const std::vector<std::array<int, 2>>& pixels, const std::vector<int>& active,
                             int threads);

/// The same image as render(), one thread, one ray at a time in plain doubles.
Image render_scalar(const Scene& scene, const RenderPlan& plan, const Theta& theta);

}  // namespace birefit
