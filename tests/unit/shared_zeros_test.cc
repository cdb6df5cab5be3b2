// Several frames on one dial.

#include "fit/problem/shared_zeros.h"

#include <gtest/gtest.h>

#include "scene_builder.h"

namespace birefit {
namespace {
using namespace testing;
using estimation::has_own_dials;
using estimation::with_shared_zeros;

struct Frames {
  TableBuilder b;
  FitJob job;

  explicit Frames(bool own, double known_to) {
    const ParameterRef shared = b.fixed("microscope.polarizer_deg", 10);
    b.table[shared].known_to.sd = known_to;
    for (int k = 0; k < 3; ++k) {
      Picture picture;
      picture.scene.microscope.polarizer_deg = shared;
      ParameterRef analyzer = shared;
      if (own) {
        analyzer = b.fixed("micrographs[" + std::to_string(k) + "].microscope.analyzer_deg", 30.0 * k);
        b.table[analyzer].known_to.sd = known_to;
      }
      picture.scene.microscope.analyzer_deg = analyzer;
      job.measurements.push_back(picture);
    }
    job.parameters = b.table;
  }
};

TEST(SharedZeros, MoveAllFramesTogether) {
  const Frames frames(true, 1);
  ASSERT_TRUE(has_own_dials(frames.job));
  const FitJob job = with_shared_zeros(frames.job);
  ASSERT_EQ(job.parameters.size(), frames.job.parameters.size() + 1);
  const ParameterRef zero = job.parameters.find("zero of microscope.analyzer_deg");
  ASSERT_TRUE(zero);
  EXPECT_EQ(job.parameters[zero].known_to.sd, 1);
  EXPECT_FALSE(has_own_dials(job));
  Theta theta = job.parameters.values();
  for (const double off : {0.0, 2.5}) {
    theta[static_cast<std::size_t>(zero.index)] = off;
    for (int k = 0; k < 3; ++k) {
      const Microscope& microscope = std::get<Picture>(job.measurements[static_cast<std::size_t>(k)]).scene.microscope;
      EXPECT_DOUBLE_EQ(microscope.analyzer_deg.in(theta), 30.0 * k + off);
      EXPECT_DOUBLE_EQ(microscope.polarizer_deg.in(theta), 10);
    }
  }
}

TEST(SharedZeros, AreOfDialsThatAreNotExactAlone) {
  EXPECT_FALSE(has_own_dials(Frames(true, 0).job));
  EXPECT_FALSE(has_own_dials(Frames(false, 1).job));
}

}  // namespace
}  // namespace birefit
