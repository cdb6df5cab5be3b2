// The noise of an image from the image itself, fringes and all.

#include "fit/weights/noise.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "independent_disc.h"
#include "independent_droplet.h"  // camera()

namespace birefit::estimation {
namespace {

struct Truth {
  double read, counts_per_photon;
};

double variance_at(const NoiseModel& noise, double signal) {
  const double light = std::max(0.0, signal - noise.black_counts);
  return noise.read_counts * noise.read_counts + noise.counts_per_photon * light;
}

/// Fringes of the given period along the diagonal, 100 to 3100 counts, Gaussian read and photon noise, rounded.
Picture fringes(const Truth& truth, double period, unsigned seed, bool rounded = true) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Picture micrograph;
  micrograph.values = Image(256, 256);
  micrograph.mask = Mask(256, 256, 1);
  for (int y = 0; y < 256; ++y)
    for (int x = 0; x < 256; ++x) {
      const double s = std::sin(std::numbers::pi * (x + y) / std::sqrt(2.0) / period);
      const double signal = 100 + 3000 * s * s;
      const double sd = std::sqrt(truth.read * truth.read + truth.counts_per_photon * signal);
      const double value = signal + sd * normal(random);
      micrograph.values(x, y) = rounded ? std::round(value) : value;
    }
  return micrograph;
}

// Read off what a right model leaves over, by squares: without bias, and about as well as n/7 independent differences
// can tell (14/n); medians know 38/n and would fail.
TEST(NoiseEstimate, SquaresOfTheResidualKnowItAsWellAsTheyCan) {
  const Truth truth{4, 0.5};
  constexpr int kDraws = 40, kPixels = 256 * 256;
  double sum = 0, squares = 0;
  for (unsigned seed = 1; seed <= kDraws; ++seed) {
    const Picture noisy = fringes(truth, 40, seed, false), still = fringes({0, 0}, 40, 1, false);
    const Image found = standard_deviation(noisy, estimate_noise(noisy, &still.values, true), still.values),
                known = standard_deviation(noisy, {truth.read, truth.counts_per_photon}, still.values);
    double ratio = 0;
    for (std::size_t i = 0; i < found.size(); ++i)
      ratio += std::pow(found.values()[i] / known.values()[i], 2) / kPixels;
    sum += ratio - 1, squares += std::pow(ratio - 1, 2);
  }
  const double sd = std::sqrt(14.0 / kPixels);
  EXPECT_LT(std::abs(sum / kDraws), 4 * sd / std::sqrt(kDraws));
  EXPECT_LT(std::sqrt(squares / kDraws), 1.35 * sd);  // three deviations of a scatter that forty draws show
}

TEST(NoiseEstimate, FindsReadAndPhotonNoiseUnderFringes) {
  for (const Truth truth : {Truth{20, 1.0}, Truth{5, 0.25}, Truth{40, 0.1}})
    for (const double period : {12.0, 40.0}) {
      const NoiseModel noise = estimate_noise(fringes(truth, period, 7));
      EXPECT_TRUE(noise.estimated);
      // What weights need is the variance: dark, in the middle, bright. 65,000 correlated differences in bins give
      // a robust variance to about 3 %; three of that.
      for (const double signal : {300.0, 1600.0, 3000.0}) {
        const double expected = truth.read * truth.read + truth.counts_per_photon * signal;
        const double found = variance_at(noise, signal);
        EXPECT_NEAR(found, expected, 0.1 * expected) << truth.read << ' ' << truth.counts_per_photon << ' ' << period;
      }
      EXPECT_NEAR(noise.counts_per_photon, truth.counts_per_photon, 0.1 * truth.counts_per_photon + 0.03);
    }
}

TEST(NoiseEstimate, IgnoresDustAndMaskedPixels) {
  Picture micrograph = fringes({20, 0.0}, 30, 5);
  std::mt19937_64 random(9);
  for (int i = 0; i < 300; ++i) {
    const int x = static_cast<int>(random() % 256), y = static_cast<int>(random() % 256);
    micrograph.values(x, y) = i % 2 ? 4000 : std::numeric_limits<double>::quiet_NaN();
    if (i % 2 == 0) micrograph.mask(x, y) = 0;
  }
  const NoiseModel noise = estimate_noise(micrograph);
  // 150 specks spoil 25 differences each, 6 % of all: the median moves by about that.
  EXPECT_NEAR(std::sqrt(variance_at(noise, 1500)), 20, 0.15 * 20);
}

TEST(NoiseEstimate, NeverFallsBelowTheRoundingOfCounts) {
  const NoiseModel noise = estimate_noise(fringes({0, 0}, 60, 1));
  EXPECT_GE(noise.read_counts, std::sqrt(1.0 / 12) * (1 - 1e-12));
  const NoiseModel exact = estimate_noise(fringes({0, 0}, 60, 1, false));
  EXPECT_GT(exact.read_counts, 0);
}

TEST(NoiseEstimate, IsInCountsWhenValuesAreTransmission) {
  const Truth truth{15, 0.5};
  Picture micrograph = fringes(truth, 25, 3);
  constexpr double kBright = 4000;  // parallel - dark
  micrograph.variance_scale = Image(256, 256, 1 / (kBright * kBright));
  for (double& value : micrograph.values.values()) value /= kBright;
  const NoiseModel noise = estimate_noise(micrograph);
  const double expected = truth.read * truth.read + truth.counts_per_photon * 1600;
  EXPECT_NEAR(variance_at(noise, 1600), expected, 0.1 * expected);
  const Image sd = standard_deviation(micrograph, {truth.read, truth.counts_per_photon, false}, Image(256, 256, 0.4));
  EXPECT_NEAR(sd(100, 100), std::sqrt(expected) / kBright, 1e-12);
}

/// One camera and one picture: what is random about them, and what the noise of a pixel then is.
struct Camera {
  double step, black, read, counts_per_photon, low, high, period, bright = 0;  // counts; bright: parallel - dark
  bool clipped = false;                                                        // at code 0
  double signal(int x, int y) const {
    const double s = std::sin(std::numbers::pi * (0.8 * x + 0.6 * y) / period);
    return low + (high - low) * s * s;
  }
  /// The camera's own and that of rounding.
  double sd(double signal) const {
    const double light = std::max(0.0, signal - black);
    return std::sqrt(read * read + counts_per_photon * light + step * step / 12);
  }
  Picture picture(unsigned seed) const {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    constexpr int kSize = 256;
    Picture micrograph;
    micrograph.values = Image(kSize, kSize);
    micrograph.mask = Mask(kSize, kSize, 1);
    if (bright > 0) micrograph.variance_scale = Image(kSize, kSize, 0);
    for (int y = 0; y < kSize; ++y)
      for (int x = 0; x < kSize; ++x) {
        const double s = signal(x, y), light = std::max(0.0, s - black);
        const double sd = std::sqrt(read * read + counts_per_photon * light);
        double value = step * std::round((s + sd * normal(random)) / step);
        if (clipped) value = std::max(0.0, value);
        micrograph.values(x, y) = value;
        if (bright <= 0) continue;
        const double lamp = bright * (1 - 0.3 * x / kSize);  // brighter on one side
        micrograph.values(x, y) /= lamp;
        micrograph.variance_scale(x, y) = 1 / (lamp * lamp);
      }
    return micrograph;
  }
};

/// Noise of any kind, a black level, clipping, 5 to 16 bits, counts or transmission. With less noise than a third of a
/// code the rounding of a flat place is one number, not a scatter.
Camera any_camera(std::mt19937_64& random) {
  const auto uniform = [&](double a, double b) { return std::uniform_real_distribution<double>(a, b)(random); };
  Camera c{};
  const double codes = std::pow(2.0, std::floor(uniform(5, 17)));
  const bool transmission = uniform(0, 1) < 0.3;
  c.step = !transmission && uniform(0, 1) < 0.3 ? 3 : 1;  // a stretched picture leaves out codes
  const double top = c.step * (codes - 1);
  c.black = transmission || uniform(0, 1) < 0.5 ? 0 : uniform(0, 0.2) * top;  // calibration takes it off
  c.low = c.black + uniform(0, 0.05) * top;
  c.high = c.low + uniform(0.3, 0.7) * top;
  c.read = std::max(0.35 * c.step, uniform(0, 0.02) * top);
  c.counts_per_photon = uniform(0, 1) < 0.3 ? 0 : uniform(0, 1) * 0.0004 * top;
  c.period = uniform(14, 60);
  c.clipped = uniform(0, 1) < 0.4;
  if (c.clipped) c.low -= c.black, c.high -= c.black, c.black = 0;
  if (c.clipped) c.low -= uniform(0, 0.3) * (c.high - c.low);  // a dark frame too bright was taken off
  if (transmission) c.bright = uniform(1, 2) * c.high;
  return c;
}

TEST(NoiseEstimate, IsRightAtEveryLevelForAnyCamera) {
  std::mt19937_64 random(20250117);
  for (int draw = 0; draw < 60; ++draw) {
    const Camera camera = any_camera(random);
    const Picture micrograph = camera.picture(1000 + static_cast<unsigned>(draw));
    const NoiseModel noise = estimate_noise(micrograph);
    for (const double share : {0.0, 0.1, 0.3, 0.6, 0.9, 1.0}) {
      const double signal = camera.low + share * (camera.high - camera.low), expected = camera.sd(signal);
      const double found = std::sqrt(variance_at(noise, signal));
      // Of a cut picture the noise shows where whole neighbourhoods are above the cut; below, it is not to be too low.
      if (camera.clipped && signal < 0.5 * camera.high) {
        if (signal > 0) EXPECT_GT(found, 0.5 * expected) << "draw " << draw;
        continue;
      }
      // A fringe's dark end has at least 5 % of the pixels: 3300 differences, of which a seventh are independent, know
      // a standard deviation by its median to 1.17 / sqrt(470) = 5 %, and a line through all levels better. Twice that.
      EXPECT_NEAR(found, expected, 0.1 * expected)
          << "draw " << draw << ", step " << camera.step << ", black " << camera.black << ", read " << camera.read
          << ", per photon " << camera.counts_per_photon << ", " << camera.low << " to " << camera.high << ", period "
          << camera.period << ", clipped " << camera.clipped << ", transmission " << camera.bright << ", share "
          << share;
    }
  }
}

// A cell's frame is of even light: a line through levels that noise alone sets apart is anything, and was a variance of
// 1e12 a count away.
TEST(NoiseEstimate, AFrameOfEvenLightTellsOneVariance) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  for (const double sd : {3.0, 20.0}) {
    Picture micrograph;
    micrograph.values = Image(32, 32);
    micrograph.mask = Mask(32, 32, 1);
    for (double& value : micrograph.values.values()) value = std::round(1700 + sd * normal(random));
    const Image even(32, 32, 1700), uneven_by_rounding = [] {
      Image image(32, 32, 1700);
      for (std::size_t i = 0; i < image.size(); ++i) image.values()[i] += 1e-10 * static_cast<double>(i % 7);
      return image;
    }();
    for (const Image* fitted : {static_cast<const Image*>(nullptr), &even, &uneven_by_rounding}) {
      const NoiseModel noise = estimate_noise(micrograph, fitted);
      // Of 784 differences about a seventh are independent: their median knows a standard deviation to a tenth.
      for (const double off : {-1.0, 0.0, 1.0}) EXPECT_NEAR(std::sqrt(variance_at(noise, 1700 + off)), sd, 0.35 * sd);
    }
  }
}

