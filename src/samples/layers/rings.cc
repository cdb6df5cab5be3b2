// Radii of rings: "pixel" i of one row is the radius of ring number Observable::ring_numbers[i].

#include "samples/layers/rings.h"

#include <algorithm>

#include "birefit/error.h"
#include "medium/indices.h"
#include "samples/kind.h"
#include "samples/layers/plan.h"
#include "transport/method.h"

namespace birefit {
namespace {

template <class S>
class RingImage final : public SampleImage<S> {
 public:
  using P = PlainOf<S>;
  RingImage(const Scene& scene, const RenderPlan& plan, const Values<S>& value)
      : numbers_(plan.observable.ring_numbers), n_host_(host_index<S>(scene, value)) {
    const Plate& plate = std::get<Plate>(scene.sample);
    const Indices<S> n = material_indices<S>(scene.material, value, wavelength_um(scene, value));
    n_o_ = n.ordinary;
    n_e_ = n.extraordinary;
    thickness_um_ = value(plate.thickness_um);
    distance_um_ = value(plate.screen_distance_um);
    offset_ = value.get(plate.ring_offset, 0.0);
    path_per_order_ = wavelength_um(scene, value) / thickness_um_;
  }
  void light(const P& column, const P&, S* out) const override {
    P number(0.0);
    if constexpr (std::is_same_v<P, Pack>) {
      alignas(64) double n[kLanes];
      for (int k = 0; k < kLanes; ++k) n[k] = number_at(lane(column, k));
      number = Pack::load_aligned(n);
    } else {
      number = number_at(column);
    }
    const S k = ring_kappa_squared<S>(n_o_, n_e_, S((S(number) + offset_) * path_per_order_));
    out[0] = 1e-4 * ring_radius<S>(n_o_, k, n_host_, thickness_um_, distance_um_);  // um to cm
  }

 private:
  double number_at(double column) const {
    return numbers_[static_cast<std::size_t>(std::clamp(column + 0.5, 0.0, numbers_.size() - 0.5))];
  }
  std::vector<double> numbers_;
  S n_host_, n_o_, n_e_, thickness_um_, distance_um_, offset_, path_per_order_;
};

RenderPlan plan_rings(const Planning& planning) {
  check_closed_form(planning.demand, "a table of rings");
  if (planning.observable.ring_numbers.empty())
    throw UserError(Where{}, "a plate with screen_distance_um needs a table of ring radii",
                    "micrograph: {image: rings.csv}");
  RenderPlan plan = planning.start();
  plan.method = "closed_form";
  plan.reasons.push_back(
      "the rings of a plate cut normal to its axis lie where the retardance is a whole number of waves: radii in "
      "closed form");
  return plan;
}

/// One that nothing changes: radii grow steadily with everything, there is no fringe order to lose.
std::vector<double> ring_phases(const Scene&, const Values<double>&) { return {0.0}; }

/// Radii come of no matrix.
void refuse_ring_jones(const Scene&, const RenderPlan&, const Values<double>&, JonesTable&) {
  throw UserError(Where{}, "a table of rings has no Jones matrices", "give the plate view: {half_angle_deg} instead");
}

bool is_rings(const Scene& scene, const Observable&) { return is_ring_table(scene); }

}  // namespace

template <class S>
std::unique_ptr<SampleImage<S>> make_rings_image(const Scene& scene, const RenderPlan& plan, const Values<S>& value,
                                                 const BeamMaker&) {
  return std::make_unique<RingImage<S>>(scene, plan, value);
}
#define BIREFIT_INSTANTIATE(S)                                                                                    \
  template std::unique_ptr<SampleImage<S>> make_rings_image<S>(const Scene&, const RenderPlan&, const Values<S>&, \
                                                               const BeamMaker&);
BIREFIT_FOR_EACH_SCALAR(BIREFIT_INSTANTIATE)

const SampleKind kRings{.name = "rings",
                        .is = is_rings,
                        .plan = plan_rings,
                        .phases_rad = ring_phases,
                        .jones = refuse_ring_jones,
                        .temperatures = heat_temperatures};

}  // namespace birefit
