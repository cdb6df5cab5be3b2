#include "instrument/exposure.h"

#include <algorithm>

#include "core/quadrature.h"

namespace birefit {

Exposure exposure_of(const Microscope& microscope) {
  const Direction direction = microscope.directions.empty() ? Direction{} : microscope.directions.front();
  return {{BeamMaker(microscope, direction)}, {1.0}};
}

DiscRule::DiscRule(int rings) {
  std::vector<double> x, w;
  legendre_nodes(rings, x, w);
  const int around = std::max(5, 2 * rings + 1);
  for (int i = 0; i < rings; ++i)
    for (int j = 0; j < around; ++j) {
      // Every other ring half a step further, lest directions of all of them lie on the same lines.
      const double azimuth = 2 * std::numbers::pi * (j + 0.5 * (i % 2)) / around;
      nodes.push_back({0.5 * (1 + x[static_cast<std::size_t>(i)]), std::cos(azimuth), std::sin(azimuth),
                       0.5 * w[static_cast<std::size_t>(i)] / around});
    }
}

Exposure condenser_exposure(const Microscope& microscope, const Values<double>& value, int rings, bool waves) {
  const CondenserDisc<double> disc = condenser_disc(microscope, value, waves);
  Exposure exposure;
  for (const DiscRule::Node& node : DiscRule(rings).nodes) {
    exposure.directions.emplace_back(microscope, Direction{}, DiscRule::kappa(node, disc));
    exposure.weights.push_back(node.weight);
  }
  return exposure;
}

MovesCondenser moves_condenser(const Microscope& microscope, int index, bool waves) {
  if (!microscope.condenser) return MovesCondenser::no;
  const Condenser& c = *microscope.condenser;
  const auto is = [&](const ParameterRef& ref) { return ref && ref.index == index; };
  if (is(c.na) || is(c.inner_na) || is(c.tilt_deg) || is(c.tilt_azimuth_deg)) return MovesCondenser::alone;
  const bool beside = is(waves ? microscope.wavelength_nm : microscope.objective_na);
  return beside ? MovesCondenser::partly : MovesCondenser::no;
}

CondenserSlope condenser_slope(const Microscope& microscope, const Theta& theta, int rings, int index, bool waves) {
  const Values<Dual<double, 1>> value(theta, {index}, nullptr);
  const CondenserDisc<Dual<double, 1>> disc = condenser_disc(microscope, value, waves);
  double radius_by = disc.radius.d[0], inner_by = disc.inner_radius.d[0],
         middle_by[2] = {disc.middle[0].d[0], disc.middle[1].d[0]};
  if (waves && microscope.wavelength_nm.index == index) {
    const double by = -1 / microscope.wavelength_nm.in(theta);  // all wavevectors shrink together
    radius_by += by * disc.radius.value, inner_by += by * disc.inner_radius.value;
    for (std::size_t a = 0; a < 2; ++a) middle_by[a] += by * disc.middle[a].value;
  }
  const double outer = disc.radius.value, inner = disc.inner_radius.value,
               over = 2 / std::max(outer * outer - inner * inner, 1e-12);
  CondenserSlope slope;
  slope.of_mean = over * (inner * inner_by - outer * radius_by);
  const int around = std::max(8, 4 * rings);
  const auto add_circle = [&](double r, double radius_by_index, double sign) {
    if (r <= 0) return;
    for (int j = 0; j < around; ++j) {
      const double azimuth = 2 * std::numbers::pi * (j + 0.5) / around, c = std::cos(azimuth), s = std::sin(azimuth),
                   outwards = radius_by_index + middle_by[0] * c + middle_by[1] * s;
      slope.on_circles.directions.emplace_back(
          microscope, Direction{}, std::array<double, 2>{disc.middle[0].value + r * c, disc.middle[1].value + r * s});
      slope.on_circles.weights.push_back(sign * over * r * outwards / around);
    }
  };
  add_circle(outer, radius_by, 1);
  add_circle(inner, inner_by, -1);
  return slope;
}

}  // namespace birefit
