#include <stdexcept>

#include "samples/bar/bar.h"
#include "samples/disc/disc.h"
#include "samples/kind.h"
#include "samples/layers/cone_view.h"
#include "samples/layers/plan.h"
#include "samples/layers/planar.h"
#include "samples/layers/retardance.h"
#include "samples/layers/rings.h"
#include "samples/sphere/plan.h"
#include "samples/volume/volume.h"

namespace birefit {
namespace {

template <class Sample>
bool is(const Scene& scene, const Observable&) {
  return std::holds_alternative<Sample>(scene.sample);
}
bool is_rings(const Scene& scene, const Observable&) { return is_ring_table(scene); }
bool is_retardance(const Scene&, const Observable& observable) { return observable.quantity != Quantity::intensity; }
bool is_layers(const Scene& scene, const Observable&) {
  return std::holds_alternative<Cell>(scene.sample) || std::holds_alternative<Slab>(scene.sample) ||
         std::holds_alternative<Plate>(scene.sample);
}
bool always(const Scene&) { return true; }
bool has_cone(const Scene& scene) { return cone_half_angle(scene).has_value(); }

}  // namespace

const SampleKind& kind_of(const Scene& scene, const Observable& observable) {
  static const SampleKind kinds[] = {
#define BIREFIT_KIND(name, is, plan, pilots, phases, note, jones, symmetric, passes_axis, image, tables) \
  {#name, is, plan, pilots, phases, note, jones, symmetric, passes_axis},
#include "samples/kinds.def"
#undef BIREFIT_KIND
  };
  for (const SampleKind& kind : kinds)
    if (kind.is(scene, observable)) return kind;
  throw std::logic_error("a sample of no kind");
}

template <class S>
std::unique_ptr<SampleImage<S>> make_image(const Scene& scene, const RenderPlan& plan, const Values<S>& value,
                                           const BeamMaker& light) {
#define BIREFIT_KIND(name, is, plan_of, pilots, phases, note, jones, symmetric, passes_axis, image, tables) \
  if (is(scene, plan.observable)) {                                                                         \
    if constexpr (tables || !kForTablesOnly<S>) return image<S>(scene, plan, value, light);                 \
    throw std::logic_error("no table serves this scene");                                                   \
  }
#include "samples/kinds.def"
#undef BIREFIT_KIND
  throw std::logic_error("a sample of no kind");
}
#define BIREFIT_INSTANTIATE(S)                                                                              \
  template std::unique_ptr<SampleImage<S>> make_image<S>(const Scene&, const RenderPlan&, const Values<S>&, \
                                                         const BeamMaker&);
BIREFIT_FOR_EACH_SCALAR_OF_TABLES(BIREFIT_INSTANTIATE)

}  // namespace birefit
