#pragma once
// The operator equation dE_t/du = generator E_t (Steinberg TOG 2020 eq. 19, for E_t) by the adaptive Runge-Kutta pair
// of Dormand and Prince: the source paper's ode45 on the whole operator. Its steps must resolve the common phase too.

#include "transport/method.h"

namespace birefit {

/// The mesh only bounds the steps; they adapt to `tolerance` (local, absolute and relative, > 0). Plain doubles.
class OdeOperator final : public TransportMethod<double> {
 public:
  explicit OdeOperator(double tolerance = 1e-9) : tolerance_(tolerance) {}
  const MethodInfo& info() const override;
  Mat2<double> transfer(const Column<double>&, const Ray<double>&, const Mesh&) const override;
  /// Throws std::logic_error: the equation of a retarder alone is not what this method is for.
  Su2<double> retarder(const Column<double>&, const Ray<double>&, const Mesh&) const override;

 private:
  double tolerance_;
};

}  // namespace birefit
