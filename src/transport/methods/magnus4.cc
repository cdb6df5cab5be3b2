#include "transport/methods.h"

namespace birefit {
namespace {

constexpr MethodInfo kInfo{"magnus4", 4, false, false, "exponential integrator of order 4, two Gauss nodes a step",
                           "Iserles & Norsett, Phil. Trans. R. Soc. A 357 (1999)"};
constexpr double kSqrt3 = 1.7320508075688772;

/// The nodes of the mesh used last by this thread: every ray of an image asks for the same.
const std::vector<double>& step_nodes(const Mesh& mesh) {
  thread_local Mesh last;
  thread_local std::vector<double> u;
  if (last == mesh) return u;
  last = mesh;
  u.resize(2 * (mesh.size() - 1));
  for (std::size_t i = 0; i + 1 < mesh.size(); ++i) {
    const double middle = 0.5 * (mesh[i] + mesh[i + 1]), offset = (mesh[i + 1] - mesh[i]) * (kSqrt3 / 6);
    u[2 * i] = middle - offset;
    u[2 * i + 1] = middle + offset;
  }
  return u;
}

}  // namespace

template <class S>
const MethodInfo& Magnus4<S>::info() const {
  return kInfo;
}

template <class S>
Mat2<S> Magnus4<S>::transfer(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh) const {
  const std::vector<double>& u = step_nodes(mesh);
  thread_local std::vector<Mat2<S>> generator;
  generator.resize(u.size());
  if (ray.continuity == Continuity::e_and_h) {
    thread_local std::vector<OpticalPoint<Slope<S>>> points;
    points.resize(u.size());
    column.sample_with_slope(u, points.data());
    for (std::size_t i = 0; i < u.size(); ++i)
      generator[i] = generator_e_and_h(points[i], ray.k0_per_um, ray.kx, ray.ky, !column.absorbing);
  } else {
    thread_local std::vector<OpticalPoint<S>> points;
    points.resize(u.size());
    column.sample(u, points.data());
    for (std::size_t i = 0; i < u.size(); ++i)
      generator[i] = generator_e_only(points[i], ray.k0_per_um, ray.kx, ray.ky, !column.absorbing);
  }
  Mat2<S> total = Mat2<S>::identity();
  for (std::size_t i = 0; i + 1 < mesh.size(); ++i) {
    const double h = mesh[i + 1] - mesh[i];
    const Mat2<S>& first = generator[2 * i];
    const Mat2<S>& second = generator[2 * i + 1];
    const Mat2<S> omega = S(0.5 * h) * (first + second) - S(kSqrt3 / 12 * h * h) * commutator(first, second);
    total = exp(omega) * total;
    if (column.jumps && ray.continuity == Continuity::e_and_h) total = step_of_medium(column, ray, mesh, i + 1) * total;
  }
  return checked_transfer(kInfo, total);
}

template <class S>
Su2<S> Magnus4<S>::retarder(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh) const {
  const std::vector<double>& u = step_nodes(mesh);
  const bool turning = ray.continuity == Continuity::e_and_h && !column.planar;
  Su2<S> total = Su2<S>::identity();
  // Step by step, so that the two samples of a step stay in the nearest cache.
  OpticalPoint<S> points[2];
  OpticalPoint<Slope<S>> slopes[2];
  for (std::size_t i = 0; i + 1 < mesh.size(); ++i) {
    const std::span<const double> nodes(u.data() + 2 * i, 2);
    Vec3<S> a, b;
    if (turning) {
      column.sample_with_slope(nodes, slopes);
      a = su2_generator_e_and_h(slopes[0], ray.k0_per_um);
      b = su2_generator_e_and_h(slopes[1], ray.k0_per_um);
    } else {
      column.sample(nodes, points);
      a = su2_generator(points[0], ray.k0_per_um);
      b = su2_generator(points[1], ray.k0_per_um);
    }
    const double h = mesh[i + 1] - mesh[i];
    // [i a.s, i b.s] = -2 i (a x b).s
    const S f = S(kSqrt3 / 6 * h * h), half = S(0.5 * h);
    const Vec3<S> w{half * (a.x + b.x) + f * (a.y * b.z - a.z * b.y), half * (a.y + b.y) + f * (a.z * b.x - a.x * b.z),
                    half * (a.z + b.z) + f * (a.x * b.y - a.y * b.x)};
    total = su2_exp(w) * total;
  }
  return total;
}

#define BIREFIT_INSTANTIATE(S) template class Magnus4<S>;
BIREFIT_FOR_EACH_SCALAR_OF_TABLES(BIREFIT_INSTANTIATE)

}  // namespace birefit
