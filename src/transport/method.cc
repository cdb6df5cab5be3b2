#include "transport/method.h"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "transport/methods.h"

namespace birefit {

template <class S>
std::span<const TransportMethod<S>* const> transport_methods() {
#define BIREFIT_METHOD(Method) static const Method<S> instance_##Method;
#include "transport/methods.def"
#undef BIREFIT_METHOD
  static const TransportMethod<S>* const list[] = {
#define BIREFIT_METHOD(Method) &instance_##Method,
#include "transport/methods.def"
#undef BIREFIT_METHOD
  };
  return list;
}

template <class S>
const TransportMethod<S>& transport_method(const std::string& name) {
  for (const TransportMethod<S>* method : transport_methods<S>())
    if (name == method->info().name) return *method;
  throw std::logic_error("no transport method named " + name);
}

const std::vector<std::string>& transport_method_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> list;
    for (const auto* method : transport_methods<double>()) list.emplace_back(method->info().name);
    return list;
  }();
  return names;
}

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
  template std::span<const TransportMethod<S>* const> transport_methods<S>();                    \
  template const TransportMethod<S>& transport_method<S>(const std::string&);                    \
  template Mat2<S> entry_factor<S>(const Column<S>&, const Ray<S>&, const S&);                   \
  template Mat2<S> exit_factor<S>(const Column<S>&, const Ray<S>&, const S&);                    \
  template Mat2<S> step_of_medium<S>(const Column<S>&, const Ray<S>&, const Mesh&, std::size_t); \
  template FaceFactors<S> lossless_faces<S>(const Column<S>&, const Ray<S>&, const S&);          \
  template class TransportMethod<S>;
BIREFIT_FOR_EACH_SCALAR_OF_TABLES(BIREFIT_INSTANTIATE)

Mesh uniform_mesh(int steps, const std::vector<double>& breaks) {
  std::vector<double> edges{0.0};
  for (double b : breaks)
    if (b > 0 && b < 1) edges.push_back(b);
  edges.push_back(1.0);
  Mesh mesh{0.0};
  for (std::size_t i = 0; i + 1 < edges.size(); ++i) {
    const double width = edges[i + 1] - edges[i];
    const int n = std::max(1, static_cast<int>(std::lround(steps * width)));
    for (int k = 1; k < n; ++k) mesh.push_back(edges[i] + width * k / n);
    mesh.push_back(edges[i + 1]);
  }
  return mesh;
}

Mesh adapted_mesh(const Column<double>& column, const Ray<double>& ray, double tolerance, double* error_estimate,
                  int max_steps) {
  const Magnus4<double> method;
  // Inner steps of the medium are exact and belong to the nodes, not to a step's error.
  struct Piece final : Column<double> {
    const Column<double>& whole;
    explicit Piece(const Column<double>& c) : whole(c) {}
    void sample(std::span<const double> u, OpticalPoint<double>* out) const override { whole.sample(u, out); }
    void sample_with_slope(std::span<const double> u, OpticalPoint<Slope<double>>* out) const override {
      whole.sample_with_slope(u, out);
    }
  } piece(column);
  constexpr double kNever = std::numeric_limits<double>::infinity();
  const auto step = [&](double from, double to) { return method.transfer(piece, ray, {from, to}); };
  const auto change = [&](double from, double middle, double to) {
    try {
      const Mat2<double> d = step(middle, to) * step(from, middle) - step(from, to);
      return std::sqrt(norm(d.a) + norm(d.b) + norm(d.c) + norm(d.d));
    } catch (const std::domain_error&) {  // far too long a step
      return kNever;
    }
  };
  const Mesh start = uniform_mesh(4, column.breaks);
  Mesh mesh{0.0};
  double total = 0;
  // Depth-first, left to right: `open` holds right ends still to be reached.
  std::vector<double> open(start.rbegin(), start.rend() - 1);
  while (!open.empty()) {
    const double from = mesh.back(), to = open.back(), middle = 0.5 * (from + to);
    const double error = change(from, middle, to);
    const bool exhausted = static_cast<int>(mesh.size() + open.size()) >= max_steps || to - from < 1e-9;
    // A step that cannot get better (rounding) is accepted too.
    if (error <= tolerance * (to - from) || error < 4e-15 || exhausted) {
      mesh.push_back(to);
      open.pop_back();
      total += error;
    } else {
      open.push_back(middle);
    }
  }
  if (error_estimate) *error_estimate = total;
  return mesh;
}

}  // namespace birefit
