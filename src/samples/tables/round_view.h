#pragma once
// Pictures that are the same all around a centre: sums of a few functions of the radius times cosines and sines of the
// azimuth.

#include <algorithm>
#include <array>
#include <cmath>

#include "core/scalar.h"
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
      : pixel_um_(scene.view.pixel_size_um),
        center_x_(plain(value(scene.view.center_x_px))),
        center_y_(plain(value(scene.view.center_y_px))),
        by_center_x_(value(scene.view.center_x_px)),
        by_center_y_(value(scene.view.center_y_px)) {}
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
  Sensitivity<S> by_center_x_, by_center_y_;
};

/// The same of light that is sum_k basis_k f_k(radius), basis = (q^2, q, 1, s, q s) with q, s = cos, sin of (2 azimuth
/// - analyser - polarizer).
template <class S>
class RoundView : public CentredView<S> {
 public:
  using P = PlainOf<S>;
  static constexpr int kMostTerms = 5;
  RoundView(const Scene& scene, const Values<S>& value) : CentredView<S>(scene, value) {
    const S sum = value.radians(scene.microscope.analyzer_deg) + value.radians(scene.microscope.polarizer_deg);
    sin_cos(plain(sum), sin_sum_, cos_sum_);
    by_sum_ = Sensitivity<S>(sum);
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
  PassingLight(double pixel_um, const S& radius_um, const S& cos_between)
      : pixel_um_(pixel_um), radius_px_(radius_um * (1 / pixel_um)), open_(cos_between * cos_between) {
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
      // From x, y to the radius and the azimuth, by which add_moves() asks.
      view.add_moves(place, (x * place.x + y * place.y) * place.inverse_rho * per_pixel,
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
