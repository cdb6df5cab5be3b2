#include "transport/methods/ode_operator.h"

#include <array>
#include <cmath>
#include <stdexcept>

#include <boost/numeric/odeint/stepper/controlled_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/generation.hpp>
#include <boost/numeric/odeint/stepper/generation/generation_runge_kutta_dopri5.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_dopri5.hpp>

namespace birefit {
namespace {

namespace odeint = boost::numeric::odeint;
constexpr MethodInfo kInfo{
    "ode_operator",
    0,
    false,
    false,
    "the operator equation by adaptive Dormand-Prince steps",
    "Steinberg, ACM Trans. Graph. 39 (2020), eq. 19; Dormand & Prince, J. Comput. Appl. Math. 6 (1980)"};
using State = std::array<double, 8>;

State packed(const Mat2<double>& m) { return {m.a.re, m.a.im, m.b.re, m.b.im, m.c.re, m.c.im, m.d.re, m.d.im}; }
Mat2<double> unpacked(const State& s) { return {{s[0], s[1]}, {s[2], s[3]}, {s[4], s[5]}, {s[6], s[7]}}; }

}  // namespace

const MethodInfo& OdeOperator::info() const { return kInfo; }

Mat2<double> OdeOperator::transfer(const Column<double>& column, const Ray<double>& ray, const Mesh& mesh) const {
  const bool lossless = !column.absorbing;
  State state = packed(Mat2<double>::identity());
  double step = mesh[1] / 64;
  for (std::size_t i = 0; i + 1 < mesh.size(); ++i) {
    // At a break each part ends on its own side.
    const double from = std::nextafter(mesh[i], 1.0), to = std::nextafter(mesh[i + 1], 0.0);
    const auto rate = [&](const State& s, State& out, double u) {
      const double at[1] = {std::clamp(u, from, to)};
      Mat2<double> generator;
      if (ray.continuity == Continuity::e_and_h) {
        OpticalPoint<Slope<double>> p;
        column.sample_with_slope(at, &p);
        generator = generator_e_and_h(p, ray.k0_per_um, ray.kx, ray.ky, lossless);
      } else {
        OpticalPoint<double> p;
        column.sample(at, &p);
        generator = generator_e_only(p, ray.k0_per_um, ray.kx, ray.ky, lossless);
      }
      out = packed(generator * unpacked(s));
    };
    auto stepper = odeint::make_controlled(tolerance_, tolerance_, odeint::runge_kutta_dopri5<State>());
    double u = mesh[i];
    while (u < mesh[i + 1]) {
      const bool last = u + step >= mesh[i + 1];
      double h = last ? mesh[i + 1] - u : step;
      const bool accepted = stepper.try_step(rate, state, u, h) == odeint::success;
      if (accepted && last) u = mesh[i + 1];
      if (!accepted && h < 1e-14) throw std::logic_error("ode_operator: steps vanish");
      // A last step cut short says nothing about the next part's.
      step = accepted && last ? std::max(h, step) : h;
    }
    if (ray.continuity == Continuity::e_and_h)
      state = packed(step_of_medium(column, ray, mesh, i + 1) * unpacked(state));
  }
  return unpacked(state);
}

Su2<double> OdeOperator::retarder(const Column<double>&, const Ray<double>&, const Mesh&) const {
  throw std::logic_error("ode_operator integrates the operator, not the retarder");
}

}  // namespace birefit
