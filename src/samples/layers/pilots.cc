// The directions and rays on which methods are judged for cells, plates and slabs.

#include <algorithm>
#include <cmath>

#include "instrument/exposure.h"
#include "medium/counting_column.h"
#include "samples/layers/cone_view.h"
#include "samples/layers/plan.h"
#include "samples/layers/planar.h"

namespace birefit {

namespace {

constexpr double kPi = std::numbers::pi;

double size_of(const Mat2<double>& d) { return std::sqrt(norm(d.a) + norm(d.b) + norm(d.c) + norm(d.d)); }

}  // namespace

std::vector<std::pair<double, double>> pilot_directions(const Scene& scene, const Values<double>& value,
                                                        std::size_t most) {
  std::vector<std::pair<double, double>> t;
  if (const std::optional<ParameterRef> half_angle = cone_half_angle(scene); half_angle && scene.view.camera) {
    // Seen from the side no circle is like another: places of the picture, out to its corners.
    const ConeView<double> cone(scene, value);
    const double w = scene.view.width, h = scene.view.height;
    const auto add = [&](double x, double y) {
      const auto d = cone.at(0.5 * (w - 1) + 0.5 * w * x, 0.5 * (h - 1) - 0.5 * h * y);
      t.push_back({d.x, d.y});
    };
    t.push_back({0.0, 0.0});
    for (int i = 0; i < 6; ++i) add(0.5 * std::cos(i * kPi / 3 + 0.2), 0.5 * std::sin(i * kPi / 3 + 0.2));
    for (const auto& [x, y] : {std::pair{-1, -1}, {1, -1}, {-1, 1}, {1, 1}, {0, 1}, {1, 0}}) add(x, y);
  } else if (half_angle) {
    const double edge = std::tan(value.radians(*half_angle, 15));
    // Pixels beyond the inscribed circle, up to the corners of the image.
    const double corner = std::hypot(scene.view.whole_width(), scene.view.whole_height()) /
                          std::min(scene.view.whole_width(), scene.view.whole_height());
    t.push_back({0.0, 0.0});
    for (int i = 0; i < 6; ++i)
      for (double f : {0.5, corner})
        t.push_back({f * edge * std::cos(i * kPi / 3 + 0.2), f * edge * std::sin(i * kPi / 3 + 0.2)});
  } else if (!scene.microscope.directions.empty()) {
    for (const Direction& d : scene.microscope.directions) {
      const double f = std::tan(d.theta_deg * kPi / 180), a = d.azimuth_deg * kPi / 180;
      t.push_back({f * std::cos(a), f * std::sin(a)});
    }
    if (t.size() > most) {
      std::stable_sort(t.begin(), t.end(), [](const auto& a, const auto& b) {
        return std::hypot(a.first, a.second) < std::hypot(b.first, b.second);
      });
      for (std::size_t i = 0; i < most; ++i) t[i] = t[i * (t.size() - 1) / (most - 1)];  // never behind i
      t.resize(most);
    }
  } else {
    t.push_back({0.0, 0.0});
    if (scene.microscope.condenser) {
      // The steepest light of the condenser, on no line with another; what the medium around does not have is refused
      // elsewhere (render/direction_plan.cc).
      const CondenserDisc<double> disc = condenser_disc(scene.microscope, value, false);
      const double host = host_index(scene, value);
      for (int i = 0; i < 5; ++i) {
        const double a = 2 * kPi * (i + 0.3) / 5, x = disc.middle[0] + disc.radius * std::cos(a),
                     y = disc.middle[1] + disc.radius * std::sin(a), square = x * x + y * y;
        if (square >= host * host) continue;
        const double over = 1 / std::sqrt(host * host - square);
        t.push_back({x * over, y * over});
      }
    }
  }
  return t;
}

Pilots planar_pilots(const Scene& scene, const Demand& demand, const Values<double>& value) {
  Pilots pilots;
  // Not one node set comes twice here: remembering them would only cost the search.
  const auto fresh = [&] {
    auto optics = std::make_shared<PlanarOptics<double>>(planar_optics(scene, value, continuity_of(demand)));
    optics->column->freeze();
    return optics;
  };
  const std::shared_ptr<const PlanarOptics<double>> o = fresh();
  pilots.breaks = o->column->breaks;
  const bool slab = std::holds_alternative<Slab>(scene.sample) && !cone_half_angle(scene);
  const auto add = [&](std::shared_ptr<const PlanarOptics<double>> optics, double tx, double ty) {
    const double c = 1 / std::sqrt(1 + tx * tx + ty * ty);
    const Ray<double> ray{optics->k0, optics->n_host * c * tx, optics->n_host * c * ty, optics->continuity};
    const Mesh mesh = adapted_mesh(*optics->column, ray, std::max(demand.intensity_accuracy / 40, 1e-13));
    const Mat2<double> exact = planar_jones<double>(*optics, transport_method<double>("magnus4"), mesh, tx, ty);
    pilots.rays.push_back([=](const TransportMethod<double>& method, const Mesh& m) {
      try {
        const Mat2<double> jones = planar_jones<double>(*optics, method, m, tx, ty);
        return or_huge(slab ? std::sqrt(2.0) * size_of(jones - exact) : intensity_distance(exact, jones));
      } catch (const std::logic_error&) {  // steps too long for the method, or a medium it cannot do
        return 1e300;
      }
    });
  };
  const auto directions = pilot_directions(scene, value);
  for (const auto& [tx, ty] : directions) add(o, tx, ty);
  if (!o->column->planar && directions.size() < 4) {
    // Modes that couple may come out right at one retardance by chance: look a quarter of a fringe further, too.
    const double ends[3] = {0.0, 0.5, 1.0};
    OpticalPoint<double> p[3];
    o->column->sample(ends, p);
    double phase = 0;
    for (const auto& q : p)
      phase = std::max(phase, o->k0 * q.depth_slope_um * std::abs(std::sqrt(q.extraordinary) - std::sqrt(q.ordinary)));
    const auto shifted = fresh();
    shifted->k0 = o->k0 * (1 + std::min(0.25, 0.5 * kPi / phase));
    for (const auto& [tx, ty] : directions) add(shifted, tx, ty);
  }
  pilots.samples_of = [o](const TransportMethod<double>& method, const Mesh& mesh) {
    // Any medium will do, at a thickness that no method minds.
    struct Thin final : Column<double> {
      void sample(std::span<const double> u, OpticalPoint<double>* out) const override {
        for (std::size_t i = 0; i < u.size(); ++i) out[i] = {{0.8, 0.0, 0.6}, 2.25, 2.5, 0.0, 0.0, 1e-3};
      }
      void sample_with_slope(std::span<const double> u, OpticalPoint<Slope<double>>* out) const override {
        for (std::size_t i = 0; i < u.size(); ++i) out[i] = {{0.8, 0.0, 0.6}, 2.25, 2.5, 0.0, 0.0, 1e-3};
      }
    } thin;
    thin.absorbing = o->column->absorbing;
    thin.planar = o->column->planar;
    const CountingColumn<double> counted(thin);
    method.transfer(counted, {o->k0, 0.1, 0.0, o->continuity}, mesh);
    return static_cast<int>(counted.count());
  };
  return pilots;
}

}  // namespace birefit
