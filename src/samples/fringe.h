#pragma once
// The mean of a fringe over a pixel in closed form. A retarder between polarizers gives
//   I = mean + Re((amplitude + i quadrature) e^{i phase})
// with four smooth functions, however fine the fringe (quadrature is what coupling and absorption add; without them it
// vanishes): one ray a pixel serves where sampling the intensity itself needs several a fringe, and one ray for many
// pixels where the functions are interpolated.

#include <array>
#include <optional>

#include "core/scalar.h"

namespace birefit {

template <class S>
struct FringePoint {
  S amplitude, phase, mean, quadrature;
};

/// A parameter that carries all fringes along and changes none: its derivative is the one along
/// (column, row) + growth (column of the place, row of the place), in pixels for one unit of the parameter; growth is
/// that of the logarithm of the scale.
struct FringeFlow {
  double column, row, growth;
};

/// What a derivative changes of a FringePoint.
struct FringeFields {
  unsigned own = 15;                 ///< the fields with values of their own, bit k the k-th
  double phase_share = 0;            ///< of the phase itself, added to its change: a thickness, a wavelength scale it
  std::optional<FringeFlow> flow{};  ///< nothing else, then
  bool has(std::size_t field) const { return own >> field & 1; }
};

/// What a table makes known of a whole picture's fringes.
struct FringeTraits {
  bool averaged = false;  ///< the mean field is its mean over pixels already
  bool even = false;      ///< amplitude, mean and quadrature have differences over three pixels for slopes
};

/// Moments of e^{i g x} over x in [-1/2, 1/2]: m0 = int e^{igx} = sinc(g/2), int x e^{igx} = -i m0', int x^2 e^{igx} =
/// -m0''. With s(q) = sin(sqrt q)/sqrt q, q = g^2/4: m0' = (g/2) s', and 4 q s'' + 6 s' + s = 0 gives m0'' = -s' - s/4,
/// m0''' = -(g/2) (s'' + s'/4).
template <class P>
struct PixelMoments {
  P m0, slope, curvature, third;  ///< m0 and its first three derivatives
  BIREFIT_INLINE explicit PixelMoments(const P& g) {
    const P half = P(0.5) * g, q = half * half;
    P s0, s1, s2;
    // s = sum (-q)^k/(2k + 1)!, up to half a turn a pixel; beyond, which no camera resolves, q is large enough to
    // divide by.
    constexpr double kTurn = 2.5;
    if (largest(q) < kTurn) [[likely]] {
      s1 = sum<1>(q), s2 = sum<2>(q), s0 = P(-6.0) * s1 - P(4.0) * (q * s2);
    } else {
      const CosSinc<P> f = cos_sinc_sq(q);
      const auto small = q < P(0.1);
      const P share = inverse(select(small, P(1.0), q));
      s0 = f.sinc_sq;
      s1 = select(small, sum<1>(q), P(0.5) * (f.cos_sq - f.sinc_sq) * share);
      s2 = select(small, sum<2>(q), P(-0.25) * (P(6.0) * s1 + s0) * share);
    }
    m0 = s0, slope = half * s1, curvature = P(-0.25) * s0 - s1, third = -half * (s2 + P(0.25) * s1);
  }

