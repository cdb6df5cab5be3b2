#pragma once
// A homeotropic droplet in a field along the viewing axis, along a refracted straight ray: the equilibrium director
// (axial_equilibrium.h) in the ray's frame (t, phi, k) of radial.h. The axis stays in the meridional plane.

#include <array>
#include <memory>
#include <vector>

#include "medium/column.h"
#include "medium/families/axial_angle.h"
#include "medium/families/axial_equilibrium.h"

namespace birefit {

/// The director's angle at a place in the upper half with what bends a ray there and what moves with the field's N directions of derivatives.
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
  AxialField(const S& e, const S& ring, bool has_ring)
      : e_(e), ring_(ring), has_ring_(has_ring), equilibrium_(known_axial_equilibrium(lane(plain(e), 0), has_ring ? lane(plain(ring), 0) : 0.0, kPlanes > 1)) {
    const AxialGrid& grid = equilibrium_->grid;
    for (int k = 0; k <= grid.elements; ++k) {
      r_edges_.push_back(axial_radius_edge(grid, k, e, ring, has_ring));
      polar_edges_.push_back(axial_polar_edge(grid, k, e, ring, has_ring));
    }
    stride_ = static_cast<std::size_t>(grid.nodes() * grid.nodes());
    values_.resize(stride_ * kPlanes);
    for (int i = 0; i < grid.nodes(); ++i)
      for (int j = 0; j < grid.nodes(); ++j) {
        const std::size_t at = static_cast<std::size_t>(i * grid.nodes() + j);
        values_[at] = equilibrium_->change(i, j);
        if constexpr (kPlanes > 1)
          for (std::size_t d = 0; d + 1 < kPlanes; ++d)
            values_[(d + 1) * stride_ + at] = equilibrium_->by_e(i, j) * lane(e.d[d], 0) + (has_ring ? equilibrium_->by_ring(i, j) * lane(ring.d[d], 0) : 0.0);
      }
  }
  const S& e() const { return e_; }
  bool has_ring() const { return has_ring_; }
  const S& ring() const { return ring_; }

  /// Sine and cosine of the director's angle from the field at (rho, z), rho >= 0, z > 0, inside the unit sphere; T = S or Slope<S>.
  template <class T>
  void director(const T& rho, const T& z, T& n_rho, T& n_z) const {
    T rb[kPoints], vb[kPoints];
    const T polar = angle_of(rho, z);
    const P row = basis(T(root(T(rho * rho + z * z))), r_edges_, false, rb), column = basis(polar, polar_edges_, true, vb);
    const int nodes = equilibrium_->grid.nodes();
    alignas(64) double from[kLanes];
    store(row * P(nodes) + column, from);
    T change(0.0);
    for (int i = 0; i < kPoints; ++i) {
      T inner = vb[0] * gather(from, i * nodes);
      for (int j = 1; j < kPoints; ++j) inner = inner + vb[j] * gather(from, i * nodes + j);
      change = change + rb[i] * inner;
    }
    if (!has_ring_) return sin_cos(T(polar + change), n_rho, n_z);
    T sine, cosine, s, c;
    axial_boundary_direction(rho, z, ring_, sine, cosine);
    sin_cos(change, s, c);
    n_rho = sine * c + cosine * s;
    n_z = cosine * c - sine * s;
  }

