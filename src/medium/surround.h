#pragma once
// What is around the sample.

#include "medium/materials/dispersion.h"
#include "scene/values.h"

namespace birefit {

/// Its index at the light's wavelength.
template <class S>
S host_index(const Scene& scene, const Values<S>& value) {
  if (scene.surround_dispersion) return index_at<S>(*scene.surround_dispersion, wavelength_um(scene, value), value);
  return value.get(scene.surround_index, 1.0);
}

}  // namespace birefit
