// A droplet in its host: every pixel's ray refracts at the sphere, crosses the droplet on a straight chord, refracts
// again, and is traced back to the mid plane, where the microscope is focused.

#include <algorithm>
#include <array>
#include <cmath>

#include "medium/build.h"
#include "render/droplet.h"
#include "render/pixel_model.h"
#include "transport/method.h"

namespace birefit {

// The geometry depends only on m = n_host / n_o: with psi the angle of incidence on the sphere, sin psi' = m sin psi,
// delta = psi - psi', the ray leaves turned by 2 delta towards the axis and its backward extension meets the mid plane
// at rho = R sin psi / cos 2 delta.
RimTable::RimTable(double index_ratio, double host_index, double objective_na) : ratio_(index_ratio) {
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
  rho_max_ = rho_over_radius(psi_max_);
  // psi against t = sqrt(1 - rho / rho_max): smooth through the rim, where rho(psi) has its square-root end.
  // Newton from the neighbour before; rho(psi) is monotone, and what little error is left is Newton's again in trace().
  psi_[0] = psi_max_;
  double psi = psi_max_;
  for (int i = 1; i < kNodes; ++i) {
    const double t = static_cast<double>(i) / kNodes;
    const double target = rho_max_ * (1 - t * t);
    psi = std::max(psi - (i == 1 ? psi_max_ * 0.5 / kNodes : psi_[static_cast<std::size_t>(i - 2)] - psi), 0.5 * psi);
    for (int k = 0; k < 6; ++k) {
      const double s1 = std::sin(psi), c1 = std::cos(psi), s2 = ratio_ * s1, c2 = std::sqrt(std::max(1e-14, 1 - s2 * s2));
      const double sd = s1 * c2 - c1 * s2, cd = c1 * c2 + s1 * s2, c = 1 - 2 * sd * sd;
      const double slope = c1 / c + 4 * s1 * sd * cd * (1 - ratio_ * c1 / c2) / (c * c);
      const double change = (s1 / c - target) / slope;
      psi = std::clamp(psi - change, 0.5 * psi, psi_[static_cast<std::size_t>(i - 1)]);
      if (std::abs(change) < 1e-9) break;
    }
    psi_[static_cast<std::size_t>(i)] = psi;
  }
  psi_[kNodes] = 0;
}

double RimTable::rho_over_radius(double psi) const {
  const double delta = psi - std::asin(std::min(1.0, ratio_ * std::sin(psi)));
  return std::sin(psi) / std::cos(2 * delta);
}

double RimTable::psi_at(double rho_over_radius) const {
  const double t = std::sqrt(std::max(0.0, 1 - rho_over_radius / rho_max_)) * kNodes;
  const int i = std::min(static_cast<int>(t), kNodes - 1);
  const double f = t - i;
  const std::size_t k = static_cast<std::size_t>(i);
  return psi_[k] * (1 - f) + psi_[k + 1] * f;
}

template <class S>
DropletRay<S> trace(const DropletOptics<S>& o, const RimTable& rim, const S& rho_um) {
  using P = PlainOf<S>;
  // The table's linear interpolation is within 1e-5 rad, so one Newton step leaves 1e-10.
  constexpr int kNewtonSteps = 1;
  P start;
  {
    const P scaled = plain(rho_um) * inverse(plain(o.radius_um));
    if constexpr (kLanesOf<S> == 1) {
      start = rim.psi_at(scaled);
    } else {
      alignas(64) double lanes[kLanes];
      scaled.store_aligned(lanes);
      for (double& x : lanes) x = rim.psi_at(x);
      start = Pack::load_aligned(lanes);
    }
  }
  // No step leaves the accepted interval: at its end the intensity vanishes.
  const P limit(rim.psi_max());
  DropletRay<S> ray;
  const auto geometry = [&](auto psi, auto ratio, auto radius, auto& r) {
    using T = decltype(psi);
    sin_cos(psi, r.sin_out, r.cos_out);
    r.sin_in = ratio * r.sin_out;
    r.cos_in = root(max_of(T(1.0) - r.sin_in * r.sin_in, T(1e-14)));
    r.sin_deflection = r.sin_out * r.cos_in - r.cos_out * r.sin_in;
    r.cos_deflection = r.cos_out * r.cos_in + r.sin_out * r.sin_in;
    r.cos_twice = 1.0 - 2.0 * r.sin_deflection * r.sin_deflection;
    const T sin_twice = 2.0 * r.sin_deflection * r.cos_deflection;
    const T secant = inverse(r.cos_twice);
    r.rho_um = radius * r.sin_out * secant;
    // d rho / d psi
    r.slope_um = radius * secant *
                 (r.cos_out + 2.0 * r.sin_out * sin_twice * secant * (1.0 - ratio * r.cos_out * inverse(r.cos_in)));
  };
  const P ratio = plain(o.ratio), radius = plain(o.radius_um);
  for (int i = 0; i < kNewtonSteps; ++i) {
    DropletRay<P> r;
    geometry(start, ratio, radius, r);
    start = start - (r.rho_um - plain(rho_um)) * inverse(r.slope_um);
    start = min_of(max_of(start, P(0.0)), limit);
  }
  S psi(start);
  if constexpr (ScalarTraits<S>::derivatives > 0) {
    // d psi = (d rho_wanted - d rho(psi; parameters)) / slope: implicit function theorem.
    DropletRay<S> first;
    geometry(S(start), o.ratio, o.radius_um, first);
    const P inverse_slope = inverse(plain(first.slope_um));
    for (int j = 0; j < ScalarTraits<S>::derivatives; ++j)
      psi.d[j] = (rho_um.d[j] - first.rho_um.d[j]) * inverse_slope;
  }
  geometry(psi, o.ratio, o.radius_um, ray);
  return ray;
}

template <class S>
DropletOptics<S> droplet_optics(const Scene& scene, const Values<S>& value) {
  const Droplet& droplet = std::get<Droplet>(scene.sample);
  const Indices<S> n = material_indices<S>(scene.material, value);
  DropletOptics<S> o;
  o.radius_um = 0.5 * value(droplet.diameter_um);
  o.n_o = n.ordinary;
  o.n_e = n.extraordinary;
  o.n_host = value(scene.surround_index);
  o.ratio = o.n_host / o.n_o;
  o.k0 = wavenumber_per_um(scene, value);
  o.twist_rad = value.radians(droplet.director.twist_deg);
  o.continuity = scene.ceiling == Ceiling::e_only ? Continuity::e_only : Continuity::e_and_h;
  return o;
}

template <class S>
Su2<S> droplet_retarder(const DropletOptics<S>& o, const DropletRay<S>& r, const TransportMethod<S>& method,
                        const Mesh& mesh, bool twisted) {
  const Chord<S> chord(o.radius_um * r.sin_in, o.radius_um * r.cos_in, o.radius_um);
  const Ray<S> light{o.k0, S(0.0), S(0.0), o.continuity};
  const S eo = o.n_o * o.n_o, ee = o.n_e * o.n_e;
  if (!twisted) {
    LawColumn<S, RadialLaw<S>> column(RadialLaw<S>{chord, eo, ee});
    column.planar = true;
    return method.retarder(column, light, mesh);
  }
  const LawColumn<S, TwistedRadialLaw<S>> column(
      TwistedRadialLaw<S>{chord, r.sin_deflection, r.cos_deflection, o.twist_rad, eo, ee});
  return method.retarder(column, light, mesh);
}

template <class S>
Mat2<S> droplet_jones(const DropletOptics<S>& o, const DropletRay<S>& r, const TransportMethod<S>& method,
                      const Mesh& mesh, bool twisted) {
  Mat2<S> jones = matrix(droplet_retarder(o, r, method, mesh, twisted));
  if (o.continuity == Continuity::e_and_h) {
    // Flux transmissions 4 Y1 Y2 / (Y1 + Y2)^2 of the sphere's surface, the same at both ends; the director is normal
    // to the surface, so s is ordinary and p sees q_e = (n_o/n_e) sqrt(n_e^2 - kappa^2), Y = n_o^2 / q_e.
    const S s1 = o.n_host * r.cos_out, s2 = o.n_o * r.cos_in;
    const S kappa = o.n_host * r.sin_out;
    const S p1 = o.n_host * inverse(r.cos_out), p2 = o.n_o * o.n_e * inverse_root(o.n_e * o.n_e - kappa * kappa);
    const S sum_s = s1 + s2, sum_p = p1 + p2;
    const S over_s = inverse(sum_s), over_p = inverse(sum_p);
    const S t_s = 4.0 * s1 * s2 * over_s * over_s, t_p = 4.0 * p1 * p2 * over_p * over_p;
    const S t_sp = root(t_s * t_p);
    jones = {t_p * jones.a, t_sp * jones.b, t_sp * jones.c, t_s * jones.d};
  }
  return jones;
}

namespace {

template <class S>
class DropletModel final : public PixelModel<S> {
 public:
  using P = PlainOf<S>;
  DropletModel(const Scene& scene, const RenderPlan& plan, const Values<S>& value)
      : optics_(droplet_optics(scene, value)),
        rim_(lane(plain(optics_.ratio), 0), lane(plain(optics_.n_host), 0), scene.microscope.objective_na),
        method_(transport_method<S>(plan.method)),
        mesh_(plan.mesh.empty() ? uniform_mesh(plan.steps) : plan.mesh),
        twisted_(static_cast<bool>(std::get<Droplet>(scene.sample).director.twist_deg)),
        aplanatic_(scene.microscope.aplanatic),
        polarizers_(polarizers(scene, value)),
        pixel_um_(scene.view.pixel_size_um),
        center_x_(value(scene.view.center_x_px)),
        center_y_(value(scene.view.center_y_px)) {
    const S along = polarizers_.px * polarizers_.ax + polarizers_.py * polarizers_.ay;
    open_ = along * along;
    rim_um_ = optics_.radius_um * rim_.rho_max();
  }

