#include <stdexcept>

#include "medium/validity.h"
#include "samples/bar/bar.h"
#include "samples/disc/disc.h"
#include "samples/kind.h"
#include "samples/layers/plan.h"
#include "samples/layers/planar.h"
#include "samples/layers/retardance.h"
#include "samples/layers/rings.h"
#include "samples/sphere/plan.h"
#include "samples/volume/volume.h"

namespace birefit {

const SampleKind& kind_of(const Scene& scene, const Observable& observable) {
#define BIREFIT_KIND(kind, image, tables) \
  if (kind.is(scene, observable)) return kind;
#include "samples/kinds.def"
#undef BIREFIT_KIND
  throw std::logic_error("a sample of no kind");
}

Traits traits_of(const Scene& scene) {
  const auto traits = kind_of(scene).traits;
  return traits ? traits(scene) : Traits{};
}

std::vector<ParameterRef> temperatures(const Scene& scene) {
  const auto* law = std::get_if<LawIndices>(&scene.material);
  if (!law) return {};
  std::vector<ParameterRef> refs;
  if (const auto own = kind_of(scene).temperatures) refs = own(scene);
  if (clearing_points(*law).empty()) return {};
  if (refs.empty() && law->temperature_k) refs = {law->temperature_k};
  if (law->haller) refs.push_back(law->haller->reference_k);
  return refs;
}

template <class S>
std::unique_ptr<SampleImage<S>> make_image(const Scene& scene, const RenderPlan& plan, const Values<S>& value,
                                           const BeamMaker& light) {
#define BIREFIT_KIND(kind, image, tables)                                                   \
  if (kind.is(scene, plan.observable)) {                                                    \
    if constexpr (tables || !kForTablesOnly<S>) return image<S>(scene, plan, value, light); \
    throw std::logic_error("no table serves this scene");                                   \
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
