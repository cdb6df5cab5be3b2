// The march of Maxwell's equations (wave/march.h) against matrices written out, closed forms, the exact series of a
// radial ball (tests/data/wave) and two Maxwell solvers (tests/data/peers/cylinder2d). All figures are printed.

#include "wave/march.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <unsupported/Eigen/MatrixFunctions>

#include "independent_ball.h"
#include "independent_imaging.h"
#include "reference_table.h"

namespace birefit {
namespace {
using namespace testing;

constexpr double kPi = std::numbers::pi, kK0 = 2 * kPi / 0.59;
using Number = std::complex<double>;
const std::array<Number, 2> kDiagonal{std::sqrt(0.5), std::sqrt(0.5)};  // polarizer at 45 degrees

double largest(const Plane& plane) {
  double most = 0;
  for (const Number& x : plane) most = std::max(most, std::abs(x));
  return most;
}

std::array<double, 6> uniaxial(double n_o, double n_e, double polar, double azimuth) {
  const double o = n_o * n_o, a = n_e * n_e - o;
  const double x = std::sin(polar) * std::cos(azimuth), y = std::sin(polar) * std::sin(azimuth), z = std::cos(polar);
  return {o + a * x * x, o + a * y * y, o + a * z * z, a * x * y, a * x * z, a * y * z};
}

/// A smooth medium without any symmetry, periodic in the box of 8 um: a director that bends and twists, an index that
/// varies.
std::array<double, 6> smooth_medium(double x, double y, double z) {
  const double u = kPi * x / 4, v = kPi * y / 4;
  const double polar = 1.1 + 0.4 * std::sin(u) + 0.3 * std::cos(v + 0.5 * z),
               azimuth = 0.5 + 0.8 * z + 0.5 * std::sin(u + 2 * v);
  return uniaxial(1.5 + 0.02 * std::cos(u - v) * std::sin(z), 1.65, polar, azimuth);
}

// ---- what must hold exactly ----------------------------------------------------------------------------------------

TEST(March, EmptyBoxScattersNothing) {
  const double n = 1.52;
  for (const std::array<double, 2>& kappa : {std::array{0.0, 0.0}, {0.3, -0.7}}) {
    const auto field = march({16, 12, 5, 4, -3, 2, 3}, kK0, n,
                             [n](double, double, double) { return std::array{n * n, n * n, n * n, 0.0, 0.0, 0.0}; },
                             {{kappa, {{{0.3, 0.1}, {0.4, -1.0}}}}})[0];
    // The series is exact to about 1e-12, three slabs.
    EXPECT_LT(std::max(largest(field.ex), largest(field.ey)), 1e-11);
    EXPECT_NEAR(field.flux_out / field.flux_in, 1, 1e-11);
  }
}

// A plate at normal incidence, director at polar angle 50 degrees: only its extraordinary wave, E in the plane of the
// director, q = N. Started as a forward wave of the host, its e = cos + i (n/N) sin and h = n cos + i N sin.
TEST(March, PlateAtNormalIncidenceIsClosedForm) {
  const double n = 1.52, o = 1.52, e = 1.74, polar = 50 * kPi / 180, azimuth = 0.7, d = 3;
  const double q = o * e / std::hypot(e * std::cos(polar), o * std::sin(polar)), phase = kK0 * q * d;
  const auto field =
      march({6, 6, 3, 3, 0, d, 4}, kK0, n, [&](double, double, double) { return uniaxial(o, e, polar, azimuth); },
            {{{0, 0}, {std::cos(azimuth), std::sin(azimuth)}}, {{0, 0}, {-std::sin(azimuth), std::cos(azimuth)}}});
  const Number exact = Number(std::cos(phase), 0.5 * (n / q + q / n) * std::sin(phase)) - std::polar(1.0, kK0 * n * d);
  for (std::size_t i = 0; i < field[0].ex.size(); ++i) {
    EXPECT_LT(std::abs(field[0].ex[i] - exact * std::cos(azimuth)), 1e-11);
    EXPECT_LT(std::abs(field[0].ey[i] - exact * std::sin(azimuth)), 1e-11);
    EXPECT_LT(std::abs(field[1].ex[i]), 1e-11);  // the ordinary wave has the host's index
    EXPECT_LT(std::abs(field[1].ey[i]), 1e-11);
  }
}

/// March of a medium that does not change along z by matrices: Maxwell's six equations component by component, kappa
/// and the transform as matrices, and Eigen's exponential. Waves of the host by their s and p parts.
std::array<Eigen::VectorXcd, 2> dense_march(const MarchGrid& grid, double k0, double n, const DielectricAt& dielectric,
                                            const MarchWave& wave) {
  using Matrix = Eigen::MatrixXcd;
  const int points = grid.nx * grid.ny;
  std::vector<std::array<double, 2>> kept;
  std::vector<std::array<int, 2>> orders;
  for (int l = -((grid.ny - 1) / 2); l <= (grid.ny - 1) / 2; ++l)
    for (int m = -((grid.nx - 1) / 2); m <= (grid.nx - 1) / 2; ++m) {
      const double x = wave.kappa[0] + 2 * kPi * m / grid.box_x_um / k0,
                   y = wave.kappa[1] + 2 * kPi * l / grid.box_y_um / k0;
      if (std::hypot(x, y) >= grid.limit * n) continue;
      kept.push_back({x, y});
      orders.push_back({m, l});
    }
  const int b = static_cast<int>(kept.size());
  Matrix to_points(points, b), kx = Matrix::Zero(b, b), ky = Matrix::Zero(b, b);
  std::array<Eigen::VectorXcd, 6> eps;
  for (auto& component : eps) component.resize(points);
  for (int j = 0; j < grid.ny; ++j)
    for (int i = 0; i < grid.nx; ++i) {
      const double x = (i + 0.5) / grid.nx - 0.5, y = (j + 0.5) / grid.ny - 0.5;
      const int p = j * grid.nx + i;
      for (int c = 0; c < b; ++c) {
        const auto [m, l] = orders[static_cast<std::size_t>(c)];
        to_points(p, c) = std::polar(1.0, 2 * kPi * (m * x + l * y));
      }
      const auto here = dielectric(x * grid.box_x_um, y * grid.box_y_um, 0);
      for (std::size_t c = 0; c < 6; ++c) eps[c](p) = here[c];
    }
  for (int c = 0; c < b; ++c)
    kx(c, c) = kept[static_cast<std::size_t>(c)][0], ky(c, c) = kept[static_cast<std::size_t>(c)][1];
  const Matrix to_waves = to_points.adjoint() / points;
  const auto times = [&](int component, const Matrix& field) -> Matrix {
    return eps[static_cast<std::size_t>(component)].asDiagonal() * field;
  };
  // Every component as a matrix acting on the unknowns (Ex, Ey, Hx, Hy).
  const auto unknown = [&](int which) -> Matrix {
    Matrix m = Matrix::Zero(b, 4 * b);
    m.block(0, which * b, b, b).setIdentity();
    return m;
  };
  const Matrix ex = unknown(0), ey = unknown(1), hx = unknown(2), hy = unknown(3), ex_points = to_points * ex,
               ey_points = to_points * ey;
  const Matrix hz = kx * ey - ky * ex;  // (curl E)_z
  // (curl H)_z = -Dz
  const Matrix ez_points = eps[2].cwiseInverse().asDiagonal() *
                           (-to_points * (kx * hy - ky * hx) - times(4, ex_points) - times(5, ey_points));
  const Matrix ez = to_waves * ez_points;
  const Matrix dx = to_waves * (times(0, ex_points) + times(3, ey_points) + times(4, ez_points));
  const Matrix dy = to_waves * (times(3, ex_points) + times(1, ey_points) + times(5, ez_points));
  Matrix a(4 * b, 4 * b);  // (1/(i k0)) d/dz
  a << hy + kx * ez,       // (curl E)_y
      ky * ez - hx,        // (curl E)_x
      kx * hz - dy,        // (curl H)_y
      ky * hz + dx;        // (curl H)_x
  const int middle = static_cast<int>(std::find(orders.begin(), orders.end(), std::array{0, 0}) - orders.begin());
  const auto directions = [&](int c) {  // (sin, cos of the azimuth; q)
    const auto [x, y] = kept[static_cast<std::size_t>(c)];
    const double k = std::hypot(x, y);
    return std::array{k > 0 ? x / k : 1, k > 0 ? y / k : 0, std::sqrt(n * n - k * k)};
  };
  Eigen::VectorXcd field = Eigen::VectorXcd::Zero(4 * b);
  {
    const auto [c, s, q] = directions(middle);
    const Number phase = std::polar(1.0, k0 * q * grid.z0_um), ep = phase * (c * wave.e[0] + s * wave.e[1]),
                 es = phase * (c * wave.e[1] - s * wave.e[0]);
    const Number hs = ep * n * n / q, hp = -es * q;  // H along s of the p wave, along p of the s wave
    field(middle) = c * ep - s * es, field(b + middle) = s * ep + c * es;
    field(2 * b + middle) = c * hp - s * hs, field(3 * b + middle) = s * hp + c * hs;
  }
  const Matrix generator = Number(0, k0 * (grid.z1_um - grid.z0_um)) * a;
  field = generator.exp() * field;
  Eigen::VectorXcd out_x(b), out_y(b);
  for (int i = 0; i < b; ++i) {
    const auto [c, s, q] = directions(i);
    const Number ep = c * field(i) + s * field(b + i), es = c * field(b + i) - s * field(i);
    const Number hp = c * field(2 * b + i) + s * field(3 * b + i), hs = c * field(3 * b + i) - s * field(2 * b + i);
    const Number p_forward = 0.5 * (ep + hs * q / (n * n)), s_forward = 0.5 * (es - hp / q);
    out_x(i) = c * p_forward - s * s_forward, out_y(i) = s * p_forward + c * s_forward;
  }
  const Number incident = std::polar(1.0, k0 * directions(middle)[2] * grid.z1_um);
  out_x(middle) -= incident * wave.e[0], out_y(middle) -= incident * wave.e[1];
  return {to_points * out_x, to_points * out_y};
}

double difference(const MarchedField& field, const std::array<Eigen::VectorXcd, 2>& dense) {
  double most = 0;
  for (std::size_t i = 0; i < field.ex.size(); ++i) {
    most = std::max(most, std::abs(field.ex[i] - dense[0](static_cast<int>(i))));
    most = std::max(most, std::abs(field.ey[i] - dense[1](static_cast<int>(i))));
  }
  return most;
}

TEST(March, PlateAtAnyIncidenceIsTheExponentialOfItsMatrix) {
  for (const std::array<double, 2>& kappa : {std::array{0.0, 0.0}, {0.2, 0.0}, {0.4, -0.8}}) {
    const MarchGrid grid{4, 4, 2, 2, -0.5, 3.5, 5};
    const auto medium = [](double, double, double) { return uniaxial(1.52, 1.74, 0.9, 0.4); };
    const MarchWave wave{kappa, {{{0.6, 0.2}, {-0.3, 0.7}}}};
    EXPECT_LT(difference(march(grid, kK0, 1.55, medium, {wave})[0], dense_march(grid, kK0, 1.55, medium, wave)), 1e-10)
        << kappa[0];
  }
}

// A random medium at every point, so that the order of kappa and the coefficients matters everywhere; even and odd
// sizes.
TEST(March, RandomMediumIsTheExponentialOfMaxwellsMatrix) {
  std::mt19937 random(20240611);
  std::uniform_real_distribution<double> angle(0, kPi), index(1.55, 1.8);
  const std::array<MarchGrid, 2> grids{{{6, 5, 1.1, 0.9, -0.2, 0.8, 2}, {9, 1, 1.7, 0, 0, 1, 2}}};
  for (const MarchGrid& grid : grids)
    for (const std::array<double, 2>& kappa : {std::array{0.0, 0.0}, {0.15, -0.1}}) {
      std::vector<std::array<double, 6>> values;
      for (int p = 0; p < grid.nx * grid.ny; ++p)
        values.push_back(uniaxial(index(random), index(random), angle(random), angle(random)));
      const auto medium = [&](double x, double y, double) {
        const int i = static_cast<int>(std::floor((x / grid.box_x_um + 0.5) * grid.nx));
        const int j = grid.ny == 1 ? 0 : static_cast<int>(std::floor((y / grid.box_y_um + 0.5) * grid.ny));
        return values[static_cast<std::size_t>(j * grid.nx + i)];
      };
      const MarchWave wave{kappa, {{{0.6, 0.2}, {-0.3, 0.7}}}};
      MarchGrid dense_grid = grid;
      if (grid.ny == 1) dense_grid.box_y_um = 1;  // any
      const auto field = march(grid, kK0, 1.52, medium, {wave})[0];
      EXPECT_LT(difference(field, dense_march(dense_grid, kK0, 1.52, medium, wave)), 1e-10);
      EXPECT_NEAR(field.flux_out / field.flux_in, 1, 1e-11);
      EXPECT_GT(std::min(largest(field.ex), largest(field.ey)), 0.1);  // it scatters
    }
}

TEST(March, FluxIsConserved) {
  const IndependentBall ball{2.5, 1.52, 1.74, 1.43, 0.25, radial_director};
  const auto fields = march({40, 40, 10, 10, -2.7, 2.7, 14}, kK0, 1.43, ball,
                            {{{0, 0}, kDiagonal}, {{0.3, -0.2}, {1, Number(0, 1)}}}, 2);
  const auto smooth = march({24, 24, 8, 8, 0, 4, 10}, kK0, 1.55, smooth_medium, {{}});
  for (const auto& field : {fields[0], fields[1], smooth[0]}) {
    fmt::print("flux out / in - 1 = {:.1e}\n", field.flux_out / field.flux_in - 1);
    // Asked for: 1e-10. The generator conserves it exactly; the series is exact to 1e-12 in each of 18 slabs.
    EXPECT_NEAR(field.flux_out / field.flux_in, 1, 1e-10);
  }
}

TEST(March, MirroredLightGivesTheMirroredField) {
  const IndependentBall ball{1.5, 1.52, 1.74, 1.52, 0.25, radial_director};
  const auto fields =
      march({32, 32, 8, 8, -1.7, 1.7, 8}, kK0, 1.52, ball, {{{0.2, 0.1}, {1, 0.5}}, {{-0.2, 0.1}, {-1, 0.5}}}, 2);
  double most = 0;
  for (std::size_t j = 0; j < 32; ++j)
    for (std::size_t i = 0; i < 32; ++i) {
      most = std::max(most, std::abs(fields[0].ex[32 * j + i] + fields[1].ex[32 * j + 31 - i]));
      most = std::max(most, std::abs(fields[0].ey[32 * j + i] - fields[1].ey[32 * j + 31 - i]));
    }
  EXPECT_LT(most, 1e-11);
  EXPECT_GT(largest(fields[0].ey), 0.1);
}

TEST(March, SameBitsForAnyNumberOfThreads) {
  const IndependentBall ball{1, 1.52, 1.74, 1.52, 0.25, radial_director};
  const std::vector<MarchWave> waves{{{0, 0}, {1, 0}}, {{0, 0}, {0, 1}}, {{0.2, 0}, {0, 1}}};
  const auto one = march({16, 16, 4, 4, -1.2, 1.2, 3}, kK0, 1.52, ball, waves, 1),
             three = march({16, 16, 4, 4, -1.2, 1.2, 3}, kK0, 1.52, ball, waves, 3);
  for (std::size_t w = 0; w < waves.size(); ++w) EXPECT_TRUE(one[w].ex == three[w].ex && one[w].ey == three[w].ey);
}

TEST(March, RefusesWhereWavesWouldGrow) {
  const auto low = [](double x, double, double) {
    const double n = x > 0 ? 1.3 : 1.5;
    return std::array{n * n, n * n, n * n, 0.0, 0.0, 0.0};
  };
  MarchGrid grid{8, 8, 2, 2, 0, 1, 1};
  EXPECT_THROW(march(grid, kK0, 1.5, low, {{}}), std::domain_error);
  grid.limit = 0.8;
  EXPECT_NO_THROW(march(grid, kK0, 1.5, low, {{}}));
  EXPECT_THROW(march(grid, kK0, 1.5, low, {{{1.21, 0}, {1, 0}}}), std::domain_error);
}

// ---- convergence ---------------------------------------------------------------------------------------------------

double distance(const MarchedField& a, const MarchedField& b) {
  double sum = 0, all = 0;
  for (std::size_t i = 0; i < a.ex.size(); ++i) {
    sum += std::norm(a.ex[i] - b.ex[i]) + std::norm(a.ey[i] - b.ey[i]);
    all += std::norm(b.ex[i]) + std::norm(b.ey[i]);
  }
  return std::sqrt(sum / all);
}

// Half the slab, a sixteenth of the error.
TEST(March, ErrorFallsWithTheFourthPowerOfTheSlab) {
  const auto at = [](int slabs) { return march({16, 16, 8, 8, 0, 4, slabs, 1}, kK0, 1.55, smooth_medium, {{}})[0]; };
  const MarchedField fine = at(320);
  const double e40 = distance(at(40), fine), e80 = distance(at(80), fine), e160 = distance(at(160), fine);
  fmt::print("slabs 40, 80, 160: {:.2e} {:.2e} {:.2e}, orders {:.2f} {:.2f}\n", e40, e80, e160, std::log2(e40 / e80),
             std::log2(e80 / e160));
  // The next term of the error, seen in the first order printed, is still in the second; that of `fine` takes 1/16 off
  // the smallest, 0.09 of the order.
  EXPECT_NEAR(std::log2(e80 / e160), 4.09, 0.2);
}

// Points: for a smooth medium the error falls faster than any power, down to rounding.
TEST(March, SmoothMediumNeedsFewPoints) {
  const auto at = [](int points) { return march({points, points, 8, 8, 0, 4, 10}, kK0, 1.55, smooth_medium, {{}})[0]; };
  const MarchedField fine = at(72);
  double before = 1;
  for (const int points : {12, 16, 24, 32}) {
    const MarchedField coarse = at(points);
    // Compared by spectra, as the points differ: frequency m of both grids, positions half a pixel off the corner.
    double sum = 0, all = 0;
    const auto spectrum = [](Plane plane, int n, int mx, int my) {
      const Number phase = std::polar(1.0 / (n * n), kPi * (mx + my) * (1 - 1.0 / n));
      Number s = 0;
      for (int j = 0; j < n; ++j)
        for (int i = 0; i < n; ++i)
          s += plane[static_cast<std::size_t>(j * n + i)] * std::polar(1.0, -2 * kPi * (mx * i + my * j) / n);
      return s * phase;
    };
    for (int my = -4; my <= 4; ++my)
      for (int mx = -4; mx <= 4; ++mx) {
        sum += std::norm(spectrum(coarse.ex, points, mx, my) - spectrum(fine.ex, 72, mx, my));
        all += std::norm(spectrum(fine.ex, 72, mx, my));
      }
    const double error = std::sqrt(sum / all);
    fmt::print("points {}: {:.1e}\n", points, error);
    EXPECT_LT(error, before);
    before = error / 10;
  }
}

// ---- the radial ball: exact series ---------------------------------------------------------------------------------

struct Ball {
  double radius_um, n_o, n_e, n_host, wavelength_um;
};

/// Crossed image, polarizer at 45 degrees, of the exact series at the points; NaN beyond the table's radius.
std::vector<double> exact_image(const Ball& ball, double aperture, double focus_um, int n, double box_um) {
  const ReferenceTable table(data_path("wave/radial_exact.csv"));
  const auto is = [&](std::size_t row, const char* column, double value) {
    return std::abs(table.number(row, column) - value) < 1e-9;
  };
  std::vector<Number> a2;
  double step = 0;
  for (std::size_t row = 0; row < table.size(); ++row)
    if (is(row, "R_um", ball.radius_um) && is(row, "no", ball.n_o) && is(row, "ne", ball.n_e) &&
        is(row, "n_host", ball.n_host) && is(row, "wavelength_um", ball.wavelength_um) && is(row, "NA", aperture) &&
        is(row, "defocus_um", focus_um)) {
      if (a2.size() == 1) step = table.number(row, "rho_um");
      a2.emplace_back(table.number(row, "A2_re"), table.number(row, "A2_im"));
    }
  if (a2.size() < 4) throw std::runtime_error("no such ball in the table");
  std::vector<double> image;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const double x = (i + 0.5 - 0.5 * n) * box_um / n, y = (j + 0.5 - 0.5 * n) * box_um / n,
                   at = std::hypot(x, y) / step;
      const std::size_t first = std::max<std::size_t>(1, static_cast<std::size_t>(at));
      if (first + 2 >= a2.size()) {
        image.push_back(std::nan(""));
        continue;
      }
      // Cubic through four rows: steps are below a seventh of the finest detail, lambda/NA.
      const double u = at - static_cast<double>(first);
      const Number value = u * (u - 1) * (u - 2) / -6 * a2[first - 1] + (u + 1) * (u - 1) * (u - 2) / 2 * a2[first] -
                           (u + 1) * u * (u - 2) / 2 * a2[first + 1] + (u + 1) * u * (u - 1) / 6 * a2[first + 2];
      const double cos_2phi = (x * x - y * y) / (x * x + y * y);  // sin 2(phi - 45 degrees) = -cos 2 phi
      image.push_back(std::norm(value) * cos_2phi * cos_2phi);
    }
  return image;
}

/// Relative RMS of the picture at NA 0.4 and 0.8 with the focus on the centre, then 2 um beyond.
std::array<double, 4> ball_errors(const Ball& ball, int n, double box_um, int slabs) {
  const double ramp = box_um / n, k0 = 2 * kPi / ball.wavelength_um, z = ball.radius_um + 0.5 * ramp;
  const IndependentBall medium{ball.radius_um, ball.n_o, ball.n_e, ball.n_host, ramp, radial_director};
  const MarchedField field =
      march({n, n, box_um, box_um, -z, z, slabs}, k0, ball.n_host, medium, {{{0, 0}, kDiagonal}})[0];
  std::array<double, 4> errors{};
  for (std::size_t c = 0; c < 4; ++c) {
    const double aperture = c % 2 == 0 ? 0.4 : 0.8, focus = c < 2 ? 0 : 2;
    const auto image =
        Imaging{k0, ball.n_host, aperture, z, focus, {0, 0}, kDiagonal}(field.ex, field.ey, n, n, box_um, box_um)
            .crossed(kPi / 4);
    const auto exact = exact_image(ball, aperture, focus, n, box_um);
    std::vector<double> ours, theirs;
    for (std::size_t i = 0; i < exact.size(); ++i)
      if (!std::isnan(exact[i])) ours.push_back(image[i]), theirs.push_back(exact[i]);
    errors[c] = relative_rms(ours, theirs);
  }
  fmt::print("R {} {}/{} in {}, {} um: {} points {} um, {} slabs: centre {:.4f} {:.4f}, +2 um {:.4f} {:.4f}\n",
             ball.radius_um, ball.n_o, ball.n_e, ball.n_host, ball.wavelength_um, n, box_um, slabs, errors[0],
             errors[1], errors[2], errors[3]);
  return errors;
}

// Light reflected twice inside is not in the march: on the axis it has r^2 = ((n_e - n_host)/(n_e + n_host))^2 of the
// amplitude (0.0046 for 1.74 in 1.52), which interferes to 2 r^2 of the intensity; towards the rim, where light meets
// the surface at a slant, r^2 is several times larger, on the part of the picture that NA 0.8 sees. So 4 and 5 r^2, and
// 0.008 and 0.012 for the points (RadialBallConverges: 0.005 to 0.01 from 72 to 128 of them). A wrong sign anywhere
// costs tens of percent, a second-order term left out 0.02-0.1.
void expect_close(const Ball& ball, int n, double box_um, int slabs) {
  const double r = (ball.n_e - ball.n_host) / (ball.n_e + ball.n_host);
  const auto errors = ball_errors(ball, n, box_um, slabs);
  for (std::size_t c = 0; c < 4; ++c) EXPECT_LT(errors[c], c % 2 == 0 ? 0.008 + 4 * r * r : 0.012 + 5 * r * r) << c;
}

TEST(March, RadialBallInItsOrdinaryIndex) { expect_close({4.5, 1.52, 1.74, 1.52, 0.59}, 96, 16, 24); }
TEST(March, SmallRadialBall) { expect_close({2.5, 1.52, 1.74, 1.52, 0.59}, 96, 12, 16); }
TEST(March, RadialBallInALowerIndex) { expect_close({4.65, 1.52, 1.74, 1.47, 0.59}, 96, 16, 24); }

TEST(March, RadialBallConverges) {
  const Ball ball{2.5, 1.52, 1.74, 1.52, 0.59};
  // Slabs of 1.03, 0.58, 0.29 um at one grid, where the points are what is left; then points.
  const auto a = ball_errors(ball, 72, 12, 5), b = ball_errors(ball, 72, 12, 9), c = ball_errors(ball, 72, 12, 18);
  EXPECT_GT(a[1], b[1]);
  EXPECT_GT(b[1], c[1]);
  const auto d = ball_errors(ball, 48, 12, 18), e = ball_errors(ball, 128, 12, 18);
  EXPECT_GT(d[1], c[1]);
  EXPECT_GT(c[1], e[1]);
}

TEST(LongMarch, RadialBalls) {
  expect_close({4.5, 1.52, 1.74, 1.52, 0.59}, 160, 20, 40);
  expect_close({7.0, 1.52, 1.62, 1.52, 0.59}, 160, 24, 40);
  expect_close({6.0, 1.5, 1.45, 1.5, 0.633}, 128, 20, 30);
  expect_close({4.65, 1.52, 1.74, 1.47, 0.59}, 160, 20, 40);
  expect_close({4.5, 1.534, 1.707, 1.42, 0.48}, 160, 18, 60);
}

// ---- tilted light --------------------------------------------------------------------------------------------------

// A radial ball looks the same from everywhere: in the plane of incidence its waves of polarization s (p) depend on the
// angle between in and out alone. A plane wave's amplitude in the far field is q times that in the plane (stationary
// phase).
TEST(March, TiltedLightScattersByTheAngleFromItself) {
  const double n = 1.52, box = 10, radius = 1.5, z = 1.65;
  const int points = 64;
  const IndependentBall ball{radius, 1.52, 1.74, n, box / points, radial_director};
  const double tilt = std::asin(0.2 / n);
  const auto fields =
      march({points, points, box, box, -z, z, 12}, kK0, n, ball,
            {{{0, 0}, {0, 1}}, {{0.2, 0}, {0, 1}}, {{0, 0}, {1, 0}}, {{0.2, 0}, {std::cos(tilt), 0}}}, 2);
  const auto far = [&](const MarchedField& field, double kappa_in, double angle, bool s) {
    const double kappa = n * std::sin(angle), q = n * std::cos(angle);
    const Plane& plane = s ? field.ey : field.ex;
    Number sum = 0;
    for (int j = 0; j < points; ++j)
      for (int i = 0; i < points; ++i)
        sum += plane[static_cast<std::size_t>(j * points + i)] *
               std::polar(1.0, -kK0 * (kappa - kappa_in) * (i + 0.5 - 0.5 * points) * box / points);
    return sum * std::polar(s ? q : n, -kK0 * q * z);  // E of a p wave is e/cos
  };
  for (const bool s : {true, false}) {
    double difference = 0, all = 0;
    for (double angle = -30; angle <= 30; angle += 1) {
      const std::size_t first = s ? 0 : 2;
      const Number straight = far(fields[first], 0, angle * kPi / 180, s),
                   tilted = far(fields[first + 1], 0.2, angle * kPi / 180 + tilt, s);
      difference += std::norm(straight - tilted);
      all += std::norm(straight);
    }
    const double error = std::sqrt(difference / all);
    fmt::print("{} light tilted by kappa 0.2: {:.4f} from the untilted far field\n", s ? "s" : "p", error);
    // What is seen of the square points (0.16 um, errors of 0.01 in the pictures above) from two directions 7.6 degrees
    // apart.
    EXPECT_LT(error, 0.005);
  }
}

// ---- the radial cylinder: two Maxwell solvers ----------------------------------------------------------------------

/// Crossed image, polarizer at 45 degrees, of a periodic row of cylinders, at 160 points over the period, by its orders
/// one by one.
std::vector<double> row_image(const std::vector<double>& x_um, const std::vector<Number>& tx,
                              const std::vector<Number>& ty, double period_um, double n, double aperture,
                              double distance_um) {
  std::vector<Number> difference(160);
  const int orders = static_cast<int>(aperture * kK0 * period_um / (2 * kPi));
  for (int m = -orders; m <= orders; ++m) {
    const double k = 2 * kPi * m / period_um, q = std::sqrt(n * n - k * k / (kK0 * kK0));
    Number amplitude = 0;
    for (std::size_t i = 0; i < x_um.size(); ++i)
      amplitude += (tx[i] - ty[i]) * std::polar(1.0 / static_cast<double>(x_um.size()), -k * x_um[i]);
    amplitude *= std::polar(1.0, kK0 * q * distance_um);
    for (std::size_t i = 0; i < 160; ++i)
      difference[i] += amplitude * std::polar(1.0, k * (static_cast<double>(i) + 0.5) * period_um / 160);
  }
  std::vector<double> image;
  for (const Number& d : difference) image.push_back(0.25 * std::norm(d));
  return image;
}

TEST(March, RadialCylindersAgreeWithMaxwellSolvers) {
  const double n = 1.52, period = 8, exit = 2.5;
  const auto table_image = [&](const std::string& name, double aperture, double distance) {
    const ReferenceTable table(data_path("peers/cylinder2d/cyl2d_" + name + "_n1.52.csv"));
    std::vector<double> x;
    std::vector<Number> tx, ty;
    for (std::size_t row = 0; row < table.size(); ++row) {
      if (std::abs(table.number(row, "x_um")) > period / 2) continue;  // meep80 repeats its first and last sample
      x.push_back(table.number(row, "x_um"));
      tx.emplace_back(table.number(row, "tx_re"), table.number(row, "tx_im"));
      ty.emplace_back(table.number(row, "ty_re"), table.number(row, "ty_im"));
    }
    return row_image(x, tx, ty, period, n, aperture, distance);
  };
  for (const int points : {160, 320}) {
    const IndependentBall cylinder{2, 1.52, 1.74, n, period / points, radial_cylinder_director, true};
    const auto fields = march({points, 1, period, 0, -exit, exit, points == 160 ? 16 : 40}, kK0, n, cylinder,
                              {{{0, 0}, {1, 0}}, {{0, 0}, {0, 1}}});
    // E along y sees n_o = n_host: nothing happens.
    EXPECT_LT(largest(fields[1].ey), 1e-10);
    std::vector<double> x;
    std::vector<Number> tx, ty;
    for (int i = 0; i < points; ++i) {
      x.push_back((i + 0.5 - 0.5 * points) * period / points);
      tx.push_back(1.0 + fields[0].ex[static_cast<std::size_t>(i)] * std::polar(1.0, -kK0 * n * exit));
      ty.push_back(1.0 + fields[1].ey[static_cast<std::size_t>(i)] * std::polar(1.0, -kK0 * n * exit));
    }
    for (const double distance : {0.0, -exit})
      for (const double aperture : {0.4, 0.8}) {
        const auto ours = row_image(x, tx, ty, period, n, aperture, distance);
        const auto meep = table_image("meep80", aperture, distance), tmm = table_image("tmm2d", aperture, distance);
        const double a = relative_rms(ours, meep), b = relative_rms(ours, tmm), between = relative_rms(tmm, meep);
        fmt::print("{} points, {} NA {}: from meep80 {:.3f}, from tmm2d {:.3f}; these from each other {:.3f}\n", points,
                   distance == 0 ? "exit  " : "centre", aperture, a, b, between);
        // The two differ by up to 0.040 from each other (meep80 is good to 0.03-0.05 by its maker, README there); the
        // march is a third witness.
        EXPECT_LT(a, 0.04);
        EXPECT_LT(b, 0.04);
      }
  }
}

}  // namespace
}  // namespace birefit