TEST(NoiseEstimate, KnowsRoundingWhereNoiseIsFarBelowACode) {
  std::mt19937_64 random(11);
  for (int draw = 0; draw < 20; ++draw) {
    Camera camera = any_camera(random);
    if (camera.clipped) continue;
    camera.read = 0.1 * camera.step, camera.counts_per_photon = 0;
    camera.period = 60;  // of 65536 codes, finer fringes leave more than a code in differences
    const NoiseModel noise = estimate_noise(camera.picture(2000 + static_cast<unsigned>(draw)));
    const double found = std::sqrt(variance_at(noise, camera.high));
    // At one place the error of rounding is anything up to half a code, on the whole 0.29 codes.
    EXPECT_GT(found, camera.step * 0.29 * (1 - 1e-2)) << draw;
    EXPECT_LT(found, camera.step * 0.5) << draw;
  }
}

/// Noise that grows faster than light (a pattern of the sensor, a scratched sample) puts a straight line's read noise
/// below zero: no level may weigh more than four times what its own scatter justifies.
// Read noise in the dark beside bright fringes whose photon noise is a hundred times as large: weights of the dark
// field, most of many pictures, hang on it.
TEST(NoiseEstimate, ADarkFieldKeepsItsNoiseBesideBrightFringes) {
  std::mt19937_64 random(41);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  constexpr int kDraws = 12, kSize = 256;
  for (int draw = 0; draw < kDraws; ++draw) {
    const double read = 2 + 6 * uniform(random), gain = std::pow(10.0, 2.5 + 2 * uniform(random));
    const double radius = kSize * (0.2 + 0.15 * uniform(random)), fringes = 1 + 3 * uniform(random);
    Picture micrograph;
    micrograph.values = Image(kSize, kSize);
    micrograph.mask = Mask(kSize, kSize, 1);
    double brightest = 0;
    for (int y = 0; y < kSize; ++y)
      for (int x = 0; x < kSize; ++x) {
        // A cross of Maltese arms that fades smoothly into the dark.
        const double dx = x - 0.5 * kSize, dy = y - 0.5 * kSize, r2 = (dx * dx + dy * dy) / (radius * radius);
        const double arms = std::pow(std::sin(2 * std::atan2(dy, dx)), 2);
        const double ring = std::pow(std::sin(std::numbers::pi * fringes * (1 - r2)), 2);
        const double signal = r2 < 1 ? gain * arms * ring * std::pow(1 - r2, 2) : 0;
        brightest = std::max(brightest, signal);
        micrograph.values(x, y) = std::round(100 + signal + std::sqrt(read * read + signal) * normal(random));
      }
    const NoiseModel noise = estimate_noise(micrograph);
    // Medians of 5,000 differences and more know a standard deviation to 4 %; the feet of the fringes that are taken
    // into the darkest level and the straight line through all of them cost as much again: 0.2 is three of both.
    EXPECT_NEAR(std::sqrt(variance_at(noise, 100)) / read, 1, 0.2) << read << ' ' << gain << ' ' << fringes;
    const double at_bright = read * read + 0.7 * brightest;
    EXPECT_NEAR(std::sqrt(variance_at(noise, 100 + 0.7 * brightest) / at_bright), 1, 0.2) << read << ' ' << gain;
  }
}

