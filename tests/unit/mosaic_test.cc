// Mosaics of filters: what is found in a picture's pixels, and the coarser grids that their parts lie on.

#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "core/sub_grid.h"
#include "io/images/mosaic.h"

namespace birefit {
namespace {

/// Smooth fringes of random direction and period with noise, seen through a cell of 2 x 2 of random transmissions or
/// through none.
struct Draw {
  std::mt19937_64 random;
  double between(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); }

  enum class Filters { none, colour, polarization };
  Image picture(Filters filters) {
    constexpr int kSize = 128;
    const double period = between(12, 60), turn = between(0, 2 * std::numbers::pi), light = between(500, 3000),
                 noise = between(0.005, 0.03) * light, phase = between(0, std::numbers::pi);
    const double red = between(0.4, 0.7), blue = between(0.2, 0.6), azimuth = between(0, std::numbers::pi),
                 purity = between(0.4, 0.9);
    const double of_colour[2][2] = {{red, 1}, {1, blue}};
    std::normal_distribution<double> normal(0, noise);
    Image image(kSize, kSize);
    for (int y = 0; y < kSize; ++y)
      for (int x = 0; x < kSize; ++x) {
        const double along = (x * std::cos(turn) + y * std::sin(turn)) / period;
        double value = light * (0.2 + std::pow(std::sin(std::numbers::pi * along + phase), 2));
        if (filters == Filters::colour) value *= of_colour[y % 2][x % 2];
        if (filters == Filters::polarization) {
          const double analyser = std::numbers::pi / 4 * (y % 2 ? (x % 2 ? 0 : 3) : (x % 2 ? 1 : 2));
          value *= 0.5 * (1 + purity * std::cos(2 * (azimuth + along - analyser)));
        }
        image(x, y) = std::round(100 + value + normal(random));
      }
    return image;
  }
};

TEST(Mosaic, IsFoundWhereThereIsOneAndNowhereElse) {
  Draw draw{std::mt19937_64(5)};
  for (int i = 0; i < 30; ++i) {
    const Image without = draw.picture(Draw::Filters::none);
    EXPECT_FALSE(find_mosaic(without, {0, 0, without.width(), without.height()}, 0.5)) << i;
    const Image colour = draw.picture(Draw::Filters::colour);
    const auto of_colour = find_mosaic(colour, {0, 0, colour.width(), colour.height()}, 0.5);
    ASSERT_TRUE(of_colour) << i;
    EXPECT_NE(of_colour->find("Bayer"), std::string::npos) << i << ' ' << *of_colour;
    const Image polarized = draw.picture(Draw::Filters::polarization);
    const auto of_polarizers = find_mosaic(polarized, {0, 0, polarized.width(), polarized.height()}, 0.5);
    ASSERT_TRUE(of_polarizers) << i;
    EXPECT_NE(of_polarizers->find("polarization"), std::string::npos) << i << ' ' << *of_polarizers;
  }
}

TEST(SubGrid, IsThatOfThePartsOfAMosaicAndOfNoOtherMask) {
  for (const int x0 : {0, 1})
    for (const int y0 : {0, 1}) {
      Mask part(17, 12, 0);
      for (int y = y0; y < 12; y += 2)
        for (int x = x0; x < 17; x += 2) part(x, y) = 1;
      part(x0 + 4, y0 + 6) = 0;  // a pixel that is left out for its own reasons
      const SubGrid grid = sub_grid(part);
      EXPECT_EQ(grid.spacing, 2);
      EXPECT_EQ(grid.x0, x0);
      EXPECT_EQ(grid.y0, y0);
      Image values(17, 12);
      for (std::size_t i = 0; i < values.size(); ++i) values.values()[i] = static_cast<double>(i);
      Image back(17, 12, -1);
      const Image small = on_grid(values, grid);
      EXPECT_EQ(small(1, 2), values(x0 + 2, y0 + 4));
      put_back(small, grid, back);
      for (int y = 0; y < 12; ++y)
        for (int x = 0; x < 17; ++x)
          EXPECT_EQ(back(x, y), x % 2 == x0 && y % 2 == y0 ? values(x, y) : -1) << x << ' ' << y;
    }
  EXPECT_EQ(sub_grid(Mask(17, 12, 1)).spacing, 1);
  Mask disc(40, 40, 0);
  for (int y = 0; y < 40; ++y)
    for (int x = 0; x < 40; ++x) disc(x, y) = std::hypot(x - 20, y - 19) < 15;
  EXPECT_EQ(sub_grid(disc).spacing, 1);
  Mask few(40, 40, 0);
  few(4, 4) = few(8, 12) = few(20, 16) = 1;
  EXPECT_EQ(sub_grid(few).spacing, 1);
}

}  // namespace
}  // namespace birefit
