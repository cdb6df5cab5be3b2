#pragma once
// The mean of a fringe over a pixel in closed form. A retarder between polarizers gives
//   I = mean + Re((amplitude + i quadrature) e^{i phase})
// with four smooth functions, however fine the fringe (quadrature is what coupling and absorption add; without them it
// vanishes): one ray a pixel serves where sampling the intensity itself needs several a fringe, and one ray for many
// pixels where the functions are interpolated.

#include "core/scalar.h"

namespace birefit {

template <class S>
struct FringePoint {
  S amplitude, phase, mean, quadrature;
};

/// Moments of e^{i g x} over x in [-1/2, 1/2]: m0 = int e^{igx} = sinc(g/2), int x e^{igx} = -i m0', int x^2 e^{igx} =
/// -m0''. With s(q) = sin(sqrt q)/sqrt q, q = g^2/4: m0' = (g/2) s', and 4 q s'' + 6 s' + s = 0 gives m0'' = -s' - s/4.
template <class S>
struct PixelMoments {
  S m0, slope, curvature;  ///< m0, m0', m0''
  explicit PixelMoments(const S& g) {
    const S half = 0.5 * g, q = half * half;
    const CosSinc<S> f = cos_sinc_sq(q);
    const S s1 = sinc_slope(q, f.cos_sq, f.sinc_sq);
    m0 = f.sinc_sq;
    slope = half * s1;
    curvature = S(0.0) - s1 - 0.25 * f.sinc_sq;
  }
};

/// Mean over the middle pixel of nine at unit distance, p[row][column], rows counted downwards (the sign of y does not
/// matter). Second order in the curvature of phase and amplitude, exact in the phase's slope. kQuadrature = false: it is
/// zero and not read.
template <bool kQuadrature, class S>
S fringe_mean(const FringePoint<S> (&p)[3][3]) {
  const auto differences = [&](auto of, S& x, S& y, S& xx, S& xy, S& yy) {
    const S middle = of(p[1][1]), l = of(p[1][0]), r = of(p[1][2]), u = of(p[0][1]), d = of(p[2][1]);
    x = 0.5 * (r - l);
    y = 0.5 * (d - u);
    xx = r + l - 2.0 * middle;
    yy = d + u - 2.0 * middle;
    xy = 0.25 * ((of(p[2][2]) - of(p[2][0])) - (of(p[0][2]) - of(p[0][0])));
  };
  S gx, gy, hxx, hxy, hyy, fx, fy, fxx, fxy, fyy;
  differences([](const FringePoint<S>& q) { return q.phase; }, gx, gy, hxx, hxy, hyy);
  const PixelMoments<S> mx(gx), my(gy);
  // (amplitude + i quadrature) e^{i phase} to second order about the middle:
  //   f + fx x + .. + (i f hxx + fxx) x^2/2 + (i f hxy + fxy) x y + ..
  // times e^{i (gx x + gy y)}; real and imaginary part of its mean without e^{i phase(middle)}.
  const S xx = mx.curvature * my.m0, yy = mx.m0 * my.curvature, xy = mx.slope * my.slope;
  const S zero = mx.m0 * my.m0, one_x = mx.slope * my.m0, one_y = mx.m0 * my.slope;
  const S bend = 0.5 * (hxx * xx + hyy * yy) + hxy * xy;
  const auto parts = [&](const S& f, S& even, S& odd) {
    even = f * zero - 0.5 * (fxx * xx + fyy * yy) - fxy * xy;
    odd = S(0.0) - fx * one_x - fy * one_y - f * bend;
  };
  S re, im;
  differences([](const FringePoint<S>& q) { return q.amplitude; }, fx, fy, fxx, fxy, fyy);
  parts(p[1][1].amplitude, re, im);
  if constexpr (kQuadrature) {
    S even, odd;
    differences([](const FringePoint<S>& q) { return q.quadrature; }, fx, fy, fxx, fxy, fyy);
    parts(p[1][1].quadrature, even, odd);
    re = re - odd;
    im = im + even;
  }
  S s, c;
  sin_cos(p[1][1].phase, s, c);
  const S around = (p[1][0].mean + p[1][2].mean) + (p[0][1].mean + p[2][1].mean) - 4.0 * p[1][1].mean;
  return p[1][1].mean + around * (1.0 / 24) + re * c - im * s;
}

}  // namespace birefit
