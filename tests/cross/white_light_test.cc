// Cells in white light and behind filters against tables that stand-alone programs made from formulas alone
// (tests/data/instrument).

#include <cmath>
#include <memory>
#include <string>

#include <gtest/gtest.h>

#include "instrument/channel_light.h"
#include "scene_builder.h"
#include "white_light.h"

namespace birefit {
namespace {

using testing::ReferenceTable;

/// A cell of one pixel whose faces keep the tangential electric field, as ideal retarders do.
struct CellScene : testing::TableBuilder {
  Scene scene;
  Demand demand;
  CellScene(double thickness_um, double polarizer_deg, double analyzer_deg) {
    demand.ceiling = Ceiling::e_only;
    scene.view.width = scene.view.height = 1;
    scene.surround_index = fixed("index", 1.5);
    scene.microscope.wavelength_nm = fixed("wavelength_nm", 550);
    scene.microscope.polarizer_deg = fixed("polarizer_deg", polarizer_deg);
    scene.microscope.analyzer_deg = fixed("analyzer_deg", analyzer_deg);
    cell.thickness_um = fixed("thickness_um", thickness_um);
  }
  Cell cell;
  double light() {
    scene.sample = cell;
    const Theta theta = table.values();
    return render(scene, plan(scene, demand, theta), theta, {}, 1).intensity(0, 0);
  }
};

// E7 (Li et al., J. Disp. Technol. 1, 51 (2005), 25 C) twisted evenly, three lamps, the CIE's observer.
TEST(WhiteLight, TwistedCells) {
  const ReferenceTable rows(testing::data_path("instrument/twisted_cell.csv"));
  ASSERT_GT(rows.size(), 20u);
  for (std::size_t row = 0; row < rows.size(); ++row) {
    CellScene s(rows.number(row, "thickness_um"), rows.number(row, "polarizer_deg"), rows.number(row, "analyzer_deg"));
    TwistedDirector director;
    director.twist_deg = s.fixed("twist_deg", rows.number(row, "twist_deg"));
    director.azimuth_deg = s.fixed("azimuth_deg", rows.number(row, "entry_azimuth_deg"));
    s.cell.director = director;
    Dispersion ordinary, extraordinary;
    ordinary.coefficients = {1.4990, 0.0072, -2, 0.0003, -4};
    extraordinary.coefficients = {1.6933, 0.0078, -2, 0.0028, -4};
    for (Dispersion* d : {&ordinary, &extraordinary})
      d->form = Dispersion::Form::cauchy, d->lower_um = 0.3, d->upper_um = 1;
    LawIndices law;
    law.indices = DispersiveIndices{ordinary, extraordinary};
    s.scene.material = law;
    const std::string illuminant = rows.text(row, "illuminant");
    ChannelLight& light = s.scene.microscope.channel_light.emplace();
    if (illuminant == "A") light.lamp.planck_k = s.fixed("planck_k", illuminant_a().temperature_k);
    if (illuminant == "D65") light.lamp.table = std::make_shared<SpectralTable>(illuminant_d65());
    const std::vector<double> white =
        channels_of(light, s.table.values(), {colour_matching(0), colour_matching(1), colour_matching(2)}).white();
    for (int c = 0; c < 3; ++c) {
      light.sensitivity = std::make_shared<SpectralTable>(colour_matching(c));
      const std::size_t k = static_cast<std::size_t>(c);
      // The accuracy that a scene asks for by itself.
      EXPECT_NEAR(s.light() * white[k] / white[1], rows.number(row, std::string(1, "XYZ"[c])) / 100, 1e-4) << row << " "
                                                                                                           << "XYZ"[c];
    }
  }
}

// A retarder without dispersion behind filters of 1 to 40 nm that are Gaussian in wavelength.
TEST(WhiteLight, FilteredPlates) {
  const ReferenceTable rows(testing::data_path("instrument/filtered_plate.csv"));
  int seen = 0;
  for (const std::size_t row : rows.rows_where("dispersion", "none")) {
    const double retardance_um = rows.number(row, "retardance_589_um");
    CellScene s(retardance_um / 0.2, 0, 90);
    UniformDirector director;
    director.azimuth_deg = s.fixed("azimuth_deg", 45), director.tilt_deg = s.fixed("tilt_deg", 0);
    s.cell.director = director;
    ConstantIndices material;
    material.ordinary = s.fixed("ordinary", 1.5), material.birefringence = s.fixed("birefringence", 0.2);
    s.scene.material = material;
    s.table[s.scene.microscope.wavelength_nm].value = rows.number(row, "centre_nm");
    s.scene.microscope.bandwidth_nm = s.fixed("bandwidth_nm", rows.number(row, "fwhm_nm"));
    EXPECT_NEAR(s.light(), rows.number(row, "I_gauss_wavelength"), 1e-4) << row;
    ++seen;
  }
  EXPECT_GT(seen, 50);
}

/// A cell that does nothing.
CellScene nothing_between(double polarizer_deg, double analyzer_deg) {
  CellScene s(1, polarizer_deg, analyzer_deg);
  UniformDirector director;
  director.azimuth_deg = s.fixed("azimuth_deg", 0), director.tilt_deg = s.fixed("tilt_deg", 0);
  s.cell.director = director;
  ConstantIndices material;
  material.ordinary = s.fixed("ordinary", 1.5), material.birefringence = s.fixed("birefringence", 0);
  s.scene.material = material;
  return s;
}

// The Michel-Levy rows of quartz, made by a plate in front of a sample that does nothing.
TEST(WhiteLight, PlatesOfQuartz) {
  const ReferenceTable rows(testing::data_path("instrument/retarder_crossed.csv"));
  int seen = 0;
  for (const std::size_t row : rows.rows_where("dispersion", "quartz")) {
    CellScene s = nothing_between(0, 90);
    Retarder plate;
    plate.retardance_nm = s.fixed("retardance_nm", rows.number(row, "retardance_nm"));
    plate.azimuth_deg = s.fixed("plate_deg", 45);
    plate.crystal = PlateCrystal::quartz;
    s.scene.microscope.before.emplace_back(plate);
    const std::string illuminant = rows.text(row, "illuminant");
    ChannelLight& light = s.scene.microscope.channel_light.emplace();
    if (illuminant == "A") light.lamp.planck_k = s.fixed("planck_k", illuminant_a().temperature_k);
    if (illuminant == "D65") light.lamp.table = std::make_shared<SpectralTable>(illuminant_d65());
    const std::vector<double> white =
        channels_of(light, s.table.values(), {colour_matching(0), colour_matching(1), colour_matching(2)}).white();
    for (int c = 0; c < 3; ++c) {
      light.sensitivity = std::make_shared<SpectralTable>(colour_matching(c));
      const std::size_t k = static_cast<std::size_t>(c);
      EXPECT_NEAR(s.light() * white[k] / white[1], rows.number(row, std::string(1, "XYZ"[c])) / 100, 2e-4) << row << " "
                                                                                                           << "XYZ"[c];
    }
    ++seen;
  }
  EXPECT_GT(seen, 50);
}

// A plate cut across its axis and tilted is what a homeotropic cell of the crystal is in slanted light: the phase
// between p and s, from four pictures, whatever the faces let through.
TEST(WhiteLight, TiltedPlates) {
  struct Case {
    PlateCrystal crystal;
    double n_o, n_e;  ///< at 589.3 nm, as handbooks have them
  };
  for (const Case& c :
       {Case{PlateCrystal::quartz, 1.5442, 1.5533}, Case{PlateCrystal::magnesium_fluoride, 1.3777, 1.3895},
        Case{PlateCrystal::calcite, 1.6583, 1.4864}})
    for (const double tilt_deg : {5.0, 17.0, 40.0}) {
      const double thickness_um = 60;
      const auto cell_light = [&](double polarizer_deg, double analyzer_deg) {
        CellScene s(thickness_um, polarizer_deg, analyzer_deg);
        s.demand.ceiling = Ceiling::one_way;
        s.demand.intensity_accuracy = 1e-8;
        UniformDirector director;
        director.azimuth_deg = s.fixed("azimuth_deg", 0), director.tilt_deg = s.fixed("tilt_deg", 90);
        s.cell.director = director;
        ConstantIndices material;
        material.ordinary = s.fixed("ordinary", c.n_o),
        material.birefringence = s.fixed("birefringence", c.n_e - c.n_o);
        s.scene.material = material;
        s.table[s.scene.surround_index].value = 1;
        s.table[s.scene.microscope.wavelength_nm].value = 589.3;
        s.scene.microscope.directions = {{tilt_deg, 0}};
        return s.light();
      };
      const double cosine =
          (cell_light(45, 45) - cell_light(45, 135)) / std::sqrt(cell_light(0, 0) * cell_light(90, 90));
      CellScene s = nothing_between(45, 45);
      s.table[s.scene.microscope.wavelength_nm].value = 589.3;
      TiltedPlate plate;
      plate.thickness_um = s.fixed("plate_um", thickness_um), plate.tilt_deg = s.fixed("plate_tilt", tilt_deg);
      plate.azimuth_deg = s.fixed("plate_azimuth", 0), plate.crystal = c.crystal;
      s.scene.microscope.before.emplace_back(plate);
      // Four digits of a birefringence are a thousandth of the phase, of quartz a hundredth.
      const double phase = std::acos(2 * s.light() - 1);
      EXPECT_NEAR(2 * s.light() - 1, cosine, 2e-3 + 0.02 * std::abs(phase)) << static_cast<int>(c.crystal) << tilt_deg;
    }
}

// Which of the two waves is behind: a quarter-wave plate of calcite's kind takes a quarter of quartz's kind away.
TEST(WhiteLight, TiltedPlatesOfEitherSign) {
  CellScene s = nothing_between(0, 90);
  const auto with = [&](PlateCrystal crystal, double tilt_deg) {
    TiltedPlate plate;
    plate.thickness_um = s.fixed("um", 100), plate.tilt_deg = s.fixed("tilt", tilt_deg);
    plate.azimuth_deg = s.fixed("azimuth", 45), plate.crystal = crystal;
    Retarder bias;
    bias.retardance_nm = s.fixed("nm", 100), bias.azimuth_deg = s.fixed("bias", 45);
    s.scene.microscope.before.clear();
    s.scene.microscope.before.emplace_back(bias), s.scene.microscope.before.emplace_back(plate);
    return s.light();
  };
  EXPECT_GT(with(PlateCrystal::quartz, 8), with(PlateCrystal::quartz, 0)) << "p is slow where n_e is above n_o";
  EXPECT_LT(with(PlateCrystal::calcite, 2), with(PlateCrystal::calcite, 0)) << "and fast where it is below";
}

/// A plate at 45 degrees whose echoes are all computed.
CellScene echoing_plate(const ReferenceTable& rows, std::size_t row, double analyzer_deg) {
  CellScene s(rows.number(row, "thickness_um"), 0, analyzer_deg);
  s.demand.ceiling = Ceiling::reflections;
  UniformDirector director;
  director.azimuth_deg = s.fixed("azimuth_deg", 45), director.tilt_deg = s.fixed("tilt_deg", 0);
  s.cell.director = director;
  ConstantIndices material;
  material.ordinary = s.fixed("ordinary", rows.number(row, "n_o"));
  material.birefringence = s.fixed("birefringence", rows.number(row, "n_e") - rows.number(row, "n_o"));
  s.scene.material = material;
  s.table[s.scene.surround_index].value = rows.number(row, "n_in");
  return s;
}

// Echoes between the faces that interfere, partly, or not at all: lines from one wavelength to 100 nm, that are
// Gaussian in the wavenumber.
TEST(WhiteLight, EchoesInLines) {
  const ReferenceTable rows(testing::data_path("instrument/echo_line.csv"));
  int seen = 0;
  for (std::size_t row = 0; row < rows.size(); ++row) {
    if (rows.number(row, "n_in") != rows.number(row, "n_out")) continue;
    for (const double analyzer_deg : {0.0, 90.0}) {
      CellScene s = echoing_plate(rows, row, analyzer_deg);
      if (const double fwhm_nm = rows.number(row, "fwhm_nm"); fwhm_nm > 0) {
        // A table that is linear between entries: fine ones.
        auto line = std::make_shared<SpectralTable>();
        constexpr double kMiddle = 0.55;
        const double width = 1e-3 * fwhm_nm / (kMiddle * kMiddle), sd = width / 2.354820045;
        for (double away = -5.5; away <= 5.5; away += 0.01) {
          const double wavenumber = 1 / kMiddle - away * sd;
          if (wavenumber < 0.6) continue;
          line->wavelength_um.push_back(1 / wavenumber);
          // Per wavenumber, and the table is per wavelength.
          line->value.push_back(std::exp(-0.5 * away * away) * wavenumber * wavenumber);
        }
        s.scene.microscope.channel_light.emplace().sensitivity = line;
      }
      EXPECT_NEAR(s.light(), rows.number(row, analyzer_deg == 0 ? "I_parallel" : "I_crossed"), 1e-4) << row;
    }
    ++seen;
  }
  EXPECT_EQ(seen, 60);
}

// The same in white light, for the eye and a camera.
TEST(WhiteLight, EchoesInColours) {
  const ReferenceTable rows(testing::data_path("instrument/echo_white.csv"));
  ASSERT_GT(rows.size(), 40u);
  for (std::size_t row = 0; row < rows.size(); ++row) {
    CellScene s = echoing_plate(rows, row, 90);
    ChannelLight& light = s.scene.microscope.channel_light.emplace();
    if (rows.text(row, "illuminant") == "D65") light.lamp.table = std::make_shared<SpectralTable>(illuminant_d65());
    const bool eye = rows.text(row, "observer") == "cie";
    const std::vector<double> white =
        eye ? channels_of(light, s.table.values(), {colour_matching(0), colour_matching(1), colour_matching(2)}).white()
            : std::vector<double>{1, 1, 1};
    for (int c = 0; c < 3; ++c) {
      const std::size_t k = static_cast<std::size_t>(c);
      light.sensitivity =
          std::make_shared<SpectralTable>(eye ? colour_matching(c) : std::get<SpectralTable>(testing::camera()[k]));
      EXPECT_NEAR(s.light() * white[k] / white[1], rows.number(row, "c" + std::to_string(c + 1)) / 100, 2e-4)
          << row << " " << c;
    }
  }
}

}  // namespace
}  // namespace birefit
