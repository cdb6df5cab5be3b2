#include "render/eikonal.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "medium/families/axial_angle.h"

namespace birefit {
namespace {

/// The angle of incidence whose ray is seen at rho / R: bisection, one lane after the other; what is left of the error is one
/// Newton step's. Negative where no ray of this mode arrives.
double eikonal_incidence(double rho, double n_host, double n_mode, double sweep) {
  const auto seen = [&](double psi, double& turn) {
    turn = std::numbers::pi - 2 * psi - (std::numbers::pi - 2 * std::asin(std::min(1.0, n_host / n_mode * std::sin(psi)))) * sweep;
    return std::sin(psi) / std::cos(turn);
  };
  double low = 0, high = std::min(std::numbers::pi / 2, n_host > n_mode ? std::asin(n_mode / n_host) : 4.0) - 1e-7, turn;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    const double here = seen(middle, turn);
    // Rays turned by 80 degrees and more never reach an objective.
    (std::abs(turn) < 1.4 && here < rho ? low : high) = middle;
  }
  const double found = seen(low, turn);
  return std::abs(found - rho) < 1e-6 && std::abs(turn) < 1.4 ? low : -1;
}

}  // namespace

template <class S>
EikonalRay<S> eikonal_ray(const DropletOptics<S>& o, bool extraordinary, const S& rho_um, double objective_na) {
  using P = PlainOf<S>;
  const S n_mode = extraordinary ? o.n_e : o.n_o, sweep = extraordinary ? o.n_o * inverse(o.n_e) : S(1.0);
  P start(0.0);
  {
    const P rho = plain(rho_um) * inverse(plain(o.radius_um));
    alignas(64) double place[kLanes];
    for (int i = 0; i < kLanesOf<S>; ++i)
      place[i] = eikonal_incidence(lane(rho, i), lane(plain(o.n_host), 0), lane(plain(n_mode), 0), lane(plain(sweep), 0));
    if constexpr (std::is_same_v<P, double>)
      start = place[0];
    else
      start = P::load_aligned(place);
  }
  const auto arrives = start >= P(0.0);
  start = select(arrives, start, P(0.1));  // any ray will do where none arrives
  const S ratio = o.n_host * inverse(n_mode);
  S s1, c1, c2, turn, cos_turn, sin_turn, slope;
  const auto geometry = [&](const S& psi) {
    sin_cos(psi, s1, c1);
    const S s2 = ratio * s1;
    c2 = root(max_of(1.0 - s2 * s2, S(1e-14)));
    turn = std::numbers::pi - 2.0 * psi - (std::numbers::pi - 2.0 * angle_of(s2, c2)) * sweep;
    sin_cos(turn, sin_turn, cos_turn);
    slope = o.radius_um * inverse(cos_turn) * (c1 + s1 * sin_turn * inverse(cos_turn) * (2.0 * sweep * ratio * c1 * inverse(c2) - 2.0));
    return o.radius_um * s1 * inverse(cos_turn);
  };
  // Value and derivatives by one Newton step each: d psi = (d rho wanted - d rho(psi; parameters)) / slope.
  S psi(start);
  for (int i = 0; i < 2; ++i) {
    const S here = geometry(S(plain(psi)));  // sets the slope
    const S change = (rho_um - here) * inverse(S(plain(slope)));
    psi = S(plain(psi)) + select(arrives, change, S(0.0));
  }
  geometry(psi);
  EikonalRay<S> ray;
  ray.cos_turn = cos_turn;
  // Flux transmission of both surfaces, as in droplet_jones: Y1, Y2 of the mode.
  const S s_in = extraordinary ? o.n_host * inverse(c1) : o.n_host * c1;
  const S s_out = extraordinary ? o.n_o * inverse(c2) : o.n_o * c2;
  const S over = inverse(s_in + s_out), transmission = 4.0 * s_in * s_out * over * over;
  const S tube = o.radius_um * c1 * cos_turn * inverse(slope);
  S amplitude = transmission * root(max_of(tube, S(1e-300)));
  if (objective_na > 0) {
    const P leaving = plain(o.n_host * sin_turn);
    amplitude = select(leaving * leaving <= P(objective_na * objective_na), amplitude, S(0.0));
  }
  ray.amplitude = select(arrives, amplitude, S(0.0));
  // Optical path inside, and in the host from the wave front through the centre and back to the mid plane.
  ray.phase_rad = o.k0 * o.radius_um * (2.0 * o.n_o * c2 - o.n_host * (2.0 * c1 - s1 * sin_turn * inverse(cos_turn)));
  return ray;
}

#define BIREFIT_INSTANTIATE(S) template EikonalRay<S> eikonal_ray<S>(const DropletOptics<S>&, bool, const S&, double);
BIREFIT_FOR_EACH_SCALAR(BIREFIT_INSTANTIATE)

}  // namespace birefit
