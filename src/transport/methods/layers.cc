#include "transport/methods.h"

namespace birefit {
namespace {

constexpr MethodInfo kMidpoint{"layers_midpoint",
                               2,
                               false,
                               false,
                               "homogeneous layers with the medium of their middle",
                               "Jones, J. Opt. Soc. Am. 38, 671 (1948); interfaces: docs/methods.md"};
constexpr MethodInfo kEdge{"layers_edge",
                           1,
                           false,
                           false,
                           "homogeneous layers with the medium of their upper face",
                           "Steinberg, ACM TOG 39(3) (2020): its brute force"};

void sampled_depths(const Mesh& mesh, double place, std::vector<double>& u) {
  u.resize(mesh.size() - 1);
  for (std::size_t i = 0; i < u.size(); ++i) u[i] = (1 - place) * mesh[i] + place * mesh[i + 1];
}

}  // namespace

template <class S>
LayersMidpoint<S>::LayersMidpoint() : Layers<S>(kMidpoint, 0.5) {}
template <class S>
LayersEdge<S>::LayersEdge() : Layers<S>(kEdge, 0.0) {}

template <class S>
Mat2<S> Layers<S>::transfer(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh) const {
  thread_local std::vector<double> u;
  sampled_depths(mesh, place_, u);
  thread_local std::vector<OpticalPoint<S>> layers;
  layers.resize(u.size());
  column.sample(u, layers.data());
  const double ends[2] = {0.0, 1.0};
  OpticalPoint<S> face[2];
  column.sample(ends, face);
  const bool faces = ray.continuity == Continuity::e_and_h;
  Mat2<S> total = Mat2<S>::identity();
  OpticalPoint<S> before = face[0];
  for (std::size_t i = 0; i <= u.size(); ++i) {
    const OpticalPoint<S>& after = i < u.size() ? layers[i] : face[1];
    const OneWay<Complex<S>> forward = one_way(after, ray.kx, ray.ky);
    if (faces)
      total = step_factor(one_way(before, ray.kx, ray.ky).admittance, one_way(before, ray.kx, ray.ky, -1.0).admittance,
                          forward.admittance) *
              total;
    if (i == u.size()) break;
    const S thickness = after.depth_slope_um * (mesh[i + 1] - mesh[i]);
    total = exp(Complex<S>(S(0.0), ray.k0_per_um * thickness) * forward.index) * total;
    before = after;
  }
  return checked_transfer(info_, total);
}

template <class S>
Su2<S> Layers<S>::retarder(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh) const {
  thread_local std::vector<double> u;
  sampled_depths(mesh, place_, u);
  Su2<S> total = Su2<S>::identity();
  const auto advance = [&](std::size_t i, const Vec3<S>& v) { total = su2_exp(S(mesh[i + 1] - mesh[i]) * v) * total; };
  if (ray.continuity == Continuity::e_and_h && !column.planar) {
    thread_local std::vector<OpticalPoint<Slope<S>>> points;
    points.resize(u.size());
    column.sample_with_slope(u, points.data());
    for (std::size_t i = 0; i < u.size(); ++i) advance(i, su2_generator_e_and_h(points[i], ray.k0_per_um));
  } else {
    thread_local std::vector<OpticalPoint<S>> points;
    points.resize(u.size());
    column.sample(u, points.data());
    for (std::size_t i = 0; i < u.size(); ++i) advance(i, su2_generator(points[i], ray.k0_per_um));
  }
  return total;
}

#define BIREFIT_INSTANTIATE(S)      \
  template class Layers<S>;         \
  template class LayersMidpoint<S>; \
  template class LayersEdge<S>;
BIREFIT_FOR_EACH_SCALAR_OF_TABLES(BIREFIT_INSTANTIATE)

}  // namespace birefit