  /// The angle itself with first and second slopes at once, term by term: a tenth of the work of duals of duals. S = double or Dual<double, N>; r > 0.
  AxialBend<ScalarTraits<S>::derivatives> bend(double rho, double z) const {
    constexpr std::size_t n = kPlanes - 1;
    const double r = std::sqrt(rho * rho + z * z), inverse_r = 1 / r, polar = std::atan2(rho, z), s = rho * inverse_r, c = z * inverse_r;
    const Along along_r = along(r, r_edges_, false), along_polar = along(polar, polar_edges_, true);
    // Sums over the polynomials and their slopes in the element's own coordinates.
    const int nodes = equilibrium_->grid.nodes();
    const double* values = values_.data() + static_cast<std::ptrdiff_t>(along_r.first) * nodes + along_polar.first;
    const auto sum = [&](std::size_t plane, const double* of_r, const double* of_polar) {
      const double* from = values + plane * stride_;
      double total = 0;
      for (int i = 0; i < kPoints; ++i) {
        double inner = 0;
        for (int j = 0; j < kPoints; ++j) inner += of_polar[j] * from[i * nodes + j];
        total += of_r[i] * inner;
      }
      return total;
    };
    const double *r0 = along_r.value, *r1 = along_r.slope, *p0 = along_polar.value, *p1 = along_polar.slope, a = along_r.scale, b = along_polar.scale;
    double f = sum(0, r0, p0), fr = a * sum(0, r1, p0), fp = b * sum(0, r0, p1);
    double frr = 0, frp = 0, fpp = 0;
    AxialBend<static_cast<int>(n)> out;
    std::array<double, n> by_r, by_p;
    if constexpr (n > 0) {
      frr = a * a * sum(0, along_r.bend, p0), frp = a * b * sum(0, r1, p1), fpp = b * b * sum(0, r0, along_polar.bend);
      for (std::size_t k = 0; k < n; ++k) {
        // The element moves with the parameters.
        const double mr = along_r.moves[k], mp = along_polar.moves[k];
        out.by[k] = sum(k + 1, r0, p0) + fr * mr + fp * mp;
        by_r[k] = a * sum(k + 1, r1, p0) + frr * mr + frp * mp + fr * along_r.stretches[k];
        by_p[k] = b * sum(k + 1, r0, p1) + frp * mr + fpp * mp + fp * along_polar.stretches[k];
      }
    }
    // The hedgehog's part is the polar angle itself; a ring's comes below.
    if (!has_ring_) f += polar, fp += 1;
    out.theta = f;
    out.by_rho = fr * s + fp * c * inverse_r;
    out.by_z = fr * c - fp * s * inverse_r;
    if constexpr (n > 0) {
      const double q = inverse_r * inverse_r, sc = s * c, both = (c * c - s * s) * inverse_r;
      out.by_rho2 = frr * s * s + 2 * frp * sc * inverse_r + fpp * c * c * q + fr * c * c * inverse_r - 2 * fp * sc * q;
      out.by_rho_z = frr * sc + frp * both - fpp * sc * q - fr * sc * inverse_r - fp * both * inverse_r;
      out.by_z2 = frr * c * c - 2 * frp * sc * inverse_r + fpp * s * s * q + fr * s * s * inverse_r + 2 * fp * sc * q;
      for (std::size_t k = 0; k < n; ++k) {
        out.by_rho_and[k] = by_r[k] * s + by_p[k] * c * inverse_r;
        out.by_z_and[k] = by_r[k] * c - by_p[k] * s * inverse_r;
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
          out.by[k] += angle.value.d[2] * ring_.d[k], out.by_rho_and[k] += angle.d[0].d[2] * ring_.d[k], out.by_z_and[k] += angle.d[1].d[2] * ring_.d[k];
      }
    }
    return out;
  }

 private:
  static constexpr int kPoints = 6;
  static constexpr std::size_t kPlanes = 1 + static_cast<std::size_t>(ScalarTraits<S>::derivatives);
  static void store(double x, double* out) { out[0] = x; }
  static void store(const Pack& x, double* out) { x.store_aligned(out); }
  S gather(const double* from, int offset) const {
    const auto plane = [&](const double* values) {
      if constexpr (std::is_same_v<P, double>) {
        return values[static_cast<int>(from[0]) + offset];
      } else {
        alignas(64) double out[kLanes];
        for (int k = 0; k < kLanes; ++k) out[k] = values[static_cast<int>(from[k]) + offset];
        return Pack::load_aligned(out);
      }
    };
    S r(plane(values_.data()));
    if constexpr (kPlanes > 1)
      for (std::size_t d = 0; d + 1 < kPlanes; ++d) r.d[d] = plane(values_.data() + (d + 1) * stride_);
    return r;
  }
  /// The element's first node (of all along the coordinate) and the values of its six polynomials.
  template <class T>
  static P basis(const T& place, const std::vector<S>& edges, bool falling, T* out) {
    static const LobattoRule& rule = lobatto_rule(kPoints - 1);
    const P here = plain(place);
    S from = edges[0], to = edges[1];
    P first(0.0);
    for (std::size_t k = 1; k + 1 < edges.size(); ++k) {
      const auto beyond = falling ? here < plain(edges[k]) : here > plain(edges[k]);
      from = select(beyond, edges[k], from);
      to = select(beyond, edges[k + 1], to);
      first = select(beyond, P(static_cast<double>(k * (kPoints - 1))), first);
    }
    const T x = (place - from) * S(2.0 * inverse(S(to - from))) - 1.0;
    // Products of (x - x_m) from both ends: no division by what may vanish.
    T below[kPoints], above[kPoints];
    below[0] = above[kPoints - 1] = T(1.0);
    for (std::size_t i = 1; i < kPoints; ++i) {
      below[i] = below[i - 1] * (x - rule.x[i - 1]);
      above[kPoints - 1 - i] = above[kPoints - i] * (x - rule.x[kPoints - i]);
    }
    for (std::size_t i = 0; i < kPoints; ++i) {
      double scale = 1;
      for (std::size_t m = 0; m < kPoints; ++m)
        if (m != i) scale /= rule.x[i] - rule.x[m];
      out[i] = scale * (below[i] * above[i]);
    }
    return first;
  }

