// Spectra, and what channels make of them: facts of the CIE, derivatives, mistakes of users.

#include "instrument/spectrum.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>

#include "instrument/channels.h"
#include "white_light.h"

namespace birefit {
namespace {
using namespace testing;
using ::testing::HasSubstr;

template <class F>
std::string complaint(const F& make) {
  try {
    make();
  } catch (const UserError& error) {
    return error.what();
  }
  return "none";
}

// CIE 15, table of tristimulus values of the illuminants: sums over 5 nm, so that they differ by a hundredth.
TEST(Spectrum, WhitesOfTheIlluminants) {
  struct White {
    const char* lamp;
    double x, z, cie_x, cie_z;
  };
  for (const White& white :
       {White{"E", 100.0079443, 100.0327853, 100.00, 100.00}, White{"A", 109.8502955, 35.5851654, 109.85, 35.58},
        White{"D65", 95.0470651, 108.8815218, 95.04, 108.88}}) {
    const std::vector<double> w = Channels(lamp_of(white.lamp), {}, observer()).white();
    EXPECT_NEAR(100 * w[0] / w[1], white.x, 1e-6) << white.lamp;
    EXPECT_NEAR(100 * w[2] / w[1], white.z, 1e-6) << white.lamp;
    EXPECT_NEAR(100 * w[0] / w[1], white.cie_x, 0.04) << white.lamp;
    EXPECT_NEAR(100 * w[2] / w[1], white.cie_z, 0.04) << white.lamp;
  }
}

// ISO/CIE 11664-2: S(l) = 100 (560/l)^5 (e^{1.435e7/(2848 * 560)} - 1)/(e^{1.435e7/(2848 l)} - 1), l in nm.
TEST(Spectrum, IlluminantAIsABlackBody) {
  for (double nm = 300; nm <= 830; nm += 10) {
    const double a =
        std::pow(560 / nm, 5) * (std::exp(1.435e7 / (2848 * 560)) - 1) / (std::exp(1.435e7 / (2848 * nm)) - 1);
    EXPECT_NEAR(value_at(illuminant_a(), nm * 1e-3), a, 1e-12 * a) << nm;
  }
  EXPECT_NEAR(illuminant_a().temperature_k, 2855.5, 0.05);
}

TEST(Spectrum, TablesOfTheCieAreRead) {
  EXPECT_EQ(value_at(illuminant_d65(), 0.56), 100);
  EXPECT_NEAR(value_at(illuminant_d65(), 0.5625), 0.5 * (100 + 98.1671), 1e-10);  // linear between entries
  EXPECT_EQ(value_at(illuminant_d65(), 0.83), 60.3125);
  EXPECT_EQ(value_at(illuminant_d65(), 0.8301), 0);
  EXPECT_EQ(value_at(colour_matching(1), 0.555), 1);
  EXPECT_EQ(value_at(colour_matching(2), 0.45), 1.77211);
  // The observer's three curves have the same area up to the digits of the table.
  double area[3] = {0, 0, 0};
  for (int c = 0; c < 3; ++c)
    area[c] = std::accumulate(colour_matching(c).value.begin(), colour_matching(c).value.end(), 0.0);
  EXPECT_NEAR(area[0] / area[1], 1, 4e-4);
  EXPECT_NEAR(area[2] / area[1], 1, 4e-4);
}

TEST(Spectrum, SlopesAreDerivatives) {
  const std::vector<Spectrum> spectra{Planck{3100}, GaussianLine{0.55, 0.01}, FlatBand{0.52, 0.04, 0.01}};
  const auto moved = [](Spectrum spectrum, std::size_t number, double by) {
    if (auto* body = std::get_if<Planck>(&spectrum)) body->temperature_k += by;
    if (auto* line = std::get_if<GaussianLine>(&spectrum)) (number == 0 ? line->centre_um : line->fwhm_um) += by;
    if (auto* band = std::get_if<FlatBand>(&spectrum))
      (number == 0 ? band->centre_um : number == 1 ? band->width_um : band->edge_um) += by;
    return spectrum;
  };
  for (const Spectrum& spectrum : spectra) {
    const std::size_t count = numbers_of(spectrum).size();
    const double step = std::holds_alternative<Planck>(spectrum) ? 0.1 : 1e-6;
    for (const double l : {0.502, 0.5371, 0.5413, 0.5555}) {
      std::vector<double> slope(count);
      slopes_at(spectrum, l, slope.data());
      for (std::size_t i = 0; i < count; ++i) {
        const double by_difference =
            (value_at(moved(spectrum, i, step), l) - value_at(moved(spectrum, i, -step), l)) / (2 * step);
        EXPECT_NEAR(slope[i], by_difference, 1e-6 * std::abs(by_difference) + 1e-9) << l << " " << i;
      }
    }
    // And those of channels: of weights that sum to 1 whatever the number is.
    for (std::size_t i = 0; i < count; ++i) {
      const auto intensity = [](double l) { return std::pow(std::sin(11 / l), 2); };
      const Channels channels(spectrum, {}, observer());
      const SpectralSum sum = channels.fine();
      const std::vector<double> above = Channels(moved(spectrum, i, step), {}, observer()).fine().of(intensity);
      const std::vector<double> below = Channels(moved(spectrum, i, -step), {}, observer()).fine().of(intensity);
      for (std::size_t c = 0; c < 3; ++c) {
        double derivative = 0;
        for (std::size_t k = 0; k < sum.size(); ++k) derivative += sum.slope[i][c][k] * intensity(sum.wavelength_um[k]);
        EXPECT_NEAR(derivative, (above[c] - below[c]) / (2 * step), 1e-4 * std::abs(derivative) + 1e-9)
            << i << " " << c;
        EXPECT_NEAR(std::accumulate(sum.slope[i][c].begin(), sum.slope[i][c].end(), 0.0), 0, 1e-12 / step);
      }
    }
  }
  const Channels both(Planck{3000}, {GaussianLine{0.55, 0.1}, EqualEnergy{}, FlatBand{0.5, 0.2, 0.02}}, observer());
  EXPECT_EQ(both.numbers(), (std::vector<std::string>{"lamp.temperature_k", "filter1.centre_um", "filter1.fwhm_um",
                                                      "filter3.centre_um", "filter3.width_um", "filter3.edge_um"}));
}

TEST(Spectrum, ABandIsWhatItSays) {
  const FlatBand band{0.55, 0.04, 0.01};
  EXPECT_NEAR(value_at(band, 0.5349), 0.99, 1e-12) << "just below the corner at 0.535";
  EXPECT_EQ(value_at(band, 0.55), 1);
  EXPECT_NEAR(value_at(band, 0.53), 0.5, 1e-12);
  EXPECT_NEAR(value_at(band, 0.57), 0.5, 1e-12);
  EXPECT_EQ(value_at(band, 0.5249), 0);
  const GaussianLine line{0.55, 0.01};
  EXPECT_NEAR(value_at(line, 0.555), 0.5, 1e-12);
}

TEST(Spectrum, MistakesOfTables) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto table = [](std::vector<double> l, std::vector<double> v) {
    return complaint([&] { spectral_table(l, v, {"lamp.csv"}, "the lamp's table"); });
  };
  EXPECT_EQ(table({0.4, 0.5, 0.7}, {0, 1, 2}), "none");
  EXPECT_THAT(table({0.4, nan, 0.7}, {0, 1, 2}), HasSubstr("entry 2: nan is not a number"));
  EXPECT_THAT(table({0.4, 0.5, 0.7}, {0, 1, nan}), HasSubstr("entry 3: nan"));
  EXPECT_THAT(table({0.4, 0.5, 0.5}, {0, 1, 2}), HasSubstr("entry 3: wavelengths must grow"));
  EXPECT_THAT(table({0.4, 0.5, 0.7}, {0, -1, 2}), HasSubstr("entry 2: -1 is negative"));
  EXPECT_THAT(table({400, 500, 700}, {0, 1, 2}), HasSubstr("looks like nanometres"));
  EXPECT_THAT(table({400, 500, 500}, {0, -1, 2}),
              AllOf(HasSubstr("nanometres"), HasSubstr("grow"), HasSubstr("negative")));
  EXPECT_THAT(table({0.4, 0.5}, {0, 0}), HasSubstr("0 everywhere"));
  EXPECT_THAT(table({0.4}, {1}), HasSubstr("at least two"));
  EXPECT_THAT(table({0.4, 0.5}, {1}), HasSubstr("2 wavelengths and 1 values"));
  EXPECT_THAT(table({0.4}, {1}), HasSubstr("lamp.csv"));
}

TEST(Spectrum, MistakesOfLampsAndFilters) {
  EXPECT_THAT(complaint([] { check_spectrum(GaussianLine{550, 10}); }), HasSubstr("looks like nanometres"));
  EXPECT_THAT(complaint([] { check_spectrum(GaussianLine{0.55, 0}); }), HasSubstr("full width at half maximum"));
  EXPECT_THAT(complaint([] { check_spectrum(Planck{-3000}); }), HasSubstr("temperature"));
  EXPECT_THAT(complaint([] { check_spectrum(FlatBand{0.55, 0.02, 0.03}); }), HasSubstr("edge"));
  const auto made = [](Spectrum lamp, std::vector<Spectrum> filters, std::vector<Spectrum> sensitivities) {
    return complaint([&] { Channels(lamp, filters, sensitivities); });
  };
  const SpectralTable narrow = spectral_table({0.42, 0.7}, {1, 1});
  EXPECT_THAT(made(narrow, {}, observer()), AllOf(HasSubstr("the lamp is known from 0.42 to 0.7 um only"),
                                                  HasSubstr("channel 1"), HasSubstr("channel 3")));
  // Not where a filter stops what the lamp's table lacks, or where the camera's own table ends.
  EXPECT_EQ(made(narrow, {GaussianLine{0.55, 0.02}}, observer()), "none");
  EXPECT_EQ(made(illuminant_d65(), {}, camera()), "none");
  EXPECT_EQ(made(illuminant_a(), {}, camera()), "none");
  EXPECT_THAT(made(EqualEnergy{}, {spectral_table({0.5, 0.6}, {1, 1})}, observer()), HasSubstr("filter 1 is known"));
  EXPECT_THAT(made(GaussianLine{0.9, 0.01}, {}, observer()), HasSubstr("records nothing"));
  EXPECT_THAT(made(EqualEnergy{}, {}, {EqualEnergy{}}), HasSubstr("ends anywhere"));
  EXPECT_THAT(made(GaussianLine{550, 10}, {Planck{0}}, observer()),
              AllOf(HasSubstr("the lamp"), HasSubstr("filter 1")));
}

TEST(Channels, WhiteIsOneInEverySum) {
  const Channels channels(illuminant_a(), {FlatBand{0.55, 0.3, 0.02}}, camera());
  const SpectralSum fine = channels.fine();
  for (const SpectralSum& sum : {fine, channels.uniform(60), gauss_sum(fine, 1), gauss_sum(fine, 40)}) {
    for (const double x : sum.of([](double) { return 1.0; })) EXPECT_NEAR(x, 1, 1e-13);
    for (const auto& number : sum.slope)
      for (const std::vector<double>& row : number) EXPECT_NEAR(std::accumulate(row.begin(), row.end(), 0.0), 0, 1e-10);
    for (std::size_t k = 1; k < sum.size(); ++k) EXPECT_GT(sum.wavelength_um[k], sum.wavelength_um[k - 1]);
  }
}

// Of all channels together the rule of n nodes integrates polynomials in 1/wavelength of degree 2 n - 1, of each
// channel those below n: weights of a measure of their own.
TEST(Channels, DegreesOfTheGaussRule) {
  const SpectralSum fine = Channels(lamp_of("E"), {}, camera()).fine();
  constexpr int n = 7;
  const SpectralSum rule = gauss_sum(fine, n);
  ASSERT_EQ(rule.size(), std::size_t{n});
  for (int degree = 0; degree < 2 * n; ++degree) {
    const auto power = [&](double l) { return std::pow(1 / l - 1.9, degree); };
    const std::vector<double> want = fine.of(power), got = rule.of(power);
    double all_want = 0, all_got = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      all_want += want[c];
      all_got += got[c];
      EXPECT_NEAR(got[c], want[c], degree < n ? 1e-13 : 1) << degree;
    }
    EXPECT_NEAR(all_got, all_want, 1e-13) << degree;
  }
  EXPECT_GT(difference(rule, fine, [](double l) { return std::pow(1 / l - 1.9, 2 * n); }), 1e-9);
  // Derivatives by the lamp's temperature are integrated alike.
  const SpectralSum warm = Channels(Planck{3200}, {}, camera()).fine(), nodes = gauss_sum(warm, n);
  for (std::size_t c = 0; c < 3; ++c) {
    double want = 0, got = 0;
    for (std::size_t k = 0; k < warm.size(); ++k) want += warm.slope[0][c][k] * std::pow(1 / warm.wavelength_um[k], 4);
    for (std::size_t k = 0; k < nodes.size(); ++k)
      got += nodes.slope[0][c][k] * std::pow(1 / nodes.wavelength_um[k], 4);
    EXPECT_NEAR(got, want, 1e-12);
  }
}

// What the reading of a table means: every fifth row of the observer's, read linearly, is another observer.
TEST(Channels, FiveNanometresAreNotEnoughOfTheObserver) {
  std::vector<Spectrum> coarse;
  for (int c = 0; c < 3; ++c) {
    std::vector<double> l, v;
    for (std::size_t i = 0; i < colour_matching(c).value.size(); i += 5) {
      l.push_back(colour_matching(c).wavelength_um[i]);
      v.push_back(colour_matching(c).value[i]);
    }
    coarse.push_back(spectral_table(l, v));
  }
  const SpectralSum fine = Channels(EqualEnergy{}, {}, observer()).fine(),
                    other = Channels(EqualEnergy{}, {}, coarse).fine();
  double worst = 0;
  for (double g = 0; g < 6; g += 0.05)
    worst = std::max(worst, difference(fine, other, [g](double l) { return std::pow(std::sin(M_PI * g / l), 2); }));
  RecordProperty("worst", std::to_string(worst));
  EXPECT_GT(worst, 3e-4);
  EXPECT_LT(worst, 3e-3);
}

}  // namespace
}  // namespace birefit
