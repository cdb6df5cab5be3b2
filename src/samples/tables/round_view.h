#pragma once
// Pictures that are the same all around a centre: sums of a few functions of the radius times cosines and sines of the
// azimuth.

#include <algorithm>
#include <array>
#include <cmath>

#include "core/scalar.h"
#include "instrument/beam.h"
#include "samples/image.h"

namespace birefit {

/// Those derivatives of a quantity that do not vanish; the same for all points of a picture.
template <class S>
class Sensitivity {
 public:
  Sensitivity() = default;
  explicit Sensitivity([[maybe_unused]] const S& x) {
    if constexpr (ScalarTraits<S>::derivatives > 0)
      for (std::size_t j = 0; j < x.d.size(); ++j)
        if (const double d = lane(x.d[j], 0); d != 0) by_[static_cast<std::size_t>(count_++)] = {j, d};
  }
  /// Adds what `slope`, the derivative of `to` by the quantity, brings.
  BIREFIT_INLINE void add([[maybe_unused]] const PlainOf<S>& slope, [[maybe_unused]] S& to) const {
    if constexpr (ScalarTraits<S>::derivatives > 0)
      for (int k = 0; k < count_; ++k) {
        const auto& [j, d] = by_[static_cast<std::size_t>(k)];
        to.d[j] = to.d[j] + slope * PlainOf<S>(d);
      }
  }

 private:
  struct By {
    std::size_t parameter;
    double derivative;
  };
  std::array<By, static_cast<std::size_t>(ScalarTraits<S>::derivatives) + 1> by_{};
  int count_ = 0;
};

/// Where points lie about the centre.
template <class S>
class CentredView {
 public:
  using P = PlainOf<S>;
  CentredView(const Scene& scene, const Values<S>& value)
      : pixel_um_(lane(plain(value(scene.view.pixel_size_um)), 0)),
        center_x_(plain(value(scene.view.center_x_px))),
        center_y_(plain(value(scene.view.center_y_px))),
        by_center_x_(value(scene.view.center_x_px)),
        by_center_y_(value(scene.view.center_y_px)),
        by_log_pixel_(log(value(scene.view.pixel_size_um))) {}
  struct Place {
    P x, y;         ///< right and up from the centre, um
    P inverse_rho;  ///< 1/um
    P rho_um;
  };
  Place at(const P& column, const P& row) const {
    return around((column - center_x_) * P(pixel_um_), (center_y_ - row) * P(pixel_um_));
  }
  static Place around(const P& x, const P& y) {
    const P rho2 = x * x + y * y + P(1e-18), over = inverse_root(rho2);
    return {x, y, over, rho2 * over};
  }
  /// Adds the derivatives that light has because its place moves, from its slopes by the radius (um) and by the
  /// azimuth.
  void add_moves(const Place& p, const P& by_rho, const P& by_azimuth, S& light) const {
    add_moves_of_centre(p, by_rho, by_azimuth, light);
    by_log_pixel_.add(by_rho * p.rho_um, light);
  }
  /// Those of them that are there whatever the size of a pixel.
  void add_moves_of_centre(const Place& p, const P& by_rho, const P& by_azimuth, S& light) const {
    const P outwards = by_rho * p.inverse_rho * P(pixel_um_),
            around = by_azimuth * P(pixel_um_) * p.inverse_rho * p.inverse_rho;
    by_center_x_.add(around * p.y - outwards * p.x, light);
    by_center_y_.add(around * p.x + outwards * p.y, light);
  }
  double pixel_um() const { return pixel_um_; }
  EdgeCircle circle(const S& radius_um) const {
    return {lane(center_x_, 0), lane(center_y_, 0), lane(plain(radius_um), 0) / pixel_um_};
  }
  /// 1 - (rho/radius)^2, with its derivatives.
  S within(const P& column, const P& row, const S& inverse_radius, const Sensitivity<S>& by_inverse_radius) const {
    const Place p = at(column, row);
    const P fraction = p.rho_um * plain(inverse_radius);
    S result(P(1.0) - fraction * fraction);
    add_moves(p, P(-2.0) * fraction * plain(inverse_radius), P(0.0), result);
    by_inverse_radius.add(P(-2.0) * fraction * p.rho_um, result);
    return result;
  }

