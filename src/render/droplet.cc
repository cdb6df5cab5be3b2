// A droplet in its host: every pixel's ray refracts at the sphere, crosses the droplet on a straight chord, refracts
// again, and is traced back to the mid plane, where the microscope is focused.

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "medium/build.h"
#include "render/ball.h"
#include "render/droplet.h"
#include "render/eikonal_image.h"
#include "render/pixel_model.h"
#include "transport/method.h"

namespace birefit {

// The geometry depends only on m = n_host / n_o: with psi the angle of incidence on the sphere, sin psi' = m sin psi,
// delta = psi - psi', the ray leaves turned by 2 delta towards the axis and its backward extension meets the mid plane
// at rho = R sin psi / cos 2 delta.
RimTable::RimTable(double index_ratio, double host_index, double objective_na)
    : ratio_(index_ratio), objective_na_(objective_na) {
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
  table_.rho_max = rho_over_radius(psi_max_);
  const double sin_in = ratio_ * std::sin(psi_max_);
  end_ = inside == std::numbers::pi / 2 - kGrazing ? End::grazing
         : sin_in > 1 - 1e-9                       ? End::total_reflection
                                                   : End::turned;
  // psi against t = sqrt(1 - rho / rho_max): smooth through the rim, where rho(psi) has its square-root end.
  // Newton from the neighbour before; rho(psi) is monotone, and what little error is left is Newton's again in trace().
  constexpr int kNodes = IncidenceTable::kNodes;
  std::array<double, kNodes + 1>& table = table_.psi;
  table[0] = psi_max_;
  double psi = psi_max_;
  for (int i = 1; i < kNodes; ++i) {
    const double t = static_cast<double>(i) / kNodes;
    const double target = table_.rho_max * (1 - t * t);
    psi = std::max(psi - (i == 1 ? psi_max_ * 0.5 / kNodes : table[static_cast<std::size_t>(i - 2)] - psi), 0.5 * psi);
    for (int k = 0; k < 6; ++k) {
      const double s1 = std::sin(psi), c1 = std::cos(psi), s2 = ratio_ * s1,
                   c2 = std::sqrt(std::max(1e-14, 1 - s2 * s2));
      const double sd = s1 * c2 - c1 * s2, cd = c1 * c2 + s1 * s2, c = 1 - 2 * sd * sd;
      const double slope = c1 / c + 4 * s1 * sd * cd * (1 - ratio_ * c1 / c2) / (c * c);
      const double change = (s1 / c - target) / slope;
      psi = std::clamp(psi - change, 0.5 * psi, table[static_cast<std::size_t>(i - 1)]);
      if (std::abs(change) < 1e-9) break;
    }
    table[static_cast<std::size_t>(i)] = psi;
  }
  table[kNodes] = 0;
}

double RimTable::rho_over_radius(double psi) const {
  const double delta = psi - std::asin(std::min(1.0, ratio_ * std::sin(psi)));
  return std::sin(psi) / std::cos(2 * delta);
}

template <class P>
P IncidenceTable::at(const P& rho_over_radius) const {
  using std::floor;
  const P t = root(max_of(P(1.0) - rho_over_radius * P(1 / rho_max), P(1e-300))) * P(static_cast<double>(kNodes));
  const P cell = min_of(floor(t), P(kNodes - 1.0)), f = t - cell;
  if constexpr (std::is_same_v<P, double>) {
    const std::size_t k = static_cast<std::size_t>(cell);
    return psi[k] + f * (psi[k + 1] - psi[k]);
  } else {
    alignas(64) double cells[kLanes], low[kLanes], high[kLanes];
    cell.store_aligned(cells);
    for (int i = 0; i < kLanes; ++i) {
      const std::size_t k = static_cast<std::size_t>(cells[i]);
      low[i] = psi[k];
      high[i] = psi[k + 1];
    }
    const P from = P::load_aligned(low);
    return from + f * (P::load_aligned(high) - from);
  }
}
template double IncidenceTable::at<double>(const double&) const;
template Pack IncidenceTable::at<Pack>(const Pack&) const;

template <class S>
DropletRay<S> trace(const DropletOptics<S>& o, const RimTable& rim, const S& rho_um) {
  using P = PlainOf<S>;
  // The table is within 5e-5 rad: one Newton step leaves some 1e-9, two leave rounding.
  constexpr int kNewtonSteps = 2;
  P start = rim.psi_at(plain(rho_um) * inverse(plain(o.radius_um)));
  // No step leaves the accepted interval: at its end the intensity vanishes.
  const P limit(rim.psi_max());
  const P ratio = plain(o.ratio), radius = plain(o.radius_um);
  for (int i = 0; i < kNewtonSteps; ++i) {
    const DropletRay<P> r = ray_at(start, ratio, radius);
    start = start - (r.rho_um - plain(rho_um)) * inverse(r.slope_um);
    start = min_of(max_of(start, P(0.0)), limit);
  }
  S psi(start);
  if constexpr (ScalarTraits<S>::derivatives > 0) {
    // d psi = (d rho_wanted - d rho(psi; parameters)) / slope: implicit function theorem.
    const DropletRay<S> first = ray_at(S(start), o.ratio, o.radius_um);
    const P inverse_slope = inverse(plain(first.slope_um));
    for (int j = 0; j < ScalarTraits<S>::derivatives; ++j) psi.d[j] = (rho_um.d[j] - first.rho_um.d[j]) * inverse_slope;
  }
  return ray_at(psi, o.ratio, o.radius_um);
}

template <class S>
DropletOptics<S> droplet_optics(const Scene& scene, const Values<S>& value) {
  const Droplet& droplet = std::get<Droplet>(scene.sample);
  const Indices<S> n = material_indices<S>(scene.material, value, wavelength_um(scene, value));
  DropletOptics<S> o;
  o.radius_um = 0.5 * value(droplet.diameter_um);
  o.n_o = n.ordinary;
  o.n_e = n.extraordinary;
  o.n_host = host_index(scene, value);
  o.ratio = o.n_host / o.n_o;
  o.k0 = wavenumber_per_um(scene, value);
  using Director = typename DropletOptics<S>::Director;
  if (const auto* radial = std::get_if<RadialDirector>(&droplet.director)) {
    if (radial->twist_deg) o.director = Director::twisted, o.twist_rad = value.radians(radial->twist_deg);
  } else if (const auto* shell = std::get_if<ShellDirector>(&droplet.director)) {
    o.director = Director::shell;
    o.core_um = o.radius_um - value(shell->wall_um);
    o.core_index = shell->core_index ? value(shell->core_index) : o.n_host;
  } else if (std::holds_alternative<AxialDirector>(droplet.director)) {
    const AxialDirector& axial = std::get<AxialDirector>(droplet.director);
    o.director = Director::axial;
    const S e = axial.reduced_field ? value(axial.reduced_field)
                                    : o.radius_um * value(axial.local_field_factor) * value(axial.field_v_per_um) /
                                          value(axial.coherence_voltage_v);
    o.axial = std::make_shared<const AxialField<S>>(e, value.get(axial.ring_radius, 0.0),
                                                    static_cast<bool>(axial.ring_radius));
  }
  o.continuity = scene.ceiling == Ceiling::e_only ? Continuity::e_only : Continuity::e_and_h;
  return o;
}

template <class S>
Su2<S> droplet_retarder(const DropletOptics<S>& o, const DropletRay<S>& r, const TransportMethod<S>& method,
                        const Mesh& mesh) {
  const Ray<S> light{o.k0, S(0.0), S(0.0), o.continuity};
  return with_droplet_column(o, r, [&](const auto& column) { return method.retarder(column, light, mesh); });
}

template <class S>
Mat2<S> droplet_jones(const DropletOptics<S>& o, const DropletRay<S>& r, const TransportMethod<S>& method,
                      const Mesh& mesh) {
  Mat2<S> jones = matrix(droplet_retarder(o, r, method, mesh));
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

/// Where the two parts of the tables meet: w = 1 - sqrt(1 - rho/edge), about 1/30 of the radius.
constexpr double kCentre = 1.0 / 64;

/// With the Jones matrix [[j0 + j1, j2 + j3], [j2 - j3, j0 - j1]] in the (radial, azimuthal) frame, analyser at alpha,
/// polarizer at beta and q, s = cos, sin (2 azimuth - alpha - beta), the field behind the analyser is D + j1 q - j2 s,
/// D = j0 cos(alpha - beta) - j3 sin(alpha - beta), and
///   I = sum of tube |field|^2 terms = f . (q^2, q, 1, s, q s),
/// the last two only where the transport is not diagonal; between crossed polarizers a diagonal one leaves the first
/// alone.
template <class S>
void intensity_terms(const Mat2<S>& j, const S& tube, const S& cos_between, const S& sin_between, bool diagonal, S* f) {
  const auto cross = [](const Complex<S>& a, const Complex<S>& b) { return a.re * b.re + a.im * b.im; };
  const S half(0.5), twice = 2.0 * tube;
  const Complex<S> j1 = half * (j.a - j.d);
  Complex<S> direct = (half * cos_between) * (j.a + j.d);
  if (diagonal) {
    f[0] = tube * norm(j1);
    f[1] = twice * cross(direct, j1);
    f[2] = tube * norm(direct);
    return;
  }
  direct = direct - (half * sin_between) * (j.b - j.c);
  const Complex<S> j2 = half * (j.b + j.c);
  const S square2 = norm(j2);
  f[0] = tube * (norm(j1) - square2);
  f[1] = twice * cross(direct, j1);
  f[2] = tube * (norm(direct) + square2);
  f[3] = S(0.0) - twice * cross(direct, j2);
  f[4] = S(0.0) - twice * cross(j1, j2);
}

}  // namespace

template <class S>
DropletImage<S>::DropletImage(const Scene& scene, const RenderPlan& plan, const Values<S>& value)
    : optics_(droplet_optics(scene, value)),
      rim_(lane(plain(optics_.ratio), 0), lane(plain(optics_.n_host), 0), scene.microscope.objective_na),
      method_(transport_method<S>(plan.method)),
      mesh_(plan.mesh.empty() ? uniform_mesh(plan.steps) : plan.mesh),
      aplanatic_(scene.microscope.aplanatic),
      view_(scene, value),
      edge_um_(optics_.radius_um * rim_edge(rim_, optics_.ratio, optics_.n_host)),
      inverse_edge_(inverse(edge_um_)),
      core_um_(0.0),
      centre_panels_(plan.centre_panels),
      rest_panels_(plan.radial_panels) {
  sin_cos(value.radians(scene.microscope.analyzer_deg) - value.radians(scene.microscope.polarizer_deg), sin_between_,
          cos_between_);
  symmetry_ = round_symmetry(scene, value, optics_.coupled());
  shell_ = optics_.director == DropletOptics<S>::Director::shell;
  if (shell_) {
    core_um_ = core_edge(optics_, rim_);
    if (can_tabulate()) {
      inverse_core_ = inverse(core_um_);
      core_root_ = root(1.0 - core_um_ * inverse_edge_);
      inverse_core_root_ = inverse(core_root_);
      by_inverse_core_ = Sensitivity<S>(inverse_core_);
      by_inverse_core_root_ = Sensitivity<S>(inverse_core_root_);
    }
    if (!can_tabulate()) rest_panels_ = 0;
  }
  by_inverse_edge_ = Sensitivity<S>(inverse_edge_);
  passing_ = PassingLight<S>(view_.pixel_um(), optics_.radius_um, cos_between_);
}

template <class S>
void DropletImage<S>::tabulate(PixelModel<S>::Wanted, int threads) {
  if (rest_panels_ == 0) return;
  const auto part = [&](Part which, int panels) {
    return RadialTable<S>(panels, number_of_terms(), threads, [&](const P& v, S* out) { terms(which, S(v), out); });
  };
  centre_ = part(Part::centre, centre_panels_);
  rest_ = part(Part::rest, rest_panels_);
}

// Functions of the radius end at the rim as functions of root = sqrt(1 - rho/edge). At the centre a twist leaves
// rho^2 log rho and the mesh along the chord changes its shape at rho ~ 0.003 edge: there w = 1 - root is stretched.
// The way through a shell's wall ends like a root at the core's edge, seen from inside; there is no defect in its
// centre.
template <class S>
void DropletImage<S>::terms(Part part, const S& v, S* out) const {
  if (shell_) {
    const S to_end = part == Part::centre ? v : core_root_ * v;
    terms_at((part == Part::centre ? core_um_ : edge_um_) * (1.0 - to_end * to_end), out);
  } else if (part == Part::centre) {
    const S v2 = v * v, w = kCentre * v2 * v2;
    terms_at(edge_um_ * w * (2.0 - w), out);
  } else {
    const S root = (1 - kCentre) * v;
    terms_at(edge_um_ * (1.0 - root * root), out);
  }
}

template <class S>
void DropletImage<S>::terms_at(const S& rho_um, S* out) const {
  const DropletRay<S> ray = trace(optics_, rim_, rho_um);
  Mat2<S> jones = droplet_jones(optics_, ray, method_, mesh_);
  // Ray tube: flux through the mid plane is b db / (rho drho) of the incident, |E|^2 = flux / cos(2 delta).
  S tube = optics_.radius_um * ray.cos_out * ray.cos_twice * inverse(ray.slope_um);
  if (!aplanatic_) {  // only the transverse part of the p field
    jones.a = ray.cos_twice * jones.a;
    jones.b = ray.cos_twice * jones.b;
    tube = tube * inverse(ray.cos_twice);
  }
  intensity_terms(jones, tube, cos_between_, sin_between_, !optics_.coupled(), out);
}

// The light at rho_um < edge by a ray of its own.
template <class S>
S DropletImage<S>::traced(const P& rho_um, const typename RoundView<S>::Place& place) const {
  const auto basis = RoundView<S>::basis(place);
  S f[kMostTerms], total(P(0.0));
  if constexpr (ScalarTraits<S>::derivatives == 0) {
    terms_at(rho_um, f);
    for (int k = 0; k < number_of_terms(); ++k) total = total + f[k] * basis[static_cast<std::size_t>(k)];
  } else {
    const auto turned = RoundView<S>::turned(place);
    S rho(rho_um);
    view_.add_moves_and_turns(place, P(1.0), P(0.0), rho);
    terms_at(rho, f);
    P by_angle(0.0);
    for (std::size_t k = 0; k < static_cast<std::size_t>(number_of_terms()); ++k) {
      total = total + f[k].chain(f[k].value * basis[k], basis[k]);
      by_angle = by_angle + f[k].value * turned[k];
    }
    view_.add_moves_and_turns(place, P(0.0), by_angle, total);
  }
  return total;
}

// The same from the tables. Slopes by hand: one chain rule at the end instead of every derivative through every root.
template <class S>
S DropletImage<S>::read(const P& rho_um, const typename RoundView<S>::Place& place) const {
  constexpr bool kSlopes = ScalarTraits<S>::derivatives > 0;
  using Slopes = typename RadialTable<S>::Slopes;
  const auto basis = RoundView<S>::basis(place);
  [[maybe_unused]] std::array<P, kMostTerms> turned;
  if constexpr (kSlopes) turned = RoundView<S>::turned(place);
  const P edge_inverse = plain(inverse_edge_), fraction = rho_um * edge_inverse, to_rim = root(P(1.0) - fraction);
  const auto central = shell_ ? rho_um < plain(core_um_) : to_rim > P(1 - kCentre);
  S total(P(0.0));
  // By the radius, by 2 azimuth and by the scales of the tables.
  P by_rho(0.0), by_angle(0.0), by_edge(0.0), by_core(0.0), by_core_root(0.0);
  // d to_rim / d fraction
  const auto rim_slope = [&] { return P(-0.5) * inverse(to_rim); };
  if (!birefit::all(central)) {
    const P scale = shell_ ? plain(inverse_core_root_) : P(1 / (1 - kCentre));
    if constexpr (kSlopes) {
      Slopes slopes;
      total = tabulated_sum(Part::rest, to_rim * scale, basis.data(), turned.data(), &slopes);
      const P by_fraction = slopes.by_v * scale * rim_slope();
      by_angle = slopes.turned, by_rho = by_fraction * edge_inverse, by_edge = by_fraction * rho_um,
      by_core_root = slopes.by_v * to_rim;
    } else {
      total = tabulated_sum(Part::rest, to_rim * scale, basis.data());
    }
  }
  if (!birefit::none(central)) {
    const P of_core = rho_um * plain(inverse_core_), w = fraction * inverse(P(1.0) + to_rim);
    const P v = shell_ ? root(max_of(P(1.0) - of_core, P(1e-30))) : root(root(w * P(1 / kCentre)));
    if constexpr (kSlopes) {
      Slopes slopes;
      total = select(central, tabulated_sum(Part::centre, v, basis.data(), turned.data(), &slopes), total);
      const auto here = [&](const P& there, P& everywhere) { everywhere = select(central, there, everywhere); };
      here(slopes.turned, by_angle);
      if (shell_) {
        const P by_of_core = slopes.by_v * P(-0.5) * inverse(v);
        here(by_of_core * plain(inverse_core_), by_rho);
        here(by_of_core * rho_um, by_core);
        here(P(0.0), by_edge);
        here(P(0.0), by_core_root);
      } else {
        const P by_fraction = slopes.by_v * P(-0.25) * v * inverse(w) * rim_slope();
        here(by_fraction * edge_inverse, by_rho);
        here(by_fraction * rho_um, by_edge);
      }
    } else {
      total = select(central, tabulated_sum(Part::centre, v, basis.data()), total);
    }
  }
  if constexpr (kSlopes) {
    view_.add_moves_and_turns(place, by_rho, by_angle, total);
    by_inverse_edge_.add(by_edge, total);
    if (shell_) {
      by_inverse_core_.add(by_core, total);
      by_inverse_core_root_.add(by_core_root, total);
    }
  }
  return total;
}

template <class S>
S DropletImage<S>::intensity(const P& column, const P& row) const {
  const auto place = view_.at(column, row);
  const auto inside = place.rho_um < plain(edge_um_) * P(1 - 1e-12);
  if (birefit::none(inside)) return S(P(0.0));
  const P rho_um = select(inside, place.rho_um, plain(edge_um_) * P(0.5));
  const S light = rest_panels_ == 0 ? traced(rho_um, place) : read(rho_um, place);
  return select(inside, light, S(0.0));
}

template <class S>
std::unique_ptr<PixelModel<S>> make_droplet_model(const Scene& scene, const RenderPlan& plan, const Values<S>& value) {
  if (!looks_round(std::get<Droplet>(scene.sample))) {
    if constexpr (kForTablesOnly<S>)
      throw std::logic_error("a ray a point takes fewer derivatives at once");
    else
      return make_ball_model(scene, plan, value);
  }
  if (scene.rays == Rays::eikonal) return std::make_unique<EikonalImage<S>>(scene, plan, value);
  return std::make_unique<DropletImage<S>>(scene, plan, value);
}
#define BIREFIT_INSTANTIATE(S)                                                                                      \
  template class DropletImage<S>;                                                                                   \
  template std::unique_ptr<PixelModel<S>> make_droplet_model<S>(const Scene&, const RenderPlan&, const Values<S>&); \
  template DropletOptics<S> droplet_optics<S>(const Scene&, const Values<S>&);                                      \
  template DropletRay<S> trace<S>(const DropletOptics<S>&, const RimTable&, const S&);                              \
  template Su2<S> droplet_retarder<S>(const DropletOptics<S>&, const DropletRay<S>&, const TransportMethod<S>&,     \
                                      const Mesh&);                                                                 \
  template Mat2<S> droplet_jones<S>(const DropletOptics<S>&, const DropletRay<S>&, const TransportMethod<S>&,       \
                                    const Mesh&);
BIREFIT_FOR_EACH_SCALAR_OF_TABLES(BIREFIT_INSTANTIATE)

}  // namespace birefit
