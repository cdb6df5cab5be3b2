#pragma once
// Straight rays through a sphere in its host: where each enters, how it is refracted, and where it is seen.

#include <array>
#include <memory>

#include "medium/families/axial.h"
#include "medium/surround.h"
#include "scene/values.h"
#include "transport/one_way.h"

namespace birefit {

/// Whether the droplet's director looks the same from all sides of the viewing axis (samples/sphere/droplet.h), or
/// every point of the picture needs a ray of its own (samples/sphere/ball.h).
bool looks_round(const Droplet& droplet);

/// Angle of incidence against image radius, over t = sqrt(1 - rho / rho_max): smooth through the turning point in which
/// rho(psi) may end.
struct IncidenceTable {
  static constexpr int kNodes = 512;
  double rho_max = 0;                    ///< in radii, at psi[0]
  std::array<double, kNodes + 1> psi{};  ///< at t = i / kNodes; the last is 0
  template <class P>
  P at(const P& rho_over_radius) const;  ///< P = double or Pack; within 5e-5 rad
};

/// Of straight rays, for one ratio m = n_host / n_o (values only; a start for Newton).
class RimTable {
 public:
  /// objective_na 0 = no limit.
  RimTable(double index_ratio, double host_index, double objective_na);
  /// What ends the accepted rays: grazing incidence, total reflection, or being turned too far to be collected.
  enum class End { grazing, total_reflection, turned };
  End end() const { return end_; }
  double objective_na() const { return objective_na_; }
  double psi_max() const { return psi_max_; }
  double rho_max() const { return table_.rho_max; }  ///< largest image radius / R that light reaches
  double rho_over_radius(double psi) const;
  template <class P>
  P psi_at(const P& rho_over_radius) const {
    return table_.at(rho_over_radius);
  }

 private:
  double ratio_, objective_na_, psi_max_ = 0;
  End end_ = End::grazing;
  IncidenceTable table_;
};

template <class S>
struct DropletOptics {
  S radius_um, n_o, n_e, n_host, ratio, k0;
  S objective_na = S(0.0);  ///< 0: not stated, all rays are collected
  enum class Director { radial, twisted, axial, shell } director = Director::radial;
  S twist_rad = S(0.0);                     // not {0.0}: a pack would take that for a list of lanes
  S core_um = S(0.0), core_index = S(1.0);  ///< of a shell's core: radius and index
  std::shared_ptr<const AxialField<S>> axial;
  Continuity continuity = Continuity::e_and_h;
  bool coupled() const { return director == Director::twisted; }  ///< the axis leaves the meridional plane
};

/// One refracted ray: sines and cosines of the angles outside and inside (against the sphere's normal), of the
/// deflection delta inside; the exit direction is turned by 2 delta. slope_um = d rho / d psi.
template <class S>
struct DropletRay {
  S sin_out, cos_out, sin_in, cos_in, sin_deflection, cos_deflection, cos_twice, rho_um, slope_um;
};

/// The ray of an angle of incidence psi on the sphere; ratio: n_host / n_o.
template <class S>
DropletRay<S> ray_at(const S& psi, const S& ratio, const S& radius_um) {
  DropletRay<S> r;
  sin_cos(psi, r.sin_out, r.cos_out);
  r.sin_in = ratio * r.sin_out;
  r.cos_in = root(max_of(S(1.0) - r.sin_in * r.sin_in, S(1e-14)));
  r.sin_deflection = r.sin_out * r.cos_in - r.cos_out * r.sin_in;
  r.cos_deflection = r.cos_out * r.cos_in + r.sin_out * r.sin_in;
  r.cos_twice = 1.0 - 2.0 * r.sin_deflection * r.sin_deflection;
  const S sin_twice = 2.0 * r.sin_deflection * r.cos_deflection, secant = inverse(r.cos_twice);
  r.rho_um = radius_um * r.sin_out * secant;
  r.slope_um = radius_um * secant *
               (r.cos_out + 2.0 * r.sin_out * sin_twice * secant * (1.0 - ratio * r.cos_out * inverse(r.cos_in)));
  return r;
}

/// `continuity`: for who sends light along rays; where they go does not ask.
template <class S>
DropletOptics<S> droplet_optics(const Scene& scene, const Values<S>& value,
                                Continuity continuity = Continuity::e_and_h);
/// rim.rho_max() with its derivatives by the indices and the aperture (where it has one).
template <class S>
S rim_edge(const RimTable& rim, const S& ratio, const S& n_host, const S& objective_na) {
  const double psi0 = rim.psi_max();
  if (rim.end() == RimTable::End::total_reflection)
    return ratio / (2.0 - ratio * ratio);  // sin psi = 1/m, 2 delta = 2 psi - pi
  const double s1 = std::sin(psi0), c1 = std::cos(psi0);
  // cos 2 delta and sin 2 delta at fixed psi, as functions of m.
  const S s2 = ratio * s1, c2 = sqrt(1.0 - s2 * s2);
  const S sd = s1 * c2 - c1 * s2, cd = c1 * c2 + s1 * s2;
  const S cos_twice = 1.0 - 2.0 * sd * sd, sin_twice = 2.0 * sd * cd;
  if (rim.end() == RimTable::End::grazing) return s1 / cos_twice;
  // |sin 2 delta| is held: by the aperture at NA / n_host, or at its fixed limit. psi follows by one Newton step, which
  // is exact for value and first derivative.
  const double sign = lane(plain(sin_twice), 0) < 0 ? -1 : 1;
  const S held = rim.objective_na() > 0 ? S(sign * objective_na) / n_host : S(plain(sin_twice));
  const S slope = 2.0 * cos_twice * (1.0 - ratio * c1 / c2);
  const S change = (held - sin_twice) / slope;  // of psi
  const S tip = cos_twice - 2.0 * sin_twice * (1.0 - ratio * c1 / c2) * change;
  return (s1 + c1 * change) / tip;
}

/// The same of a droplet: in radii.
template <class S>
S rim_edge(const RimTable& rim, const DropletOptics<S>& o) {
  return rim_edge(rim, o.ratio, o.n_host, o.objective_na);
}
/// The rays of a droplet, by its values.
template <class S>
RimTable rim_table(const DropletOptics<S>& o) {
  return {lane(plain(o.ratio), 0), lane(plain(o.n_host), 0), lane(plain(o.objective_na), 0)};
}

/// Image radius (um) of the rays that touch a shell's core, where its picture has a kink; 0 where the rim comes first.
template <class S>
S core_edge(const DropletOptics<S>& o, const RimTable& rim) {
  // sin psi = (core / R) / m.
  const S sin_in = o.core_um * inverse(o.radius_um), sin_out = sin_in * inverse(o.ratio);
  if (!(lane(plain(sin_out), 0) < std::sin(rim.psi_max()) * (1 - 1e-6))) return S(0.0);
  const S cos_in = root(1.0 - sin_in * sin_in), cos_out = root(1.0 - sin_out * sin_out),
          turn = sin_out * cos_in - cos_out * sin_in;
  return o.radius_um * sin_out * inverse(1.0 - 2.0 * turn * turn);
}

/// The ray whose backward extension meets the mid plane at image radius rho_um < rim.rho_max() R.
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

}  // namespace birefit