 private:
  /// The series' derivative of order kOrder.
  template <int kOrder>
  BIREFIT_INLINE static P sum(const P& q) {
    constexpr int kTerms = 11;  // for q < 2.5 the next is below 1e-15, in the second derivative, too
    static constexpr std::array<double, kTerms> c = [] {
      std::array<double, kTerms> a{};
      double factorial = 1;  // (2k + 1)! with its sign
      for (int k = 0; k < kTerms; ++k) {
        if (k > 0) factorial *= -2.0 * k * (2 * k + 1);
        double falling = 1;
        for (int m = 0; m < kOrder; ++m) falling *= k - m;
        if (k >= kOrder) a[static_cast<std::size_t>(k - kOrder)] = falling / factorial;
      }
      return a;
    }();
    // Even and odd powers apart: each product waits for the one before it.
    const P square = q * q;
    P high(c[kTerms - 1 - kOrder]), low(c[kTerms - 2 - kOrder]);
    int k = kTerms - 3 - kOrder;
    for (; k > 0; k -= 2) {
      high = high * square + P(c[static_cast<std::size_t>(k)]);
      low = low * square + P(c[static_cast<std::size_t>(k - 1)]);
    }
    if (k == 0) return low * q + (high * square + P(c[0]));
    return high * q + low;
  }
};

/// A quadratic through nine pixels at unit distance, rows counted downwards (the sign of y does not matter).
template <class P>
struct NinePoints {
  P f, x, y, xx, xy, yy;  ///< value and derivatives in the middle
  /// at(row, column), both 0 in the middle
  template <class At>
  BIREFIT_INLINE static NinePoints of(const At& at) {
    const P middle = at(0, 0), l = at(0, -1), r = at(0, 1), u = at(-1, 0), d = at(1, 0);
    return {middle,
            P(0.5) * (r - l),
            P(0.5) * (d - u),
            r + l - P(2.0) * middle,
            P(0.25) * ((at(1, 1) - at(1, -1)) - (at(-1, 1) - at(-1, -1))),
            d + u - P(2.0) * middle};
  }
  BIREFIT_INLINE P times(const NinePoints& o) const {
    return (f * o.f + x * o.x + y * o.y) + (xx * o.xx + xy * o.xy + yy * o.yy);
  }
};

/// What a change of nine points changes, once its derivatives by the quadratic's six numbers are known.
template <class P>
class NineWeights {
 public:
  NineWeights() = default;
  explicit NineWeights(const NinePoints<P>& by)
      : middle_(by.f - P(2.0) * (by.xx + by.yy)),
        left_(by.xx - P(0.5) * by.x),
        right_(by.xx + P(0.5) * by.x),
        up_(by.yy - P(0.5) * by.y),
        down_(by.yy + P(0.5) * by.y),
        corners_(P(0.25) * by.xy) {}
  template <class At>
  BIREFIT_INLINE P times(const At& at) const {
    return (middle_ * at(0, 0) + left_ * at(0, -1) + right_ * at(0, 1)) +
           (up_ * at(-1, 0) + down_ * at(1, 0) + corners_ * ((at(1, 1) - at(1, -1)) - (at(-1, 1) - at(-1, -1))));
  }

 private:
  P middle_, left_, right_, up_, down_, corners_;
};

/// In the middle of nine points, by two pixels more on either axis.
template <class P>
struct ThirdDerivatives {
  P xxx, xxy, xyy, yyy;
  template <class At>
  BIREFIT_INLINE static ThirdDerivatives of(const NinePoints<P>& f, const At& at) {
    const P a = at(-1, -1), b = at(-1, 1), c = at(1, -1), d = at(1, 1), half(0.5), two(2.0);
    return {half * (at(0, 2) - at(0, -2)) - two * f.x, half * ((c + d) - (a + b)) - two * f.y,
            half * ((b + d) - (a + c)) - two * f.x, half * (at(2, 0) - at(-2, 0)) - two * f.y};
  }
};

/// What the mean over a pixel changes by where its nine points are carried along: by their quadratic's derivatives and
/// by third ones, of which they take a sixth for slope. `mean_by`: the mean's derivatives by the quadratic's numbers.
template <class P>
struct CarriedMean {
  P by_column = P(0.0), by_row = P(0.0), by_growth = P(0.0);

