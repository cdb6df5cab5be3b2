#pragma once
// A photoelastic disc: one retarder a point, its retardance and axis set by the stress.

#include <vector>

#include "medium/families/disc.h"
#include "samples/planning.h"
#include "samples/zone.h"

namespace birefit {

struct SampleKind;  // samples/kind.h

template <class S>
struct DiscOptics {
  S center_x_px, center_y_px, px_per_radius_inverse;
  S load_cos, load_sin;  ///< of the load's azimuth in the image
  S load_phase;          ///< rad per P/(t R)
  S residual_phase;      ///< rad per MPa
  std::vector<S> residual_normal, residual_shear;
  std::vector<S> illumination;  ///< 1, then the coefficients; empty = even light

  DiscOptics(const Scene& scene, const Values<S>& value);
  /// Place in the load's frame, units of the radius: y along the line of the forces.
  void place(const S& column, const S& row, S& x, S& y) const {
    const S east = (column - center_x_px) * px_per_radius_inverse, north = (center_y_px - row) * px_per_radius_inverse;
    x = east * load_sin - north * load_cos;
    y = east * load_cos + north * load_sin;
  }
  /// Retardance (rad) times cos and sin of twice the azimuth of the slow axis from x of the load's frame.
  StressPair<S> phases(const S& x, const S& y) const {
    const StressPair<S> load = diametral_stress(x, y);
    StressPair<S> p{load_phase * load.normal, load_phase * load.shear};
    if (!residual_normal.empty()) p.normal = p.normal + residual_phase * plane_polynomial<S>(residual_normal, x, y);
    if (!residual_shear.empty()) p.shear = p.shear + residual_phase * plane_polynomial<S>(residual_shear, x, y);
    return p;
  }
};

/// Radii (in radii of the disc) of what a fit leaves out: around the two forces, and inside of the edge.
struct DiscMargins {
  double contact, rim;
};
DiscMargins disc_margins(const StressedDisc& disc, double radius_um);

/// Which pixels of a disc's image a fit uses, the disc being where `theta` puts it.
class DiscZone final : public Zone {
 public:
  /// `scene` holds a StressedDisc.
  DiscZone(const Scene& scene, const Theta& theta);
  const DiscMargins& margins() const { return margins_; }
  double radius_px() const { return radius_px_; }
  /// All of the pixel is inside of the rim and clear of both forces.
  bool fitted(double column, double row) const override;
  std::vector<Mover> movers() const override;

 private:
  std::vector<ParameterRef> lengths_, azimuths_;
  DiscMargins margins_;
  double radius_px_, center_x_px_, center_y_px_, load_cos_, load_sin_;
};

/// A disc is a retarder whose phase goes with 1/wavelength: what a colour makes of it is one function of its path
/// difference, unless plates beside it have phases of their own.
bool disc_sums_wavelengths(const Scene&, const RenderPlan&, const Theta&);
template <class S>
std::unique_ptr<SampleImage<S>> make_disc_image(const Scene&, const RenderPlan&, const Values<S>&, const BeamMaker&);
/// What the list of kinds (samples/kinds.def) holds of it.
extern const SampleKind kDisc;

}  // namespace birefit
