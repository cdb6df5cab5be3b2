#pragma once
// The picture of a droplet or shell whose two modes run on rays of their own (eikonal.h).

#include <vector>

#include "rays/eikonal.h"
#include "samples/image.h"
#include "samples/tables/radial_table.h"
#include "samples/tables/round_view.h"

namespace birefit {

/// Where rays of either mode begin or end (rims, a core's edge, the aperture, a ring's shadow) light jumps, or ends
/// like a root. Between two such radii it is smooth and comes from a table for each half, over v = sqrt(distance from
/// the end / half the way); the ends move with the parameters, and so do the tables. A jump is drawn over a quarter of
/// a pixel, so that pixels know how it moves; over less, where the next end is closer.
template <class S>
class EikonalImage final : public SampleImage<S> {
 public:
  using P = PlainOf<S>;
  EikonalImage(const Scene& scene, const RenderPlan& plan, const Values<S>& value, const BeamMaker& light);
  void tabulate(typename SampleImage<S>::Wanted, int threads) override;
  void light(const P& column, const P& row, S* out) const override;
  Symmetry symmetry() const override { return symmetry_; }
  bool has_passing_light() const override { return !passing_.dark(); }
  void passing(const P& column, const P& row, S* out) const override {
    out[0] = passing_.mean(view_, view_.at(column, row));
  }

  // For the planner.
  std::vector<double> ends_um() const;  ///< from the axis outwards
  int integrated_rays() const { return fan_p_.rays(); }
  double phase_error_rad() const {
    return fan_p_.path_error() * lane(plain(optics_.k0 * optics_.radius_um * optics_.n_o), 0);
  }
  std::size_t parts() const { return parts_.size(); }
  /// How far a table of so many panels is from the functions of a part (RadialTable::tail).
  double tail(std::size_t part, int panels) const { return table(parts_[part], panels, 1).tail(); }
  /// Largest difference between such a table and the functions, over places that are no nodes of it.
  double table_error(std::size_t part, int panels) const;

 private:
  int terms() const { return light_.functions(true); }  ///< functions of the radius, of RoundView's basis
  /// rho = end + v^2 / inverse_span.
  struct Part {
    S end_um, inverse_span;
    double middle_um;  ///< half-way to the next end, whose part begins there
    double blur_um;    ///< over which a jump at the end is drawn; 0 on the axis
    bool outwards;     ///< of the end
    Sensitivity<S> by_end, by_inverse_span;
    RadialTable<S> light;
  };
  RadialTable<S> table(const Part&, int panels, int threads) const;
  void terms_at(const S& rho_um, S* out) const;
  /// Share of a part in the light of rho: all, none, or some beside its end; and its slope.
  void share_at(const Part&, const P& rho_um, P& share, P& slope) const;

  DropletOptics<S> optics_;
  EikonalFan<S> fan_p_, fan_s_;
  RoundLight<S> light_;
  RoundView<S> view_;
  PassingLight<S> passing_;
  bool aplanatic_;
  Symmetry symmetry_;
  std::vector<Part> parts_;  ///< from the axis outwards, two for each stretch between ends
  std::vector<int> panels_;  ///< of the parts
  double allowed_tail_;      ///< of tables that are read
  /// Of a picture that is a sum over wavelengths, in a medium without dispersion: phases go with 1/wavelength.
  struct Colour {
    double phase;  ///< over that of optics_
    S weight;
  };
  std::vector<Colour> colours_;  ///< none: a single line
};

/// Its tables by this plan are of light of all wavelengths: rays go the same ways in all of them, and so do fields
/// beside the sample.
bool eikonal_sums_wavelengths(const Scene&, const RenderPlan&, const Theta&);

template <class S>
std::unique_ptr<SampleImage<S>> make_eikonal_image(const Scene&, const RenderPlan&, const Values<S>&, const BeamMaker&);

}  // namespace birefit
