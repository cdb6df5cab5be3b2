// The droplet in a field along its axis against independent finite elements (tests/data/physics/README.md) and limits.

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>

#include "medium/families/axial.h"
#include "reference_table.h"
#include "transport/one_way.h"

namespace birefit {
namespace {
using namespace testing;

constexpr double kDegree = std::numbers::pi / 180;
constexpr AxialGrid kFine{20, 7};

/// Largest |ours - table| over the rows, each in units of its tolerance. 3 err, and what the table prints (1e-9).
double worst_ratio(const ReferenceTable& table, const AxialGrid& grid) {
  double worst = 0, e = -1, ring = -1;
  AxialEquilibrium equilibrium;
  const bool rings = table.has("rho_ring_over_R");
  for (std::size_t row = 0; row < table.size(); ++row) {
    const double e_here = table.number(row, "e"), ring_here = rings ? table.number(row, "rho_ring_over_R") : 0;
    if (e_here != e || ring_here != ring) equilibrium = axial_equilibrium(e = e_here, ring = ring_here, grid);
    const double r = table.number(row, "r_over_R"), polar = table.number(row, "polar_angle_deg") * kDegree;
    const double ours = equilibrium.theta(r * std::sin(polar), r * std::cos(polar));
    worst = std::max(
        worst, std::abs(ours - table.number(row, "theta_rad")) / std::max(3 * table.number(row, "err_est_rad"), 2e-9));
  }
  return worst;
}

TEST(AxialDroplet, HedgehogAgreesWithFiniteElements) {
  EXPECT_LE(worst_ratio(ReferenceTable(data_path("physics/droplet_hedgehog_theta.csv")), kFine), 1);
}

TEST(AxialDroplet, RingAgreesWithFiniteElements) {
  EXPECT_LE(worst_ratio(ReferenceTable(data_path("physics/droplet_ring_theta.csv")), kFine), 1);
}

// The grid that images use, against the header's promise.
TEST(AxialDroplet, ProductionGridIsWithinItsPromise) {
  for (const auto& [e, ring] :
       {std::pair{1.0, 0.0}, {8.0, 0.0}, {20.0, 0.0}, {40.0, 0.0}, {5.0, 0.85}, {20.0, 0.965}, {40.0, 0.98}}) {
    const AxialEquilibrium coarse = axial_equilibrium(e, ring, axial_production_grid(ring)),
                           fine = axial_equilibrium(e, ring, kFine);
    double worst = 0;
    for (double r = 0.025; r < 1; r += 0.05)
      for (double polar = 2.5; polar < 90; polar += 5) {
        const double rho = r * std::sin(polar * kDegree), z = r * std::cos(polar * kDegree);
        worst = std::max(worst, std::abs(coarse.theta(rho, z) - fine.theta(rho, z)));
      }
    EXPECT_LT(worst, ring > 0 ? 6.5e-4 : 3e-4) << "e " << e << " ring " << ring;
  }
}

// Polynomials of degree p: halving the elements divides the error by 2^(p+1) where theta is smooth; the hedgehog's
// r^1.56 at the centre is met by elements that shrink towards it. Order p is what is declared.
TEST(AxialDroplet, ErrorFallsWithTheDeclaredOrder) {
  const AxialEquilibrium exact = axial_equilibrium(10, 0, {24, 7});
  const auto error = [&](int elements) {
    const AxialEquilibrium one = axial_equilibrium(10, 0, {elements, 3});
    double sum = 0;
    for (double r = 0.3; r < 1; r += 0.07)
      for (double polar = 4; polar < 90; polar += 9) {
        const double rho = r * std::sin(polar * kDegree), z = r * std::cos(polar * kDegree);
        sum += square(one.theta(rho, z) - exact.theta(rho, z));
      }
    return std::sqrt(sum);
  };
  EXPECT_GT(std::log2(error(8) / error(16)), 3);
}

TEST(AxialDroplet, EnergyAgreesWithFiniteElements) {
  const ReferenceTable table(data_path("physics/droplet_hedgehog_energy.csv"));
  for (std::size_t row = 0; row < table.size(); row += 3) {
    const double e = table.number(row, "e");
    // err is the size of the Richardson correction; 1e-8 is what the table prints.
    EXPECT_NEAR(axial_equilibrium(e, 0, {12, 6}).energy(), table.number(row, "F_over_KR"),
                std::max(3 * table.number(row, "err_est"), 2e-8))
        << e;
  }
  EXPECT_NEAR(axial_equilibrium(0, 0).energy(), 4 * std::numbers::pi, 1e-12);
}

constexpr double kTension = std::numbers::pi * std::numbers::pi / 2;  // of a ring, per radius and L, in K
/// Rings are closer to 1e-4 of their energy on it than on what images use.
constexpr AxialGrid kRing{20, 7};

TEST(AxialDroplet, RingEnergyAgreesWithFiniteElements) {
  const ReferenceTable table(data_path("physics/droplet_ring_energy.csv"));
  int compared = 0;
  for (std::size_t row = 0; row < table.size(); ++row) {
    const double e = table.number(row, "e"), ring = table.number(row, "rho_ring_over_R");
    if (ring < 0.2 || (e != 0 && e != 2 && e != 6 && e != 12 && e != 40)) continue;  // others take time
    // The table's error is the size of its last correction, which says nothing where it changes its sign: the largest
    // of five neighbours counts. Ours: grids of 20 and 30 elements differ by 5e-5 at most, and fall by a third from one
    // to the next.
    double error = 0;
    for (std::size_t near = row > 1 ? row - 2 : 0; near <= std::min(row + 2, table.size() - 1); ++near)
      if (table.number(near, "e") == e) error = std::max(error, 3 * table.number(near, "err_est"));
    if (error > 0.05) continue;  // says nothing
    EXPECT_NEAR(axial_equilibrium(e, ring, kRing, false).energy(), table.number(row, "Freg_over_KR"), error + 1e-4)
        << e << " " << ring;
    ++compared;
  }
  EXPECT_GT(compared, 50);
}

// Where the table's ring is in balance ours is, for its L within what moves it by three times 0.003; so do barriers,
// which are unstable.
TEST(AxialDroplet, RingsAreInBalanceWhereFiniteElementsSay) {
  const ReferenceTable table(data_path("physics/droplet_ring_equilibrium.csv"));
  int stable = 0, barriers = 0;
  for (std::size_t row = 0; row < table.size(); ++row) {
    const double L = table.number(row, "L"), e = table.number(row, "e");
    if (e > 20) continue;
    EXPECT_NEAR(axial_equilibrium(e, 0, {12, 6}, false).energy(), table.number(row, "F_hedgehog_over_KR"), 1e-3) << e;
    for (const bool barrier : {false, true}) {
      const double ring = table.number(row, barrier ? "rho_barrier" : "rho_eq");
      if (!(ring > 0.22) || ring > 0.98) continue;
      const RingBalance here = ring_balance(e, ring), out = ring_balance(e, ring + 0.3 * (1 - ring)),
                        in = ring_balance(e, ring - 0.02);
      const double slope = std::max(std::abs(out.core_length - here.core_length) / (0.3 * (1 - ring)),
                                    std::abs(here.core_length - in.core_length) / 0.02);
      EXPECT_NEAR(here.core_length, L, 0.02 + 0.009 * slope) << e << " " << ring;
      const double energy = axial_equilibrium(e, ring, {20, 5}, false).energy() + kTension * ring * L;
      EXPECT_NEAR(energy, table.number(row, barrier ? "F_barrier_over_KR" : "F_eq_over_KR"), 0.09)
          /* three times the README's 0.03 */ << e << " " << ring;
      if (std::abs(here.core_length - L) < 0.1 * std::abs(out.core_length - L)) {  // at a spinodal both are one
        EXPECT_EQ(here.stable, !barrier) << e << " " << ring;
      }
      ++(barrier ? barriers : stable);
    }
  }
  EXPECT_GT(stable, 30);
  EXPECT_GT(barriers, 5);
}

// At the lower spinodal the ring's L is the largest that any ring has at that field; at coexistence ring and hedgehog
// have one energy. The table's fields are good to 0.02.
TEST(AxialDroplet, TransitionsAreWhereFiniteElementsSay) {
  const ReferenceTable table(data_path("physics/droplet_transitions.csv"));
  int compared = 0;
  for (std::size_t row = 0; row < table.size(); ++row) {
    const double L = table.number(row, "L"), e = table.number(row, "e_ring_spinodal_lower"),
                 together = table.number(row, "e_coexistence");
    if (!(L > 5.5)) continue;  // below, the two are one
    const double ring = table.number(row, "rho_at_spinodal");
    const auto largest = [&](double field) {
      double most = 0;
      for (double at = ring - 0.06; at < ring + 0.07; at += 0.02)
        most = std::max(most, ring_balance(field, at).core_length);
      return most;
    };
    EXPECT_NEAR(largest(e), L, 0.06 * (largest(e + 0.1) - largest(e - 0.1)) / 0.2) << L;
    const auto excess = [&](double field) {
      const double at = table.number(row, "rho_at_coexistence");
      return axial_equilibrium(field, at, kRing, false).energy() + kTension * at * L -
             axial_equilibrium(field, 0, {12, 6}, false).energy();
    };
    ++compared;
    EXPECT_NEAR(excess(together), 0, 0.06 * std::abs(excess(together + 0.1) - excess(together - 0.1)) / 0.2) << L;
  }
  EXPECT_EQ(compared, 5);
}

// F - F_hedgehog = pi^2/2 (x/e) (L - ln e + ln x + c(x)), x = e ring.
TEST(AxialDroplet, SmallRingsScale) {
  const ReferenceTable table(data_path("physics/droplet_small_ring_scaling.csv"));
  int compared = 0;
  for (std::size_t row = 0; row < table.size(); ++row) {
    const double e = table.number(row, "e"), x = table.number(row, "x_eq_rho_times_e"), ring = x / e;
    if (ring < 0.2 || e > 20) continue;
    const double c =
        (axial_equilibrium(e, ring, kRing, false).energy() - axial_equilibrium(e, 0, {20, 7}, false).energy()) /
            (kTension * ring) -
        std::log(ring);
    EXPECT_NEAR(c, table.number(row, "c_of_x"), std::max(3 * table.number(row, "err_est"), 2e-3)) << e << " " << x;
    ++compared;
  }
  EXPECT_GT(compared, 4);
}

TEST(AxialDroplet, BalanceHasANumberAtTheEndsOfItsRange) {
  for (const double e : {0.0, 60.0})
    for (const double ring : {0.2, 0.995})
      EXPECT_TRUE(std::isfinite(ring_balance(e, ring).core_length)) << e << " " << ring;
  // Near the sphere the ring is repelled like pi^2/2 ln(1/(1 - ring)): no core is small enough to hold it there without
  // a field.
  EXPECT_LT(ring_balance(0, 0.995).core_length, -50);
}

// theta = polar - e^2/2 (r^p - r^2) sin cos + O(e^4), p = (sqrt 17 - 1)/2: the linearised equation solved by hand.
TEST(AxialDroplet, WeakFieldTurnsTheHedgehogAsPerturbationTheorySays) {
  const double e = 0.05, p = (std::sqrt(17.0) - 1) / 2;
  const AxialEquilibrium equilibrium = axial_equilibrium(e, 0, kFine);
  for (double r : {0.2, 0.5, 0.9})
    for (double polar : {0.3, 0.9, 1.4}) {
      const double expected = polar - 0.5 * e * e * (std::pow(r, p) - r * r) * std::sin(polar) * std::cos(polar);
      EXPECT_NEAR(equilibrium.theta(r * std::sin(polar), r * std::cos(polar)), expected, std::pow(e, 4));
    }
}

TEST(AxialDroplet, AnchoringAxisEquatorAndRingHoldWhatTheyMust) {
  for (const auto& [e, ring] : {std::pair{7.0, 0.0}, {15.0, 0.6}, {30.0, 0.97}}) {
    const AxialEquilibrium q = axial_equilibrium(e, ring);
    for (double polar : {0.1, 0.8, 1.5}) EXPECT_NEAR(q.theta(std::sin(polar), std::cos(polar)), polar, 1e-12);
    for (double z : {0.2, 0.7}) EXPECT_NEAR(q.theta(1e-14, z), 0, 1e-12);
    for (double rho : {0.3, 0.5, 0.99})
      EXPECT_NEAR(q.theta(rho, 0), rho < ring ? 0 : std::numbers::pi / 2, 1e-12) << ring << " " << rho;
  }
}

// What images use is found in a few steps from equilibria kept nearby: the same as from the start. Over the whole range
// and its corners.
TEST(AxialDroplet, NeighboursLeadToTheSameEquilibrium) {
  for (const double e : {0.0, 0.11, 1.3, 5.2, 12.7, 29.3, 60.0})
    for (const double ring : {0.0, 0.2, 0.51, 0.87, 0.955, 0.995}) {
      const AxialEquilibrium direct = axial_equilibrium(e, ring, axial_production_grid(ring));
      const auto known = known_axial_equilibrium(e, ring, true);
      // Steps end at 1e-9 of their size; each leaves at most a third of the error.
      const auto compare = [&](const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, const char* what) {
        EXPECT_LT((a - b).cwiseAbs().maxCoeff(), 1e-8 * std::max(1.0, a.cwiseAbs().maxCoeff()))
            << what << ", e " << e << " ring " << ring;
      };
      compare(direct.change, known->change, "theta");
      compare(direct.by_e, known->by_e, "by e");
      if (ring > 0) compare(direct.by_ring, known->by_ring, "by ring");
    }
}

template <class S, class T>
T angle_from_field(const AxialField<S>& field, const T& rho, const T& z) {
  T s, c;
  field.director(rho, z, s, c);
  return angle_of(s, c);
}

// d theta / d e by the implicit function theorem, on nodes that move, against the table's own.
TEST(AxialDroplet, DerivativeByFieldAgreesWithFiniteElements) {
  const ReferenceTable table(data_path("physics/droplet_hedgehog_theta.csv"));
  using D = Dual<double, 1>;
  double e = -1, worst = 0, largest_slope = 0;
  std::unique_ptr<AxialField<D>> field;
  for (std::size_t row = 0; row < table.size(); ++row) {
    if (table.number(row, "e") > 30) continue;
    if (table.number(row, "e") != e) {
      D variable(e = table.number(row, "e"));
      variable.d[0] = 1;
      field = std::make_unique<AxialField<D>>(variable, D(0.0), false);
    }
    const double r = table.number(row, "r_over_R"), polar = table.number(row, "polar_angle_deg") * kDegree;
    const double ours = angle_from_field(*field, D(r * std::sin(polar)), D(r * std::cos(polar))).d[0],
                 theirs = table.number(row, "dtheta_de_rad");
    worst = std::max(worst, std::abs(ours - theirs));
    largest_slope = std::max(largest_slope, std::abs(theirs));
  }
  EXPECT_LT(worst, 1e-3 * largest_slope);  // the production grid's 3e-5 rad over its change of e by some 0.1 to 1
}

/// theta from the equilibrium's nodes by Lagrange's polynomials, in any number: an element's edges move with e and
/// ring.
template <class T, class S>
T angle_by_lagrange(const AxialEquilibrium& known, const S& e, const S& ring, const T& rho, const T& z) {
  const bool has_ring = known.ring > 0;
  const int degree = known.grid.degree;
  const auto basis = [&](const T& place, const auto& edge, bool falling, T* out) {
    int k = 0;
    while (k + 1 < known.grid.elements &&
           (falling ? plain(place) < plain(edge(k + 1)) : plain(place) > plain(edge(k + 1))))
      ++k;
    const T from{edge(k)}, to{edge(k + 1)}, x = 2.0 * (place - from) / (to - from) - 1.0;
    const std::vector<double>& nodes = lobatto_rule(degree).x;
    for (int i = 0; i <= degree; ++i) {
      out[i] = T(S(1.0));
      for (int m = 0; m <= degree; ++m)
        if (m != i)
          out[i] = out[i] * (x - nodes[static_cast<std::size_t>(m)]) *
                   (1 / (nodes[static_cast<std::size_t>(i)] - nodes[static_cast<std::size_t>(m)]));
    }
    return k * degree;
  };
  const T r = root(T(rho * rho + z * z)), polar = angle_of(rho, z);
  T of_r[6], of_polar[6];
  const int i0 = basis(
      r, [&](int k) { return axial_radius_edge(known.grid, k, e, ring, has_ring); }, false, of_r);
  const int j0 = basis(
      polar, [&](int k) { return axial_polar_edge(known.grid, k, e, ring, has_ring); }, true, of_polar);
  T theta = has_ring ? axial_boundary_angle(rho, z, T(ring)) : polar;
  for (int i = 0; i <= degree; ++i)
    for (int j = 0; j <= degree; ++j) {
      S node(known.change(i0 + i, j0 + j));
      node.d[0] = known.by_e(i0 + i, j0 + j);
      if (has_ring) node.d[1] = known.by_ring(i0 + i, j0 + j);
      theta = theta + of_r[i] * of_polar[j] * T(node);
    }
  return theta;
}

// What bends rays, term by term, against nested dual numbers: to rounding, which second derivatives near the centre
// make larger.
TEST(AxialDroplet, SlopesOfTheDirectorAreThoseOfDualNumbers) {
  using Field = Dual<double, 2>;  // by e and ring
  using First = Dual<Field, 2>;   // by rho and z
  using Second = Dual<First, 2>;
  for (const auto& [e_value, ring_value] : {std::pair{5.0, 0.0}, {12.0, 0.0}, {6.0, 0.6}}) {
    const bool has_ring = ring_value > 0;
    Field e(e_value), ring(ring_value);
    e.d[0] = ring.d[1] = 1;
    const AxialField<Field> field(e, ring, has_ring);
    const AxialField<double> plain_field(e_value, ring_value, has_ring);
    for (int i = 0; i < 60; ++i) {
      const double r = 0.02 + 0.016 * i, polar = 1.5 * (0.5 + 0.49 * std::sin(7.0 * i)), rho = r * std::sin(polar),
                   z = r * std::cos(polar);
      First x1{Field(rho)}, z1{Field(z)};
      x1.d[0] = z1.d[1] = Field(1.0);
      Second x(x1), y(z1);
      x.d[0] = y.d[1] = First(Field(1.0));
      const Second theta = angle_by_lagrange(*known_axial_equilibrium(e_value, ring_value, true), e, ring, x, y);
      const auto bend = field.bend(rho, z);
      const double allowed = 1e-10 / (r * r);
      EXPECT_NEAR(bend.theta, plain(theta), 1e-13);
      EXPECT_NEAR(bend.by_rho, plain(theta.d[0]), allowed);
      EXPECT_NEAR(bend.by_z, plain(theta.d[1]), allowed);
      EXPECT_NEAR(bend.by_rho2, plain(theta.d[0].d[0]), allowed);
      EXPECT_NEAR(bend.by_rho_z, plain(theta.d[0].d[1]), allowed);
      EXPECT_NEAR(bend.by_z2, plain(theta.d[1].d[1]), allowed);
      for (std::size_t k = 0; k < (has_ring ? 2u : 1u); ++k) {
        EXPECT_NEAR(bend.by[k], theta.value.value.d[k], allowed);
        EXPECT_NEAR(bend.by_rho_and[k], theta.d[0].value.d[k], allowed);
        EXPECT_NEAR(bend.by_z_and[k], theta.d[1].value.d[k], allowed);
      }
      const auto values = plain_field.bend(rho, z);
      EXPECT_NEAR(values.theta, bend.theta, 1e-13);
      EXPECT_NEAR(values.by_rho, bend.by_rho, allowed);
      EXPECT_NEAR(values.by_z, bend.by_z, allowed);
    }
  }
}

/// Closed forms near the equilibria, of which the tables say how far off they are: tan(theta/2) = tan(v/2) q^1.25 [1 -
/// (1 - exp(-a (1 - r)))(1 - exp(-b z'))] at polar angle v; of a hedgehog q = 1 and z' = z. Of a ring of radius c, z'^2
/// = z^2 + max(0, c - rho)^2 and q is 1 on the sphere and on the equator outside the ring, 0 inside it: the conformal
/// map of the quarter disc.
double closed_form(double rho, double z, double a, double b, double ring) {
  const double r = std::hypot(rho, z), inside = std::max(0.0, ring - rho),
               height = ring > 0 ? std::hypot(z, inside) : z;
  double q = 1;
  if (ring > 0) {
    const std::complex<double> zeta(rho, z), j = -0.5 * (zeta + 1.0 / zeta);
    const double middle = 0.5 * (ring + 1 / ring);
    const auto angle = [](const std::complex<double>& w) { return std::atan2(std::abs(w.imag()), w.real()); };
    q = (angle(j - middle) - angle(j + middle)) / std::numbers::pi;
  }
  return 2 * std::atan(rho / (r + z) * std::pow(q, 1.25) *
                       (1 - (1 - std::exp(-a * (1 - r))) * (1 - std::exp(-b * height))));
}

// Held to three times what the tables' finite elements are off by (4.3e-4 and 7e-4 rad at the worst), and to a
// hundredth for where they were looked at. Below e = 3 closed forms are too near for that to tell.
TEST(AxialDroplet, ClosedFormsAreOffByWhatTheTablesSay) {
  for (const bool rings : {false, true}) {
    const ReferenceTable table(
        data_path(rings ? "physics/droplet_ring_ansatz.csv" : "physics/droplet_hedgehog_ansatz.csv"));
    ASSERT_GT(table.size(), 10u);
    for (std::size_t row = 0; row < table.size(); ++row) {
      const double e = table.number(row, "e"), ring = rings ? table.number(row, "rho_ring") : 0,
                   a = table.number(row, "a"), b = table.number(row, "b");
      if (e < 3) continue;
      const AxialEquilibrium equilibrium = axial_equilibrium(e, ring, kFine);
      double worst = 0;
      const auto look_at = [&](double rho, double z) {
        worst = std::max(worst, std::abs(equilibrium.theta(rho, z) - closed_form(rho, z, a, b, ring)));
      };
      for (double r = 0.0025; r < 1; r += 0.005)
        for (double polar = 0.25; polar < 90; polar += 0.5) {
          const double rho = r * std::sin(polar * kDegree), z = r * std::cos(polar * kDegree);
          if (!rings || std::hypot(rho - ring, z) > 0.02 / e) look_at(rho, z);
        }
      for (double off = 0.02 / e; rings && off < 1 - ring; off *= 1.1)  // from 0.02 coherence lengths on
        for (double turn = 1; turn < 180; turn += 2)
          look_at(ring + off * std::cos(turn * kDegree), off * std::sin(turn * kDegree));
      const double stated = table.number(row, rings ? "max_err_rad_outside_0.02xi" : "max_err_rad");
      EXPECT_NEAR(worst, stated, 0.01 * stated + 3 * (rings ? 7e-4 : 4.3e-4)) << "e " << e << " ring " << ring;
    }
  }
}

// Largest retardance of a straight ray (rad) through an E12 droplet of 9.3 um at 590 nm as the field grows: the figures
// of the prototype, printed with one digit after the point. Its 2.3 at e = 40 is left out: there the largest is at the
// rim, narrower than its grid.
TEST(AxialDroplet, RetardanceFallsWithTheField) {
  for (const auto& [e, expected] : {std::pair{5.0, 9.2}, {10.0, 6.7}, {20.0, 4.7}}) {
    const AxialField<double> field(e, 0.0, false);
    double most = 0;
    for (double b = 0.1; b < 4.6; b += 0.05) {
      const AxialColumn<double> column(field, b, std::sqrt(4.65 * 4.65 - b * b), 4.65, 0.0, 1.0, 1.52 * 1.52,
                                       1.74 * 1.74);
      double sum = 0;
      constexpr int kNodes = 400;
      for (int i = 0; i < kNodes; ++i) {
        const double u[1] = {(i + 0.5) / kNodes};
        OpticalPoint<double> p;
        column.sample(u, &p);
        EXPECT_NEAR(p.axis.x * p.axis.x + p.axis.z * p.axis.z, 1, 1e-12);
        sum += retardance_per_length(p) * p.depth_slope_um / kNodes;
      }
      most = std::max(most, sum * 2 * std::numbers::pi / 0.59);
    }
    EXPECT_NEAR(most, expected, 0.06) << "e " << e;
  }
}

}  // namespace
}  // namespace birefit
