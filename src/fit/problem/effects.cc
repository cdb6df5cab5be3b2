#include "fit/problem/effects.h"

#include <cmath>

namespace birefit::estimation {
namespace {

bool has_neighbours(const KnownLight& p, int x, int y) {
  return x > 0 && y > 0 && x + 1 < p.light.width() && y + 1 < p.light.height() && p.known(x - 1, y) &&
         p.known(x + 1, y) && p.known(x, y - 1) && p.known(x, y + 1);
}

}  // namespace

KnownLight::KnownLight(const View& view, const Theta& theta, const std::vector<std::array<int, 2>>& pixels,
                       const Eigen::Ref<const Eigen::VectorXd>& values)
    : KnownLight(view.width, view.height) {
  center_x = view.center_x_px ? view.center_x_px.in(theta) : view.middle_x();
  center_y = view.center_y_px ? view.center_y_px.in(theta) : view.middle_y();
  for (std::size_t i = 0; i < pixels.size(); ++i) set(pixels[i][0], pixels[i][1], values[static_cast<Eigen::Index>(i)]);
}

double effect_at(PictureEffect::Kind kind, const KnownLight& p, int x, int y) {
  const double here = p.light(x, y);
  switch (kind) {
    case PictureEffect::Kind::gamma:
      return here > 0 && p.brightest > 0 ? here * std::log(here / p.brightest) : 0;
    case PictureEffect::Kind::curve:
      return p.brightest > 0 ? here * (here / p.brightest - 1) : 0;
    default:
      break;
  }
  if (!has_neighbours(p, x, y)) return 0;
  const Image& light = p.light;
  // Convolution with what has that variance along x and y: half the Laplacian (heat equation).
  if (kind == PictureEffect::Kind::blur)
    return 0.5 * (light(x + 1, y) + light(x - 1, y) + light(x, y + 1) + light(x, y - 1) - 4 * here);
  const double by_x = 0.5 * (light(x + 1, y) - light(x - 1, y)), by_y = 0.5 * (light(x, y + 1) - light(x, y - 1)),
               dx = x - p.center_x, dy = y - p.center_y;
  if (kind == PictureEffect::Kind::growth) return -(dx * by_x + dy * by_y);
  return kind == PictureEffect::Kind::stretch_x ? dy * by_y - dx * by_x : -(dx * by_y + dy * by_x);
}

}  // namespace birefit::estimation
