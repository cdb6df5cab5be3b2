#pragma once
// Director fields in a sphere that have no symmetry about the viewing axis, along a refracted straight ray: bipolar, a
// field in the image plane, the gap between two spheres. Positions in radii of the sphere, axes of docs/conventions.md.

#include <memory>
#include <span>
#include <variant>

#include "medium/column.h"
#include "medium/families/axial.h"

namespace birefit {

/// The hedgehog, turned about the light's axis by twist (1 - r): RadialDirector.
template <class S>
struct RadialField {
  bool twisted;
  S twist_rad;
  template <class T>
  Vec3<T> at(const Vec3<T>& r) const {
    const T square = r.x * r.x + r.y * r.y + r.z * r.z + 1e-18, inverse_r = inverse_root(square);
    const Vec3<T> n{inverse_r * r.x, inverse_r * r.y, inverse_r * r.z};
    if (!twisted) return n;
    T s, c;
    sin_cos(T(twist_rad) * (1.0 - square * inverse_r), s, c);
    return {c * n.x - s * n.y, s * n.x + c * n.y, n.z};
  }
};

/// Tangential anchoring, poles at +-pole_distance on `axis`: along the circles through both poles (Williams, J. Phys. A
/// 19, 3211 (1986)). Pole distance 1: boojums on the surface; far away: uniform. Not a solution of the elastic
/// equations.
template <class S>
struct BipolarField {
  Vec3<S> axis;
  S pole_distance;
  template <class T>
  Vec3<T> at(const Vec3<T>& r) const {
    // (a^2 + rho^2 - w^2) u - 2 w rho with rho = r - w u: (a^2 + r^2) u - 2 w r. The small number keeps the poles
    // finite.
    const T twice_w = 2.0 * (r.x * axis.x + r.y * axis.y + r.z * axis.z);
    const T along = dot(r, r) + S(pole_distance * pole_distance + 1e-12);
    return normalized(
        Vec3<T>{along * axis.x - twice_w * r.x, along * axis.y - twice_w * r.y, along * axis.z - twice_w * r.z});
  }
};

/// Normal anchoring, a field in the direction of `axis` (axial_equilibrium.h).
template <class S>
struct TiltedAxialField {
  Vec3<S> axis;
  std::shared_ptr<const AxialField<S>> field;
  template <class T>
  Vec3<T> at(const Vec3<T>& r) const {
    const T z = r.x * axis.x + r.y * axis.y + r.z * axis.z;
    const Vec3<T> out{r.x - z * axis.x, r.y - z * axis.y, r.z - z * axis.z};
    const T square = dot(out, out) + 1e-18, inverse_rho = inverse_root(square);
    const auto below = plain(z) < PlainOf<T>(0.0);
    T n_rho, n_z;
    field->director(square * inverse_rho, T(select(below, -z, z) + 1e-12), n_rho, n_z);
    n_z = select(below, -n_z, n_z);
    const T f = n_rho * inverse_rho;
    return {f * out.x + n_z * axis.x, f * out.y + n_z * axis.y, f * out.z + n_z * axis.z};
  }
};

/// Normal anchoring on the unit sphere and on one of radius `core` about `offset`: normals of the spheres nested
/// between the two, |r - s offset| = 1 - s (1 - core), s in [0, 1]. Normal to both surfaces and smooth; not an elastic
/// equilibrium.
template <class S>
struct NestedField {
  Vec3<S> offset;
  S core;
  /// rays find the wall's director go on within the core: what is seen beside it, continued smoothly
  bool core_left_out = false;
  template <class T>
  Vec3<T> at(const Vec3<T>& r) const {
    const S wall = 1.0 - core, a = dot(offset, offset) - wall * wall;
    const T b = wall - (r.x * offset.x + r.y * offset.y + r.z * offset.z);
    // On the surface rounding may leave c a little above zero.
    const T c = dot(r, r) - 1.0;
    const T root_of = b * b - a * c;
    const T s = -c * inverse(T(b + root_of * inverse_root(max_of(root_of, T(1e-30)))));
    return normalized(Vec3<T>{r.x - s * offset.x, r.y - s * offset.y, r.z - s * offset.z});
  }
};

/// Where a ray, of BallRay's geometry, passes the core's middle: across the ray in its frame (t, phi), that turned back
/// into the picture, in radii of the core. Of length 1 where it touches the core. `reach`, in radii of the sphere,
/// along the azimuth of the image point, less the offset: (impact t - offset).t = reach - offset.rho, as t - rho = (cos
/// d - 1) rho + sin d z.
template <class S>
S reach_at_core(const NestedField<S>& f, const S& impact, const S& sin_deflection, const S& cos_deflection,
                const S& cos_azimuth, const S& sin_azimuth) {
  return impact + (1.0 - cos_deflection) * (f.offset.x * cos_azimuth + f.offset.y * sin_azimuth) -
         sin_deflection * f.offset.z;
}

template <class S>
using BallField = std::variant<BipolarField<S>, TiltedAxialField<S>, NestedField<S>>;

/// A straight piece through the unit sphere: r(s) = impact t + s k, |s| < half, with t = cos d rho + sin d z, k = cos d
/// z - sin d rho (d: deflection inside, rho: the direction of the image point), seen in the frame (t, phi, k).
template <class S>
struct BallRay {
  S impact, half;  ///< in radii
  S sin_deflection, cos_deflection;
  S cos_azimuth, sin_azimuth;  ///< of the image point
  S radius_um;
};

/// Where columns of a field have their breaks.
template <class Field>
std::vector<double> ball_breaks(const Field& field) {
  if constexpr (requires { field.field->has_ring(); })
    if (field.field->has_ring()) return {0.25, 0.5, 0.75};
  return {0.5};
}

/// u in [0, 1/2] runs from the entry to the core or, where there is none on the way, to the middle; the rest to the
/// exit. What lies in the core does not retard. Nodes crowd at a defect in the middle; at a ring of defects, to which a
/// ray comes close twice, at u = 1/4 and 3/4, as far as it passes; and so at the pole of a bipolar field that the ray
/// passes nearest to before the middle, and behind it.
template <class S, class Field>
class BallColumn final : public Column<S> {
 public:
  BallColumn(const Field& field, const BallRay<S>& ray, const S& ordinary, const S& extraordinary)
      : field_(field), ray_(ray), eo_(ordinary), ee_(extraordinary) {
    this->breaks = ball_breaks(field);
    before_ = after_ = S(0.0);
    q_ = S(30.0);  // all but linear
    rho_ = ray.cos_deflection * ray.impact;
    z_ = ray.sin_deflection * ray.impact;
    if constexpr (std::is_same_v<Field, NestedField<S>>) {
      // |impact t + s k - offset| = core.
      const Vec3<S> t = rho_z(ray_.cos_deflection, ray_.sin_deflection),
                    k = rho_z(S(0.0) - ray_.sin_deflection, ray_.cos_deflection);
      const Vec3<S> away{ray_.impact * t.x - field.offset.x, ray_.impact * t.y - field.offset.y,
                         ray_.impact * t.z - field.offset.z};
      const S h = away.x * k.x + away.y * k.y + away.z * k.z;
      const S c = away.x * away.x + away.y * away.y + away.z * away.z - field.core * field.core;
      const S half_way = field.core_left_out ? S(0.0) : root(max_of(h * h - c, S(1e-14)));
      before_ = S(0.0) - h - half_way;
      after_ = half_way - h;
    } else if constexpr (std::is_same_v<Field, TiltedAxialField<S>>) {
      q_ = 4.0 * ray_.impact * inverse(ray_.half) + 0.05;  // the defect or the wall's middle
      if (field.field->has_ring()) {
        const Vec3<S> t = rho_z(ray_.cos_deflection, ray_.sin_deflection),
                      k = rho_z(S(0.0) - ray_.sin_deflection, ray_.cos_deflection);
        const auto along_axis = [&](const Vec3<S>& v) {
          return v.x * field.axis.x + v.y * field.axis.y + v.z * field.axis.z;
        };
        // In front of and behind the middle, where the ray is as far from the axis as the ring is, or nearest to that:
        // impact^2 + s^2 - (above + s lean)^2 = ring^2.
        const S above = ray_.impact * along_axis(t), lean = along_axis(k), over = inverse(S(1.0 - lean * lean + 1e-6));
        const S square =
            (field.field->ring() * field.field->ring() - ray_.impact * ray_.impact + above * above) * over +
            (above * lean * over) * (above * lean * over);
        const S away = root(max_of(square, S(1e-6))), middle = above * lean * over;
        for (int side = 0; side < 2; ++side) {
          RingSide& r = sides_[side];
          const double sign = side == 0 ? -1 : 1;
          r.at = min_of(max_of(S(away + sign * middle), S(1e-3)), S(0.98 * ray_.half));
          const S plane = above + sign * r.at * lean;
          r.passes = root(plane * plane + max_of(S(0.0) - square, S(0.0)) + 1e-10);
          r.outer = asinh(S((ray_.half - r.at) * inverse(r.passes)));
          r.inner = asinh(S(r.at * inverse(r.passes)));
        }
        ring_ = true;
      }
    } else if constexpr (kHasPoles) {
      const auto along_axis = [&](const Vec3<S>& v) {
        return v.x * field.axis.x + v.y * field.axis.y + v.z * field.axis.z;
      };
      const S above = along_axis(rho_z(ray_.cos_deflection, ray_.sin_deflection)),
              lean = along_axis(rho_z(S(0.0) - ray_.sin_deflection, ray_.cos_deflection));
      const S& pole = field.pole_distance;
      // Of the poles +-pole u, |+-pole u - impact t|^2 less the part along the ray.
      const S both = pole * pole * (1.0 - lean * lean) + ray_.impact * ray_.impact,
              apart = 2.0 * pole * ray_.impact * above;
      for (int side = 0; side < 2; ++side) {
        const double sign = side == 0 ? -1 : 1;
        const S at = sign * pole * lean;
        const auto squared = [](const S& x) { return S(x * x); };
        const auto beyond = [&](const S& x) { return x - min_of(max_of(x, S(0.0)), ray_.half); };
        const S near_square = both - apart + squared(beyond(at)),
                other_square = both + apart + squared(beyond(S(0.0) - at));
        // The nearer one, and smoothly from the one to the other where both are far: nodes that jump would show in
        // differences of pictures.
        const S lead = 2.0 * (other_square - near_square) * inverse(S(other_square + near_square)),
                part = min_of(max_of(lead, S(-1.0)), S(1.0)), share = 0.75 * part - 0.25 * part * part * part;
        RingSide& r = sides_[side];
        r.at = 2.0 * share * at;
        r.passes = root(max_of(S(both - 2.0 * share * apart), S(0.0)) + 1e-10);
        r.outer = asinh(S((ray_.half - r.at) * inverse(r.passes)));
        r.inner = asinh(S(r.at * inverse(r.passes)));
      }
    }
  }
  void sample(std::span<const double> u, OpticalPoint<S>* out) const override {
    for (std::size_t i = 0; i < u.size(); ++i)
      ::new (static_cast<void*>(out + i)) OpticalPoint<S>(at<S>(S(u[i]), u[i]));
  }
  void sample_with_slope(std::span<const double> u, OpticalPoint<Slope<S>>* out) const override {
    for (std::size_t i = 0; i < u.size(); ++i) {
      Slope<S> x{S(u[i])};
      x.d[0] = S(1.0);
      ::new (static_cast<void*>(out + i)) OpticalPoint<Slope<S>>(at<Slope<S>>(x, u[i]));
    }
  }

