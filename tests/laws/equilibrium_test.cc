// The director of cells in a field: against tables of an independent quadrature and collocation (tests/data/physics),
// closed forms with Boost's elliptic functions, thresholds, order and derivatives.

#include <gtest/gtest.h>

#include <algorithm>
#include <boost/math/special_functions.hpp>
#include <numbers>

#include "medium/families/freedericksz.h"
#include "medium/families/helix.h"
#include "reference_table.h"

namespace birefit {
namespace {
using namespace testing;
constexpr double kPi = std::numbers::pi, kDeg = kPi / 180;

/// A nodal profile at any depth.
double at(const DirectorMesh& mesh, const std::vector<double>& nodes, double u) {
  const int e = mesh.element_at(u);
  const double x = (u - mesh.middle(e)) * 2 / mesh.width(e);
  double sum = 0;
  for (int power = mesh.degree(); power >= 0; --power) {
    double c = 0;
    for (int j = 0; j <= mesh.degree(); ++j)
      c += mesh.monomial(power, j) * nodes[static_cast<std::size_t>(e * mesh.degree() + j)];
    sum = sum * x + c;
  }
  return sum;
}
double tilt_at(const DirectorSolution& s, double u) { return at(cell_mesh(), s.tilt, u); }
double azimuth_at(const DirectorSolution& s, double u) { return at(cell_mesh(), s.azimuth, u); }

CellForces<double> one_constant(double v) {
  CellForces<double> p;
  p.drive = kPi * kPi * v * v;
  return p;
}
CellForces<double> e7(double v, double pretilt_deg = 0) {
  CellForces<double> p = one_constant(v);
  p.k33 = 17.1 / 11.1;
  p.k22 = 6.5 / 11.1;
  p.gamma = 19.28 / 5.21 - 1;
  p.tilt_entry = p.tilt_exit = pretilt_deg * kDeg;
  return p;
}
CellForces<double> five_cb(double v) {
  CellForces<double> p = one_constant(v);
  p.k33 = 8.2 / 6.4;
  p.gamma = 18.5 / 7.0 - 1;
  return p;
}
CellForces<double> twisted_e7(double v, double pretilt_deg = 2) {
  CellForces<double> p = e7(v, pretilt_deg);
  p.twisted = true;
  p.twist = kPi / 2;
  return p;
}
CellForces<double> case_of(const std::string& name, double v) {
  return name.starts_with("one") ? one_constant(v) : name.starts_with("E7") ? e7(v) : five_cb(v);
}

/// Integral over the depth of (index seen at normal incidence - n_o) / (n_e - n_o).
double retardance_ratio(const DirectorSolution& s, double n_o, double n_e) {
  const DirectorMesh& mesh = cell_mesh();
  double sum = 0;
  for (int e = 0; e < mesh.elements(); ++e)
    for (int k = 0; k <= mesh.degree(); ++k) {
      const double t = s.tilt[static_cast<std::size_t>(e * mesh.degree() + k)], c = std::cos(t), sn = std::sin(t);
      sum +=
          0.5 * mesh.width(e) * mesh.weight(k) * (n_o * n_e / std::sqrt(n_e * n_e * sn * sn + n_o * n_o * c * c) - n_o);
    }
  return sum / (n_e - n_o);
}

// ---- tables of an independent computation --------------------------------------------------------------------------

// Printed to 12 decimals (m), 9 to 10 digits (1 - m, slope) and 9 decimals (retardance). Deuling's integrals against
// this boundary-value solver; its own error, from a mesh twice as fine, stays below 6e-9 rad up to five times the
// threshold: in the middle, where the slope of m = sin^2 t vanishes as the director saturates, below 1e-11 in m.
TEST(Equilibrium, PlanarCellsAgreeWithDeulingsIntegrals) {
  const ReferenceTable table(data_path("physics/freedericksz_planar.csv"));
  for (std::size_t row = 0; row < table.size(); ++row) {
    const std::string name = table.text(row, "case");
    const double v = table.number(row, "V_over_Vth");
    const CellForces<double> p = case_of(name, v);
    const DirectorSolution s = solve_director(p);
    const double t = tilt_at(s, 0.5), m = std::sin(t) * std::sin(t);
    EXPECT_NEAR(m, table.number(row, "sin2_thetam"), 1.1e-11) << name << " " << v;
    const double rest = table.number(row, "one_minus_sin2_thetam");
    EXPECT_NEAR(std::cos(t) * std::cos(t), rest, 1e-11 + 5e-8 * rest) << name << " " << v;
    EXPECT_NEAR(retardance_ratio(s, 1.522, 1.739), table.number(row, "retardance_ratio_no1.522_ne1.739"), 1.1e-9)
        << name << " " << v;
    // d m / d v from the implicit-function theorem.
    CellForces<Dual<double, 1>> d{p.k33,        p.k22,       p.gamma, p.drive, p.chirality,
                                  p.tilt_entry, p.tilt_exit, p.twist, false};
    d.drive.d[0] = 2 * kPi * kPi * v;
    std::vector<std::array<double, 1>> tilt, azimuth;
    director_tangents<1>(d, cell_mesh(), s, tilt, azimuth);
    std::vector<double> slope;
    for (const auto& x : tilt) slope.push_back(x[0]);
    const double expected = table.number(row, "dsin2_dV");
    // The table's slope is a difference: at v = 1.001 of the E7-like case Deuling's integral, differentiated with 30
    // digits, gives 0.9439682906, this solver the same, the table 0.943968310.
    EXPECT_NEAR(std::sin(2 * t) * at(cell_mesh(), slope, 0.5), expected, 3e-8 * std::abs(expected) + 2e-9)
        << name << " " << v;
  }
}

TEST(Equilibrium, PlanarProfilesAgree) {
  const ReferenceTable table(data_path("physics/freedericksz_planar_profiles.csv"));
  for (std::size_t row = 0; row < table.size(); ++row) {
    const std::string name = table.text(row, "case");
    const double v = table.number(row, "V_over_Vth");
    // 9 decimals; the solver's own error above.
    EXPECT_NEAR(tilt_at(solve_director(case_of(name, v)), table.number(row, "y_over_d")),
                table.number(row, "theta_rad"), 6e-9)
        << name << " " << v;
  }
}

// Printed to 8 decimals by a collocation solver of 1e-9.
TEST(Equilibrium, PretiltedCellsAgreeOnBothSidesOfTheThreshold) {
  const ReferenceTable table(data_path("physics/freedericksz_pretilt.csv"));
  for (std::size_t row = 0; row < table.size(); ++row) {
    const double v = table.number(row, "V_over_Vth"), pretilt = table.number(row, "pretilt_deg");
    EXPECT_NEAR(tilt_at(solve_director(e7(v, pretilt)), 0.5), table.number(row, "theta_mid_rad"), 1.2e-8)
        << pretilt << " " << v;
  }
}

// Printed to 8 decimals by a collocation solver whose residual is 1e-7.
TEST(Equilibrium, TwistedNematicProfilesAgree) {
  const ReferenceTable table(data_path("physics/tn_profiles.csv"));
  double v = -1;
  DirectorSolution s;
  for (std::size_t row = 0; row < table.size(); ++row) {
    if (table.number(row, "V_over_VF") != v) s = solve_director(twisted_e7(v = table.number(row, "V_over_VF")));
    const double u = table.number(row, "y_over_d"), tolerance = std::max(3 * table.number(row, "bvp_rms_resid"), 1e-8);
    EXPECT_NEAR(tilt_at(s, u), table.number(row, "theta_rad"), tolerance) << v << " " << u;
    EXPECT_NEAR(azimuth_at(s, u), table.number(row, "phi_rad"), tolerance) << v << " " << u;
  }
}

// Between faces alike half of a cell is solved for; where they differ by next to nothing all of it.
TEST(Equilibrium, HalfOfACellTellsTheWhole) {
  for (const bool twisted : {false, true})
    for (const double v : {0.9, 1.3, 4.0}) {
      const CellForces<double> same = twisted ? twisted_e7(v) : e7(v, 2);
      CellForces<double> nearly = same;
      nearly.tilt_exit += 1e-15;
      const DirectorSolution half = solve_director(same), whole = solve_director(nearly);
      ASSERT_EQ(half.tilt.size(), whole.tilt.size());
      ASSERT_EQ(half.azimuth.size(), whole.azimuth.size());
      const auto tangents_of = [](const CellForces<double>& p, const DirectorSolution& s) {
        CellForces<Dual<double, 1>> d{p.k33,        p.k22,       p.gamma, p.drive,  p.chirality,
                                      p.tilt_entry, p.tilt_exit, p.twist, p.twisted};
        d.drive.d[0] = 1, d.tilt_entry.d[0] = d.tilt_exit.d[0] = 0.3, d.twist.d[0] = 0.2;
        std::pair<std::vector<std::array<double, 1>>, std::vector<std::array<double, 1>>> slopes;
        director_tangents<1>(d, cell_mesh(), s, slopes.first, slopes.second);
        return slopes;
      };
      const auto of_half = tangents_of(same, half), of_whole = tangents_of(nearly, whole);
      // Steps end at 1e-11, and slopes are theirs over the weakest restoring force, a few per cent.
      for (std::size_t i = 0; i < half.tilt.size(); ++i) {
        EXPECT_NEAR(half.tilt[i], whole.tilt[i], 1e-10) << v;
        EXPECT_NEAR(of_half.first[i][0], of_whole.first[i][0], 1e-8) << v;
      }
      for (std::size_t i = 0; i < half.azimuth.size(); ++i) {
        EXPECT_NEAR(half.azimuth[i], whole.azimuth[i], 1e-9) << v;
        EXPECT_NEAR(of_half.second[i][0], of_whole.second[i][0], 1e-7) << v;
      }
    }
}

TEST(Equilibrium, HybridCellsAgree) {
  const ReferenceTable table(data_path("physics/han.csv"));
  for (std::size_t row = 0; row < table.size(); ++row) {
    CellForces<double> p =
        table.text(row, "case").starts_with("one") ? one_constant(table.number(row, "V_over_Vth_planar")) : e7(0);
    p.tilt_exit = kPi / 2;
    // 10 decimals
    EXPECT_NEAR(tilt_at(solve_director(p), table.number(row, "y_over_d")), table.number(row, "theta_rad"), 1.5e-10)
        << table.text(row, "case");
  }
}

// ---- closed forms --------------------------------------------------------------------------------------------------

// One constant, uniform field: sin t = sqrt(m) sn(2 K zeta), v = 2 K / pi.
TEST(Equilibrium, OneConstantIsTheEllipticSine) {
  for (double k : {0.1, 0.6, 0.9, 0.99}) {
    const double quarter = boost::math::ellint_1(k);
    const DirectorSolution s = solve_director(one_constant(2 / kPi * quarter));
    for (double zeta : {0.03, 0.2, 0.5, 0.77}) {
      double cn, dn;
      const double sn = boost::math::jacobi_elliptic(k, 2 * quarter * zeta, &cn, &dn);
      EXPECT_NEAR(std::sin(tilt_at(s, zeta)), k * sn, 1e-12) << k;
    }
  }
}

// Below the threshold nothing moves without a pretilt; linear in the pretilt otherwise, t = tp cos(pi v (zeta - 1/2)) /
// cos(pi v / 2), the cubic term being of order (6e-6)^2 / (1 - v).
TEST(Equilibrium, BelowTheThresholdTheResponseIsLinearInThePretilt) {
  EXPECT_EQ(tilt_at(solve_director(e7(0.99)), 0.5), 0.0);
  for (double v : {0.3, 0.9}) {
    const double pretilt_deg = 1e-6 / kDeg;
    for (double zeta : {0.1, 0.5})
      EXPECT_NEAR(tilt_at(solve_director(e7(v, pretilt_deg)), zeta) / 1e-6,
                  std::cos(kPi * v * (zeta - 0.5)) / std::cos(kPi * v / 2), 1e-8);
  }
}

// A homeotropic cell is a planar one with bend for splay and both permittivities exchanged, measured from the normal.
TEST(Equilibrium, HomeotropicCellsMirrorPlanarOnes) {
  const CellForces<double> planar = e7(1.4, 1);
  CellForces<double> p;
  p.k33 = 1 / planar.k33;
  p.gamma = 1 / (1 + planar.gamma) - 1;
  p.drive = -planar.drive * p.k33;
  p.tilt_entry = p.tilt_exit = kPi / 2 - planar.tilt_entry;
  const DirectorSolution a = solve_director(planar), b = solve_director(p);
  for (double u : {0.05, 0.3, 0.5}) EXPECT_NEAR(tilt_at(a, u), kPi / 2 - tilt_at(b, u), 1e-11);
}

// Leslie's threshold: eps0 deps Vth^2 / K11 = pi^2 + (k33 - 2 k22) Phi^2 + 4 pi k22 (d/p) Phi. Just above it m grows
// from zero in proportion to the excess; from two voltages a straight line finds it, its curvature leaving 1e-7.
TEST(Equilibrium, TwistedCellsHaveLesliesThreshold) {
  for (double pitch_ratio : {0.0, 0.1, -0.05}) {
    const auto m_at = [&](double drive) {
      CellForces<double> p = twisted_e7(0, 0);
      p.chirality = 2 * kPi * pitch_ratio;
      p.drive = drive;
      return std::pow(std::sin(tilt_at(solve_director(p), 0.5)), 2);
    };
    const CellForces<double> e = twisted_e7(0, 0);
    const double threshold =
        kPi * kPi + (e.k33 - 2 * e.k22) * e.twist * e.twist + 4 * kPi * e.k22 * pitch_ratio * e.twist;
    EXPECT_LT(m_at(threshold * (1 - 1e-4)), 1e-16);
    const double h = 1e-4 * threshold, near = m_at(threshold + h), far = m_at(threshold + 2 * h);
    EXPECT_NEAR(threshold + h - near * h / (far - near), threshold, 1e-7 * threshold) << pitch_ratio;
  }
}

// Without field and pretilt the azimuth is a straight line, whatever the pitch: the faces hold it.
TEST(Equilibrium, WithoutFieldATwistIsUniform) {
  CellForces<double> p = twisted_e7(0, 0);
  p.chirality = 1.3;
  const DirectorSolution s = solve_director(p);
  for (double u : {0.1, 0.63}) EXPECT_NEAR(azimuth_at(s, u), u * p.twist, 1e-13);
}

// The displacement and torques balance: the first integrals of the equations are the same at every depth.
TEST(Equilibrium, FirstIntegralOfTheTwistIsConstant) {
  CellForces<double> p = twisted_e7(2.2);
  p.chirality = 0.4;
  const DirectorSolution s = solve_director(p);
  double low = 1e9, high = -1e9;
  for (int i = 0; i < 97; ++i) {
    const double u = 0.02 + 0.01 * i, h = 1e-5;
    const double rate = (azimuth_at(s, u + h) - azimuth_at(s, u - h)) / (2 * h),
                 c2 = std::pow(std::cos(tilt_at(s, u)), 2);
    const double torque = c2 * (p.k22 * c2 + p.k33 * (1 - c2)) * rate - p.k22 * p.chirality * c2;
    low = std::min(low, torque);
    high = std::max(high, torque);
  }
  EXPECT_LT(high - low, 1e-6);  // of differences: h^2 times the third derivative
}

// The state found is the one of least energy, tilted like the pretilt, also where the opposite tilt is metastable.
TEST(Equilibrium, TiltsTheWayThePretiltPoints) {
  for (double v : {0.9, 1.02, 1.5, 4.0}) {
    const double up = tilt_at(solve_director(e7(v, 0.5)), 0.5), down = tilt_at(solve_director(e7(v, -0.5)), 0.5);
    EXPECT_GT(up, 0.5 * kDeg) << v;
    EXPECT_NEAR(up, -down, 1e-10) << v;
  }
}

// ---- the discretisation --------------------------------------------------------------------------------------------

TEST(Equilibrium, ErrorOfTheProfileFallsWithTheDeclaredOrder) {
  for (int degree : {3, 4}) {
    const CellForces<double> p = twisted_e7(1.6);
    const DirectorSolution exact = solve_director(p);
    const auto error = [&](int elements) {
      const DirectorMesh mesh(elements, degree);
      const DirectorSolution s = solve_director(p, mesh);
      double worst = 0;
      for (int i = 0; i <= 400; ++i)
        worst = std::max(worst, std::abs(at(mesh, s.tilt, i / 400.0) - tilt_at(exact, i / 400.0)));
      return worst;
    };
    // Of the least order observed over two halvings: 0.3 for what is not yet asymptotic.
    const double a = error(24), b = error(48), c = error(96);
    EXPECT_GT(std::log2(a / b), degree + 1 - 0.3) << degree;
    EXPECT_GT(std::log2(b / c), degree + 1 - 0.3) << degree;
  }
}

// The figures that equilibrium.h states of the mesh all cells use, against one of twice as many elements and higher
// degree.
TEST(Equilibrium, MeshOfAllCellsHoldsItsStatedError) {
  const DirectorMesh fine(32, 12);
  for (const auto& [v, most] : {std::pair{3.0, 1e-9}, {10.0, 1e-7}, {20.0, 1e-6}, {50.0, 1e-4}}) {
    const DirectorSolution s = solve_director(e7(v, 1)), exact = solve_director(e7(v, 1), fine);
    double worst = 0;
    for (int i = 0; i <= 2000; ++i)
      worst = std::max(worst, std::abs(tilt_at(s, i / 2000.0) - at(fine, exact.tilt, i / 2000.0)));
    EXPECT_LT(worst, most) << v;
  }
}

// ---- derivatives ---------------------------------------------------------------------------------------------------

// Every number of the forces, by Richardson's differences of the solution itself (1e-8 with steps of 1e-4).
TEST(Equilibrium, TangentsAgreeWithDifferences) {
  for (double v : {0.7, 0.99, 1.01, 1.3, 2.5}) {
    CellForces<double> p = twisted_e7(v);
    p.chirality = 0.3;
    p.tilt_exit = 3 * kDeg;
    const DirectorSolution s = solve_director(p);
    for (int which = 0; which < 8; ++which) {
      const auto member = [&](auto& forces) -> auto& {
        using F = std::remove_reference_t<decltype(forces)>;
        (void)sizeof(F);
        return *std::array{
            &forces.k33,       &forces.k22,        &forces.gamma,     &forces.drive,
            &forces.chirality, &forces.tilt_entry, &forces.tilt_exit, &forces.twist}[static_cast<std::size_t>(which)];
      };
      CellForces<Dual<double, 1>> d{p.k33,        p.k22,       p.gamma, p.drive, p.chirality,
                                    p.tilt_entry, p.tilt_exit, p.twist, true};
      member(d).d[0] = 1;
      std::vector<std::array<double, 1>> tilt, azimuth;
      director_tangents<1>(d, cell_mesh(), s, tilt, azimuth);
      const double h = 2e-4;
      const auto moved = [&](double step) {
        CellForces<double> q = p;
        member(q) += step;
        return solve_director(q);
      };
      const DirectorSolution a = moved(h), b = moved(-h), a2 = moved(h / 2), b2 = moved(-h / 2);
      double size = 0, error = 0;
      for (std::size_t i = 0; i < tilt.size(); ++i) {
        const auto slope = [&](const auto& x, const auto& y, const auto& x2, const auto& y2) {
          return (8 * (x2[i] - y2[i]) - (x[i] - y[i])) / (6 * h);
        };
        const double by_tilt = slope(a.tilt, b.tilt, a2.tilt, b2.tilt),
                     by_azimuth = slope(a.azimuth, b.azimuth, a2.azimuth, b2.azimuth);
        size = std::max({size, std::abs(by_tilt), std::abs(by_azimuth)});
        error = std::max({error, std::abs(by_tilt - tilt[i][0]), std::abs(by_azimuth - azimuth[i][0])});
      }
      EXPECT_LT(error, 1e-6 * size + 1e-9) << "v " << v << " number " << which;
    }
  }
}

// ---- optics of the profile -----------------------------------------------------------------------------------------

// Without pretilt the retardance has a kink at the threshold: flat below, falling above with the slope of the amplitude
// equation, d(G/G0)/dv = -n_e (n_e + n_o) / (2 n_o^2) * 2 / (1 + k + g), k = k33 - 1.
TEST(Equilibrium, RetardanceHasAKinkAtTheThreshold) {
  const double n_o = 1.522, n_e = 1.739, g = retardance_ratio(solve_director(e7(1 - 1e-6)), n_o, n_e);
  EXPECT_NEAR(g, 1, 1e-14);
  const CellForces<double> p = e7(1);
  const double slope = -n_e * (n_e + n_o) / (n_o * n_o) / (p.k33 + p.gamma), h = 1e-4;
  // The next term is of order h.
  EXPECT_NEAR((retardance_ratio(solve_director(e7(1 + h)), n_o, n_e) - 1) / h, slope, 1e-3 * std::abs(slope));
}

// ---- the unwound helix ---------------------------------------------------------------------------------------------

TEST(Helix, PitchGrowsAsTheFieldUnwindsIt) {
  const ReferenceTable table(data_path("physics/cholesteric_unwinding.csv"));
  for (std::size_t row = 0; row < table.size(); ++row) {
    const double k = table.number(row, "modulus_k"), pitch = 2, thickness = 1;
    const CompleteElliptic<double> elliptic = complete_elliptic(k);
    EXPECT_NEAR(k / elliptic.second, table.number(row, "E_over_Ec"), 6e-10);
    const UnwoundHelixLaw<double> law(pitch, 0.3, k, 2.3, 3.0, thickness);
    // A full turn takes p/p0 pitches: the printed ratio, nine decimals, gives the azimuth of a whole turn back to them.
    const auto azimuth = [&](double u) {
      const auto n = law.at(u).axis;
      return std::atan2(n.y, n.x);
    };
    const double turn = table.number(row, "p_over_p0") * pitch / thickness;
    EXPECT_NEAR(azimuth(turn), 0.3, 1e-8) << k;
    EXPECT_NEAR(azimuth(0.25 * turn), 0.3 + kPi / 2, 1e-8 * table.number(row, "p_over_p0") / std::sqrt(1 - k)) << k;
  }
}

TEST(Helix, AzimuthIsJacobisAmplitude) {
  for (double k : {0.0, 1e-8, 0.3, 0.9, 0.9999, 1 - 1e-6})
    for (double u : {0.02, 0.37, 0.9}) {
      const UnwoundHelixLaw<double> law(2.0, 0.1, k, 2.3, 3.0, 5.0);
      double cn, dn;
      const double sn = boost::math::jacobi_elliptic(k, kPi * kPi * 2.5 * u / boost::math::ellint_2(k), &cn, &dn);
      const auto n = law.at(u).axis;
      EXPECT_NEAR(n.x, std::cos(0.1) * cn - std::sin(0.1) * sn, 1e-11) << k;
      EXPECT_NEAR(n.y, std::cos(0.1) * sn + std::sin(0.1) * cn, 1e-11) << k;
    }
}

}  // namespace
}  // namespace birefit
