#include <cmath>
#include <stdexcept>

#include "transport/methods.h"
#include "transport/scattering.h"

namespace birefit {
namespace {

constexpr MethodInfo kInfo{"berreman",
                           4,
                           false,
                           true,
                           "4 x 4 transfer with all reflections, as scattering matrices",
                           "Berreman, J. Opt. Soc. Am. 62, 502 (1972); Redheffer, J. Math. Phys. 41, 1 (1962)"};
constexpr double kSqrt3 = 1.7320508075688772;

template <class S>
Scattering<S> whole_stack(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh, const S& host_index) {
  const S eps = host_index * host_index;
  const Matrix2<S> host = isotropic_admittance<S>(eps, sqrt(eps - ray.kx * ray.kx - ray.ky * ray.ky), ray.kx, ray.ky);
  thread_local std::vector<OpticalPoint<S>> points;
  points.resize(2);
  Scattering<S> total = Scattering<S>::nothing();
  for (std::size_t i = 0; i + 1 < mesh.size(); ++i) {
    const double h = mesh[i + 1] - mesh[i], middle = 0.5 * (mesh[i] + mesh[i + 1]), offset = h * (kSqrt3 / 6);
    const double u[2] = {middle - offset, middle + offset};
    column.sample(u, points.data());
    const auto a = berreman_generator(points[0], ray.k0_per_um, ray.kx, ray.ky);
    const auto b = berreman_generator(points[1], ray.k0_per_um, ray.kx, ray.ky);
    // Omega = h/2 (A1 + A2) - sqrt(3)/12 h^2 [A1, A2], as in magnus4.
    auto omega = scaled(S(0.5 * h), a + b);
    omega = omega + scaled(S(-kSqrt3 / 12 * h * h), a * b - b * a);
    total = joined(total, scattering_of_exponential(omega, host));
  }
  return total;
}

}  // namespace

template <class S>
const MethodInfo& Berreman<S>::info() const {
  return kInfo;
}
template <class S>
Mat2<S> Berreman<S>::transfer(const Column<S>&, const Ray<S>&, const Mesh&) const {
  throw std::logic_error("berreman has no one-way transfer");
}
template <class S>
Su2<S> Berreman<S>::retarder(const Column<S>&, const Ray<S>&, const Mesh&) const {
  throw std::logic_error("berreman has no one-way transfer");
}
template <class S>
Mat2<S> Berreman<S>::transmission(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh,
                                  const S& host_index) const {
  return whole_stack(column, ray, mesh, host_index).forward;
}
template <class S>
Mat2<S> Berreman<S>::reflection(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh,
                                const S& host_index) const {
  return whole_stack(column, ray, mesh, host_index).front;
}

#define BIREFIT_INSTANTIATE(S) template class Berreman<S>;
BIREFIT_FOR_EACH_SCALAR_OF_TABLES(BIREFIT_INSTANTIATE)

}  // namespace birefit
