#include "transport/magnus.h"
#include "transport/methods.h"

namespace birefit {
namespace {

constexpr MethodInfo kInfo{"magnus4",
                           4,
                           false,
                           false,
                           "exponential integrator of order 4, two Gauss nodes a step",
                           "Iserles & Norsett, Phil. Trans. R. Soc. A 357 (1999)",
                           false,
                           true};

}  // namespace

template <class S>
const MethodInfo& Magnus4<S>::info() const {
  return kInfo;
}

template <class S>
Mat2<S> Magnus4<S>::transfer(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh) const {
  if constexpr (!kHasTransfer<S>) {
    refuse_transfer_of_tables();
  } else {
    const std::vector<double>& u = magnus_nodes<2>(mesh);
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
      const Mat2<S> a[2] = {generator[2 * i], generator[2 * i + 1]};
      total = exp(magnus_exponent(mesh[i + 1] - mesh[i], a)) * total;
      if (column.jumps && ray.continuity == Continuity::e_and_h)
        total = step_of_medium(column, ray, mesh, i + 1) * total;
    }
    return checked_transfer(kInfo, total);
  }
}

template <class S>
Su2<S> Magnus4<S>::retarder(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh) const {
  const std::vector<double>& u = magnus_nodes<2>(mesh);
  const bool turning = ray.continuity == Continuity::e_and_h && !column.planar;
  RetarderProduct<S> product;
  // Step by step, so that the two samples of a step stay in the nearest cache.
  OpticalPoint<S> points[2];
  OpticalPoint<Slope<S>> slopes[2];
  for (std::size_t i = 0; i + 1 < mesh.size(); ++i) {
    const std::span<const double> nodes(u.data() + 2 * i, 2);
    Vec3<S> v[2];
    if (turning) {
      column.sample_with_slope(nodes, slopes);
      for (int k = 0; k < 2; ++k) v[k] = su2_generator_e_and_h(slopes[k], ray.k0_per_um);
    } else {
      column.sample(nodes, points);
      for (int k = 0; k < 2; ++k) v[k] = su2_generator(points[k], ray.k0_per_um);
    }
    product.multiply(magnus_exponent(mesh[i + 1] - mesh[i], v));
  }
  return product.value();
}

#define BIREFIT_INSTANTIATE(S) template class Magnus4<S>;
BIREFIT_FOR_EACH_SCALAR_OF_TABLES(BIREFIT_INSTANTIATE)

}  // namespace birefit
