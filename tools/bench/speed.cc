// Speed of the forward model and of a fit, as medians of interleaved runs and as ratios within this one run:
//   build/release/tools/bench/birefit_bench [rounds]
// Every figure of docs/methods.md's section on speed comes from here.

#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "birefit/fit.h"
#include "birefit/render.h"
#include "independent_droplet.h"
#include "medium/families/axial_equilibrium.h"
#include "medium/families/radial.h"
#include "render/exposed.h"
#include "samples/choices.h"
#include "samples/sphere/droplet.h"
#include "study/frames.h"
#include "transport/one_way.h"

namespace birefit {
/// A double that counts the arithmetic done on it, functions by what the lanes spend on them: multiplications and
/// additions of their polynomials and Newton steps (core/scalar.h).
struct Counted {
  double v = 0;
  Counted() = default;
  Counted(double x) : v(x) {}  // NOLINT: numbers are counted numbers
  static inline long operations = 0;
  static double did(int n, double result) {
    operations += n;
    return result;
  }
  friend Counted operator+(Counted a, Counted b) { return did(1, a.v + b.v); }
  friend Counted operator-(Counted a, Counted b) { return did(1, a.v - b.v); }
  friend Counted operator*(Counted a, Counted b) { return did(1, a.v * b.v); }
  friend Counted operator/(Counted a, Counted b) { return did(9, a.v / b.v); }
  friend Counted operator-(Counted a) { return -a.v; }
  friend bool operator<(Counted a, Counted b) { return a.v < b.v; }
  friend bool operator>(Counted a, Counted b) { return a.v > b.v; }
};
inline Counted plain(Counted x) { return x; }
inline Counted inverse(Counted x) { return Counted::did(8, 1 / x.v); }
inline Counted inverse_root(Counted x) { return Counted::did(11, 1 / std::sqrt(x.v)); }
inline Counted root(Counted x) { return Counted::did(17, std::sqrt(x.v)); }
inline void sin_cos(Counted x, Counted& s, Counted& c) {
  s = Counted::did(38, std::sin(x.v));
  c = std::cos(x.v);
}
}  // namespace birefit

using namespace birefit;

