#pragma once
// A director field sampled on a box (birefit/volume.h) in its host as a medium on the grid of wave optics.

#include <algorithm>
#include <array>
#include <cmath>

#include "medium/families/volume.h"
#include "wave/object.h"

namespace birefit {

/// A node of liquid crystal, not of the host.
inline bool is_crystal(const std::array<double, 6>& tensor) {
  return tensor[0] != 0 || tensor[1] != 0 || tensor[2] != 0;
}

template <class S>
struct SampledOptics {
  const VolumeGrid* grid = nullptr;
  S scale = S(1.0);                        ///< of the box
  S cos_turn = S(1.0), sin_turn = S(0.0);  ///< of the box about the view, counter-clockwise in the image
  S n_o, n_e, n_host;
};

/// The host is where a node's tensor is zero, and beyond the box. Between nodes tensor and share of liquid crystal are
/// interpolated trilinearly, so a surface inside the box is blurred over a cell and lies half-way between the nodes on
/// its two sides; that of the box is a ramp of ramp_um. Either is mixed across its normal, the share's gradient or the
/// box's own.
template <class S>
class SampledMedium final : public WaveMedium<S> {
 public:
  using P = PlainOf<S>;
  SampledMedium(const SampledOptics<S>& optics, double ramp_um)
      : o_(optics), g_(*optics.grid), width_(kRampWidth * ramp_um), over_scale_(inverse(o_.scale)) {}

  bool reaches(const P& x, const P& y, double z) const override {
    S place[3];
    in_nodes(x, y, z, place);
    P beyond(0.0);  // of the box's faces, um
    for (std::size_t i = 0; i < 3; ++i) beyond = max_of(beyond, P(P(0.0) - plain(depth_um(place, i))));
    return smallest(beyond) < 0.5 * width_;
  }
  OpticalPoint<S> at(const P& x, const P& y, double z) const override {
    using std::floor;
    S place[3], inside(1.0);
    in_nodes(x, y, z, place);
    Vec3<S> face{S(0.0), S(0.0), S(0.0)};
    Corners corners;
    for (std::size_t i = 0; i < 3; ++i) {
      const S ramp = surface_ramp(depth_um(place, i), width_);
      const auto near = plain(ramp) < plain(inside);  // the nearest face of the box so far
      const P on(i == 0 ? 1.0 : 0.0), up(i == 1 ? 1.0 : 0.0), along(i == 2 ? 1.0 : 0.0);
      face = {S(select(near, on, plain(face.x))), S(select(near, up, plain(face.y))),
              S(select(near, along, plain(face.z)))};
      inside = inside * ramp;
      place[i] = min_of(max_of(place[i], S(0.0)), S(nodes(i) - 1.0));
      const P cell = min_of(P(floor(plain(place[i]))), P(nodes(i) - 2.0));
      corners.fraction[i] = place[i] - S(cell);
      corners.cell[i] = cell;
    }
    corners.find(g_);
    const auto value = [&](std::size_t component) {
      return corners.value([&](std::size_t node) { return g_.nodes[node][component]; });
    };
    const SymmetricTensor<S> a{value(0), value(1), value(2), value(3), value(4), value(5)};
    const auto crystal = [&](std::size_t node) { return is_crystal(g_.nodes[node]) ? 1.0 : 0.0; };
    Vec3<S> slope;
    const S share = corners.value_and_slope(crystal, slope);
    slope = {slope.x * (1 / g_.spacing_um[0]), slope.y * (1 / g_.spacing_um[1]), slope.z * (1 / g_.spacing_um[2])};
    const S steep = inverse_root(S(slope.x * slope.x + slope.y * slope.y + slope.z * slope.z + 1e-24));
    const auto at_box = plain(inside) < P(1.0);
    face = {select(at_box, face.x, steep * slope.x), select(at_box, face.y, steep * slope.y),
            select(at_box, face.z, steep * slope.z)};
    // The liquid crystal's own order, without the host's share.
    const S order = (a.xx + a.yy + a.zz) * inverse(S(share + 1e-12)),
            extraordinary = o_.n_o + (o_.n_e - o_.n_o) * order;
    const S c = share * inside, eh = o_.n_host * o_.n_host, rest = 1.0 - c;
    return mixed_at_surface(turned(principal_axis(a)), turned(face), S(o_.n_o * o_.n_o),
                            S(extraordinary * extraordinary), c, S(rest * eh), S(rest * inverse(eh)));
  }

 private:
  static constexpr int kWide = std::is_same_v<P, double> ? 1 : kLanes;
  /// The cell around a place and what is trilinear in it.
  struct Corners {
    P cell[3];
    S fraction[3];
    std::size_t first[kWide], row = 0, layer = 0;

