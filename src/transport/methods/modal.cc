// Transport in the local modes with their coupling, for axes that turn slowly against the phase.
//
// The amplitudes (o, e) obey o' = A o + b1 e, e' = b2 o + B e with A - B = 2 b3 large and imaginary (modes.h). Their
// fast solutions are not needed: the two slow ones,
//   (1, r) e^{int A + b1 r},  r' = b2 - 2 b3 r - b1 r^2,        (s, 1) e^{int B + b2 s},  s' = b1 + 2 b3 s - b2 s^2,
// hold the whole transfer, and r, s vary no faster than the medium. Solving each for its large term,
//   r = (b2 - b1 r^2 - r') / 2 b3,   s = (s' - b1 + b2 s^2) / 2 b3,
// gains one power of 1/(phase between the modes over the length on which the medium changes) a pass; r' comes from the
// polynomial through the nodes (collocation in the sense of Levin, Math. Comp. 38, 531 (1982)).

#include "core/quadrature.h"
#include "transport/methods.h"
#include "transport/modes.h"

namespace birefit {
namespace {

constexpr MethodInfo kInfo{"modal",
                           0,
                           false,
                           false,
                           "phases and slow coupling of the local modes, 8 Gauss nodes a step",
                           "collocation for oscillatory equations: Levin, Math. Comp. 38 (1982)",
                           true};
constexpr int kNodes = 8;

}  // namespace

template <class S>
const MethodInfo& Modal<S>::info() const {
  return kInfo;
}

template <class S, class R>
Complex<R> raised(const Raise<S, R>& raise, const Complex<S>& z) {
  return {raise(z.re), raise(z.im)};
}
template <class S, class R>
Mat2<R> raised(const Raise<S, R>& raise, const Mat2<S>& m) {
  return {raised(raise, m.a), raised(raise, m.b), raised(raise, m.c), raised(raise, m.d)};
}

template <class S, class R>
ModalGenerator<R> generator_at(const OpticalPoint<Slope<S>>& p, const Ray<S>& ray, const R& k0,
                               const Raise<S, R>& raise) {
  const ModalRates<S> rates = modal_rates(p, ray);
  return modal_generator<R>({raised(raise, rates.q_o), raised(raise, rates.q_e), raised(raise, rates.turning)},
                            k0 * raise(p.depth_slope_um.value));
}

/// The phases alone.
template <class S, class R>
ModalTransfer<R> uncoupled(const Column<S>& column, const Ray<S>& ray, const R& k0, const Raise<S, R>& raise,
                           const Mesh& mesh) {
  const GaussNodes& nodes = gauss_nodes(mesh, column.breaks);
  thread_local std::vector<OpticalPoint<Slope<S>>> points;
  points.resize(nodes.u.size());
  column.sample_with_slope(nodes.u, points.data());
  ModalTransfer<R> result;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const ModalGenerator<R> g = generator_at(points[i], ray, k0, raise);
    const R w(nodes.weight[i]);
    result.log_o = result.log_o + w * (g.a + g.b3);
    result.log_e = result.log_e + w * (g.a - g.b3);
  }
  const double faces[2] = {0.0, 1.0};
  OpticalPoint<S> face[2];
  column.sample(faces, face);
  result.first = raised(raise, unit_modes(face[0], ray.kx, ray.ky).fields);
  result.last = raised(raise, unit_modes(face[1], ray.kx, ray.ky).fields);
  return result;
}