namespace {

/// Of one call, in a row of them that lasts some ten milliseconds and follows another one: a fit makes pictures one
/// after the other, and a core that had nothing to do takes as long to wake as the shortest picture.
double seconds_of(const std::function<void()>& work) {
  const auto since = [](auto start) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  const auto first = std::chrono::steady_clock::now();
  work();
  if (const double seconds = since(first); seconds >= 0.01) return seconds;
  int calls = 0;
  double seconds = 0;
  for (const auto start = std::chrono::steady_clock::now(); seconds < 0.01; ++calls) {
    work();
    seconds = since(start);
  }
  return seconds / calls;
}

struct DropletScene {
  ParameterTable table;
  Scene scene;
  Demand demand;
  std::vector<int> four, eight;
};
/// 500 x 500 pixels, E12, 9.3 um in 1.43 at 590 nm; twisted: the fully coupled scene.
DropletScene droplet_scene(bool twisted, int size, double pixel_um) {
  DropletScene s;
  Droplet droplet;
  droplet.diameter_um = s.table.add_constant("diameter_um", 9.3);
  if (twisted) droplet.director = RadialDirector{s.table.add_constant("twist_deg", 60)};
  s.scene.sample = droplet;
  ConstantIndices material;
  material.ordinary = s.table.add_constant("ordinary", 1.52);
  material.birefringence = s.table.add_constant("birefringence", 0.22);
  s.scene.material = material;
  s.scene.surround_index = s.table.add_constant("index", 1.43);
  s.scene.microscope.wavelength_nm = s.table.add_constant("wavelength_nm", 590);
  s.scene.microscope.polarizer_deg = s.table.add_constant("polarizer_deg", 0);
  s.scene.microscope.analyzer_deg = s.table.add_constant("analyzer_deg", 90);
  s.scene.view.width = s.scene.view.height = size;
  s.scene.view.pixel_size_um = s.table.add_constant("pixel_size_um", pixel_um);
  s.scene.view.center_x_px = s.table.add_constant("center_x", 0.5 * size + 0.3);
  s.scene.view.center_y_px = s.table.add_constant("center_y", 0.5 * size - 0.2);
  s.four = {droplet.diameter_um.index, material.birefringence.index, s.scene.view.center_x_px.index,
            s.scene.view.center_y_px.index};
  s.eight = s.four;
  for (const ParameterRef& more :
       {material.ordinary, s.scene.surround_index, s.scene.microscope.wavelength_nm, s.scene.microscope.analyzer_deg})
    s.eight.push_back(more.index);
  return s;
}

/// Points inside the droplet's image (refraction makes it larger than the droplet) of which a picture's rays are
/// traced.
double rays_in_picture(const Scene& scene, const Theta& theta, const RenderPlan& plan, double radius_um,
                       double index_ratio, double host_index) {
  const double radius_px = radius_um * RimTable(index_ratio, host_index, 0).rho_max() /
                           theta[static_cast<std::size_t>(scene.view.pixel_size_um.index)];
  double rays = 0;
  for (int r = 0; r < scene.view.height; ++r)
    for (int c = 0; c < scene.view.width; ++c) {
      const double distance = std::hypot(c - plan.means.center_x_px, r - plan.means.center_y_px);
      if (distance > radius_px) continue;
      const int n =
          plan.means
              .samples[std::min(plan.means.samples.size() - 1, static_cast<std::size_t>(distance / plan.means.bin_px))];
      rays += n * n;
    }
  return rays;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// How many times `other` a thing takes: of measurements that were made one after the other, since a machine with
/// neighbours is not as fast all the time.
double ratio(const std::vector<double>& thing, const std::vector<double>& other) {
  std::vector<double> each;
  for (std::size_t i = 0; i < std::min(thing.size(), other.size()); ++i) each.push_back(thing[i] / other[i]);
  return median(each);
}

/// Arithmetic operations of the medium, the generators and the exponentials along one ray of the twisted droplet; the
/// ray itself, its surfaces and the commutators, about a tenth, are left out.
long operations_of_a_ray(int steps, int samples_a_step) {
  const Chord<Counted> chord(2.1, 4.1, 4.65);
  const LawColumn<Counted, TwistedRadialLaw<Counted>> column({chord, 0.1, 0.99, 1.0, 2.3, 3.0});
  std::vector<double> u;
  for (int i = 0; i < steps * samples_a_step; ++i) u.push_back((i + 0.5) / (steps * samples_a_step));
  std::vector<OpticalPoint<Slope<Counted>>> points(u.size());
  Counted::operations = 0;
  column.sample_with_slope(u, points.data());
  Su2<Counted> total = Su2<Counted>::identity();
  for (int i = 0; i < steps; ++i) {
    Vec3<Counted> v{};
    for (int k = 0; k < samples_a_step; ++k)
      v = su2_generator_e_and_h(points[static_cast<std::size_t>(i * samples_a_step + k)], Counted(10.6));
    total = su2_exp(v) * total;
  }
  return Counted::operations;
}

/// Multiplications and additions a second of one core that does nothing else.
double peak_operations_per_second() {
  constexpr long kRounds = 4'000'000;
  const Pack a(0.999999), b(1e-6);
  // Chains enough to hide the latency, each in a register.
  Pack s0(1.0), s1 = s0, s2 = s0, s3 = s0, s4 = s0, s5 = s0, s6 = s0, s7 = s0, s8 = s0, s9 = s0;
  double best = 1e9;
  for (int i = 0; i < 3; ++i)
    best = std::min(best, seconds_of([&] {
                      Pack t0 = s0, t1 = s1, t2 = s2, t3 = s3, t4 = s4, t5 = s5, t6 = s6, t7 = s7, t8 = s8, t9 = s9;
                      for (long k = 0; k < kRounds; ++k) {
                        t0 = t0 * a + b, t1 = t1 * a + b, t2 = t2 * a + b, t3 = t3 * a + b, t4 = t4 * a + b;
                        t5 = t5 * a + b, t6 = t6 * a + b, t7 = t7 * a + b, t8 = t8 * a + b, t9 = t9 * a + b;
                      }
                      s0 = t0, s1 = t1, s2 = t2, s3 = t3, s4 = t4, s5 = t5, s6 = t6, s7 = t7, s8 = t8, s9 = t9;
                    }));
  const double used = lane(s0 + s1 + s2 + s3 + s4 + s5 + s6 + s7 + s8 + s9, 0);
  return used > 0 ? 2.0 * kLanes * 10 * kRounds / best : 0;
}

/// What wave optics of a sphere costs against the ray picture of the same size.
void time_waves(int rounds) {
  for (const double diameter : {9.0, 20.0}) {
    DropletScene s = droplet_scene(false, 500, 1.42 * diameter / 500);
    s.table[std::get<Droplet>(s.scene.sample).diameter_um].value = diameter;
    s.scene.microscope.objective_na = s.table.add_constant("objective_na", 0.8);
    const Theta theta = s.table.values();
    const RenderPlan rays = plan(s.scene, theta);
    const RenderPlan series = plan(s.scene, {.ceiling = Ceiling::wave}, theta);
    const RenderPlan propagated = plan(s.scene, {.ceiling = Ceiling::wave, .method = "split_step"}, theta);
    // Diameter and indices change the light itself; two of `four` only move the picture.
    const std::vector<int> of_light{s.eight[0], s.eight[1], s.eight[4], s.eight[5]};
    Rendering out, derivatives;
    std::vector<double> by_rays, by_series, by_series_four, by_waves, one, four, four_light;
    for (int i = 0; i < rounds; ++i) {
      by_rays.push_back(seconds_of([&] { render(s.scene, rays, theta, {}, 0, out); }));
      by_series.push_back(seconds_of([&] { render(s.scene, series, theta, {}, 0, out); }));
      by_series_four.push_back(seconds_of([&] { render(s.scene, series, theta, s.four, 0, derivatives); }));
      by_waves.push_back(seconds_of([&] { render(s.scene, propagated, theta, {}, 0, out); }));
      one.push_back(seconds_of([&] { render(s.scene, propagated, theta, {}, 1, out); }));
      four.push_back(seconds_of([&] { render(s.scene, propagated, theta, s.four, 0, derivatives); }));
      four_light.push_back(seconds_of([&] { render(s.scene, propagated, theta, of_light, 0, derivatives); }));
    }
    std::printf("500 x 500 radial droplet of %g um, NA 0.8, as waves:\n", diameter);
    std::printf(
        "  exact series                  %8.2f ms   %.2f times rays; with four derivatives %.2f ms, %.2f times\n",
        1e3 * median(by_series), ratio(by_series, by_rays), 1e3 * median(by_series_four),
        ratio(by_series_four, by_series));
    std::printf("  propagation                   %8.2f ms   %.1f times rays; one thread %.2f ms, %.2f times\n",
                1e3 * median(by_waves), ratio(by_waves, by_rays), 1e3 * median(one), ratio(one, by_waves));
    std::printf(
        "    four derivatives            %8.2f ms   %.2f times the image; all four by what light meets %.2f ms, %.2f "
        "times\n",
        1e3 * median(four), ratio(four, by_waves), 1e3 * median(four_light), ratio(four_light, by_waves));
  }
}

/// Pictures of directions: every pixel a ray of its own, but few are traced.
void time_cones(int rounds) {
  for (const study::FrameScene& f : study::frame_scenes()) {
    if (!std::holds_alternative<Plate>(f.scene.sample) && !std::holds_alternative<Slab>(f.scene.sample)) continue;
    const Theta theta = f.table.values();
    const RenderPlan p = plan(f.scene, theta);
    const std::vector<int> four(f.parameters.begin(), f.parameters.begin() + 4);
    Rendering out, out_four, out_all;
    std::vector<double> both, one, by_four, by_all;
    for (int i = 0; i < rounds; ++i) {
      both.push_back(seconds_of([&] { render(f.scene, p, theta, {}, 0, out); }));
      one.push_back(seconds_of([&] { render(f.scene, p, theta, {}, 1, out); }));
      by_four.push_back(seconds_of([&] { render(f.scene, p, theta, four, 0, out_four); }));
      by_all.push_back(seconds_of([&] { render(f.scene, p, theta, f.parameters, 0, out_all); }));
    }
    std::printf("500 x 500 %s (%s):\n", f.name.c_str(), p.method.c_str());
    std::printf("  image, all threads            %8.2f ms   one thread %.2f ms, %.2f times\n", 1e3 * median(both),
                1e3 * median(one), ratio(one, both));
    std::printf("  image and four derivatives    %8.2f ms   %.2f times the image; %zu: %.2f ms, %.2f times\n",
                1e3 * median(by_four), ratio(by_four, both), f.parameters.size(), 1e3 * median(by_all),
                ratio(by_all, both));
  }
}

void time_shell(int rounds) {
  DropletScene s = droplet_scene(false, 500, 0.025);
  ShellDirector shell;
  shell.wall_um = s.table.add_constant("wall_um", 1.3);
  std::get<Droplet>(s.scene.sample).director = shell;
  const Theta theta = s.table.values();
  const RenderPlan p = plan(s.scene, theta);
  Rendering out;
  std::vector<double> times;
  for (int i = 0; i < rounds; ++i) times.push_back(seconds_of([&] { render(s.scene, p, theta, {}, 0, out); }));
  std::printf("500 x 500 concentric shell, wall 1.3 um: %.2f ms\n", 1e3 * median(times));
}

/// Each mode on its own ray.
void time_curved(int rounds) {
  struct Sample {
    const char* name;
    double wall_um, field, ring;
  };
  for (const auto& [name, wall_um, field, ring] : {Sample{"hedgehog", 0, 0, 0},
                                                   {"shell, wall 1.3 um", 1.3, 0, 0},
                                                   {"hedgehog in a field, e = 3", 0, 3, 0},
                                                   {"ring in a field, e = 8", 0, 8, 0.85}}) {
    DropletScene s = droplet_scene(false, 128, 0.1);
    Droplet& droplet = std::get<Droplet>(s.scene.sample);
    if (wall_um > 0) {
      ShellDirector shell;
      shell.wall_um = s.table.add_constant("wall_um", wall_um);
      droplet.director = shell;
    } else if (field > 0) {
      AxialDirector axial;
      axial.reduced_field = s.table.add_constant("reduced_field", field);
      if (ring > 0) axial.ring_radius = s.table.add_constant("ring_radius", ring);
      droplet.director = axial;
    }
    const Theta theta = s.table.values();
    const RenderPlan p = plan(s.scene, {.rays = Rays::eikonal}, theta);
    Rendering out, out_four;
    std::vector<double> image, four;
    for (int i = 0; i < rounds; ++i) {
      image.push_back(seconds_of([&] { render(s.scene, p, theta, {}, 0, out); }));
      four.push_back(seconds_of([&] { render(s.scene, p, theta, s.four, 0, out_four); }));
    }
    std::printf("128 x 128 by curved rays, %s: %.2f ms   with four derivatives %.2f ms, %.2f times\n", name,
                1e3 * median(image), 1e3 * median(four), ratio(four, image));
  }
}

/// Droplets that look different from all sides: full transport, tables over squares of the disc or a ray for every
/// point.
void time_unsymmetric(int rounds) {
  for (const char* name : {"bipolar, poles 20 deg out of the image plane", "under a field across the view, e = 3",
                           "with a ring under a field across the view, e = 12", "eccentric shell"}) {
    DropletScene s = droplet_scene(false, 500, 0.025);
    Droplet& droplet = std::get<Droplet>(s.scene.sample);
    if (name[0] == 'b') {
      BipolarDirector bipolar;
      bipolar.azimuth_deg = s.table.add_constant("azimuth_deg", 35);
      bipolar.tilt_deg = s.table.add_constant("tilt_deg", 20);
      droplet.director = bipolar;
    } else if (name[0] != 'e') {
      AxialDirector axial;
      axial.reduced_field = s.table.add_constant("reduced_field", name[0] == 'w' ? 12 : 3);
      if (name[0] == 'w') axial.ring_radius = s.table.add_constant("ring_radius", 0.9);
      axial.field_azimuth_deg = s.table.add_constant("field_azimuth_deg", 35);
      droplet.director = axial;
    } else {
      ShellDirector shell;
      shell.wall_um = s.table.add_constant("wall_um", 1.3);
      shell.offset_um = {s.table.add_constant("offset_x", 0.4), s.table.add_constant("offset_y", -0.2),
                         s.table.add_constant("offset_z", 0.3)};
      droplet.director = shell;
    }
    const Theta theta = s.table.values();
    RenderPlan p;
    const double planned = seconds_of([&] { p = plan(s.scene, theta); });
    RenderPlan every = p;
    for (DiscSquare& square : choices(every).disc) square.smooth = false;
    Rendering image, four, direct, direct_four;
    std::vector<double> table, table_four, rays, rays_four;
    for (int i = 0; i < std::max(3, rounds); ++i) {
      table.push_back(seconds_of([&] { render(s.scene, p, theta, {}, 0, image); }));
      table_four.push_back(seconds_of([&] { render(s.scene, p, theta, s.four, 0, four); }));
      if (i >= std::max(3, rounds / 3)) continue;
      rays.push_back(seconds_of([&] { render(s.scene, every, theta, {}, 0, direct); }));
      rays_four.push_back(seconds_of([&] { render(s.scene, every, theta, s.four, 0, direct_four); }));
    }
    double error = 0;
    for (std::size_t i = 0; i < image.intensity.values().size(); ++i)
      error = std::max(error, std::abs(image.intensity.values()[i] - direct.intensity.values()[i]));
    std::printf("500 x 500 droplet, %s (%s, %d steps), planned in %.0f ms:\n", name, p.method.c_str(), p.steps,
                1e3 * planned);
    std::printf("  image                         %8.2f ms   with four derivatives %.2f ms, %.2f times\n",
                1e3 * median(table), 1e3 * median(table_four), ratio(table_four, table));
    std::printf(
        "  a ray for every point         %8.2f ms   with four derivatives %.2f ms, %.2f times; differs by %.1e\n",
        1e3 * median(rays), 1e3 * median(rays_four), ratio(rays_four, rays), error);
  }
}

/// Where a search begins and between which bounds.
struct Range {
  double start, low, high;
};

/// A fit of s.four, gain and offset to `values`.
FitJob job_of(DropletScene s, Image values, const std::array<Range, 4>& ranges, std::optional<NoiseModel> noise = {}) {
  for (std::size_t k = 0; k < ranges.size(); ++k) {
    Parameter& parameter = s.table[s.four[k]];
    parameter.free = true;
    parameter.value = ranges[k].start, parameter.lower = ranges[k].low, parameter.upper = ranges[k].high;
  }
  Picture micrograph;
  micrograph.name = "synthetic";
  micrograph.mask = Mask(values.width(), values.height(), 1);
  micrograph.values = std::move(values);
  micrograph.noise = noise;
  for (const char* name : {"gain", "offset"}) {
    Parameter parameter;
    parameter.name = name;
    parameter.free = parameter.automatic = parameter.linear = true;
    (std::string(name) == "gain" ? micrograph.gain : micrograph.offset) = s.table.add(parameter);
  }
  micrograph.scene = s.scene;
  FitJob job;
  job.parameters = s.table;
  job.demand = s.demand;
  job.measurements = {micrograph};
  return job;
}

/// The equilibrium of a droplet under a field, and what it makes of a fit in the field against one in the
/// birefringence: as many unknowns and pixels, the first run of each, when no equilibrium is known yet, and one more.
void time_field() {
  for (const double ring : {0.0, 0.9}) {
    double alone = 0, near = 0;
    constexpr int kCalls = 20;
    for (int i = 0; i < kCalls; ++i) {
      const double e = 9 + 0.013 * i;  // a rung's neighbours
      const auto seconds = [](const auto& work) {
        const auto start = std::chrono::steady_clock::now();
        work();
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() / kCalls;
      };
      alone += seconds([&] { axial_equilibrium(e, ring, axial_production_grid(ring)); });
      if (i == 0) known_axial_equilibrium(e - 0.001, ring, false);
      near += seconds([&] { known_axial_equilibrium(e, ring, true); });
    }
    std::printf(
        "equilibrium of a droplet under a field, %s, with slopes: %.1f ms from the start, %.1f ms from the nearest "
        "kept\n",
        ring > 0 ? "ring" : "hedgehog", 1e3 * alone, 1e3 * near);
  }
  double first[2], second[2];
  for (const bool field : {true, false}) {
    DropletScene s = droplet_scene(false, 128, 0.08);
    AxialDirector axial;
    axial.reduced_field = s.table.add_constant("reduced_field", 17);  // away from the calls above
    std::get<Droplet>(s.scene.sample).director = axial;
    Image values = render(s.scene, plan(s.scene, s.table.values()), s.table.values(), {}, 0).intensity;
    std::mt19937_64 random(3);
    std::normal_distribution<double> noise(0, 20);
    for (double& value : values.values()) value = 150 + 3200 * value + noise(random);
    if (field) s.four[1] = axial.reduced_field.index;
    const FitJob job =
        job_of(s, std::move(values),
               {{{9.0, 8.5, 10}, field ? Range{12, 0, 40} : Range{0.15, 0.05, 0.4}, {66, 58, 70}, {62, 58, 70}}});
    for (double* seconds : {&first[field], &second[field]}) {
      const auto start = std::chrono::steady_clock::now();
      const FitResult result = fit(job);
      *seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      if (!result.has_answer()) std::printf("NO ANSWER\n");
    }
  }
  std::printf(
      "fit of a 128 x 128 droplet under a field: the field %.2f s (again %.2f), the birefringence %.2f s (again %.2f): "
      "%.1f times\n",
      first[1], second[1], first[0], second[0], first[1] / first[0]);
}

/// A fit by propagation, the search for the fringe order included: a bipolar droplet, 160 x 160 pixels, noise of 0.2 %.
void time_fit_by_waves() {
  constexpr int kSize = 160;
  DropletScene s = droplet_scene(false, kSize, 0.08);
  BipolarDirector bipolar;
  bipolar.azimuth_deg = s.table.add_constant("azimuth_deg", 30);
  bipolar.tilt_deg = s.table.add_constant("tilt_deg", 0);
  std::get<Droplet>(s.scene.sample).director = bipolar;
  s.demand.ceiling = Ceiling::wave;
  s.scene.microscope.objective_na = s.table.add_constant("objective_na", 0.8);
  s.table[s.scene.surround_index].value = 1.5;
  const std::array<double, 4> truth{9.0, 0.12, 80.3, 79.2};
  for (std::size_t k = 0; k < truth.size(); ++k) s.table[s.four[k]].value = truth[k];
  const Theta theta = s.table.values();
  Image values = render(s.scene, plan(s.scene, s.demand, theta), theta).intensity;
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0, 0.002);
  for (double& value : values.values()) value += noise(random);
  const FitJob job = job_of(s, std::move(values), {{{8.8, 8.4, 9.6}, {0.1, 0.06, 0.2}, {80, 77, 83}, {80, 77, 83}}},
                            NoiseModel{0.002, 0, false});
  FitResult result;
  const double seconds = seconds_of([&] { result = fit(job); });
  std::printf(
      "fit by propagation, bipolar droplet of 9 um, 160 x 160 pixels, four parameters, orders searched: %.1f s, %d "
      "evaluations, %s\n",
      seconds, result.evaluations, result.has_answer() ? "answer" : "NO ANSWER");
}

/// A whole fit: size x size pixels, six free parameters, the scan included; by rays to an image of a program that
/// shares no code with the fit, by waves to one of the exact series.
void time_fit(int size, int rounds, bool by_waves) {
  const double scale = 256.0 / size;
  testing::IndependentDroplet truth;
  truth.center_x_px = 129.3 / scale;
  truth.center_y_px = 125.8 / scale;
  truth.pixel_um = 0.05 * scale;
  DropletScene s = droplet_scene(false, size, truth.pixel_um);
  std::vector<double> mean;
  if (by_waves) {
    s.demand.ceiling = Ceiling::wave;
    s.scene.microscope.objective_na = s.table.add_constant("objective_na", 0.75);
    const std::array<double, 4> values{9.3, 0.22, truth.center_x_px, truth.center_y_px};
    for (std::size_t k = 0; k < values.size(); ++k) s.table[s.four[k]].value = values[k];
    const Theta theta = s.table.values();
    const Image intensity = render(s.scene, plan(s.scene, s.demand, theta), theta).intensity;
    for (const double value : intensity.values()) mean.push_back(150 + 3200 * value);
  } else {
    for (int row = 0; row < size; ++row)
      for (int column = 0; column < size; ++column) mean.push_back(150 + 3200 * truth.pixel(column, row, 2));
  }
  Image values(size, size);
  values.values() = testing::camera(mean, 0.5, 4.0, 7);
  const FitJob job = job_of(s, std::move(values),
                            {{{9.0, 8.0, 10.5},
                              {0.15, 0.05, 0.4},
                              {130 / scale, 110 / scale, 150 / scale},
                              {126 / scale, 106 / scale, 146 / scale}}});
  std::vector<double> times;
  FitResult result;
  for (int i = 0; i < rounds; ++i) times.push_back(seconds_of([&] { result = fit(job); }));
  std::printf("fit of a %d x %d droplet%s, six parameters, scan included: %.2f s, %d evaluations, %s\n", size, size,
              by_waves ? " by waves" : "", median(times), result.evaluations,
              result.has_answer() ? "converged" : "NO ANSWER");
  std::printf("  %s\n", result.verdict.c_str());
}

}  // namespace

