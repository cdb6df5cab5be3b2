#include "transport/method.h"

#include <algorithm>
#include <stdexcept>

namespace birefit {

void refuse_transfer(const MethodInfo& info) {
  throw std::domain_error(std::string(info.name) +
                          ": no passive medium does this: steps too long for the method, total reflection inside, or "
                          "modes where there are none");
}

template <class S>
Mat2<S> entry_factor(const Column<S>& column, const Ray<S>& ray, const S& host_index) {
  if (ray.continuity == Continuity::e_only) return Mat2<S>::identity();
  const double start[1] = {0.0};
  OpticalPoint<S> p;
  column.sample(start, &p);
  const Complex<S> eps(host_index * host_index);
  const Complex<S> q = sqrt(eps - Complex<S>(ray.kx * ray.kx + ray.ky * ray.ky));
  const Mat2<S> outside = isotropic_admittance(eps, q, ray.kx, ray.ky);
  return S(2.0) * (inverse(outside + one_way(p, ray.kx, ray.ky).admittance) * outside);
}

template <class S>
Mat2<S> exit_factor(const Column<S>& column, const Ray<S>& ray, const S& host_index) {
  if (ray.continuity == Continuity::e_only) return Mat2<S>::identity();
  const double end[1] = {1.0};
  OpticalPoint<S> p;
  column.sample(end, &p);
  const Complex<S> eps(host_index * host_index);
  const Complex<S> q = sqrt(eps - Complex<S>(ray.kx * ray.kx + ray.ky * ray.ky));
  return step_factor(one_way(p, ray.kx, ray.ky).admittance, one_way(p, ray.kx, ray.ky, -1.0).admittance,
                     isotropic_admittance(eps, q, ray.kx, ray.ky));
}

template <class S>
Mat2<S> step_of_medium(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh, std::size_t node) {
  if (!column.jumps || node == 0 || node + 1 >= mesh.size() ||
      !std::binary_search(column.breaks.begin(), column.breaks.end(), mesh[node]))
    return Mat2<S>::identity();
  // A hair to either side, and never across the next node: a sub-layer may be thinner than a hair.
  const double hair = std::min({1e-12, 0.5 * (mesh[node] - mesh[node - 1]), 0.5 * (mesh[node + 1] - mesh[node])});
  const double sides[2] = {mesh[node] - hair, mesh[node] + hair};
  OpticalPoint<S> p[2];
  column.sample(sides, p);
  return step_factor(one_way(p[0], ray.kx, ray.ky).admittance, one_way(p[0], ray.kx, ray.ky, -1.0).admittance,
                     one_way(p[1], ray.kx, ray.ky).admittance);
}

template <class S>
FaceFactors<S> lossless_faces(const Column<S>& column, const Ray<S>& ray, const S& host_index) {
  const double ends[2] = {0.0, 1.0};
  OpticalPoint<S> p[2];
  column.sample(ends, p);
  const S eps = host_index * host_index;
  const Matrix2<S> outside =
      isotropic_admittance<S>(eps, sqrt(eps - ray.kx * ray.kx - ray.ky * ray.ky), ray.kx, ray.ky);
  return {inverse(outside + one_way_lossless(p[0], ray.kx, ray.ky).admittance) * (S(2.0) * outside),
          step_factor(one_way_lossless(p[1], ray.kx, ray.ky).admittance,
                      one_way_lossless(p[1], ray.kx, ray.ky, -1.0).admittance, outside)};
}

template <class S>
Mat2<S> TransportMethod<S>::transmission(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh,
                                         const S& host_index) const {
  const Mat2<S> inside = transfer(column, ray, mesh);
  if (!column.absorbing && ray.continuity == Continuity::e_and_h) {
    const FaceFactors<S> faces = lossless_faces(column, ray, host_index);
    return faces.exit * (inside * faces.entry);
  }
  return exit_factor(column, ray, host_index) * inside * entry_factor(column, ray, host_index);
}

#define BIREFIT_INSTANTIATE(S)                                                                   \
  template Mat2<S> entry_factor<S>(const Column<S>&, const Ray<S>&, const S&);                   \
  template Mat2<S> exit_factor<S>(const Column<S>&, const Ray<S>&, const S&);                    \
  template Mat2<S> step_of_medium<S>(const Column<S>&, const Ray<S>&, const Mesh&, std::size_t); \
  template FaceFactors<S> lossless_faces<S>(const Column<S>&, const Ray<S>&, const S&);          \
  template class TransportMethod<S>;
BIREFIT_FOR_EACH_SCALAR_OF_TABLES(BIREFIT_INSTANTIATE)

}  // namespace birefit
