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

namespace {

/// Convolution with what has that variance along x and y: half the Laplacian (heat equation).
double blur_at(const Image& light, int x, int y) {
  return 0.5 * (light(x + 1, y) + light(x - 1, y) + light(x, y + 1) + light(x, y - 1) - 4 * light(x, y));
}

std::array<double, 2> slope_at(const Image& light, int x, int y) {
  return {0.5 * (light(x + 1, y) - light(x - 1, y)), 0.5 * (light(x, y + 1) - light(x, y - 1))};
}

/// Of light with this slope, at a distance (dx, dy) from what stays where it is.
double stretched_light(PictureEffect::Kind kind, const std::array<double, 2>& slope, double dx, double dy) {
  const auto [by_x, by_y] = slope;
  if (kind == PictureEffect::Kind::growth) return -(dx * by_x + dy * by_y);
  return kind == PictureEffect::Kind::stretch_x ? dy * by_y - dx * by_x : -(dx * by_y + dy * by_x);
}

}  // namespace

double effect_at(PictureEffect::Kind kind, const KnownLight& p, int x, int y) {
  const double here = p.light(x, y);
  switch (kind) {
    case PictureEffect::Kind::gamma:
      return here > 0 ? here * std::log(here) : 0;
    case PictureEffect::Kind::curve:
      return here * (here - 1);
    default:
      break;
  }
  if (!has_neighbours(p, x, y)) return 0;
  if (kind == PictureEffect::Kind::blur) return blur_at(p.light, x, y);
  return stretched_light(kind, slope_at(p.light, x, y), x - p.center_x, y - p.center_y);
}

double effect_change_at(PictureEffect::Kind kind, const KnownLight& p, const LightChange& change, int x, int y) {
  const double here = p.light(x, y), by = change.light(x, y);
  if (kind == PictureEffect::Kind::gamma) return here > 0 ? by * (std::log(here) + 1) : 0;
  if (kind == PictureEffect::Kind::curve) return by * (2 * here - 1);
  if (!has_neighbours(p, x, y)) return 0;
  if (kind == PictureEffect::Kind::blur) return blur_at(change.light, x, y);
  return stretched_light(kind, slope_at(change.light, x, y), x - p.center_x, y - p.center_y) -
         stretched_light(kind, slope_at(p.light, x, y), change.center_x, change.center_y);
}

}  // namespace birefit::estimation
