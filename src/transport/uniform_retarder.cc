// Retarders of a medium with the same permittivities everywhere, whose derivatives by permittivities need no other
// sample.

#include "transport/magnus.h"

namespace birefit {
namespace {

template <class P>
struct Constants {
  P half_k0, eo, ee, de, n_o, product, n_product;  ///< k0 / 2, eo de, n_o n_e
  explicit Constants(const UniformMedium<P>& m)
      : half_k0(0.5 * m.k0),
        eo(m.ordinary),
        ee(m.extraordinary),
        de(ee - eo),
        n_o(root(eo)),
        product(eo * de),
        n_product(n_o * root(ee)) {}
};

/// su2_generator() and su2_generator_e_and_h() (one_way.h), `cross` = a_t x a_t' (0: of the first), with the
/// derivatives of WithMedium.
template <class V, class S>
BIREFIT_INLINE Vec3<V> generator(const Vec3<S>& a, const S& cross, const S& depth_slope, const Constants<PlainOf<S>>& m,
                                 bool turning) {
  using P = PlainOf<S>;
  const S z = a.z * a.z, over_root = inverse_root(S(m.eo + m.de * z)), over = over_root * over_root;
  const S n_eff = m.n_product * over_root, inverse_sum = inverse(S(n_eff + m.n_o));
  const S g = m.product * (over * inverse_sum), reach = m.half_k0 * depth_slope, half = reach * g;
  const S first = 2.0 * (a.x * a.y), third = a.x * a.x - a.y * a.y;
  S turn(0.0);
  [[maybe_unused]] P turn_by_x(0.0), x_plain(0.0);
  if (turning) {
    const S at2 = a.x * a.x + a.y * a.y, x = g * inverse_sum, y = square(x * at2);
    const S series = 0.5 * (1.0 + y * (0.75 + y * (0.625 + y * (0.546875 + y * (0.4921875 + y * 0.451171875)))));
    const S across = at2 * cross;
    turn = (x * x * series) * across;
    if constexpr (!std::is_same_v<V, S>) {
      const P q = plain(y), slope = 0.5 * (0.75 + q * (1.25 + q * (1.640625 + q * (1.96875 + q * 2.255859375))));
      x_plain = plain(x);
      turn_by_x = 2.0 * x_plain * (plain(series) + q * slope) * plain(across);
    }
  }
  const Vec3<S> v{half * first, turn, half * third};
  if constexpr (std::is_same_v<V, S>) {
    return v;
  } else {
    constexpr std::size_t n = static_cast<std::size_t>(ScalarTraits<S>::derivatives);
    Vec3<V> r{V(plain(v.x)), V(plain(v.y)), V(plain(v.z))};
    if constexpr (n > 0)
      for (std::size_t j = 0; j < n; ++j) r.x.d[j] = v.x.d[j], r.y.d[j] = v.y.d[j], r.z.d[j] = v.z.d[j];
    const P one(1.0), pz = plain(z), po = plain(over), pn = plain(n_eff), ps = plain(inverse_sum), pg = plain(g),
                      pr = plain(reach);
    for (std::size_t j = 0; j < 2; ++j) {
      const bool ordinary = j == 0;
      const P by = (ordinary ? one - pz : pz) * po;  // of the logarithm of the denominator
      const P sum = 0.5 * pn * (inverse(ordinary ? m.eo : m.ee) - by) + (ordinary ? P(0.5) * inverse(m.n_o) : P(0.0));
      const P dg = (ordinary ? m.de - m.eo : m.eo) * po * ps - pg * (by + sum * ps), dhalf = pr * dg;
      r.x.d[n + j] = dhalf * plain(first);
      r.y.d[n + j] = turn_by_x * ps * (dg - x_plain * sum);
      r.z.d[n + j] = dhalf * plain(third);
    }
    return r;
  }
}

template <int Nodes, class V, class S>
Su2<V> retarder(const Column<S>& column, Continuity continuity, const UniformMedium<PlainOf<S>>& medium,
                const Mesh& mesh) {
  const std::vector<double>& u = magnus_nodes<Nodes>(mesh);
  const bool turning = continuity == Continuity::e_and_h && !column.planar;
  const Constants<PlainOf<S>> constants(medium);
  RetarderProduct<V> product;
  OpticalPoint<S> points[Nodes];
  OpticalPoint<Slope<S>> slopes[Nodes];
  for (std::size_t i = 0; i + 1 < mesh.size(); ++i) {
    const std::span<const double> nodes(u.data() + Nodes * i, Nodes);
    Vec3<V> v[Nodes];
    if (turning) {
      column.sample_with_slope(nodes, slopes);
      for (int k = 0; k < Nodes; ++k) {
        const Vec3<Slope<S>>& a = slopes[k].axis;
        v[k] = generator<V, S>({a.x.value, a.y.value, a.z.value}, a.x.value * a.y.d[0] - a.y.value * a.x.d[0],
                               slopes[k].depth_slope_um.value, constants, true);
      }
    } else {
      column.sample(nodes, points);
      for (int k = 0; k < Nodes; ++k)
        v[k] = generator<V, S>(points[k].axis, S(0.0), points[k].depth_slope_um, constants, false);
    }
    product.multiply(magnus_exponent(mesh[i + 1] - mesh[i], v));
  }
  return product.value();
}

}  // namespace

template <class V, class S>
Su2<V> magnus_retarder(int order, const Column<S>& column, Continuity continuity,
                       const UniformMedium<PlainOf<S>>& medium, const Mesh& mesh) {
  return order == 4 ? retarder<2, V>(column, continuity, medium, mesh)
                    : retarder<3, V>(column, continuity, medium, mesh);
}

#define BIREFIT_INSTANTIATE(S)                                                                               \
  template Su2<S> magnus_retarder<S, S>(int, const Column<S>&, Continuity, const UniformMedium<PlainOf<S>>&, \
                                        const Mesh&);                                                        \
  template Su2<WithMedium<S>> magnus_retarder<WithMedium<S>, S>(int, const Column<S>&, Continuity,           \
                                                                const UniformMedium<PlainOf<S>>&, const Mesh&);
BIREFIT_FOR_EACH_SCALAR(BIREFIT_INSTANTIATE)

}  // namespace birefit
