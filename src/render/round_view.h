#pragma once
// Pictures that are the same all around a centre: sums of a few functions of the radius times cosines and sines of the azimuth.

#include <array>

#include "core/scalar.h"
#include "render/pixel_model.h"

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
      : pixel_um_(scene.view.pixel_size_um), center_x_(plain(value(scene.view.center_x_px))), center_y_(plain(value(scene.view.center_y_px))), by_center_x_(value(scene.view.center_x_px)),
        by_center_y_(value(scene.view.center_y_px)) {}
  struct Place {
    P x, y;         ///< right and up from the centre, um
    P inverse_rho;  ///< 1/um
    P rho_um;
  };
  Place at(const P& column, const P& row) const { return around((column - center_x_) * P(pixel_um_), (center_y_ - row) * P(pixel_um_)); }
  static Place around(const P& x, const P& y) {
    const P rho2 = x * x + y * y + P(1e-18), over = inverse_root(rho2);
    return {x, y, over, rho2 * over};
  }
  /// Adds the derivatives that light has because its place moves, from its slopes by the radius (um) and by the azimuth.
  void add_moves(const Place& p, const P& by_rho, const P& by_azimuth, S& light) const {
    const P outwards = by_rho * p.inverse_rho * P(pixel_um_), around = by_azimuth * P(pixel_um_) * p.inverse_rho * p.inverse_rho;
    by_center_x_.add(around * p.y - outwards * p.x, light);
    by_center_y_.add(around * p.x + outwards * p.y, light);
  }
  double pixel_um() const { return pixel_um_; }

 private:
  double pixel_um_;
  P center_x_, center_y_;
  Sensitivity<S> by_center_x_, by_center_y_;
};

/// The same of light that is sum_k basis_k f_k(radius), basis = (q^2, q, 1, s, q s) with q, s = cos, sin of (2 azimuth - analyser - polarizer).
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
    const P square = p.inverse_rho * p.inverse_rho, c2 = (p.x * p.x - p.y * p.y) * square, s2 = P(2.0) * p.x * p.y * square;
    p.q = cos_sum_ * c2 + sin_sum_ * s2, p.s = cos_sum_ * s2 - sin_sum_ * c2;
    return p;
  }
  static std::array<P, kMostTerms> basis(const Place& p) { return {p.q * p.q, p.q, P(1.0), p.s, p.q * p.s}; }
  /// Its derivative by 2 azimuth: q' = -s, s' = q.
  static std::array<P, kMostTerms> turned(const Place& p) { return {P(-2.0) * p.q * p.s, -p.s, P(0.0), p.q, p.q * p.q - p.s * p.s}; }
  /// by_angle: the slope by 2 azimuth, with which the polarizers turn.
  void add_moves_and_turns(const Place& p, const P& by_rho, const P& by_angle, S& light) const {
    this->add_moves(p, by_rho, P(2.0) * by_angle, light);
    by_sum_.add(-by_angle, light);
  }

 private:
  P sin_sum_, cos_sum_;
  Sensitivity<S> by_sum_;
};

/// Light that passes by a ball, averaged over a pixel along the radius.
template <class S>
class PassingLight {
 public:
  using P = PlainOf<S>;
  PassingLight() = default;
  PassingLight(double pixel_um, const S& radius_um, const S& cos_between) : pixel_um_(pixel_um), radius_um_(radius_um), open_(cos_between * cos_between) {
    dark_ = lane(plain(open_), 0) < 1e-30;  // crossed; its derivatives vanish with it
  }
  S at(const CentredView<S>& view, const typename CentredView<S>::Place& place) const {
    if (dark_ || birefit::all(place.rho_um < plain(radius_um_) - P(pixel_um_))) return S(P(0.0));
    S rho(place.rho_um);
    view.add_moves(place, P(1.0), P(0.0), rho);
    return open_ * min_of(max_of((rho - radius_um_) * (1 / pixel_um_) + 0.5, S(0.0)), S(1.0));
  }

 private:
  double pixel_um_ = 1;
  S radius_um_, open_;
  bool dark_ = true;
};

}  // namespace birefit
