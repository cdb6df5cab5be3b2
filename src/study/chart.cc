#include "birefit/study.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "birefit/render.h"
#include "study/frames.h"
#include "study/rays.h"
#include "study/timing.h"
#include "transport/methods.h"
#include "transport/methods/ode_operator.h"
#include "transport/methods/ode_scalar.h"
#include "transport/methods/wei_norman.h"

namespace birefit {
namespace {

using namespace study;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
using M = Mat2<double>;

double frobenius(const M& m) { return std::sqrt(norm(m.a) + norm(m.b) + norm(m.c) + norm(m.d)); }
double relative(const M& m, const M& reference) { return frobenius(m - reference) / frobenius(reference); }
double intensity_error(const M& m, const M& reference) {
  double worst = 0;
  for (int i = 0; i <= 90; ++i) {
    const double angle = 2 * i * std::numbers::pi / 180, px = std::cos(angle), py = std::sin(angle);
    const auto crossed = [&](const M& t) { return norm(-py * (px * t.a + py * t.b) + px * (px * t.c + py * t.d)); };
    const double error = std::abs(crossed(m) - crossed(reference));
    if (!(error <= worst)) worst = error;  // NaN stays NaN
    if (std::isnan(worst)) return worst;
  }
  return worst;
}
/// Value and derivative of the first lane.
M first_lane(const Mat2<Dual1>& m, bool derivative) {
  const auto z = [&](const Complex<Dual1>& c) {
    return derivative ? Complex<double>{lane(c.re.d[0], 0), lane(c.im.d[0], 0)}
                      : Complex<double>{lane(c.re.value, 0), lane(c.im.value, 0)};
  };
  return {z(m.a), z(m.b), z(m.c), z(m.d)};
}

template <class S>
Ray<S> ray_of(const RaySpec& spec, Continuity continuity) {
  return {S(2 * std::numbers::pi / spec.wavelength_um), S(spec.kx), S(spec.ky), continuity};
}

/// Everything that is compared on one ray. Methods are compared in the source paper's physics, tangential E continuous,
/// the one that all of them can do.
struct RayBench {
  RaySpec spec;
  std::unique_ptr<Column<double>> column;
  std::unique_ptr<Column<Pack>> lanes;
  std::unique_ptr<Column<Dual1>> slopes;
  M reference, gradient;
  double agreement = 0;
  double step = 0;                             ///< of n_e, for derivatives by differences
  std::unique_ptr<Column<double>> shifted[4];  ///< n_e at -2, -1, 1, 2 steps

  explicit RayBench(const RaySpec& s)
      : spec(s), column(ray_column<double>(s.name, 0.0)), lanes(ray_column<Pack>(s.name, Pack(0.0))) {
    Dual1 shift(Pack(0.0));
    shift.d[0] = Pack(1.0);
    slopes = ray_column<Dual1>(s.name, shift);
    constexpr int kSteps = 16384;
    const Mat2<Dual1> exact = Magnus6<Dual1>().transfer(*slopes, ray_of<Dual1>(spec, Continuity::e_only),
                                                        uniform_mesh(kSteps, column->breaks));
    reference = first_lane(exact, false);
    gradient = first_lane(exact, true);
    agreement = relative(Magnus4<double>().transfer(*column, ray_of<double>(spec, Continuity::e_only),
                                                    uniform_mesh(4 * kSteps, column->breaks)),
                         reference);
    // 3 mrad of phase: the formula of fourth order leaves some 1e-12 of the derivative, and so does rounding.
    double depth = 0;
    for (int i = 0; i < 64; ++i) {
      const double u = (i + 0.5) / 64;
      OpticalPoint<double> p;
      column->sample({&u, 1}, &p);
      depth += p.depth_slope_um / 64;
    }
    step = 3e-3 / (ray_of<double>(spec, Continuity::e_only).k0_per_um * depth);
    for (int k = 0; k < 4; ++k) shifted[k] = ray_column<double>(s.name, (k < 2 ? k - 2 : k - 1) * step);
  }