TEST(NoiseEstimate, NeverEndsAtTheFloorWhereThePictureScatters) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  for (const double pattern : {0.02, 0.05, 0.2}) {
    Picture micrograph;
    micrograph.values = Image(200, 200);
    micrograph.mask = Mask(200, 200, 1);
    const auto sd = [&](double s) { return std::hypot(45.0, pattern * s); };
    for (int y = 0; y < 200; ++y)
      for (int x = 0; x < 200; ++x) {
        const double s = 20 + 4000 * std::pow(std::sin(0.05 * x), 2);
        micrograph.values(x, y) = std::round(s + sd(s) * normal(random));
      }
    const NoiseModel noise = estimate_noise(micrograph);
    for (const double s : {20.0, 200.0, 1000.0, 4000.0}) {
      const double found = std::sqrt(variance_at(noise, s));
      EXPECT_GT(found, 0.5 * sd(s)) << pattern << ' ' << s;
      EXPECT_LT(found, 4 * sd(s)) << pattern << ' ' << s;
    }
  }
}

/// Of a background cut off at code 0 half of the pixels scatter no more: the others tell the noise.
TEST(NoiseEstimate, IsThatOfTheOthersWhereHalfOfThePixelsAreCutOff) {
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal;
  for (const double background : {-300.0, -30.0, 0.0}) {
    Picture micrograph;
    micrograph.values = Image(256, 256);
    micrograph.mask = Mask(256, 256, 1);
    for (int y = 0; y < 256; ++y)
      for (int x = 0; x < 256; ++x) {
        const double r = std::hypot(x - 128, y - 128);
        const double s = r < 90 ? 2000 * std::pow(std::sin(0.002 * (90 * 90 - r * r) / 4), 2) + 100 : background;
        micrograph.values(x, y) = std::max(0.0, std::round(s + 20 * normal(random)));
      }
    const NoiseModel noise = estimate_noise(micrograph);
    for (const double s : {200.0, 1000.0, 2000.0})
      // The fringes of 10 pixels' period at the edge add to the median: 10 % of noise, 5 % of fringes.
      EXPECT_NEAR(std::sqrt(variance_at(noise, s)), 20, 0.15 * 20) << background << ' ' << s;
  }
}

