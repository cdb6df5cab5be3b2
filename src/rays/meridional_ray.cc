// One ray of either mode through a droplet, in the plane of the viewing axis.

#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include <boost/numeric/odeint/stepper/controlled_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/generation.hpp>
#include <boost/numeric/odeint/stepper/generation/generation_runge_kutta_dopri5.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_dopri5.hpp>

#include "medium/families/axial_angle.h"
#include "rays/eikonal.h"

namespace birefit {

namespace {

namespace odeint = boost::numeric::odeint;
constexpr double kPi = std::numbers::pi;
constexpr double kMostTurn = 1.4;  ///< rad: rays turned by 80 degrees and more never reach an objective

/// Share of the flux that passes a surface between wave admittances y1 and y2.
template <class T>
T passed(const T& y1, const T& y2) {
  const T over = 1.0 / (y1 + y2);
  return 4.0 * y1 * y2 * over * over;
}
template <class T>
T cosine_of(const T& sine) {
  return sqrt(1.0 - sine * sine);
}

template <class T>
MeridionalRay<T> radial_ray(const MeridionalDroplet<T>& d, bool extraordinary, const T& psi) {
  MeridionalRay<T> ray;
  const T index = extraordinary ? d.extraordinary : T(1.0), faster = 1.0 / index;
  T s1, c1;
  sin_cos(psi, s1, c1);
  const T momentum = d.host * s1, nearest = momentum / index;
  // Wave admittances: of p waves n/cos outside and n_o/cos inside, where the cosine is that of nearest = sin; of s
  // waves n cos.
  const auto admittance = [&](const T& n, const T& cosine) { return extraordinary ? n / cosine : n * cosine; };
  if (!(plain(nearest) < 1)) return ray.arrives = false, ray;
  const T c2 = cosine_of(nearest);
  const T through = passed(admittance(d.host, c1), admittance(T(1.0), c2));
  T sweep = faster * angle_of(c2, nearest), path = c2;  // from the sphere to where the ray is nearest to the centre
  ray.flux = through * through;
  if (plain(nearest) < plain(d.core)) {
    const T in_wall = nearest / d.core, in_core = momentum / (d.core * d.core_index);
    if (!(plain(in_core) < 1)) return ray.arrives = false, ray;
    const T cw = cosine_of(in_wall), cc = cosine_of(in_core);
    sweep = sweep - faster * angle_of(cw, in_wall) + angle_of(cc, in_core);
    path = path - d.core * cw + d.core * d.core_index * cc;
    const T at_core = passed(admittance(T(1.0), cw), admittance(d.core_index, cc));
    ray.flux = ray.flux * at_core * at_core;
  }
  ray.path = 2.0 * path;
  ray.turn_rad = kPi - 2.0 * psi - 2.0 * sweep;
  ray.impact = s1;
  sin_cos(ray.turn_rad + psi, ray.exit_rho, ray.exit_z);
  ray.arrives = std::abs(plain(ray.turn_rad)) < kMostTurn;
  return ray;
}

/// Place (rho, z) and wavevector (rho, z) of a ray, with derivatives beside the values.
template <class T>
struct Flight {
  static constexpr std::size_t kPlanes = 1 + static_cast<std::size_t>(ScalarTraits<T>::derivatives);
  using State = std::array<double, 4 * kPlanes>;
  const typename decltype(MeridionalDroplet<T>::field)::element_type& field;
  T extra;  ///< n_e^2 - 1

