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
RimTable::RimTable(double index_ratio, double host_index, double objective_na) : ratio_(index_ratio), objective_na_(objective_na) {
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
  const double sin_in = ratio_ * std::sin(psi_max_);
  end_ = inside == std::numbers::pi / 2 - kGrazing ? End::grazing
         : sin_in > 1 - 1e-9                       ? End::total_reflection
                                                   : End::turned;
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
  // The table is within 5e-5 rad: one Newton step leaves some 1e-9, two leave rounding.
  constexpr int kNewtonSteps = 2;
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
    // Beyond kappa = n_e (n_e below the host's index) p is totally reflected: p2 grows without end and t_p vanishes.
    const S inside = max_of(o.n_e * o.n_e - kappa * kappa, S(1e-14));
    const S p1 = o.n_host * inverse(r.cos_out), p2 = o.n_o * o.n_e * inverse_root(inside);
    const S sum_s = s1 + s2, sum_p = p1 + p2;
    const S over_s = inverse(sum_s), over_p = inverse(sum_p);
    const S t_s = 4.0 * s1 * s2 * over_s * over_s, t_p = 4.0 * p1 * p2 * over_p * over_p;
    const S t_sp = root(t_s * t_p);
    jones = {t_p * jones.a, t_sp * jones.b, t_sp * jones.c, t_s * jones.d};
  }
  return jones;
}

namespace {

/// The image is symmetric up to the turn of the polarizers: with a_r, a_f (p_r, p_f) the analyser's (polarizer's)
/// components along the radius and around the axis,
///   I = sum of tube |field|^2 terms = sum_k basis_k(a_r, a_f, p_r, p_f) f_k(rho),
/// nine terms, three when the transport is diagonal.
constexpr int kTerms = 9, kDiagonalTerms = 3;
template <class S>
void intensity_terms(const Mat2<S>& j, const S& tube, bool diagonal, S* f) {
  const auto cross = [](const Complex<S>& a, const Complex<S>& b) { return a.re * b.re + a.im * b.im; };
  f[0] = tube * norm(j.a);
  f[1] = tube * norm(j.d);
  f[2] = 2.0 * tube * cross(j.a, j.d);
  if (diagonal) return;
  f[2] = f[2] + 2.0 * tube * cross(j.b, j.c);
  f[3] = tube * norm(j.b);
  f[4] = tube * norm(j.c);
  f[5] = 2.0 * tube * cross(j.a, j.b);
  f[6] = 2.0 * tube * cross(j.c, j.d);
  f[7] = 2.0 * tube * cross(j.a, j.c);
  f[8] = 2.0 * tube * cross(j.b, j.d);
}
template <class S>
void intensity_basis(const S& a_r, const S& a_f, const S& p_r, const S& p_f, bool diagonal, S* basis) {
  const S arf = a_r * a_f, prf = p_r * p_f;
  if (diagonal) {
    const S r = a_r * p_r, f = a_f * p_f;
    basis[0] = r * r, basis[1] = f * f, basis[2] = r * f;
    return;
  }
  const S arr = a_r * a_r, aff = a_f * a_f, prr = p_r * p_r, pff = p_f * p_f;
  basis[0] = arr * prr, basis[1] = aff * pff, basis[2] = arf * prf;
  basis[3] = arr * pff, basis[4] = aff * prr, basis[5] = arr * prf;
  basis[6] = aff * prf, basis[7] = arf * prr, basis[8] = arf * pff;
}

}  // namespace

template <class S>
DropletImage<S>::DropletImage(const Scene& scene, const RenderPlan& plan, const Values<S>& value)
    : optics_(droplet_optics(scene, value)),
      rim_(lane(plain(optics_.ratio), 0), lane(plain(optics_.n_host), 0), scene.microscope.objective_na),
      method_(transport_method<S>(plan.method)),
      mesh_(plan.mesh.empty() ? uniform_mesh(plan.steps) : plan.mesh),
      twisted_(static_cast<bool>(std::get<Droplet>(scene.sample).director.twist_deg)),
      aplanatic_(scene.microscope.aplanatic),
      polarizers_(polarizers(scene, value)),
      pixel_um_(scene.view.pixel_size_um),
      center_x_(value(scene.view.center_x_px)),
      center_y_(value(scene.view.center_y_px)),
      edge_um_(optics_.radius_um * rim_edge(rim_, optics_.ratio, optics_.n_host)) {
  const S along = polarizers_.px * polarizers_.ax + polarizers_.py * polarizers_.ay;
  open_ = along * along;
  if (plan.radial_panels > 0)
    table_ = RadialTable<S>(plan.radial_panels, twisted_ ? kTerms : kDiagonalTerms,
                            [this](const P& v, S* out) { terms(S(v), out); });
  tabulated_ = plan.radial_panels > 0;
}