// A disc of 64 pixels under a load: fringes finer than a few pixels look like noise where it is bright. A line through
// them and the dark must not fall below what the dark pixels around the disc show themselves.
TEST(NoiseEstimate, OfTheDarkIsNotExtrapolatedFromFringes) {
  testing::IndependentDisc disc;
  disc.center_x_px = 32.3, disc.center_y_px = 30.6, disc.um_per_px = 200, disc.load_n = 150;
  std::vector<double> mean;
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 64; ++x) mean.push_back(50 + 1000 * disc.pixel(x, y, 8));
  for (unsigned long seed = 1; seed <= 20; ++seed) {
    Picture micrograph;
    micrograph.values = Image(64, 64);
    micrograph.mask = Mask(64, 64, 1);
    micrograph.values.values() = testing::camera(mean, 1, 3, seed, false);
    // 59 there, by photons and the camera: half of it, and a tenth for what 900 pixels leave open.
    EXPECT_GT(variance_at(estimate_noise(micrograph), 50), 0.4 * 59) << seed;
  }
}

// What rounding does to all of an even picture: twenty of them, whose light falls anywhere between codes 17 apart.
TEST(NoiseEstimate, RoundingIsSharedByPixelsOfEvenLight) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> light(100, 900);
  for (const double noise : {0.05, 0.3, 1.5}) {  // of a code
    std::vector<Picture> pictures(20);
    std::vector<const Picture*> all;
    double squares = 0;  // of what their means are off by
    for (Picture& picture : pictures) {
      picture.values = Image(20, 20);
      picture.mask = Mask(20, 20, 1);
      const double mean = light(random);
      double sum = 0;
      for (double& v : picture.values.values()) v = 17 * std::round(mean / 17 + noise * normal(random)), sum += v / 400;
      squares += (sum - mean) * (sum - mean) / static_cast<double>(pictures.size());
      all.push_back(&picture);
    }
    const CoarseCodes codes = coarse_codes(all);
    EXPECT_EQ(codes.step, 17);
    // Twenty pictures tell a standard deviation to a sixth: three of that, beside the pixels' own noise.
    EXPECT_NEAR(codes.shared_sd, std::sqrt(squares), 0.5 * std::sqrt(squares) + 17 * noise / 20);
    EXPECT_NEAR(codes.pixel_sd, 17 * std::sqrt(noise * noise + 1 / 12.0), 0.2 * codes.pixel_sd);
  }
  Picture smooth;
  smooth.values = Image(20, 20);
  smooth.mask = Mask(20, 20, 1);
  for (double& value : smooth.values.values()) value = normal(random);
  EXPECT_EQ(coarse_codes({&smooth}).step, 0);
}

}  // namespace
}  // namespace birefit::estimation
