#pragma once
// A homeotropic droplet in a field along the viewing axis, along a refracted straight ray: the equilibrium director
// (axial_equilibrium.h) in the ray's frame (t, phi, k) of radial.h. The axis stays in the meridional plane.

#include <array>
#include <memory>
#include <vector>

#include "medium/column.h"
#include "medium/families/axial_angle.h"
#include "medium/families/axial_equilibrium.h"
#include "medium/families/axial_table.h"

namespace birefit {

/// The director's angle at a place in the upper half with what bends a ray there and what moves with the field's N
/// directions of derivatives.
template <int N>
struct AxialBend {
  double theta, by_rho, by_z, by_rho2, by_rho_z, by_z2;
  std::array<double, N> by, by_rho_and, by_z_and;  ///< theta and its slopes by direction k, at a fixed place
};

/// The equilibrium at scalar e and ring (radii; 0: hedgehog), read at any place. Shared by all rays of an image.
template <class S>
class AxialField {
 public:
  using P = PlainOf<S>;
  /// `memo` may be null.
  AxialField(const S& e, const S& ring, bool has_ring, Memo* memo = nullptr)
      : e_(e),
        ring_(ring),
        has_ring_(has_ring),
        table_(
            *known_axial_equilibrium(lane(plain(e), 0), has_ring ? lane(plain(ring), 0) : 0.0, kDerivatives > 0, memo),
            has_ring, kDerivatives > 0) {}
  const S& e() const { return e_; }
  bool has_ring() const { return has_ring_; }
  const S& ring() const { return ring_; }

  /// Sine and cosine of the director's angle from the field at (rho, z), rho >= 0, z > 0, inside the unit sphere; T = S
  /// or Slope<S>.
  template <class T>
  void director(const T& rho, const T& z, T& n_rho, T& n_z) const {
    const T polar = angle_of(rho, z), change = change_at(T(root(T(rho * rho + z * z))), polar);
    if (!has_ring_) return sin_cos(T(polar + change), n_rho, n_z);
    T sine, cosine, s, c;
    axial_boundary_direction(rho, z, ring_, sine, cosine);
    sin_cos(change, s, c);
    n_rho = sine * c + cosine * s;
    n_z = cosine * c - sine * s;
  }

  /// The angle itself with first and second slopes at once, term by term: a tenth of the work of duals of duals. S =
  /// double or Dual<double, N>; r > 0.
  AxialBend<ScalarTraits<S>::derivatives> bend(double rho, double z) const {
    constexpr std::size_t n = kDerivatives;
    const double r = std::sqrt(rho * rho + z * z), inverse_r = 1 / r, polar = std::atan2(rho, z), s = rho * inverse_r,
                 c = z * inverse_r;
    const auto change = table_.template read < double, n == 0 ? 1 : 2 > (r, polar);
    // the hedgehog's boundary angle is the polar angle itself; a ring's comes below
    const double fr = change.by_r, fp = has_ring_ ? change.by_polar : change.by_polar + 1;
    AxialBend<static_cast<int>(n)> out;
    out.theta = has_ring_ ? change.value : change.value + polar;
    out.by_rho = fr * s + fp * c * inverse_r;
    out.by_z = fr * c - fp * s * inverse_r;
    if constexpr (n > 0) {
      const double frr = change.by_r2, frp = change.by_r_polar, fpp = change.by_polar2, q = inverse_r * inverse_r,
                   sc = s * c, both = (c * c - s * s) * inverse_r;
      out.by_rho2 = frr * s * s + 2 * frp * sc * inverse_r + fpp * c * c * q + fr * c * c * inverse_r - 2 * fp * sc * q;
      out.by_rho_z = frr * sc + frp * both - fpp * sc * q - fr * sc * inverse_r - fp * both * inverse_r;
      out.by_z2 = frr * c * c - 2 * frp * sc * inverse_r + fpp * s * s * q + fr * s * s * inverse_r + 2 * fp * sc * q;
      for (std::size_t k = 0; k < n; ++k) {
        const double by_r = along(change.by_r_and, k), by_p = along(change.by_polar_and, k);
        out.by[k] = along(change.by, k);
        out.by_rho_and[k] = by_r * s + by_p * c * inverse_r;
        out.by_z_and[k] = by_r * c - by_p * s * inverse_r;
      }
    }
    if (has_ring_) {
      using Inner = std::conditional_t<n == 0, double, Dual<double, 3>>;  // rho, z, ring
      using Outer = Dual<Inner, 2>;
      Inner at[3] = {Inner(rho), Inner(z), Inner(lane(plain(ring_), 0))};
      if constexpr (n > 0)
        for (std::size_t k = 0; k < 3; ++k) at[k].d[k] = 1;
      Outer x(at[0]), y(at[1]);
      x.d[0] = y.d[1] = Inner(1.0);
      const Outer angle = axial_boundary_angle(x, y, Outer(at[2]));
      out.theta += plain(angle), out.by_rho += plain(angle.d[0]), out.by_z += plain(angle.d[1]);
      if constexpr (n > 0) {
        out.by_rho2 += angle.d[0].d[0], out.by_rho_z += angle.d[0].d[1], out.by_z2 += angle.d[1].d[1];
        for (std::size_t k = 0; k < n; ++k)
          out.by[k] += angle.value.d[2] * ring_.d[k], out.by_rho_and[k] += angle.d[0].d[2] * ring_.d[k],
              out.by_z_and[k] += angle.d[1].d[2] * ring_.d[k];
      }
    }
    return out;
  }

