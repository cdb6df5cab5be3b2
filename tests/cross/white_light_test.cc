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

}  // namespace
}  // namespace birefit