 private:
  double pixel_um_;
  P center_x_, center_y_;
  Sensitivity<S> by_center_x_, by_center_y_, by_log_pixel_;
};

/// What passes of rays that are alike all around the centre. With the Jones matrix [[j0 + j1, j2 + j3], [j2 - j3, j0 -
/// j1]] in the (radial, azimuthal) frame a pair of fields has the amplitude d + u q + v s,
///   d = j0 D + j3 Y, u = j1 Z + j2 X, v = j1 X - j2 Z, q, s = cos, sin of 2 azimuth,
/// D, X, Y, Z those of 1, sigma_x, i sigma_y, sigma_z, and the light is sum_k basis_k f_k with the basis (q^2, q, 1, s,
/// q s). Between linear states q and s count from (analyser + polarizer) / 2: Z = 1, X = 0, D and Y are the cosine and
/// minus the sine of the angle between; the last two f_k are there only where the transport is not diagonal, and of a
/// diagonal one between crossed polarizers the first alone.
template <class S>
class RoundLight {
 public:
  explicit RoundLight(const Line<S>& line) : line_(line) {}
  /// Of the angle from which 2 azimuth counts.
  S cos_sum() const { return line_.linear() ? line_.cos_sum() : S(1.0); }
  S sin_sum() const { return line_.linear() ? line_.sin_sum() : S(0.0); }
  const Line<S>& line() const { return line_; }
  /// How many f_k there are; `diagonal`: j2 = j3 = 0.
  int functions(bool diagonal) const { return diagonal && line_.linear() ? 3 : 5; }
  /// The f_k of a ray, times `tube`.
  void terms(const Mat2<S>& j, const S& tube, bool diagonal, S* f) const {
    const auto cross = [](const Complex<S>& a, const Complex<S>& b) { return a.re * b.re + a.im * b.im; };
    const S half(0.5), twice = 2.0 * tube;
    const Complex<S> j1 = half * (j.a - j.d);
    if (!line_.linear()) {
      const Complex<S> j0 = half * (j.a + j.d), j2 = half * (j.b + j.c), j3 = half * (j.b - j.c);
      for (int k = 0; k < 5; ++k) f[k] = S(0.0);
      for (int k = 0; k < line_.pairs(); ++k) {
        const auto& p = line_.pair(k);
        Complex<S> d = p.one() * j0, u = p.z() * j1, v = p.x() * j1;
        if (!diagonal) d = d + p.iy() * j3, u = u + p.x() * j2, v = v - p.z() * j2;
        const S weight = tube * p.weight, twice_weight = 2.0 * weight, v2 = norm(v);
        f[0] = f[0] + weight * (norm(u) - v2);
        f[1] = f[1] + twice_weight * cross(d, u);
        f[2] = f[2] + weight * (norm(d) + v2);
        f[3] = f[3] + twice_weight * cross(d, v);
        f[4] = f[4] + twice_weight * cross(u, v);
      }
      return;
    }
    Complex<S> direct = (half * line_.cos_between()) * (j.a + j.d);
    if (diagonal) {
      f[0] = tube * norm(j1);
      f[1] = twice * cross(direct, j1);
      f[2] = tube * norm(direct);
      return;
    }
    direct = direct - (half * line_.sin_between()) * (j.b - j.c);
    const Complex<S> j2 = half * (j.b + j.c);
    const S square2 = norm(j2);
    f[0] = tube * (norm(j1) - square2);
    f[1] = twice * cross(direct, j1);
    f[2] = tube * (norm(direct) + square2);
    f[3] = S(0.0) - twice * cross(direct, j2);
    f[4] = S(0.0) - twice * cross(j1, j2);
  }

 private:
  Line<S> line_;
};

/// The same of light that is sum_k basis_k f_k(radius), as RoundLight has it.
template <class S>
class RoundView : public CentredView<S> {
 public:
  using P = PlainOf<S>;
  static constexpr int kMostTerms = 5;
  RoundView(const Scene& scene, const Values<S>& value, const RoundLight<S>& light)
      : CentredView<S>(scene, value), sin_sum_(plain(light.sin_sum())), cos_sum_(plain(light.cos_sum())) {
    // d sum = cos d sin - sin d cos
    by_sum_ = Sensitivity<S>(S(S(cos_sum_) * light.sin_sum() - S(sin_sum_) * light.cos_sum()));
  }
  struct Place : CentredView<S>::Place {
    P q, s;
  };
  Place at(const P& column, const P& row) const {
    Place p{CentredView<S>::at(column, row), {}, {}};
    const P square = p.inverse_rho * p.inverse_rho, c2 = (p.x * p.x - p.y * p.y) * square,
            s2 = P(2.0) * p.x * p.y * square;
    p.q = cos_sum_ * c2 + sin_sum_ * s2, p.s = cos_sum_ * s2 - sin_sum_ * c2;
    return p;
  }
  static std::array<P, kMostTerms> basis(const Place& p) { return {p.q * p.q, p.q, P(1.0), p.s, p.q * p.s}; }
  /// Its derivative by 2 azimuth: q' = -s, s' = q.
  static std::array<P, kMostTerms> turned(const Place& p) {
    return {P(-2.0) * p.q * p.s, -p.s, P(0.0), p.q, p.q * p.q - p.s * p.s};
  }
  /// by_angle: the slope by 2 azimuth, with which the polarizers turn.
  void add_moves_and_turns(const Place& p, const P& by_rho, const P& by_angle, S& light) const {
    this->add_moves(p, by_rho, P(2.0) * by_angle, light);
    by_sum_.add(-by_angle, light);
  }

