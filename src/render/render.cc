#include "birefit/render.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "core/threads.h"
#include "render/droplet.h"
#include "render/pixel_model.h"
#include "render/planar.h"
#include "render/sampling.h"

namespace birefit {

template <class S>
std::unique_ptr<PixelModel<S>> make_pixel_model(const Scene& scene, const RenderPlan& plan, const Values<S>& value) {
  if (std::holds_alternative<Droplet>(scene.sample)) return make_droplet_model(scene, plan, value);
  if (std::holds_alternative<Crystal>(scene.sample)) return make_crystal_model(scene, plan, value);
  return make_planar_model(scene, plan, value);
}

namespace {

int samples_at(const RenderPlan& plan, double column, double row) {
  if (plan.samples.empty()) return 1;
  const double dx = column - plan.sampling_center_x_px, dy = row - plan.sampling_center_y_px;
  const std::size_t bin = static_cast<std::size_t>(std::sqrt(dx * dx + dy * dy) / plan.sampling_bin_px);
  return plan.samples[std::min(bin, plan.samples.size() - 1)];
}

const PixelRule& rule_of(int n) {
  static const std::array<PixelRule, 9> rules = [] {
    std::array<PixelRule, 9> r;
    for (int i = 1; i <= 8; ++i) r[static_cast<std::size_t>(i)] = pixel_rule(i);
    return r;
  }();
  return rules[static_cast<std::size_t>(n)];
}

template <class P>
P load_lanes(const double* x) {
  if constexpr (std::is_same_v<P, Pack>)
    return Pack::load_unaligned(x);
  else
    return *x;
}

constexpr std::array<double, kLanes> kCount = [] {
  std::array<double, kLanes> a{};
  for (int k = 0; k < kLanes; ++k) a[static_cast<std::size_t>(k)] = k;
  return a;
}();

template <class S>
S mean_over_pixel(const PixelModel<S>& model, const PlainOf<S>& column, const PlainOf<S>& row, int n) {
  const PixelRule& rule = rule_of(n);
  S sum(0.0);
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const std::size_t a = static_cast<std::size_t>(i), b = static_cast<std::size_t>(j);
      sum = sum + (rule.w[a] * rule.w[b]) * model.intensity(column + PlainOf<S>(rule.x[a]), row + PlainOf<S>(rule.x[b]));
    }
  return sum;
}

/// Writes lanes [first, first + count) of value and derivatives to out[0], out[1..N].
template <class S, std::size_t N>
BIREFIT_INLINE void store(const S& value, const std::array<double*, N>& out, int planes, int first, int count) {
  const auto put = [&](const PlainOf<S>& x, double* to) {
    if constexpr (kLanesOf<S> > 1) {
      if (first == 0 && count == kLanes) {
        x.store_unaligned(to);
        return;
      }
    }
    for (int k = 0; k < count; ++k) to[k] = lane(x, first + k);
  };
  put(plain(value), out[0]);
  if constexpr (ScalarTraits<S>::derivatives > 0)
    for (int j = 1; j < planes; ++j) put(value.d[static_cast<std::size_t>(j - 1)], out[static_cast<std::size_t>(j)]);
}

/// samples_at() for the whole picture and a rim of one pixel around it. Rings of equal samples are painted row by row
/// from the inside out; a root a ring and row instead of one a pixel.
void fill_samples(const RenderPlan& plan, Grid<std::uint8_t>& samples) {
  const int w = samples.width();
  const std::uint8_t inner = plan.samples.empty() ? 1 : static_cast<std::uint8_t>(plan.samples[0]);
  for (int r = 0; r < samples.height(); ++r) {
    std::uint8_t* out = samples.row(r);
    std::fill(out, out + w, inner);
    const double dy = r - 1.0 - plan.sampling_center_y_px, middle = plan.sampling_center_x_px + 1;
    for (std::size_t i = 1; i < plan.samples.size(); ++i) {
      if (plan.samples[i] == plan.samples[i - 1]) continue;
      const double radius = static_cast<double>(i) * plan.sampling_bin_px, square = radius * radius - dy * dy;
      const double half = square > 0 ? std::sqrt(square) : 0;
      const int left = static_cast<int>(std::clamp(std::floor(middle - half) + 1, 0.0, static_cast<double>(w)));
      const int right = static_cast<int>(std::clamp(std::ceil(middle + half), 0.0, static_cast<double>(w)));
      const std::uint8_t n = static_cast<std::uint8_t>(plan.samples[i]);
      std::fill(out, out + std::min(left, right), n);
      std::fill(out + right, out + w, n);
    }
  }
}

/// Which points of a row are needed: one-sample pixels and their eight neighbours. `row` on a picture with a rim.
struct NeededPoints {
  bool all = false;
  std::vector<std::uint8_t> flags;  ///< with one place to the left and right
  void find(const Grid<std::uint8_t>& samples, int row) {
    const int w = samples.width();
    const std::uint8_t* here = samples.row(row);
    all = std::accumulate(here, here + w, 0) == w;
    if (all) return;
    flags.assign(static_cast<std::size_t>(w) + 2, 0);
    for (int r = std::max(row - 1, 0); r <= std::min(row + 1, samples.height() - 1); ++r)
      for (int c = 0; c < w; ++c)
        if (samples(c, r) == 1) std::fill_n(flags.data() + c, 3, std::uint8_t{1});
  }
  bool any(int first, int count) const {
    if (all) return true;
    const auto from = flags.begin() + first + 1;
    return std::find(from, from + count, 1) != from + count;
  }
};

/// Point values on the image and a rim of one pixel: rows(field * planes + plane, row), rows of at least width + 2 +
/// kLanes readable places. One field, the intensity, or with plan.fringe_means the three of a FringePoint.
class PointPlanes {
 public:
  PointPlanes(int width, int height, int planes) : wide_(width + 2), plane_(static_cast<std::size_t>(width + 2) * static_cast<std::size_t>(height + 2)) {
    // Fresh memory costs as much as the image itself: it stays with the thread.
    thread_local std::vector<double> memory;
    memory.resize(std::max(memory.size(), plane_ * static_cast<std::size_t>(planes) + kLanes));
    data_ = memory.data();
  }
  double* row(int plane, int r) const {
    return data_ + static_cast<std::size_t>(plane) * plane_ + static_cast<std::size_t>(r) * static_cast<std::size_t>(wide_);
  }

