// A droplet in its host: every pixel's ray refracts at the sphere, crosses the droplet on a straight chord, refracts
// again, and is traced back to the mid plane, where the microscope is focused.

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "instrument/channel_light.h"
#include "instrument/exposure.h"
#include "samples/choices.h"
#include "samples/curved/eikonal_image.h"
#include "samples/image.h"
#include "samples/sphere/droplet.h"
#include "transport/method.h"

namespace birefit {

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

}  // namespace

template <class S>
DropletImage<S>::DropletImage(const Scene& scene, const RenderPlan& plan, const Values<S>& value,
                              const BeamMaker& light, const RimTable* rim)
    : optics_(droplet_optics(scene, value, continuity_of(plan.demand))),
      rim_(rim ? *rim : rim_table(optics_)),
      method_(transport_method<S>(plan.method)),
      mesh_(plan.mesh.empty() ? uniform_mesh(plan.steps) : plan.mesh),
      aplanatic_(scene.microscope.aplanatic),
      light_(light.in(value).line),
      view_(scene, value, light_),
      edge_um_(optics_.radius_um * rim_edge(rim_, optics_)),
      inverse_edge_(inverse(edge_um_)),
      core_um_(0.0),
      centre_panels_(choices(plan).centre_panels),
      rest_panels_(choices(plan).radial_panels) {
  symmetry_ = round_symmetry(scene, value, light_.line(), optics_.coupled());
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
  S open = light_.line().open();
  if (light.rule()) {
    sum_over(*light.rule(), scene, plan, value, light);
    open = S(0.0);
    for (const Colour& colour : colours_) open = open + colour.weight * colour.image->light_.line().open();
  }
  passing_ = PassingLight<S>(value(scene.view.pixel_size_um), optics_.radius_um, open);
}

template <class S>
void DropletImage<S>::sum_over(const WavelengthRule& rule, const Scene& scene, const RenderPlan& plan,
                               const Values<S>& value, const BeamMaker& light) {
  // A wavelength of the sum is no parameter: those of the light move the weights.
  std::vector<int> active = value.active();
  for (int& index : active)
    if (index == scene.microscope.wavelength_nm.index) index = -1;
  for (std::size_t k = 0; k < rule.size(); ++k) {
    const Theta theta = at_wavelength(scene.microscope, value.theta(), 1e-3 * rule.wavelength_nm[k]);
    colours_.push_back({weight_in<S>(rule, k, value.active()),
                        std::make_unique<DropletImage>(scene, plan, Values<S>(theta, active, value.memo()),
                                                       light.with(nullptr), &rim_)});
  }
}

template <class S>
void DropletImage<S>::tabulate(typename SampleImage<S>::Wanted, int threads) {
  if (rest_panels_ == 0) return;
  const int count = number_of_terms();
  const auto part = [&](Part which, int panels) {
    return RadialTable<S>(panels, count, threads, [&](const P& v, S* out) {
      if (colours_.empty()) return terms(which, S(v), out);
      for (int k = 0; k < count; ++k) out[k] = S(0.0);
      S one[kMostTerms];
      for (const Colour& colour : colours_) {
        colour.image->terms(which, S(v), one);
        for (int k = 0; k < count; ++k) out[k] = out[k] + colour.weight * one[k];
      }
    });
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
  light_.terms(jones, tube, !optics_.coupled(), out);
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
void DropletImage<S>::light(const P& column, const P& row, S* out) const {
  const auto place = view_.at(column, row);
  const auto inside = place.rho_um < plain(edge_um_) * P(1 - 1e-12);
  if (birefit::none(inside)) {
    out[0] = S(P(0.0));
    return;
  }
  const P rho_um = select(inside, place.rho_um, plain(edge_um_) * P(0.5));
  out[0] = select(inside, rest_panels_ == 0 ? traced(rho_um, place) : read(rho_um, place), S(0.0));
}

bool droplet_sums_wavelengths(const Scene& scene, const RenderPlan& plan, const Theta& theta) {
  const SampleChoices& own = choices(plan);
  if (plan.wave || own.radial_panels == 0 || own.series_reach_um > 0 || !looks_round(std::get<Droplet>(scene.sample)))
    return false;
  if (plan.demand.rays == Rays::eikonal) return eikonal_sums_wavelengths(scene, plan, theta);
  const auto ratio_at = [&](double nm) {
    const Theta there = at_wavelength(scene.microscope, theta, 1e-3 * nm);
    const DropletOptics<double> o = droplet_optics(scene, Values<double>(there, {}, plan.demand.memo.get()));
    return o.n_o / o.n_host;
  };
  const std::vector<double>& nm = plan.wavelengths->wavelength_nm;
  if (ratio_at(nm.front()) != ratio_at(nm.back())) return false;  // each wavelength's rays go their own ways
  if (!std::holds_alternative<ShellDirector>(std::get<Droplet>(scene.sample).director)) return true;
  const Values<double> value(theta, {}, plan.demand.memo.get());
  return DropletImage<double>(scene, plan, value, exposure_of(scene.microscope).directions.front()).can_tabulate();
}

template <class S>
std::unique_ptr<SampleImage<S>> make_droplet_image(const Scene& scene, const RenderPlan& plan, const Values<S>& value,
                                                   const BeamMaker& light) {
  return std::make_unique<DropletImage<S>>(scene, plan, value, light);
}
#define BIREFIT_INSTANTIATE(S)                                                                                      \
  template class DropletImage<S>;                                                                                   \
  template std::unique_ptr<SampleImage<S>> make_droplet_image<S>(const Scene&, const RenderPlan&, const Values<S>&, \
                                                                 const BeamMaker&);                                 \
  template Su2<S> droplet_retarder<S>(const DropletOptics<S>&, const DropletRay<S>&, const TransportMethod<S>&,     \
                                      const Mesh&);                                                                 \
  template Mat2<S> droplet_jones<S>(const DropletOptics<S>&, const DropletRay<S>&, const TransportMethod<S>&,       \
                                    const Mesh&);
BIREFIT_FOR_EACH_SCALAR_OF_TABLES(BIREFIT_INSTANTIATE)

}  // namespace birefit