template <class S, class R>
ModalTransfer<R> modal_transfer(const Column<S>& column, const Ray<S>& ray, const R& k0, const Raise<S, R>& raise,
                                const Mesh& mesh, int passes) {
  using C = Complex<R>;
  if (passes == 0) return uncoupled(column, ray, k0, raise, mesh);
  thread_local Mesh last_mesh;
  thread_local std::vector<double> u, weight;
  if (last_mesh != mesh) {
    last_mesh = mesh;
    gauss8_nodes(mesh, u, weight);
  }
  const GaussPolynomial& polynomial = gauss8_polynomial();
  thread_local std::vector<OpticalPoint<Slope<S>>> points;
  points.resize(u.size());
  column.sample_with_slope(u, points.data());
  ModalTransfer<R> result;
  C r_start, s_start, r_end, s_end;
  const std::size_t steps = mesh.size() - 1;
  for (std::size_t step = 0; step < steps; ++step) {
    ModalGenerator<R> g[kNodes];
    C r[kNodes], s[kNodes], over[kNodes];
    for (std::size_t i = 0; i < kNodes; ++i) {
      g[i] = generator_at(points[step * kNodes + i], ray, k0, raise);
      over[i] = C(R(0.5)) / g[i].b3;
    }
    const double per_u = 2 / (mesh[step + 1] - mesh[step]);
    for (int pass = 0; pass < passes; ++pass) {
      C r_slope[kNodes], s_slope[kNodes];
      if (pass > 0)
        for (std::size_t i = 0; i < kNodes; ++i)
          for (std::size_t k = 0; k < kNodes; ++k) {
            const double d = per_u * polynomial.derivative[i][k];
            r_slope[i] = {r_slope[i].re + d * r[k].re, r_slope[i].im + d * r[k].im};
            s_slope[i] = {s_slope[i].re + d * s[k].re, s_slope[i].im + d * s[k].im};
          }
      for (std::size_t i = 0; i < kNodes; ++i) {
        r[i] = over[i] * (g[i].b2 - g[i].b1 * (r[i] * r[i]) - r_slope[i]);
        s[i] = over[i] * (s_slope[i] - g[i].b1 + g[i].b2 * (s[i] * s[i]));
      }
    }
    for (std::size_t i = 0; i < kNodes; ++i) {
      const R w(weight[step * kNodes + i]);
      result.log_o = result.log_o + w * (g[i].a + g[i].b3 + g[i].b1 * r[i]);
      result.log_e = result.log_e + w * (g[i].a - g[i].b3 + g[i].b2 * s[i]);
    }
    const auto end = [&](const C* x, const std::array<double, kNodes>& weight) {
      C sum;
      for (std::size_t i = 0; i < kNodes; ++i) sum = {sum.re + weight[i] * x[i].re, sum.im + weight[i] * x[i].im};
      return sum;
    };
    if (step == 0) r_start = end(r, polynomial.at_start), s_start = end(s, polynomial.at_start);
    if (step + 1 == steps) r_end = end(r, polynomial.at_end), s_end = end(s, polynomial.at_end);
  }
  const double faces[2] = {0.0, 1.0};
  OpticalPoint<S> face[2];
  column.sample(faces, face);
  const C one(R(1.0));
  result.first = raised(raise, unit_modes(face[0], ray.kx, ray.ky).fields) * Mat2<R>{one, s_start, r_start, one};
  result.last = raised(raise, unit_modes(face[1], ray.kx, ray.ky).fields) * Mat2<R>{one, s_end, r_end, one};
  return result;
}

template <class S>
Mat2<S> together(const ModalTransfer<S>& m) {
  return m.last * Mat2<S>{exp(m.log_o), Complex<S>(), Complex<S>(), exp(m.log_e)} * inverse(m.first);
}

template <class S>
Mat2<S> Modal<S>::transfer(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh) const {
  if (column.jumps) throw std::logic_error("modal: the medium jumps");
  return checked_transfer(kInfo, together(modal_transfer(column, ray, mesh, passes_)));
}

template <class S>
Su2<S> Modal<S>::retarder(const Column<S>&, const Ray<S>&, const Mesh&) const {
  throw std::logic_error("modal has no retarder");
}

#define BIREFIT_INSTANTIATE(S) \
  template class Modal<S>;     \
  template Mat2<S> together<S>(const ModalTransfer<S>&);
BIREFIT_FOR_EACH_SCALAR_OF_TABLES(BIREFIT_INSTANTIATE)
#define BIREFIT_INSTANTIATE_RAISED(S, R)                                                                        \
  template ModalTransfer<R> modal_transfer<S, R>(const Column<S>&, const Ray<S>&, const R&, const Raise<S, R>&, \
                                                 const Mesh&, int);
BIREFIT_FOR_EACH_RAISE(BIREFIT_INSTANTIATE_RAISED)

}  // namespace birefit