 private:
  int wide_;
  std::size_t plane_;
  double* data_;
};

template <class S>
S load(const PointPlanes& points, int first_plane, int row, int column) {
  S v(load_lanes<PlainOf<S>>(points.row(first_plane, row) + column));
  if constexpr (ScalarTraits<S>::derivatives > 0)
    for (int j = 0; j < ScalarTraits<S>::derivatives; ++j)
      v.d[static_cast<std::size_t>(j)] = load_lanes<PlainOf<S>>(points.row(first_plane + 1 + j, row) + column);
  return v;
}

/// planes: value and as many derivatives as asked (at most those of S).
template <class S>
std::vector<Image> render_planes(const Scene& scene, const RenderPlan& plan, const Theta& theta,
                                 const std::vector<int>& active, int threads) {
  const Values<S> value(theta, active);
  const std::unique_ptr<PixelModel<S>> model = make_pixel_model<S>(scene, plan, value);
  const int w = scene.view.width, h = scene.view.height, wide = w + 2, planes = static_cast<int>(active.size()) + 1;
  constexpr int kStep = kLanesOf<S>, kPlanes = 1 + ScalarTraits<S>::derivatives;
  using Targets = std::array<double*, static_cast<std::size_t>(kPlanes)>;
  thread_local Grid<std::uint8_t> samples_of_thread;
  Grid<std::uint8_t>& samples = samples_of_thread;  // the workers' own thread_locals are others
  if (samples.width() != wide || samples.height() != h + 2) samples = Grid<std::uint8_t>(wide, h + 2);
  fill_samples(plan, samples);
  const PointPlanes points(w, h, plan.fringe_means ? 3 * kPlanes : kPlanes);
  parallel_for(h + 2, threads, [&](int r) {
    thread_local NeededPoints needed;
    needed.find(samples, r);
    for (int c0 = 0; c0 < wide; c0 += kStep) {
      const int count = std::min(kStep, wide - c0);
      if (!needed.any(c0, count)) continue;
      const PlainOf<S> column = load_lanes<PlainOf<S>>(kCount.data()) + PlainOf<S>(c0 - 1.0), row(r - 1.0);
      const auto put = [&](const S& v, int field) {
        Targets out;
        for (int p = 0; p < kPlanes; ++p) out[static_cast<std::size_t>(p)] = points.row(field * kPlanes + p, r) + c0;
        store(v, out, kPlanes, 0, count);
      };
      if (plan.fringe_means) {
        const FringePoint<S> v = model->fringe(column, row);
        put(v.mean, 0), put(v.amplitude, 1), put(v.phase, 2);
      } else {
        put(model->intensity(column, row), 0);
      }
    }
  });
  std::vector<Image> images(static_cast<std::size_t>(planes));
  parallel_for(planes, threads, [&](int p) { images[static_cast<std::size_t>(p)] = Image(w, h); });
  parallel_for(h, threads, [&](int r) {
    const auto targets = [&](int column) {
      Targets out{};
      for (std::size_t p = 0; p < images.size(); ++p) out[p] = images[p].row(r) + column;
      return out;
    };
    if (plan.fringe_means) {
      for (int c0 = 0; c0 < w; c0 += kStep) {
        FringePoint<S> p[3][3];
        for (int j = 0; j < 3; ++j)
          for (int i = 0; i < 3; ++i)
            p[j][i] = {load<S>(points, 0, r + j, c0 + i), load<S>(points, kPlanes, r + j, c0 + i),
                       load<S>(points, 2 * kPlanes, r + j, c0 + i)};
        store(fringe_mean(p), targets(c0), planes, 0, std::min(kStep, w - c0));
      }
    } else {
      for (int p = 0; p < planes; ++p) {
        const double *up = points.row(p, r) + 1, *here = points.row(p, r + 1) + 1, *down = points.row(p, r + 2) + 1;
        double* out = images[static_cast<std::size_t>(p)].row(r);
        // Mean over a unit square of a smooth function: f + laplacian f / 24, here by the five-point formula.
        for (int c = 0; c < w; ++c)
          out[c] = here[c] + (here[c - 1] + here[c + 1] + up[c] + down[c] - 4 * here[c]) * (1.0 / 24);
      }
    }
    // Pixels of several samples, packed into lanes by their number.
    const std::uint8_t* n = samples.row(r + 1) + 1;
    std::array<std::array<int, kLanes>, 9> waiting;
    std::array<int, 9> count{};
    const auto flush = [&](std::size_t most) {
      double columns[kLanes];
      for (int k = 0; k < kStep; ++k) columns[k] = waiting[most][static_cast<std::size_t>(std::min(k, count[most] - 1))];
      const S v = mean_over_pixel(*model, load_lanes<PlainOf<S>>(columns), PlainOf<S>(static_cast<double>(r)), static_cast<int>(most));
      for (int k = 0; k < count[most]; ++k) store(v, targets(waiting[most][static_cast<std::size_t>(k)]), planes, k, 1);
      count[most] = 0;
    };
    for (int c = 0; c < w; ++c) {
      if (n[c] == 1) continue;
      const std::size_t most = n[c];
      waiting[most][static_cast<std::size_t>(count[most]++)] = c;
      if (count[most] == kStep) flush(most);
    }
    for (std::size_t most = 2; most < 9; ++most)
      if (count[most] > 0) flush(most);
  });
  return images;
}

template <class S>
void render_list(const Scene& scene, const RenderPlan& plan, const Theta& theta,
                 const std::vector<std::array<int, 2>>& pixels, const std::vector<int>& active, int threads,
                 PixelRendering& out, int first_column) {
  const Values<S> value(theta, active);
  const std::unique_ptr<PixelModel<S>> model = make_pixel_model<S>(scene, plan, value);
  const int n = static_cast<int>(pixels.size());
  constexpr int kStep = kLanesOf<S>;
  const int groups = (n + kStep - 1) / kStep;
  parallel_for((groups + 15) / 16, threads, [&](int block) {
    for (int g = 16 * block; g < std::min(groups, 16 * block + 16); ++g) {
      double columns[kLanes], rows[kLanes];
      int most = 1;
      for (int k = 0; k < kLanes; ++k) {
        const auto& pixel = pixels[static_cast<std::size_t>(std::min(g * kStep + k, n - 1))];
        columns[k] = pixel[0];
        rows[k] = pixel[1];
        if (k < kStep) most = std::max(most, samples_at(plan, pixel[0], pixel[1]));
      }
      const PlainOf<S> column = load_lanes<PlainOf<S>>(columns), row = load_lanes<PlainOf<S>>(rows);
      S v;
      if (most == 1 && plan.fringe_means) {
        FringePoint<S> p[3][3];
        for (int j = 0; j < 3; ++j)
          for (int i = 0; i < 3; ++i) p[j][i] = model->fringe(column + PlainOf<S>(i - 1.0), row + PlainOf<S>(j - 1.0));
        v = fringe_mean(p);
      } else {
        v = mean_over_pixel(*model, column, row, std::max(most, 2));  // the point value alone is no pixel mean
      }
      for (int k = 0; k < std::min(kStep, n - g * kStep); ++k) {
        out.intensity(g * kStep + k) = lane(plain(v), k);
        if constexpr (ScalarTraits<S>::derivatives > 0)
          for (std::size_t j = 0; j < active.size(); ++j)
            out.derivatives(g * kStep + k, first_column + static_cast<int>(j)) = lane(v.d[j], k);
      }
    }
  });
}

/// Calls body<S>(chunk, first) for the active parameters in chunks of 4, 2 and 1 derivatives a pass.
template <class Body>
void in_chunks(const std::vector<int>& active, const Body& body) {
  std::size_t first = 0;
  while (first < active.size()) {
    const std::size_t left = active.size() - first;
    const std::size_t take = left >= 3 ? std::min<std::size_t>(left, 4) : left;
    const std::vector<int> chunk(active.begin() + static_cast<long>(first), active.begin() + static_cast<long>(first + take));
    if (take > 2)
      body.template operator()<Dual4>(chunk, static_cast<int>(first));
    else if (take == 2)
      body.template operator()<Dual2>(chunk, static_cast<int>(first));
    else
      body.template operator()<Dual1>(chunk, static_cast<int>(first));
    first += take;
  }
}

}  // namespace

