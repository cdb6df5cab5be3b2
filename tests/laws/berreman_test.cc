// Laws of the 4 x 4 transport with all reflections.

#include <gtest/gtest.h>

#include <cmath>
#include <complex>

#include "profiles.h"
#include "transport/methods.h"

namespace birefit {
namespace {
using namespace testing;

const TiltTwistLaw kMedium{10 * kDeg, 50 * kDeg, 20 * kDeg, 35 * kDeg, 80 * kDeg, 1.52, 1.74, 6};
Ray<double> ray_of(double kx, double ky) { return {2 * std::numbers::pi / 0.59, kx, ky, Continuity::e_and_h}; }

/// Flux S_z = Re(E x H*)_z of waves in an isotropic host with H = +-Y E.
double flux(const Matrix2<double>& y, const Complex<double>& ex, const Complex<double>& ey) {
  const Complex<double> hx = y.a * ex + y.b * ey, hy = y.c * ex + y.d * ey;
  return (ex * conj(hy)).re - (ey * conj(hx)).re;
}

// What is not transmitted is reflected, polarisation by polarisation: 64 joined slices of rounding.
TEST(Berreman, FluxIsConservedWithoutAbsorption) {
  const LawColumn<double, TiltTwistLaw> column(kMedium);
  for (const auto& [kx, ky] : {std::pair{0.0, 0.0}, {0.35, -0.2}, {0.8, 0.3}}) {
    const Ray<double> ray = ray_of(kx, ky);
    const double n = 1.0;
    const Mesh mesh = uniform_mesh(64);
    const Mat2<double> t = Berreman<double>().transmission(column, ray, mesh, n),
                       r = Berreman<double>().reflection(column, ray, mesh, n);
    const Matrix2<double> y = isotropic_admittance<double>(n * n, std::sqrt(n * n - kx * kx - ky * ky), kx, ky);
    for (const auto& [ex, ey] :
         {std::pair<Complex<double>, Complex<double>>{{1, 0}, {0, 0}}, {{0, 0}, {1, 0}}, {{0.6, 0}, {0, 0.8}}}) {
      const double in = flux(y, ex, ey), out = flux(y, t.a * ex + t.b * ey, t.c * ex + t.d * ey),
                   back = flux(y, r.a * ex + r.b * ey, r.c * ex + r.d * ey);
      EXPECT_NEAR((out + back) / in, 1, 1e-12);
      EXPECT_GT(back / in, 1e-3);  // there is something to conserve
    }
  }
}

// A glass plate in air: t = (1 - r^2) e^{i d} / (1 - r^2 e^{2 i d}) at normal incidence (Airy), whatever its thickness.
TEST(Berreman, APlateIsAirys) {
  for (const double thickness : {0.1, 7.3, 1000.0}) {
    const LawColumn<double, TiltTwistLaw> column(TiltTwistLaw{0, 0, 0, 0, 0, 1.5, 1.5, thickness});
    const Mat2<double> t = Berreman<double>().transmission(column, ray_of(0, 0), uniform_mesh(4), 1.0);
    const double d = 2 * std::numbers::pi / 0.59 * 1.5 * thickness, r = 0.2;
    const std::complex<double> airy = (1 - r * r) * std::polar(1.0, d) / (1.0 - r * r * std::polar(1.0, 2 * d));
    EXPECT_NEAR(t.a.re, airy.real(), 1e-12 * (1 + d));
    EXPECT_NEAR(t.a.im, airy.imag(), 1e-12 * (1 + d));
    EXPECT_NEAR(norm(t.b) + norm(t.c), 0, 1e-24);
  }
}

/// A law made absorbing.
struct Absorbing {
  TiltTwistLaw law;
  double k;
  template <class T>
  OpticalPoint<T> at(const T& u) const {
    OpticalPoint<T> p = law.at(u);
    p.ordinary_im = T(2 * 1.52 * k);
    p.extraordinary_im = T(2 * 1.74 * k);
    return p;
  }
};

// exp(-k0 k d) = e^-4000 is nothing, and nothing overflows on the way; what is reflected is the front face's.
TEST(Berreman, AThickAbsorberIsDarkAndFinite) {
  const LawColumn<double, Absorbing> column({TiltTwistLaw{0, 0, 0, 0, 0, 1.52, 1.74, 500}, 0.75});
  const Mat2<double> t = Berreman<double>().transmission(column, ray_of(0, 0), uniform_mesh(4), 1.0);
  for (const Complex<double>& z : {t.a, t.b, t.c, t.d}) EXPECT_LT(norm(z), 1e-200);
  const Mat2<double> r = Berreman<double>().reflection(column, ray_of(0, 0), uniform_mesh(4), 1.0);
  const std::complex<double> eps(1.74 * 1.74, 2 * 1.74 * 0.75), n = std::sqrt(eps);  // the axis lies along x
  const std::complex<double> face = (1.0 - n) / (1.0 + n);
  EXPECT_NEAR(r.a.re, face.real(), 1e-12);
  EXPECT_NEAR(r.a.im, face.imag(), 1e-12);
}

TEST(Berreman, ConvergesAtFourthOrder) {
  const LawColumn<double, TiltTwistLaw> column(kMedium);
  const Ray<double> ray = ray_of(0.35, -0.2);
  const auto at = [&](int n) { return Berreman<double>().transmission(column, ray, uniform_mesh(n), 1.43); };
  const Mat2<double> exact = at(2048);
  EXPECT_NEAR(std::log2(distance(at(64), exact) / distance(at(128), exact)), 4, 0.25);
}

}  // namespace
}  // namespace birefit