  /// A method of the registry: any scalar.
  template <template <class> class Method>
  ChartPoint measure(int n) const {
    const Mesh mesh = uniform_mesh(n, column->breaks);
    const Method<double> plain_method{};
    const Ray<double> ray = ray_of<double>(spec, Continuity::e_only);
    const Ray<Pack> ray_lanes = ray_of<Pack>(spec, Continuity::e_only);
    const Ray<Dual1> ray_slopes = ray_of<Dual1>(spec, Continuity::e_only);
    ChartPoint p = value_point(plain_method, ray, mesh, plain_method.info().name, fmt::format("n={}", n));
    const Method<Pack> lane_method{};
    p.seconds_in_lanes = seconds_of([&] { keep(lane_method.transfer(*lanes, ray_lanes, mesh)); }) / kLanes;
    // Its own derivatives, instead of differences.
    const M slope = first_lane(Method<Dual1>{}.transfer(*slopes, ray_slopes, mesh), true);
    p.gradient_error = relative(slope, gradient);
    return p;
  }
  /// A method for plain doubles only.
  ChartPoint value_point(const TransportMethod<double>& method, const Ray<double>& ray, const Mesh& mesh,
                         const std::string& name, const std::string& effort) const {
    ChartPoint p;
    p.scene = spec.name, p.method = name, p.effort = effort;
    p.seconds_in_lanes = p.gradient_error = kNone;
    const CountingColumn<double> counted(*column);
    p.samples = kNone;
    M result;
    try {
      result = method.transfer(*column, ray, mesh);
    } catch (const std::exception&) {  // says itself that it cannot do this ray
      p.seconds = p.jones_error = p.intensity_error = kNone;
      return p;
    }
    p.seconds = seconds_of([&] { keep(method.transfer(*column, ray, mesh)); });
    if (counts_samples(method)) {
      method.transfer(counted, ray, mesh);
      p.samples = counted.count();
    }
    p.jones_error = relative(result, reference);
    p.intensity_error = intensity_error(result, reference);
    try {
      M at[4];
      for (int k = 0; k < 4; ++k) at[k] = method.transfer(*shifted[k], ray, mesh);
      const Complex<double> near(8 / (12 * step)), far(1 / (12 * step));
      p.gradient_error = relative(near * (at[2] - at[1]) - far * (at[3] - at[0]), gradient);
    } catch (const std::exception&) {  // not beside it
    }
    return p;
  }

