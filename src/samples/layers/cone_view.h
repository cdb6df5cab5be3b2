#pragma once
// From pixels to directions in a converging cone: a picture of a screen that stands across the sample's axis, seen from
// in front or, through View::camera, from the side.
//
// Looked at from the direction of (t, 1), t = (tan tilt_x, tan tilt_y), by a pinhole whose axis points at the middle of
// the cone and that is not rolled (the screen turned by the shortest way), a place of the screen at R from the middle
// lies in the picture at
//   A^-1 R / (1 - k.A^-1 R),   A = 1 + t t^T / (1 + sec),  sec = sqrt(1 + t^2),  k = t x tangent of the camera's half
//   field:
// A stretches by sec along t what the slant foreshortens, k is what the nearer half gains. Backwards, R = A r / (1 +
// k.r). Lengths in units of half the picture's smaller side at the middle; the formula is smooth at t = 0, where it is
// R = r to the last bit.

#include <algorithm>
#include <optional>
#include <utility>

#include "samples/image.h"

namespace birefit {

/// Half angle in the host of the cone a plate or slab is seen in, one direction a pixel; none: every pixel sees the
/// same.
inline std::optional<ParameterRef> cone_half_angle(const Scene& scene) {
  if (const auto* plate = std::get_if<Plate>(&scene.sample)) return plate->half_angle_deg;
  if (const auto* slab = std::get_if<Slab>(&scene.sample); slab && slab->half_angle_deg) return slab->half_angle_deg;
  return std::nullopt;
}

template <class S>
class ConeView {
 public:
  using P = PlainOf<S>;
  struct Tangents {
    S x, y;  ///< tan(incidence in the host) times the unit vector of the azimuth
  };

  /// Only of scenes with a cone_half_angle().
  ConeView(const Scene& scene, const Values<S>& value) {
    const S half = value.radians(*cone_half_angle(scene), 15), edge = sin(half) / cos(half);
    tan_per_px = edge * (2.0 / std::min(scene.view.whole_width(), scene.view.whole_height()));
    center_x = value.get(scene.view.center_x_px, scene.view.middle_x());
    center_y = value.get(scene.view.center_y_px, scene.view.middle_y());
    if (!scene.view.camera) return;
    const auto tangent = [&](ParameterRef ref) {
      const S angle = value.radians(ref);
      return S(sin(angle) / cos(angle));
    };
    Slant s;
    s.x = tangent(scene.view.camera->tilt_x_deg);
    s.y = tangent(scene.view.camera->tilt_y_deg);
    s.stretch = 1.0 / (sqrt(s.x * s.x + s.y * s.y + 1.0) + 1.0);
    s.nearness = tangent(scene.view.camera->half_field_deg) / edge;
    slant_ = s;
  }

  Tangents at(const P& column, const P& row) const {
    return from_side((S(column) - center_x) * tan_per_px, (center_y - S(row)) * tan_per_px);
  }

  /// What stands at (x, y) in the picture, both in tangents at the middle.
  Tangents from_side(const S& x, const S& y) const {
    if (!slant_) return {x, y};
    const S along = slant_->x * x + slant_->y * y, stretch = slant_->stretch * along,
            near = 1.0 / (slant_->nearness * along + 1.0);
    return {(x + slant_->x * stretch) * near, (y + slant_->y * stretch) * near};
  }

  /// Column and row of a direction.
  std::pair<S, S> pixel_of(const Tangents& t) const {
    S x = t.x, y = t.y;
    if (slant_) {
      // (1 - cos)/t^2 = 1/(sec (1 + sec))
      const S squash = slant_->stretch / (1.0 / slant_->stretch - 1.0) * (slant_->x * t.x + slant_->y * t.y);
      x = t.x - squash * slant_->x;
      y = t.y - squash * slant_->y;
      const S near = 1.0 / (1.0 - slant_->nearness * (slant_->x * x + slant_->y * y));
      x = x * near;
      y = y * near;
    }
    return {center_x + x / tan_per_px, center_y - y / tan_per_px};
  }

  /// How near the screen is to the camera at a pixel, 1 in the middle; 0 and less: the pixel looks past the screen's
  /// horizon.
  double nearness(double column, double row) const {
    if (!slant_) return 1;
    const double x = (column - lane(plain(center_x), 0)) * lane(plain(tan_per_px), 0),
                 y = (lane(plain(center_y), 0) - row) * lane(plain(tan_per_px), 0);
    return 1 + lane(plain(slant_->nearness), 0) * (lane(plain(slant_->x), 0) * x + lane(plain(slant_->y), 0) * y);
  }

  /// Square to the axis, for the values and all derivatives that are carried.
  bool from_front() const { return !slant_ || (stays_at(slant_->x, 0.0) && stays_at(slant_->y, 0.0)); }

  S tan_per_px, center_x, center_y;  ///< tan(incidence) a pixel, in the middle and across the slant

 private:
  struct Slant {
    S x, y;      ///< t
    S stretch;   ///< 1/(1 + sec)
    S nearness;  ///< tan(half field) over the tangent of the cone's half angle
  };
  std::optional<Slant> slant_;
};

}  // namespace birefit
