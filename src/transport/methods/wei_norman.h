#pragma once
// The analytic transport of Steinberg, TOG 2020: the
// two mode amplitudes of a layer as a product of exponentials (Wei & Norman), its coupling integrals in closed form.
//
//   U = e^f diag(e^g3, e^-g3) S,   G1 = int e^{-2 g3} b1 dz,   G2 = int e^{2 g3} b2 dz,   f = int a,  g3 = int b3
//   S = [[1 + G1 G2, G1], [G2, 1]]     the paper (eq. 29; its g1 = G1 e^{2 g3}, g2 = G2 e^{-2 g3} can overflow)
//   S = exp [[0, G1], [G2, 0]]         the same integrals without an order of the two couplings: one order better
//
// G1, G2: Taylor series of the envelopes e^{-2 Re g3} b1, e^{2 Re g3} b2 against exp(-+ 2 i (c1 z + c2 z^2)), z from
// the point of expansion, c1 = Im b3, c2 = Im b3'/2 there (eqs. 30-36). Wherever b2 vanishes (an axis that does not
// turn and constant n_o) nothing but the series is approximate.

#include <string>

#include "transport/method.h"

namespace birefit {

/// The choices in which the two methods differ.
struct WeiNormanForm {
  int order = 7;             ///< of the Taylor series, 1 .. kTaylorOrder; their cost grows as its square
  bool centred = false;      ///< expanded about the layer's middle, else about its entry face
  bool exponential = false;  ///< S = exp(..), else the ordered product
  bool phase_series = true;  ///< f and g3 by their Taylor series (eqs. 32, 33), else by 2 x 16 Gauss nodes
};
inline constexpr WeiNormanForm kWeiNormanPaper{};
inline constexpr WeiNormanForm kWeiNormanExp{7, true, true, false};

/// One layer. Lengths in um; f, g3, G1, G2 as above.
struct WeiNormanLayer {
  Complex<double> f, g3, G1, G2;
  double length_um = 0;
  double c1_per_um = 0, c2_per_um2 = 0;
  double phase_residual_rad = 0;  ///< eq. 37: phase of the coupling that c1 z + c2 z^2 leaves out
  double taylor_tail = 0;         ///< last term over the sum of all: of the envelopes, and of f and g3 where by series
  double truncation = 0;          ///< what the series leave out of the transfer, if no worse than geometric by halves
  double peak_coupling = 0;       ///< max |b1|, |b2| times the length
  double estimate = 0;            ///< see WeiNormanReport
  Matrix2<Complex<double>> mode_transfer(bool exponential) const;  ///< U
};
/// Layer [from, to] in u of a column that is smooth there; `check` fills phase_residual_rad, peak_coupling and estimate
/// too, at the price of a quadrature.
WeiNormanLayer wei_norman_layer(const Column<double>& column, const Ray<double>& ray, double from, double to,
                                const WeiNormanForm& form, bool check = true);

/// Can a result be trusted, and how far?
struct WeiNormanReport {
  /// Relative error of the transfer from dropping -b2 g1 in eq. 27 and from the order of the couplings:
  /// sum of dz |b1 b2| min(h/2, 1/(2 |b3|)). Measured within 30 % for the paper's form (a factor 3 high for single
  /// layers that are not valid anyway), an upper bound, to the same 30 %, for the other.
  double estimate = 0;
  /// Relative error of the transfer from ending the series: the sum of their last terms, which bounds the rest where
  /// each term is at most half of the one before (where not, taylor_tail refuses).
  double truncation = 0;
  double phase_residual_rad = 0;  ///< the largest of all layers, as are the next two
  double taylor_tail = 0;
  double peak_coupling = 0;
  double min_v22 = 1;  ///< smallest |V22| of a layer over its common amplitude: g1 has a pole where it is 0
  bool valid = true;
  std::string reason;  ///< why not
};
WeiNormanReport wei_norman_report(const Column<double>& column, const Ray<double>& ray, const Mesh& mesh,
                                  const WeiNormanForm& form);

/// The method of the source paper, whole: entry face, ordered product, f and g3 by series. One layer a mesh step.
/// Order 1. Values only: throws std::logic_error for scalars with derivatives, and for columns without a law.
template <class S>
class WeiNorman final : public TransportMethod<S> {
 public:
  explicit WeiNorman(int order = kWeiNormanPaper.order) { form_.order = order; }
  const MethodInfo& info() const override;
  Mat2<S> transfer(const Column<S>&, const Ray<S>&, const Mesh&) const override;
  /// transfer() brought to the nearest retarder, sign undetermined.
  Su2<S> retarder(const Column<S>&, const Ray<S>&, const Mesh&) const override;
  const WeiNormanForm& form() const { return form_; }

 private:
  WeiNormanForm form_ = kWeiNormanPaper;
};

/// The same integrals about layer centres with S = exp(..), f and g3 by quadrature. Order 2.
template <class S>
class WeiNormanExp final : public TransportMethod<S> {
 public:
  explicit WeiNormanExp(int order = kWeiNormanExp.order) { form_.order = order; }
  const MethodInfo& info() const override;
  Mat2<S> transfer(const Column<S>&, const Ray<S>&, const Mesh&) const override;
  Su2<S> retarder(const Column<S>&, const Ray<S>&, const Mesh&) const override;
  const WeiNormanForm& form() const { return form_; }

 private:
  WeiNormanForm form_ = kWeiNormanExp;
};

}  // namespace birefit
