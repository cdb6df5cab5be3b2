#include "fit/problem/light.h"

#include <algorithm>
#include <array>
#include <optional>
#include <vector>

#include "fit/problem/effects.h"

namespace birefit::estimation {

double LightTerm::shape_at(const View& view, int column, int row) const {
  if (!shape) return 1;
  const double width = over_region ? view.width : view.whole_width(),
               height = over_region ? view.height : view.whole_height(), half = 0.5 * std::max(width, height);
  const double x = (column - (over_region ? 0.5 * (width - 1) : view.middle_x())) / half,
               y = ((over_region ? 0.5 * (height - 1) : view.middle_y()) - row) / half;
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
  std::vector<LightTerm> terms{{micrograph.gain, 1, true, {}, false, {}}, {micrograph.offset, 0, false, {}, false, {}}};
  for (const UnevenLight& uneven : micrograph.uneven)
    terms.push_back({uneven.coefficient, 0, uneven.of_intensity, uneven.shape, uneven.over_region, {}});
  for (const PictureEffect& effect : micrograph.effects)
    terms.push_back({effect.coefficient, 0, false, {}, false, effect.kind});
  return terms;
}

Image lit(const Picture& micrograph, const Theta& theta, Image intensity) {
  const std::vector<LightTerm> terms = light_terms(micrograph);
  const View& view = micrograph.scene.view;
  std::optional<KnownLight> known;
  if (!micrograph.effects.empty()) {
    known.emplace(view, theta, std::vector<std::array<int, 2>>{}, Eigen::VectorXd{});
    for (int y = 0; y < intensity.height(); ++y)
      for (int x = 0; x < intensity.width(); ++x) known->set(x, y, intensity(x, y));
  }
  const bool even = std::none_of(terms.begin(), terms.end(), [](const LightTerm& term) {
    return term.shape.has_value() || term.effect.has_value();
  });
  if (even) {  // as most are, and tried by hand thirty times a second
    double gain = 0, offset = 0;
    for (const LightTerm& term : terms) (term.of_intensity ? gain : offset) += term.coefficient_in(theta);
    for (double& value : intensity.values()) value = gain * value + offset;
    return intensity;
  }
  for (int y = 0; y < intensity.height(); ++y)
    for (int x = 0; x < intensity.width(); ++x) {
      double gain = 0, offset = 0;
      for (const LightTerm& term : terms)
        (term.of_intensity ? gain : offset) +=
            term.coefficient_in(theta) *
            (term.effect ? effect_at(*term.effect, *known, x, y) : term.shape_at(view, x, y));
      intensity(x, y) = gain * intensity(x, y) + offset;
    }
  return intensity;
}

}  // namespace birefit::estimation