 private:
  static constexpr std::size_t kDerivatives = static_cast<std::size_t>(ScalarTraits<S>::derivatives);
  /// Slopes by e and ring along S's direction k.
  P along(const std::array<P, 2>& by, std::size_t k) const {
    return has_ring_ ? P(by[0] * e_.d[k] + by[1] * ring_.d[k]) : P(by[0] * e_.d[k]);
  }
  template <class T>
  T change_at(const T& r, const T& polar) const {
    if constexpr (std::is_same_v<T, S>) {
      const auto change = table_.template read < P, kDerivatives == 0 ? 0 : 1 > (plain(r), plain(polar));
      S out(change.value);
      if constexpr (kDerivatives > 0)
        for (std::size_t k = 0; k < kDerivatives; ++k)
          out.d[k] = change.by_r * r.d[k] + change.by_polar * polar.d[k] + along(change.by, k);
      return out;
    } else {
      static_assert(std::is_same_v<T, Slope<S>>);
      const auto change = table_.template read < P, kDerivatives == 0 ? 1 : 2 > (plain(r), plain(polar));
      S value(change.value), by_r(change.by_r), by_polar(change.by_polar);
      if constexpr (kDerivatives > 0)
        for (std::size_t k = 0; k < kDerivatives; ++k) {
          const P dr = r.value.d[k], dp = polar.value.d[k];
          value.d[k] = change.by_r * dr + change.by_polar * dp + along(change.by, k);
          by_r.d[k] = change.by_r2 * dr + change.by_r_polar * dp + along(change.by_r_and, k);
          by_polar.d[k] = change.by_r_polar * dr + change.by_polar2 * dp + along(change.by_polar_and, k);
        }
      T out(value);
      out.d[0] = by_r * r.d[0] + by_polar * polar.d[0];
      return out;
    }
  }

  S e_, ring_;
  bool has_ring_;
  AxialTable table_;
};

/// u in [0, 1/2] runs from the entry to the equator (z = 0), the rest to the exit; nodes crowd at the equator, where
/// the wall and the defect are, and at the sphere, each over the coherence length or what the ray's distance makes of
/// it.
template <class S>
class AxialColumn final : public Column<S> {
 public:
  /// impact_um, half_um: distance and half length of the chord; deflection of the ray inside, > 0 turns towards the
  /// axis.
  AxialColumn(const AxialField<S>& field, const S& impact_um, const S& half_um, const S& radius_um,
              const S& sin_deflection, const S& cos_deflection, const S& ordinary, const S& extraordinary)
      : field_(field),
        b_(impact_um),
        radius_(radius_um),
        sd_(sin_deflection),
        cd_(cos_deflection),
        eo_(ordinary),
        ee_(extraordinary) {
    this->planar = true;
    this->breaks = {0.5};
    // Where the ray meets the equator; some near the rim never do.
    equator_ = S(0.0) - b_ * sd_ * inverse(cd_);
    const S most = 0.98 * half_um;
    equator_ = select(plain(equator_) > plain(most), most, equator_);
    equator_ = select(plain(equator_) < -plain(most), -most, equator_);
    before_ = equator_ + half_um;
    after_ = half_um - equator_;
    fine_ = 1.0 / (1.0 + field.e() * (1.0 / 6));
    q_ = 4.0 * b_ * inverse(half_um) + 0.01;
  }
  void sample(std::span<const double> u, OpticalPoint<S>* out) const override {
    for (std::size_t i = 0; i < u.size(); ++i)
      ::new (static_cast<void*>(out + i)) OpticalPoint<S>(at<S>(S(u[i]), u[i]));
  }
  void sample_with_slope(std::span<const double> u, OpticalPoint<Slope<S>>* out) const override {
    for (std::size_t i = 0; i < u.size(); ++i) {
      Slope<S> x{S(u[i])};
      x.d[0] = S(1.0);
      ::new (static_cast<void*>(out + i)) OpticalPoint<Slope<S>>(at<Slope<S>>(x, u[i]));
    }
  }

 private:
  template <class T>
  OpticalPoint<T> at(const T& u, double where) const {
    const bool behind = where < 0.5;
    const T x = behind ? 1.0 - 2.0 * u : 2.0 * u - 1.0;
    const S& length = behind ? before_ : after_;
    // x to [0, 1], slope `fine` at both ends; then w -> q w / (1 + q - w).
    const T x2 = x * x, w = fine_ * (x - 3.0 * x2 + 2.0 * x2 * x) + x2 * (3.0 - 2.0 * x);
    const T slope = fine_ * (1.0 - 6.0 * x + 6.0 * x2) + 6.0 * (x - x2);
    const S end = q_ + 1.0, reach = length * q_;
    const T f = inverse(T(end - w));
    const T distance = reach * (w * f);
    const T depth_slope = (2.0 * reach * end) * (f * f * slope);
    const T s = behind ? T(equator_ - distance) : T(equator_ + distance);
    const S over = inverse(radius_);
    const T rho = over * (cd_ * b_ - sd_ * s), z = over * (sd_ * b_ + cd_ * s);
    // Half the droplet is known: theta is odd in rho, and the lower half mirrors the upper, n_z -> -n_z.
    const auto inward = plain(rho) < PlainOf<T>(0.0), below = plain(z) < PlainOf<T>(0.0);
    const T size = select(inward, -rho, rho) + 1e-12, height = select(below, -z, z) + 1e-12;
    T n_rho, n_z;
    field_.director(size, height, n_rho, n_z);
    n_rho = select(inward, -n_rho, n_rho);
    n_z = select(below, -n_z, n_z);
    return {{cd_ * n_rho + sd_ * n_z, T(0.0), cd_ * n_z - sd_ * n_rho}, T(eo_), T(ee_), T(0.0), T(0.0), depth_slope};
  }

  const AxialField<S>& field_;
  S b_, radius_, sd_, cd_, eo_, ee_, equator_, before_, after_, fine_, q_;
};

}  // namespace birefit
