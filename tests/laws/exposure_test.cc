// What light of several directions brings is the sum of what each does, by its weight.

#include <gtest/gtest.h>

#include "render/exposed.h"
#include "scene_builder.h"

namespace birefit {
namespace {

using namespace testing;

struct TiltedCell {
  TableBuilder b;
  Scene scene;
  std::vector<int> by;
  TiltedCell() {
    scene.view.width = 3, scene.view.height = 2;
    const ParameterRef thickness = b.fixed("thickness", 4.3), twist = b.fixed("twist", 62),
                       analyzer = b.fixed("analyzer", 71);
    TwistedDirector director;
    director.azimuth_deg = b.fixed("azimuth", 12), director.twist_deg = twist,
    director.pretilt_deg = b.fixed("pretilt", 3);
    scene.sample = Cell{thickness, director};
    scene.material = ConstantIndices{b.fixed("ordinary", 1.52), b.fixed("birefringence", 0.11)};
    scene.surround_index = b.fixed("surround", 1.3);
    scene.microscope.wavelength_nm = b.fixed("wavelength", 546);
    scene.microscope.polarizer_deg = b.fixed("polarizer", 5), scene.microscope.analyzer_deg = analyzer;
    by = {thickness.index, twist.index, analyzer.index};
  }
};

TEST(Exposure, DirectionsAddUpByTheirWeights) {
  TiltedCell cell;
  const Theta theta = cell.b.table.values();
  const RenderPlan p = plan(cell.scene, theta);
  const std::vector<Direction> directions{{0, 0}, {21, 40}, {33, 250}};
  const std::vector<double> weights{0.5, 0.2, 0.3};
  Exposure all;
  Rendering sum;
  std::vector<Rendering> one(directions.size());
  for (std::size_t k = 0; k < directions.size(); ++k) {
    const BeamMaker light(cell.scene.microscope, directions[k]);
    all.directions.push_back(light), all.weights.push_back(weights[k]);
    render(cell.scene, p, {{light}, {1.0}}, theta, cell.by, 1, one[k]);
  }
  EXPECT_GT(std::abs(one[1].intensity(0, 0) - one[0].intensity(0, 0)), 1e-3) << "directions that nothing tells apart";
  render(cell.scene, p, all, theta, cell.by, 1, sum);
  const PixelRendering pixels = render_pixels(cell.scene, p, all, theta, {{2, 1}}, cell.by, 1);
  double expected = 0;
  std::vector<double> slopes(cell.by.size(), 0.0);
  for (std::size_t k = 0; k < directions.size(); ++k) {
    expected += weights[k] * one[k].intensity(2, 1);
    for (std::size_t j = 0; j < slopes.size(); ++j) slopes[j] += weights[k] * one[k].derivatives[j](2, 1);
  }
  EXPECT_NEAR(sum.intensity(2, 1), expected, 1e-15);
  EXPECT_NEAR(pixels.intensity(0), expected, 1e-14);
  for (std::size_t j = 0; j < slopes.size(); ++j) {
    EXPECT_NEAR(sum.derivatives[j](2, 1), slopes[j], 1e-14);
    EXPECT_NEAR(pixels.derivatives(0, static_cast<Eigen::Index>(j)), slopes[j], 1e-13);
  }
}

TEST(Exposure, TheMicroscopesOwnIsItsFirstDirection) {
  TiltedCell cell;
  const Theta theta = cell.b.table.values();
  const auto light_of = [&](const std::vector<Direction>& stated) {
    Scene scene = cell.scene;
    scene.microscope.directions = stated;
    return render(scene, plan(cell.scene, theta), theta).intensity(1, 1);
  };
  EXPECT_EQ(light_of({}), light_of({{0, 0}}));
  EXPECT_EQ(light_of({{21, 40}}), light_of({{21, 40}, {33, 250}}));
  EXPECT_NE(light_of({{21, 40}}), light_of({}));
}

}  // namespace
}  // namespace birefit