  S intensity(const P& column, const P& row) const override {
    const S x = (S(column) - center_x_) * pixel_um_, y = (center_y_ - S(row)) * pixel_um_;
    const S rho2 = x * x + y * y + S(1e-18);
    const S inverse_rho = inverse_root(rho2);
    const S rho = rho2 * inverse_rho;
    // Light that passes beside the droplet; the edge is averaged over a pixel.
    const S coverage = min_of(max_of((rho - optics_.radius_um) * (1 / pixel_um_) + 0.5, S(0.0)), S(1.0));
    const S beside = open_ * coverage;
    const P edge = plain(rim_um_) * P(1 - 1e-12);
    const auto inside = plain(rho) < edge;
    if (none(inside)) return beside;
    const S radius = select(inside, rho, S(plain(rim_um_) * P(0.5)));
    const DropletRay<S> ray = trace(optics_, rim_, radius);
    const Mat2<S> jones = droplet_jones(optics_, ray, method_, mesh_, twisted_);
    const S cr = x * inverse_rho, sr = y * inverse_rho;
    const S p_r = polarizers_.px * cr + polarizers_.py * sr, p_f = polarizers_.py * cr - polarizers_.px * sr;
    S a_r = polarizers_.ax * cr + polarizers_.ay * sr;
    const S a_f = polarizers_.ay * cr - polarizers_.ax * sr;
    // Ray tube: flux through the mid plane is b db / (rho drho) of the incident, |E|^2 = flux / cos(2 delta).
    S tube = optics_.radius_um * ray.cos_out * ray.cos_twice * inverse(ray.slope_um);
    if (!aplanatic_) {
      a_r = a_r * ray.cos_twice;  // the transverse part of the p field
      tube = tube * inverse(ray.cos_twice);
    }
    const Complex<S> field = a_r * (p_r * jones.a + p_f * jones.b) + a_f * (p_r * jones.c + p_f * jones.d);
    return beside + select(inside, tube * norm(field), S(0.0));
  }

