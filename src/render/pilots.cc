#include "render/pilots.h"
#include "render/cone_view.h"

#include <algorithm>
#include <cmath>

#include "medium/counting_column.h"
#include "medium/families/radial.h"
#include "render/ball.h"
#include "render/droplet.h"
#include "render/planar.h"
#include "render/volume.h"

namespace birefit {
namespace {

constexpr double kPi = std::numbers::pi;

double size_of(const Mat2<double>& d) { return std::sqrt(norm(d.a) + norm(d.b) + norm(d.c) + norm(d.d)); }
double checked(double error) { return std::isfinite(error) ? error : 1e300; }

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
    const double corner =
        std::hypot(scene.view.width, scene.view.height) / std::min(scene.view.width, scene.view.height);
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
  }
  return t;
}

Pilots::Pilots(const Scene& scene, const Values<double>& value) {
  if (const auto* droplet = std::get_if<Droplet>(&scene.sample))
    looks_round(*droplet) ? add_droplet(scene, value) : add_ball(scene, value);
  else if (std::holds_alternative<SampledVolume>(scene.sample))
    add_volume(scene, value);
  else
    add_planar(scene, value);
}

double Pilots::error(const TransportMethod<double>& method, const Mesh& mesh, double enough) const {
  // The ray that was too much for the last effort mostly is for the next.
  double worst = rays_.empty() ? 0 : rays_[hardest_](method, mesh);
  for (std::size_t i = 0; i < rays_.size() && !(worst > enough); ++i)
    if (i != hardest_) {
      worst = std::max(worst, rays_[i](method, mesh));
      if (worst > enough) hardest_ = i;
    }
  return worst;
}

void Pilots::add_droplet(const Scene& scene, const Values<double>& value) {
  const DropletOptics<double> o = droplet_optics(scene, value);
  const RimTable rim(o.ratio, o.n_host, scene.microscope.objective_na);
  const Mesh fine = uniform_mesh(o.coupled() ? 1024 : 512);
  for (double f : {0.003, 0.02, 0.1, 0.25, 0.4, 0.55, 0.7, 0.85, 0.97}) {
    const DropletRay<double> ray = trace(o, rim, f * rim.rho_max() * o.radius_um);
    const Su2<double> exact = droplet_retarder<double>(o, ray, transport_method<double>("magnus4"), fine);
    rays_.push_back([=](const TransportMethod<double>& method, const Mesh& mesh) {
      return checked(intensity_distance(exact, droplet_retarder(o, ray, method, mesh)));
    });
  }
  samples_ = [=](const TransportMethod<double>& method, const Mesh& mesh) {
    const RimTable table(o.ratio, o.n_host, 0);
    const DropletRay<double> ray = trace(o, table, 0.5 * table.rho_max() * o.radius_um);
    return with_droplet_column(o, ray, [&](const auto& column) {
      const CountingColumn<double> counted(column);
      method.retarder(counted, {o.k0, 0.0, 0.0, o.continuity}, mesh);
      return static_cast<int>(counted.count());
    });
  };
}

void Pilots::add_ball(const Scene& scene, const Values<double>& value) {
  const auto o = std::make_shared<const BallOptics<double>>(ball_optics(scene, value));
  const RimTable rim(o->sphere.ratio, o->sphere.n_host, scene.microscope.objective_na);
  const Mesh fine = ball_mesh(*o, 256), finer = ball_mesh(*o, 512);
  breaks_ = std::visit([](const auto& field) { return ball_breaks(field); }, o->field);
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
          {f, azimuth, checked(intensity_distance(exact, jones(f, azimuth, transport_method<double>("magnus4"), fine))),
           exact});
    }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.unsure < b.unsure; });
  constexpr std::size_t kLeast = 16;
  for (const Candidate& c : candidates) {
    if (scene.method == "auto" && rays_.size() >= kLeast && c.unsure > 0.1 * scene.intensity_accuracy) break;
    rays_.push_back([=](const TransportMethod<double>& method, const Mesh& mesh) {
      try {
        return checked(intensity_distance(c.exact, jones(c.fraction, c.azimuth, method, mesh)));
      } catch (const std::logic_error&) {  // a method that asks for more than this column knows
        return 1e300;
      }
    });
  }
  samples_ = [=](const TransportMethod<double>& method, const Mesh& mesh) {
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
}

