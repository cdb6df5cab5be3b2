// Light of a condenser against tables that stand-alone programs made from formulas alone (tests/data/instrument), and
// one way to compute it against another.

#include <cmath>
#include <numbers>
#include <string>

#include <gtest/gtest.h>

#include "birefit/error.h"
#include "core/quadrature.h"
#include "instrument/exposure.h"
#include "reference_table.h"
#include "render/exposed.h"
#include "samples/kind.h"
#include "scene_builder.h"

namespace birefit {
namespace {

using testing::ReferenceTable;

/// Light of 550 or 590 nm between a polarizer along x and one across it.
struct CondenserScene : testing::TableBuilder {
  Scene scene;
  Demand demand;
  CondenserScene(double wavelength_nm, double n_o, double n_e, double n_host) {
    scene.view.width = scene.view.height = 1;
    scene.surround_index = fixed("index", n_host);
    scene.microscope.wavelength_nm = fixed("wavelength_nm", wavelength_nm);
    scene.microscope.polarizer_deg = fixed("polarizer_deg", 0);
    scene.microscope.analyzer_deg = fixed("analyzer_deg", 90);
    ConstantIndices material;
    material.ordinary = fixed("ordinary", n_o), material.birefringence = fixed("birefringence", n_e - n_o);
    scene.material = material;
  }
  void plate(double thickness_um, double tilt_deg, double azimuth_deg) {
    Cell cell;
    cell.thickness_um = fixed("thickness_um", thickness_um);
    UniformDirector director;
    director.tilt_deg = fixed("tilt_deg", tilt_deg), director.azimuth_deg = fixed("azimuth_deg", azimuth_deg);
    cell.director = director;
    scene.sample = cell;
  }
  void ball(double radius_um, double objective_na, int pixels, double pixel_um) {
    Droplet droplet;
    droplet.diameter_um = fixed("diameter_um", 2 * radius_um);
    scene.sample = droplet;
    scene.microscope.objective_na = fixed("objective_na", objective_na);
    scene.view.width = scene.view.height = pixels;
    scene.view.pixel_size_um = fixed("pixel_um", pixel_um);
    scene.view.center_x_px = fixed("center_x", 0.5 * (pixels - 1));
    scene.view.center_y_px = fixed("center_y", 0.5 * (pixels - 1));
    demand.ceiling = Ceiling::wave;
  }
  Condenser& condenser(double na) {
    Condenser& c = scene.microscope.condenser.emplace();
    c.na = fixed("condenser_na", na);
    return c;
  }
  RenderPlan planned() const { return plan(scene, demand, table.values()); }
  Image picture() const { return render(scene, planned(), table.values(), {}, 1).intensity; }
};

double relative_rms(const Image& a, const Image& b) {
  double difference = 0, size = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    difference += square(a.values()[i] - b.values()[i]);
    size += square(b.values()[i]);
  }
  return std::sqrt(difference / size);
}

// Homogeneous plates under apertures of up to 0.6, by both ceilings.
TEST(CondenserLight, Plates) {
  const ReferenceTable rows(testing::data_path("instrument/aperture_plate.csv"));
  ASSERT_GT(rows.size(), 100u);
  for (std::size_t row = 0; row < rows.size(); ++row)
    for (const bool reflections : {true, false}) {
      CondenserScene s(550, rows.number(row, "n_o"), rows.number(row, "n_e"), rows.number(row, "n_host"));
      s.plate(rows.number(row, "thickness_um"), rows.number(row, "tilt_deg"), rows.number(row, "azimuth_deg"));
      s.demand.ceiling = reflections ? Ceiling::reflections : Ceiling::one_way;
      s.demand.intensity_accuracy = 1e-7;
      if (const double na = rows.number(row, "condenser_na"); na > 0) s.condenser(na);
      // The table has nine digits, and says how far its own sum had settled.
      EXPECT_NEAR(s.picture()(0, 0), rows.number(row, reflections ? "I_reflections" : "I_one_way"),
                  1e-6 + 3 * rows.number(row, "change_on_doubling"))
          << row << (reflections ? " reflections" : " one way");
    }
}

// Directions that are normally distributed about one, cut where waves cease to travel: what [S4] calls a coherence
// size.
TEST(CondenserLight, CoherenceSizes) {
  const ReferenceTable rows(testing::data_path("instrument/coherence_plate.csv"));
  ASSERT_GT(rows.size(), 10u);
  for (std::size_t row = 0; row < rows.size(); ++row) {
    CondenserScene s(550, 1.658, 1.486, 1);
    s.plate(20, 45, 0);
    s.table[s.scene.microscope.polarizer_deg].value = 45;
    s.table[s.scene.microscope.analyzer_deg].value = 135;
    s.demand.intensity_accuracy = 1e-6;
    const double k0 = 2 * std::numbers::pi / 0.55, sigma = 1 / (k0 * rows.number(row, "coherence_um")),
                 middle = std::sin(rows.number(row, "incidence_deg") * std::numbers::pi / 180);
    // Seven standard deviations about the middle, but for what lies beyond 0.995 of grazing incidence: so far the
    // table's own sum goes.
    constexpr double kEnd = 0.995, kReach = 7;
    std::vector<double> x, wx, y, wy;
    // The whole half space has echoes up to grazing incidence, where they are sharp, and takes seconds.
    const bool whole = rows.number(row, "coherence_um") < 0.5,
               seldom = std::fmod(rows.number(row, "incidence_deg"), 60) != 0;
    if (whole && seldom) continue;
    legendre_nodes(whole ? 400 : 150, x, wx);
    legendre_nodes(whole ? 240 : 90, y, wy);
    Exposure exposure;
    double all = 0;
    const double left = std::max(-kEnd, middle - kReach * sigma), right = std::min(kEnd, middle + kReach * sigma);
    for (std::size_t i = 0; i < x.size(); ++i) {
      const double kx = 0.5 * (left + right + x[i] * (right - left)),
                   up = std::min(kReach * sigma, std::sqrt(kEnd * kEnd - kx * kx));
      for (std::size_t j = 0; j < y.size(); ++j) {
        const double ky = y[j] * up, away = square(kx - middle) + square(ky),
                     w = wx[i] * wy[j] * up * std::exp(-away / (2 * sigma * sigma));
        exposure.directions.emplace_back(s.scene.microscope, Direction{}, std::array<double, 2>{kx, ky});
        exposure.weights.push_back(w);
        all += w;
      }
    }
    for (double& w : exposure.weights) w /= all;
    for (const bool reflections : {true, false}) {
      s.demand.ceiling = reflections ? Ceiling::reflections : Ceiling::one_way;
      const Theta theta = s.table.values();
      Rendering sum;
      render(s.scene, plan(s.scene, s.demand, theta), exposure, theta, {}, 1, sum);
      EXPECT_NEAR(sum.intensity(0, 0), rows.number(row, reflections ? "I_reflections" : "I_one_way"),
                  std::max(1e-4, 3 * rows.number(row, "change_on_refining")))
          << row << (reflections ? " reflections" : " one way");
    }
  }
}

// Radial droplets by their exact series, aplanatic condenser and objective: at points along x and along the diagonal.
TEST(CondenserLight, RadialDroplets) {
  const ReferenceTable rows(testing::data_path("instrument/condenser_droplet.csv"));
  std::size_t row = 0;
  while (row < rows.size()) {
    const auto same = [&](std::size_t other) {
      for (const char* of : {"radius_um", "n_o", "n_e", "n_host", "objective_na", "condenser_na"})
        if (rows.number(other, of) != rows.number(row, of)) return false;
      return true;
    };
    std::size_t end = row;
    while (end < rows.size() && same(end)) ++end;
    CondenserScene s(590, rows.number(row, "n_o"), rows.number(row, "n_e"), rows.number(row, "n_host"));
    constexpr double kPixelUm = 0.5;
    s.ball(rows.number(row, "radius_um"), rows.number(row, "objective_na"),
           static_cast<int>(std::ceil(2 * rows.number(end - 1, "rho_um") / kPixelUm)) + 3, kPixelUm);
    s.scene.microscope.aplanatic = true;
    s.demand.intensity_accuracy = 1e-3;
    s.condenser(rows.number(row, "condenser_na"));
    const Theta theta = s.table.values();
    RenderPlan chosen = plan(s.scene, s.demand, theta);
    EXPECT_GT(chosen.condenser_rings, 0);
    const Values<double> value(theta, {}, nullptr);
    const Exposure axis = exposure_of(s.scene.microscope);
    const auto image = make_image<double>(s.scene, chosen, value, axis.directions.front());
    image->tabulate(SampleImage<double>::Wanted::picture, 1);
    double difference = 0, size = 0;
    const double middle = 0.5 * (s.scene.view.width - 1);
    for (; row < end; ++row)
      for (const bool diagonal : {false, true}) {
        const double r = rows.number(row, "rho_um") / kPixelUm, along = diagonal ? r / std::sqrt(2.0) : r;
        double light = 0;
        image->light(middle + along, middle - (diagonal ? along : 0), &light);
        const double expected = rows.number(row, diagonal ? "I_45deg" : "I_0deg");
        // The table's own sum over directions and ours.
        EXPECT_NEAR(light, expected, std::max(1e-4, 3 * rows.number(row, "change_from_fewer_directions")) + 1e-3)
            << row;
        difference += square(light - expected), size += square(expected);
      }
    EXPECT_LT(std::sqrt(difference / size), 0.005 + 0.005) << row;
  }
}

// Propagated waves of the same droplet, direction by direction, with either pupil.
TEST(CondenserLight, PropagatedWavesAsTheSeries) {
  for (const bool aplanatic : {false, true}) {
    CondenserScene s(590, 1.52, 1.68, 1.5);
    s.ball(2, 0.5, 48, 0.15);
    s.scene.microscope.aplanatic = aplanatic;
    s.condenser(0.3);
    s.demand.intensity_accuracy = 1e-3;
    const Image series = s.picture();
    s.demand.method = "split_step";
    const RenderPlan waves = s.planned();
    EXPECT_GT(waves.condenser_rings, 0);
    const Image propagated = render(s.scene, waves, s.table.values(), {}, 2).intensity;
    EXPECT_LT(relative_rms(propagated, series), waves.numerical_error + waves.model_error) << aplanatic;
    s.scene.microscope.condenser.reset();
    const Image along_axis = render(s.scene, s.planned(), s.table.values(), {}, 2).intensity;
    EXPECT_GT(relative_rms(along_axis, series), 3 * (waves.numerical_error + waves.model_error))
        << "a condenser that changes nothing tests nothing";
  }
}

// A tilted condenser has no round picture, and is propagated; a stop in its middle takes the axis away.
TEST(CondenserLight, AnnuliAreDifferencesOfDiscs) {
  const auto light = [](double na, double inner, bool waves) {
    CondenserScene s(590, 1.52, 1.68, 1.5);
    if (waves)
      s.ball(2, 0.5, 24, 0.25);
    else
      s.plate(20, 50, 30);
    s.demand.intensity_accuracy = waves ? 1e-4 : 1e-6;
    Condenser& c = s.condenser(na);
    if (inner > 0) c.inner_na = s.fixed("inner", inner);
    return s.picture();
  };
  for (const bool waves : {false, true}) {
    const Image large = light(0.4, 0, waves), small = light(0.25, 0, waves), ring = light(0.4, 0.25, waves);
    const double share = square(0.25 / 0.4);
    for (std::size_t i = 0; i < ring.size(); ++i)
      EXPECT_NEAR(share * small.values()[i] + (1 - share) * ring.values()[i], large.values()[i], waves ? 3e-4 : 4e-6)
          << i;
  }
}

// By the condenser's own numbers, and by the rest of them through its light.
TEST(CondenserLight, HasDerivatives) {
  struct Case {
    const char* name;
    bool waves;
    const char* method;
    double tolerance;  ///< of the largest slope: the rules' own
  };
  for (const Case& c : {Case{"plate", false, "auto", 1e-4}, Case{"series", true, "auto", 1e-3},
                        Case{"propagated", true, "split_step", 3e-2}}) {
    SCOPED_TRACE(c.name);
    CondenserScene s(590, 1.52, 1.68, 1.5);
    if (c.waves)
      s.ball(2, 0.5, 12, 0.5);
    else
      s.plate(8, 50, 30);
    s.demand.method = c.method;
    s.demand.intensity_accuracy = c.waves ? 1e-4 : 1e-7;
    Condenser& condenser = s.condenser(0.3);
    condenser.inner_na = s.fixed("inner_na", 0.1);
    std::vector<ParameterRef> by{condenser.na, condenser.inner_na, s.scene.microscope.wavelength_nm,
                                 std::get<ConstantIndices>(s.scene.material).birefringence};
    if (!c.waves) {
      condenser.tilt_deg = s.fixed("tilt", 7), condenser.tilt_azimuth_deg = s.fixed("tilt_azimuth", 25);
      by.push_back(condenser.tilt_deg), by.push_back(condenser.tilt_azimuth_deg);
    }
    Theta theta = s.table.values();
    RenderPlan chosen = plan(s.scene, s.demand, theta);
    chosen.condenser_rings += 2;
    std::vector<int> active;
    for (const ParameterRef& ref : by) active.push_back(ref.index);
    const Rendering all = render(s.scene, chosen, theta, active, 2);
    for (std::size_t j = 0; j < active.size(); ++j) {
      const std::size_t at = static_cast<std::size_t>(active[j]);
      const double kept = theta[at], h = 1e-4 * kept;
      theta[at] = kept + h;
      const Image up = render(s.scene, chosen, theta, {}, 2).intensity;
      theta[at] = kept - h;
      const Image down = render(s.scene, chosen, theta, {}, 2).intensity;
      theta[at] = kept;
      double largest = 0, worst = 0;
      for (std::size_t i = 0; i < up.size(); ++i) {
        const double slope = (up.values()[i] - down.values()[i]) / (2 * h);
        largest = std::max(largest, std::abs(slope));
        worst = std::max(worst, std::abs(slope - all.derivatives[j].values()[i]));
      }
      EXPECT_LT(worst, c.tolerance * largest) << "by " << s.table[active[j]].name << ", of " << largest;
    }
  }
}

// The transport is chosen for the steepest light, too: cells that twist about the axis, nearly along it, show along
// it nothing of what slanted light meets. Against many steps.
TEST(CondenserLight, LayersShowWhatBothLensesTakeIn) {
  CondenserScene wide(590, 1.52, 1.68, 1.5), same(590, 1.52, 1.68, 1.5);
  wide.plate(8, 50, 30), same.plate(8, 50, 30);
  wide.demand.intensity_accuracy = same.demand.intensity_accuracy = 1e-7;
  Condenser& condenser = wide.condenser(0.6);
  wide.scene.microscope.objective_na = wide.fixed("objective_na", 0.3);
  const ParameterRef as_wide = same.condenser(0.3).na;
  const Theta theta = wide.table.values(), theta_same = same.table.values();
  const RenderPlan chosen = plan(wide.scene, wide.demand, theta),
                   chosen_same = plan(same.scene, same.demand, theta_same);
  EXPECT_TRUE(chosen.warnings.empty());
  const Rendering seen =
      render(wide.scene, chosen, theta, {wide.scene.microscope.objective_na.index, condenser.na.index}, 1);
  const Rendering as_one = render(same.scene, chosen_same, theta_same, {as_wide.index}, 1);
  EXPECT_DOUBLE_EQ(seen.intensity(0, 0), as_one.intensity(0, 0));
  EXPECT_NEAR(seen.derivatives[0](0, 0), as_one.derivatives[0](0, 0), 1e-14);  // a mean and its slope, rounded
  EXPECT_NE(seen.derivatives[0](0, 0), 0);
  EXPECT_EQ(seen.derivatives[1](0, 0), 0);

  // A dark field: an annulus beyond the objective.
  condenser.inner_na = wide.fixed("inner_na", 0.4);
  EXPECT_THROW(plan(wide.scene, wide.demand, wide.table.values()), UserError);
}

TEST(CondenserLight, StepsHoldForEveryDirection) {
  for (const auto& [twist_deg, pretilt_deg] : {std::pair{240.0, 25.0}, {400.0, 80.0}, {1000.0, 88.0}}) {
    CondenserScene s(550, 1.52, 1.74, 1.5);
    Cell cell;
    cell.thickness_um = s.fixed("thickness_um", 9);
    TwistedDirector director;
    director.twist_deg = s.fixed("twist_deg", twist_deg), director.azimuth_deg = s.fixed("azimuth_deg", 12);
    director.pretilt_deg = s.fixed("pretilt_deg", pretilt_deg);
    cell.director = director;
    s.scene.sample = cell;
    s.condenser(0.6);
    const RenderPlan chosen = s.planned();
    RenderPlan fine = chosen;
    fine.method = "magnus6", fine.mesh.clear(), fine.steps = 400;
    const Theta theta = s.table.values();
    EXPECT_NEAR(render(s.scene, chosen, theta, {}, 1).intensity(0, 0),
                render(s.scene, fine, theta, {}, 1).intensity(0, 0), s.demand.intensity_accuracy)
        << twist_deg << " by " << chosen.method << " in " << chosen.steps;
  }
}

// C24: an empty field between parallel polarizers is 1 for every direction.
TEST(CondenserLight, EmptyFieldsAreBright) {
  for (const bool aplanatic : {false, true})
    for (const char* method : {"auto", "split_step"}) {
      CondenserScene s(590, 1.5, 1.5 + 1e-9, 1.5);
      s.ball(2, 0.5, 10, 0.6);
      s.demand.method = method;
      s.scene.microscope.aplanatic = aplanatic;
      s.table[s.scene.microscope.analyzer_deg].value = 0;
      s.condenser(0.4);
      RenderPlan chosen = s.planned();
      chosen.condenser_rings = 2;
      const Image picture = render(s.scene, chosen, s.table.values(), {}, 1).intensity;
      for (const double light : picture.values()) EXPECT_NEAR(light, 1, 1e-6) << method << aplanatic;
    }
}

TEST(CondenserLight, LightThatTheMediumDoesNotHaveIsRefused) {
  CondenserScene s(550, 1.52, 1.6, 1);
  s.plate(5, 10, 20);
  s.condenser(1.1);
  EXPECT_THROW(s.planned(), UserError);
  s.table[s.scene.microscope.condenser->na].value = 0.4;
  s.scene.microscope.condenser->inner_na = s.fixed("inner", 0.5);
  EXPECT_THROW(s.planned(), UserError);
}

// A small aperture changes less than the intensity's error, and is not computed; the plan says so.
TEST(CondenserLight, IsLeftOutWhereItChangesNothing) {
  CondenserScene s(550, 1.52, 1.6, 1.5);
  s.plate(3, 0, 45);
  s.condenser(0.01);
  const RenderPlan chosen = s.planned();
  EXPECT_EQ(chosen.condenser_rings, 0);
  EXPECT_NE(chosen.reasons.back().find("stands for all of it"), std::string::npos) << chosen.reasons.back();
}

}  // namespace
}  // namespace birefit
