#include "rays/eikonal.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <tuple>
#include <utility>

#include "core/chebyshev.h"
#include "medium/families/axial_angle.h"

namespace birefit {

bool rays_stay_meridional(const Droplet& droplet) {
  if (!looks_round(droplet)) return false;
  const auto* radial = std::get_if<RadialDirector>(&droplet.director);
  return !radial || !radial->twist_deg;
}

namespace {

constexpr double kPi = std::numbers::pi;

template <class T>
T cosine_of(const T& sine) {
  return sqrt(1.0 - sine * sine);
}

template <class T>
auto field_of(double e, double ring, bool has_ring) {
  using Field = typename decltype(MeridionalDroplet<T>::field)::element_type;
  if constexpr (std::is_same_v<T, double>) {
    return std::make_shared<const Field>(e, ring, has_ring);
  } else {
    Dual<double, 2> by_e(e), by_ring(ring);
    by_e.d[0] = by_ring.d[1] = 1;
    return std::make_shared<const Field>(by_e, by_ring, has_ring);
  }
}

template <class S, class One>
S in_all_lanes(const One& x) {
  S result(plain(x));
  if constexpr (ScalarTraits<S>::derivatives > 0)
    for (std::size_t j = 0; j < x.d.size(); ++j) result.d[j] = PlainOf<S>(x.d[j]);
  return result;
}

/// x with the value of `at`, moving as the root of f(., parameters) does; slope = df/dx.
template <class T>
T moving_root(double at, const T& f, double slope) {
  return T(at) - (f - plain(f)) / slope;
}

}  // namespace

template <class S>
EikonalFan<S>::EikonalFan(const DropletOptics<S>& o, bool extraordinary, const S& objective_na)
    : extraordinary_(extraordinary),
      objective_na_(lane_of(objective_na, 0)),
      host_(lane_of(o.n_host, 0)),
      radius_um_(o.radius_um),
      path_phase_(o.k0 * o.radius_um * o.n_o) {
  using Director = typename DropletOptics<S>::Director;
  const One over = inverse(lane_of(o.n_o, 0));
  shape_[0] = lane_of(o.n_host, 0) * over;
  shape_[1] = lane_of(o.n_e, 0) * over;
  const bool shell = o.director == Director::shell, field = o.director == Director::axial;
  shape_[2] = shell   ? lane_of(o.core_um, 0) * inverse(lane_of(o.radius_um, 0))
              : field ? lane_of(o.axial->e(), 0)
                      : One(0.0);
  shape_[3] = shell ? lane_of(o.core_index, 0) * over : field ? lane_of(o.axial->ring(), 0) : One(0.0);
  T shape[kShape];
  for (std::size_t k = 0; k < kShape; ++k) {
    shape[k] = T(plain(shape_[k]));
    if constexpr (kPlanes > 1) shape[k].d[k] = 1;
  }
  droplet_.host = shape[0], droplet_.extraordinary = shape[1];
  if (shell) droplet_.core = shape[2], droplet_.core_index = shape[3];
  if (field && extraordinary) droplet_.field = field_of<T>(plain(shape_[2]), plain(shape_[3]), o.axial->has_ring());

  const T index = extraordinary ? droplet_.extraordinary : T(1.0);
  // Where a ray's L is `momentum`, or grazes; the small number keeps transmissions above 0.
  const auto incidence = [&](const T& momentum) {
    const T sine = momentum / droplet_.host;
    return plain(sine) < 1 - 1e-12 ? angle_of(sine, cosine_of(sine)) : T(kPi / 2 - 1e-7);
  };
  const T rim = incidence(index);
  if (!droplet_.field) {
    constexpr Accuracy kExact{1e-11, 8};  // a ray costs less than a microsecond
    const T core = droplet_.core, into_core = plain(droplet_.core_index) < plain(index) ? droplet_.core_index : index;
    const bool has_core = plain(core) > 0,
               beside =
                   !has_core || plain(core) * plain(index) < plain(droplet_.host) * std::sin(plain(rim)) * (1 - 1e-9);
    if (beside) add({has_core ? incidence(core * index) : T(0.0), rim}, 0, 1, kExact);
    if (has_core) {
      const T last = incidence(core * into_core);
      add({T(0.0), plain(last) < plain(rim) ? last : rim, Piece::Map::rim, true}, 0, 1, kExact);
    }
  } else {
    add_rays_in_field(rim, shape[3]);
  }
  find_ends();
  // What is nearer to the axis than the innermost ray is read from it.
  if (!panels_.empty() && panels_.back().inner < 2e-3) panels_.back().inner = -1;
}

template <class S>
void EikonalFan<S>::add_rays_in_field(const T& rim, const T& ring) {
  constexpr Accuracy kIntegrated{1e-6, 4};
  const double most = plain(rim);
  if (droplet_.field->has_ring()) {
    // Rays on both sides of the ring's go different ways: none is followed closer to it than this.
    constexpr double kBeside = 2e-3, kAxis = 1e-3;
    const auto equator = [&](double psi) {
      T place(2.0);
      meridional_ray(droplet_, true, T(psi), &place);
      ++rays_;
      return place;
    };
    double inside = kAxis, outside = most;
    for (int i = 0; i < 24; ++i) {
      const double middle = 0.5 * (inside + outside);
      (plain(equator(middle)) < plain(ring) ? inside : outside) = middle;
    }
    // The shadow moves with the ring. Beside it: what comes closest is turned most.
    const double h = 0.5 * kBeside;
    const T below = equator(inside - h), above = equator(inside + h);
    const T meets = moving_root(inside, T(0.5 * (below + above) - ring), (plain(above) - plain(below)) / (2 * h));
    if (inside + 2 * kBeside < most) add({meets + kBeside, rim}, 0, 1, kIntegrated);
    add({T(kAxis), meets - kBeside}, 0, 1, kIntegrated);
    return;
  }
  // The defect in the middle turns rays off the axis that come in on it, and the field bends them on: where they are
  // seen is past the axis.
  const auto image = [&](double psi) {
    const MeridionalRay<T> ray = traced(T(psi));
    return ray.arrives ? T(ray.impact / cos(ray.turn_rad)) : T(0.0);
  };
  double low = 1e-3;
  T first(low);
  if (plain(image(low)) < 0) {
    double inside = low;
    while (low < 0.2 && plain(image(low)) < 0) inside = low, low *= 2;
    for (int i = 0; i < 26; ++i) {
      const double middle = 0.5 * (inside + low);
      (plain(image(middle)) < 0 ? inside : low) = middle;
    }
    const double h = 1e-2 * low;
    first = moving_root(low, image(low), (plain(image(low + h)) - plain(image(low - h))) / (2 * h));
    axis_ray_ = sin(lifted(first));
  }
  constexpr double kMiddle = 0.3;
  add({T(kMiddle), rim}, 0, 1, kIntegrated);
  add({first, T(kMiddle), Piece::Map::axis}, 0, 1, kIntegrated);
}

template <class S>
MeridionalRay<typename EikonalFan<S>::T> EikonalFan<S>::traced(const T& psi) {
  ++rays_;
  return meridional_ray(droplet_, extraordinary_, psi);
}

// ---- the table -----------------------------------------------------------------------------------------------------

namespace {

/// A polynomial in x and its slope.
template <std::size_t N>
std::pair<double, double> horner(const double* c, double x) {
  double value = c[N - 1], slope = 0;
  for (std::size_t k = N - 1; k-- > 0;) {
    slope = slope * x + value;
    value = value * x + c[k];
  }
  return {value, slope};
}

}  // namespace

template <class S>
auto EikonalFan<S>::Piece::psi(double u) const -> T {
  if (map == Map::axis) return high * exp(u * log(T(low / high)));
  // No difference of what is nearly one: low may be 0.
  return low + (high - low) * ((1 - u) * (1 + u));
}
template <class S>
auto EikonalFan<S>::Piece::by_u(double u) const -> T {
  return map == Map::axis ? T(psi(u) * log(T(low / high))) : T((high - low) * (-2 * u));
}
template <class S>
double EikonalFan<S>::Piece::bend(double u) const {
  return map == Map::axis ? plain(psi(u)) * square(std::log(plain(low) / plain(high)))
                          : -2 * (plain(high) - plain(low));
}

template <class S>
auto EikonalFan<S>::Panel::place(double x) const -> Place {
  const double u = middle + half * x, psi = plain(piece.psi(u)), by_x = half * plain(piece.by_u(u));
  const auto [ratio, ratio_by_x] = horner<kPoints>(coefficients.data() + kRatio * kPoints, x);
  const double s = std::sin(psi);
  return {s * ratio, s * ratio_by_x + std::cos(psi) * by_x * ratio};
}

template <class S>
void EikonalFan<S>::add(const Piece& piece, double from, double to, const Accuracy& accuracy) {
  if (std::optional<Panel> panel = panel_of(piece, from, to, accuracy)) {
    // Where one panel goes on from another, their polynomials leave no gap between them.
    if (!panels_.empty() && !(piece.jumps && from == 0)) {
      const Panel& before = panels_.back();
      if (std::abs(plain(before.piece.psi(before.middle + before.half)) - plain(piece.psi(from))) < 1e-12)
        panel->outer = before.inner;
    }
    panels_.push_back(*std::move(panel));
  } else if (accuracy.splits > 0) {
    const double middle = 0.5 * (from + to);
    const Accuracy finer{accuracy.tail, accuracy.splits - 1};
    add(piece, from, middle, finer);
    add(piece, middle, to, finer);
  }
}

template <class S>
auto EikonalFan<S>::panel_of(const Piece& piece, double from, double to, const Accuracy& accuracy)
    -> std::optional<Panel> {
  const ChebyshevRule<kPoints>& rule = chebyshev_rule<kPoints>();
  Panel panel{piece, 0.5 * (from + to), 0.5 * (to - from), 0, 0, std::vector<double>(kPlanes * kFunctions * kPoints)};
  std::array<std::array<double, kPoints>, kPlanes * kFunctions> values;
  for (std::size_t k = 0; k < kPoints; ++k) {
    const double u = panel.middle + panel.half * rule.x[k];
    const T psi = piece.psi(u);
    const MeridionalRay<T> ray = traced(psi);
    if (!ray.arrives) return {};
    T s1, c1, s, c;
    sin_cos(psi, s1, c1);
    sin_cos(ray.turn_rad, s, c);
    // In the host from the wave front through the centre to the sphere, and from there back to the mid plane.
    const T out[kFunctions] = {ray.impact / (c * s1), ray.path - droplet_.host * (c1 + ray.exit_z / c), ray.turn_rad,
                               ray.flux};
    for (std::size_t f = 0; f < kFunctions; ++f) {
      values[f][k] = plain(out[f]);
      if constexpr (kPlanes > 1)
        for (std::size_t p = 1; p < kPlanes; ++p) values[p * kFunctions + f][k] = out[f].d[p - 1];
    }
  }
  double path_error = 0;
  const double allowed = accuracy.tail * (accuracy.splits == 0 ? kLast : 1);
  for (std::size_t f = 0; f < values.size(); ++f) {
    double tail[2] = {0, 0}, size = 1;
    for (std::size_t k = 0; k < kPoints; ++k) {
      for (std::size_t m = 0; m < 2; ++m)
        tail[m] += 2.0 / kPoints *
                   std::cos(static_cast<double>(kPoints - 1 - m) * kPi * (static_cast<double>(k) + 0.5) / kPoints) *
                   values[f][k];
      size = std::max(size, std::abs(values[f][k]));
    }
    // By values alone: the picture is the same with derivatives and without.
    const double both = std::abs(tail[0]) + std::abs(tail[1]);
    if (f < kFunctions && !(both <= allowed * size)) return {};
    if (f == kPath) path_error = both;
    for (std::size_t c = 0; c < kPoints; ++c) {
      double sum = 0;
      for (std::size_t k = 0; k < kPoints; ++k) sum += rule.to_powers[c][k] * values[f][k];
      panel.coefficients[f * kPoints + c] = sum;
    }
  }
  // Image radii fall from the rim inwards.
  for (int k = 0; k <= 16; ++k) {
    const double x = -1 + 0.125 * k;
    if (panel.middle + panel.half * x > 1e-9 && !(panel.place(x).by_x < 0)) return {};
  }
  panel.outer = panel.place(-1).rho, panel.inner = panel.place(1).rho;
  path_error_ = std::max(path_error_, path_error);
  return panel;
}

template <class S>
auto EikonalFan<S>::lifted(double value, const double* planes, std::size_t stride) const -> One {
  One result(value);
  if constexpr (kPlanes > 1)
    for (std::size_t k = 0; k < kShape; ++k)
      for (std::size_t j = 0; j < result.d.size(); ++j) result.d[j] += planes[k * stride] * shape_[k].d[j];
  return result;
}
template <class S>
auto EikonalFan<S>::lifted(const T& x) const -> One {
  if constexpr (kPlanes == 1)
    return x;
  else
    return lifted(x.value, x.d.data(), 1);
}

template <class S>
auto EikonalFan<S>::function_at(const Panel& panel, Function k, double x) const -> Slope {
  double values[kPlanes], slopes[kPlanes];
  for (std::size_t p = 0; p < kPlanes; ++p)
    std::tie(values[p], slopes[p]) = horner<kPoints>(panel.coefficients.data() + (p * kFunctions + k) * kPoints, x);
  return {lifted(values[0], values + 1, 1), lifted(slopes[0], slopes + 1, 1)};
}

template <class S>
void EikonalFan<S>::find_ends() {
  const auto add_end = [&](const Panel& panel, double x, const One& move) {
    const double u = panel.middle + panel.half * x;
    const One sine = sin(lifted(panel.piece.psi(u)));
    ends_um_.push_back(radius_um_ *
                       in_all_lanes<S>(One(sine * function_at(panel, kRatio, x).value + move * panel.place(x).by_x)));
  };
  for (std::size_t i = 0; i < panels_.size(); ++i) {
    const Panel& panel = panels_[i];
    if (i == 0 || panels_[i - 1].inner != panel.outer) add_end(panel, -1, One(0.0));
    if ((i + 1 == panels_.size() || panels_[i + 1].outer != panel.inner) && panel.inner > 0)
      add_end(panel, 1, One(0.0));
    if (plain(objective_na_) <= 0) continue;
    // Where rays begin or cease to be turned too far for the aperture.
    const double* turn = panel.coefficients.data() + kTurn * kPoints;
    const auto beyond = [&](double x) {
      return std::abs(std::sin(horner<kPoints>(turn, x).first)) * plain(host_) > plain(objective_na_);
    };
    constexpr int kSteps = 24;
    for (int k = 0; k < kSteps; ++k) {
      double low = 2.0 * k / kSteps - 1, high = 2.0 * (k + 1) / kSteps - 1;
      const bool before = beyond(low);
      if (beyond(high) == before) continue;
      for (int n = 0; n < 55; ++n) {
        const double middle = 0.5 * (low + high);
        (beyond(middle) == before ? low : high) = middle;
      }
      const auto [angle, slope] = function_at(panel, kTurn, low);
      const double side = plain(angle) < 0 ? -1 : 1;
      add_end(
          panel, low,
          One((side * objective_na_ - host_ * sin(angle)) / (plain(host_) * std::cos(plain(angle)) * plain(slope))));
    }
  }
}

template <class S>
auto EikonalFan<S>::read(const One& rho) const -> EikonalRay<One> {
  const EikonalRay<One> none{One(0.0), One(0.0), One(0.0), One(1.0)};
  const double wanted = plain(rho);
  const auto found = std::find_if(panels_.begin(), panels_.end(),
                                  [&](const Panel& p) { return wanted <= p.outer && wanted >= p.inner; });
  if (found == panels_.end()) return none;
  const Panel& panel = *found;
  // Newton within what is known to hold the root.
  double low = -1, high = 1, x = 1 - 2 * (wanted - panel.inner) / (panel.outer - panel.inner);
  x = std::clamp(x, -1.0, 1.0);
  for (int i = 0; i < 60; ++i) {
    const auto [here, by_x] = panel.place(x);
    (here > wanted ? low : high) = x;
    double next = x - (here - wanted) / by_x;
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    const double change = std::abs(next - x);
    x = next;
    if (change < 1e-14 || (i > 2 && change < 1e-9)) break;
  }
  // Functions at x and their slopes by x, both with derivatives by the shape; x itself follows from the place.
  const std::array<Slope, kFunctions> f{function_at(panel, kRatio, x), function_at(panel, kPath, x),
                                        function_at(panel, kTurn, x), function_at(panel, kFlux, x)};
  const double u = panel.middle + panel.half * x;
  One psi = lifted(panel.piece.psi(u)), psi_slope = lifted(panel.piece.by_u(u)) * panel.half, s1, c1;
  sin_cos(psi, s1, c1);
  One slope = s1 * f[kRatio].slope + c1 * psi_slope * f[kRatio].value;  // of the image radius
  const One move = (rho - s1 * f[kRatio].value) / plain(slope);         // of x: value 0
  const double curvature = [&] {
    const double* c = panel.coefficients.data() + kRatio * kPoints;
    double second = 0;
    for (std::size_t k = kPoints; k-- > 2;) second = second * x + static_cast<double>(k * (k - 1)) * c[k];
    return second;
  }();
  const double bend = panel.piece.bend(u) * panel.half * panel.half;
  slope =
      slope + move * (plain(s1) * curvature + 2 * plain(c1) * plain(psi_slope) * plain(f[kRatio].slope) +
                      (plain(c1) * bend - plain(s1) * plain(psi_slope) * plain(psi_slope)) * plain(f[kRatio].value));
  psi = psi + move * plain(psi_slope);
  psi_slope = psi_slope + move * bend;
  sin_cos(psi, s1, c1);
  const auto moved = [&](Function k) { return f[k].value + move * plain(f[k].slope); };
  EikonalRay<One> ray;
  sin_cos(moved(kTurn), ray.sin_turn, ray.cos_turn);
  ray.phase_rad = moved(kPath);
  if (plain(objective_na_) > 0 && std::abs(plain(ray.sin_turn)) * plain(host_) > plain(objective_na_)) return none;
  // Flux through the mid plane: b db / (rho drho) of what came in, b = sin psi.
  const One ratio2 = square(moved(kRatio)), off2 = square(One(axis_ray_ / s1));
  const One tube = c1 * psi_slope * inverse(slope) * inverse_root(root(ratio2 * ratio2 + off2 * off2));
  ray.amplitude = root(max_of(One(moved(kFlux) * tube), One(1e-300)));
  return ray;
}

template <class S>
EikonalRay<S> EikonalFan<S>::at(const S& rho_um) const {
  const S place = rho_um * inverse(radius_um_);
  EikonalRay<S> ray;
  if constexpr (kLanesOf<S> == 1) {
    ray = read(place);
  } else {
    std::array<EikonalRay<One>, kLanes> rays;
    for (int l = 0; l < kLanes; ++l) rays[static_cast<std::size_t>(l)] = read(lane_of(place, l));
    const auto gathered = [&](One EikonalRay<One>::*part) {
      std::array<double, kLanes> lanes;
      const auto pack = [&](const auto& number) {
        for (std::size_t l = 0; l < lanes.size(); ++l) lanes[l] = number(rays[l].*part);
        return Pack::load_unaligned(lanes.data());
      };
      S x;
      if constexpr (kPlanes > 1) {
        x = S(pack([](const One& n) { return n.value; }));
        for (std::size_t j = 0; j < x.d.size(); ++j) x.d[j] = pack([j](const One& n) { return n.d[j]; });
      } else {
        x = pack([](double n) { return n; });
      }
      return x;
    };
    ray = {gathered(&EikonalRay<One>::amplitude), gathered(&EikonalRay<One>::phase_rad),
           gathered(&EikonalRay<One>::sin_turn), gathered(&EikonalRay<One>::cos_turn)};
  }
  ray.phase_rad = ray.phase_rad * path_phase_;
  return ray;
}

#define BIREFIT_INSTANTIATE(S) template class EikonalFan<S>;
BIREFIT_FOR_EACH_SCALAR_OF_TABLES(BIREFIT_INSTANTIATE)

}  // namespace birefit