 private:
  static bool none(bool inside) { return !inside; }
  static bool none(const Pack::batch_bool_type& inside) { return xsimd::none(inside); }

  DropletOptics<S> optics_;
  RimTable rim_;
  const TransportMethod<S>& method_;
  Mesh mesh_;
  bool twisted_, aplanatic_;
  Polarizers<S> polarizers_;
  double pixel_um_;
  S center_x_, center_y_, open_, rim_um_;
};

}  // namespace

template <class S>
std::unique_ptr<PixelModel<S>> make_droplet_model(const Scene& scene, const RenderPlan& plan, const Values<S>& value) {
  return std::make_unique<DropletModel<S>>(scene, plan, value);
}
#define BIREFIT_INSTANTIATE(S)                                                                                       \
  template std::unique_ptr<PixelModel<S>> make_droplet_model<S>(const Scene&, const RenderPlan&, const Values<S>&);  \
  template DropletOptics<S> droplet_optics<S>(const Scene&, const Values<S>&);                                       \
  template DropletRay<S> trace<S>(const DropletOptics<S>&, const RimTable&, const S&);                               \
  template Su2<S> droplet_retarder<S>(const DropletOptics<S>&, const DropletRay<S>&, const TransportMethod<S>&,      \
                                      const Mesh&, bool);                                                            \
  template Mat2<S> droplet_jones<S>(const DropletOptics<S>&, const DropletRay<S>&, const TransportMethod<S>&,        \
                                    const Mesh&, bool);
BIREFIT_FOR_EACH_SCALAR(BIREFIT_INSTANTIATE)

}  // namespace birefit
