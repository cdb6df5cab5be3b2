// The list of kinds (samples/kinds.def) against the samples there are.

#include <gtest/gtest.h>

#include "birefit/error.h"
#include "birefit/render.h"
#include "samples/kind.h"

namespace birefit {
namespace {

template <std::size_t I>
Scene scene_of_alternative() {
  Scene scene;
  scene.sample.emplace<I>();
  return scene;
}

template <std::size_t... I>
std::vector<Scene> every_sample(std::index_sequence<I...>) {
  return {scene_of_alternative<I>()...};
}

// The list ends in no kind that takes whatever is left: a new sample without a line of its own would pass for it.
TEST(SampleKinds, EverySampleHasOne) {
  for (const Scene& scene : every_sample(std::make_index_sequence<std::variant_size_v<Sample>>())) {
    const SampleKind* kind = nullptr;
    EXPECT_NO_THROW(kind = &kind_of(scene)) << "sample " << scene.sample.index();
    if (!kind) continue;
    EXPECT_TRUE(kind->plan && kind->phases_rad) << kind->name;
    // Rays on which transport methods are judged exist just where there is a matrix to ask for.
    EXPECT_EQ(kind->pilots != nullptr, kind->jones != nullptr) << kind->name;
  }
}

TEST(SampleKinds, ClosedFormsHaveNoJonesMatrices) {
  for (const Scene& scene : every_sample(std::make_index_sequence<std::variant_size_v<Sample>>())) {
    if (kind_of(scene).jones) continue;
    Scene lit = scene;
    lit.microscope.wavelength_nm = ParameterRef{0};
    EXPECT_THROW(jones(lit, RenderPlan{}, Theta{550}), UserError) << kind_of(scene).name;
  }
  Scene rings;
  Plate plate;
  rings.microscope.wavelength_nm = ParameterRef{0};
  plate.screen_distance_um = ParameterRef{1};
  rings.sample = plate;
  ASSERT_STREQ(kind_of(rings).name, "rings");
  EXPECT_THROW(jones(rings, RenderPlan{}, Theta{550, 1e5}), UserError);
}

}  // namespace
}  // namespace birefit
