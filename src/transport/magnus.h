#pragma once
// What the exponential integrators of order 4 and 6 share: their nodes, their exponents, and products of retarders with
// derivatives.

#include <array>
#include <stdexcept>
#include <vector>

#include "transport/method.h"

namespace birefit {

/// transfer() is not compiled for scalars that serve tables alone (method.h): those read retarder() or the transfers of
/// the modes, and its eight derivatives would take minutes to compile.
template <class S>
inline constexpr bool kHasTransfer = ScalarTraits<S>::derivatives <= 4;
[[noreturn]] inline void refuse_transfer_of_tables() {
  throw std::logic_error("a picture of more than four derivatives is read from tables, which need no transfer");
}

/// The Gauss nodes of every step of the mesh used last by this thread: every ray of an image asks for the same. Nodes =
/// 2 or 3.
template <int Nodes>
const std::vector<double>& magnus_nodes(const Mesh& mesh) {
  static_assert(Nodes == 2 || Nodes == 3);
  constexpr double kFromMiddle = Nodes == 2 ? 0.28867513459481288 : 0.38729833462074169;  // sqrt(3)/6, sqrt(15)/10
  thread_local Mesh last;
  thread_local std::vector<double> u;
  if (last == mesh) return u;
  last = mesh;
  u.clear();
  for (std::size_t i = 0; i + 1 < mesh.size(); ++i) {
    const double middle = 0.5 * (mesh[i] + mesh[i + 1]), offset = (mesh[i + 1] - mesh[i]) * kFromMiddle;
    u.push_back(middle - offset);
    if (Nodes == 3) u.push_back(middle);
    u.push_back(middle + offset);
  }
  return u;
}

/// Omega = h/2 (A1 + A2) - sqrt(3)/12 h^2 [A1, A2].
/// A: what scale(double, A), add(A, A) and bracket(A, A) work on.
template <class A, class Scale, class Add, class Bracket>
BIREFIT_INLINE A magnus_exponent(double h, const A (&a)[2], const Scale& scale, const Add& add,
                                 const Bracket& bracket) {
  constexpr double kSqrt3 = 1.7320508075688772;
  return add(scale(0.5 * h, add(a[0], a[1])), scale(-kSqrt3 / 12 * h * h, bracket(a[0], a[1])));
}
/// With a1 = h A2, a2 = h sqrt(15)/3 (A3 - A1), a3 = h 10/3 (A3 - 2 A2 + A1):
///   Omega = a1 + a3/12 + [-20 a1 - a3 + C1, a2 + C2]/240,  C1 = [a1, a2],  C2 = -[a1, 2 a3 + C1]/60.
template <class A, class Scale, class Add, class Bracket>
BIREFIT_INLINE A magnus_exponent(double h, const A (&a)[3], const Scale& scale, const Add& add,
                                 const Bracket& bracket) {
  constexpr double kSqrt15 = 3.872983346207417;
  const A a1 = scale(h, a[1]), a2 = scale(h * kSqrt15 / 3, add(a[2], scale(-1, a[0])));
  const A a3 = scale(h * 10 / 3, add(add(a[2], a[0]), scale(-2, a[1])));
  const A c1 = bracket(a1, a2), c2 = scale(-1.0 / 60, bracket(a1, add(scale(2, a3), c1)));
  const A left = add(add(scale(-20, a1), scale(-1, a3)), c1);
  return add(add(a1, scale(1.0 / 12, a3)), scale(1.0 / 240, bracket(left, add(a2, c2))));
}
/// Of matrices.
template <class S, int Nodes>
Mat2<S> magnus_exponent(double h, const Mat2<S> (&a)[Nodes]) {
  return magnus_exponent(
      h, a, [](double f, const Mat2<S>& m) { return S(f) * m; },
      [](const Mat2<S>& m, const Mat2<S>& n) { return m + n; },
      [](const Mat2<S>& m, const Mat2<S>& n) { return commutator(m, n); });
}
/// Of generators i v.s, as vectors: [i a.s, i b.s] = -2 i (a x b).s
template <class S, int Nodes>
BIREFIT_INLINE Vec3<S> magnus_exponent(double h, const Vec3<S> (&v)[Nodes]) {
  return magnus_exponent(
      h, v,
      [](double f, const Vec3<S>& a) BIREFIT_INLINE_LAMBDA {
        return Vec3<S>{f * a.x, f * a.y, f * a.z};
      },
      [](const Vec3<S>& a, const Vec3<S>& b) BIREFIT_INLINE_LAMBDA { return a + b; },
      [](const Vec3<S>& a, const Vec3<S>& b) BIREFIT_INLINE_LAMBDA {
        return Vec3<S>{-2.0 * (a.y * b.z - a.z * b.y), -2.0 * (a.z * b.x - a.x * b.z), -2.0 * (a.x * b.y - a.y * b.x)};
      });
}

/// exp(i v_n.s) ... exp(i v_1.s), one factor after the other, with its derivatives. Those are not carried through the
/// product: a factor's change, seen from the entry, is a vector, and the vectors add:
///   exp(i (v + dv).s) = exp(i v.s)(1 + i (J dv).s),  J dv = (c f) dv + f^2 v x dv + (1 - c f) v (v.dv)/v^2,  c = cos
///   |v|, f = sin |v| / |v|.
template <class S>
class RetarderProduct {
 public:
  using P = PlainOf<S>;
  BIREFIT_INLINE void multiply(const Vec3<S>& v) {
    if constexpr (kDerivatives == 0) {
      total_ = su2_exp(v) * total_;
    } else {
      const Vec3<P> p{plain(v.x), plain(v.y), plain(v.z)};
      const P q = dot(p, p);
      const CosSinc<P> f = cos_sinc_sq(q);
      const P both = f.cos_sq * f.sinc_sq, square = f.sinc_sq * f.sinc_sq,
              rest = (P(1.0) - both) * inverse(max_of(q, P(1e-40)));
      // What the factors so far make of a vector, seen from behind them: a rotation.
      const P w = total_.w, x = total_.x, y = total_.y, z = total_.z, two(2.0);
      const P xx = two * x * x, yy = two * y * y, zz = two * z * z, xy = two * x * y, xz = two * x * z,
              yz = two * y * z, wx = two * w * x, wy = two * w * y, wz = two * w * z;
      const P one(1.0), r00 = one - yy - zz, r11 = one - xx - zz, r22 = one - xx - yy;
      for (std::size_t j = 0; j < static_cast<std::size_t>(kDerivatives); ++j) {
        const Vec3<P> d{v.x.d[j], v.y.d[j], v.z.d[j]};
        const P along = rest * dot(p, d);
        const Vec3<P> g{both * d.x + square * (p.y * d.z - p.z * d.y) + along * p.x,
                        both * d.y + square * (p.z * d.x - p.x * d.z) + along * p.y,
                        both * d.z + square * (p.x * d.y - p.y * d.x) + along * p.z};
        turned_[j] = {turned_[j].x + (r00 * g.x + (xy - wz) * g.y + (xz + wy) * g.z),
                      turned_[j].y + ((xy + wz) * g.x + r11 * g.y + (yz - wx) * g.z),
                      turned_[j].z + ((xz - wy) * g.x + (yz + wx) * g.y + r22 * g.z)};
      }
      total_ = Su2<P>{f.cos_sq, f.sinc_sq * p.x, f.sinc_sq * p.y, f.sinc_sq * p.z} * total_;
    }
  }
  Su2<S> value() const {
    if constexpr (kDerivatives == 0) {
      return total_;
    } else {
      Su2<S> r{S(total_.w), S(total_.x), S(total_.y), S(total_.z)};
      for (std::size_t j = 0; j < static_cast<std::size_t>(kDerivatives); ++j) {
        const Su2<P> d = total_ * Su2<P>{P(0.0), turned_[j].x, turned_[j].y, turned_[j].z};
        r.w.d[j] = d.w, r.x.d[j] = d.x, r.y.d[j] = d.y, r.z.d[j] = d.z;
      }
      return r;
    }
  }

