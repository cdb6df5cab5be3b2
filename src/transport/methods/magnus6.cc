#include <algorithm>

#include "transport/methods.h"

namespace birefit {
namespace {

constexpr MethodInfo kInfo{"magnus6", 6, false, false, "exponential integrator of order 6, three Gauss nodes a step",
                           "Blanes, Casas, Oteo & Ros, Phys. Rep. 470, 151 (2009)"};
constexpr double kSqrt15 = 3.872983346207417;

/// The three Gauss nodes of every step; the same for every ray of an image.
const std::vector<double>& step_nodes(const Mesh& mesh) {
  thread_local Mesh last;
  thread_local std::vector<double> u;
  if (last == mesh) return u;
  last = mesh;
  u.resize(3 * (mesh.size() - 1));
  for (std::size_t i = 0; i + 1 < mesh.size(); ++i) {
    const double middle = 0.5 * (mesh[i] + mesh[i + 1]), offset = (mesh[i + 1] - mesh[i]) * (kSqrt15 / 10);
    u[3 * i] = middle - offset;
    u[3 * i + 1] = middle;
    u[3 * i + 2] = middle + offset;
  }
  return u;
}

// With generators A1, A2, A3 at the nodes, a1 = h A2, a2 = h sqrt(15)/3 (A3 - A1), a3 = h 10/3 (A3 - 2 A2 + A1):
//   Omega = a1 + a3/12 + [-20 a1 - a3 + C1, a2 + C2]/240,  C1 = [a1, a2],  C2 = -[a1, 2 a3 + C1]/60.
template <class A, class Scale, class Add, class Bracket>
A omega(double h, const A& first, const A& second, const A& third, const Scale& scale, const Add& add, const Bracket& bracket) {
  const A a1 = scale(h, second), a2 = scale(h * kSqrt15 / 3, add(third, scale(-1, first)));
  const A a3 = scale(h * 10 / 3, add(add(third, first), scale(-2, second)));
  const A c1 = bracket(a1, a2), c2 = scale(-1.0 / 60, bracket(a1, add(scale(2, a3), c1)));
  const A left = add(add(scale(-20, a1), scale(-1, a3)), c1);
  return add(add(a1, scale(1.0 / 12, a3)), scale(1.0 / 240, bracket(left, add(a2, c2))));
}

}  // namespace

template <class S>
const MethodInfo& Magnus6<S>::info() const {
  return kInfo;
}

template <class S>
Mat2<S> Magnus6<S>::transfer(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh) const {
  const std::vector<double>& u = step_nodes(mesh);
  thread_local std::vector<Mat2<S>> generator;
  generator.resize(u.size());
  const bool lossless = !column.absorbing;
  if (ray.continuity == Continuity::e_and_h) {
    thread_local std::vector<OpticalPoint<Slope<S>>> points;
    points.resize(u.size());
    column.sample_with_slope(u, points.data());
    for (std::size_t i = 0; i < u.size(); ++i)
      generator[i] = generator_e_and_h(points[i], ray.k0_per_um, ray.kx, ray.ky, lossless);
  } else {
    thread_local std::vector<OpticalPoint<S>> points;
    points.resize(u.size());
    column.sample(u, points.data());
    for (std::size_t i = 0; i < u.size(); ++i)
      generator[i] = generator_e_only(points[i], ray.k0_per_um, ray.kx, ray.ky, lossless);
  }
  Mat2<S> total = Mat2<S>::identity();
  for (std::size_t i = 0; i + 1 < mesh.size(); ++i) {
    const Mat2<S> w = omega(
        mesh[i + 1] - mesh[i], generator[3 * i], generator[3 * i + 1], generator[3 * i + 2],
        [](double f, const Mat2<S>& m) { return S(f) * m; }, [](const Mat2<S>& m, const Mat2<S>& n) { return m + n; },
        [](const Mat2<S>& m, const Mat2<S>& n) { return commutator(m, n); });
    total = exp(w) * total;
    if (column.jumps && ray.continuity == Continuity::e_and_h) total = step_of_medium(column, ray, mesh, i + 1) * total;
  }
  return checked_transfer(kInfo, total);
}

template <class S>
Su2<S> Magnus6<S>::retarder(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh) const {
  const std::vector<double>& u = step_nodes(mesh);
  const bool turning = ray.continuity == Continuity::e_and_h && !column.planar;
  Su2<S> total = Su2<S>::identity();
  OpticalPoint<S> points[3];
  OpticalPoint<Slope<S>> slopes[3];
  for (std::size_t i = 0; i + 1 < mesh.size(); ++i) {
    const std::span<const double> nodes(u.data() + 3 * i, 3);
    Vec3<S> v[3];
    if (turning) {
      column.sample_with_slope(nodes, slopes);
      for (int k = 0; k < 3; ++k) v[k] = su2_generator_e_and_h(slopes[k], ray.k0_per_um);
    } else {
      column.sample(nodes, points);
      for (int k = 0; k < 3; ++k) v[k] = su2_generator(points[k], ray.k0_per_um);
    }
    const Vec3<S> w = omega(
        mesh[i + 1] - mesh[i], v[0], v[1], v[2], [](double f, const Vec3<S>& a) { return S(f) * a; },
        [](const Vec3<S>& a, const Vec3<S>& b) { return a + b; },
        // [i a.s, i b.s] = -2 i (a x b).s
        [](const Vec3<S>& a, const Vec3<S>& b) {
          return S(-2.0) * Vec3<S>{a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
        });
    total = su2_exp(w) * total;
  }
  return total;
}

#define BIREFIT_INSTANTIATE(S) template class Magnus6<S>;
BIREFIT_FOR_EACH_SCALAR_OF_TABLES(BIREFIT_INSTANTIATE)

}  // namespace birefit
