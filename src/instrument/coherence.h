#pragma once
// White and filtered light through a retardance: the complex degree of coherence of a channel,
//
//     chi_c(G) = integral of w_c(l) e^{2 pi i G t(l)} dl,   t = D(l)/l,
//
// G the path difference (um) at the wavelength where D is 1, D its dispersion. A diagonal ray passes a + b cos delta +
// c sin delta, which a channel records as a + b Re chi + c Im chi. docs/methods.md, "Spectrum".

#include <array>
#include <cstddef>
#include <vector>

#include "core/scalar.h"
#include "core/taylor.h"
#include "instrument/channels.h"

namespace birefit {

/// What a mean over the spectrum makes of e^{i delta}. `loss` = 1 - Re keeps its digits where delta is small, in dark
/// pixels: a + b Re + c Im = (a + b) - b loss + c im, where a + b is nothing between crossed polarizers.
template <class S>
struct MeanPhase {
  S loss, im;
  S re() const { return S(1.0) - loss; }
};

/// Tables of chi and chi' over G, a row for every channel and one for every derivative of its weights.
class Coherence {
 public:
  /// Of the sum's weights with t (1/um, finite, above 0) at its wavelengths; tables up to |G| = reach_um (above 0),
  /// within 1e-13 of the sum itself, chi' within 1e-10. Beyond them the sum is made at every call, a thousand times
  /// slower, and good to the reach that it was made for (Channels::fine).
  Coherence(const SpectralSum&, const std::vector<double>& t, double reach_um);
  /// Of any rows of weights over t, which need no sum of 1: of weights times dt/dp a derivative by a number p of the
  /// dispersion, dchi/dp = 2 pi i G (sum - loss + i im).
  Coherence(std::vector<std::vector<double>> rows, std::vector<double> t, double reach_um);

  std::size_t channels() const { return channels_; }
  /// Row of a channel's derivative by one of Channels::numbers(); channels themselves are the rows from 0. Its loss is
  /// - d Re chi, as its weights sum to 0.
  std::size_t row_of(std::size_t number, std::size_t channel) const { return channels_ * (1 + number) + channel; }
  std::size_t rows() const { return row_.size(); }
  double reach_um() const { return reach_; }

  /// chi of a row: sum of its weights - loss, and im.
  template <class S>
  MeanPhase<S> at(std::size_t row, const S& g) const {
    const WithSlope<PlainOf<S>> v = values(row, plain(g));
    return raise(g, v);
  }

 private:
  static constexpr std::size_t kPoints = 16;
  template <class P>
  struct WithSlope {
    P loss, im, loss_slope, im_slope;
  };
  /// Coefficients of powers of the place within a panel, [-1, 1]: loss and im; in the panel at 0 loss/G^2 and im/G
  /// over G^2.
  struct Panel {
    double power[kPoints][2];
  };
  void tabulate();
  template <class P>
  WithSlope<P> values(std::size_t row, const P& g) const;
  /// Of a panel by the place in it, and their derivatives by that.
  template <class P, class Coefficient>
  static WithSlope<P> polynomials(const P& x, const Coefficient& coefficient);
  WithSlope<double> beyond(std::size_t row, double g) const;
  WithSlope<Pack> beyond(std::size_t row, const Pack& g) const;
  static MeanPhase<double> raise(double, const WithSlope<double>& v) { return {v.loss, v.im}; }
  static MeanPhase<Pack> raise(const Pack&, const WithSlope<Pack>& v) { return {v.loss, v.im}; }
  template <class B, int N>
  static MeanPhase<Dual<B, N>> raise(const Dual<B, N>& g, const WithSlope<PlainOf<B>>& v) {
    return {g.chain(v.loss, v.loss_slope), g.chain(v.im, v.im_slope)};
  }

  std::size_t channels_;
  std::vector<std::vector<double>> row_;
  std::vector<double> t_;
  double reach_, width_;
  std::size_t panels_;
  std::vector<Panel> panel_;  // [row][panel]
};

/// A phase difference by relative wavelength y = l/l0 - 1: value and derivatives at y = 0, rad.
template <class S>
struct PhaseSeries {
  S d0, d1, d2, d3, d4;
};
/// Of a law evaluated at the wavelength l0 Taylor<S, 4>::variable(1) (core/taylor.h).
template <class S>
PhaseSeries<S> phase_series(const Taylor<S, 4>& by_y) {
  return {by_y.c[0], by_y.c[1], by_y.c[2] * 2.0, by_y.c[3] * 6.0, by_y.c[4] * 24.0};
}

/// Mean of e^{i delta} over a line that is Gaussian in wavelength, `sigma` = fwhm/(2.3548 l0): chirp (d2) in closed
/// form, d3 to first order. Errors of the intensity: docs/methods.md; estimated by gaussian_line_error.
template <class S>
MeanPhase<S> gaussian_line(const PhaseSeries<S>& phase, const S& sigma) {
  const S s2 = sigma * sigma, c = s2 * phase.d2;
  // z = 1 - i c; 1/z = (1 + i c)/(1 + c^2); z^{-1/2} by its modulus and half its angle
  const S over = S(1.0) / (1.0 + c * c);
  const Complex<S> inverse_z(over, c * over);
  const Complex<S> root_z = sqrt(inverse_z);
  const S half = S(0.5) * s2 * phase.d1 * phase.d1;
  const Complex<S> mean = root_z * exp(Complex<S>(S(0.0) - half * inverse_z.re, phase.d0 - half * inverse_z.im));
  // m = i s2 d1/z is where the mean of y moves to, u = s2/z its variance: <y^3> = m^3 + 3 m u.
  const Complex<S> m = times_i(Complex<S>(s2 * phase.d1) * inverse_z), u = s2 * inverse_z;
  const Complex<S> cubic = times_i((phase.d3 * S(1.0 / 6)) * (m * (m * m + S(3.0) * u)));
  const Complex<S> all = mean * (Complex<S>(S(1.0)) + cubic);
  return {S(1.0) - all.re, all.im};
}
/// About the error that gaussian_line leaves: half the square of its third order and the fourth order.
double gaussian_line_error(const PhaseSeries<double>& phase, double sigma);

}  // namespace birefit
