// Several frames on one dial.

#include "fit/problem/shared_zeros.h"

#include <string>

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

/// Cells of which every picture states a thickness and a birefringence for itself, and a filter.
struct Cells {
  TableBuilder b;
  FitJob job;
  ParameterRef fitted = b.fitted("sample.material.birefringence", 0.1, 0, 0.2);

  Cells() {
    for (int k = 0; k < 4; ++k) {
      const std::string at = "micrographs[" + std::to_string(k) + "].";
      const auto known = [&](const std::string& name, double value, double share) {
        const ParameterRef ref = b.fixed(at + name, value);
        b.table[ref].known_to.share = share;
        return ref;
      };
      Picture picture;
      Cell cell;
      cell.thickness_um = known("sample.cell.thickness_um", 5 + k, 0.005);
      picture.scene.sample = cell;
      // The last shows the empty field.
      picture.scene.material =
          ConstantIndices{b.fixed("ordinary", 1.5), k < 3 ? fitted : known("sample.material.birefringence", 0, 0.01)};
      picture.scene.microscope.wavelength_nm = known("microscope.light.wavelength_nm", k % 2 ? 633 : 546, 0.003);
      job.measurements.push_back(picture);
    }
    job.parameters = b.table;
  }
  const Scene& scene(const FitJob& of, std::size_t k) const { return std::get<Picture>(of.measurements[k]).scene; }
};

// A calliper reads all thicknesses, and each filter is one, however often it is stated. What is fitted elsewhere stays.
TEST(SharedZeros, WhatIsKnownToAShareHasOneScaleAndFiltersAreOneEach) {
  const Cells cells;
  ASSERT_TRUE(has_own_dials(cells.job));
  const FitJob job = with_shared_zeros(cells.job);
  EXPECT_FALSE(has_own_dials(job));
  const ParameterRef scale = job.parameters.find("scale of sample.cell.thickness_um");
  ASSERT_TRUE(scale);
  EXPECT_EQ(job.parameters[scale].known_to.sd, 0.005);
  EXPECT_FALSE(job.parameters.find("scale of sample.material.birefringence"));
  Theta theta = job.parameters.values();
  theta[static_cast<std::size_t>(scale.index)] = 1.01;
  for (std::size_t k = 0; k < 4; ++k) {
    const Scene& scene = cells.scene(job, k);
    EXPECT_DOUBLE_EQ(std::get<Cell>(scene.sample).thickness_um.in(theta), 1.01 * (5.0 + static_cast<double>(k)));
    EXPECT_EQ(std::get<ConstantIndices>(scene.material).birefringence == cells.fitted, k < 3);
    EXPECT_EQ(scene.microscope.wavelength_nm.index, cells.scene(job, k % 2).microscope.wavelength_nm.index);
    EXPECT_EQ(scene.microscope.wavelength_nm.in(theta), k % 2 ? 633 : 546);
  }
  EXPECT_NE(cells.scene(job, 0).microscope.wavelength_nm.index, cells.scene(job, 1).microscope.wavelength_nm.index);
}

}  // namespace
}  // namespace birefit
