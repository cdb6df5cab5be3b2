#include "rays/sphere_ray.h"

#include <algorithm>
#include <cmath>

#include "medium/indices.h"
#include "transport/method.h"

namespace birefit {

bool looks_round(const Droplet& droplet) {
  if (std::holds_alternative<BipolarDirector>(droplet.director)) return false;
  if (const auto* axial = std::get_if<AxialDirector>(&droplet.director)) return !axial->field_azimuth_deg;
  if (const auto* shell = std::get_if<ShellDirector>(&droplet.director)) return !shell->offset_um[0];
  return true;
}

// The geometry depends only on m = n_host / n_o: with psi the angle of incidence on the sphere, sin psi' = m sin psi,
// delta = psi - psi', the ray leaves turned by 2 delta towards the axis and its backward extension meets the mid plane
// at rho = R sin psi / cos 2 delta.
RimTable::RimTable(double index_ratio, double host_index, double objective_na)
    : ratio_(index_ratio), objective_na_(objective_na) {
  const auto accepted = [&](double psi) {
    const double sin_in = ratio_ * std::sin(psi);
    if (sin_in >= 1) return false;
    const double twice = 2 * (psi - std::asin(sin_in));
    // Rays turned by 80 degrees and more never reach an objective.
    return std::cos(twice) > 0.17 && (objective_na <= 0 || std::abs(host_index * std::sin(twice)) <= objective_na);
  };
  // The accepted interval starts at the axis and ends once: bisect its end.
  double inside = 0, outside = std::numbers::pi / 2;
  constexpr double kGrazing = 1e-7;  // keeps cos psi > 0 where transmission vanishes
  if (accepted(outside - kGrazing)) {
    inside = outside - kGrazing;
  } else {
    for (int i = 0; i < 60; ++i) {
      const double middle = 0.5 * (inside + outside);
      (accepted(middle) ? inside : outside) = middle;
    }
  }
  psi_max_ = inside;
  table_.rho_max = rho_over_radius(psi_max_);
  const double sin_in = ratio_ * std::sin(psi_max_);
  end_ = inside == std::numbers::pi / 2 - kGrazing ? End::grazing
         : sin_in > 1 - 1e-9                       ? End::total_reflection
                                                   : End::turned;
  // psi against t = sqrt(1 - rho / rho_max): smooth through the rim, where rho(psi) has its square-root end.
  // Newton from the neighbour before; rho(psi) is monotone, and what little error is left is Newton's again in trace().
  constexpr int kNodes = IncidenceTable::kNodes;
  std::array<double, kNodes + 1>& table = table_.psi;
  table[0] = psi_max_;
  double psi = psi_max_;
  for (int i = 1; i < kNodes; ++i) {
    const double t = static_cast<double>(i) / kNodes;
    const double target = table_.rho_max * (1 - t * t);
    psi = std::max(psi - (i == 1 ? psi_max_ * 0.5 / kNodes : table[static_cast<std::size_t>(i - 2)] - psi), 0.5 * psi);
    for (int k = 0; k < 6; ++k) {
      const double s1 = std::sin(psi), c1 = std::cos(psi), s2 = ratio_ * s1,
                   c2 = std::sqrt(std::max(1e-14, 1 - s2 * s2));
      const double sd = s1 * c2 - c1 * s2, cd = c1 * c2 + s1 * s2, c = 1 - 2 * sd * sd;
      const double slope = c1 / c + 4 * s1 * sd * cd * (1 - ratio_ * c1 / c2) / (c * c);
      const double change = (s1 / c - target) / slope;
      psi = std::clamp(psi - change, 0.5 * psi, table[static_cast<std::size_t>(i - 1)]);
      if (std::abs(change) < 1e-9) break;
    }
    table[static_cast<std::size_t>(i)] = psi;
  }
  table[kNodes] = 0;
}

double RimTable::rho_over_radius(double psi) const {
  const double delta = psi - std::asin(std::min(1.0, ratio_ * std::sin(psi)));
  return std::sin(psi) / std::cos(2 * delta);
}

template <class P>
P IncidenceTable::at(const P& rho_over_radius) const {
  using std::floor;
  const P t = root(max_of(P(1.0) - rho_over_radius * P(1 / rho_max), P(1e-300))) * P(static_cast<double>(kNodes));
  const P cell = min_of(floor(t), P(kNodes - 1.0)), f = t - cell;
  if constexpr (std::is_same_v<P, double>) {
    const std::size_t k = static_cast<std::size_t>(cell);
    return psi[k] + f * (psi[k + 1] - psi[k]);
  } else {
    alignas(64) double cells[kLanes], low[kLanes], high[kLanes];
    cell.store_aligned(cells);
    for (int i = 0; i < kLanes; ++i) {
      const std::size_t k = static_cast<std::size_t>(cells[i]);
      low[i] = psi[k];
      high[i] = psi[k + 1];
    }
    const P from = P::load_aligned(low);
    return from + f * (P::load_aligned(high) - from);
  }
}
template double IncidenceTable::at<double>(const double&) const;
template Pack IncidenceTable::at<Pack>(const Pack&) const;

template <class S>
DropletOptics<S> droplet_optics(const Scene& scene, const Values<S>& value, Continuity continuity) {
  const Droplet& droplet = std::get<Droplet>(scene.sample);
  const Indices<S> n = material_indices<S>(scene.material, value, wavelength_um(scene, value));
  DropletOptics<S> o;
  o.radius_um = 0.5 * value(droplet.diameter_um);
  o.n_o = n.ordinary;
  o.n_e = n.extraordinary;
  o.n_host = host_index(scene, value);
  o.ratio = o.n_host / o.n_o;
  o.k0 = wavenumber_per_um(scene, value);
  o.objective_na = value.get(scene.microscope.objective_na, 0.0);
  using Director = typename DropletOptics<S>::Director;
  if (const auto* radial = std::get_if<RadialDirector>(&droplet.director)) {
    if (radial->twist_deg) o.director = Director::twisted, o.twist_rad = value.radians(radial->twist_deg);
  } else if (const auto* shell = std::get_if<ShellDirector>(&droplet.director)) {
    o.director = Director::shell;
    o.core_um = o.radius_um - value(shell->wall_um);
    o.core_index = shell->core_index ? value(shell->core_index) : o.n_host;
  } else if (std::holds_alternative<AxialDirector>(droplet.director)) {
    const AxialDirector& axial = std::get<AxialDirector>(droplet.director);
    o.director = Director::axial;
    const S e = axial.reduced_field ? value(axial.reduced_field)
                                    : o.radius_um * value(axial.local_field_factor) * value(axial.field_v_per_um) /
                                          value(axial.coherence_voltage_v);
    o.axial = std::make_shared<const AxialField<S>>(e, value.get(axial.ring_radius, 0.0),
                                                    static_cast<bool>(axial.ring_radius), value.memo());
  }
  o.continuity = continuity;
  return o;
}

#define BIREFIT_INSTANTIATE(S) template DropletOptics<S> droplet_optics<S>(const Scene&, const Values<S>&, Continuity);
BIREFIT_FOR_EACH_SCALAR_OF_TABLES(BIREFIT_INSTANTIATE)

}  // namespace birefit
