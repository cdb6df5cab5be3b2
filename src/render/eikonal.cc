#include "render/eikonal.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "medium/families/axial_angle.h"

namespace birefit {
EikonalFan::EikonalFan(double n_host, double n_mode, double sweep, bool extraordinary) : extraordinary_(extraordinary) {
  const double ratio = n_host / n_mode;
  const auto seen = [&](double psi, double& turn) {
    turn = std::numbers::pi - 2 * psi - (std::numbers::pi - 2 * std::asin(std::min(1.0, ratio * std::sin(psi)))) * sweep;
    return std::sin(psi) / std::cos(turn);
  };
  // Rays turned by 80 degrees and more never reach an objective.
  const auto arrives = [&](double psi) {
    double turn;
    seen(psi, turn);
    return std::abs(turn) < 1.4;
  };
  double low = 0, high = std::min(std::numbers::pi / 2, ratio > 1 ? std::asin(1 / ratio) : 4.0) - 1e-7, turn;
  if (arrives(high)) low = high;
  for (int i = 0; i < 60 && low < high; ++i) {
    const double middle = 0.5 * (low + high);
    (arrives(middle) ? low : high) = middle;
  }
  table_.psi[0] = low;
  table_.rho_max = seen(low, turn);
  for (int i = 1; i < IncidenceTable::kNodes; ++i) {
    const double t = static_cast<double>(i) / IncidenceTable::kNodes, target = table_.rho_max * (1 - t * t);
    // Newton from where the last two nodes point to, halving where it leaves the bracket: rho grows with psi, but without bound of
    // its slope at an end.
    double below = 0, above = table_.psi[static_cast<std::size_t>(i - 1)];
    double psi = i == 1 ? above : std::max(2 * above - table_.psi[static_cast<std::size_t>(i - 2)], 0.5 * above);
    for (int k = 0; k < 40; ++k) {
      const double rho = seen(psi, turn);
      (rho < target ? below : above) = psi;
      const double s = std::sin(psi), c = std::cos(psi), secant = 1 / std::cos(turn);
      const double slope = secant * (c + s * std::tan(turn) * (2 * sweep * ratio * c / std::sqrt(std::max(1e-14, 1 - ratio * ratio * s * s)) - 2));
      double next = psi - (rho - target) / slope;
      if (!(next > below && next < above)) next = 0.5 * (below + above);
      const double change = std::abs(next - psi);
      psi = next;
      if (change < 1e-10) break;
    }
    table_.psi[static_cast<std::size_t>(i)] = psi;
  }
}

template <class S>
EikonalRay<S> eikonal_ray(const DropletOptics<S>& o, const EikonalFan& fan, const S& rho_um, double objective_na) {
  using P = PlainOf<S>;
  const bool extraordinary = fan.extraordinary();
  const S n_mode = extraordinary ? o.n_e : o.n_o, sweep = extraordinary ? o.n_o * inverse(o.n_e) : S(1.0);
  const P place = plain(rho_um) * inverse(plain(o.radius_um)), limit(fan.psi_max());
  const auto arrives = place <= P(fan.rho_max());
  P start = fan.incidence(min_of(place, P(fan.rho_max())));
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
  // From the table's 5e-5 rad to rounding; no step leaves the rays that arrive.
  for (int i = 0; i < 2; ++i) {
    const P here = plain(geometry(S(start)));
    start = min_of(max_of(start + (plain(rho_um) - here) * inverse(plain(slope)), P(0.0)), limit);
  }
  start = select(arrives, start, P(0.1));  // any ray will do where none arrives
  // Derivatives by one step more: d psi = (d rho wanted - d rho(psi; parameters)) / slope.
  const S here = geometry(S(start));
  const S change = (rho_um - here) * inverse(S(plain(slope)));
  const S psi = S(start) + select(arrives, change, S(0.0));
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

#define BIREFIT_INSTANTIATE(S) template EikonalRay<S> eikonal_ray<S>(const DropletOptics<S>&, const EikonalFan&, const S&, double);
BIREFIT_FOR_EACH_SCALAR_OF_TABLES(BIREFIT_INSTANTIATE)

}  // namespace birefit
