#pragma once
// Optics of one ray through a droplet that looks the same from all sides of the viewing axis, and its picture; shared
// with the planner and the tests.

#include "medium/families/axial.h"
#include "medium/families/radial.h"
#include "rays/sphere_ray.h"
#include "samples/choices.h"
#include "samples/image.h"
#include "samples/tables/radial_table.h"
#include "samples/tables/round_view.h"
#include "transport/method.h"

namespace birefit {

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
class DropletImage final : public SampleImage<S> {
 public:
  using P = PlainOf<S>;
  /// `rim`: of a droplet whose rays go the same ways; null: its own is made.
  DropletImage(const Scene& scene, const RenderPlan& plan, const Values<S>& value, const BeamMaker& light,
               const RimTable* rim = nullptr);
  void tabulate(typename SampleImage<S>::Wanted, int threads) override;
  void light(const P& column, const P& row, S* out) const override;
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
  void passing(const P& column, const P& row, S* out) const override {
    out[0] = passing_.mean(view_, view_.at(column, row));
  }
  /// The image is sum_k basis_k(azimuth) f_k(radius). Tables hold the f_k in two parts, each over v in [0, 1]: the
  /// centre, where they change over a hundredth of the radius, and the rest, smooth up to the rim; of a shell what is
  /// seen through the core, up to the kink at its edge, and what is seen beside it.
  enum class Part { centre, rest };
  static constexpr int kMostTerms = RoundView<S>::kMostTerms;
  int number_of_terms() const { return light_.functions(!optics_.coupled()); }
  /// False where one ray a point is needed whatever the plan says: a shell whose core's edge no ray of the image meets.
  bool can_tabulate() const { return !shell_ || lane(plain(core_um_), 0) > 0; }
  /// Other ones than the plan's, for the next tabulate().
  void set_panels(int centre, int rest) { centre_panels_ = centre, rest_panels_ = can_tabulate() ? rest : 0; }
  /// f_k at v of the part; out has number_of_terms() places.
  void terms(Part part, const S& v, S* out) const;
  /// sum_k basis[k] f_k(v) as the image reads it; after tabulate(), with choices(plan).radial_panels > 0.
  S tabulated_sum(Part part, const P& v, const P* basis, const P* turned = nullptr,
                  typename RadialTable<S>::Slopes* slopes = nullptr) const {
    const RadialTable<S>& table = part == Part::centre ? centre_ : rest_;
    return table.sum(number_of_terms(), v, basis, turned, slopes);
  }

 private:
  /// Makes colours_.
  void sum_over(const WavelengthRule&, const Scene&, const RenderPlan&, const Values<S>&, const BeamMaker&);
  void terms_at(const S& rho_um, S* out) const;
  S traced(const P& rho_um, const typename RoundView<S>::Place&) const;
  S read(const P& rho_um, const typename RoundView<S>::Place&) const;

  DropletOptics<S> optics_;
  RimTable rim_;
  const TransportMethod<S>& method_;
  Mesh mesh_;
  bool aplanatic_, shell_;
  Symmetry symmetry_;
  RoundLight<S> light_;
  RoundView<S> view_;
  PassingLight<S> passing_;
  S edge_um_, inverse_edge_;
  S core_um_, inverse_core_, core_root_, inverse_core_root_;  ///< image radius of a shell's core, sqrt(1 - that / edge)
  Sensitivity<S> by_inverse_edge_, by_inverse_core_, by_inverse_core_root_;
  int centre_panels_, rest_panels_;
  RadialTable<S> centre_, rest_;
  /// The same droplet at the wavelengths of a rule, whose sum is tabulated; none: the picture is of one.
  struct Colour {
    S weight;
    std::unique_ptr<DropletImage> image;
  };
  std::vector<Colour> colours_;
};

/// Its tables by this plan are of light of all wavelengths: the same radius is the same ray in all of them.
bool droplet_sums_wavelengths(const Scene&, const RenderPlan&, const Theta&);

template <class S>
std::unique_ptr<SampleImage<S>> make_droplet_image(const Scene&, const RenderPlan&, const Values<S>&, const BeamMaker&);

}  // namespace birefit