 private:
  static constexpr int kDerivatives = ScalarTraits<S>::derivatives;
  static std::array<Vec3<P>, static_cast<std::size_t>(kDerivatives)> zeros() {
    std::array<Vec3<P>, static_cast<std::size_t>(kDerivatives)> r;
    for (Vec3<P>& v : r) v = {P(0.0), P(0.0), P(0.0)};
    return r;
  }
  Su2<P> total_ = Su2<P>::identity();
  std::array<Vec3<P>, static_cast<std::size_t>(kDerivatives)> turned_ = zeros();
};

/// A medium whose permittivities are the same all along a column, and light of wavenumber k0, in the column's unit of
/// depth.
template <class R>
struct UniformMedium {
  R k0, ordinary, extraordinary;
};
/// S with two more derivatives behind its own: by the ordinary and by the extraordinary permittivity. None is needed by
/// k0: light knows k0 times the refractive indices, so that k0 d/dk0 = 2 (eps_o d/d eps_o + eps_e d/d eps_e).
template <class S>
using WithMedium = Dual<PlainOf<S>, ScalarTraits<S>::derivatives + 2>;

/// What retarder() of the Magnus method of that order returns for a column in a uniform medium, whose own
/// permittivities are not read. V = S, or WithMedium<S>: what moves the ray or turns the director costs a derivative of
/// the whole column, what changes the medium next to nothing.
template <class V, class S>
Su2<V> magnus_retarder(int order, const Column<S>&, Continuity, const UniformMedium<PlainOf<S>>&, const Mesh&);

}  // namespace birefit
