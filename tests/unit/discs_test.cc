// Several droplets in one picture: all of them are found, and the one that the config means is fitted alone.

#include <gmock/gmock.h>

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "config_fixture.h"
#include "io/config/discs.h"

namespace birefit {
namespace {

using ::testing::HasSubstr;

struct Ball {
  double x, y, radius, retardance;
};
/// Crosses of rings between crossed polarizers, apart from each other.
Image picture(int side, const std::vector<Ball>& balls) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0, 12);
  Image image(side, side);
  for (int row = 0; row < side; ++row)
    for (int column = 0; column < side; ++column) {
      double light = 0;
      for (const Ball& ball : balls) {
        const double dx = column - ball.x, dy = row - ball.y, r = std::hypot(dx, dy);
        if (r == 0 || r > ball.radius) continue;
        const double sine = 2 * dx * dy / (r * r);
        light +=
            sine * sine * std::pow(std::sin(ball.retardance * std::sqrt(1 - r * r / (ball.radius * ball.radius))), 2);
      }
      image(column, row) = std::round(120 + 2800 * light + noise(random));
    }
  return image;
}
const std::vector<Ball> kThree = {{60.2, 58.4, 46.5, 5.5}, {170.5, 65.3, 35.5, 4.2}, {111.4, 168.1, 31, 3.8}};

std::vector<DiscGuess> found(const Image& image, const DiameterPx& diameter) {
  return find_discs(image, Mask(image.width(), image.height(), 1), diameter);
}

TEST(Discs, AreFoundWhereTheyAreTheLargestFirst) {
  const std::vector<DiscGuess> discs = found(picture(224, kThree), {93, 70, 120});
  ASSERT_EQ(discs.size(), kThree.size());
  for (std::size_t i = 0; i < discs.size(); ++i) {
    EXPECT_NEAR(discs[i].center_x_px, kThree[i].x, 1);
    EXPECT_NEAR(discs[i].center_y_px, kThree[i].y, 1);
    // The outermost ring is faint: what is seen ends before the rim.
    EXPECT_NEAR(discs[i].radius_px, kThree[i].radius, 0.1 * kThree[i].radius);
  }
}

TEST(Discs, OneIsNotSeveralWhateverItsRings) {
  for (const double retardance : {1.5, 3.1, 6.0, 12.0, 25.0})
    EXPECT_TRUE(found(picture(160, {{78, 83, 60, retardance}}), {112, 90, 140}).empty()) << retardance;
  // Looked for among much smaller ones, its rings lie apart.
  EXPECT_TRUE(found(picture(160, {{78, 83, 60, 6.0}}), {30, 20, 150}).empty());
  EXPECT_TRUE(found(picture(160, {}), {112, 90, 140}).empty());
}

// Two lobes of one droplet lie further apart than its rings do where a brighter one beside it sets what is seen.
TEST(Discs, LobesOfOneAreNotTwoBesideABrighterOne) {
  constexpr double kRadius = 23, kPi = 3.14159265358979;
  for (const double azimuth_deg : {0.0, 30.0, 75.0}) {
    Image image = picture(130, {{30, 92, 20, 1.5}});
    const double cosine = std::cos(azimuth_deg * kPi / 180), sine = std::sin(azimuth_deg * kPi / 180);
    for (int row = 0; row < image.height(); ++row)
      for (int column = 0; column < image.width(); ++column) {
        const double dx = column - 84.0, dy = row - 40.0, along = dx * cosine + dy * sine,
                     across = dy * cosine - dx * sine;
        if (std::hypot(dx, dy) < kRadius && std::abs(along) > 0.21 * kRadius && std::abs(across) < 0.7 * kRadius)
          image(column, row) += 1300;
      }
    const std::vector<DiscGuess> discs = found(image, {42, 25, 63});
    ASSERT_EQ(discs.size(), 2u) << azimuth_deg;
    EXPECT_NEAR(discs[0].center_x_px, 84, 2) << azimuth_deg;
    EXPECT_NEAR(discs[0].center_y_px, 40, 2) << azimuth_deg;
    EXPECT_NEAR(discs[0].radius_px, kRadius, 0.15 * kRadius) << azimuth_deg;
  }
}

// What stands closer than its diameter is two all the same, where both are as large as what is looked for.
TEST(Discs, TwoThatTouchAreNotJoined) {
  EXPECT_EQ(found(picture(160, {{45, 80, 30, 2.0}, {113, 80, 30, 2.0}}), {60, 40, 90}).size(), 2u);
}

using DiscsInConfigs = birefit::testing::ConfigFolder;
TEST_F(DiscsInConfigs, TheOneWithinTheBoundsIsMeantAndTheOthersAreLeftOut) {
  save("a.tif", picture(224, kThree));
  const std::string text = R"(micrograph:
  image: a.tif
  pixel_size_um: 0.1
  gain: {fit: auto}
  offset: {fit: auto}
  center_px: {fit: auto}
sample:
  droplet:
    diameter_um: {value: 9.0, fit: [8, 10.5]}
    director: {radial: {}}
  material: {ordinary: 1.52, birefringence: {value: 0.2, fit: [0.05, 0.4]}}
  surround: {index: 1.43}
microscope:
  light: {wavelength_nm: 590}
  polarizer_deg: 0
  analyzer_deg: 90
)";
  const auto read = load(text, ConfigUse::fit);
  const Picture& picture = std::get<Picture>(read.job.measurements[0]);
  const auto value = [&](const char* name) { return read.job.parameters[read.job.parameters.find(name)].value; };
  EXPECT_NEAR(value("micrograph.center_px.x"), kThree[0].x, 1);
  EXPECT_NEAR(value("micrograph.center_px.y"), kThree[0].y, 1);
  EXPECT_EQ(picture.mask(60, 58), 1);
  EXPECT_EQ(picture.mask(170, 65), 0);
  EXPECT_EQ(picture.mask(111, 168), 0);
  EXPECT_THAT(read.job.warnings, ::testing::Contains(HasSubstr("several discs are visible")));

  // The largest, from a start without bounds, or with wide ones.
  for (const char* wide : {"{value: 9.0, fit: auto}", "{value: 9.0, fit: [5, 25]}"}) {
    const auto again = load(replaced(text, "{value: 9.0, fit: [8, 10.5]}", wide), ConfigUse::fit);
    EXPECT_NEAR(again.job.parameters[again.job.parameters.find("micrograph.center_px.x")].value, kThree[0].x, 1)
        << wide;
  }

  // The smallest, by its bounds.
  const auto small =
      load(replaced(text, "{value: 9.0, fit: [8, 10.5]}", "{value: 6.2, fit: [5.5, 6.6]}"), ConfigUse::fit);
  EXPECT_NEAR(small.job.parameters[small.job.parameters.find("micrograph.center_px.x")].value, kThree[2].x, 1);
}

}  // namespace
}  // namespace birefit
