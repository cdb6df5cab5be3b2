#pragma once
// From a model's intensity to a micrograph's values: value = (gain + uneven light) * intensity + offset + uneven
// background + effects of lens and camera. Linear in every coefficient.

#include <vector>

#include "birefit/fit.h"

namespace birefit::estimation {

/// One of the summands: coefficient * shape, times the intensity or by itself.
struct LightTerm {
  ParameterRef coefficient;
  double absent = 0;  ///< the coefficient where the micrograph has none
  bool of_intensity = false;
  std::optional<UnevenLight::Shape> shape;  ///< nothing: 1 everywhere
  bool over_region = false;                 ///< of UnevenLight
  /// Set: the coefficient stands before how the light changes by it, which follows the light.
  std::optional<PictureEffect::Kind> effect;

  double coefficient_in(const Theta& theta) const {
    return coefficient ? theta[static_cast<std::size_t>(coefficient.index)] : absent;
  }
  double shape_at(const View& view, int column, int row) const;
};

/// Gain and offset first, then the micrograph's uneven light and effects.
std::vector<LightTerm> light_terms(const Picture& micrograph);

/// The values that a camera would show for these intensities.
Image lit(const Picture& micrograph, const Theta& theta, Image intensity);

}  // namespace birefit::estimation
