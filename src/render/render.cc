#include "birefit/render.h"

#include <algorithm>
#include <array>
#include <cmath>

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

/// Writes the lanes of value and derivatives to planes[0], planes[1..N] at `index`, `count` lanes.
template <class S>
void store(const S& value, std::vector<Image>& planes, std::size_t index, int first_lane, int count) {
  for (int k = 0; k < count; ++k) {
    planes[0].values()[index + static_cast<std::size_t>(k)] = lane(plain(value), first_lane + k);
    constexpr std::size_t kDerivatives = ScalarTraits<S>::derivatives;
    if constexpr (kDerivatives > 0)
      for (std::size_t j = 0; j < std::min(kDerivatives, planes.size() - 1); ++j)
        planes[j + 1].values()[index + static_cast<std::size_t>(k)] = lane(value.d[j], first_lane + k);
  }
}

/// planes: value and as many derivatives as asked (at most those of S).
template <class S>
std::vector<Image> render_planes(const Scene& scene, const RenderPlan& plan, const Theta& theta,
                                 const std::vector<int>& active, int threads) {
  const Values<S> value(theta, active);
  const std::unique_ptr<PixelModel<S>> model = make_pixel_model<S>(scene, plan, value);
  const int w = scene.view.width, h = scene.view.height;
  constexpr int kStep = kLanesOf<S>;
  Grid<std::uint8_t> samples(w + 2, h + 2);
  parallel_for(h + 2, threads, [&](int r) {
    for (int c = 0; c < w + 2; ++c) samples(c, r) = static_cast<std::uint8_t>(samples_at(plan, c - 1.0, r - 1.0));
  });
  // Point values on the image and a rim of one pixel, wherever a one-sample pixel or its neighbour needs them.
  std::vector<Image> points(active.size() + 1, Image(w + 2, h + 2));
  parallel_for(h + 2, threads, [&](int r) {
    for (int c0 = 0; c0 < w + 2; c0 += kStep) {
      const int count = std::min(kStep, w + 2 - c0);
      bool needed = false;
      for (int c = c0; c < c0 + count && !needed; ++c)
        needed = samples(c, r) == 1 || (c > 0 && samples(c - 1, r) == 1) || (c < w + 1 && samples(c + 1, r) == 1) ||
                 (r > 0 && samples(c, r - 1) == 1) || (r < h + 1 && samples(c, r + 1) == 1);
      if (!needed) continue;
      double columns[kLanes];
      for (int k = 0; k < kLanes; ++k) columns[k] = std::min(c0 + k, w + 1) - 1.0;
      const S v = model->intensity(load_lanes<PlainOf<S>>(columns), PlainOf<S>(r - 1.0));
      store(v, points, static_cast<std::size_t>(r) * (w + 2) + c0, 0, count);
    }
  });
  std::vector<Image> planes(active.size() + 1, Image(w, h));
  parallel_for(h, threads, [&](int r) {
    for (std::size_t p = 0; p < planes.size(); ++p) {
      const double *up = points[p].row(r) + 1, *here = points[p].row(r + 1) + 1, *down = points[p].row(r + 2) + 1;
      double* out = planes[p].row(r);
      // Mean over a unit square of a smooth function: f + laplacian f / 24, here by the five-point formula.
      for (int c = 0; c < w; ++c)
        out[c] = here[c] + (here[c - 1] + here[c + 1] + up[c] + down[c] - 4 * here[c]) * (1.0 / 24);
    }
    for (int c0 = 0; c0 < w; c0 += kStep) {
      const int count = std::min(kStep, w - c0);
      int most = 1;
      for (int c = c0; c < c0 + count; ++c) most = std::max<int>(most, samples(c + 1, r + 1));
      if (most == 1) continue;
      double columns[kLanes];
      for (int k = 0; k < kLanes; ++k) columns[k] = std::min(c0 + k, w - 1);
      const S v = mean_over_pixel(*model, load_lanes<PlainOf<S>>(columns), PlainOf<S>(static_cast<double>(r)), most);
      for (int k = 0; k < count; ++k)
        if (samples(c0 + k + 1, r + 1) > 1) store(v, planes, static_cast<std::size_t>(r) * w + c0 + k, k, 1);
    }
  });
  return planes;
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
      int most = 2;  // the point value alone is no pixel mean
      for (int k = 0; k < kLanes; ++k) {
        const auto& pixel = pixels[static_cast<std::size_t>(std::min(g * kStep + k, n - 1))];
        columns[k] = pixel[0];
        rows[k] = pixel[1];
        if (k < kStep) most = std::max(most, samples_at(plan, pixel[0], pixel[1]));
      }
      const S v = mean_over_pixel(*model, load_lanes<PlainOf<S>>(columns), load_lanes<PlainOf<S>>(rows), most);
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
