// One-way wave optics by split steps (wave/split_step.h) against closed forms, the exact series of a radial ball, the march of Maxwell's
// equations, two Maxwell solvers and another program's beam propagation, and its laws: order of convergence, flux, derivatives, threads.
// All figures are printed; errors of pictures are relative RMS, crossed polarizers at 45 degrees.

#include "wave/split_step.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <unsupported/Eigen/MatrixFunctions>

#include "independent_ball.h"
#include "independent_imaging.h"
#include "reference_table.h"
#include "transport/quadrature.h"
#include "wave/imaging.h"
#include "wave/march.h"
#include "wave/radial_series.h"
#include "wave/sphere.h"

namespace birefit {
namespace {
using namespace testing;
using Number = std::complex<double>;

constexpr double kPi = std::numbers::pi, kK0 = 2 * kPi / 0.59, kRoot = 0.70710678118654752;
template <int N>
using DualPack = Dual<Pack, N>;

// ---- the operator of transverse wavevectors ------------------------------------------------------------------------------

/// The same medium everywhere.
struct Uniform final : WaveMedium<Pack> {
  OpticalPoint<Pack> point;
  Uniform(const std::array<double, 3>& axis, double n_o, double n_e)
      : point{{Pack(axis[0]), Pack(axis[1]), Pack(axis[2])}, Pack(n_o * n_o), Pack(n_e * n_e), Pack(0.0), Pack(0.0), Pack(0.0)} {}
  OpticalPoint<Pack> at(const Pack&, const Pack&, double) const override { return point; }
  bool reaches(const Pack&, const Pack&, double) const override { return true; }
};

/// q of the code for light of wavevector kappa in a uniform medium, as the 2 x 2 matrix that acts on the flux-normalised field: what a slab
/// so thin that its parts commute adds to 1.
Eigen::Matrix2cd coded_operator(const Uniform& medium, const std::array<double, 2>& kappa, double n_host) {
  const double h = 1e-4;
  const double kx = kK0 * kappa[0], ky = kK0 * kappa[1];
  WaveGrid g;
  g.nx = g.ny = 2;
  g.step_um = 0.2;
  g.entry_um = 0, g.exit_um = h;
  g.slabs = 1, g.layers = 2;
  g.n_ref = n_host;
  g.cut_per_um = 1.05 * std::hypot(kx, ky) + 0.1;
  const double q = std::sqrt(n_host * n_host - kappa[0] * kappa[0] - kappa[1] * kappa[1]);
  Eigen::Matrix2cd in, out;
  for (int c = 0; c < 2; ++c) {
    const std::array<double, 2> e{c == 0 ? 1.0 : 0.0, c == 0 ? 0.0 : 1.0};
    const auto field = propagate(g, WaveLight<Pack>{Pack(kK0), Pack(n_host), Pack(e[0]), Pack(e[1]), kx, ky}, medium, 1)[0];
    // The incident wave's own flux form, as the header has it.
    const double k = std::hypot(kx, ky), px = k > 0 ? kx / k : 1, py = k > 0 ? ky / k : 0;
    const double p = std::sqrt(n_host / q) * (px * e[0] + py * e[1]), s = std::sqrt(q / n_host) * (px * e[1] - py * e[0]);
    in.col(c) << px * p - py * s, py * p + px * s;
    out.col(c) << in(0, c) + field.a[0][0], in(1, c) + field.a[1][0];
  }
  const Eigen::Matrix2cd step = out * in.inverse();
  // In units of the host's wave.
  return step.log() / Number(0, kK0 * h) + Eigen::Matrix2cd::Identity() * q;
}

/// The same from Maxwell's equations for plane waves: h = Y e of the two forward waves, flux e* (Y + Y*) e / 2 = a* a, so a = F e with F the root of the
/// Hermitian part, and F (their q) F^-1.
struct PlaneWaves {
  double q_o, q_e;
  Eigen::Matrix2cd operation;
};
PlaneWaves plane_waves(const std::array<double, 3>& n, double n_o, double n_e, const std::array<double, 2>& kappa) {
  const double o = n_o * n_o, d = n_e * n_e - o, k2 = kappa[0] * kappa[0] + kappa[1] * kappa[1], along = kappa[0] * n[0] + kappa[1] * n[1];
  // no^2 k^2 + (ne^2 - no^2)(k.n)^2 = no^2 ne^2.
  const double a = o + d * n[2] * n[2], b = d * n[2] * along, c = o * k2 + d * along * along - o * n_e * n_e;
  PlaneWaves w{std::sqrt(o - k2), (-b + std::sqrt(b * b - a * c)) / a, {}};
  const Eigen::Vector3d axis(n[0], n[1], n[2]);
  Eigen::Matrix2cd e, h, q = Eigen::Matrix2cd::Zero();
  const std::array<double, 2> qs{w.q_o, w.q_e};
  for (int i = 0; i < 2; ++i) {
    const double z = qs[static_cast<std::size_t>(i)];
    const Eigen::Vector3d k(kappa[0], kappa[1], z);
    // Ordinary: E across k and the axis; extraordinary: E in the plane of both, n_o^2 n - (k.n) k.
    const Eigen::Vector3d field = i == 0 ? k.cross(axis).eval() : (o * axis - k.dot(axis) * k).eval(), magnetic = k.cross(field);
    e.col(i) << field(0), field(1);
    h.col(i) << magnetic(1), -magnetic(0);
    q(i, i) = z;
  }
  const Eigen::Matrix2cd y = h * e.inverse(), flux = 0.5 * (y + y.adjoint()), root = flux.sqrt();
  w.operation = root * e * q * e.inverse() * root.inverse();
  return w;
}

// Both q, and the 2 x 2 matrix of which they are the eigenvalues: every coefficient of v, sd, sc and D shows in one of them.
TEST(SplitStep, TransverseWavevectorsActToTheSecondOrder) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> unit(-1, 1), index(1.45, 1.65), difference(0.05, 0.25);
  const std::array<double, 3> sizes{0.1, 0.2, 0.3};
  std::array<double, 3> worst{}, sum{}, matrix{};
  double flat = 0, loss = 0;
  const int trials = 400;
  for (int trial = 0; trial < trials; ++trial) {
    const double nz = unit(random), azimuth = kPi * unit(random), direction = kPi * unit(random), t = std::sqrt(1 - nz * nz);
    const std::array<double, 3> n{t * std::cos(azimuth), t * std::sin(azimuth), nz};
    const double n_o = index(random), n_e = n_o + (trial % 3 == 0 ? -0.6 : 1) * difference(random), n_host = index(random);
    const Uniform medium(n, n_o, n_e);
    flat = std::max(flat, (coded_operator(medium, {0, 0}, n_host) - plane_waves(n, n_o, n_e, {1e-10, 0}).operation).norm());
    for (std::size_t s = 0; s < 3; ++s) {
      const std::array<double, 2> kappa{sizes[s] * std::cos(direction), sizes[s] * std::sin(direction)};
      const Eigen::Matrix2cd coded = coded_operator(medium, kappa, n_host);
      const PlaneWaves exact = plane_waves(n, n_o, n_e, kappa);
      Eigen::Vector2d q = coded.eigenvalues().real();
      if ((q(0) < q(1)) != (exact.q_o < exact.q_e)) std::swap(q(0), q(1));
      const double error = std::max(std::abs(q(0) - exact.q_o), std::abs(q(1) - exact.q_e));
      worst[s] = std::max(worst[s], error);
      sum[s] += error;
      matrix[s] = std::max(matrix[s], (coded - exact.operation).norm());
      loss = std::max(loss, (coded - coded.adjoint()).norm());
    }
  }
  for (std::size_t s = 0; s < 3; ++s) fmt::print("kappa {}: q off by {:.1e}, at worst {:.1e}; matrix {:.1e}\n", sizes[s], sum[s] / trials, worst[s], matrix[s]);
  fmt::print("kappa 0: {:.1e}; not Hermitian: {:.1e}\n", flat, loss);
  // Rounding of 1e-16 and a few, over k0 h = 1e-3; the directions of the two waves are ill defined where n_e(direction) = n_o.
  EXPECT_LT(flat, 1e-8);
  EXPECT_LT(loss, 1e-9);
  for (std::size_t s = 0; s < 3; ++s) {
    const double third = sizes[s] * sizes[s] * sizes[s];
    // Third order with the coefficients seen (0.004, 0.013, 0.020) and half as much again. A coefficient of the second order wrong by 0.01
    // costs 1e-4 at kappa 0.1, ten times the bound.
    EXPECT_LT(sum[s] / trials, 0.006 * third);
    EXPECT_LT(worst[s], 0.02 * third);
    EXPECT_LT(matrix[s], 0.03 * third);
  }
}

// ---- pictures ------------------------------------------------------------------------------------------------------------

struct Ball {
  double radius_um, n_host, n_o = 1.52, n_e = 1.74, core_um = 0;  // a core of the host's index
};

template <class S = Pack>
SphereOptics<S> optics(const Ball& b) {
  SphereOptics<S> o;
  o.radius_um = S(b.radius_um), o.n_o = S(b.n_o), o.n_e = S(b.n_e), o.n_host = S(b.n_host);
  o.field = RadialField<S>{false, S(0.0)};
  if (b.core_um > 0) o.has_core = true, o.core_um = S(b.core_um), o.core_index = S(b.n_host);
  return o;
}
/// Production's.
WaveGrid grid_of(const Ball& b, double na) { return sphere_grid(optics<double>(b), kK0, na); }
/// Polarizer at 45 degrees, or the azimuth given.
WaveLight<Pack> light(double n_host, double polarizer = kPi / 4) { return {Pack(kK0), Pack(n_host), Pack(std::cos(polarizer)), Pack(std::sin(polarizer))}; }

/// Pixels of 0.1 um, analyser crossed, out to `half` from the centre.
constexpr double kPixel = 0.1;
int pixels(double half_um) { return 2 * static_cast<int>(std::ceil(half_um / kPixel)); }
Image picture(const WaveGrid& g, const std::vector<WaveField>& field, const WaveLight<Pack>& l, double na, double focus_um, double half_um, bool aplanatic) {
  const int n = pixels(half_um);
  WaveMicroscope<Pack> m;
  m.objective_na = na, m.aplanatic = aplanatic, m.focus_um = Pack(focus_um);
  m.ax = Pack(0.0) - l.ey, m.ay = l.ex;
  m.center_x_px = m.center_y_px = Pack(0.5 * (n - 1));
  m.pixel_um = kPixel, m.width = m.height = n;
  Image image;
  form_image(g, plan_imaging(g, kK0, na, half_um + kPixel, half_um + kPixel), l, m, field, 1, {&image});
  return image;
}
/// The same of the exact series: four points of each pixel, good to 1e-4 of the finest wave that an objective of 0.8 passes.
Image exact_picture(const Ball& b, double na, double focus_um, double half_um, bool aplanatic) {
  RadialBall<double> ball{{}, b.n_host, kK0};
  if (b.core_um > 0) ball.layers.push_back({b.core_um, b.n_host, b.n_host});
  ball.layers.push_back({b.radius_um, b.n_o, b.n_e});
  const double step = 0.01, reach = 1.5 * half_um;
  const RadialImage<double> field(radial_series(ball), na, focus_um, reach, aplanatic ? Pupil::aplanatic : Pupil::focal_plane);
  std::vector<double> table;
  for (double rho = 0; rho < reach; rho += step) table.push_back(norm(field(rho).a2));
  std::vector<double> node, weight;
  legendre_nodes(2, node, weight);
  const int n = pixels(half_um);
  Image image(n, n, 0.0);
  for (int row = 0; row < n; ++row)
    for (int column = 0; column < n; ++column)
      for (const double u : node)
        for (const double v : node) {
          const double x = (column - 0.5 * (n - 1) + 0.5 * u) * kPixel, y = (0.5 * (n - 1) - row + 0.5 * v) * kPixel, at = std::hypot(x, y) / step;
          const std::size_t i = static_cast<std::size_t>(at);
          const double f = at - static_cast<double>(i), cos_2phi = (x * x - y * y) / (x * x + y * y);
          image(column, row) += 0.25 * ((1 - f) * table.at(i) + f * table.at(i + 1)) * cos_2phi * cos_2phi;
        }
  return image;
}

/// Errors against the series, production's grid for each aperture.
double series_error(const Ball& b, double na, double focus_um = 0, bool aplanatic = false) {
  const WaveGrid g = grid_of(b, na);
  const WaveLight<Pack> l = light(b.n_host);
  const double half = b.radius_um + 3;
  const Image image = picture(g, propagate(g, l, SphereMedium<Pack>(optics(b), g.step_um), 1), l, na, focus_um, half, aplanatic);
  const double error = relative_rms(image.values(), exact_picture(b, na, focus_um, half, aplanatic).values());
  fmt::print("R {} core {} {}/{} in {} NA {} focus {}{}: {:.4f}  ({} x {} x {}, {:.3f} um, slabs {:.3f} um)\n", b.radius_um, b.core_um, b.n_o, b.n_e, b.n_host, na, focus_um,
             aplanatic ? " aplanatic" : "", error, g.nx, g.ny, g.slabs, g.step_um, (g.exit_um - g.entry_um) / g.slabs);
  return error;
}

// Wanted: 0.025 at NA 0.4, 0.06 at NA 0.8. What a finer grid does not take away (Converges, below, and half the step and slab here): 0.006 to 0.02, and
// 0.02 to 0.05; light that is reflected or, third order, steep. It is 0.03 and 0.06 for 2.5 um in 1.43, where there is most surface for the volume.
void expect_close(const Ball& b, double more = 1) {
  EXPECT_LT(series_error(b, 0.4), 0.025 * more);
  EXPECT_LT(series_error(b, 0.8), 0.06 * more);
}
TEST(SplitStep, SmallRadialBalls) {
  expect_close({2.5, 1.52});
  expect_close({2.5, 1.43}, 1.2);
}
TEST(SplitStep, RadialBalls) {
  for (const double n_host : {1.52, 1.43}) expect_close({4.5, n_host});
}
TEST(SplitStep, LargeRadialBalls) {
  for (const double n_host : {1.52, 1.43}) expect_close({7, n_host});
}
TEST(LongSplitStep, LargerRadialBalls) {
  for (const double n_host : {1.52, 1.43}) expect_close({10, n_host});
}
// What is left out falls with the square of the birefringence.
TEST(SplitStep, WeakerBirefringence) {
  EXPECT_LT(series_error({4.5, 1.52, 1.52, 1.62}, 0.4), 0.012);
  EXPECT_LT(series_error({4.5, 1.52, 1.52, 1.62}, 0.8), 0.025);
  EXPECT_LT(series_error({4.5, 1.5, 1.5, 1.45}, 0.8), 0.025);
}
// Another plane in focus and another objective change where errors show, not what they are: the same bounds.
TEST(SplitStep, DefocusAndAplanaticObjective) {
  for (const double n_host : {1.52, 1.43})
    for (const double na : {0.4, 0.8}) {
      EXPECT_LT(series_error({4.5, n_host}, na, 2), na < 0.5 ? 0.025 : 0.06);
      EXPECT_LT(series_error({4.5, n_host}, na, -2), na < 0.5 ? 0.025 : 0.06);
      EXPECT_LT(series_error({4.5, n_host}, na, 0, true), na < 0.5 ? 0.025 : 0.06);
    }
}
// Light that runs along a wall stays steep, and what is left out is larger, the more so where surfaces turn it: as measured, and a fifth or more on top.
TEST(SplitStep, Shells) {
  expect_close({5, 1.534, 1.534, 1.707, 3.5}, 1.2);
  expect_close({5, 1.42, 1.534, 1.707, 3.5}, 2.9);
}
TEST(LongSplitStep, LargeShells) {
  expect_close({15, 1.534, 1.534, 1.707, 12}, 1.2);
  expect_close({15, 1.42, 1.534, 1.707, 12}, 1.8);
}

}  // namespace
}  // namespace birefit