    void find(const VolumeGrid& g) {
      for (int k = 0; k < kWide; ++k)
        first[k] = g.at(static_cast<int>(lane(cell[0], k)), static_cast<int>(lane(cell[1], k)),
                        static_cast<int>(lane(cell[2], k)));
      row = static_cast<std::size_t>(g.nx);
      layer = row * static_cast<std::size_t>(g.ny);
    }
    /// c0 + cx fx + .. + cxyz fx fy fz.
    struct Polynomial {
      P c0, cx, cy, cz, cxy, cxz, cyz, cxyz;
    };
    template <class At>
    Polynomial polynomial(const At& at) const {
      const auto corner = [&](std::size_t away) {
        if constexpr (kWide == 1) {
          return P(at(first[0] + away));
        } else {
          alignas(64) double values[kLanes];
          for (int k = 0; k < kLanes; ++k) values[k] = at(first[k] + away);
          return Pack::load_aligned(values);
        }
      };
      const P a = corner(0), x = corner(1), y = corner(row), xy = corner(row + 1), z = corner(layer),
              xz = corner(layer + 1), yz = corner(layer + row), xyz = corner(layer + row + 1);
      return {
          a, x - a, y - a, z - a, xy - x - y + a, xz - x - z + a, yz - y - z + a, xyz - xy - xz - yz + x + y + z - a};
    }
    /// A number whose slopes by the fractions are these.
    S with_slopes(const P& value, const P& gx, const P& gy, const P& gz) const {
      S r(value);
      if constexpr (ScalarTraits<S>::derivatives > 0)
        for (std::size_t i = 0; i < r.d.size(); ++i)
          r.d[i] = gx * fraction[0].d[i] + gy * fraction[1].d[i] + gz * fraction[2].d[i];
      return r;
    }
    template <class At>
    S value_and_slope(const At& at, Vec3<S>& slope) const {
      const Polynomial p = polynomial(at);
      const P x = plain(fraction[0]), y = plain(fraction[1]), z = plain(fraction[2]);
      const P xy = p.cxy + z * p.cxyz, xz = p.cxz + y * p.cxyz, yz = p.cyz + x * p.cxyz;
      const P gx = p.cx + y * xy + z * p.cxz, gy = p.cy + x * xy + z * p.cyz, gz = p.cz + x * xz + y * p.cyz;
      slope = {with_slopes(gx, P(0.0), xy, xz), with_slopes(gy, xy, P(0.0), yz), with_slopes(gz, xz, yz, P(0.0))};
      return with_slopes(p.c0 + x * gx + y * (p.cy + z * p.cyz) + z * p.cz, gx, gy, gz);
    }
    template <class At>
    S value(const At& at) const {
      Vec3<S> unused;
      return value_and_slope(at, unused);
    }
  };

  int nodes(std::size_t i) const { return i == 0 ? g_.nx : i == 1 ? g_.ny : g_.nz; }
  void in_nodes(const P& x, const P& y, double z, S* place) const {
    const S sx(x), sy(y);
    place[0] = (o_.cos_turn * sx + o_.sin_turn * sy) * over_scale_ * (1 / g_.spacing_um[0]) + 0.5 * (g_.nx - 1);
    place[1] = (o_.cos_turn * sy - o_.sin_turn * sx) * over_scale_ * (1 / g_.spacing_um[1]) + 0.5 * (g_.ny - 1);
    place[2] = over_scale_ * (z / g_.spacing_um[2]) + 0.5 * (g_.nz - 1);
  }
  /// Below the nearer of two opposite faces of the box.
  S depth_um(const S* place, std::size_t i) const {
    return min_of(place[i], S(nodes(i) - 1.0 - place[i])) * o_.scale * g_.spacing_um[i];
  }
  Vec3<S> turned(const Vec3<S>& a) const {
    return {o_.cos_turn * a.x - o_.sin_turn * a.y, o_.sin_turn * a.x + o_.cos_turn * a.y, a.z};
  }

  SampledOptics<S> o_;
  const VolumeGrid& g_;
  double width_;
  S over_scale_;
};

/// The grid for pictures of it; turned boxes in their upright surroundings.
inline WaveGrid sampled_grid(const SampledOptics<double>& o, double k0_per_um, double objective_na) {
  const VolumeGrid& v = *o.grid;
  const auto half = [&](int nodes, std::size_t i) { return 0.5 * o.scale * v.spacing_um[i] * (nodes - 1); };
  const double a = half(v.nx, 0), b = half(v.ny, 1), depth = half(v.nz, 2), c = std::abs(o.cos_turn),
               s = std::abs(o.sin_turn);
  const double margin = std::max(1.5 + 3 * objective_na, spread_um(depth, objective_na, o.n_host));
  WaveGrid g = object_grid({1.05 * (c * a + s * b), 1.05 * (s * a + c * b), depth, margin}, o.n_o, o.n_e, o.n_host,
                           k0_per_um, objective_na);
  // As many layers as the samples tell apart, two by two.
  const double slab = (g.exit_um - g.entry_um) / g.slabs;
  g.layers = std::clamp(2 * static_cast<int>(std::ceil(0.5 * slab / (o.scale * v.spacing_um[2]))), 4, 12);
  return g;
}

}  // namespace birefit