 private:
  P sin_sum_, cos_sum_;
  Sensitivity<S> by_sum_;
};

/// Of a sample that looks the same from all sides of the viewing axis; twisted, it is not its mirror image.
template <class S>
Symmetry round_symmetry(const Scene& scene, const Values<S>& value, const Line<S>& light, bool twisted) {
  const S center_x = value(scene.view.center_x_px), center_y = value(scene.view.center_y_px);
  if (centred(scene, center_x, center_y)) return Symmetry::half_turn;
  return !twisted && on_middle_row(scene, center_y) && light.mirrored() ? Symmetry::mirror : Symmetry::none;
}

/// The part of a unit square about (x, y) that lies within a circle of `radius` about the origin, and its derivatives
/// by these three.
struct SquareInCircle {
  double area = 0, by_x = 0, by_y = 0, by_radius = 0;
  SquareInCircle(double x, double y, double radius) {
    const double r2 = radius * radius, left = x - 0.5, right = x + 0.5, low = y - 0.5, high = y + 0.5;
    const auto half_chord = [&](double a) { return std::sqrt(std::max(0.0, (radius - a) * (radius + a))); };
    // The integral from 0 to b of min(height, half_chord), odd in either.
    const auto below = [&](double b, double height) {
      const double sign = (b < 0 ? -1 : 1) * (height < 0 ? -1 : 1), h = std::min(std::abs(height), radius),
                   to = std::min(std::abs(b), radius), flat = half_chord(h);
      if (to <= flat) return sign * h * to;
      // Two triangles and the sector between them; by small angles, where a large circle all but touches a side.
      const double at_end = half_chord(to);
      return sign * 0.5 * (h * flat + to * at_end + r2 * (std::atan2(h, flat) - std::atan2(at_end, to)));
    };
    area = below(right, high) - below(left, high) - below(right, low) + below(left, low);
    // What a side that moves outwards takes in is as much of it as lies within the circle; all of the area's change by
    // the radius follows, as areas go with the square of lengths: 2 area = radius by_radius + the sides' distances from
    // the origin times these lengths.
    const auto within = [&](double side, double from, double to) {
      const double h = half_chord(side);
      return std::clamp(to, -h, h) - std::clamp(from, -h, h);
    };
    const double at_right = within(right, low, high), at_left = within(left, low, high),
                 at_high = within(high, left, right), at_low = within(low, left, right);
    by_x = at_right - at_left, by_y = at_high - at_low;
    by_radius = (2 * area - right * at_right + left * at_left - high * at_high + low * at_low) / radius;
  }
};

/// Light that passes by a ball: the mean over a pixel.
template <class S>
class PassingLight {
 public:
  using P = PlainOf<S>;
  PassingLight() = default;
  /// `open`: the light without a sample.
  PassingLight(const S& pixel_um, const S& radius_um, const S& open)
      : pixel_um_(lane(plain(pixel_um), 0)), radius_px_(radius_um * inverse(pixel_um)), open_(open) {
    dark_ = lane(plain(open_), 0) < 1e-30;  // crossed; its derivatives vanish with it
  }
  bool dark() const { return dark_; }
  S mean(const CentredView<S>& view, const typename CentredView<S>::Place& place) const {
    const double radius = lane(plain(radius_px_), 0);
    const P per_pixel(1 / pixel_um_), nothing(0.0);
    constexpr double kCorner = 0.7072;
    const P from_middle = place.rho_um * per_pixel;
    if (birefit::none(from_middle < P(radius + kCorner))) return open_;
    if (birefit::none(from_middle > P(radius - kCorner))) return S(nothing);
    alignas(64) std::array<double, kLanes> area{}, by_x{}, by_y{}, by_radius{};
    for (std::size_t k = 0; k < static_cast<std::size_t>(kLanesOf<S>); ++k) {
      const int i = static_cast<int>(k);
      const SquareInCircle part(lane(place.x, i) / pixel_um_, lane(place.y, i) / pixel_um_, radius);
      area[k] = part.area, by_x[k] = part.by_x, by_y[k] = part.by_y, by_radius[k] = part.by_radius;
    }
    const auto load = [](const std::array<double, kLanes>& a) {
      if constexpr (kLanesOf<S> == 1)
        return a[0];
      else
        return Pack::load_aligned(a.data());
    };
    S inside(load(area));
    if constexpr (ScalarTraits<S>::derivatives > 0) {
      const P x = load(by_x), y = load(by_y);
      for (std::size_t j = 0; j < inside.d.size(); ++j) inside.d[j] = load(by_radius) * radius_px_.d[j];
      // From x, y to the radius and the azimuth, by which moves are asked for; all lengths are in pixels.
      view.add_moves_of_centre(place, (x * place.x + y * place.y) * place.inverse_rho * per_pixel,
                               (y * place.x - x * place.y) * per_pixel, inside);
    }
    return open_ * (S(P(1.0)) - inside);
  }

 private:
  double pixel_um_ = 1;
  S radius_px_, open_;
  bool dark_ = true;
};

}  // namespace birefit
