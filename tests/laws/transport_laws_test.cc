// Laws every transport method must obey. A method in methods.def is tested here without a line added.

#include <gtest/gtest.h>

#include <complex>
#include <map>
#include <random>

#include <Eigen/Dense>

#include "medium/families/planar.h"
#include "profiles.h"
#include "reference_table.h"
#include "transport/methods.h"

namespace birefit {
namespace {
using namespace testing;
using M = Mat2<double>;

constexpr Continuity kContinuities[] = {Continuity::e_and_h, Continuity::e_only};

/// The same law with the axis turned over.
template <class Law>
struct Flipped {
  Law law;
  template <class T>
  OpticalPoint<T> at(const T& u) const {
    OpticalPoint<T> p = law.at(u);
    p.axis = {-p.axis.x, -p.axis.y, -p.axis.z};
    return p;
  }
};
/// The column from the other side: z to -z turns the axis into (ax, ay, -az).
template <class Law>
struct Reversed {
  Law law;
  template <class T>
  OpticalPoint<T> at(const T& u) const {
    OpticalPoint<T> p = law.at(T(1.0 - u));
    p.axis.z = -p.axis.z;
    return p;
  }
};
/// Part [from, to] of a column.
template <class Law>
struct Part {
  Law law;
  double from, to;
  template <class T>
  OpticalPoint<T> at(const T& u) const {
    OpticalPoint<T> p = law.at(T(from + (to - from) * u));
    p.depth_slope_um = p.depth_slope_um * (to - from);
    return p;
  }
};

// What every method can do: the axis in a fixed plane through z, light along z. What only coupled ones can: the rest.
const TiltTwistLaw kPlanar{10 * kDeg, 50 * kDeg, 20 * kDeg, 35 * kDeg, 0, 1.52, 1.74, 6};
const TiltTwistLaw kCoupled{10 * kDeg, 50 * kDeg, 20 * kDeg, 35 * kDeg, 80 * kDeg, 1.52, 1.74, 6};
const TiltTwistLaw kIsotropic{10 * kDeg, 50 * kDeg, 20 * kDeg, 35 * kDeg, 80 * kDeg, 1.52, 1.52, 6};

Ray<double> normal_ray(Continuity c) { return {2 * std::numbers::pi / 0.59, 0, 0, c}; }
Ray<double> oblique_ray(Continuity c) { return {2 * std::numbers::pi / 0.59, 0.35, -0.2, c}; }
bool coupled(const TransportMethod<double>& m) { return !m.info().needs_planar; }
bool is_layers(const TransportMethod<double>& m) { return std::string(m.info().name).starts_with("layers"); }
std::string label(const TransportMethod<double>& m, Continuity c) {
  return std::string(m.info().name) + (c == Continuity::e_only ? " e_only" : " e_and_h");
}
template <class Body>
void for_each_method(const Body& body) {
  for (const TransportMethod<double>* method : transport_methods<double>()) {
    if (method->info().reflections) continue;  // no one-way transfer; its laws are in berreman_test.cc
    if (method->info().slow_axes) continue;    // modal_test.cc
    for (const Continuity c : kContinuities) {
      SCOPED_TRACE(label(*method, c));
      body(*method, c);
    }
  }
}
M without_common_phase(const M& m) {
  const std::complex<double> det = [&] {
    const Complex<double> d = determinant(m);
    return std::complex<double>(d.re, d.im);
  }();
  const std::complex<double> f = 1.0 / std::sqrt(det / std::abs(det));
  return Complex<double>(f.real(), f.imag()) * m;
}
/// Distance up to a common phase (both square roots of the determinant's phase are tried).
double phase_free_distance(const M& a, const M& b) {
  const M x = without_common_phase(a), y = without_common_phase(b);
  return std::min(distance(x, y), distance(x, Complex<double>(-1.0) * y));
}

// Called directly, with steps of up to 1e5 rad: an answer that a passive medium can give, or a refusal.
TEST(TransportLaws, AnswersAreFiniteOrRefused) {
  std::map<std::string, int> refused, answered;
  for_each_method([&](const auto& method, Continuity c) {
    for (double thickness_um : {1.0, 100.0, 1e4, 1e5})
      for (const int steps : {1, 4, 16, 64}) {
        TiltTwistLaw law = kCoupled;
        law.thickness_um = thickness_um;
        const LawColumn<double, TiltTwistLaw> column(law);
        try {
          EXPECT_LT(size(method.transfer(column, oblique_ray(c), uniform_mesh(steps))), 1e6)
              << thickness_um << " um, " << steps << " steps";
          ++answered[method.info().name];
        } catch (const std::domain_error& error) {
          EXPECT_NE(std::string(error.what()).find(method.info().name), std::string::npos);
          ++refused[method.info().name];
        }
      }
    // Total reflection of both waves: real arithmetic has no answer, complex arithmetic an evanescent one.
    const LawColumn<double, TiltTwistLaw> column(kCoupled);
    try {
      EXPECT_LT(size(method.transfer(column, {10, 1.8, 0, c}, uniform_mesh(16))), 1e6);
    } catch (const std::domain_error&) {
    }
  });
  // Commutators of a step grow with powers of its phase; layers and a phase integral do not have them.
  EXPECT_GT(refused["magnus6"], 0);
  EXPECT_GT(answered["magnus6"], 0);
  EXPECT_EQ(refused["layers_midpoint"], 0);
}
TEST(TransportLaws, AHomogeneousMediumTakesAnyStep) {
  for_each_method([](const auto& method, Continuity c) {
    const LawColumn<double, TiltTwistLaw> column(TiltTwistLaw{0.3, 0, 0, 0.7, 0, 1.52, 1.74, 1e4});
    // 1.7e5 rad of phase, known to 4e-11.
    EXPECT_LT(distance(method.transfer(column, oblique_ray(c), uniform_mesh(1)),
                       method.transfer(column, oblique_ray(c), uniform_mesh(64))),
              1e-9);
  });
}
// The mesh that adapts starts from steps that its method refuses.
TEST(TransportLaws, AdaptedMeshesFindTheirWayFromStepsFarTooLong) {
  TiltTwistLaw law = kCoupled;
  law.thickness_um = 3000;
  const LawColumn<double, TiltTwistLaw> column(law);
  for (const Continuity c : kContinuities) {
    double estimate = 0;
    const Mesh mesh = adapted_mesh(column, oblique_ray(c), 1e-4, &estimate);
    EXPECT_LT(estimate, 1e-4);
    const M exact = Magnus6<double>().transfer(column, oblique_ray(c), uniform_mesh(32768));
    EXPECT_LT(distance(Magnus4<double>().transfer(column, oblique_ray(c), mesh), exact), 1e-4);
  }
}

TEST(TransportLaws, NothingHappensWithoutBirefringence) {
  for_each_method([](const auto& method, Continuity c) {
    TiltTwistLaw law = kIsotropic;
    if (!coupled(method)) law.azimuth1 = 0;  // an axis that turns is not its column, seen or not
    const LawColumn<double, TiltTwistLaw> column(law);
    const Ray<double> ray = normal_ray(c);
    // 60 rad of phase in up to 1,000 products: 1e-12.
    EXPECT_LT(phase_free_distance(method.transfer(column, ray, uniform_mesh(64)), M::identity()), 1e-12);
    const Su2<double> r = method.retarder(column, ray, uniform_mesh(64));
    EXPECT_NEAR(std::abs(r.w), 1, 1e-13);
    if (!coupled(method)) return;
    EXPECT_LT(phase_free_distance(method.transfer(column, oblique_ray(c), uniform_mesh(64)), M::identity()), 1e-12);
  });
}

TEST(TransportLaws, PartsOfAColumnCompose) {
  for_each_method([](const auto& method, Continuity c) {
    const auto check = [&](const TiltTwistLaw& law, const Ray<double>& ray) {
      const LawColumn<double, TiltTwistLaw> whole(law);
      const LawColumn<double, Part<TiltTwistLaw>> first({law, 0, 0.375}), second({law, 0.375, 1});
      // The same steps in both: 3/8 and 5/8 of 64.
      const M all = method.transfer(whole, ray, uniform_mesh(64));
      const M parts = method.transfer(second, ray, uniform_mesh(40)) * method.transfer(first, ray, uniform_mesh(24));
      // Layers with E and H continuous meet one face more where the parts meet, of height 1/n.
      const bool extra_face = is_layers(method) && c == Continuity::e_and_h;
      EXPECT_LT(distance(all, parts), extra_face ? 1e-3 : 1e-11);
    };
    check(kPlanar, normal_ray(c));
    if (coupled(method)) check(kCoupled, oblique_ray(c));
  });
}

TEST(TransportLaws, LosslessRetardersAreUnitary) {
  for_each_method([](const auto& method, Continuity c) {
    const LawColumn<double, TiltTwistLaw> column(coupled(method) ? kCoupled : kPlanar);
    const M u = matrix(method.retarder(column, normal_ray(c), uniform_mesh(64)));
    const M adjoint{conj(u.a), conj(u.c), conj(u.b), conj(u.d)};
    EXPECT_LT(distance(u * adjoint, M::identity()), 1e-12);
  });
}

TEST(TransportLaws, AxisAndItsOppositeAreTheSameMedium) {  // C17
  for_each_method([](const auto& method, Continuity c) {
    const auto check = [&](const TiltTwistLaw& law, const Ray<double>& ray) {
      const LawColumn<double, TiltTwistLaw> column(law);
      const LawColumn<double, Flipped<TiltTwistLaw>> flipped({law});
      EXPECT_LT(
          distance(method.transfer(column, ray, uniform_mesh(32)), method.transfer(flipped, ray, uniform_mesh(32))),
          1e-12);
    };
    check(kPlanar, normal_ray(c));
    if (coupled(method)) check(kCoupled, oblique_ray(c));
  });
}

// Normal incidence: light sent back through the column meets the transpose (on the flux-normalised field, in axes that
// do not turn with the light). The common phase aside, so as retarders.
TEST(TransportLaws, LightSentBackMeetsTheTranspose) {
  for_each_method([](const auto& method, Continuity c) {
    if (c == Continuity::e_only && coupled(method)) return;  // E alone conserves no flux, so it knows no reciprocity
    if (std::string(method.info().name) == "layers_edge") return;  // samples one face: other layers on the way back
    const TiltTwistLaw law = coupled(method) ? kCoupled : kPlanar;
    const LawColumn<double, TiltTwistLaw> column(law);
    const LawColumn<double, Reversed<TiltTwistLaw>> back({law});
    const M there = matrix(method.retarder(column, normal_ray(c), uniform_mesh(64)));
    const M here = matrix(method.retarder(back, normal_ray(c), uniform_mesh(64)));
    EXPECT_LT(distance(here, M{there.a, there.c, there.b, there.d}), 1e-12);
  });
}

double measured_order(const TransportMethod<double>& method, const Ray<double>& ray, int n) {
  const LawColumn<double, TiltTwistLaw> column(kCoupled);
  const M exact = Magnus4<double>().transfer(column, ray, uniform_mesh(4096));
  const double coarse = distance(method.transfer(column, ray, uniform_mesh(n)), exact);
  const double fine = distance(method.transfer(column, ray, uniform_mesh(2 * n)), exact);
  return std::log2(coarse / fine);
}

TEST(TransportLaws, MeasuredOrderIsTheDeclaredOne) {
  for_each_method([](const auto& method, Continuity c) {
    if (method.info().order == 0) return;                       // spectral
    if (is_layers(method) && c == Continuity::e_and_h) return;  // their own fact below
    // 128 steps of order 6 already reach rounding.
    EXPECT_NEAR(measured_order(method, oblique_ray(c), method.info().order > 4 ? 24 : 128), method.info().order, 0.25);
  });
}
// Dropping the backward wave at n faces of height ~ 1/n leaves an error ~ n (1/n)^2.
TEST(TransportLaws, LayersWithEAndHContinuousConvergeAtFirstOrder) {
  const double order =
      measured_order(transport_method<double>("layers_midpoint"), oblique_ray(Continuity::e_and_h), 8192);
  // The 1/n^2 of the layers' middles is as large as the 1/n of the faces at 1,024 layers (1.4 there), an eighth at
  // 8,192.
  EXPECT_GT(order, 0.8);
  EXPECT_LT(order, 1.3);
}

// a = N^(1/2) E_t at normal incidence; N is symmetric there and its root is (N + sqrt(det) I)/sqrt(trace + 2
// sqrt(det)).
TEST(TransportLaws, RetarderIsTheFluxNormalisedTransfer) {
  const LawColumn<double, TiltTwistLaw> column(kCoupled);
  const auto root = [&](double u) {
    OpticalPoint<double> p;
    const double at[1] = {u};
    column.sample(at, &p);
    const M n = one_way(p, 0.0, 0.0).index;
    const double s = std::sqrt(determinant(n).re), t = std::sqrt(n.a.re + n.d.re + 2 * s);
    return Complex<double>(1 / t) * (n + Complex<double>(s) * M::identity());
  };
  for (const Continuity c : kContinuities) {
    const Ray<double> ray = normal_ray(c);
    const Magnus4<double> method;
    const M transfer = method.transfer(column, ray, uniform_mesh(1024));
    const M retarder = matrix(method.retarder(column, ray, uniform_mesh(1024)));
    const M expected = c == Continuity::e_and_h ? root(1) * transfer * inverse(root(0)) : transfer;
    // 1,024 steps leave 1e-10; the series of the coupling 1e-8 of a coupling of 1e-2.
    EXPECT_LT(phase_free_distance(expected, retarder), 2e-9) << (c == Continuity::e_only ? "e_only" : "e_and_h");
  }
}

// ---- the closed operator against Berreman's matrix ------------------------------------------------------------------

using C = std::complex<double>;
/// d/dz (Ex, Ey, Hx, Hy) = i k0 D (..), from Maxwell: k x E = H, k x H = -eps E with the z components eliminated.
Eigen::Matrix4cd berreman(C eo, C ee, const Eigen::Vector3d& a, double kx, double ky) {
  const Eigen::Matrix3cd eps = eo * Eigen::Matrix3cd::Identity() + (ee - eo) * (a * a.transpose()).cast<C>();
  // E_z = -(ex E_x + ey E_y + kx H_y - ky H_x)/ezz, H_z = kx E_y - ky E_x
  const C ezz = eps(2, 2);
  Eigen::RowVector4cd ez, hz;
  ez << -eps(2, 0) / ezz, -eps(2, 1) / ezz, ky / ezz, -kx / ezz;
  hz << -ky, kx, 0, 0;
  Eigen::Matrix4cd d = Eigen::Matrix4cd::Zero();
  // q E_x = H_y + kx E_z;  q E_y = -H_x + ky E_z;  q H_x = -D_y + kx H_z;  q H_y = D_x + ky H_z
  d.row(0) = kx * ez;
  d(0, 3) += 1.0;
  d.row(1) = ky * ez;
  d(1, 2) -= 1.0;
  d.row(2) = kx * hz - eps(1, 2) * ez;
  d(2, 0) -= eps(1, 0);
  d(2, 1) -= eps(1, 1);
  d.row(3) = ky * hz + eps(0, 2) * ez;
  d(3, 0) += eps(0, 0);
  d(3, 1) += eps(0, 1);
  return d;
}

// The two forward normal components of uniaxial plates, from the quartic equation (tests/data/physics/README.md): the
// eigenvalues of N.
TEST(OneWayOperator, HasTheNormalComponentsOfTheQuartic) {
  const testing::ReferenceTable table(testing::data_path("physics/plate_wavevectors.csv"));
  const testing::ReferenceTable tensors(testing::data_path("physics/plate_tensors.csv"));
  /// eo of a uniaxial case, and ee = trace - 2 eo.
  const auto medium = [&](const std::string& name, double eo, const Vec3<double>& axis) {
    std::size_t row = 0;
    while (tensors.text(row, "case") != name) ++row;
    return OpticalPoint<double>{
        axis, eo,  tensors.number(row, "exx") + tensors.number(row, "eyy") + tensors.number(row, "ezz") - 2 * eo,
        0.0,  0.0, 1.0};
  };
  const double a = 1 / std::sqrt(8.0), c = std::sqrt(3.0) / 2;
  const OpticalPoint<double> e44 = medium("E44_278K_axisA", 1.53 * 1.53, {-a, a, -c}),
                             calcite = medium("calcite_c_axis", 1.6584 * 1.6584, {0, 0, 1});
  int compared = 0;
  for (std::size_t row = 0; row < table.size(); ++row) {
    const std::string name = table.text(row, "case");
    if (name != "E44_278K_axisA" && name != "calcite_c_axis") continue;  // biaxial
    const OpticalPoint<double>& p = name == "calcite_c_axis" ? calcite : e44;
    const double angle = table.number(row, "theta_inc_deg") * std::numbers::pi / 180,
                 azimuth = table.number(row, "azimuth_deg") * std::numbers::pi / 180;
    const Matrix2<double> n =
        one_way_lossless(p, std::sin(angle) * std::cos(azimuth), std::sin(angle) * std::sin(azimuth)).index;
    const double half = 0.5 * (n.a + n.d),
                 root = std::sqrt(std::max(0.25 * (n.a - n.d) * (n.a - n.d) + n.b * n.c, 0.0));
    // at double roots, along the axis, theirs are good to 1e-7; tensors have 12 digits
    const double tolerance = root < 1e-6 ? 3e-7 : 1e-11;
    EXPECT_NEAR(half - root, table.number(row, "q_small"), tolerance) << name << " " << angle << " " << azimuth;
    EXPECT_NEAR(half + root, table.number(row, "q_large"), tolerance) << name << " " << angle << " " << azimuth;
    ++compared;
  }
  EXPECT_GT(compared, 50);
}

TEST(OneWayOperator, IntertwinesWithBerremanInRandomMedia) {
  std::mt19937_64 random(20260705);
  std::uniform_real_distribution<double> unit(0, 1);
  std::normal_distribution<double> gauss;
  double worst = 0;
  for (int i = 0; i < 2000; ++i) {
    const double n_o = 1.3 + 0.7 * unit(random), n_e = 1.3 + 0.7 * unit(random);  // both signs of birefringence
    const double k_o = i % 3 == 0 ? 0.3 * unit(random) : 0, k_e = i % 3 == 0 ? 0.3 * unit(random) : 0;
    const double kappa = 1.1 * unit(random), azimuth = 2 * M_PI * unit(random);
    const double kx = kappa * std::cos(azimuth), ky = kappa * std::sin(azimuth);
    Eigen::Vector3d a(gauss(random), gauss(random), gauss(random));
    if (i % 4 == 0)  // axis within 1e-6 of the ordinary wavevector
      a = Eigen::Vector3d(kx, ky, std::sqrt(n_o * n_o - kappa * kappa)).normalized() +
          5e-7 * Eigen::Vector3d(gauss(random), gauss(random), gauss(random)) * unit(random);
    a.normalize();
    const C eo = C(n_o, k_o) * C(n_o, k_o), ee = C(n_e, k_e) * C(n_e, k_e);
    const OpticalPoint<double> p{{a.x(), a.y(), a.z()}, eo.real(), ee.real(), eo.imag(), ee.imag(), 1};
    const Eigen::Matrix4cd d = berreman(eo, ee, a, kx, ky);
    for (const double direction : {1.0, -1.0}) {
      const auto w = one_way(p, kx, ky, direction);
      const auto z = [](const Complex<double>& c) { return C(c.re, c.im); };
      Eigen::Matrix2cd n, y;
      n << z(w.index.a), z(w.index.b), z(w.index.c), z(w.index.d);
      y << z(w.admittance.a), z(w.admittance.b), z(w.admittance.c), z(w.admittance.d);
      Eigen::Matrix<C, 4, 2> iy;
      iy << Eigen::Matrix2cd::Identity(), y;
      const double error = (d * iy - iy * n).norm();
      worst = std::max(worst, error);
      ASSERT_LT(error, 1e-12) << "medium " << i << " direction " << direction;
      // Forward waves travel or decay towards +z.
      const std::complex<double> mean = 0.5 * n.trace(), apart = std::sqrt(mean * mean - n.determinant());
      for (const std::complex<double> q : {mean + apart, mean - apart})
        ASSERT_GT(direction * (q.real() + q.imag()), 0) << "medium " << i;
    }
  }
  RecordProperty("worst", std::to_string(worst));
}

}  // namespace
}  // namespace birefit