// v = (1 - sqrt(1 - rho/edge))^(1/4): edge - rho is quadratic in v at the rim, where everything is a function of
// sqrt(edge - rho), and rho ~ v^4 at the centre, where a twist leaves rho^2 log rho and the mesh along the chord changes
// its shape at rho ~ 0.003 edge.
template <class S>
void DropletImage<S>::terms(const S& v, S* out) const {
  const S v2 = v * v, w = 1.0 - v2 * v2;
  terms_at(edge_um_ * (1.0 - w * w), out);
}

template <class S>
void DropletImage<S>::terms_at(const S& rho_um, S* out) const {
  const DropletRay<S> ray = trace(optics_, rim_, rho_um);
  Mat2<S> jones = droplet_jones(optics_, ray, method_, mesh_, twisted_);
  // Ray tube: flux through the mid plane is b db / (rho drho) of the incident, |E|^2 = flux / cos(2 delta).
  S tube = optics_.radius_um * ray.cos_out * ray.cos_twice * inverse(ray.slope_um);
  if (!aplanatic_) {  // only the transverse part of the p field
    jones.a = ray.cos_twice * jones.a;
    jones.b = ray.cos_twice * jones.b;
    tube = tube * inverse(ray.cos_twice);
  }
  intensity_terms(jones, tube, !twisted_, out);
}

template <class S>
S DropletImage<S>::intensity(const P& column, const P& row) const {
  const S x = (S(column) - center_x_) * pixel_um_, y = (center_y_ - S(row)) * pixel_um_;
  const S rho2 = x * x + y * y + S(1e-18);
  const S inverse_rho = inverse_root(rho2);
  const S rho = rho2 * inverse_rho;
  const P edge = plain(edge_um_) * P(1 - 1e-12);
  const auto inside = plain(rho) < edge;
  S beside(0.0);
  if (!all(plain(rho) < plain(optics_.radius_um) - P(pixel_um_)))  // light that passes by; averaged over a pixel
    beside = open_ * min_of(max_of((rho - optics_.radius_um) * (1 / pixel_um_) + 0.5, S(0.0)), S(1.0));
  if (none(inside)) return beside;
  const S cr = x * inverse_rho, sr = y * inverse_rho;
  const S p_r = polarizers_.px * cr + polarizers_.py * sr, p_f = polarizers_.py * cr - polarizers_.px * sr;
  const S a_r = polarizers_.ax * cr + polarizers_.ay * sr, a_f = polarizers_.ay * cr - polarizers_.ax * sr;
  S basis[kTerms];
  intensity_basis(a_r, a_f, p_r, p_f, !twisted_, basis);
  S through;
  if (tabulated_) {
    const S fraction = select(inside, rho * inverse(edge_um_), S(0.5));
    through = tabulated_sum(root(root(fraction * inverse(1.0 + root(1.0 - fraction)))), basis);
  } else {
    S f[kTerms];
    terms_at(select(inside, rho, S(plain(edge_um_) * P(0.5))), f);
    through = basis[0] * f[0];
    for (int k = 1; k < number_of_terms(); ++k) through = through + basis[k] * f[k];
  }
  return beside + select(inside, through, S(0.0));
}

template <class S>
std::unique_ptr<PixelModel<S>> make_droplet_model(const Scene& scene, const RenderPlan& plan, const Values<S>& value) {
  return std::make_unique<DropletImage<S>>(scene, plan, value);
}
#define BIREFIT_INSTANTIATE(S)                                                                                       \
  template class DropletImage<S>;                                                                                    \
  template std::unique_ptr<PixelModel<S>> make_droplet_model<S>(const Scene&, const RenderPlan&, const Values<S>&);  \
  template DropletOptics<S> droplet_optics<S>(const Scene&, const Values<S>&);                                       \
  template DropletRay<S> trace<S>(const DropletOptics<S>&, const RimTable&, const S&);                               \
  template Su2<S> droplet_retarder<S>(const DropletOptics<S>&, const DropletRay<S>&, const TransportMethod<S>&,      \
                                      const Mesh&, bool);                                                            \
  template Mat2<S> droplet_jones<S>(const DropletOptics<S>&, const DropletRay<S>&, const TransportMethod<S>&,        \
                                    const Mesh&, bool);
BIREFIT_FOR_EACH_SCALAR(BIREFIT_INSTANTIATE)

}  // namespace birefit