int main(int argc, char** argv) {
  const int rounds = argc > 1 ? std::atoi(argv[1]) : 11;
  std::printf("%u threads, %d doubles a lane pack, %d rounds, medians; ratios are medians of each round's\n",
              std::thread::hardware_concurrency(), kLanes, rounds);
  for (const bool twisted : {false, true}) {
    const DropletScene s = droplet_scene(twisted, 500, 0.025);
    const Theta theta = s.table.values();
    const RenderPlan p = plan(s.scene, theta);
    // The same without the table over the radius: a ray for every point, as a scene without symmetry needs.
    RenderPlan every = p;
    choices(every).radial_panels = 0;
    Rendering out, out_four, out_eight;  // images are made once, as in a fit
    std::vector<double> both, one, four, eight, scalar, rays, rays_one, rays_four, rays_scalar;
    for (int i = 0; i < rounds; ++i) {
      both.push_back(seconds_of([&] { render(s.scene, p, theta, {}, 0, out); }));
      one.push_back(seconds_of([&] { render(s.scene, p, theta, {}, 1, out); }));
      four.push_back(seconds_of([&] { render(s.scene, p, theta, s.four, 0, out_four); }));
      eight.push_back(seconds_of([&] { render(s.scene, p, theta, s.eight, 0, out_eight); }));
      rays.push_back(seconds_of([&] { render(s.scene, every, theta, {}, 0, out); }));
      rays_one.push_back(seconds_of([&] { render(s.scene, every, theta, {}, 1, out); }));
      rays_four.push_back(seconds_of([&] { render(s.scene, every, theta, s.four, 0, out_four); }));
      if (i < 3) scalar.push_back(seconds_of([&] { render_scalar(s.scene, p, theta); }));
      if (i < 3) rays_scalar.push_back(seconds_of([&] { render_scalar(s.scene, every, theta); }));
    }
    std::printf("500 x 500 %s droplet (%s, %d steps, accuracy %.0e):\n", twisted ? "twisted" : "radial",
                p.method.c_str(), p.steps, p.demand.intensity_accuracy);
    std::printf("  image, all threads            %8.2f ms\n", 1e3 * median(both));
    std::printf("  image, one thread             %8.2f ms   %.2f times all threads\n", 1e3 * median(one),
                ratio(one, both));
    std::printf("  image, one thread, no lanes   %8.2f ms   %.2f times the lanes\n", 1e3 * median(scalar),
                ratio(scalar, one));
    std::printf("  image and four derivatives    %8.2f ms   %.2f times the image\n", 1e3 * median(four),
                ratio(four, both));
    std::printf("  image and eight derivatives   %8.2f ms   %.2f times the image\n", 1e3 * median(eight),
                ratio(eight, both));
    std::printf("  a ray for every point         %8.2f ms   %8.2f ms with four derivatives, %.2f times\n",
                1e3 * median(rays), 1e3 * median(rays_four), ratio(rays_four, rays));
    std::printf("    one thread                  %8.2f ms   %.2f times all threads\n", 1e3 * median(rays_one),
                ratio(rays_one, rays));
    std::printf("    one thread, no lanes        %8.2f ms   %.2f times the lanes\n", 1e3 * median(rays_scalar),
                ratio(rays_scalar, rays_one));
    if (twisted && p.method == "magnus6") {
      // Three samples a step; points beside the droplet have no ray, some pixels several.
      const double rays_traced = rays_in_picture(s.scene, theta, every,
                                                 0.5 * theta[static_cast<std::size_t>(s.four[0])], 1.43 / 1.52, 1.43),
                   operations = static_cast<double>(operations_of_a_ray(p.steps, 3)),
                   peak = peak_operations_per_second();
      const double achieved = rays_traced * operations / median(rays_one);
      std::printf(
          "    %.0f rays of %.0f operations: %.1f GFLOP/s of the core's %.1f (fused multiplications and additions "
          "alone), %.0f %%\n",
          rays_traced, operations, 1e-9 * achieved, 1e-9 * peak, 100 * achieved / peak);
    }
  }

  time_shell(rounds);
  time_curved(rounds);
  time_cones(rounds);
  time_unsymmetric(rounds);
  const auto peak_mb = [] {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return static_cast<double>(usage.ru_maxrss) / 1024;
  };
  time_field();
  time_fit_by_waves();
  for (const bool by_waves : {false, true}) {
    time_fit(256, 3, by_waves);
    std::printf("  peak memory so far %.0f MB\n", peak_mb());
    time_fit(1024, 1, by_waves);
    std::printf("  peak memory so far %.0f MB\n", peak_mb());
  }
  time_waves(std::max(3, rounds / 3));
  std::printf("  peak memory so far %.0f MB\n", peak_mb());
}
