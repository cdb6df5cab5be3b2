#include "fit/problem/light.h"

namespace birefit::estimation {

double LightTerm::shape_at(const View& view, int column, int row) const {
  if (!shape) return 1;
  const double half = 0.5 * std::max(view.width, view.height);
  const double x = (column - 0.5 * (view.width - 1)) / half, y = (0.5 * (view.height - 1) - row) / half;
  switch (*shape) {
    case UnevenLight::Shape::x:
      return x;
    case UnevenLight::Shape::y:
      return y;
    case UnevenLight::Shape::square:
      return x * x + y * y;
  }
  return 0;
}

std::vector<LightTerm> light_terms(const Picture& micrograph) {
  std::vector<LightTerm> terms{{micrograph.gain, 1, true, {}}, {micrograph.offset, 0, false, {}}};
  for (const UnevenLight& uneven : micrograph.uneven)
    terms.push_back({uneven.coefficient, 0, uneven.of_intensity, uneven.shape});
  return terms;
}

Image lit(const Picture& micrograph, const Theta& theta, Image intensity) {
  const std::vector<LightTerm> terms = light_terms(micrograph);
  for (int y = 0; y < intensity.height(); ++y)
    for (int x = 0; x < intensity.width(); ++x) {
      double gain = 0, offset = 0;
      for (const LightTerm& term : terms)
        (term.of_intensity ? gain : offset) += term.coefficient_in(theta) * term.shape_at(micrograph.scene.view, x, y);
      intensity(x, y) = gain * intensity(x, y) + offset;
    }
  return intensity;
}

}  // namespace birefit::estimation
