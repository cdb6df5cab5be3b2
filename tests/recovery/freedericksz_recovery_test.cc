// The voltage of a planar cell in units of its threshold, from three grey levels. Truth: quadrature with pretilt
// (independent_field_cell.h); ceiling e_only, whose transport at normal incidence it is exactly.

#include <gtest/gtest.h>

#include "birefit/fit.h"
#include "independent_droplet.h"  // camera()
#include "independent_field_cell.h"
#include "scene_builder.h"

namespace birefit {
namespace {
using namespace testing;

constexpr int kSide = 16;
constexpr double kGain = 1000;

const IndependentFieldCell kCell;

FitJob voltage_job(double v, double start, unsigned long seed) {
  TableBuilder b;
  Scene scene;
  FreederickszDirector d;
  d.reduced_voltage = b.fitted("reduced_voltage", start, 0, 4);
  b.table[d.reduced_voltage].physical_lower = 0;
  d.k33_over_k11 = b.fixed("k33_over_k11", kCell.k33_over_k11);
  d.eps_ratio = b.fixed("eps_ratio", kCell.eps_ratio);
  d.pretilt_deg = b.fixed("pretilt_deg", kCell.pretilt_deg);
  d.azimuth_deg = b.fixed("azimuth_deg", 45);
  scene.sample = Cell{b.fixed("thickness_um", kCell.thickness_um), d};
  scene.material = ConstantIndices{b.fixed("ordinary", kCell.n_o), b.fixed("birefringence", kCell.n_e - kCell.n_o)};
  scene.surround_index = b.fixed("surround", 1.5);
  scene.microscope.polarizer_deg = b.fixed("polarizer_deg", 0);
  scene.microscope.analyzer_deg = b.fixed("analyzer_deg", 90);
  scene.ceiling = Ceiling::e_only;
  scene.view.width = scene.view.height = kSide;
  scene.view.rotation_deg = b.fixed("rotation_deg", 0);
  const ParameterRef gain = b.fixed("gain", kGain), offset = b.fixed("offset", 0);
  FitJob job;
  // Three colours: one grey level returns with every order of the retardance.
  for (double wavelength_nm : {480.0, 560.0, 650.0}) {
    Scene here = scene;
    const std::string name = std::to_string(wavelength_nm);
    here.microscope.wavelength_nm = b.fixed("wavelength_nm " + name, wavelength_nm);
    const std::vector<double> mean(kSide * kSide, kGain * kCell.crossed(v, wavelength_nm / 1000));
    job.micrographs.push_back(micrograph_of(name, here, camera(mean, 1, 3, 10 * seed + job.micrographs.size(), false),
                                            gain, offset, {3, 1}));
  }
  job.parameters = b.table;
  job.options.threads = 1;
  return job;
}

TEST(FreederickszRecovery, ReducedVoltageIsFoundFromBothSidesOfTheThreshold) {
  unsigned long seed = 1;
  for (double v : {0.9, 1.0, 1.05, 1.2, 1.7, 3.0})
    for (double start : {0.5, 2.5}) {
      const FitResult r = fit(voltage_job(v, start, seed++));
      EXPECT_TRUE(r.has_answer()) << v << " from " << start << ": " << r.verdict;
      const ParameterEstimate* p = find_estimate(r, "reduced_voltage");
      EXPECT_LT(std::abs(p->value - v), 5 * p->stderr_) << v << " from " << start << ": " << p->value;
      // Every level is known to about 40 counts over 16 pixels a side of 1000: at the steepest some 0.2 % of the phase.
      EXPECT_LT(p->stderr_, 0.05) << v;
    }
}

// Far below the threshold the director hardly moves: how far below is not known, that it is below is.
TEST(FreederickszRecovery, FarBelowTheThresholdIsToldFromAbove) {
  for (unsigned long seed = 1; seed <= 3; ++seed) {
    const FitResult r = fit(voltage_job(0.1, 0.6, 100 + seed));
    EXPECT_LT(find_estimate(r, "reduced_voltage")->value, 0.8) << seed;
  }
}

}  // namespace
}  // namespace birefit
