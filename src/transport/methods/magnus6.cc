#include "transport/magnus.h"
#include "transport/methods.h"

namespace birefit {
namespace {

constexpr MethodInfo kInfo{"magnus6",
                           6,
                           false,
                           false,
                           "exponential integrator of order 6, three Gauss nodes a step",
                           "Blanes, Casas, Oteo & Ros, Phys. Rep. 470, 151 (2009)",
                           false,
                           true};

}  // namespace

template <class S>
const MethodInfo& Magnus6<S>::info() const {
  return kInfo;
}

template <class S>
Mat2<S> Magnus6<S>::transfer(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh) const {
  if constexpr (!kHasTransfer<S>) {
    refuse_transfer_of_tables();
  } else {
    const std::vector<double>& u = magnus_nodes<3>(mesh);
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
      const Mat2<S> a[3] = {generator[3 * i], generator[3 * i + 1], generator[3 * i + 2]};
      total = exp(magnus_exponent(mesh[i + 1] - mesh[i], a)) * total;
      if (column.jumps && ray.continuity == Continuity::e_and_h)
        total = step_of_medium(column, ray, mesh, i + 1) * total;
    }
    return checked_transfer(kInfo, total);
  }
}

template <class S>
Su2<S> Magnus6<S>::retarder(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh) const {
  const std::vector<double>& u = magnus_nodes<3>(mesh);
  const bool turning = ray.continuity == Continuity::e_and_h && !column.planar;
  RetarderProduct<S> product;
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
    product.multiply(magnus_exponent(mesh[i + 1] - mesh[i], v));
  }
  return product.value();
}

#define BIREFIT_INSTANTIATE(S) template class Magnus6<S>;
BIREFIT_FOR_EACH_SCALAR_OF_TABLES(BIREFIT_INSTANTIATE)

}  // namespace birefit
