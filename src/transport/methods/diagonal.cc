#include "core/quadrature.h"
#include "transport/methods.h"
#include "transport/modes.h"

namespace birefit {
namespace {

constexpr MethodInfo kInfo{"diagonal",
                           0,
                           true,
                           false,
                           "one phase integral per local mode, Gauss nodes as many as steps, flux factors",
                           "Born & Wolf 15; flux factors: docs/methods.md"};

template <class S>
void normal_components(const OpticalPoint<S>& p, const S& kx, const S& ky, S& q_o, S& q_e) {
  const S eo = p.ordinary, de = p.extraordinary - eo;
  const S ak = p.axis.x * kx + p.axis.y * ky, kk = kx * kx + ky * ky;
  const S A = eo + de * p.axis.z * p.axis.z, B = de * p.axis.z * ak;
  const S C = eo * kk + de * ak * ak - eo * p.extraordinary;
  q_o = sqrt(eo - kk);
  q_e = (sqrt(B * B - A * C) - B) / A;
}
/// Tangential fields of both modes as columns, scaled to unit flux; H = w x E (over k0): S_z = (E x H)_z with
/// E_o = a x w_o and E_e = eo a - (a.w_e) w_e, H_e = eo w_e x a.
template <class S>
Mat2<S> flux_modes(const OpticalPoint<S>& p, const S& kx, const S& ky) {
  S q_o, q_e;
  normal_components(p, kx, ky, q_o, q_e);
  const auto cross = [](const Vec3<S>& a, const Vec3<S>& b) {
    return Vec3<S>{a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
  };
  const Vec3<S> wo{kx, ky, q_o}, we{kx, ky, q_e};
  const Vec3<S> eo = cross(p.axis, wo), ho = cross(wo, eo);
  const S aw = dot(p.axis, we);
  const Vec3<S> ee = p.ordinary * p.axis + (S(0.0) - aw) * we, he = cross(we, ee);
  const S fo = 1.0 / sqrt(eo.x * ho.y - eo.y * ho.x), fe = 1.0 / sqrt(ee.x * he.y - ee.y * he.x);
  return {fo * eo.x, fe * ee.x, fo * eo.y, fe * ee.y};
}

}  // namespace

template <class S>
const MethodInfo& Diagonal<S>::info() const {
  return kInfo;
}

// With E and H continuous, flux-normalised modes of a lossless medium couple antisymmetrically, with zero diagonal:
// nothing but the two phases is left between the faces.
template <class S, class R>
ModalTransfer<R> diagonal_transfer(const Column<S>& column, const Ray<S>& ray, const R& k0, const Raise<S, R>& raise,
                                   const Mesh& mesh) {
  if (column.absorbing || ray.continuity != Continuity::e_and_h) return modal_transfer(column, ray, k0, raise, mesh, 0);
  const GaussNodes& nodes = gauss_nodes(mesh, column.breaks);
  const std::vector<double>&u = nodes.u, &weight = nodes.weight;
  thread_local std::vector<OpticalPoint<S>> points;
  points.resize(u.size());
  column.sample(u, points.data());
  S phase_o(0.0), phase_e(0.0);
  for (std::size_t i = 0; i < u.size(); ++i) {
    S q_o, q_e;
    normal_components(points[i], ray.kx, ray.ky, q_o, q_e);
    const S path = points[i].depth_slope_um * weight[i];
    phase_o = phase_o + path * q_o;
    phase_e = phase_e + path * q_e;
  }
  const double ends[2] = {0.0, 1.0};
  OpticalPoint<S> face[2];
  column.sample(ends, face);
  const auto modes_at = [&](const OpticalPoint<S>& p) -> Mat2<R> {
    const Mat2<S> m = flux_modes(p, ray.kx, ray.ky);
    return {raise(m.a.re), raise(m.b.re), raise(m.c.re), raise(m.d.re)};
  };
  return {modes_at(face[0]), modes_at(face[1]), Complex<R>(R(0.0), k0 * raise(phase_o)),
          Complex<R>(R(0.0), k0 * raise(phase_e))};
}

template <class S>
Mat2<S> Diagonal<S>::transfer(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh) const {
  return checked_transfer(kInfo, together(diagonal_transfer(column, ray, mesh)));
}

template <class S>
Su2<S> Diagonal<S>::retarder(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh) const {
  const GaussNodes& nodes = gauss_nodes(mesh, column.breaks);
  const std::vector<double>&u = nodes.u, &weight = nodes.weight;
  thread_local std::vector<OpticalPoint<S>> points;
  points.resize(u.size());
  column.sample(u, points.data());
  // Generators of a planar column commute: the integral is the whole answer, and nothing needs the axis' azimuth.
  Vec3<S> v{S(0.0), S(0.0), S(0.0)};
  for (std::size_t i = 0; i < u.size(); ++i) v = v + S(weight[i]) * su2_generator(points[i], ray.k0_per_um);
  return su2_exp(v);
}

#define BIREFIT_INSTANTIATE(S) template class Diagonal<S>;
BIREFIT_FOR_EACH_SCALAR_OF_TABLES(BIREFIT_INSTANTIATE)
#define BIREFIT_INSTANTIATE_RAISED(S, R)                                                                           \
  template ModalTransfer<R> diagonal_transfer<S, R>(const Column<S>&, const Ray<S>&, const R&, const Raise<S, R>&, \
                                                    const Mesh&);
BIREFIT_FOR_EACH_RAISE(BIREFIT_INSTANTIATE_RAISED)

}  // namespace birefit
