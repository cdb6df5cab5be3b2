#pragma once
// What lanes are measured against.

#include "birefit/render.h"

namespace birefit {

/// The same image as render(), one thread, one ray at a time in plain doubles.
Image render_scalar(const Scene& scene, const RenderPlan& plan, const Theta& theta);

}  // namespace birefit