  /// The element's polynomials at a place along one coordinate.
  struct Along {
    int first;
    double scale;                                                ///< of the element's coordinate
    double value[kPoints], slope[kPoints], bend[kPoints];        ///< by that coordinate
    std::array<double, kPlanes - 1> moves, stretches;            ///< at a fixed place: of the coordinate, in units of the place, and of log(scale)
  };
  Along along(double place, const std::vector<S>& edges, bool falling) const {
    std::size_t k = 1;
    while (k + 1 < edges.size() && (falling ? place < plain(edges[k]) : place > plain(edges[k]))) ++k;
    const S &from = edges[k - 1], &to = edges[k];
    const double width = plain(to) - plain(from), x = 2 * (place - plain(from)) / width - 1;
    Along a;
    a.first = static_cast<int>(k - 1) * (kPoints - 1);
    a.scale = 2 / width;
    if constexpr (kPlanes > 1)
      for (std::size_t d = 0; d + 1 < kPlanes; ++d) {
        const double wider = (to.d[d] - from.d[d]) / width;
        a.moves[d] = -(from.d[d] + (place - plain(from)) * wider);
        a.stretches[d] = -wider;
      }
    // Newton's form, without division by what may vanish: value and slopes of the product of all (x - x_m) but one.
    static const LobattoRule& rule = lobatto_rule(kPoints - 1);
    static const std::array<double, kPoints> scales = [] {
      std::array<double, kPoints> result;
      for (std::size_t i = 0; i < kPoints; ++i) {
        result[i] = 1;
        for (std::size_t m = 0; m < kPoints; ++m)
          if (m != i) result[i] /= rule.x[i] - rule.x[m];
      }
      return result;
    }();
    for (std::size_t i = 0; i < kPoints; ++i) {
      double p = scales[i], p1 = 0, p2 = 0;
      for (std::size_t m = 0; m < kPoints; ++m) {
        if (m == i) continue;
        const double f = x - rule.x[m];
        p2 = p2 * f + 2 * p1;
        p1 = p1 * f + p;
        p *= f;
      }
      a.value[i] = p, a.slope[i] = p1, a.bend[i] = p2;
    }
    return a;
  }

  S e_, ring_;
  bool has_ring_;
  std::shared_ptr<const AxialEquilibrium> equilibrium_;
  std::vector<S> r_edges_, polar_edges_;
  std::size_t stride_ = 0;
  std::vector<double> values_;  ///< [plane][node of r][node of polar angle]
};

/// u in [0, 1/2] runs from the entry to the equator (z = 0), the rest to the exit; nodes crowd at the equator, where the
/// wall and the defect are, and at the sphere, each over the coherence length or what the ray's distance makes of it.
template <class S>
class AxialColumn final : public Column<S> {
 public:
  /// impact_um, half_um: distance and half length of the chord; deflection of the ray inside, > 0 turns towards the axis.
  AxialColumn(const AxialField<S>& field, const S& impact_um, const S& half_um, const S& radius_um, const S& sin_deflection,
              const S& cos_deflection, const S& ordinary, const S& extraordinary)
      : field_(field), b_(impact_um), radius_(radius_um), sd_(sin_deflection), cd_(cos_deflection), eo_(ordinary), ee_(extraordinary) {
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
    for (std::size_t i = 0; i < u.size(); ++i) ::new (static_cast<void*>(out + i)) OpticalPoint<S>(at<S>(S(u[i]), u[i]));
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
