// Colours as numbers: CIELAB, CIEDE2000 and sRGB against tables made by formulas alone (tests/data/instrument).

#include "instrument/colour.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "instrument/interference_colour.h"
#include "reference_table.h"
#include "white_light.h"

namespace birefit {
namespace {
using namespace testing;

Lab lab(const ReferenceTable& table, std::size_t row, const std::string& which) {
  return {table.number(row, "L" + which), table.number(row, "a" + which), table.number(row, "b" + which)};
}

/// Tristimulus values of the lamps' whites as the tables' makers had them.
const std::map<std::string, Xyz> kWhite{{"E", {100.0079443, 100, 100.0327853}},
                                        {"A", {109.8502955, 100, 35.5851654}},
                                        {"D65", {95.0468442, 100, 108.8816540}}};

TEST(Colour, DistancesOfSharmaWuAndDalal) {
  const ReferenceTable table(data_path("instrument/ciede2000_34.csv"));
  ASSERT_EQ(table.size(), 34u);
  for (std::size_t row = 0; row < table.size(); ++row) {
    const double distance = ciede2000(lab(table, row, "1"), lab(table, row, "2"));
    const std::string pair = "pair " + table.text(row, "pair");
    if (table.text(row, "pair") == "14") {
      // Opposite hues: on which side their mean lies is up to the last bit of an arctangent.
      EXPECT_LT(std::min(std::abs(distance - 4.7461), std::abs(distance - 4.8045)), 5e-5);
    } else {
      EXPECT_NEAR(distance, table.number(row, "dE00"), 1e-9) << pair;
      EXPECT_NEAR(distance, table.number(row, "published"), 5.1e-5) << pair;
    }
  }
}

TEST(Colour, DistancesOfRandomPairs) {
  const ReferenceTable table(data_path("instrument/ciede2000_random.csv"));
  ASSERT_EQ(table.size(), 300u);
  for (std::size_t row = 0; row < table.size(); ++row) {
    const Lab one = lab(table, row, "1"), two = lab(table, row, "2");
    EXPECT_NEAR(ciede2000(one, two), table.number(row, "dE00"), 1e-9) << row;
    EXPECT_NEAR(ciede2000(two, one), ciede2000(one, two), 1e-12) << row;
    EXPECT_EQ(ciede2000(one, one), 0) << row;
  }
}

TEST(Colour, GreysHaveNoHue) {
  EXPECT_NEAR(ciede2000({50, 0, 0}, {50, 2.5, 0}), ciede2000({50, 2.5, 0}, {50, 0, 0}), 1e-14);
  // Of two greys only the lightness differs: S_L is 1 about 50.
  EXPECT_NEAR(ciede2000({49.5, 0, 0}, {50.5, 0, 0}), 1, 1e-12);
}

TEST(Colour, LabAndScreenOfInterferenceColours) {
  const ReferenceTable table(data_path("instrument/retarder_crossed.csv"));
  for (std::size_t row = 0; row < table.size(); ++row) {
    const Xyz colour{table.number(row, "X"), table.number(row, "Y"), table.number(row, "Z")};
    const Xyz white = kWhite.at(table.text(row, "illuminant"));
    const Lab l = lab_of(colour, white);
    EXPECT_NEAR(l.l, table.number(row, "L"), 1e-4) << row;
    EXPECT_NEAR(l.a, table.number(row, "a"), 1e-4) << row;
    EXPECT_NEAR(l.b, table.number(row, "b"), 1e-4) << row;
    const Rgb rgb = linear_srgb(colour, white);
    EXPECT_NEAR(rgb.r, table.number(row, "r_lin"), 2e-6) << row;
    EXPECT_NEAR(rgb.g, table.number(row, "g_lin"), 2e-6) << row;
    EXPECT_NEAR(rgb.b, table.number(row, "b_lin"), 2e-6) << row;
  }
}

TEST(Colour, WhiteIsWhite) {
  for (const auto& [name, white] : kWhite) {
    const Rgb rgb = linear_srgb(white, white);
    EXPECT_NEAR(rgb.r, 1, 1e-12) << name;
    EXPECT_NEAR(rgb.g, 1, 1e-12) << name;
    EXPECT_NEAR(rgb.b, 1, 1e-12) << name;
    const Lab l = lab_of(white, white);
    EXPECT_NEAR(l.l, 100, 1e-12) << name;
    EXPECT_NEAR(std::hypot(l.a, l.b), 0, 1e-12) << name;
  }
  // IEC 61966-2-1 prints the matrix from tristimulus values with four digits: its first column, and E without
  // adaptation.
  const Xyz daylight{0.95047, 1, 1.08883};
  const Rgb red = linear_srgb({1, 0, 0}, daylight);
  EXPECT_NEAR(red.r, 3.2406, 5e-4);
  EXPECT_NEAR(red.g, -0.9689, 5e-4);
  EXPECT_NEAR(red.b, 0.0557, 5e-4);
  const Rgb pink = linear_srgb({1, 1, 1}, daylight);
  EXPECT_NEAR(pink.r, 1.205, 1e-3);
  EXPECT_NEAR(pink.g, 0.948, 1e-3);
  EXPECT_NEAR(pink.b, 0.909, 1e-3);
}

TEST(Colour, CodesOfTheScreen) {
  EXPECT_EQ(srgb_code(0), 0);
  EXPECT_NEAR(srgb_code(1), 1, 1e-15);
  EXPECT_NEAR(srgb_code(0.2140411), 0.5, 1e-7);
  for (double x = -0.2; x < 1.5; x += 0.01) EXPECT_NEAR(srgb_light(srgb_code(x)), x, 1e-12);
  // The two pieces meet to the digits that the standard gives.
  EXPECT_NEAR(12.92 * 0.0031308, srgb_code(0.00313081), 1e-6);
}

/// A camera under illuminant A, a quartz wedge.
struct Wedge {
  Channels channels{illuminant_a(), {}, camera()};
  SpectralSum fine = channels.fine(8);
  ColourCurve curve{fine, std::vector<FringeOfLine>(fine.size()), turns(fine, "quartz"), 8};
  std::vector<double> colour(double g) const {
    std::vector<double> x;
    for (std::size_t c = 0; c < 3; ++c) x.push_back(curve.at(c, g));
    return x;
  }
  const std::vector<double> noise{0.01, 0.01, 0.01};
};

TEST(InterferenceColour, SaysTheRetardanceUpToTwoMicrometres) {
  const Wedge wedge;
  for (const double g : {0.02, 0.05, 0.2, 0.5, 1.0, 1.2, 2.0}) {
    const auto found = retardances_of(wedge.curve, wedge.colour(g), wedge.noise);
    ASSERT_FALSE(found.empty());
    EXPECT_NEAR(found.front().g_um, g, 1e-6);
    EXPECT_NEAR(found.front().odds, 1, 0);
    EXPECT_EQ(found.size(), 1u) << g;
    EXPECT_LT(found.front().error_um, g < 0.05 ? 0.01 : 0.0031) << g;
  }
  // One pair of colours below 2 um is the same within noise of 1 %: of odds one half.
  const auto pair = retardances_of(wedge.curve, wedge.colour(1.74), wedge.noise);
  ASSERT_EQ(pair.size(), 2u);
  EXPECT_NEAR(pair[1].g_um, 0.122, 1e-3);
  EXPECT_NEAR(pair[1].odds, 0.46, 0.02);
  // Black says 0, and that its error is not one of a slope.
  const auto black = retardances_of(wedge.curve, {0, 0, 0}, wedge.noise);
  ASSERT_EQ(black.size(), 1u);
  EXPECT_LT(black.front().g_um, 1e-4);
  EXPECT_GT(black.front().error_um, 1);
}

TEST(InterferenceColour, IsAmbiguousBeyond) {
  const Wedge wedge;
  for (const auto& [g, error] : {std::pair{3.0, 0.0086}, {5.0, 0.032}}) {
    const auto found = retardances_of(wedge.curve, wedge.colour(g), wedge.noise);
    EXPECT_GT(found.size(), 3u);
    EXPECT_NEAR(found.front().g_um, g, 1e-6);
    EXPECT_NEAR(found.front().error_um, error, 0.02 * error);
    EXPECT_GT(found[1].odds, 0.9);
    for (std::size_t i = 1; i < found.size(); ++i) EXPECT_LE(found[i].odds, found[i - 1].odds);
  }
}

// Under E the observer sees a quartz retarder that has a double more than 0.1 um away within a CIEDE2000 of 5, 3 and 2
// from these retardances on, and only greys within 10, 3 and 1 beyond those.
TEST(InterferenceColour, DoublesAndGreys) {
  const Channels channels(EqualEnergy{}, {}, observer());
  const SpectralSum fine = channels.fine(8);
  const ColourCurve curve(fine, std::vector<FringeOfLine>(fine.size()), turns(fine, "quartz"), 8);
  const std::vector<double>& w = channels.white();
  const Xyz white{w[0] / w[1], 1, w[2] / w[1]};
  const double step = 0.01;
  std::vector<Lab> seen;
  for (int i = 0; i <= 800; ++i) seen.push_back(lab_of(interference_colour(curve, i * step, white), white));
  const Lab grey = lab_of({0.5 * white.x, 0.5 * white.y, 0.5 * white.z}, white);
  for (const auto& [limit, from] : {std::pair{5.0, 0.38}, {3.0, 1.0}, {2.0, 2.87}}) {
    int first = 0;
    const auto has_double = [&](int i) {
      for (int j = 0; j <= 800; ++j)
        if (std::abs(i - j) * step > 0.1 &&
            ciede2000(seen[static_cast<std::size_t>(i)], seen[static_cast<std::size_t>(j)]) < limit)
          return true;
      return false;
    };
    while (!has_double(first)) ++first;
    EXPECT_NEAR(first * step, from, 0.025) << limit;
  }
  for (const auto& [limit, beyond] : {std::pair{10.0, 3.39}, {3.0, 5.49}, {1.0, 5.82}}) {
    int last = 0;
    for (int i = 0; i <= 800; ++i)
      if (ciede2000(seen[static_cast<std::size_t>(i)], grey) > limit) last = i;
    EXPECT_NEAR(last * step, beyond, 0.015) << limit;
  }
}

}  // namespace
}  // namespace birefit
