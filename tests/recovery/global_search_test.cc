// The right fringe order from bounds several orders wide: random problems of five families, truths anywhere in the bounds, starts anywhere
// else, 0.5 to 5 % of noise. What must not be is a confident wrong number.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <mutex>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "birefit/fit.h"
#include "birefit/render.h"
#include "core/threads.h"
#include "scene_builder.h"

namespace birefit {
namespace {
using namespace testing;

constexpr double kGain = 1000;

/// One problem: the table holds the truth until the starts are drawn; a scene a micrograph.
struct Problem {
  TableBuilder b;
  std::vector<Scene> scenes;
  std::mt19937_64 random;
  double between(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); }
  /// Its truth anywhere between the bounds but for their last twentieth, where a fit would have to say that it is at one.
  ParameterRef anywhere(const std::string& name, double low, double high) {
    return b.fitted(name, between(low + 0.05 * (high - low), high - 0.05 * (high - low)), low, high);
  }
};

Scene seen(Problem& p, int size, double pixel_um) {
  Scene s;
  s.microscope.wavelength_nm = p.b.fixed("wavelength_nm", 590);
  s.microscope.polarizer_deg = p.b.fixed("polarizer_deg", 0);
  s.microscope.analyzer_deg = p.b.fixed("analyzer_deg", 90);
  s.view.width = s.view.height = size;
  s.view.pixel_size_um = pixel_um;
  s.view.rotation_deg = p.b.fixed("rotation_deg", 0);
  return s;
}

/// A droplet somewhere near the middle; its edge lies in the image.
void droplet(Problem& p, double birefringence_low, double birefringence_high, const std::function<void(Droplet&)>& director) {
  constexpr int kSize = 64;
  Scene s = seen(p, kSize, 0.3);
  s.view.center_x_px = p.anywhere("center_x", 26, 38);
  s.view.center_y_px = p.anywhere("center_y", 26, 38);
  Droplet sample;
  sample.diameter_um = p.anywhere("diameter_um", 5.5, 16);
  director(sample);
  s.sample = sample;
  s.material = ConstantIndices{p.b.fixed("ordinary", 1.52), birefringence_high > birefringence_low ? p.anywhere("birefringence", birefringence_low, birefringence_high)
                                                                                                    : p.b.fixed("birefringence", birefringence_low)};
  s.surround_index = p.b.fixed("surround", 1.5);
  p.scenes.push_back(s);
}

void radial_droplet(Problem& p) {
  droplet(p, 0.04, 0.4, [](Droplet&) {});
}
void droplet_in_a_field(Problem& p) {
  droplet(p, 0.3, 0.3, [&](Droplet& sample) {
    AxialDirector axial;
    axial.reduced_field = p.anywhere("reduced_field", 1, 39);
    sample.director = axial;
  });
}
void shell(Problem& p) {
  droplet(p, 0.3, 0.3, [&](Droplet& sample) {
    ShellDirector s;
    s.wall_um = p.anywhere("wall_um", 0.3, 2.5);
    sample.director = s;
  });
}
/// A planar cell is one number an image: five wavelengths and two analyser angles tell its order.
void cell(Problem& p) {
  Scene s = seen(p, 24, 1);
  Cell sample;
  sample.thickness_um = p.b.fixed("thickness_um", 20);
  UniformDirector director;
  director.azimuth_deg = p.anywhere("azimuth_deg", 5, 40);
  director.tilt_deg = p.b.fixed("tilt_deg", 0);
  sample.director = director;
  s.sample = sample;
  s.material = ConstantIndices{p.b.fixed("ordinary", 1.52), p.anywhere("birefringence", 0.04, 0.25)};
  for (const double wavelength_nm : {450.0, 500.0, 550.0, 600.0, 650.0})
    for (const double analyzer_deg : {90.0, 45.0}) {
      s.microscope.wavelength_nm = p.b.fixed("wavelength", wavelength_nm);
      s.microscope.analyzer_deg = p.b.fixed("analyzer", analyzer_deg);
      p.scenes.push_back(s);
    }
}
void heated_plate(Problem& p) {
  Scene s = seen(p, 64, 0);
  Plate plate;
  plate.thickness_um = p.b.fixed("thickness_um", 800);
  plate.director.axis = {p.b.fixed("axis.x", -0.353553), p.b.fixed("axis.y", 0.353553), p.b.fixed("axis.z", -0.866025)};
  HeatStep heat;
  heat.fourier_number = p.b.fitted("fourier_number", std::exp(p.between(std::log(0.004), std::log(0.25))), 0.002, 0.5);
  heat.cold_k = p.b.fixed("cold_k", 278);
  heat.hot_k = p.b.fixed("hot_k", 368);
  plate.heat = heat;
  plate.half_angle_deg = p.b.fixed("half_angle_deg", 8);
  s.sample = plate;
  s.material = E44Steinberg2020{p.b.fixed("temperature_k", 298)};
  s.surround_index = p.b.fixed("surround", 1.0);
  s.microscope.wavelength_nm = p.b.fixed("wavelength_640", 640);
  p.scenes.push_back(s);
}

struct Family {
  std::string name;
  void (*make)(Problem&);
};
const std::vector<Family> kFamilies = {{"Droplet", radial_droplet}, {"DropletInAField", droplet_in_a_field}, {"Shell", shell}, {"Cell", cell}, {"HeatedPlate", heated_plate}};

struct Count {
  int problems = 0, right = 0, limits = 0, refused = 0;
  int undecided = 0;  ///< ambiguous, and another minimum is as likely as 1 to 100
  int ambiguous = 0;  ///< though none is
  int wrong = 0;  ///< an answer with a searched parameter more than five standard errors off
};

Count solve(const Family& family, int problems, int first_seed = 1, Ceiling ceiling = Ceiling::one_way) {
  Count count;
  std::mutex mutex;
  parallel_for(problems, 0, [&](int i) {
    Problem p;
    p.random.seed(static_cast<unsigned long>(first_seed + i) * 104729);
    family.make(p);
    for (Scene& scene : p.scenes) {
      scene.ceiling = ceiling;
      if (ceiling == Ceiling::wave) scene.microscope.objective_na = p.between(0.4, 0.9);
    }
    const double noise = kGain * std::exp(p.between(std::log(0.005), std::log(0.05)));
    const Theta truth = p.b.table.values();
    std::normal_distribution<double> normal(0, noise);
    FitJob job;
    job.options.threads = 1;
    std::vector<std::vector<double>> images;
    for (const Scene& scene : p.scenes) {
      images.emplace_back();
      const Image exact = render(scene, plan(scene, truth), truth, {}, 1).intensity;
      for (const double value : exact.values()) images.back().push_back(kGain * value + normal(p.random));
    }
    const ParameterRef gain = p.b.linear("gain", 900), offset = p.b.linear("offset", 5);
    p.b.table[gain].lower = 0;
    for (int k = 0; k < p.b.table.size(); ++k) {
      Parameter& of = p.b.table[k];
      if (of.free && !of.linear) of.value = p.between(of.lower, of.upper);
    }
    for (std::size_t g = 0; g < p.scenes.size(); ++g) job.micrographs.push_back(micrograph_of(family.name, p.scenes[g], images[g], gain, offset, {noise, 0}));
    job.parameters = p.b.table;
    const FitResult r = fit(job);
    bool wrong = false, limit = false;
    double worst = 0;
    for (const ParameterEstimate& e : r.parameters) {
      if (e.linear) continue;
      limit = limit || !e.limit.empty();
      if (!e.limit.empty()) continue;
      const double off = std::abs(e.value - truth[static_cast<std::size_t>(p.b.table.find(e.name).index)]);
      worst = std::max(worst, off / e.stderr_);
      wrong = wrong || !(off <= 5 * e.stderr_);
    }
    const std::scoped_lock lock(mutex);
    ++count.problems;
    if (r.ambiguous) {
      ++(std::any_of(r.rivals.begin(), r.rivals.end(), [](const RivalMinimum& rival) { return rival.likelihood_ratio > 0.01; }) ? count.undecided : count.ambiguous);
    } else if (!r.has_answer()) {
      ++count.refused;
    } else if (wrong) {
      ++count.wrong;
    } else {
      ++(limit ? count.limits : count.right);
    }
    if (r.has_answer() ? wrong : true) {
      std::printf("  %s %d, noise %.3f, %s: reduced chi-square %.4f, worst %.1f standard errors;", family.name.c_str(), first_seed + i, noise / kGain,
                  r.ambiguous ? "ambiguous" : !r.has_answer() ? "no answer" : "WRONG", r.reduced_chi_square, worst);
      for (const ParameterEstimate& e : r.parameters)
        if (!e.linear) std::printf(" %s %.5g +- %.2g (%.5g)", e.name.c_str(), e.value, e.stderr_, truth[static_cast<std::size_t>(p.b.table.find(e.name).index)]);
      for (const RivalMinimum& rival : r.rivals) std::printf(" rival %.2g", rival.odds);
      std::printf(" %s\n", r.has_answer() ? "" : r.verdict.c_str());
    }
  });
  std::printf("  %s: %d problems, %d right, %d limits, %d undecided, %d ambiguous, %d without an answer, %d WRONG\n", family.name.c_str(), count.problems, count.right, count.limits,
              count.undecided, count.ambiguous, count.refused, count.wrong);
  return count;
}

class GlobalSearch : public ::testing::TestWithParam<std::size_t> {};
class LongGlobalSearch : public GlobalSearch {};

// A few of every family but shells, which take seconds each.
TEST_P(GlobalSearch, FindsTheOrder) {
  const Count count = solve(kFamilies[GetParam()], 4);
  EXPECT_EQ(count.wrong, 0);
  EXPECT_GE(count.right, 3);
}

// Between two rings of this droplet the retardance has its maximum: planned by what changes from one end of a pixel to the other, one point served
// as the mean of pixels there, 0.04 wrong, and the fit left the truth by 11 standard errors when it was planned anew.
TEST(PixelMeansInAFit, APictureWhoseRetardanceTurnsBackWithinAPixel) {
  const Count count = solve(kFamilies[1], 1, 1617);
  EXPECT_EQ(count.right, 1);
}

// One in 1,000, as asked of the tool.
TEST_P(LongGlobalSearch, IsNeverConfidentlyWrong) {
  const Count count = solve(kFamilies[GetParam()], problems_or(3000), first_problem());
  EXPECT_LE(count.wrong, count.problems / 1000);
  EXPECT_LE(count.ambiguous + count.undecided, count.problems / 100);
}

// The same on pictures by wave optics, for the families that are finite: 100 of each. Ripples of large droplets may be as likely as each other.
class LongWaveSearch : public GlobalSearch {};
TEST_P(LongWaveSearch, IsNeverConfidentlyWrong) {
  const Count count = solve(kFamilies[GetParam()], problems_or(100), first_problem(), Ceiling::wave);
  EXPECT_EQ(count.wrong, 0);
  EXPECT_LE(count.ambiguous, count.problems / 100);
  EXPECT_LE(count.undecided, count.problems / 20);
}

// The lowest chi-square of this shell lies in a resonance 0.6 nm wide that follows the noise, 17 of its standard errors from the truth: the valley around it is the likelier answer.
TEST(WaveSearch, AResonanceThatFollowsTheNoiseIsNotTheAnswer) {
  const Count count = solve(kFamilies[2], 1, 69, Ceiling::wave);
  EXPECT_EQ(count.right, 1);
}

std::string family_name(const ::testing::TestParamInfo<std::size_t>& info) { return kFamilies[info.param].name; }
INSTANTIATE_TEST_SUITE_P(Families, GlobalSearch, ::testing::Values(0, 1, 3, 4), family_name);
INSTANTIATE_TEST_SUITE_P(Finite, LongWaveSearch, ::testing::Range<std::size_t>(0, 3), family_name);
INSTANTIATE_TEST_SUITE_P(Families, LongGlobalSearch, ::testing::Range<std::size_t>(0, 5), family_name);

}  // namespace
}  // namespace birefit
