#pragma once
// Columns that only tests need: tilt and azimuth as simple functions of depth, and their cut into layers.

#include <cmath>
#include <memory>
#include <numbers>

#include "medium/families/planar.h"
#include "medium/families/profile.h"
#include "samples/layers/planar.h"
#include "transport/methods.h"

namespace birefit::testing {

inline constexpr double kDeg = std::numbers::pi / 180;

/// tilt = tilt0 + tilt1 u + bump sin(pi u), azimuth = azimuth0 + azimuth1 u, constant indices.
struct TiltTwistLaw {
  double tilt0, tilt1, bump, azimuth0, azimuth1, n_o, n_e, thickness_um;
  template <class T>
  OpticalPoint<T> at(const T& u) const {
    const T tilt = tilt0 + tilt1 * u + bump * sin(u * std::numbers::pi);
    const T azimuth = azimuth0 + azimuth1 * u;
    return {axis_from_angles<T>(tilt, azimuth), T(n_o * n_o), T(n_e * n_e), T(0.0), T(0.0), T(thickness_um)};
  }
};

/// Fixed axis, n_o = 1.53, n_e = 2.1942 - (278 + 90 u)/750.
struct LinearHeatLaw {
  Vec3<double> axis;
  double thickness_um;
  template <class T>
  OpticalPoint<T> at(const T& u) const {
    const T n_e = 2.1942 - (278.0 + 90.0 * u) * (1.0 / 750);
    return {{T(axis.x), T(axis.y), T(axis.z)}, T(1.53 * 1.53), n_e * n_e, T(0.0), T(0.0), T(thickness_um)};
  }
};

template <class S, class Law>
std::unique_ptr<Column<S>> column_of(Law law) {
  return std::make_unique<LawColumn<S, Law>>(law);
}

/// n equal homogeneous layers with the medium of their middles.
inline std::unique_ptr<Column<double>> layered(const Column<double>& column, int n) {
  std::vector<double> u;
  for (int i = 0; i < n; ++i) u.push_back((i + 0.5) / n);
  std::vector<OpticalPoint<double>> p(u.size());
  column.sample(u, p.data());
  SlabProfile profile;
  profile.interpolation = SlabProfile::Interpolation::constant;
  for (int i = 0; i < n; ++i) {
    const auto& q = p[static_cast<std::size_t>(i)];
    profile.rows.push_back({q.depth_slope_um * (i + 1) / n, q.axis.x, q.axis.y, q.axis.z, std::sqrt(q.ordinary),
                            std::sqrt(q.extraordinary), 0, 0});
  }
  auto table = std::make_shared<const ProfileTable>(profile);
  auto result = std::make_unique<LawColumn<double, ProfileLaw<double>>>(ProfileLaw<double>{table});
  result->jumps = table->jumps();
  result->breaks.assign(table->edges().begin() + 1, table->edges().end() - 1);
  return result;
}

inline PlanarOptics<double> optics_of(std::unique_ptr<Column<double>> column, double wavelength_um, double n_host,
                                      Continuity continuity) {
  PlanarOptics<double> o;
  o.column = std::make_unique<CachedColumn<double>>(std::move(column));
  o.k0 = 2 * std::numbers::pi / wavelength_um;
  o.n_host = n_host;
  o.continuity = continuity;
  return o;
}

/// Complex transmission in the s, p pair of docs/conventions.md; names as there: ps = p in, s out.
struct SpJones {
  std::complex<double> ss, ps, sp, pp;
};
inline SpJones sp_jones(const Mat2<double>& j, double azimuth_rad) {
  const auto z = [](const Complex<double>& c) { return std::complex<double>(c.re, c.im); };
  const std::complex<double> m[2][2] = {{z(j.a), z(j.b)}, {z(j.c), z(j.d)}};
  const double p[2] = {std::cos(azimuth_rad), std::sin(azimuth_rad)}, s[2] = {-p[1], p[0]};
  const auto element = [&](const double* out, const double* in) {
    std::complex<double> sum = 0;
    for (int a = 0; a < 2; ++a)
      for (int b = 0; b < 2; ++b) sum += out[a] * m[a][b] * in[b];
    return sum;
  };
  return {element(s, s), element(s, p), element(p, s), element(p, p)};
}

inline double distance(const Mat2<double>& a, const Mat2<double>& b) {
  const Mat2<double> d = a - b;
  return std::sqrt(norm(d.a) + norm(d.b) + norm(d.c) + norm(d.d));
}
inline double size(const Mat2<double>& a) { return distance(a, Mat2<double>{}); }

}  // namespace birefit::testing
