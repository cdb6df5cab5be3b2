#pragma once
// The four scalar equations of Wei and Norman, Steinberg TOG 2020 eqs. 25-28, without his simplification:
//
//   f' = a,  g1' = b1 + 2 b3 g1 - b2 g1^2,  g2' = b2 - 2 b3 g2 + 2 b2 g1 g2,  g3' = b3 - b2 g1
//   U = e^f [[(1 + g1 g2) e^g3, g1 e^-g3], [g2 e^g3, e^-g3]]                                    (eq. 29)
//
// integrated by the adaptive Runge-Kutta pair of Dormand and Prince (order 5). g1 has a pole wherever the extraordinary
// amplitude that came from an extraordinary one vanishes, which the paper denies: there the product so far is put aside
// and the functions start again from 0.

#include "transport/method.h"

namespace birefit {

struct OdeScalarResult {
  Mat2<double> mode_transfer;     ///< U
  Complex<double> f, g1, g2, g3;  ///< since the last restart
  int evaluations = 0;            ///< of the right-hand side
  int restarts = 0;
};
/// Part [from, to] in u of a column that is smooth there. `tolerance`: local, absolute and relative, > 0.
/// Restarts when |g1| or |g2| exceeds `restart_above`. std::logic_error where the axis is parallel to the wavevector,
/// and at a pole that too large a `restart_above` lets happen: never NaN.
OdeScalarResult ode_scalar(const Column<double>& column, const Ray<double>& ray, double from, double to,
                           double tolerance, double restart_above = 10);

/// The mesh only bounds the steps and starts the functions anew; steps adapt. Values only: throws std::logic_error for
/// scalars with derivatives.
template <class S>
class OdeScalar final : public TransportMethod<S> {
 public:
  explicit OdeScalar(double tolerance = 1e-9) : tolerance_(tolerance) {}
  const MethodInfo& info() const override;
  Mat2<S> transfer(const Column<S>&, const Ray<S>&, const Mesh&) const override;
  /// transfer() brought to the nearest retarder, sign undetermined.
  Su2<S> retarder(const Column<S>&, const Ray<S>&, const Mesh&) const override;

 private:
  double tolerance_;
};

}  // namespace birefit