Rendering render(const Scene& scene, const RenderPlan& plan, const Theta& theta, const std::vector<int>& active,
                 int threads) {
  Rendering r;
  if (active.empty()) {
    r.intensity = std::move(render_planes<Pack>(scene, plan, theta, {}, threads)[0]);
    return r;
  }
  in_chunks(active, [&]<class S>(const std::vector<int>& chunk, int) {
    std::vector<Image> planes = render_planes<S>(scene, plan, theta, chunk, threads);
    r.intensity = std::move(planes[0]);
    for (std::size_t j = 1; j < planes.size(); ++j) r.derivatives.push_back(std::move(planes[j]));
  });
  return r;
}

Image render_scalar(const Scene& scene, const RenderPlan& plan, const Theta& theta) {
  return std::move(render_planes<double>(scene, plan, theta, {}, 1)[0]);
}

PixelRendering render_pixels(const Scene& scene, const RenderPlan& plan, const Theta& theta,
                             const std::vector<std::array<int, 2>>& pixels, const std::vector<int>& active,
                             int threads) {
  PixelRendering out;
  out.intensity.resize(static_cast<long>(pixels.size()));
  out.derivatives.resize(static_cast<long>(pixels.size()), static_cast<long>(active.size()));
  if (pixels.empty()) return out;
  if (active.empty())
    render_list<Pack>(scene, plan, theta, pixels, {}, threads, out, 0);
  else
    in_chunks(active, [&]<class S>(const std::vector<int>& chunk, int first) {
      render_list<S>(scene, plan, theta, pixels, chunk, threads, out, first);
    });
  return out;
}