 private:
  /// Methods that work on series of the medium ask the column for them, not for samples.
  static bool counts_samples(const TransportMethod<double>& method) {
    return std::string(method.info().name).find("wei_norman") == std::string::npos;
  }
  /// The compiler must not drop the work.
  template <class T>
  static void keep(const T& value) {
    [[maybe_unused]] static volatile double sink;
    sink = lane(plain(value.a.re), 0);
  }
};

ChartScene describe(const RayBench& bench) {
  ChartScene scene{bench.spec.name, bench.spec.what, bench.agreement, 0, 0, 0};
  const Ray<double> ray = ray_of<double>(bench.spec, Continuity::e_and_h);
  const ModalTransfer<double> modes = diagonal_transfer(*bench.column, ray, uniform_mesh(64, bench.column->breaks));
  scene.phase_rad = std::abs(modes.log_e.im - modes.log_o.im);
  const Mesh mesh = uniform_mesh(4096, bench.column->breaks);
  const M everything = Berreman<double>().transmission(*bench.column, ray, mesh, bench.spec.host_index);
  const Magnus4<double> method;
  scene.one_way_error =
      intensity_error(method.transmission(*bench.column, ray, mesh, bench.spec.host_index), everything);
  scene.e_only_error = intensity_error(
      method.transmission(*bench.column, ray_of<double>(bench.spec, Continuity::e_only), mesh, bench.spec.host_index),
      everything);
  return scene;
}

// ---- whole frames --------------------------------------------------------------------------------------------------

/// Some pixels of a frame by magnus4 and 8 x 8 points each: what the slab is judged by, whose every pixel would take
/// minutes.
struct PixelTruth {
  std::vector<std::array<int, 2>> pixels;
  Eigen::VectorXd intensity;
};
PixelTruth pixel_truth(const Scene& scene, const Theta& theta) {
  RenderPlan fine = plan(scene, {.intensity_accuracy = 1e-7, .method = "magnus4"}, theta);
  fine.means.samples = {8};
  fine.means.fringes = false;
  PixelTruth truth;
  for (int i = 0; i < 200; ++i) {
    const auto at = [&](double turn, int size) { return static_cast<int>((turn - std::floor(turn)) * size); };
    truth.pixels.push_back(
        {at(i * 0.7548776662466927, scene.view.width), at(i * 0.5698402909980532, scene.view.height)});
  }
  truth.intensity = render_pixels(scene, fine, theta, truth.pixels).intensity;
  return truth;
}

/// The frame of pixels so many times finer, averaged: none of its pixels is planned as the frame's are.
Image by_finer_pixels(Scene scene, const Demand& demand, Theta theta) {
  constexpr int kFiner = 9;
  const int w = scene.view.width, h = scene.view.height;
  scene.view.width *= kFiner, scene.view.height *= kFiner;
  if (scene.view.pixel_size_um) theta[static_cast<std::size_t>(scene.view.pixel_size_um.index)] /= kFiner;
  for (const ParameterRef& centre : {scene.view.center_x_px, scene.view.center_y_px}) {
    double& at = theta[static_cast<std::size_t>(centre.index)];
    at = (at + 0.5) * kFiner - 0.5;  // pixel centres are whole numbers
  }
  const Image fine = render(scene, plan(scene, demand, theta), theta).intensity;
  Image mean(w, h);
  for (int row = 0; row < h; ++row)
    for (int j = 0; j < kFiner; ++j) {
      const double* from = fine.row(kFiner * row + j);
      for (int column = 0; column < w; ++column)
        for (int i = 0; i < kFiner; ++i) mean(column, row) += from[kFiner * column + i] / (kFiner * kFiner);
    }
  return mean;
}

void measure_frames(MethodChart& chart, const std::function<void(const std::string&)>& say) {
  for (const FrameScene& f : frame_scenes()) {
    if (say) say("frames of " + f.name);
    const Theta theta = f.table.values();
    const bool by_pixels = f.name == "evaluation_slab";
    PixelTruth some;
    Image exact;
    if (by_pixels) {
      some = pixel_truth(f.scene, theta);
    } else {
      exact = by_finer_pixels(f.scene, {.intensity_accuracy = 1e-10}, theta);
    }
    for (const double asked : {1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8}) {
      if (by_pixels && asked < 1e-4) break;  // kinks of its splines keep the modes from less: minutes by magnus4
      const RenderPlan chosen = plan(f.scene, {.intensity_accuracy = asked}, theta);
      ChartFrame frame;
      frame.scene = f.name, frame.method = chosen.method, frame.asked = asked;
      Rendering rendering;
      frame.seconds = seconds_of([&] { render(f.scene, chosen, theta, {}, 0, rendering); });
      const Image& image = rendering.intensity;
      double sum = 0;
      const std::size_t count = by_pixels ? some.pixels.size() : image.size();
      for (std::size_t i = 0; i < count; ++i) {
        const double d =
            by_pixels ? image(some.pixels[i][0], some.pixels[i][1]) - some.intensity[static_cast<Eigen::Index>(i)]
                      : image.values()[i] - exact.values()[i];
        sum += d * d;
        if (std::abs(d) <= frame.worst_error) continue;
        frame.worst_error = std::abs(d);
        frame.worst_column = by_pixels ? some.pixels[i][0] : static_cast<int>(i) % image.width();
        frame.worst_row = by_pixels ? some.pixels[i][1] : static_cast<int>(i) / image.width();
      }
      frame.rms_error = std::sqrt(sum / static_cast<double>(count));
      chart.frames.push_back(frame);
    }
  }
}

}  // namespace

MethodChart measure_chart(bool quick, const std::function<void(const std::string&)>& say) {
  MethodChart chart;
  for (const RaySpec& spec : ray_specs()) {
    if (say) say("rays of " + spec.name);
    const RayBench bench(spec);
    chart.scenes.push_back(describe(bench));
    const Ray<double> ray = ray_of<double>(spec, Continuity::e_only);
    const int most = quick ? 256 : 8192;
    for (int n = 4; n <= most; n *= quick ? 4 : 2) {
      if (n <= 64) chart.points.push_back(bench.measure<Diagonal>(n));
      if (n <= 512) chart.points.push_back(bench.measure<Modal>(n / 4));
      chart.points.push_back(bench.measure<Magnus4>(n));
      chart.points.push_back(bench.measure<Magnus6>(n));
      chart.points.push_back(bench.measure<LayersMidpoint>(n));
      chart.points.push_back(bench.measure<LayersEdge>(n));
    }
    for (int n = 1; n <= (quick ? 16 : 1024); n *= 4) {
      const Mesh mesh = uniform_mesh(n, bench.column->breaks);
      const std::string effort = fmt::format("n={}", n);
      for (const int order : {kWeiNormanPaper.order, 3, 11}) {
        const std::string series = order == kWeiNormanPaper.order ? effort : fmt::format("{} order={}", effort, order);
        chart.points.push_back(bench.value_point(WeiNorman<double>(order), ray, mesh, "wei_norman", series));
        chart.points.push_back(bench.value_point(WeiNormanExp<double>(order), ray, mesh, "wei_norman_exp", series));
      }
    }
    for (const double tolerance : {1e-3, 1e-6, 1e-9}) {
      if (quick && tolerance < 1e-6) break;
      const std::string effort = fmt::format("tol={:g}", tolerance);
      chart.points.push_back(bench.value_point(OdeOperator(tolerance), ray, uniform_mesh(2, bench.column->breaks),
                                               "ode_operator", effort));
      chart.points.push_back(bench.value_point(OdeScalar<double>(tolerance), ray, uniform_mesh(2, bench.column->breaks),
                                               "ode_scalar", effort));
    }
  }
  if (!quick) measure_frames(chart, say);
  return chart;
}

}  // namespace birefit
