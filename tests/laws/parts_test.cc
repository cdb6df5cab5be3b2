// Every polarizing part of the microscope with every kind of sample that makes a picture. Intensities are bilinear in
// the states on both sides, whatever the sample: that alone decides what parts do, and nothing here knows a sample.

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include <gtest/gtest.h>

#include "every_kind.h"

namespace birefit {
namespace {

using testing::Kind;
using Setting = std::function<void(Microscope&, Kind&)>;

ParameterRef azimuth(Kind& kind, double deg) { return kind.number("azimuth", deg); }
void set_polarizers(Microscope& m, Kind& kind, double polarizer_deg, double analyzer_deg) {
  m.polarizer_deg = azimuth(kind, polarizer_deg), m.analyzer_deg = azimuth(kind, analyzer_deg);
}
Retarder retarder(Kind& kind, double phase_deg, double azimuth_deg) {
  Retarder r;
  r.phase_deg = kind.number("phase", phase_deg), r.azimuth_deg = azimuth(kind, azimuth_deg);
  return r;
}

/// The picture under a setting, by the plan that the scene has as it stands: one discretisation for all settings.
Image picture(const Kind& of, const RenderPlan& plan, const Setting& setting) {
  Kind kind = of;
  kind.scene.microscope.before.clear(), kind.scene.microscope.behind.clear();
  setting(kind.scene.microscope, kind);
  return render(kind.scene, plan, kind.table.values(), {}, 1).intensity;
}
RenderPlan plan_of(Kind kind) {
  // Planned for elliptic light: for a picture that is as good as any.
  set_polarizers(kind.scene.microscope, kind, 17, 80);
  kind.scene.microscope.behind.emplace_back(retarder(kind, 70, 25));
  return plan(kind.scene, kind.demand, kind.table.values());
}

struct Term {
  double factor;
  Setting setting;
};
/// max |sum of factor x picture|
double residual(const Kind& kind, const RenderPlan& plan, const std::vector<Term>& terms) {
  Image sum(testing::kSmallSide, testing::kSmallSide);
  for (const Term& term : terms) {
    const Image image = picture(kind, plan, term.setting);
    for (std::size_t i = 0; i < sum.size(); ++i) sum.values()[i] += term.factor * image.values()[i];
  }
  double most = 0;
  for (const double v : sum.values()) most = std::max(most, std::abs(v));
  return most;
}

// What is exact in the states is exact to rounding where a pixel is the mean of points. Means of fringes in closed form
// go by differences of amplitude and phase between pixels, a propagated picture by a spectrum, and squares of a disc
// that have no symmetry are interpolated where their own light lets them, to a small part of the accuracy of 1e-4. All
// of it is far below what any confusion of parts makes, which is of order one.
constexpr double kRounding = 1e-7;

class Parts : public ::testing::Test {
 protected:
  /// Calls what(kind, plan, random) for every kind.
  template <class F>
  void for_every_kind(const F& what) {
    std::mt19937_64 random(7);
    for (const Kind& kind : testing::every_kind_small()) {
      SCOPED_TRACE(kind.name);
      what(kind, plan_of(kind),
           [&](double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); });
    }
  }
};

// A plate without retardance changes nothing, but takes the way of elliptic light through the program: both ways are
// one.
TEST_F(Parts, APlateWithoutRetardanceChangesNothing) {
  for_every_kind([](const Kind& kind, const RenderPlan& plan, const auto& draw) {
    const double p = draw(0, 180), a = draw(0, 180), f = draw(0, 180);
    const auto with = [&](bool before, bool behind) {
      return [=](Microscope& m, Kind& k) {
        set_polarizers(m, k, p, a);
        if (before) m.before.emplace_back(retarder(k, 0, f));
        if (behind) m.behind.emplace_back(retarder(k, 0, f));
      };
    };
    EXPECT_LT(residual(kind, plan, {{1, with(false, false)}, {-1, with(true, false)}}), kRounding);
    EXPECT_LT(residual(kind, plan, {{1, with(false, false)}, {-1, with(false, true)}}), kRounding);
  });
}

TEST_F(Parts, TwoQuarterWavePlatesAreAHalfWavePlate) {
  for_every_kind([](const Kind& kind, const RenderPlan& plan, const auto& draw) {
    const double p = draw(0, 180), a = draw(0, 180), f = draw(0, 180);
    const auto with = [=](std::vector<double> phases, bool before) {
      return [=](Microscope& m, Kind& k) {
        set_polarizers(m, k, p, a);
        for (const double phase : phases) (before ? m.before : m.behind).emplace_back(retarder(k, phase, f));
      };
    };
    // A half-wave plate turns a polarizer to its mirror image in the axis.
    const auto mirrored = [=](double polarizer, double analyzer) {
      return [=](Microscope& m, Kind& k) { set_polarizers(m, k, polarizer, analyzer); };
    };
    EXPECT_LT(residual(kind, plan, {{1, with({90, 90}, true)}, {-1, with({180}, true)}}), kRounding);
    EXPECT_LT(residual(kind, plan, {{1, with({90, 90}, true)}, {-1, mirrored(2 * f - p, a)}}), kRounding);
    EXPECT_LT(residual(kind, plan, {{1, with({90, 90}, false)}, {-1, mirrored(p, 2 * f - a)}}), kRounding);
    EXPECT_LT(residual(kind, plan, {{1, with({70, -70}, true)}, {-1, mirrored(p, a)}}), kRounding);
    EXPECT_LT(residual(kind, plan, {{1, with({360}, false)}, {-1, mirrored(p, a)}}), kRounding);
  });
}

TEST_F(Parts, ARotatorTurnsThePolarizerBeforeAndTheAnalyserBehind) {
  for_every_kind([](const Kind& kind, const RenderPlan& plan, const auto& draw) {
    const double p = draw(0, 180), a = draw(0, 180), by = draw(-90, 90);
    const auto turned = [=](double polarizer, double analyzer) {
      return [=](Microscope& m, Kind& k) { set_polarizers(m, k, polarizer, analyzer); };
    };
    const auto with = [=](bool before) {
      return [=](Microscope& m, Kind& k) {
        set_polarizers(m, k, p, a);
        (before ? m.before : m.behind).emplace_back(Rotator{k.number("angle", by)});
      };
    };
    EXPECT_LT(residual(kind, plan, {{1, with(true)}, {-1, turned(p + by, a)}}), kRounding);
    EXPECT_LT(residual(kind, plan, {{1, with(false)}, {-1, turned(p, a - by)}}), kRounding);
  });
}

TEST_F(Parts, UnpolarizedLightIsTheMeanOfAnyTwoOrthogonalStates) {
  for_every_kind([](const Kind& kind, const RenderPlan& plan, const auto& draw) {
    const double p = draw(0, 180), a = draw(0, 180), f = draw(0, 180), phase = draw(20, 160);
    const auto state = [=](double polarizer, bool elliptic) {
      return [=](Microscope& m, Kind& k) {
        set_polarizers(m, k, polarizer, a);
        if (elliptic) m.before.emplace_back(retarder(k, phase, f));
      };
    };
    const Setting unpolarized = [=](Microscope& m, Kind& k) { m.polarizer_deg = {}, m.analyzer_deg = azimuth(k, a); };
    for (const bool elliptic : {false, true})
      EXPECT_LT(residual(kind, plan, {{1, unpolarized}, {-0.5, state(p, elliptic)}, {-0.5, state(p + 90, elliptic)}}),
                kRounding);
  });
}

TEST_F(Parts, WithoutAnalyserAllIsSeen) {
  for_every_kind([](const Kind& kind, const RenderPlan& plan, const auto& draw) {
    const double p = draw(0, 180), a = draw(0, 180), f = draw(0, 180), phase = draw(20, 160);
    const auto behind = [=](double analyzer, bool elliptic) {
      return [=](Microscope& m, Kind& k) {
        set_polarizers(m, k, p, analyzer);
        if (elliptic) m.behind.emplace_back(retarder(k, phase, f));
      };
    };
    const Setting none = [=](Microscope& m, Kind& k) { m.polarizer_deg = azimuth(k, p), m.analyzer_deg = {}; };
    for (const bool elliptic : {false, true})
      EXPECT_LT(residual(kind, plan, {{1, none}, {-1, behind(a, elliptic)}, {-1, behind(a + 90, elliptic)}}),
                kRounding);
  });
}

TEST_F(Parts, APolarizerThatLeaksLetsTheOtherStateThrough) {
  for_every_kind([](const Kind& kind, const RenderPlan& plan, const auto& draw) {
    const double p = draw(0, 180), a = draw(0, 180), ratio = draw(2, 50), other = draw(2, 50);
    const auto ideal = [=](double polarizer, double analyzer) {
      return [=](Microscope& m, Kind& k) { set_polarizers(m, k, polarizer, analyzer); };
    };
    const Setting leaking = [=](Microscope& m, Kind& k) {
      set_polarizers(m, k, p, a);
      m.polarizer_extinction_ratio = k.number("ratio", ratio), m.analyzer_extinction_ratio = k.number("other", other);
    };
    // Of the flux behind the polarizer 1 / (1 + ratio) has the other state.
    const double in = ratio / (1 + ratio), across = 1 / (1 + ratio);
    EXPECT_LT(residual(kind, plan,
                       {{1, leaking},
                        {-in, ideal(p, a)},
                        {-across, ideal(p + 90, a)},
                        {-in / other, ideal(p, a + 90)},
                        {-across / other, ideal(p + 90, a + 90)}}),
              kRounding);
  });
}

// Four states before and four behind tell all others: light is linear in the Stokes vectors of both sides. Of elliptic
// light (its Stokes vector from the plate's own rotation of the sphere) the picture is the sum of theirs.
TEST_F(Parts, EllipticLightIsBilinearInStokesVectors) {
  for_every_kind([](const Kind& kind, const RenderPlan& plan, const auto& draw) {
    const double p = draw(0, 180), a = draw(0, 180), f = draw(0, 180), phase = draw(-170, 170), g = draw(0, 180),
                 psi = draw(-170, 170);
    constexpr double kRadian = 3.14159265358979323846 / 180;
    // Light of a polarizer through a plate: exp(i phase / 2) along its axis, exp(-i phase / 2) across, S3 = 2
    // Im(conj(Ex) Ey). What an analyser behind a plate lets through is the analyser's state through the plate's
    // adjoint.
    const auto stokes = [&](double polarizer, double axis, double delay) {
      const double c2 = std::cos(2 * (polarizer - axis) * kRadian), s2 = std::sin(2 * (polarizer - axis) * kRadian);
      const double along = c2, diagonal = s2 * std::cos(delay * kRadian), circular = -s2 * std::sin(delay * kRadian);
      const double ca = std::cos(2 * axis * kRadian), sa = std::sin(2 * axis * kRadian);
      return std::array<double, 4>{1, along * ca - diagonal * sa, along * sa + diagonal * ca, circular};
    };
    // Basis: along x, along y, along the diagonal, circular (a quarter-wave plate at 45 degrees behind a polarizer at
    // 0).
    const auto weights = [](const std::array<double, 4>& s, double circular_sign) {
      const double circular = circular_sign * s[3];
      const double rest = 1 - s[2] - circular;  // S0 of what is left for x and y
      return std::array<double, 4>{0.5 * (rest + s[1]), 0.5 * (rest - s[1]), s[2], circular};
    };
    const double before_sign = stokes(0, 45, 90)[3], behind_sign = stokes(0, 45, -90)[3];
    const std::array<double, 4> in = weights(stokes(p, f, phase), before_sign),
                                out = weights(stokes(a, g, -psi), behind_sign);
    std::vector<Term> terms{{-1, [=](Microscope& m, Kind& k) {
                               set_polarizers(m, k, p, a);
                               m.before.emplace_back(retarder(k, phase, f));
                               m.behind.emplace_back(retarder(k, psi, g));
                             }}};
    const double angles[] = {0, 90, 45, 0};
    for (std::size_t i = 0; i < 4; ++i)
      for (std::size_t j = 0; j < 4; ++j)
        terms.push_back({in[i] * out[j], [=](Microscope& m, Kind& k) {
                           set_polarizers(m, k, angles[i], angles[j]);
                           if (i == 3) m.before.emplace_back(retarder(k, 90, 45));
                           if (j == 3) m.behind.emplace_back(retarder(k, 90, 45));
                         }});
    EXPECT_LT(residual(kind, plan, terms), kRounding);
  });
}

// Circular light has no azimuth: a circular polariscope may be turned about the axis.
TEST_F(Parts, ACircularPolariscopeHasNoAzimuth) {
  for_every_kind([](const Kind& kind, const RenderPlan& plan, const auto& draw) {
    const double by = draw(0, 180);
    const auto turned = [](double angle) {
      return [=](Microscope& m, Kind& k) {
        set_polarizers(m, k, angle, angle + 90);
        m.before.emplace_back(retarder(k, 90, angle + 45));
        m.behind.emplace_back(retarder(k, 90, angle - 45));
      };
    };
    EXPECT_LT(residual(kind, plan, {{1, turned(0)}, {-1, turned(by)}}), kRounding);
  });
}

TEST_F(Parts, ACompensatorThatUndoesACellLeavesDarkness) {
  std::mt19937_64 random(3);
  for (int draw = 0; draw < 5; ++draw) {
    const auto between = [&](double low, double high) {
      return std::uniform_real_distribution<double>(low, high)(random);
    };
    Kind kind;
    kind.scene.view.width = kind.scene.view.height = 1;
    Cell cell;
    const double thickness = between(1, 20), birefringence = between(0.02, 0.2), axis = between(0, 180);
    cell.thickness_um = kind.number("thickness", thickness);
    UniformDirector director;
    director.azimuth_deg = azimuth(kind, axis), director.tilt_deg = azimuth(kind, 0);
    cell.director = director;
    kind.scene.sample = cell;
    kind.scene.material = ConstantIndices{kind.number("ordinary", 1.5), kind.number("birefringence", birefringence)};
    kind.scene.surround_index = kind.number("surround", 1.0);
    kind.demand.ceiling = Ceiling::e_only;  // faces let ordinary and extraordinary light through alike: a retarder
    kind.scene.microscope.wavelength_nm = kind.number("wavelength", 550);
    const double p = between(0, 180);
    set_polarizers(kind.scene.microscope, kind, p, p + 90);
    const auto light = [&] {
      const Theta theta = kind.table.values();
      return render(kind.scene, plan(kind.scene, kind.demand, theta), theta, {}, 1).intensity(0, 0);
    };
    EXPECT_GT(light(), 1e-4) << draw;
    const Retarder undoing = retarder(kind, -360 * thickness * birefringence / 0.55, axis);
    kind.scene.microscope.before = {undoing};
    EXPECT_LT(light(), 1e-12) << draw;
    kind.scene.microscope.before.clear();
    kind.scene.microscope.behind = {undoing};
    EXPECT_LT(light(), 1e-12) << draw;
    // The same plate in nm, whose phase follows the wavelength as the cell's does.
    Retarder plate;
    plate.retardance_nm = kind.number("retardance", -1000 * thickness * birefringence);
    plate.azimuth_deg = azimuth(kind, axis);
    kind.scene.microscope.behind = {plate};
    for (const double nm : {450.0, 633.0}) {
      kind.scene.microscope.wavelength_nm = kind.number("wavelength", nm);
      EXPECT_LT(light(), 1e-12) << draw << ' ' << nm;
    }
  }
}

// Malus' law and extinction, of a sample that does nothing.
TEST_F(Parts, WithoutBirefringenceLightFollowsMalus) {
  Kind kind;
  kind.scene.view.width = kind.scene.view.height = 1;
  Crystal bar;
  bar.half_wave_voltage_v = kind.number("half_wave", 1000), bar.bias_v = kind.number("bias", 0);
  bar.slow_axis_deg = azimuth(kind, 30);
  kind.scene.sample = bar;
  kind.scene.microscope.wavelength_nm = kind.number("wavelength", 550);
  constexpr double kRatio = 500;
  for (const double between : {0.0, 20.0, 45.0, 77.0, 90.0}) {
    set_polarizers(kind.scene.microscope, kind, 12, 12 + between);
    const double cos2 = std::pow(std::cos(between * 3.14159265358979323846 / 180), 2);
    const auto light = [&] {
      const Theta theta = kind.table.values();
      return render(kind.scene, plan(kind.scene, kind.demand, theta), theta, {}, 1).intensity(0, 0);
    };
    kind.scene.microscope.analyzer_extinction_ratio = {};
    EXPECT_NEAR(light(), cos2, 1e-14);
    kind.scene.microscope.analyzer_extinction_ratio = kind.number("ratio", kRatio);
    EXPECT_NEAR(light(), cos2 + (1 - cos2) / kRatio, 1e-14);
  }
}

// Derivatives by everything that a part has, against central differences.
TEST_F(Parts, DerivativesByWhatPartsHave) {
  for_every_kind([](const Kind& of, const RenderPlan& plan, const auto& draw) {
    Kind kind = of;
    Microscope& m = kind.scene.microscope;
    set_polarizers(m, kind, draw(0, 180), draw(0, 180));
    m.polarizer_extinction_ratio = kind.number("ratio", 20), m.analyzer_extinction_ratio = kind.number("other", 30);
    const Retarder first = retarder(kind, draw(-170, 170), draw(0, 180)),
                   second = retarder(kind, draw(-170, 170), draw(0, 180));
    const Rotator rotator{kind.number("angle", draw(-60, 60))};
    Retarder quartz;
    quartz.retardance_nm = kind.number("retardance", draw(50, 900)), quartz.azimuth_deg = azimuth(kind, draw(0, 180));
    quartz.crystal = PlateCrystal::quartz;
    TiltedPlate berek;
    berek.thickness_um = kind.number("plate", 70), berek.tilt_deg = kind.number("tilt", draw(5, 20));
    berek.azimuth_deg = azimuth(kind, draw(0, 180)), berek.crystal = PlateCrystal::calcite;
    m.before = {first, rotator, berek}, m.behind = {second, quartz};
    const std::vector<int> active{berek.thickness_um.index,
                                  berek.tilt_deg.index,
                                  berek.azimuth_deg.index,
                                  quartz.retardance_nm.index,
                                  quartz.azimuth_deg.index,
                                  m.polarizer_deg.index,
                                  m.analyzer_deg.index,
                                  m.polarizer_extinction_ratio.index,
                                  m.analyzer_extinction_ratio.index,
                                  first.phase_deg.index,
                                  first.azimuth_deg.index,
                                  rotator.angle_deg.index,
                                  second.phase_deg.index,
                                  second.azimuth_deg.index};
    const Theta theta = kind.table.values();
    const Rendering exact = render(kind.scene, plan, theta, active, 1);
    // Along a line drawn at random through all of them: where it agrees at every pixel, each of them does.
    std::vector<double> along;
    for (std::size_t j = 0; j < active.size(); ++j) along.push_back(draw(0.5, 1) * (j % 2 ? 1 : -1));
    constexpr double kStep = 3e-4;  // degrees, and of a ratio: the third derivative leaves 1e-9
    Theta up = theta, down = theta;
    for (std::size_t j = 0; j < active.size(); ++j) {
      up[static_cast<std::size_t>(active[j])] += kStep * along[j];
      down[static_cast<std::size_t>(active[j])] -= kStep * along[j];
    }
    const Image plus = render(kind.scene, plan, up, {}, 1).intensity,
                minus = render(kind.scene, plan, down, {}, 1).intensity;
    for (std::size_t i = 0; i < plus.size(); ++i) {
      double slope = 0;
      for (std::size_t j = 0; j < active.size(); ++j) slope += along[j] * exact.derivatives[j].values()[i];
      ASSERT_NEAR(slope, (plus.values()[i] - minus.values()[i]) / (2 * kStep), 1e-7) << "pixel " << i;
    }
  });
}

}  // namespace
}  // namespace birefit