std::vector<JonesRow> jones(const Scene& scene, const RenderPlan& plan, const Theta& theta) {
  const Values<double> value(theta, {});
  const double wavelength_nm = value(scene.microscope.wavelength_nm);
  std::vector<JonesRow> rows;
  // From the lab's x, y to the s, p pair of azimuth a: p = (cos a, sin a), s = (-sin a, cos a).
  const auto add = [&](const Mat2<double>& j, double azimuth_rad, JonesRow row) {
    const auto z = [](const Complex<double>& c) { return std::complex<double>(c.re, c.im); };
    const std::complex<double> m[2][2] = {{z(j.a), z(j.b)}, {z(j.c), z(j.d)}};
    const double p[2] = {std::cos(azimuth_rad), std::sin(azimuth_rad)}, s[2] = {-p[1], p[0]};
    const auto element = [&](const double* out, const double* in) {
      std::complex<double> sum = 0;
      for (int a = 0; a < 2; ++a)
        for (int b = 0; b < 2; ++b) sum += out[a] * m[a][b] * in[b];
      return sum;
    };
    row.wavelength_nm = wavelength_nm;
    row.ss = element(s, s);
    row.ps = element(s, p);
    row.sp = element(p, s);
    row.pp = element(p, p);
    rows.push_back(row);
  };
  if (std::holds_alternative<Slab>(scene.sample)) {
    const PlanarOptics<double> optics = planar_optics(scene, value);
    const TransportMethod<double>& method = transport_method<double>(plan.method);
    for (const Direction& d : scene.microscope.directions) {
      const double theta_rad = d.theta_deg * std::numbers::pi / 180, azimuth = d.azimuth_deg * std::numbers::pi / 180;
      const double kappa = optics.n_host * std::sin(theta_rad);
      const Ray<double> ray{optics.k0, kappa * std::cos(azimuth), kappa * std::sin(azimuth), optics.continuity};
      // Each direction gets its own mesh, unless a number of steps was forced.
      const Mesh mesh = plan.mesh.empty() ? uniform_mesh(plan.steps, optics.column->breaks)
                                          : adapted_mesh(*optics.column, ray, scene.intensity_accuracy / 4);
      const double t = std::tan(theta_rad);
      add(planar_jones(optics, method, mesh, t * std::cos(azimuth), t * std::sin(azimuth)), azimuth,
          {.theta_deg = d.theta_deg, .azimuth_deg = d.azimuth_deg});
    }
    return rows;
  }
  const int w = scene.view.width, h = scene.view.height;
  const Mesh mesh = plan.mesh.empty() ? uniform_mesh(plan.steps) : plan.mesh;
  if (const auto* droplet = std::get_if<Droplet>(&scene.sample)) {
    const DropletOptics<double> optics = droplet_optics(scene, value);
    const RimTable rim(optics.ratio, optics.n_host, scene.microscope.objective_na);
    const TransportMethod<double>& method = transport_method<double>(plan.method);
    for (int r = 0; r < h; ++r)
      for (int c = 0; c < w; ++c) {
        const double x = (c - value(scene.view.center_x_px)) * scene.view.pixel_size_um;
        const double y = (value(scene.view.center_y_px) - r) * scene.view.pixel_size_um;
        const double rho = std::hypot(x, y), azimuth = std::atan2(y, x);
        const JonesRow row{.theta_deg = 0, .azimuth_deg = 0, .row = r, .column = c};
        if (rho >= optics.radius_um * rim.rho_max()) {
          add(Mat2<double>::identity(), 0, row);
          continue;
        }
        // droplet_jones is in (p, s) = (radial, azimuthal): turn it into x, y.
        const DropletRay<double> ray = trace(optics, rim, rho);
        const Mat2<double> local = droplet_jones(optics, ray, method, mesh, static_cast<bool>(droplet->director.twist_deg));
        const double ca = std::cos(azimuth), sa = std::sin(azimuth);
        const Mat2<double> turn{{ca, 0}, {-sa, 0}, {sa, 0}, {ca, 0}}, back{{ca, 0}, {sa, 0}, {-sa, 0}, {ca, 0}};
        add(turn * local * back, 0, row);
      }
    return rows;
  }
  if (std::holds_alternative<Crystal>(scene.sample))
    throw UserError(Where{}, "a crystal scene has no jones table: its retarder is one closed formula per pixel",
                    "use `render`");
  const PlanarOptics<double> optics = planar_optics(scene, value);
  const TransportMethod<double>& method = transport_method<double>(plan.method);
  const auto* plate = std::get_if<Plate>(&scene.sample);
  if (!plate) {
    add(planar_jones(optics, method, mesh, 0.0, 0.0), 0, {});
    return rows;
  }
  const double scale = std::tan(value.radians(plate->half_angle_deg, 15)) * 2 / std::min(w, h);
  for (int r = 0; r < h; ++r)
    for (int c = 0; c < w; ++c) {
      const double tx = (c - value.get(scene.view.center_x_px, 0.5 * (w - 1))) * scale;
      const double ty = (value.get(scene.view.center_y_px, 0.5 * (h - 1)) - r) * scale;
      const double azimuth = std::atan2(ty, tx);
      add(planar_jones(optics, method, mesh, tx, ty), azimuth,
          {.theta_deg = std::atan(std::hypot(tx, ty)) * 180 / std::numbers::pi,
           .azimuth_deg = azimuth * 180 / std::numbers::pi,
           .row = r,
           .column = c});
    }
  return rows;
}

}  // namespace birefit
