// White and filtered light through retardances: against tables made by formulas alone (tests/data/instrument), against
// sums over the spectrum, and the figures of docs/methods.md, "Spectrum".

#include "instrument/coherence.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <map>
#include <random>
#include <string>

#include "instrument/colour.h"
#include "white_light.h"

namespace birefit {
namespace {
using namespace testing;

constexpr double kPi = 3.14159265358979323846;
constexpr double kDegree = kPi / 180;

/// A lamp and three channels, and their coherence in retarders of one dispersion.
struct White {
  Channels channels;
  SpectralSum fine;
  Coherence chi;
  White(Spectrum lamp, std::vector<Spectrum> seen, const std::string& law, double reach)
      : channels(std::move(lamp), {}, std::move(seen)),
        fine(channels.fine(reach)),
        chi(fine, turns(fine, law), reach) {}
  /// What a channel's 100 is in the tables: tristimulus values share Y's scale.
  double scale(std::size_t c, bool tristimulus) const {
    return tristimulus ? 100 * channels.white()[c] / channels.white()[1] : 100;
  }
};

struct Table {
  const char* file;
  std::array<const char*, 3> column;
  bool tristimulus;
};

TEST(Coherence, CrossedRetarders) {
  for (const Table& what : {Table{"retarder_crossed.csv", {"X", "Y", "Z"}, true},
                            Table{"retarder_crossed_camera.csv", {"R", "G", "B"}, false}}) {
    const ReferenceTable table(data_path(std::string("instrument/") + what.file));
    std::map<std::string, White> white;
    double worst = 0, worst_of_daylight = 0;
    for (std::size_t row = 0; row < table.size(); ++row) {
      const std::string lamp = table.text(row, "illuminant"), law = table.text(row, "dispersion");
      const White& w = white.try_emplace(lamp + law, lamp_of(lamp), what.tristimulus ? observer() : camera(), law, 6.5)
                           .first->second;
      for (std::size_t c = 0; c < 3; ++c) {
        const double x = 0.5 * w.chi.at(c, table.number(row, "retardance_nm") * 1e-3).loss;
        const double off = std::abs(x * w.scale(c, what.tristimulus) - table.number(row, what.column[c])) / 100;
        (lamp == "D65" && what.tristimulus ? worst_of_daylight : worst) =
            std::max(lamp == "D65" && what.tristimulus ? worst_of_daylight : worst, off);
      }
    }
    EXPECT_LT(worst, 5.1e-9) << "six decimals of a hundred";
    EXPECT_LT(worst_of_daylight, 4e-6) << "D65 beyond 780 nm, which the table's makers took as 0";
  }
}

TEST(Coherence, RetardersBetweenAnyPolarizers) {
  const ReferenceTable table(data_path("instrument/retarder_any_polarizers.csv"));
  const White white(illuminant_d65(), observer(), "quartz", 6.5);
  for (std::size_t row = 0; row < table.size(); ++row) {
    const double p = table.number(row, "polarizer_deg") * kDegree, a = table.number(row, "analyzer_deg") * kDegree;
    const double s = table.number(row, "slow_axis_deg") * kDegree, g = table.number(row, "retardance_nm") * 1e-3;
    const double open = std::pow(std::cos(p - a), 2), turned = std::sin(2 * (p - s)) * std::sin(2 * (a - s));
    for (std::size_t c = 0; c < 3; ++c) {
      const double x = open - 0.5 * turned * white.chi.at(c, g).loss;
      EXPECT_NEAR(x * white.scale(c, true) / 100,
                  table.number(row, c == 0   ? "X"
                                    : c == 1 ? "Y"
                                             : "Z") /
                      100,
                  4e-6)
          << row;
    }
  }
}

TEST(Coherence, TablesAreTheSum) {
  using D = Dual<double, 1>;
  for (const char* law : {"none", "quartz", "5cb_wu1993"}) {
    const White white(EqualEnergy{}, observer(), law, 20);
    const Coherence sum(white.fine, turns(white.fine, law), 1e-3);
    double value = 0, slope = 0;
    for (int k = 0; k < 1000; ++k) {
      D g(19.99 * (k + 0.37) / 1000 * (k % 2 == 0 ? 1 : -1));
      g.d[0] = 1;
      for (std::size_t c = 0; c < 3; ++c) {
        const MeanPhase<D> a = white.chi.at(c, g), b = sum.at(c, g);
        value = std::max({value, std::abs(a.loss.value - b.loss.value), std::abs(a.im.value - b.im.value)});
        slope = std::max({slope, std::abs(a.loss.d[0] - b.loss.d[0]), std::abs(a.im.d[0] - b.im.d[0])});
      }
    }
    EXPECT_LT(value, 1e-13) << law;
    EXPECT_LT(slope, 1e-10) << law;
    // Both against twice to four times as many wavelengths.
    const SpectralSum finer = white.channels.fine(100);
    const Coherence exact(finer, turns(finer, law), 1e-3);
    double apart = 0;
    for (double g = 0.1; g < 20; g += 0.3)
      for (std::size_t c = 0; c < 3; ++c)
        apart = std::max(apart, std::abs(exact.at(c, g).loss - white.chi.at(c, g).loss));
    EXPECT_LT(apart, 2e-9) << law;
  }
}

TEST(Coherence, DarkPixelsKeepTheirDigits) {
  const White white(EqualEnergy{}, observer(), "quartz", 5);
  const std::vector<double> t = turns(white.fine, "quartz");
  for (const double g : {1e-9, 1e-6, 1e-4, 1e-3, 1e-2, 0.1}) {
    double loss = 0;
    for (std::size_t k = 0; k < t.size(); ++k)
      loss += white.fine.weight[1][k] * 2 * std::pow(std::sin(kPi * t[k] * g), 2);
    EXPECT_NEAR(white.chi.at(1, g).loss / loss, 1, 1e-12) << g;
  }
  Dual<double, 1> zero(0.0);
  zero.d[0] = 1;
  EXPECT_EQ(white.chi.at(1, zero).loss.value, 0);
  EXPECT_EQ(white.chi.at(1, zero).loss.d[0], 0);
  EXPECT_GT(white.chi.at(1, zero).im.d[0], 10);
}

TEST(Coherence, LanesAreNumbers) {
  using L = Dual<Pack, 1>;
  using D = Dual<double, 1>;
  const White white(illuminant_a(), observer(), "none", 8);
  std::mt19937 random(3);
  for (int k = 0; k < 200; ++k) {
    alignas(64) double at[kLanes];
    // In one panel, over the first two, anywhere, and beyond the table.
    const double spread[] = {1e-4, 0.3, 7.9, 12};
    for (double& g : at)
      g = (k % 4 == 0 ? 0.01 * k : 0) +
          spread[k % 4] * (static_cast<double>(random()) / 4294967296.0 - (k % 8 < 4 ? 0 : 0.5));
    L g(Pack::load_aligned(at));
    g.d[0] = Pack(1.0);
    const MeanPhase<L> lanes = white.chi.at(2, g);
    for (int i = 0; i < kLanes; ++i) {
      D one(at[i]);
      one.d[0] = 1;
      const MeanPhase<D> number = white.chi.at(2, one);
      EXPECT_NEAR(lane(lanes.loss.value, i), number.loss.value, 1e-13);
      EXPECT_NEAR(lane(lanes.im.value, i), number.im.value, 1e-13);
      EXPECT_NEAR(lane(lanes.loss.d[0], i), number.loss.d[0], 1e-11);
      EXPECT_NEAR(lane(lanes.im.d[0], i), number.im.d[0], 1e-11);
    }
  }
}

TEST(Coherence, DerivativesByTheLampAndByTheDispersion) {
  const auto with = [](double kelvin) { return White(Planck{kelvin}, camera(), "quartz", 5); };
  const White here = with(3100), above = with(3101), below = with(3099);
  for (const double g : {0.05, 0.4, 1.7, 4.2})
    for (std::size_t c = 0; c < 3; ++c) {
      const MeanPhase<double> slope = here.chi.at(here.chi.row_of(0, c), g);
      EXPECT_NEAR(slope.loss, (above.chi.at(c, g).loss - below.chi.at(c, g).loss) / 2, 5e-11);
      EXPECT_NEAR(slope.im, (above.chi.at(c, g).im - below.chi.at(c, g).im) / 2, 5e-11);
    }
  // t = 1/l + p (1/l^3 - 1/l0^2 l) by p: dchi/dp = 2 pi i G Int w dt/dp e^{i delta}.
  const SpectralSum sum = here.fine;
  const auto t_of = [&](double p) {
    std::vector<double> t;
    for (const double l : sum.wavelength_um) t.push_back((1 + p * (1 / (l * l) - 1 / (0.5893 * 0.5893))) / l);
    return t;
  };
  std::vector<double> row;
  double total = 0;
  for (std::size_t k = 0; k < sum.size(); ++k) {
    const double l = sum.wavelength_um[k];
    row.push_back(sum.weight[0][k] * (1 / (l * l) - 1 / (0.5893 * 0.5893)) / l);
    total += row.back();
  }
  const double p = 0.02, step = 1e-5;
  const Coherence slope(std::vector<std::vector<double>>{row}, t_of(p), 5), more(sum, t_of(p + step), 5),
      less(sum, t_of(p - step), 5);
  for (const double g : {0.05, 0.4, 1.7, 4.2}) {
    const MeanPhase<double> m = slope.at(0, g);
    const std::complex<double> by_p = std::complex<double>(0, 2 * kPi * g) * std::complex<double>(total - m.loss, m.im);
    EXPECT_NEAR(by_p.real(), -(more.at(0, g).loss - less.at(0, g).loss) / (2 * step), 1e-6);
    EXPECT_NEAR(by_p.imag(), (more.at(0, g).im - less.at(0, g).im) / (2 * step), 1e-6);
  }
}

// Path differences (um) beyond which |chi| stays below 0.5, 0.1, 1e-2 and 1e-3.
TEST(Coherence, ReachOfWhiteLight) {
  struct Reach {
    std::vector<Spectrum> seen;
    const char* lamp;
    std::array<std::array<double, 4>, 3> um;
  };
  for (const Reach& reach :
       {Reach{observer(), "E", {{{1.95, 3.65, 6.20, 12.78}, {1.41, 2.57, 4.90, 7.97}, {1.66, 3.06, 7.24, 15.52}}}},
        Reach{camera(), "A", {{{2.58, 6.92, 16.35, 62.61}, {1.39, 2.94, 6.25, 16.56}, {1.27, 2.26, 7.59, 27.49}}}}}) {
    const White white(lamp_of(reach.lamp), reach.seen, "none", 80);
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t i = 0; i < 4; ++i) {
        const double limit = std::array{0.5, 0.1, 1e-2, 1e-3}[i];
        double last = 0;
        for (double g = 0.01; g < 79.9; g += 0.01)
          if (const MeanPhase<double> m = white.chi.at(c, g); std::hypot(m.re(), m.im) >= limit) last = g;
        EXPECT_NEAR(last, reach.um[c][i], 0.015) << reach.lamp << " " << c;
      }
  }
}

// Sums over every 40, 20, 10, 5 nm from 380 nm on, as colour is computed everywhere: where a retarder between crossed
// polarizers comes out wrong by 1e-3 of white in any channel, and by a CIEDE2000 of 1.
TEST(Coherence, AliasingOfSumsOverTheWavelength) {
  const White white(EqualEnergy{}, observer(), "none", 40);
  const Xyz w{white.scale(0, true), 100, white.scale(2, true)};
  for (const auto& [step, wrong, seen] :
       {std::array{0.04, 0.11, 0.96}, {0.02, 0.74, 3.17}, {0.01, 7.76, 12.23}, {0.005, 26.75, 30.78}}) {
    double first_wrong = 0, first_seen = 0;
    for (double g = 0.01; g < 35 && first_seen == 0; g += 0.01) {
      std::array<double, 3> sum, exact;
      for (std::size_t c = 0; c < 3; ++c) {
        double light = 0, all = 0;
        for (double l = 0.38; l < 0.8301; l += step) {
          const double v = value_at(colour_matching(static_cast<int>(c)), l);
          light += v * std::pow(std::sin(kPi * g / l), 2);
          all += v;
        }
        sum[c] = light / all;
        exact[c] = 0.5 * white.chi.at(c, g).loss;
        if (first_wrong == 0 && std::abs(sum[c] - exact[c]) > 1e-3) first_wrong = g;
      }
      const auto lab = [&](const std::array<double, 3>& x) { return lab_of({w.x * x[0], w.y * x[1], w.z * x[2]}, w); };
      if (ciede2000(lab(sum), lab(exact)) > 1) first_seen = g;
    }
    EXPECT_NEAR(first_wrong, wrong, 0.015) << step;
    EXPECT_NEAR(first_seen, seen, 0.015) << step;
  }
}

TEST(GaussianLine, OrdersOfThePhase) {
  const ReferenceTable table(data_path("instrument/filtered_plate.csv"));
  // [width][order]: no dispersion of the phase but of the wave number at the centre; linear; chirp; third.
  std::map<int, std::array<double, 4>> worst;
  double estimate = 0, sums = 0, nodes = 0;
  for (std::size_t row = 0; row < table.size(); ++row) {
    const double g = table.number(row, "retardance_589_um"), l0 = table.number(row, "centre_nm") * 1e-3;
    const double fwhm = table.number(row, "fwhm_nm") * 1e-3, want = table.number(row, "I_gauss_wavelength");
    const std::string law = table.text(row, "dispersion");
    using Series = Taylor<double, 4>;
    const Series l = Series::variable(1.0) * Series(l0);
    const PhaseSeries<double> phase = phase_series(Series(2 * kPi * g) * dispersion(law, l) / l);
    const double sigma = fwhm / (2 * std::sqrt(2 * std::log(2)) * l0);
    std::array<PhaseSeries<double>, 4> order;
    order.fill(phase);
    order[0].d1 = -phase.d0;
    for (const std::size_t i : {0u, 1u}) order[i].d2 = 0;
    for (const std::size_t i : {0u, 1u, 2u}) order[i].d3 = 0;
    std::array<double, 4>& w = worst[static_cast<int>(std::lround(fwhm * 1e3))];
    for (std::size_t i = 0; i < 4; ++i)
      w[i] = std::max(w[i], std::abs(0.5 * gaussian_line(order[i], sigma).loss - want));
    const double error = std::abs(0.5 * gaussian_line(phase, sigma).loss - want);
    if (error > 1e-7) estimate = std::max(estimate, error / (0.5 * gaussian_line_error(phase, sigma)));
    // The same line as a lamp, to its sum and to the Gauss rule.
    const auto intensity = [&](double um) { return std::pow(std::sin(kPi * g * dispersion(law, um) / um), 2); };
    const SpectralSum sum = Channels(GaussianLine{l0, fwhm}, {}, {EqualEnergy{}}).fine(g);
    sums = std::max(sums, std::abs(sum.of(intensity)[0] - want));
    const double deviation = sigma * std::abs(phase.d1);
    const bool absorbed = law == "5cb_wu1993" && l0 - 3.6 * fwhm < 0.36;  // the law's absorption is at 282 nm
    if (deviation < 6 && !absorbed)
      nodes = std::max(nodes, difference(gauss_sum(sum, line_nodes(deviation)), sum, intensity));
  }
  const std::map<int, std::array<double, 4>> stated{
      {1, {0.14, 6.1e-4, 1.6e-6, 1e-8}}, {10, {0.12, 3.2e-3, 1.7e-4, 4e-6}}, {40, {0.10, 1.7e-2, 1.2e-3, 2e-4}}};
  for (const auto& [width, limits] : stated)
    for (std::size_t i = 0; i < 4; ++i) {
      EXPECT_LT(worst.at(width)[i], limits[i]) << width << " nm, order " << i;
      EXPECT_GT(worst.at(width)[i], 0.3 * limits[i]) << width << " nm, order " << i;
    }
  EXPECT_LT(estimate, 1.1);
  EXPECT_LT(sums, 1e-9);
  EXPECT_LT(nodes, 1e-4);
}

// By the thickness of a plate and by the width of the line, in lanes.
TEST(GaussianLine, HasDerivatives) {
  const double l0 = 0.55;
  const auto mean = [&](const auto& g, const auto& fwhm) {
    using S = std::decay_t<decltype(g)>;
    using Series = Taylor<S, 4>;
    const Series l = Series::variable(S(1.0)) * Series(S(l0));
    return gaussian_line(phase_series(Series(2 * kPi * g) * dispersion("quartz", l) / l), fwhm * S(1 / (2.3548 * l0)));
  };
  Dual<Pack, 2> g(Pack(30.0)), fwhm(Pack(0.01));
  g.d[0] = fwhm.d[1] = Pack(1.0);
  const MeanPhase<Dual<Pack, 2>> m = mean(g, fwhm);
  EXPECT_NEAR(lane(m.loss.value, 0), mean(30.0, 0.01).loss, 1e-12);
  const double step = 1e-5;
  EXPECT_NEAR(lane(m.loss.d[0], 0), (mean(30 + step, 0.01).loss - mean(30 - step, 0.01).loss) / (2 * step), 1e-7);
  EXPECT_NEAR(lane(m.im.d[0], 0), (mean(30 + step, 0.01).im - mean(30 - step, 0.01).im) / (2 * step), 1e-7);
  EXPECT_NEAR(lane(m.loss.d[1], 0), (mean(30.0, 0.01 + step).loss - mean(30.0, 0.01 - step).loss) / (2 * step), 1e-2);
  EXPECT_NEAR(lane(m.im.d[1], 0), (mean(30.0, 0.01 + step).im - mean(30.0, 0.01 - step).im) / (2 * step), 1e-2);
}

/// Ideal retarder of uniform twist (closed form, Jones 1948; tangential field only): angles in rad.
double twisted_cell(double um, double thickness, double twist, double entry, double polarizer, double analyzer) {
  using C = std::complex<double>;
  const double half = kPi * thickness * nematic_e7(um) / um, x = std::hypot(twist, half);
  const double s = std::sin(x) / x, c = std::cos(x);
  const double along = std::cos(polarizer - entry), across = std::sin(polarizer - entry);
  const C first = C(c, half * s) * along + twist * s * across, second = C(c, -half * s) * across - twist * s * along;
  const double out = analyzer - entry - twist;
  return std::norm(first * std::cos(out) + second * std::sin(out));
}

TEST(SpectralNodes, TwistedCells) {
  const ReferenceTable table(data_path("instrument/twisted_cell.csv"));
  for (const char* lamp : {"E", "A", "D65"}) {
    const Channels channels(lamp_of(lamp), {}, observer());
    const SpectralSum fine = channels.fine();
    std::vector<double> t;
    for (const double l : fine.wavelength_um) t.push_back(nematic_e7(l) / nematic_e7(0.5893) / l);
    const double per_um = cycles_per_um(fine, t);
    for (const std::size_t row : table.rows_where("illuminant", lamp)) {
      const double thickness = table.number(row, "thickness_um");
      const auto angle = [&](const char* column) { return table.number(row, column) * kDegree; };
      const auto intensity = [&](double um) {
        return twisted_cell(um, thickness, angle("twist_deg"), angle("entry_azimuth_deg"), angle("polarizer_deg"),
                            angle("analyzer_deg"));
      };
      const std::vector<double> x = fine.of(intensity);
      for (std::size_t c = 0; c < 3; ++c)
        EXPECT_NEAR(x[c] * channels.white()[c] / channels.white()[1], table.number(row, std::string(1, "XYZ"[c])) / 100,
                    lamp == std::string("D65") ? 4e-6 : 5.1e-9);
      const double cycles = per_um * thickness * nematic_e7(0.5893);
      const int n = gauss_nodes(cycles, 1e-3);
      const SpectralSum few = gauss_sum(fine, n), more = gauss_sum(fine, n + 3);
      const double error = difference(few, fine, intensity);
      EXPECT_LT(error, 1e-3) << row;
      EXPECT_LT(error, 3 * difference(few, more, intensity) + 1e-5) << row;
      EXPECT_LT(difference(gauss_sum(fine, gauss_nodes(cycles, 1e-4)), fine, intensity), 1e-4) << row;
      EXPECT_LT(difference(channels.uniform(uniform_nodes(cycles)), fine, intensity), 1e-3) << row;
    }
  }
}

// Planned counts are enough, and no more than 1.3 times those that are and five: of random cells of so many cycles, the
// worst of a dozen.
TEST(SpectralNodes, CountsAreEnoughAndNotTooMany) {
  std::mt19937 random(5);
  const auto uniform = [&](double a, double b) { return a + (b - a) * (static_cast<double>(random()) / 4294967296.0); };
  for (const auto& [lamp, seen] : {std::pair{"E", observer()}, {"A", camera()}, {"D65", camera()}}) {
    const Channels channels(lamp_of(lamp), {}, seen);
    const SpectralSum fine = channels.fine(40);
    std::vector<double> t;
    for (const double l : fine.wavelength_um) t.push_back(nematic_e7(l) / nematic_e7(0.5893) / l);
    const double per_um = cycles_per_um(fine, t);
    for (const double cycles : {1.3, 2.2, 3.7, 7.3, 15.0, 30.0}) {
      const double thickness = cycles / per_um / nematic_e7(0.5893);
      std::vector<std::function<double(double)>> cells;
      for (int k = 0; k < 12; ++k) {
        // A retarder, cells of half a turn, helices of up to five.
        const double twist = k == 0 ? 1e-9 : k < 6 ? uniform(-3.2, 3.2) : uniform(-31, 31);
        const double entry = k == 0 ? kPi / 4 : uniform(0, 3.1), polarizer = k == 0 ? 0 : uniform(0, 3.1);
        const double analyzer = k % 2 == 0 ? polarizer + kPi / 2 : uniform(0, 3.1);
        cells.push_back([=](double um) { return twisted_cell(um, thickness, twist, entry, polarizer, analyzer); });
      }
      const auto worst = [&](const SpectralSum& sum) {
        double error = 0;
        for (const auto& cell : cells) error = std::max(error, difference(sum, fine, cell));
        return error;
      };
      for (const double error : {1e-5, 1e-6})
        EXPECT_LT(worst(gauss_sum(fine, gauss_nodes(cycles, error))), error) << lamp << " " << cycles;
      for (const double error : {1e-3, 1e-4}) {
        const int n = gauss_nodes(cycles, error);
        EXPECT_LT(worst(gauss_sum(fine, n)), error) << lamp << " " << cycles;
        // That many less would not do.
        const int least = static_cast<int>((n - 5) / 1.3);
        EXPECT_GT(worst(gauss_sum(fine, std::max(1, least - 1))), error) << lamp << " " << cycles << " of " << n;
      }
      EXPECT_LT(worst(channels.uniform(uniform_nodes(cycles))), 1e-3) << lamp << " " << cycles;
    }
  }
}

}  // namespace
}  // namespace birefit