void Pilots::add_volume(const Scene& scene, const Values<double>& value) {
  const auto o = std::make_shared<const VolumeOptics<double>>(scene, value);
  breaks_ = o->breaks;
  const Mesh fine = uniform_mesh(8 * (o->grid->nz - 1), breaks_), finer = uniform_mesh(16 * (o->grid->nz - 1), breaks_);
  constexpr int kMost = 48;
  for (int i = 0; i < kMost && rays_.size() < 16; ++i) {
    const auto [x, y] = volume_place(*o->grid, i);
    const Su2<double> exact = volume_retarder<double>(*o, x, y, transport_method<double>("magnus4"), finer);
    // Through a defect the axis between two nodes is anybody's guess, and turns as fast as it likes: no measure of a
    // method.
    const double unsure =
        intensity_distance(exact, volume_retarder<double>(*o, x, y, transport_method<double>("magnus4"), fine));
    if (unsure > 0.1 * scene.intensity_accuracy && i < kMost - 4) continue;
    rays_.push_back([=, x = x, y = y](const TransportMethod<double>& method, const Mesh& mesh) {
      try {
        return checked(intensity_distance(exact, volume_retarder(*o, x, y, method, mesh)));
      } catch (const std::logic_error&) {  // a method that asks for more than this column knows
        return 1e300;
      }
    });
  }
  samples_ = [=](const TransportMethod<double>& method, const Mesh& mesh) { return volume_samples(*o, method, mesh); };
}

void Pilots::add_planar(const Scene& scene, const Values<double>& value) {
  // Not one node set comes twice here: remembering them would only cost the search.
  const auto fresh = [&] {
    auto optics = std::make_shared<PlanarOptics<double>>(planar_optics(scene, value));
    optics->column->freeze();
    return optics;
  };
  const std::shared_ptr<const PlanarOptics<double>> o = fresh();
  breaks_ = o->column->breaks;
  const bool slab = std::holds_alternative<Slab>(scene.sample) && !cone_half_angle(scene);
  const auto add = [&](std::shared_ptr<const PlanarOptics<double>> optics, double tx, double ty) {
    const double c = 1 / std::sqrt(1 + tx * tx + ty * ty);
    const Ray<double> ray{optics->k0, optics->n_host * c * tx, optics->n_host * c * ty, optics->continuity};
    const Mesh mesh = adapted_mesh(*optics->column, ray, std::max(scene.intensity_accuracy / 40, 1e-13));
    const Mat2<double> exact = planar_jones<double>(*optics, transport_method<double>("magnus4"), mesh, tx, ty);
    rays_.push_back([=](const TransportMethod<double>& method, const Mesh& m) {
      try {
        const Mat2<double> jones = planar_jones<double>(*optics, method, m, tx, ty);
        return checked(slab ? std::sqrt(2.0) * size_of(jones - exact) : intensity_distance(exact, jones));
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
  samples_ = [o](const TransportMethod<double>& method, const Mesh& mesh) {
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
}

Effort cheapest_effort(const Pilots& pilots, double target, const std::string& only, bool even_steps,
                       const std::string& but) {
  std::vector<int> ladder;
  for (int n = even_steps ? 2 : 1; n <= 8192; n += std::max(even_steps ? 2 : 1, n / 16 * 2)) ladder.push_back(n);
  // Breaks make several numbers of steps the same mesh, which would confirm itself.
  if (even_steps)
    ladder.erase(std::unique(ladder.begin(), ladder.end(),
                             [&](int a, int b) { return pilots.mesh(a).size() == pilots.mesh(b).size(); }),
                 ladder.end());
  std::vector<Effort> efforts;
  for (const TransportMethod<double>* method : transport_methods<double>()) {
    if (method->info().reflections || but == method->info().name || (!only.empty() && only != method->info().name))
      continue;
    // Samples grow by the same number with every step.
    const int at_8 = pilots.samples(*method, uniform_mesh(8)), at_16 = pilots.samples(*method, uniform_mesh(16));
    for (int n : ladder) {
      const int steps = static_cast<int>(pilots.mesh(n).size()) - 1;
      efforts.push_back({method, n, at_8 + (at_16 - at_8) * (steps - 8) / 8, 1e300});
    }
  }
  std::stable_sort(efforts.begin(), efforts.end(),
                   [](const Effort& a, const Effort& b) { return a.samples < b.samples; });
  Effort best;
  for (Effort& effort : efforts) {
    effort.error = pilots.error(*effort.method, pilots.mesh(effort.steps), target);
    if (effort.error <= target) {
      const auto finer = std::find_if(ladder.begin(), ladder.end(), [&](int n) { return n > effort.steps; });
      if (finer == ladder.end() || pilots.error(*effort.method, pilots.mesh(*finer), target) <= target) return effort;
    }
    if (effort.error < best.error) best = effort;
  }
  if (!best.method) return efforts.empty() ? best : efforts.back();  // none of them has an answer
  // Errors were cut short at the first ray beyond the target.
  best.error = pilots.error(*best.method, pilots.mesh(best.steps));
  return best;
}

}  // namespace birefit