  BIREFIT_INLINE void carry(const NinePoints<P>& f, const NinePoints<P>& mean_by) {
    by_column = by_column + (mean_by.f * f.x + mean_by.x * f.xx + mean_by.y * f.xy);
    by_row = by_row + (mean_by.f * f.y + mean_by.x * f.xy + mean_by.y * f.yy);
    by_growth = by_growth + (mean_by.x * f.x + mean_by.y * f.y) +
                P(2.0) * (mean_by.xx * f.xx + mean_by.xy * f.xy + mean_by.yy * f.yy);
  }
  template <class At>
  BIREFIT_INLINE void carry_third(const NinePoints<P>& f, const NinePoints<P>& mean_by, const At& at) {
    const auto third = ThirdDerivatives<P>::of(f, at);
    const P sixth = P(-1.0 / 6) * mean_by.f;
    by_column = by_column + ((mean_by.xx + sixth) * third.xxx + mean_by.xy * third.xxy + mean_by.yy * third.xyy);
    by_row = by_row + ((mean_by.yy + sixth) * third.yyy + mean_by.xy * third.xyy + mean_by.xx * third.xxy);
    by_growth = by_growth + P(1.0 / 3) * (mean_by.x * third.xxx + mean_by.y * third.yyy);
  }
  /// The mean field itself, of which a pixel sees the curvature.
  BIREFIT_INLINE void carry_mean(const NinePoints<P>& mean) {
    by_column = by_column + mean.x;
    by_row = by_row + mean.y;
    by_growth = by_growth + P(1.0 / 12) * (mean.xx + mean.yy);
  }
  BIREFIT_INLINE P along(const FringeFlow& flow, const P& column, const P& row) const {
    const P growth(flow.growth);
    return (P(flow.column) + growth * column) * by_column + (P(flow.row) + growth * row) * by_row + growth * by_growth;
  }
};

/// Mean over the middle pixel of nine at unit distance, second order in the curvature of phase and amplitude and exact
/// in the phase's slope, with its derivatives. load(plane, field, row, column): plane 0 holds values, the others, of
/// kMostPlanes at most, their derivatives by parameters; fields are numbered as in FringePoint, row and column from the
/// middle pixel, whose place in the picture is (column, row). put(plane, mean). kQuadrature = false: it is zero and not
/// read. fields[plane]: what of them a parameter moves, the others are not read; kFlows = false: none has a flow. What
/// a change of any of the nine points does to the mean is found once, backwards through the formula, and serves all
/// derivatives; flows read two pixels further.
template <bool kQuadrature, bool kFlows, int kMostPlanes, class P, class Load, class Put>
BIREFIT_INLINE void fringe_means(int planes, const FringeTraits& traits, const P& column, const P& row,
                                 const FringeFields* fields, const Load& load, const Put& put) {
  const auto field = [&load](int plane, int f) BIREFIT_INLINE_LAMBDA {
    return [&load, plane, f](int j, int i) BIREFIT_INLINE_LAMBDA { return load(plane, f, j, i); };
  };
  const auto mean_of = [&](int plane) BIREFIT_INLINE_LAMBDA {
    const auto at = field(plane, 2);
    if (traits.averaged) return at(0, 0);
    return P(1 - 4.0 / 24) * at(0, 0) + P(1.0 / 24) * ((at(0, -1) + at(0, 1)) + (at(-1, 0) + at(1, 0)));
  };
  const NinePoints<P> phase = NinePoints<P>::of(field(0, 1)), amplitude = NinePoints<P>::of(field(0, 0));
  const PixelMoments<P> mx(phase.x), my(phase.y);
  // (amplitude + i quadrature) e^{i phase} to second order about the middle:
  //   f + fx x + .. + (i f hxx + fxx) x^2/2 + (i f hxy + fxy) x y + ..
  // times e^{i (gx x + gy y)}; real and imaginary part of its mean without e^{i phase(middle)}.
  const P xx = mx.curvature * my.m0, yy = mx.m0 * my.curvature, xy = mx.slope * my.slope;
  const P zero = mx.m0 * my.m0, one_x = mx.slope * my.m0, one_y = mx.m0 * my.slope;
  const P bend = P(0.5) * (phase.xx * xx + phase.yy * yy) + phase.xy * xy;
  const auto even_of = [&](const NinePoints<P>& f)
                           BIREFIT_INLINE_LAMBDA { return f.f * zero - P(0.5) * (f.xx * xx + f.yy * yy) - f.xy * xy; };
  const auto odd_of = [&](const NinePoints<P>& f)
                          BIREFIT_INLINE_LAMBDA { return P(0.0) - f.x * one_x - f.y * one_y - f.f * bend; };
  P re = even_of(amplitude), im = odd_of(amplitude);
  NinePoints<P> quadrature{};
  if constexpr (kQuadrature) {
    quadrature = NinePoints<P>::of(field(0, 3));
    re = re - odd_of(quadrature);
    im = im + even_of(quadrature);
  }
  P s, c;
  sin_cos(phase.f, s, c);
  const P value = mean_of(0) + re * c - im * s;
  if (kMostPlanes == 1 || planes <= 1) {
    put(0, value);
    return;
  }

  // Backwards: by_* is the mean's derivative by *.
  const P half_xx = P(0.5) * xx, half_yy = P(0.5) * yy;
  struct By {
    P zero, one_x, one_y, xx, yy, xy, bend;
  };
  const auto back = [](const NinePoints<P>& f, const P& even, const P& odd) BIREFIT_INLINE_LAMBDA {
    const P half = P(-0.5) * even;
    return By{even * f.f, -odd * f.x, -odd * f.y, half * f.xx, half * f.yy, -even * f.xy, -odd * f.f};
  };
  const auto points = [&](const P& even, const P& odd) BIREFIT_INLINE_LAMBDA {
    return NinePoints<P>{even * zero - odd * bend, -odd * one_x, -odd * one_y,
                         -even * half_xx,          -even * xy,   -even * half_yy};
  };
  By by = back(amplitude, c, -s);
  const NinePoints<P> by_amplitude = points(c, -s);
  [[maybe_unused]] NinePoints<P> by_quadrature;
  if constexpr (kQuadrature) {
    const By more = back(quadrature, -s, -c);
    by = {by.zero + more.zero, by.one_x + more.one_x, by.one_y + more.one_y, by.xx + more.xx,
          by.yy + more.yy,     by.xy + more.xy,       by.bend + more.bend};
    by_quadrature = points(-s, -c);
  }
  const P half_bend = P(0.5) * by.bend;
  by.xx = by.xx + phase.xx * half_bend, by.yy = by.yy + phase.yy * half_bend, by.xy = by.xy + phase.xy * by.bend;
  const P xxx = mx.third * my.m0, yyy = mx.m0 * my.third, xxy = mx.curvature * my.slope, xyy = mx.slope * my.curvature;
  const NinePoints<P> by_phase{
      -(re * s + im * c),
      by.zero * one_x + by.one_x * xx + by.one_y * xy + by.xx * xxx + by.yy * xyy + by.xy * xxy,
      by.zero * one_y + by.one_x * xy + by.one_y * yy + by.xx * xxy + by.yy * yyy + by.xy * xyy,
      xx * half_bend,
      xy * by.bend,
      yy * half_bend};

  [[maybe_unused]] CarriedMean<P> carried;
  if constexpr (kFlows) {
    carried.carry(phase, by_phase);
    carried.carry_third(phase, by_phase, field(0, 1));
    carried.carry(amplitude, by_amplitude);
    if constexpr (kQuadrature) carried.carry(quadrature, by_quadrature);
    const NinePoints<P> mean = NinePoints<P>::of(field(0, 2));
    carried.carry_mean(mean);
    if (!traits.even) {
      const P none(0.0), share(traits.averaged ? 0.0 : 1.0 / 24);
      carried.carry_third(mean, {P(1.0), none, none, share, none, share}, field(0, 2));
      carried.carry_third(amplitude, by_amplitude, field(0, 0));
      if constexpr (kQuadrature) carried.carry_third(quadrature, by_quadrature, field(0, 3));
    }
  }
  put(0, value);
  const NineWeights<P> of_amplitude(by_amplitude), of_phase(by_phase);
  [[maybe_unused]] NineWeights<P> of_quadrature;
  if constexpr (kQuadrature) of_quadrature = NineWeights<P>(by_quadrature);
  for (int plane = 1; plane < planes; ++plane) {
    const FringeFields& moved = fields[plane];
    if constexpr (kFlows)
      if (moved.flow) {
        put(plane, carried.along(*moved.flow, column, row));
        continue;
      }
    P d(0.0);
    if (moved.has(0)) d = of_amplitude.times(field(plane, 0));
    if (moved.has(1)) d = d + of_phase.times(field(plane, 1));
    if (moved.phase_share != 0) d = d + P(moved.phase_share) * by_phase.times(phase);
    if (moved.has(2)) d = d + mean_of(plane);
    if constexpr (kQuadrature)
      if (moved.has(3)) d = d + of_quadrature.times(field(plane, 3));
    put(plane, d);
  }
}

/// The same of nine points p[row][column].
template <bool kQuadrature, class S>
S fringe_mean(const FringePoint<S> (&p)[3][3]) {
  using P = PlainOf<S>;
  S mean(0.0);
  const auto load = [&p](int plane, int field, int row, int column) -> P {
    const FringePoint<S>& q = p[row + 1][column + 1];
    const S& part = field == 0 ? q.amplitude : field == 1 ? q.phase : field == 2 ? q.mean : q.quadrature;
    if constexpr (ScalarTraits<S>::derivatives > 0) {
      if (plane > 0) return part.d[static_cast<std::size_t>(plane - 1)];
    }
    return plain(part);
  };
  constexpr int kPlanes = 1 + ScalarTraits<S>::derivatives;
  static constexpr std::array<FringeFields, kPlanes> kAll{};
  fringe_means<kQuadrature, false, kPlanes, P>(kPlanes, {}, P(0.0), P(0.0), kAll.data(), load,
                                               [&mean](int plane, const P& value) {
                                                 if constexpr (ScalarTraits<S>::derivatives > 0) {
                                                   if (plane > 0) {
                                                     mean.d[static_cast<std::size_t>(plane - 1)] = value;
                                                     return;
                                                   }
                                                   mean.value = value;
                                                 } else {
                                                   mean = value;
                                                 }
                                               });
  return mean;
}

}  // namespace birefit
