#pragma once
// Pictures of radial droplets and concentric shells by their exact series, Ceiling::wave.

#include "samples/image.h"

namespace birefit {

/// Of a sphere: radial without twist, or a concentric shell.
bool has_series(const Scene& scene);
/// Throws UserError like plan_wave, which serves the other spheres.
RenderPlan plan_series(const Scene& scene, const Demand& demand, const Values<double>& value, const BeamMaker& light);
/// Distance of neighbouring resonances in the parameter of this index (its unit); 0 where it moves none.
double series_ripple_period(const Scene& scene, const Values<double>& value, int index);
template <class S>
std::unique_ptr<SampleImage<S>> make_series_image(const Scene&, const RenderPlan&, const Values<S>&, const BeamMaker&);

}  // namespace birefit
