#include "transport/methods/ode_scalar.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include <boost/numeric/odeint/stepper/controlled_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/generation.hpp>
#include <boost/numeric/odeint/stepper/generation/generation_runge_kutta_dopri5.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_dopri5.hpp>

#include "transport/by_lane.h"
#include "transport/modes.h"

namespace birefit {
namespace {

namespace odeint = boost::numeric::odeint;
constexpr MethodInfo kInfo{
    "ode_scalar",
    0,
    false,
    false,
    "the four Wei-Norman equations by adaptive Dormand-Prince steps",
    "Steinberg, ACM Trans. Graph. 39 (2020), eqs. 25-28; Dormand & Prince, J. Comput. Appl. Math. 6 (1980)"};

using C = Complex<double>;
using State = std::array<double, 8>;  // f, g1, g2, g3

C number(const State& s, std::size_t i) { return {s[2 * i], s[2 * i + 1]}; }
void store(State& s, std::size_t i, const C& z) { s[2 * i] = z.re, s[2 * i + 1] = z.im; }

/// eq. 29
Mat2<double> product(const State& s) {
  const C f = number(s, 0), g1 = number(s, 1), g2 = number(s, 2), g3 = number(s, 3);
  const C up = exp(f + g3), down = exp(f - g3);
  return {(C(1.0) + g1 * g2) * up, g1 * down, g2 * up, down};
}

/// `sample`: the medium with its slope at u.
template <class Sample>
OdeScalarResult integrate(const Sample& sample, const Ray<double>& ray, double from, double to, double tolerance,
                          double restart_above) {
  OdeScalarResult result;
  result.mode_transfer = Mat2<double>::identity();
  const double last = std::nextafter(to, from);  // at a break the part ends on its own side
  const auto rates = [&](const State& s, State& rate, double u) {
    ++result.evaluations;
    const OpticalPoint<Slope<double>> p = by_depth(sample(std::clamp(u, from, last)));
    const ModalGenerator<double> m = modal_generator(p, ray);
    const C g1 = number(s, 1), g2 = number(s, 2), b2g1 = m.b2 * g1;
    const double dz = p.depth_slope_um.value;
    store(rate, 0, dz * m.a);
    store(rate, 1, dz * (m.b1 + (2.0 * m.b3 - b2g1) * g1));
    store(rate, 2, dz * (m.b2 + 2.0 * ((b2g1 - m.b3) * g2)));
    store(rate, 3, dz * (m.b3 - b2g1));
  };
  const auto fresh = [&] { return odeint::make_controlled(tolerance, tolerance, odeint::runge_kutta_dopri5<State>()); };
  auto stepper = fresh();
  State state{};
  double u = from, step = (to - from) / 64;
  while (u < to) {
    const bool final_step = u + step >= to;
    double h = final_step ? to - u : step;
    const bool accepted = stepper.try_step(rates, state, u, h) == odeint::success;
    for (const double x : state)
      if (!std::isfinite(x))
        throw std::logic_error("ode_scalar: the axis is parallel to the wavevector, modes are undefined");
    if (accepted && final_step) u = to;
    step = h;  // proposed
    if (u < to && step < 1e-13 * (to - from)) throw std::logic_error("ode_scalar: steps vanish at a pole");
    if (u < to && std::max(norm(number(state, 1)), norm(number(state, 2))) > restart_above * restart_above) {
      result.mode_transfer = product(state) * result.mode_transfer;
      state = State{};
      stepper = fresh();  // its last slope belongs to the old functions
      ++result.restarts;
    }
  }
  result.mode_transfer = product(state) * result.mode_transfer;
  result.f = number(state, 0), result.g1 = number(state, 1), result.g2 = number(state, 2), result.g3 = number(state, 3);
  return result;
}

template <class S>
struct Faces {
  double from, to;
  OpticalPoint<S> entry, exit;
};

}  // namespace

OdeScalarResult ode_scalar(const Column<double>& column, const Ray<double>& ray, double from, double to,
                           double tolerance, double restart_above) {
  const auto sample = [&](double u) {
    OpticalPoint<Slope<double>> p;
    column.sample_with_slope({&u, 1}, &p);
    return p;
  };
  return integrate(sample, ray, from, to, tolerance, restart_above);
}

template <class S>
const MethodInfo& OdeScalar<S>::info() const {
  return kInfo;
}

template <class S>
Mat2<S> OdeScalar<S>::transfer(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh) const {
  const auto prepare = [&](auto from, auto to) {
    const double ends[2] = {from, std::nextafter(to, from)};
    OpticalPoint<S> p[2];
    column.sample(ends, p);
    return Faces<S>{from, to, p[0], p[1]};
  };
  const auto step = [&](const auto& faces, int l, const Ray<double>& one) {
    const auto sample = [&](double u) {
      OpticalPoint<Slope<S>> p;
      column.sample_with_slope({&u, 1}, &p);
      return lane_of(p, l);
    };
    if (modes_turn_over([&](double u) { return value_of(sample(u)); }, one, faces.from, faces.to, 256))
      throw std::logic_error("ode_scalar: the axis passes the wavevector, where the modes change places");
    const Mat2<double> u = integrate(sample, one, faces.from, faces.to, tolerance_, 10).mode_transfer;
    const auto fields = [&](const auto& p) { return unit_modes(lane_of(p, l), one.kx, one.ky).fields; };
    return fields(faces.exit) * u * inverse(fields(faces.entry));
  };
  return transfer_by_lanes(kInfo, column, ray, mesh, prepare, step);
}

template <class S>
Su2<S> OdeScalar<S>::retarder(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh) const {
  return nearest_retarder(column, ray, transfer(column, ray, mesh));
}

#define BIREFIT_INSTANTIATE(S) template class OdeScalar<S>;
BIREFIT_FOR_EACH_SCALAR_OF_TABLES(BIREFIT_INSTANTIATE)

}  // namespace birefit
