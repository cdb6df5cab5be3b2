// Makes the image of data/wave_droplet: run from the repository's root,
//   g++ -std=c++20 -O2 -Itests/support tools/make_data/wave_droplet.cc -o make_wave && ./make_wave
//   oiiotool --nosoftwareattrib wave_droplet.pgm -o wave_droplet.png
// A ball whose optic axis is radial, as Maxwell's equations show it: Mie's series with TM waves of order nu inside,
// nu (nu + 1) = n (n + 1) n_o^2/n_e^2 (Roth & Dignam, J. Opt. Soc. Am. 63, 308 (1973); Bohren & Huffman, chapter 4),
// then the objective's aperture. Bessel functions are the standard library's.

#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "independent_droplet.h"  // camera()
#include "pgm.h"

namespace {

constexpr double kPi = std::numbers::pi;
using Cplx = std::complex<double>;

struct Radial {
  double psi, chi, psi_slope, chi_slope;  ///< z j(z), -z y(z) and their derivatives
};
Radial radial(double order, double z) {
  const auto j = [z](double m) { return std::sqrt(kPi * z / 2) * std::cyl_bessel_j(m + 0.5, z); };
  const auto y = [z](double m) { return std::sqrt(kPi * z / 2) * std::cyl_neumann(m + 0.5, z); };
  const double psi = j(order), chi = -y(order);
  return {psi, chi, (order + 1) / z * psi - j(order + 1), (order + 1) / z * chi + y(order + 1)};
}

struct RadialDrop {
  double radius_um = 4.6, ordinary = 1.52, extraordinary = 1.705, host = 1.47, wavelength_um = 0.546, aperture = 0.75;
  std::vector<Cplx> a{}, b{};

  void solve() {
    const double k = 2 * kPi * host / wavelength_um, x = k * radius_um, m = ordinary / host, inside = m * x;
    for (int n = 1; n < x + 4.05 * std::cbrt(x) + 10; ++n) {
      const double ratio = ordinary / extraordinary, nu = std::sqrt(0.25 + n * (n + 1.0) * ratio * ratio) - 0.5;
      const Radial out = radial(n, x), tm = radial(nu, inside), te = radial(n, inside);
      const Cplx xi(out.psi, -out.chi), xi_slope(out.psi_slope, -out.chi_slope);
      a.push_back((m * tm.psi * out.psi_slope - out.psi * tm.psi_slope) / (m * tm.psi * xi_slope - xi * tm.psi_slope));
      b.push_back((te.psi * out.psi_slope - m * out.psi * te.psi_slope) / (te.psi * xi_slope - m * xi * te.psi_slope));
    }
  }
  /// The field between crossed polarizers at this distance from the middle, focused on the mid plane, is this times sin
  /// 2 (azimuth - polarizer).
  Cplx crossed(double rho_um) const {
    const double k = 2 * kPi * host / wavelength_um, most = k * aperture / host;
    constexpr int kPoints = 1500;
    Cplx sum = 0;
    for (int i = 0; i < kPoints; ++i) {
      const double q = (i + 0.5) * most / kPoints, cosine = std::sqrt(1 - q * q / (k * k));
      Cplx s1 = 0, s2 = 0;
      double before = 0, pi = 1;
      for (std::size_t j = 0; j < a.size(); ++j) {
        const double n = static_cast<double>(j + 1), tau = n * cosine * pi - (n + 1) * before,
                     weight = (2 * n + 1) / (n * (n + 1));
        s1 += weight * (a[j] * pi + b[j] * tau);
        s2 += weight * (a[j] * tau + b[j] * pi);
        const double next = ((2 * n + 1) * cosine * pi - (n + 1) * before) / n;
        before = pi, pi = next;
      }
      sum += (s2 * cosine - s1) / (2 * k * k * cosine) * std::cyl_bessel_j(2.0, q * rho_um) * q;
    }
    return sum * (most / kPoints);
  }
};

}  // namespace

#ifndef BIREFIT_ONLY_FORMULAS
int main() {
  constexpr int kSize = 128, kFine = 8;
  constexpr double kPixel = 0.085, kCentreX = 63.1, kCentreY = 64.6, kStep = 0.002, kPolarizer = 30 * kPi / 180;
  RadialDrop drop;
  drop.solve();
  std::vector<double> brightness;
  for (double rho = 0; rho < kPixel * kSize; rho += kStep) brightness.push_back(std::norm(drop.crossed(rho)));
  std::vector<double> mean;
  for (int row = 0; row < kSize; ++row)
    for (int column = 0; column < kSize; ++column) {
      double sum = 0;
      for (int i = 0; i < kFine; ++i)
        for (int j = 0; j < kFine; ++j) {
          const double x = (column + (i + 0.5) / kFine - 0.5 - kCentreX) * kPixel,
                       y = (kCentreY - row - (j + 0.5) / kFine + 0.5) * kPixel;
          const double at = std::hypot(x, y) / kStep, turn = std::sin(2 * (std::atan2(y, x) - kPolarizer));
          const auto cell = static_cast<std::size_t>(at);
          sum += std::lerp(brightness[cell], brightness[cell + 1], at - static_cast<double>(cell)) * turn * turn;
        }
      mean.push_back(100 + 3000 * sum / (kFine * kFine));
    }
  write_pgm("wave_droplet.pgm", kSize, kSize, birefit::testing::camera(mean, 0.5, 4.0, 5150));
}
#endif
