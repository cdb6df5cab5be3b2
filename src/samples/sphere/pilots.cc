// The rays on which methods are judged for droplets and shells.

#include <algorithm>
#include <cmath>

#include "medium/counting_column.h"
#include "samples/sphere/ball.h"
#include "samples/sphere/droplet.h"
#include "samples/sphere/plan.h"

namespace birefit {

namespace {

Pilots droplet_pilots(const Scene& scene, const Demand& demand, const Values<double>& value) {
  Pilots pilots;
  const DropletOptics<double> o = droplet_optics(scene, value, continuity_of(demand));
  const RimTable rim = rim_table(o);
  const Mesh fine = uniform_mesh(o.coupled() ? 1024 : 512);
  for (double f : {0.003, 0.02, 0.1, 0.25, 0.4, 0.55, 0.7, 0.85, 0.97}) {
    const DropletRay<double> ray = trace(o, rim, f * rim.rho_max() * o.radius_um);
    const Su2<double> exact = droplet_retarder<double>(o, ray, transport_method<double>("magnus4"), fine);
    pilots.rays.push_back([=](const TransportMethod<double>& method, const Mesh& mesh) {
      return or_huge(intensity_distance(exact, droplet_retarder(o, ray, method, mesh)));
    });
  }
  pilots.samples_of = [=](const TransportMethod<double>& method, const Mesh& mesh) {
    const RimTable table(o.ratio, o.n_host, 0);
    const DropletRay<double> ray = trace(o, table, 0.5 * table.rho_max() * o.radius_um);
    return with_droplet_column(o, ray, [&](const auto& column) {
      const CountingColumn<double> counted(column);
      method.retarder(counted, {o.k0, 0.0, 0.0, o.continuity}, mesh);
      return static_cast<int>(counted.count());
    });
  };
  return pilots;
}

Pilots ball_pilots(const Scene& scene, const Demand& demand, const Values<double>& value) {
  Pilots pilots;
  const auto o = std::make_shared<const BallOptics<double>>(ball_optics(scene, value, continuity_of(demand)));
  const RimTable rim = rim_table(o->sphere);
  const Mesh fine = ball_mesh(*o, 256), finer = ball_mesh(*o, 512);
  pilots.breaks = std::visit([](const auto& field) { return ball_breaks(field); }, o->field);
  const auto jones = [=](double fraction, double azimuth, const TransportMethod<double>& method, const Mesh& mesh) {
    const DropletRay<double> ray = trace(o->sphere, rim, fraction * rim.rho_max() * o->sphere.radius_um);
    return ball_jones<double>(*o, ray, std::cos(azimuth), std::sin(azimuth), method, mesh);
  };
  // A ray that grazes a defect takes more steps than all others, of any method: it is for the steps by place (ball.cc),
  // no measure of a method.
  struct Candidate {
    double fraction, azimuth, unsure;
    Mat2<double> exact;
  };
  std::vector<Candidate> candidates;
  for (double f : {0.02, 0.15, 0.3, 0.45, 0.6, 0.75, 0.88, 0.97})
    for (int k = 0; k < 3; ++k) {
      const double azimuth = 2.399963 * static_cast<double>(candidates.size());  // the golden angle: no two alike
      const Mat2<double> exact = jones(f, azimuth, transport_method<double>("magnus4"), finer);
      candidates.push_back(
          {f, azimuth, or_huge(intensity_distance(exact, jones(f, azimuth, transport_method<double>("magnus4"), fine))),
           exact});
    }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.unsure < b.unsure; });
  constexpr std::size_t kLeast = 16;
  for (const Candidate& c : candidates) {
    if (demand.method == "auto" && pilots.rays.size() >= kLeast && c.unsure > 0.1 * demand.intensity_accuracy) break;
    pilots.rays.push_back([=](const TransportMethod<double>& method, const Mesh& mesh) {
      try {
        return or_huge(intensity_distance(c.exact, jones(c.fraction, c.azimuth, method, mesh)));
      } catch (const std::logic_error&) {  // a method that asks for more than this column knows
        return 1e300;
      }
    });
  }
  pilots.samples_of = [=](const TransportMethod<double>& method, const Mesh& mesh) {
    try {
      const DropletRay<double> ray = trace(o->sphere, rim, 0.5 * rim.rho_max() * o->sphere.radius_um);
      return with_ball_column(*o, ray, 0.8, 0.6, [&](const auto& column) {
        const CountingColumn<double> counted(column);
        method.retarder(counted, {o->sphere.k0, 0.0, 0.0, o->sphere.continuity}, mesh);
        return static_cast<int>(counted.count());
      });
    } catch (const std::logic_error&) {
      return 1000000;
    }
  };
  return pilots;
}

}  // namespace

Pilots sphere_pilots(const Scene& scene, const Demand& demand, const Values<double>& value) {
  return looks_round(std::get<Droplet>(scene.sample)) ? droplet_pilots(scene, demand, value)
                                                      : ball_pilots(scene, demand, value);
}

}  // namespace birefit
