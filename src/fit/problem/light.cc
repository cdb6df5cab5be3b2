#include "fit/problem/light.h"

#include "fit/problem/effects.h"

namespace birefit::estimation {
namespace {

double centre_in(const Theta& theta, ParameterRef ref) { return ref ? ref.in(theta) : 0; }

}  // namespace

double LightTerm::shape_at(const View& view, int column, int row) const {
  if (!shape) return 1;
  const double half = 0.5 * std::max(view.whole_width(), view.whole_height());
  const double x = (column - view.middle_x()) / half, y = (view.middle_y() - row) / half;
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
  std::vector<LightTerm> terms{{micrograph.gain, 1, true, {}, {}}, {micrograph.offset, 0, false, {}, {}}};
  for (const UnevenLight& uneven : micrograph.uneven)
    terms.push_back({uneven.coefficient, 0, uneven.of_intensity, uneven.shape, {}});
  for (const PictureEffect& effect : micrograph.effects)
    terms.push_back({effect.coefficient, 0, false, {}, effect.kind});
  return terms;
}

Image lit(const Picture& micrograph, const Theta& theta, Image intensity) {
  const std::vector<LightTerm> terms = light_terms(micrograph);
  const View& view = micrograph.scene.view;
  KnownLight known(micrograph.effects.empty() ? 0 : intensity.width(),
                   micrograph.effects.empty() ? 0 : intensity.height());
  if (!micrograph.effects.empty()) {
    known.center_x = centre_in(theta, view.center_x_px), known.center_y = centre_in(theta, view.center_y_px);
    for (int y = 0; y < intensity.height(); ++y)
      for (int x = 0; x < intensity.width(); ++x) known.set(x, y, intensity(x, y));
  }
  for (int y = 0; y < intensity.height(); ++y)
    for (int x = 0; x < intensity.width(); ++x) {
      double gain = 0, offset = 0;
      for (const LightTerm& term : terms)
        (term.of_intensity ? gain : offset) +=
            term.coefficient_in(theta) *
            (term.effect ? effect_at(*term.effect, known, x, y) : term.shape_at(view, x, y));
      intensity(x, y) = gain * intensity(x, y) + offset;
    }
  return intensity;
}

}  // namespace birefit::estimation
