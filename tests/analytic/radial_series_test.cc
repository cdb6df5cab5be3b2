// The exact series of the radial ball against its own laws, against textbook series coded here from Boost's Bessel
// functions, against the Born approximation and against tabulated images (tests/data/wave/README.md).

#include "wave/radial_series.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <boost/math/special_functions/bessel.hpp>
#include <cmath>
#include <complex>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "core/quadrature.h"
#include "reference_table.h"

namespace birefit {
namespace {
using namespace testing;
using Cplx = std::complex<double>;
constexpr double kPi = std::numbers::pi;

Cplx number(const Complex<double>& a) { return {a.re, a.im}; }
double k0_of(double wavelength_um) { return 2 * kPi / wavelength_um; }

using Ball = RadialBall<double>;
const Ball kDroplet{{{4.5, 1.52, 1.74}}, 1.43, k0_of(0.59)};
const Ball kNegative{{{2.0, 1.6, 1.5}}, 1.33, k0_of(0.48)};
const Ball kSmall{{{0.05, 1.52, 1.74}}, 1.43, k0_of(0.59)};
const Ball kShell{{{1.4, 1.46, 1.46}, {2.1, 1.52, 1.74}}, 1.40, k0_of(0.59)};
const Ball kOnion{{{0.02, 1.8, 1.4}, {1.0, 1.33, 1.33}, {1.3, 1.52, 1.74}, {2.0, 1.6, 1.5}}, 1.45, k0_of(0.633)};
const Ball kBig{{{30.0, 1.52, 1.74}}, 1.43, k0_of(0.59)};
const Ball kBigShell{{{25.0, 1.33, 1.33}, {30.0, 1.52, 1.74}}, 1.43, k0_of(0.59)};
const std::vector<Ball> kBalls{kDroplet, kNegative, kSmall, kShell, kOnion, kBig, kBigShell};

double largest_difference(const RadialSeries<double>& f, const RadialSeries<double>& g) {
  double most = 0;
  for (std::size_t i = 0; i < std::min(f.a.size(), g.a.size()); ++i)
    most = std::max({most, std::abs(number(f.a[i] - g.a[i])), std::abs(number(f.b[i] - g.b[i]))});
  return most;
}

// ---- the radial functions ------------------------------------------------------------------------------------------

// The equation is u'' = (lambda / z^2 - 1) u, and both numbers of a pair carry the same factor, which may depend on z;
// the logarithmic derivative p = u'/u does not know it: p' = lambda / z^2 - 1 - p^2, multiplied here by u^2 so that
// zeros of u do no harm. Pairs are scaled to 1; their rounding comes magnified by the number of Miller's steps, and by
// lambda / z^2.
TEST(RadialSeries, RegularSolutionSolvesItsEquation) {
  std::mt19937 random(7);
  for (int trial = 0; trial < 400; ++trial) {
    const double z = std::exp(std::uniform_real_distribution<>(std::log(0.05), std::log(700))(random));
    const double nu = std::uniform_real_distribution<>(0.1, 1.2 * z + 20)(random);
    Dual<double, 1> at(z);
    at.d[0] = 1;
    const auto pair = regular_pair(Dual<double, 1>(nu), at);
    const double u = pair.u.value, v = pair.slope.value, well = nu * (nu + 1) / (z * z) - 1;
    EXPECT_NEAR((pair.slope.d[0] * u - v * pair.u.d[0]), well * u * u - v * v, 1e-12 * (1 + std::abs(well)))
        << nu << ' ' << z;
  }
}

// Against Boost where it is at home; its real orders are good to some 1e-13 and the pair is normalised to length 1.
TEST(RadialSeries, RegularSolutionIsABesselFunctionOfRealOrder) {
  for (double z : {0.3, 5.0, 40.0, 73.0})
    for (double nu : {0.37, 1.0, 3.7, 31.4, 60.0, 88.8}) {
      const RadialPair<double> pair = regular_pair(nu, z);
      const double psi = std::sqrt(z) * boost::math::cyl_bessel_j(nu + 0.5, z);
      const double next = std::sqrt(z) * boost::math::cyl_bessel_j(nu + 1.5, z), slope = (nu + 1) / z * psi - next;
      const double length = std::hypot(pair.u, pair.slope) * std::hypot(psi, slope);
      EXPECT_NEAR((pair.u * slope - pair.slope * psi) / length, 0, 1e-12) << nu << ' ' << z;
      EXPECT_GT(pair.u * psi + pair.slope * slope, 0);
    }
}

// psi xi' - psi' xi = i (psi eta' - psi' eta), that is psi_(n-1) eta_n - psi_n eta_(n-1) = -1. n steps of recurrence,
// each rounding.
TEST(RadialSeries, HostWavesHaveTheirWronskian) {
  for (double x : {1e-3, 0.1, 1.0, kPi, 10.0, 73.0, 700.0}) {
    const int orders = series_orders(x);
    const RiccatiBessel<double> f = riccati_bessel(x, orders);
    for (std::size_t n = 1; n <= static_cast<std::size_t>(orders); ++n) {
      const double turn = static_cast<double>(n) / x;
      const double psi_slope = f.psi[n - 1] - turn * f.psi[n], eta_slope = f.eta[n - 1] - turn * f.eta[n];
      // Both products grow as 2n / x below the surface of the barrier; rounding is relative to them.
      EXPECT_NEAR(f.psi[n] * eta_slope - psi_slope * f.eta[n], 1, 1e-15 * (50 + static_cast<double>(n)) * (1 + turn))
          << x << ' ' << n;
    }
  }
}

// One solution carried on and computed anew; steps of 4 rad lose less than 1e-14 each and there are up to 150 of them.
TEST(RadialSeries, CarriedSolutionIsTheSolutionFurtherOut) {
  for (double nu : {0.7, 4.3, 50.2, 300.9})
    for (double from : {0.5, 7.0, 100.0})
      for (double ratio : {1.0, 1.0001, 1.3, 6.0}) {
        const double lambda = nu * (nu + 1), to = from * ratio;
        const RadialPair<double> carry = carried(regular_pair(nu, from), lambda, from, to), anew = regular_pair(nu, to);
        EXPECT_NEAR((carry.u * anew.slope - carry.slope * anew.u) / std::hypot(carry.u, carry.slope) /
                        std::hypot(anew.u, anew.slope),
                    0, 2e-12)
            << nu << ' ' << from << ' ' << ratio;
      }
}

// ---- the coefficients ----------------------------------------------------------------------------------------------

// Without absorption each partial wave comes out with the modulus it went in with: rounding only.
TEST(RadialSeries, EveryWaveKeepsItsFlux) {
  for (const Ball& ball : kBalls) {
    const RadialSeries<double> series = radial_series(ball);
    for (std::size_t i = 0; i < series.a.size(); ++i) {
      EXPECT_NEAR(std::abs(1.0 - 2.0 * number(series.a[i])), 1, 1e-13);
      EXPECT_NEAR(std::abs(1.0 - 2.0 * number(series.b[i])), 1, 1e-13);
    }
    // Nothing is cut off: the last waves pass untouched. More orders start Miller's recurrence elsewhere: rounding of x
    // steps.
    EXPECT_LT(std::abs(number(series.a.back())) + std::abs(number(series.b.back())), 1e-16);
    EXPECT_LT(largest_difference(series, radial_series(ball, series.orders() + 5)), 1e-14);
  }
}

/// Riccati-Bessel psi, chi = -eta and slopes of real order by Boost in long double.
struct Riccati {
  long double psi, chi, psi_slope, chi_slope;
  Riccati(long double nu, long double z) {
    const long double f = std::sqrt(std::numbers::pi_v<long double> * z / 2);
    psi = f * boost::math::cyl_bessel_j(nu + 0.5L, z);
    chi = -f * boost::math::cyl_neumann(nu + 0.5L, z);
    psi_slope = f * boost::math::cyl_bessel_j(nu - 0.5L, z) - nu / z * psi;
    chi_slope = -f * boost::math::cyl_neumann(nu - 0.5L, z) - nu / z * chi;
  }
};

/// a_n and b_n of a ball with one shell, Bohren & Huffman (8.2), with the TM order of each radial medium: the field in
/// the shell is psi - A chi. A plain ball has an inner radius of zero (A = 0).
std::array<Cplx, 2> textbook(const Ball& ball, int n) {
  using Real = long double;
  const RadialLayer<double>& outer = ball.layers.back();
  const Real y = Real(ball.k0) * ball.n_host * outer.radius_um, m2 = Real(outer.n_o) / ball.n_host;
  const auto order = [n](const RadialLayer<double>& layer, bool tm) {
    const Real ratio = tm ? Real(layer.n_o) / layer.n_e : 1;
    return std::sqrt(0.25L + n * (n + 1.0L) * ratio * ratio) - 0.5L;
  };
  std::array<Cplx, 2> result;
  for (const bool tm : {true, false}) {
    Real mix = 0;
    if (ball.layers.size() == 2) {
      const RadialLayer<double>& inner = ball.layers.front();
      const Real x = Real(ball.k0) * ball.n_host * inner.radius_um, m1 = Real(inner.n_o) / ball.n_host;
      const Riccati core(order(inner, tm), m1 * x), shell(order(outer, tm), m2 * x);
      const Real f = tm ? m2 : m1, g = tm ? m1 : m2;
      mix = (f * shell.psi * core.psi_slope - g * shell.psi_slope * core.psi) /
            (f * shell.chi * core.psi_slope - g * shell.chi_slope * core.psi);
    }
    const Riccati in(order(outer, tm), m2 * y), out(n, y);
    const Real u = in.psi - mix * in.chi, v = in.psi_slope - mix * in.chi_slope;
    const Real f = tm ? 1 : m2, g = tm ? m2 : 1;
    const std::complex<Real> xi(out.psi, -out.chi), xi_slope(out.psi_slope, -out.chi_slope);
    const std::complex<Real> a = (f * out.psi * v - g * out.psi_slope * u) / (f * xi * v - g * xi_slope * u);
    result[tm ? 0 : 1] = Cplx(static_cast<double>(a.real()), static_cast<double>(a.imag()));
  }
  return result;
}

double difference_from_textbook(const Ball& ball) {
  const RadialSeries<double> series = radial_series(ball);
  double most = 0;
  for (int n = 1; n <= series.orders(); ++n) {
    const std::array<Cplx, 2> book = textbook(ball, n);
    const std::size_t i = static_cast<std::size_t>(n) - 1;
    most = std::max({most, std::abs(number(series.a[i]) - book[0]), std::abs(number(series.b[i]) - book[1])});
  }
  return most;
}

// Coefficients of modulus up to 1 behind some hundred steps of recurrence, each rounded: 1e-12.
TEST(RadialSeries, IsotropicBallIsMies) {
  for (double n : {1.33, 1.43001, 1.6, 2.2})
    for (double radius_um : {0.3, 1.0, 4.5})
      EXPECT_LT(difference_from_textbook({{{radius_um, n, n}}, 1.43, k0_of(0.59)}), 1e-12) << n << ' ' << radius_um;
  // Rayleigh's limit, Bohren & Huffman 5.4; the next term is x^2 = 1e-4 of it.
  const Ball dust{{{0.001, 1.6, 1.6}}, 1.0, k0_of(0.59)};
  const double x = dust.k0 * 0.001, m2 = 1.6 * 1.6;
  EXPECT_NEAR(radial_series(dust).a[0].im / (-2 * x * x * x / 3 * (m2 - 1) / (m2 + 2)), 1, 1e-3);
}

TEST(RadialSeries, RadialAxisAgreesWithBesselFunctionsOfRealOrder) {
  for (const Ball& ball : {kDroplet, kNegative, kSmall, kBig}) EXPECT_LT(difference_from_textbook(ball), 1e-12);
}

TEST(RadialSeries, ShellAgreesWithBesselFunctionsOfRealOrder) {
  const Ball coated{{{1.4, 1.33, 1.33}, {2.1, 1.59, 1.59}}, 1.0, k0_of(0.59)};  // isotropic, a bubble's wall
  EXPECT_LT(difference_from_textbook(coated), 1e-12);
  EXPECT_LT(difference_from_textbook(kShell), 1e-12);
  EXPECT_LT(difference_from_textbook(kBigShell), 1e-12);
  EXPECT_LT(difference_from_textbook({{{1.0, 1.52, 1.74}, {3.0, 1.6, 1.5}}, 1.45, k0_of(0.59)}), 1e-12);
}

TEST(RadialSeries, LayersThatDoNotDifferAreOne) {
  const RadialSeries<double> whole = radial_series(kDroplet);
  Ball parted = kDroplet;
  parted.layers = {{0.01, 1.52, 1.74}, {3.0, 1.52, 1.74}, {4.5, 1.52, 1.74}};
  EXPECT_LT(largest_difference(whole, radial_series(parted)), 1e-12);
  // A wall without thickness is the core, a wall of the host is nothing, and a core of no size is its shell: what a
  // dipole of size k r = 7e-4 scatters, (k r)^3 times the contrast, 1e-11, is left.
  const Ball core{{{1.4, 1.46, 1.46}}, 1.40, k0_of(0.59)};
  Ball wall = core;
  wall.layers.push_back({1.4, 1.52, 1.74});
  EXPECT_LT(largest_difference(radial_series(core), radial_series(wall)), 1e-14);
  wall.layers = {{4.5, 1.52, 1.74}, {5.0, 1.43, 1.43}};
  wall.n_host = 1.43;
  const RadialSeries<double> dressed = radial_series(wall);
  EXPECT_LT(largest_difference(whole, dressed), 1e-12);
  parted.layers = {{4.5e-5, 1.46, 1.46}, {4.5, 1.52, 1.52}};
  EXPECT_LT(largest_difference(radial_series(parted), radial_series(Ball{{{4.5, 1.52, 1.52}}, 1.43, k0_of(0.59)})),
            5e-11);
}

// ---- flux ----------------------------------------------------------------------------------------------------------

// Scattered flux by integrating the far field over all directions. S1, S2 are polynomials of degree `orders` in cos, so
// the rule is exact; rounding of sums of 1e3 terms that reach x^2.
TEST(RadialSeries, ExtinctionIsScattering) {
  for (const Ball& ball : {kDroplet, kNegative, kShell, kOnion, kBig, kBigShell}) {
    const RadialSeries<double> series = radial_series(ball);
    std::vector<double> c, w;
    legendre_nodes(series.orders() + 2, c, w);
    double flux = 0;
    for (std::size_t i = 0; i < c.size(); ++i) {
      const ScatteringAmplitudes<double> f = scattering_amplitudes(series, c[i]);
      flux += w[i] * (norm(f.s1) + norm(f.s2));
    }
    const double x = series.k0 * series.n_host * series.radius_um;
    EXPECT_NEAR(flux / (x * x) / scattering_efficiency(series), 1, 1e-10);
    EXPECT_NEAR(extinction_efficiency(series) / scattering_efficiency(series), 1, 1e-12);
    // The optical theorem, Bohren & Huffman 4.76.
    EXPECT_NEAR(4 * scattering_amplitudes(series, 1.0).s1.re / (x * x) / extinction_efficiency(series), 1, 1e-12);
  }
  // A big ball takes away twice its shadow; the edge adds 2 x^(-2/3) = 0.034 here, and the light straight through the
  // middle interferes with it by 4 / (phase delay) = 0.07 in each of two modes.
  EXPECT_NEAR(extinction_efficiency(radial_series(kBig)), 2, 0.034 + 2 * 0.07 + 0.03);
}

// ---- the image -----------------------------------------------------------------------------------------------------

// The table was printed with eleven digits.
TEST(RadialSeries, ImagesAgreeWithTheTable) {
  const ReferenceTable table(data_path("wave/radial_exact.csv"));
  const std::vector<std::string> keys{"R_um", "no", "ne", "n_host", "wavelength_um", "NA", "defocus_um"};
  std::vector<double> last;
  std::optional<RadialImage<double>> image;
  for (std::size_t row = 0; row < table.size(); ++row) {
    std::vector<double> now;
    for (const std::string& key : keys) now.push_back(table.number(row, key));
    if (now != last) {
      const Ball ball{{{now[0], now[1], now[2]}}, now[3], k0_of(now[4])};
      image.emplace(radial_series(ball), now[5], now[6], 20.0);
      last = now;
    }
    const Complex<double> a2 = (*image)(table.number(row, "rho_um")).a2;
    EXPECT_NEAR(a2.re, table.number(row, "A2_re"), 1e-10) << row;
    EXPECT_NEAR(a2.im, table.number(row, "A2_im"), 1e-10) << row;
  }
}

// Twice the nodes change nothing: the rule's length is long enough wherever the arguments are large.
TEST(RadialSeries, QuadratureIsLongEnough) {
  for (const Ball& ball : kBalls)
    for (double na : {0.1, 0.8, 1.39, 1.6})
      for (double defocus_um : {0.0, -40.0}) {
        const RadialSeries<double> series = radial_series(ball);
        const RadialImage<double> image(series, na, defocus_um, 50),
            longer(series, na, defocus_um, 50, Pupil::focal_plane, 2 * image.nodes());
        for (double rho_um : {0.0, 0.7, 12.0, 50.0}) {
          const RadialAmplitudes<double> f = image(rho_um), g = longer(rho_um);
          // Rounding: the integrand reaches x^2 / 2 (1e5 for the biggest), most of it in a narrow peak of width 1 / x.
          EXPECT_LT(std::abs(number(f.a0 - g.a0)) + std::abs(number(f.a2 - g.a2)), 2e-11)
              << series.radius_um << ' ' << na << ' ' << defocus_um << ' ' << rho_um;
        }
      }
}

/// The image at one place from the angular spectrum: a rule over the disc of accepted directions, in sin theta = NA/n
/// sin t so that the end is smooth even at 90 degrees; the azimuth's trapezoids are exact once they outnumber the waves
/// around the rim.
std::array<Cplx, 2> image_of_spectrum(const RadialSeries<double>& series, double na, double defocus_um, double x,
                                      double y, Pupil pupil) {
  const int azimuths = 160;
  std::vector<double> t, w;
  legendre_nodes(80, t, w);
  std::array<Cplx, 2> field{};
  for (std::size_t i = 0; i < t.size(); ++i) {
    const double angle = kPi / 4 * (1 + t[i]), kappa = na * std::sin(angle);
    const double weight =
        kPi / 4 * w[i] * na * na * std::sin(angle) * std::cos(angle) * series.k0 * series.k0 / azimuths / (2 * kPi);
    for (int j = 0; j < azimuths; ++j) {
      const double phi = 2 * kPi * (j + 0.3) / azimuths, kx = kappa * std::cos(phi), ky = kappa * std::sin(phi);
      const Mat2<double> f = scattered_spectrum(series, {0, 0}, {kx, ky}, defocus_um, pupil);
      const Cplx wave = std::polar(weight, series.k0 * (kx * x + ky * y));
      field[0] += wave * number(f.a);
      field[1] += wave * number(f.c);
    }
  }
  return field;
}

// Two ways to one field, sharing the coefficients only. Rounding of 1e4 terms.
TEST(RadialSeries, ImageIsTheSumOfItsSpectrum) {
  for (const Ball& ball : {kNegative, kShell})
    for (const Pupil pupil : {Pupil::focal_plane, Pupil::unrolled, Pupil::aplanatic}) {
      const RadialSeries<double> series = radial_series(ball);
      const double na = 0.8, defocus_um = 1.3;
      const RadialImage<double> image(series, na, defocus_um, 4.0, pupil);
      for (const auto& [rho_um, phi] :
           {std::pair(0.0, 0.0), std::pair(0.9, 0.4), std::pair(2.2, 2.0), std::pair(4.0, -1.0)}) {
        const RadialAmplitudes<double> f = image(rho_um);
        const std::array<Cplx, 2> sum =
            image_of_spectrum(series, na, defocus_um, rho_um * std::cos(phi), rho_um * std::sin(phi), pupil);
        EXPECT_LT(std::abs(number(f.a0) + std::cos(2 * phi) * number(f.a2) - sum[0]), 1e-12) << rho_um;
        EXPECT_LT(std::abs(std::sin(2 * phi) * number(f.a2) - sum[1]), 1e-12) << rho_um;
      }
    }
}

// ---- the spectrum for tilted light ---------------------------------------------------------------------------------

/// Born's approximation of the scattered spectrum (first order in the contrasts): polarization (eps - eps_host) E_in in
/// every point,
///   F e = i k0^2 / (2 k cos) exp(i ..) [transverse part of] integral (eps - eps_host) e exp(i (k_in - k_out) . r)
///   d^3r,
/// with the integrals over a sphere of exp = 4 pi j0 and of r r exp = 4 pi (j1 / x - q q j2), left to a rule in r.
Mat2<double> born_spectrum(const Ball& ball, const std::array<double, 2>& kappa_in,
                           const std::array<double, 2>& kappa_out, double defocus_um) {
  const double n = ball.n_host, k = ball.k0 * n;
  const auto direction = [n](const std::array<double, 2>& kappa) {
    const double x = kappa[0] / n, y = kappa[1] / n;
    return Vec3<double>{x, y, std::sqrt(1 - x * x - y * y)};
  };
  const Vec3<double> in = direction(kappa_in), out = direction(kappa_out), q = k * (in + -1.0 * out);
  const double length = std::sqrt(dot(q, q));
  double isotropic = 0, along_q = 0, from_um = 0;
  std::vector<double> t, w;
  legendre_nodes(60, t, w);
  for (const RadialLayer<double>& layer : ball.layers) {
    const double across = layer.n_o * layer.n_o - n * n, along = layer.n_e * layer.n_e - layer.n_o * layer.n_o;
    for (std::size_t i = 0; i < t.size(); ++i) {
      const double half = 0.5 * (layer.radius_um - from_um), r = from_um + half * (1 + t[i]), x = length * r;
      const double weight = 4 * kPi * half * w[i] * r * r;
      isotropic += weight * (across * std::sph_bessel(0, x) + along * std::sph_bessel(1, x) / x);
      along_q -= weight * along * std::sph_bessel(2, x) / (length * length);
    }
    from_um = layer.radius_um;
  }
  std::array<Complex<double>, 4> entry;
  const Complex<double> wave = exp(Complex<double>(0.0, k * (out.z - in.z) * defocus_um));
  for (std::size_t column = 0; column < 2; ++column) {
    Vec3<double> e{column == 0 ? 1.0 : 0.0, column == 0 ? 0.0 : 1.0, 0.0};
    e.z = -dot(e, in) / in.z;
    Vec3<double> source = isotropic * e + (along_q * dot(q, e)) * q;
    source = source + -dot(source, out) * out;
    const Complex<double> f = Complex<double>(0.0, ball.k0 * ball.k0 / (2 * k * out.z)) * wave;
    entry[column] = source.x * f;
    entry[2 + column] = source.y * f;
  }
  return {entry[0], entry[1], entry[2], entry[3]};
}

double size_of(const Mat2<double>& m) { return std::sqrt(norm(m.a) + norm(m.b) + norm(m.c) + norm(m.d)); }

// The error of the first order, relative, is of the first order in the contrast: it falls with it by the same factor.
// This holds the coefficients, all phases and signs, the polarizations at any tilt and the focus to an independent
// formula.
TEST(RadialSeries, WeakContrastIsBorns) {
  const std::array<std::array<double, 2>, 4> out{{{0.3, -0.5}, {-0.2, 0.1}, {0.0, 1.1}, {0.41, 0.2}}};
  for (const std::array<double, 2>& in :
       {std::array<double, 2>{0, 0}, std::array<double, 2>{0.4, 0.2}, std::array<double, 2>{-0.9, 0.6}})
    for (const auto& kappa : out) {
      std::array<double, 2> error{};
      for (int i = 0; i < 2; ++i) {
        const double weak = i == 0 ? 1e-4 : 1e-5;
        const Ball ball{{{0.6, 1.5 - 0.7 * weak, 1.5 + 2 * weak}, {1.2, 1.5 + weak, 1.5 - weak}}, 1.5, k0_of(0.59)};
        const Mat2<double> exact = scattered_spectrum(radial_series(ball), in, kappa, 0.8),
                           born = born_spectrum(ball, in, kappa, 0.8);
        error[static_cast<std::size_t>(i)] = size_of(exact - born) / size_of(born);
      }
      // First order: about k0 R times the contrast. The quotient is 10 up to the next order and, at 1e-5, to the
      // rounding of coefficients that are themselves 1e-4.
      EXPECT_LT(error[0], 5e-2);
      EXPECT_NEAR(error[0] / error[1], 10, 0.5) << in[0] << ' ' << kappa[0];
    }
}

// Reciprocity: exchanging source and receiver transposes the flux-normalised spectrum, directions reversed. Here also
// the mirror z -> -z of the ball is used, which turns the reversed pair into a forward one (the focus is then on the
// other side: kept at 0).
TEST(RadialSeries, SpectrumIsReciprocal) {
  const RadialSeries<double> series = radial_series(kDroplet);
  const std::array<double, 2> one{0.5, -0.3}, two{-0.2, 0.7};
  const auto cosine = [](const std::array<double, 2>& kappa) {
    return std::sqrt(1 - (kappa[0] * kappa[0] + kappa[1] * kappa[1]) / (1.43 * 1.43));
  };
  const Mat2<double> there = scattered_spectrum(series, one, two, 0, Pupil::unrolled);
  const Mat2<double> back = scattered_spectrum(series, {-two[0], -two[1]}, {-one[0], -one[1]}, 0, Pupil::unrolled);
  // Exact but for rounding; the spectrum is in um^2, of order 1 to 10.
  const double f = cosine(two), g = cosine(one), tolerance = 1e-13 * (1 + size_of(there) * f);
  EXPECT_LT(
      size_of({f * there.a - g * back.a, f * there.b - g * back.c, f * there.c - g * back.b, f * there.d - g * back.d}),
      tolerance);
}

// ---- derivatives ---------------------------------------------------------------------------------------------------

/// Everything that may vary, for a shell around a core: n_o, n_e, n_host, wavelength, both radii, defocus, rho, n_core.
using Inputs = std::array<double, 9>;
template <class S>
std::array<S, 6> outputs(const std::array<S, 9>& v, bool shell) {
  RadialBall<S> ball;
  if (shell) ball.layers.push_back({v[4], v[8], v[8]});
  ball.layers.push_back({v[5], v[0], v[1]});
  ball.n_host = v[2];
  ball.k0 = 2 * kPi * inverse(v[3]);
  const RadialSeries<S> series = radial_series(ball, 90);
  const RadialAmplitudes<S> f = RadialImage<S>(series, 0.7, v[6], 4.0)(v[7]);
  return {f.a0.re, f.a0.im, f.a2.re, f.a2.im, extinction_efficiency(series), scattering_efficiency(series)};
}

// Richardson's extrapolation of central differences: the error left is of the order (h p / 4)^6 of the slope for phases
// of p = 50 rad per unit of the input, below 1e-9, and rounding / h = 1e-13 / 1e-4.
TEST(RadialSeries, DerivativesAreDifferences) {
  const Inputs at{1.52, 1.70, 1.45, 0.59, 1.1, 2.3, 0.9, 1.3, 1.47};
  for (const bool shell : {false, true})
    for (std::size_t input = 0; input < at.size(); ++input) {
      std::array<Dual<double, 1>, 9> v;
      for (std::size_t i = 0; i < at.size(); ++i) v[i] = at[i];
      v[input].d[0] = 1;
      const std::array<Dual<double, 1>, 6> dual = outputs(v, shell);
      const auto central = [&](double h) {
        Inputs up = at, down = at;
        up[input] += h;
        down[input] -= h;
        const std::array<double, 6> f = outputs(up, shell), g = outputs(down, shell);
        std::array<double, 6> slope{};
        for (std::size_t i = 0; i < slope.size(); ++i) slope[i] = (f[i] - g[i]) / (2 * h);
        return slope;
      };
      const double h = 4e-4;
      const std::array<double, 6> d1 = central(h), d2 = central(h / 2), d4 = central(h / 4);
      double size = 1;
      for (const double d : d4) size = std::max(size, std::abs(d));
      for (std::size_t i = 0; i < dual.size(); ++i) {
        const double first = (4 * d2[i] - d1[i]) / 3, second = (4 * d4[i] - d2[i]) / 3,
                     limit = (16 * second - first) / 15;
        EXPECT_NEAR(dual[i].d[0], limit, 1e-8 * size)
            << "input " << input << " output " << i << (shell ? " shell" : " ball");
      }
      EXPECT_NEAR(dual[2].value, outputs(at, shell)[2], 1e-13);
    }
}

// Derivatives come through where the number itself is a limit: no thickness yet, no birefringence yet, middle of the
// image.
TEST(RadialSeries, DerivativesSurviveDegenerateInputs) {
  using D = Dual<double, 2>;
  D thickness(0.0), birefringence(0.0);
  thickness.d[0] = birefringence.d[1] = 1;
  const auto field = [](auto thickness_um, auto birefringence, double rho_um) {
    using S = decltype(thickness_um);
    RadialBall<S> ball{
        {{S(1.4), S(1.5), 1.5 + birefringence}, {1.4 + thickness_um, S(1.6), S(1.6)}}, S(1.45), S(k0_of(0.59))};
    return RadialImage<S>(radial_series(ball, 60), 0.8, S(0.3), 3.0)(S(rho_um));
  };
  for (const double rho_um : {0.0, 1.0}) {
    const RadialAmplitudes<D> f = field(thickness, birefringence, rho_um);
    // One-sided in the thickness (second order), central in the birefringence: errors h^2 x (third derivatives of about
    // 1e3).
    const double h = 1e-5, e = 1e-5;
    const RadialAmplitudes<double> f0 = field(0.0, 0.0, rho_um), f1 = field(h, 0.0, rho_um),
                                   f2 = field(2 * h, 0.0, rho_um);
    const RadialAmplitudes<double> up = field(0.0, e, rho_um), down = field(0.0, -e, rho_um);
    EXPECT_NEAR(f.a0.re.d[0], (4 * f1.a0.re - f2.a0.re - 3 * f0.a0.re) / (2 * h), 1e-6);
    EXPECT_NEAR(f.a2.im.d[0], (4 * f1.a2.im - f2.a2.im - 3 * f0.a2.im) / (2 * h), 1e-6);
    EXPECT_NEAR(f.a0.im.d[1], (up.a0.im - down.a0.im) / (2 * e), 1e-6);
    EXPECT_NEAR(f.a2.re.d[1], (up.a2.re - down.a2.re) / (2 * e), 1e-6);
  }
}

// ---- a big ball ----------------------------------------------------------------------------------------------------

// 60 um across, sizes up to 556: everything finite, and the scattered field in the picture carries no more flux than
// was scattered.
TEST(RadialSeries, BigBallsAreFinite) {
  for (const Ball& ball : {kBig, kBigShell}) {
    const RadialSeries<double> series = radial_series(ball);
    const double na = 0.8, reach_um = 60;
    const RadialImage<double> image(series, na, 0.0, reach_um);
    double flux = 0;
    const double step_um = 0.02;
    for (double rho_um = 0.5 * step_um; rho_um < reach_um; rho_um += step_um) {
      const RadialAmplitudes<double> f = image(rho_um);
      ASSERT_TRUE(std::isfinite(norm(f.a0)) && std::isfinite(norm(f.a2)));
      flux += 2 * kPi * rho_um * step_um * (norm(f.a0) + norm(f.a2));
    }
    const double scattered = scattering_efficiency(series) * kPi * 900;
    EXPECT_LT(flux, scattered);
    EXPECT_GT(flux, 0.5 * scattered) << "most of a ball's light goes forward, the shadow alone is half";
  }
}

}  // namespace
}  // namespace birefit