 private:
  static constexpr bool kHasPoles = std::is_same_v<Field, BipolarField<S>>;
  Vec3<S> rho_z(const S& rho, const S& z) const { return {rho * ray_.cos_azimuth, rho * ray_.sin_azimuth, z}; }
  template <class T>
  OpticalPoint<T> at(const T& u, double where) const {
    const bool first = where < 0.5;
    if (ring_) {
      const bool outer = where < 0.25 || where >= 0.75;
      const T x = where < 0.25   ? 1.0 - 4.0 * u
                  : where < 0.5  ? 4.0 * u - 1.0
                  : where < 0.75 ? 3.0 - 4.0 * u
                                 : 4.0 * u - 3.0;
      // The director turns on the length of the distance: steps as long as they are far, distance = passes sinh(a x).
      const RingSide& r = sides_[first ? 0 : 1];
      const S& a = outer ? r.outer : r.inner;
      const T grown = exp(T(a * x)), shrunk = inverse(grown);
      const T distance = (0.5 * r.passes) * (grown - shrunk), away = outer ? T(r.at + distance) : T(r.at - distance);
      return seen_at<T>(first ? T(-away) : away, T((2.0 * r.passes * a * ray_.radius_um) * (grown + shrunk)));
    }
    const T x = first ? 1.0 - 2.0 * u : 2.0 * u - 1.0;
    if constexpr (kHasPoles) {
      const RingSide& r = sides_[first ? 0 : 1];
      const S steps = r.inner + r.outer;
      const T grown = exp(T(steps * x - r.inner)), shrunk = inverse(grown);
      const T distance = r.at + (0.5 * r.passes) * (grown - shrunk);
      return seen_at<T>(first ? T(-distance) : distance, T((r.passes * steps * ray_.radius_um) * (grown + shrunk)));
    }
    const S& from = first ? before_ : after_;
    const S reach = (first ? S(ray_.half + before_) : S(ray_.half - after_)) * q_, end = q_ + 1.0;
    const T f = inverse(T(end - x));
    const T distance = reach * (x * f);
    return seen_at<T>(first ? T(from - distance) : T(from + distance),
                      T((2.0 * reach * end * ray_.radius_um) * (f * f)));
  }
  template <class T>
  OpticalPoint<T> seen_at(const T& s, const T& slope) const {
    const S &sd = ray_.sin_deflection, &cd = ray_.cos_deflection, &ca = ray_.cos_azimuth, &sa = ray_.sin_azimuth;
    const T rho = rho_ - sd * s;
    const Vec3<T> n = field_.template at<T>(Vec3<T>{rho * ca, rho * sa, z_ + cd * s});
    const T n_rho = n.x * ca + n.y * sa;
    return {{cd * n_rho + sd * n.z, n.y * ca - n.x * sa, cd * n.z - sd * n_rho}, T(eo_), T(ee_), T(0.0), T(0.0), slope};
  }

  const Field& field_;
  BallRay<S> ray_;
  S eo_, ee_, before_, after_, q_;
  S rho_, z_;  ///< of the ray's point nearest to the middle
  struct RingSide {
    /// distances (radii): of the closest place from the middle, of the ring or the pole from there
    S at = S(0.0), passes = S(0.0);
    S outer = S(0.0), inner = S(0.0);  ///< asinh of how many of the latter there are to the surface and to the middle
  };
  RingSide sides_[2];
  bool ring_ = false;
};

}  // namespace birefit
