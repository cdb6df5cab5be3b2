#include "wave/tilted_series.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/chebyshev.h"
#include "core/quadrature.h"
#include "wave/slopes.h"

namespace birefit {
namespace {

/// acos(c) of two directions by the length of their cross product and their dot product, with derivatives.
template <class S>
S angle_between(const S& sine, const S& cosine) {
  const double s = plain(sine), c = plain(cosine);
  // d angle = c d sine - s d cosine, both of unit vectors
  return S(std::atan2(s, c)) + (c * change(sine) - s * change(cosine));
}

/// An orthonormal pair across a direction of the light: what the transverse components x, y of `pupil` are along.
template <class S>
struct PupilFrame {
  Vec3<S> x, y;
};
/// Turned with the light the short way from z.
template <class S>
PupilFrame<S> unrolled_frame(const Vec3<S>& d) {
  const S over = inverse(S(1.0 + d.z));
  return {{1.0 - d.x * d.x * over, -(d.x * d.y) * over, -d.x}, {-(d.x * d.y) * over, 1.0 - d.y * d.y * over, -d.y}};
}

}  // namespace

template <class S>
ScatteringTable<S>::ScatteringTable(const RadialSeries<S>& series, double largest_angle_rad) {
  const auto& rule = chebyshev_rule<static_cast<int>(kPoints)>();
  // The highest order turns by 3 radians in a panel.
  const int count = 1 + static_cast<int>(largest_angle_rad * series.orders() / 3);
  per_panel_ = largest_angle_rad * (1 + 1e-9) / count;
  panels_.resize(static_cast<std::size_t>(count));
  for (std::size_t p = 0; p < panels_.size(); ++p)
    for (std::size_t k = 0; k < kPoints; ++k) {
      const double angle = per_panel_ * (static_cast<double>(p) + 0.5 * (1 + rule.x[k]));
      const ScatteringAmplitudes<S> f = scattering_amplitudes(series, S(std::cos(angle)));
      for (std::size_t c = 0; c < kPoints; ++c) {
        panels_[p].s1[c] = panels_[p].s1[c] + S(rule.to_powers[c][k]) * f.s1;
        panels_[p].s2[c] = panels_[p].s2[c] + S(rule.to_powers[c][k]) * f.s2;
      }
    }
}

template <class S>
ScatteringAmplitudes<S> ScatteringTable<S>::operator()(const S& angle_rad) const {
  const double place = plain(angle_rad) / per_panel_;
  const std::size_t p = std::min(static_cast<std::size_t>(place), panels_.size() - 1);
  const double x = 2 * (place - static_cast<double>(p)) - 1;
  const S moved = (2 / per_panel_) * change(angle_rad);
  const auto sum = [&](const std::array<Complex<S>, kPoints>& powers) {
    Complex<S> value = powers[kPoints - 1];
    Complex<double> slope;
    for (std::size_t c = kPoints - 1; c-- > 0;) {
      slope = x * slope + value_of(value);
      value = S(x) * value + powers[c];
    }
    return Complex<S>(value.re + slope.re * moved, value.im + slope.im * moved);
  };
  return {sum(panels_[p].s1), sum(panels_[p].s2)};
}

template <class S>
[[gnu::flatten]] TiltedRadialImage<S>::TiltedRadialImage(const RadialSeries<S>& series,
                                                         const ScatteringTable<S>& amplitudes,
                                                         const std::array<S, 2>& kappa, const S& objective_na,
                                                         const S& defocus_um, double x_max_um, Pupil pupil) {
  const S over_host = inverse(series.n_host), k = series.k0 * series.n_host;
  const auto direction = [&](const S& x, const S& y) {
    const S px = x * over_host, py = y * over_host;
    return Vec3<S>{px, py, sqrt(max_of(S(1.0 - px * px - py * py), S(1e-12)))};
  };
  const Vec3<S> in = direction(kappa[0], kappa[1]);
  const double na = std::min(plain(objective_na), plain(series.n_host) * (1 - 1e-9)), steep = na / plain(series.n_host);
  const S aperture = plain(objective_na) < plain(series.n_host) ? objective_na : S(na);
  collected_ = std::hypot(plain(kappa[0]), plain(kappa[1])) <= plain(objective_na);
  incident_kx_per_um_ = series.k0 * kappa[0];

  // What a pupil makes of an incident field of components x, y, and of the one behind: three-dimensional vectors.
  PupilFrame<S> e_in = unrolled_frame(in);
  if (pupil == Pupil::focal_plane) {
    const S over_z = inverse(in.z);
    e_in = {{S(1.0), S(0.0), -(in.x * over_z)}, {S(0.0), S(1.0), -(in.y * over_z)}};
  }
  // kappa_x = NA sin a, kappa_y = NA cos a sin b: smooth up to the pupil's edge, whatever happens there. Either angle's
  // rule must follow the highest order and the focus, the first the place in the picture, too (RadialImage).
  const double k0 = plain(series.k0), reach = 0.5 * std::numbers::pi * k0 * na,
               inside = series.orders() / plain(k) + std::abs(plain(defocus_um)) * steep;
  // Half a node a radian, and the tail beyond them that leaves 1e-7.
  const auto length = [](double swing) { return static_cast<int>(0.5 * swing + 2.5 * std::cbrt(swing)) + 6; };
  std::vector<double> a, wa, b, wb;
  legendre_nodes(length(reach * (inside + x_max_um)), a, wa);
  legendre_nodes(length(reach * inside), b, wb);
  constexpr double kQuarter = 0.5 * std::numbers::pi;
  nodes_.resize(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double sin_a = std::sin(kQuarter * a[i]), cos_a = std::cos(kQuarter * a[i]);
    const S kx = sin_a * aperture;
    Mat2<S> sum{};
    for (std::size_t j = 0; j < b.size(); ++j) {
      const double sin_b = std::sin(kQuarter * b[j]), cos_b = std::cos(kQuarter * b[j]);
      const Vec3<S> out = direction(kx, (cos_a * sin_b) * aperture);
      const Vec3<S> normal = cross(in, out);
      const S sine2 = dot(normal, normal), cosine = dot(in, out);
      // Straight on both amplitudes are equal, and any plane will do.
      const bool straight = plain(sine2) < 1e-20;
      Vec3<S> across;
      if (straight) {
        across = unrolled_frame(in).y;
      } else {
        const S over = inverse(sqrt(sine2));
        across = {over * normal.x, over * normal.y, over * normal.z};
      }
      const S angle = straight ? S(0.0) : angle_between(S(sqrt(sine2)), cosine);
      const ScatteringAmplitudes<S> f = amplitudes(angle);
      const Vec3<S> along_in = cross(across, in), along_out = cross(across, out);
      S scale = (-2 * std::numbers::pi) * inverse(S(k * k * out.z));
      if (pupil == Pupil::aplanatic) scale = scale * sqrt(S(out.z * inverse(in.z)));
      // d^2 k over (2 pi)^2
      scale = scale * series.k0 * series.k0 * aperture * aperture *
              (wa[i] * wb[j] * kQuarter * kQuarter * cos_a * cos_a * cos_b / square(2 * std::numbers::pi));
      const Complex<S> wave = scale * exp(Complex<S>(S(0.0), k * (out.z - in.z) * defocus_um));
      const Complex<S> parallel = wave * f.s2, perpendicular = wave * f.s1;
      S p_x = along_out.x, p_y = along_out.y, s_x = across.x, s_y = across.y;
      if (pupil != Pupil::focal_plane) {
        const PupilFrame<S> seen = unrolled_frame(out);
        p_x = dot(along_out, seen.x), p_y = dot(along_out, seen.y);
        s_x = dot(across, seen.x), s_y = dot(across, seen.y);
      }
      const auto column = [&](const Vec3<S>& e, Complex<S>& x, Complex<S>& y) {
        const Complex<S> p = dot(e, along_in) * parallel, s = dot(e, across) * perpendicular;
        x = x + p_x * p + s_x * s;
        y = y + p_y * p + s_y * s;
      };
      column(e_in.x, sum.a, sum.c);
      column(e_in.y, sum.b, sum.d);
    }
    nodes_[i] = {series.k0 * kx, sum};
  }
}

template <class S>
[[gnu::flatten]] Mat2<S> TiltedRadialImage<S>::operator()(double x_um) const {
  const auto wave = [x_um](const S& k) { return exp(Complex<S>(S(0.0), k * x_um)); };
  Mat2<S> field{};
  if (collected_) field.a = field.d = wave(incident_kx_per_um_);
  for (const Node& node : nodes_) {
    const Complex<S> w = wave(node.kx_per_um);
    field.a = field.a + w * node.field.a;
    field.b = field.b + w * node.field.b;
    field.c = field.c + w * node.field.c;
    field.d = field.d + w * node.field.d;
  }
  return field;
}

#define BIREFIT_INSTANTIATE(S)       \
  template class ScatteringTable<S>; \
  template class TiltedRadialImage<S>;
BIREFIT_INSTANTIATE(double)
using Single1 = Dual<double, 1>;
using Single2 = Dual<double, 2>;
using Single4 = Dual<double, 4>;
using Single8 = Dual<double, 8>;
BIREFIT_INSTANTIATE(Single1)
BIREFIT_INSTANTIATE(Single2)
BIREFIT_INSTANTIATE(Single4)
BIREFIT_INSTANTIATE(Single8)
#undef BIREFIT_INSTANTIATE

}  // namespace birefit