  static T get(const State& state, std::size_t i) {
    if constexpr (kPlanes == 1) {
      return state[i];
    } else {
      T x(state[i]);
      for (std::size_t k = 1; k < kPlanes; ++k) x.d[k - 1] = state[4 * k + i];
      return x;
    }
  }
  static void set(State& state, std::size_t i, const T& x) {
    state[i] = plain(x);
    if constexpr (kPlanes > 1)
      for (std::size_t k = 1; k < kPlanes; ++k) state[4 * k + i] = x.d[k - 1];
  }
  /// x' = w + extra (n.w) n, w' = -extra (n.w) grad (n.w): half of Hamilton's, so that the optical path grows by n_e^2.
  void operator()(const State& state, State& rate, double /*t*/) const {
    const T x = get(state, 0), z = get(state, 1), wx = get(state, 2), wz = get(state, 3);
    // A quarter of the meridional plane is known; n and -n are one.
    const double side = plain(x) < 0 ? -1 : 1, half = plain(z) < 0 ? -1 : 1;
    const auto bend = field.bend(std::abs(plain(x)) + 1e-12, std::abs(plain(z)) + 1e-12);
    T theta(bend.theta), by_rho(bend.by_rho), by_z(bend.by_z);
    if constexpr (kPlanes > 1) {
      for (std::size_t k = 0; k + 1 < kPlanes; ++k) {
        const double rho = side * x.d[k], height = half * z.d[k];
        theta.d[k] = bend.by_rho * rho + bend.by_z * height;
        by_rho.d[k] = bend.by_rho2 * rho + bend.by_rho_z * height;
        by_z.d[k] = bend.by_rho_z * rho + bend.by_z2 * height;
      }
      for (std::size_t k = 0; k < 2; ++k)
        theta.d[2 + k] += bend.by[k], by_rho.d[2 + k] += bend.by_rho_and[k], by_z.d[2 + k] += bend.by_z_and[k];
    }
    T s, c;
    sin_cos(theta, s, c);
    const T nx = side * s, nz = half * c, along = nx * wx + nz * wz, pull = extra * along;
    const T by_theta = pull * (half * (s * wz) - side * (c * wx));
    set(rate, 0, wx + pull * nx);
    set(rate, 1, wz + pull * nz);
    set(rate, 2, side * (by_theta * by_rho));
    set(rate, 3, half * (by_theta * by_z));
  }
};

/// Steps are as long as the ray asks; derivatives follow along.
template <class State>
struct OfTheRay {
  template <class Algebra, class Derivative, class Errors, class Time>
  double error(Algebra&, const State&, const Derivative&, Errors& errors, Time) const {
    constexpr double kTolerance = 1e-8;
    return std::max({std::abs(errors[0]), std::abs(errors[1]), std::abs(errors[2]), std::abs(errors[3])}) / kTolerance;
  }
  template <class Derivative, class Errors, class Time>
  double error(const State& before, const Derivative& rate, Errors& errors, Time step) const {
    odeint::range_algebra algebra;
    return error(algebra, before, rate, errors, step);
  }
};

/// `equator`, where given: the distance from the axis at which the ray crosses the plane z = 0.
template <class T>
MeridionalRay<T> ray_in_field(const MeridionalDroplet<T>& d, const T& psi, T* equator) {
  MeridionalRay<T> ray;
  ray.arrives = false;
  const T square = d.extraordinary * d.extraordinary;
  const Flight<T> flight{*d.field, square - 1.0};
  using State = typename Flight<T>::State;
  T s1, c1;
  sin_cos(psi, s1, c1);
  // The director is normal to the sphere: the wavevector inside has normal component sqrt(1 - (k/n_e)^2), k its
  // tangential one.
  const T in = d.host * s1 / d.extraordinary;
  if (!(plain(in) < 1)) return ray;
  const T c2 = cosine_of(in), along = d.host * s1;
  State y{}, rate;
  Flight<T>::set(y, 0, s1);
  Flight<T>::set(y, 1, -c1);
  Flight<T>::set(y, 2, along * c1 - c2 * s1);
  Flight<T>::set(y, 3, along * s1 + c2 * c1);
  const auto outward = [&] { return y[0] * rate[0] + y[1] * rate[1]; };  // half of d r^2 / d t
  const auto distance = [&] { return 0.5 * (1 - y[0] * y[0] - y[1] * y[1]); };
  constexpr double kNear = 5e-3;
  using Step = odeint::runge_kutta_dopri5<State>;
  odeint::controlled_runge_kutta<Step, OfTheRay<State>> stepper{OfTheRay<State>()};
  double t = 0, step = 0.05;
  bool out = false;
  for (int i = 0; i < 2000 && !out; ++i) {
    flight(y, rate, t);
    // Not farther than to the sphere on a straight line: beyond it the director is not known.
    const double b = outward(), speed2 = rate[0] * rate[0] + rate[1] * rate[1];
    const double most = (std::sqrt(std::max(0.0, b * b + 2 * speed2 * distance())) - b) / speed2;
    const State before = y;
    const double then = t;
    double h = std::min(step, most);
    const bool cut = h < step;
    if (stepper.try_step(flight, y, t, h) == odeint::success) {
      if (equator && before[1] < 0 && y[1] >= 0) {
        const T low = Flight<T>::get(before, 1), high = Flight<T>::get(y, 1), share = low / (low - high);
        *equator = Flight<T>::get(before, 0) + share * (Flight<T>::get(y, 0) - Flight<T>::get(before, 0));
      }
      if (!(t > then)) return ray;
      flight(y, rate, t);
      out = distance() < kNear && outward() > 0;
      if (!cut || h < step) step = h;  // proposed
    } else {
      step = h;
    }
    if (step < 1e-9 || !std::isfinite(y[0] + y[1] + y[2] + y[3])) return ray;
  }
  if (!out) return ray;
  for (int i = 0; i < 4; ++i) {
    flight(y, rate, t);
    const double h = distance() / outward();
    if (!(std::abs(h) < 0.1)) return ray;
    Step fresh;  // its slope would belong to the step before
    fresh.do_step(flight, y, t, h);
    t += h;
  }
  flight(y, rate, t);
  T x = Flight<T>::get(y, 0), z = Flight<T>::get(y, 1), wx = Flight<T>::get(y, 2), wz = Flight<T>::get(y, 3), time(t);
  // Derivatives, too, on the sphere.
  const T vx = Flight<T>::get(rate, 0), vz = Flight<T>::get(rate, 1),
          rest = (0.5 * (1.0 - x * x - z * z)) / (x * vx + z * vz);
  wx = wx + rest * Flight<T>::get(rate, 2), wz = wz + rest * Flight<T>::get(rate, 3);
  x = x + rest * vx, z = z + rest * vz, time = time + rest;
  const T leaves = wx * z - wz * x, into2 = d.host * d.host - leaves * leaves;  // along (z, -x)
  if (!(plain(into2) > 0)) return ray;
  const T into = sqrt(into2), kx = leaves * z + into * x, kz = into * z - leaves * x;
  const T inside = cosine_of(T(leaves / d.extraordinary));
  ray.exit_rho = x, ray.exit_z = z;
  ray.turn_rad = angle_of(kx, kz);
  ray.impact = -leaves / d.host;
  ray.path = square * time;
  ray.flux = passed(T(d.host / c1), T(1.0 / c2)) * passed(T(d.host * d.host / into), T(1.0 / inside));
  ray.arrives = std::abs(plain(ray.turn_rad)) < kMostTurn;
  return ray;
}

}  // namespace

template <class T>
MeridionalRay<T> meridional_ray(const MeridionalDroplet<T>& droplet, bool extraordinary, const T& psi, T* equator) {
  return extraordinary && droplet.field ? ray_in_field(droplet, psi, equator) : radial_ray(droplet, extraordinary, psi);
}
template MeridionalRay<double> meridional_ray<double>(const MeridionalDroplet<double>&, bool, const double&, double*);
template MeridionalRay<Dual<double, 4>> meridional_ray<Dual<double, 4>>(const MeridionalDroplet<Dual<double, 4>>&, bool,
                                                                        const Dual<double, 4>&, Dual<double, 4>*);

}  // namespace birefit
