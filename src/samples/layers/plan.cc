#include "samples/layers/plan.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include <fmt/format.h>

#include "birefit/error.h"
#include "core/threads.h"
#include "medium/validity.h"
#include "samples/choices.h"
#include "samples/kind.h"
#include "samples/layers/cone_view.h"
#include "samples/layers/planar.h"
#include "samples/pixels/sampling.h"
#include "samples/tables/fringe_table.h"
#include "transport/intensity_distance.h"
#include "transport/methods.h"

namespace birefit {

namespace {

constexpr double kPi = std::numbers::pi;

/// Smallest entry of `candidates` whose worst pilot error is within `target`; fills error. Falls back to the last.
int choose(const std::vector<int>& candidates, double target, const std::function<double(int)>& error_of,
           double& error) {
  for (int n : candidates) {
    error = error_of(n);
    if (error <= target) return n;
  }
  return candidates.back();
}
const std::vector<int> kSteps{1,  2,  3,  4,  5,  6,  8,   10,  12,  14,  16,  18,   20,   22,   24,  28,
                              32, 40, 48, 64, 80, 96, 128, 192, 256, 384, 512, 1024, 2048, 4096, 8192};

Ray<double> ray_at(const PlanarOptics<double>& o, double tx, double ty) {
  const double c = 1 / std::sqrt(1 + tx * tx + ty * ty);
  return {o.k0, o.n_host * c * tx, o.n_host * c * ty, o.continuity};
}

/// Phase difference of the two modes (rad), a sum over midpoints.
double planar_phase(const PlanarOptics<double>& o, double tx, double ty, int nodes = 64) {
  const Ray<double> ray = ray_at(o, tx, ty);
  std::vector<double> u(static_cast<std::size_t>(nodes));
  for (int i = 0; i < nodes; ++i) u[static_cast<std::size_t>(i)] = (i + 0.5) / nodes;
  std::vector<OpticalPoint<double>> p(u.size());
  o.column->sample(u, p.data());
  double sum = 0;
  for (const auto& point : p) {
    const double eo = point.ordinary, de = point.extraordinary - eo;
    const double ak = point.axis.x * ray.kx + point.axis.y * ray.ky, kk = ray.kx * ray.kx + ray.ky * ray.ky;
    const double a = eo + de * square(point.axis.z), b = de * point.axis.z * ak,
                 c = eo * kk + de * ak * ak - eo * point.extraordinary;
    const double root = b * b - a * c;
    if (eo <= kk || root <= 0) return 0;
    sum += ((std::sqrt(root) - b) / a - std::sqrt(eo - kk)) * point.depth_slope_um / nodes;
  }
  return o.k0 * sum;
}

/// Closed-form pixel means (samples/fringe.h) wherever they agree with 8 x 8 Gauss points; around the image of the
/// optic axis, where the modes turn within a pixel, the points stay. False when the fringes curve too fast for the
/// formula.
bool plan_fringe_means(const Planning& planning, const PlanarOptics<double>& o, RenderPlan& plan) {
  const Scene& scene = planning.scene;
  const int w = scene.view.width, h = scene.view.height;
  RenderPlan trial = plan;
  trial.means.fringes = true;
  // Along the axis inside, the wavevector is n_o a.
  OpticalPoint<double> face;
  const double start[1] = {0.0};
  o.column->sample(start, &face);
  const double n_o = std::sqrt(face.ordinary), sign = face.axis.z < 0 ? -1 : 1;
  const double sx = sign * n_o * face.axis.x / o.n_host, sy = sign * n_o * face.axis.y / o.n_host,
               s2 = sx * sx + sy * sy;
  constexpr int kAround = 10;  // pixels
  trial.means.samples = {1};
  if (s2 < 1) {
    const double cosine = std::sqrt(1 - s2);
    const auto [column, row] = ConeView<double>(scene, planning.value).pixel_of({sx / cosine, sy / cosine});
    if (column > -kAround && row > -kAround && column < w + kAround && row < h + kAround) {
      trial.means.center_x_px = column;
      trial.means.center_y_px = row;
      trial.means.bin_px = 1;
      trial.means.samples.assign(kAround + 1, 1);
      std::fill(trial.means.samples.begin(), trial.means.samples.begin() + 4, 8);
      std::fill(trial.means.samples.begin() + 4, trial.means.samples.begin() + kAround, 4);
    }
  }
  RenderPlan points = trial;
  points.means.fringes = false;
  points.means.samples = {8};
  std::vector<std::array<int, 2>> pilots;
  for (int i = 0; i < 64; ++i) {
    const auto at = [&](double turn, int size) {
      return std::min(size - 1, static_cast<int>((turn - std::floor(turn)) * size));
    };
    // the plastic number: even in two dimensions
    pilots.push_back({at(i * 0.7548776662466927, w), at(i * 0.5698402909980532, h)});
  }
  for (int i : {0, w - 1})
    for (int j : {0, h - 1}) pilots.push_back({i, j});
  const double error = (planning.means_at(trial, pilots) - planning.means_at(points, pilots)).cwiseAbs().maxCoeff();
  if (!(error <= plan.demand.intensity_accuracy)) return false;
  plan = trial;
  plan.numerical_error = std::max(plan.numerical_error, error);
  return true;
}

/// Squares of the picture whose fringes are smooth enough to be interpolated from 144 rays each; of the sizes tried,
/// from the whole picture on, the one with the fewest rays.
void plan_fringe_blocks(const Planning& planning, RenderPlan& plan) {
  const Scene& scene = planning.scene;
  const int w = scene.view.width, h = scene.view.height;
  // Less than 1e-9 the powers of a phase of some hundred radians do not hold.
  constexpr double kLeast = 1e-9;
  if (plan.demand.intensity_accuracy < 10 * kLeast) return;
  const double target = std::max(kSquaresShare * plan.demand.intensity_accuracy, kLeast);
  constexpr int kColumns = 8, kRims = 2 * FringeBlocks::kRim;
  const Values<Pack> lanes = planning.value.as<Pack>();
  const std::unique_ptr<SampleImage<Pack>> model = make_planar_image(scene, plan, lanes, planning.light);
  double fewest = 0.5 * w * h;
  for (int parts = 1;; parts *= 2) {
    constexpr int kWhole = 8;  // lanes do not cross from square to square
    static_assert(kWhole % kLanes == 0);
    const int size = ((std::max(w, h) + kRims + parts - 1) / parts + kWhole - 1) / kWhole * kWhole;
    const FringeBlocks blocks(w, h, size);
    const double least = static_cast<double>(blocks.count()) * FringeTable<Pack>::kRays;
    if (least >= fewest) break;
    const FringeTable<Pack> table(blocks, std::vector<std::uint8_t>(static_cast<std::size_t>(blocks.count()), 1),
                                  kGivenUp * plan.demand.intensity_accuracy, 0, {},
                                  [&](const Pack& column, const Pack& row) {
                                    FringePoint<Pack> point;
                                    model->fringe(column, row, &point);
                                    return point;
                                  });
    std::vector<std::uint8_t> smooth(static_cast<std::size_t>(blocks.count()), 0);
    parallel_for(blocks.count(), 0, [&](int b) {
      const double left = (b % blocks.columns) * size - FringeBlocks::kRim,
                   top = (b / blocks.columns) * size - FringeBlocks::kRim;
      FringeScratch scratch;
      for (const double down : {0.02, 0.31, 0.77, 0.98})  // none a Chebyshev point, the ends among them
        for (int first = 0; first < kColumns; first += kLanes) {
          alignas(64) double column[kLanes];
          for (int k = 0; k < kLanes; ++k)
            column[k] = left + size * (0.01 + 0.98 * std::min(first + k, kColumns - 1) / (kColumns - 1.0));
          const double row = top + down * size;
          FringePoint<Pack> exact;
          model->fringe(Pack::load_aligned(column), Pack(row), &exact);
          for (int k = 0; k < kLanes; ++k) {
            FringePoint<double> read;
            if (!table.read(column[k], row, scratch, read)) return;
            const auto distance = [k](const Pack& a, double c) { return std::abs(lane(a, k) - c); };
            // Every part counts as the intensity it changes.
            const double size_of_fringe = std::abs(lane(exact.amplitude, k)) + std::abs(lane(exact.quadrature, k));
            const double error = distance(exact.mean, read.mean) + distance(exact.amplitude, read.amplitude) +
                                 distance(exact.quadrature, read.quadrature) +
                                 size_of_fringe * distance(exact.phase, read.phase);
            if (!(error <= target)) return;  // also where there is no number: total reflection outside the picture
          }
        }
      smooth[static_cast<std::size_t>(b)] = 1;
    });
    double left_over = 0;  // pixels
    for (int b = 0; b < blocks.count(); ++b)
      if (!smooth[static_cast<std::size_t>(b)])
        left_over += static_cast<double>(std::min(size, w + kRims - b % blocks.columns * size)) *
                     std::min(size, h + kRims - b / blocks.columns * size);
    if (least + left_over < fewest) {
      fewest = least + left_over;
      choices(plan).fringe_block_px = size;
      choices(plan).fringe_blocks = smooth;
    }
  }
  if (choices(plan).fringe_block_px == 0) return;
  plan.numerical_error += target;
  plan.reasons.push_back(
      fmt::format("{} of {} squares of {} pixels have their fringes interpolated from {} rays each",
                  std::count(choices(plan).fringe_blocks.begin(), choices(plan).fringe_blocks.end(), 1),
                  choices(plan).fringe_blocks.size(), choices(plan).fringe_block_px, FringeTable<Pack>::kRays));
}

/// Steps below which those of the 4 x 4 transport need not converge where the medium changes within them: its waves run
/// both ways, and a step must be shorter than half a wave (Magnus series, |k| h < pi: S. Blanes, F. Casas, J. A. Oteo &
/// J. Ros, Phys. Rep. 470, 151 (2009), section 2.7). With fewer the averages over a step are those of another medium,
/// a mirror say, and twice as many agree with that. 1 where layers are even.
int fewest_steps(const PlanarOptics<double>& o) {
  constexpr int kWithin = 32;
  constexpr double kSame = 1e-12;
  // Golden section: the turns of a helix, however many, do not keep in step with it.
  constexpr double kGolden = 0.6180339887498949;
  const Mesh layers = uniform_mesh(1, o.column->breaks);
  double rate = 0;  // the most that a phase grows with u, of the slower wave
  bool even = true;
  for (std::size_t layer = 1; layer < layers.size(); ++layer) {
    std::array<double, kWithin> u{};
    for (int i = 0; i < kWithin; ++i)
      u[static_cast<std::size_t>(i)] =
          layers[layer - 1] + std::fmod((i + 0.5) * kGolden, 1.0) * (layers[layer] - layers[layer - 1]);
    std::array<OpticalPoint<double>, kWithin> at;
    o.column->sample(u, at.data());
    for (const OpticalPoint<double>& p : at) {
      rate = std::max(rate, o.k0 * std::sqrt(std::max(std::abs(p.ordinary), std::abs(p.extraordinary))) *
                                std::abs(p.depth_slope_um));
      const double along = dot(p.axis, at[0].axis);
      even = even && std::abs(along * along - 1) < kSame && std::abs(p.ordinary - at[0].ordinary) < kSame &&
             std::abs(p.extraordinary - at[0].extraordinary) < kSame;
    }
  }
  return even ? 1 : static_cast<int>(std::ceil(rate / kPi));
}

/// All reflections: as many steps of the 4 x 4 transport as change nothing when doubled.
RenderPlan plan_reflections(const Planning& planning, const PlanarOptics<double>& o,
                            const std::vector<std::pair<double, double>>& directions) {
  RenderPlan plan = planning.start();
  plan.method = "berreman";
  const Berreman<double> method;
  // Halving a step of order 4 leaves a sixteenth of its error.
  const auto change = [&](int n) {
    const Mesh mesh = uniform_mesh(n, o.column->breaks);
    Mesh halved{0.0};
    for (std::size_t i = 1; i < mesh.size(); ++i) halved.insert(halved.end(), {0.5 * (mesh[i - 1] + mesh[i]), mesh[i]});
    double largest = 0;
    for (const auto& [tx, ty] : directions)
      largest = std::max(largest, intensity_distance(planar_jones<double>(o, method, mesh, tx, ty),
                                                     planar_jones<double>(o, method, halved, tx, ty)));
    return largest;
  };
  std::vector<int> enough{kSteps.back()};
  if (const auto first = std::lower_bound(kSteps.begin(), kSteps.end(), fewest_steps(o)); first != kSteps.end())
    enough.assign(first, kSteps.end());
  plan.steps = choose(enough, plan.demand.intensity_accuracy, change, plan.numerical_error);
  plan.reasons.push_back(
      fmt::format("{} steps of the 4 x 4 transport hold the intensity to {} on {} directions (asked: {})", plan.steps,
                  sci(plan.numerical_error), directions.size(), sci(plan.demand.intensity_accuracy)));
  plan.reasons.push_back("asked for by physics.ceiling: all reflections, between the two faces too");
  if (plan.numerical_error > plan.demand.intensity_accuracy)
    plan.warnings.push_back(fmt::format("Even {} steps err by {}.", plan.steps, sci(plan.numerical_error)));
  return plan;
}

bool has_fringes(const Effort& effort) {
  const std::string name = effort.method->info().name;
  return name == "diagonal" || name == "modal";
}

/// Whether the slow solutions of the modes hold in the whole picture, not only on the pilots: where the axis comes near
/// the wavevector the modes turn too fast for them. What their last pass changes tells.
bool slow_everywhere(const Scene& scene, const Values<double>& value, const PlanarOptics<double>& o,
                     const Effort& effort, double accuracy) {
  const ConeView<double> cone(scene, value);
  const double w = scene.view.width, h = scene.view.height;
  const Mesh mesh = uniform_mesh(effort.steps, o.column->breaks);
  constexpr int kAcross = 24, kPasses = Modal<double>::kPasses;
  const auto medium = [&](double u) {
    OpticalPoint<double> p;
    o.column->sample({&u, 1}, &p);
    return p;
  };
  for (int i = 0; i <= kAcross; ++i)
    for (int j = 0; j <= kAcross; ++j) {
      const auto t = cone.at(w * i / kAcross - 0.5, h - 0.5 - h * j / kAcross);
      const Ray<double> ray = ray_at(o, t.x, t.y);
      if (modes_turn_over(medium, ray, 0, 1, 32)) return false;
      const Mat2<double> all = together(modal_transfer(*o.column, ray, mesh, kPasses)),
                         fewer = together(modal_transfer(*o.column, ray, mesh, kPasses - 1));
      if (!(intensity_distance(all, fewer) <= accuracy)) return false;
    }
  return true;
}

/// What a camera at the side does to the picture, in words.
void note_camera(const Scene& scene, const Values<double>& value, const ConeView<double>& view, RenderPlan& plan) {
  if (!scene.view.camera) return;
  const double x = std::tan(value.radians(scene.view.camera->tilt_x_deg)),
               y = std::tan(value.radians(scene.view.camera->tilt_y_deg));
  const double t = std::hypot(x, y), w = scene.view.width - 0.5, h = scene.view.height - 0.5;
  const auto [far, near] =
      std::minmax({view.nearness(-0.5, -0.5), view.nearness(-0.5, h), view.nearness(w, -0.5), view.nearness(w, h)});
  plan.reasons.push_back(
      fmt::format("the camera sees the screen from {:.3g} degrees aside, azimuth {:.3g}: foreshortened there to "
                  "{:.3g}; the scale in the picture's corners goes from {:.3g} to {:.3g} of the middle's",
                  std::atan(t) * 180 / kPi, std::atan2(y, x) * 180 / kPi, 1 / std::hypot(1.0, t), far, near));
}

}  // namespace

std::vector<double> planar_phases(const Scene& scene, const Values<double>& value) {
  std::vector<double> result;
  const PlanarOptics<double> o = planar_optics(scene, value);
  for (const auto& [tx, ty] : pilot_directions(scene, value)) result.push_back(planar_phase(o, tx, ty));
  if (const auto* cell = std::get_if<Cell>(&scene.sample)) {
    if (const auto* twisted = std::get_if<TwistedDirector>(&cell->director))
      result.push_back(2 * value.radians(twisted->twist_deg));
    if (const auto* field = std::get_if<FreederickszDirector>(&cell->director))
      result.push_back(2 * value.radians(field->twist_deg));
    if (const auto* helix = std::get_if<HelixDirector>(&cell->director))
      result.push_back(4 * kPi * value(cell->thickness_um) / value(helix->pitch_um));
  }
  return result;
}

namespace {

using Directions = decltype(pilot_directions(std::declval<const Scene&>(), std::declval<const Values<double>&>()));

/// Every pixel of a side camera's picture looks at the screen.
void check_horizon(const Scene& scene, const Values<double>& value) {
  // A twentieth of the middle's scale: what is twenty times as far away as the middle is not a picture of a screen
  // any more.
  const ConeView<double> view(scene, value);
  for (const int column : {0, scene.view.width - 1})
    for (const int row : {0, scene.view.height - 1})
      if (!(view.nearness(column, row) > 0.05))
        throw UserError(
            Where{},
            fmt::format("the corner of the picture at column {}, row {} looks past the horizon of the screen", column,
                        row),
            "lower half_field_deg or the tilt of view.camera");
}

/// No direction of the scene is totally reflected.
void check_total_reflection(const Scene& scene, const Values<double>& value, const PlanarOptics<double>& o) {
  for (const auto& [tx, ty] : pilot_directions(scene, value, std::numeric_limits<std::size_t>::max())) {
    const Ray<double> ray = ray_at(o, tx, ty);
    std::vector<double> u{0.0, 0.5, 1.0};
    OpticalPoint<double> p[3];
    o.column->sample(u, p);
    for (const auto& q : p)
      if (std::min(q.ordinary, q.extraordinary) <= ray.kx * ray.kx + ray.ky * ray.ky)
        throw UserError(
            Where{},
            "a direction of this scene is totally reflected: its tangential wavevector exceeds an index of the sample",
            "lower the angle of incidence or the surround's index");
  }
}

/// The method and its effort, into the plan with the reasons.
void choose_transport(const Scene& scene, const Values<double>& value, const PlanarOptics<double>& o,
                      const Directions& directions, RenderPlan& plan) {
  const double target = plan.demand.intensity_accuracy;
  const bool cone = cone_half_angle(scene).has_value();
  const Pilots pilots = planar_pilots(scene, plan.demand, value);
  const bool choose_freely = plan.demand.method == "auto";
  Effort effort = cheapest_effort(pilots, target, choose_freely ? "" : plan.demand.method, false,
                                  choose_freely && !cone ? "modal" : "");
  if (cone && choose_freely && !has_fringes(effort)) {
    // Pixel means come in closed form from transport in the modes: worth half as many samples again.
    for (const char* name : {"diagonal", "modal"}) {
      const Effort modes = cheapest_effort(pilots, target, name, false);
      if (modes.error <= target && 2 * modes.samples <= 3 * effort.samples) {
        effort = modes;
        break;
      }
    }
  }
  if (cone && choose_freely && effort.method->info().slow_axes && !slow_everywhere(scene, value, o, effort, target))
    effort = cheapest_effort(pilots, target, "", false, "modal");
  plan.method = effort.method->info().name;
  plan.steps = effort.steps;
  plan.numerical_error = effort.error;
  const std::string what =
      fmt::format("{}: {}, {} samples of the medium a ray, hold the intensity to {} on {} pilot rays (asked: {})",
                  plan.method, effort_text(plan.method, plan.steps), effort.samples, sci(effort.error), pilots.size(),
                  sci(plan.demand.intensity_accuracy));
  if (effort.error > target && plan.demand.method == "auto") {
    // Steps where they are needed, by their own estimate.
    double local_errors = 0;
    for (const auto& [tx, ty] : directions) {
      double estimate = 0;
      const Mesh mesh = adapted_mesh(*o.column, ray_at(o, tx, ty), std::max(target / 20, 1e-13), &estimate);
      local_errors = std::max(local_errors, estimate);
      if (mesh.size() > plan.mesh.size()) plan.mesh = mesh;
    }
    plan.method = "magnus4";
    plan.numerical_error = 2 * local_errors;  // of the matrix; an intensity changes by twice that at most
    plan.reasons.push_back(fmt::format(
        "no equal steps hold the accuracy: full 2 x 2 transport with {} adapted Magnus-4 steps", plan.mesh.size() - 1));
  } else if (effort.error > target) {
    plan.reasons.push_back(fmt::format("{} was asked for by name: {} err by {}", plan.method,
                                       effort_text(plan.method, plan.steps), sci(plan.numerical_error)));
    plan.warnings.push_back(
        fmt::format("The {} method, asked for by name, errs by {} here.", plan.method, sci(plan.numerical_error)));
  } else {
    plan.reasons.push_back(plan.method == "diagonal" ? "mode coupling is below the accuracy: " + what
                           : o.column->planar
                               ? what + "; no method needs fewer"
                               : (plan.method == "modal"
                                      ? "the modes couple, slowly against their phase: "
                                      : "the axis turns out of the ray's plane: full 2 x 2 transport, ") +
                                     what + "; no method needs fewer");
  }
}

/// Means over the pixels of a picture of directions: in closed form, or from points.
void plan_cone_pixels(const Planning& planning, const PlanarOptics<double>& o, RenderPlan& plan) {
  const Scene& scene = planning.scene;
  const Values<double>& value = planning.value;
  const ConeView<double> view(scene, value);
  const double cx = view.center_x, cy = view.center_y;
  note_camera(scene, value, view, plan);
  const int bins = static_cast<int>(std::ceil(
                       std::hypot(std::max(cx, scene.view.width - cx), std::max(cy, scene.view.height - cy)))) +
                   1;
  // The gradient changes slowly with radius: measure it on 24 radii and 12 azimuths, interpolate.
  std::vector<double> gradient(25);
  for (int i = 0; i <= 24; ++i)
    for (int k = 0; k < 12; ++k) {
      const double r = bins * i / 24.0, a = k * kPi / 6;
      double x = cx + r * std::cos(a), y = cy - r * std::sin(a);
      // Seen from the side there may be no screen outside the picture: there its edge, which ends in its corners,
      // stands for what lies beyond.
      if (scene.view.camera)
        x = std::clamp(x, 0.0, scene.view.width - 1.0), y = std::clamp(y, 0.0, scene.view.height - 1.0);
      const auto phase = [&](double column, double row) {
        const auto t = view.at(column, row);
        return planar_phase(o, t.x, t.y, 24);
      };
      const double gx = phase(x + 0.5, y) - phase(x - 0.5, y), gy = phase(x, y + 0.5) - phase(x, y - 0.5);
      gradient[static_cast<std::size_t>(i)] = std::max(gradient[static_cast<std::size_t>(i)], std::hypot(gx, gy));
    }
  const double fastest = *std::max_element(gradient.begin(), gradient.end());
  plan.reasons.push_back(fmt::format("the phase changes by up to {:.2g} rad a pixel", fastest));
  if ((plan.method == "diagonal" || plan.method == "modal") && plan_fringe_means(planning, o, plan)) {
    plan.reasons.push_back("pixel means of the fringes in closed form, from one ray a pixel");
    plan_fringe_blocks(planning, plan);
  } else {
    sample_by_radius(plan, cx, cy, bins, [&](double r) {
      const double f = std::min(23.999, r / bins * 24);
      const std::size_t i = static_cast<std::size_t>(f);
      return samples_for(std::max(gradient[i], gradient[i + 1]), plan.demand.intensity_accuracy);
    });
    const int most = *std::max_element(plan.means.samples.begin(), plan.means.samples.end());
    plan.reasons.push_back(fmt::format("pixel means from up to {} x {} rays a pixel", most, most));
  }
}

RenderPlan plan_planar(const Planning& planning) {
  const Scene& scene = planning.scene;
  const Values<double>& value = planning.value;
  RenderPlan plan = planning.start();
  if (scene.view.camera) check_horizon(scene, value);
  const PlanarOptics<double> o = planar_optics(scene, value, continuity_of(planning.demand));
  o.column->freeze();  // no node set comes twice: remembering them would only cost the search
  const Directions directions = pilot_directions(scene, value);
  check_total_reflection(scene, value, o);
  if (plan.demand.ceiling == Ceiling::reflections) return plan_reflections(planning, o, directions);
  choose_transport(scene, value, o, directions, plan);
  double largest_phase = 0;
  for (const auto& [tx, ty] : directions) largest_phase = std::max(largest_phase, std::abs(planar_phase(o, tx, ty)));
  if (cone_half_angle(scene)) {
    plan_cone_pixels(planning, o, plan);
  } else if (!std::holds_alternative<Slab>(scene.sample)) {
    plan.reasons.push_back("every pixel sees the same ray: one transfer for the whole image");
  }
  OpticalPoint<double> faces[2];
  const double ends[2] = {0, 1};
  o.column->sample(ends, faces);
  double r = 0;
  for (const auto& f : faces)
    r = std::max({r, reflectance(std::sqrt(f.ordinary), o.n_host), reflectance(std::sqrt(f.extraordinary), o.n_host)});
  plan.model_error = r + (plan.demand.ceiling == Ceiling::e_only ? 0.03 : 0.0);
  if (r > 0.01)
    plan.left_out.push_back(
        fmt::format("Light reflected between the faces (reflectance {:.2g}) is left out; it ripples the intensity by "
                    "up to about {:.2g}.",
                    r, r));
  return plan;
}

bool is_layers(const Scene& scene, const Observable&) {
  return std::holds_alternative<Cell>(scene.sample) || std::holds_alternative<Slab>(scene.sample) ||
         std::holds_alternative<Plate>(scene.sample);
}
bool has_cone(const Scene& scene) { return cone_half_angle(scene).has_value(); }

Traits layers_traits(const Scene& scene) {
  Traits traits;
  if (const Cell* cell = std::get_if<Cell>(&scene.sample)) {
    traits.even = true;
    traits.quick = !std::holds_alternative<FreederickszDirector>(cell->director);
  }
  traits.directions = has_cone(scene);
  if (std::holds_alternative<Plate>(scene.sample)) traits.strips = Traits::Strips::rows;
  return traits;
}

}  // namespace

std::vector<ParameterRef> heat_temperatures(const Scene& scene) {
  const Plate* plate = std::get_if<Plate>(&scene.sample);
  const HeatStep* heat = plate ? std::get_if<HeatStep>(&plate->heat) : nullptr;
  if (!heat) return {};
  if (const auto* law = std::get_if<LawIndices>(&scene.material); law && clearing_points(*law).empty())
    throw UserError(Where{}, "the material of a heated plate needs a law of temperature", "add haller to the material");
  return {heat->cold_k, heat->hot_k, heat->initial_k ? heat->initial_k : heat->cold_k};
}

namespace {

/// Seen in a cone every pixel has a direction of its own.
ManyDirections layers_directions(const Scene& scene, const RenderPlan&) {
  const bool one = !cone_half_angle(scene) && scene.microscope.directions.size() < 2;
  return one ? ManyDirections::summed : ManyDirections::never;
}

}  // namespace

const SampleKind kLayers{.name = "layers",
                         .is = is_layers,
                         .plan = plan_planar,
                         .pilots = planar_pilots,
                         .phases_rad = planar_phases,
                         .jones = add_planar_jones,
                         .symmetric = has_cone,
                         .directions = layers_directions,
                         .traits = layers_traits,
                         .temperatures = heat_temperatures};

}  // namespace birefit
