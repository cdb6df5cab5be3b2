#pragma once
// Geometry and optics of one ray through a droplet, shared by the image, the planner and the tests.

#include <array>
#include <memory>

#include "medium/families/axial.h"
#include "medium/families/radial.h"
#include "render/pixel_model.h"
#include "render/radial_table.h"
#include "render/round_view.h"
#include "transport/method.h"

namespace birefit {

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

template <class S>
DropletOptics<S> droplet_optics(const Scene& scene, const Values<S>& value);
/// rim.rho_max() with its derivatives by the indices.
template <class S>
S rim_edge(const RimTable& rim, const S& ratio, const S& n_host) {
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
  const S held = rim.objective_na() > 0 ? S(sign * rim.objective_na()) / n_host : S(plain(sin_twice));
  const S slope = 2.0 * cos_twice * (1.0 - ratio * c1 / c2);
  const S change = (held - sin_twice) / slope;  // of psi
  const S tip = cos_twice - 2.0 * sin_twice * (1.0 - ratio * c1 / c2) * change;
  return (s1 + c1 * change) / tip;
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
DropletRay<S> trace(const DropletOptics<S>& optics, const RimTable& rim, const S& rho_um);
/// Retarder on (p, s) = (radial, azimuthal) of the ray's frame inside, common phase left out.
template <class S>
Su2<S> droplet_retarder(const DropletOptics<S>&, const DropletRay<S>&, const TransportMethod<S>&, const Mesh&);
/// The same with the surface's transmissions at both ends.
template <class S>
Mat2<S> droplet_jones(const DropletOptics<S>&, const DropletRay<S>&, const TransportMethod<S>&, const Mesh&);
// Large, and needed by few: axial_column.cc has them, so that droplet.cc stays small enough to be inlined well.
#define BIREFIT_EXTERN(S) extern template class AxialColumn<S>;
BIREFIT_FOR_EACH_SCALAR_OF_TABLES(BIREFIT_EXTERN)
#undef BIREFIT_EXTERN
/// Calls f(column) with the medium along the ray.
template <class S, class F>
auto with_droplet_column(const DropletOptics<S>& o, const DropletRay<S>& r, const F& f) {
  using Director = typename DropletOptics<S>::Director;
  const S eo = o.n_o * o.n_o, ee = o.n_e * o.n_e, impact = o.radius_um * r.sin_in, half = o.radius_um * r.cos_in;
  if (o.director == Director::axial)
    return f(AxialColumn<S>(*o.axial, impact, half, o.radius_um, r.sin_deflection, r.cos_deflection, eo, ee));
  const Chord<S> chord(impact, half, o.radius_um);
  if (o.director == Director::twisted)
    return f(LawColumn<S, TwistedRadialLaw<S>>({chord, r.sin_deflection, r.cos_deflection, o.twist_rad, eo, ee}));
  if (o.director == Director::shell) {
    // Beside the core the piece begins in the middle of the chord; the small number keeps the derivative finite at the
    // edge.
    const S from = root(max_of(o.core_um * o.core_um - impact * impact, 1e-14 * (o.radius_um * o.radius_um)));
    LawColumn<S, ShellLaw<S>> shell({impact, from, half - from, eo, ee});
    shell.planar = true;
    return f(shell);
  }
  LawColumn<S, RadialLaw<S>> column({chord, eo, ee});
  column.planar = true;
  return f(column);
}

/// The image of a droplet that is symmetric about the viewing axis.
template <class S>
class DropletImage final : public PixelModel<S> {
 public:
  using P = PlainOf<S>;
  DropletImage(const Scene& scene, const RenderPlan& plan, const Values<S>& value);
  void tabulate(PixelModel<S>::Wanted, int threads) override;
  S intensity(const P& column, const P& row) const override;
  Symmetry symmetry() const override { return symmetry_; }
  int edges() const override { return shell_ && lane(plain(core_um_), 0) > 0 ? 2 : 1; }
  P beyond_edge(int edge, const P& column, const P& row) const override {
    const P fraction = view_.at(column, row).rho_um * inverse(plain(edge == 0 ? edge_um_ : core_um_));
    return P(1.0) - fraction * fraction;
  }
  bool round() const override { return true; }
  std::optional<EdgeCircle> circle(int edge) const override { return view_.circle(edge == 0 ? edge_um_ : core_um_); }
  S rim(const P& column, const P& row) const override {
    return view_.within(column, row, inverse_edge_, by_inverse_edge_);
  }
  bool has_passing_light() const override { return !passing_.dark(); }
  S passing(const P& column, const P& row) const override { return passing_.mean(view_, view_.at(column, row)); }
  /// The image is sum_k basis_k(azimuth) f_k(radius). Tables hold the f_k in two parts, each over v in [0, 1]: the
  /// centre, where they change over a hundredth of the radius, and the rest, smooth up to the rim; of a shell what is
  /// seen through the core, up to the kink at its edge, and what is seen beside it.
  enum class Part { centre, rest };
  static constexpr int kMostTerms = RoundView<S>::kMostTerms;
  int number_of_terms() const { return optics_.coupled() ? 5 : 3; }
  /// False where one ray a point is needed whatever the plan says: a shell whose core's edge no ray of the image meets.
  bool can_tabulate() const { return !shell_ || lane(plain(core_um_), 0) > 0; }
  /// Other ones than the plan's, for the next tabulate().
  void set_panels(int centre, int rest) { centre_panels_ = centre, rest_panels_ = can_tabulate() ? rest : 0; }
  /// f_k at v of the part; out has number_of_terms() places.
  void terms(Part part, const S& v, S* out) const;
  /// sum_k basis[k] f_k(v) as the image reads it; after tabulate(), with plan.radial_panels > 0.
  S tabulated_sum(Part part, const P& v, const P* basis, const P* turned = nullptr,
                  typename RadialTable<S>::Slopes* slopes = nullptr) const {
    const RadialTable<S>& table = part == Part::centre ? centre_ : rest_;
    return optics_.coupled() ? table.template sum<5>(v, basis, turned, slopes)
                             : table.template sum<3>(v, basis, turned, slopes);
  }

 private:
  void terms_at(const S& rho_um, S* out) const;
  S traced(const P& rho_um, const typename RoundView<S>::Place&) const;
  S read(const P& rho_um, const typename RoundView<S>::Place&) const;

  DropletOptics<S> optics_;
  RimTable rim_;
  const TransportMethod<S>& method_;
  Mesh mesh_;
  bool aplanatic_, shell_;
  Symmetry symmetry_;
  RoundView<S> view_;
  S cos_between_, sin_between_;  ///< of analyser - polarizer
  PassingLight<S> passing_;
  S edge_um_, inverse_edge_;
  S core_um_, inverse_core_, core_root_, inverse_core_root_;  ///< image radius of a shell's core, sqrt(1 - that / edge)
  Sensitivity<S> by_inverse_edge_, by_inverse_core_, by_inverse_core_root_;
  int centre_panels_, rest_panels_;
  RadialTable<S> centre_, rest_;
};

}  // namespace birefit
