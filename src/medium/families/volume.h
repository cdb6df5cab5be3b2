#pragma once
// A ray along z through a field sampled on a box (birefit/volume.h): the tensor s n n^T, trilinear between the nodes.

#include <cmath>
#include <vector>

#include "birefit/volume.h"
#include "medium/column.h"

namespace birefit {

template <class T>
struct SymmetricTensor {
  T xx, yy, zz, xy, xz, yz;
};

/// Unit eigenvector of the eigenvalue of largest size, its sign left to chance: the tensor to the 16th power is all but
/// a multiple of a a^T, (second eigenvalue / first)^16 apart, so any of its columns will do; the largest never
/// vanishes. By arithmetic alone, so that derivatives come along. Where the tensor is zero: along z.
template <class T>
BIREFIT_INLINE Vec3<T> principal_axis(const SymmetricTensor<T>& a) {
  SymmetricTensor<T> m = a;
  m.zz = m.zz + 1e-12;  // 1e-12 of a full order: no direction that matters is turned by more
  for (int i = 0; i < 4; ++i) {
    const T xx = m.xx * m.xx + m.xy * m.xy + m.xz * m.xz, yy = m.xy * m.xy + m.yy * m.yy + m.yz * m.yz,
            zz = m.xz * m.xz + m.yz * m.yz + m.zz * m.zz;
    const T f = inverse(T(xx + yy + zz));  // of a square: positive
    m = {f * xx,
         f * yy,
         f * zz,
         f * (m.xx * m.xy + m.xy * m.yy + m.xz * m.yz),
         f * (m.xx * m.xz + m.xy * m.yz + m.xz * m.zz),
         f * (m.xy * m.xz + m.yy * m.yz + m.yz * m.zz)};
  }
  Vec3<T> column{m.xx, m.xy, m.xz};
  T top = m.xx;
  const auto offer = [&](const T& diagonal, const Vec3<T>& other) {
    const auto larger = plain(diagonal) > plain(top);
    column = {select(larger, other.x, column.x), select(larger, other.y, column.y), select(larger, other.z, column.z)};
    top = select(larger, diagonal, top);
  };
  offer(m.yy, {m.xy, m.yy, m.yz});
  offer(m.zz, {m.xz, m.yz, m.zz});
  const T length = inverse_root(T(column.x * column.x + column.y * column.y + column.z * column.z));
  return {length * column.x, length * column.y, length * column.z};
}

/// u grows linearly from the first layer of nodes to the last; every layer between them is a kink of the field.
template <class S>
class VolumeColumn final : public Column<S> {
 public:
  using P = PlainOf<S>;
  /// x, y: place in the plane, in nodes from the first, inside [0, nx - 1] and [0, ny - 1]; the axis is turned by the
  /// angle given; n_e - n_o = birefringence times the relative order; depth_um of the whole box.
  VolumeColumn(const VolumeGrid& grid, const std::vector<double>& breaks, const S& x, const S& y, const S& cos_turn,
               const S& sin_turn, const S& ordinary_index, const S& birefringence, const S& depth_um)
      : grid_(grid), cos_(cos_turn), sin_(sin_turn), n_o_(ordinary_index), dn_(birefringence), depth_(depth_um) {
    this->breaks = breaks;
    using std::floor;
    const P column = min_of(P(floor(plain(x))), P(grid.nx - 2.0)), row = min_of(P(floor(plain(y))), P(grid.ny - 2.0));
    fx_ = x - S(column);
    fy_ = y - S(row);
    for (int k = 0; k < kWide; ++k)
      first_[k] = grid.at(static_cast<int>(lane(column, k)), static_cast<int>(lane(row, k)), 0);
  }
  void sample(std::span<const double> u, OpticalPoint<S>* out) const override {
    for (std::size_t i = 0; i < u.size(); ++i) {
      const double in_cell = enter(u[i]);
      ::new (static_cast<void*>(out + i)) OpticalPoint<S>(
          point<S>({entry_.xx + in_cell * (exit_.xx - entry_.xx), entry_.yy + in_cell * (exit_.yy - entry_.yy),
                    entry_.zz + in_cell * (exit_.zz - entry_.zz), entry_.xy + in_cell * (exit_.xy - entry_.xy),
                    entry_.xz + in_cell * (exit_.xz - entry_.xz), entry_.yz + in_cell * (exit_.yz - entry_.yz)}));
    }
  }
  void sample_with_slope(std::span<const double> u, OpticalPoint<Slope<S>>* out) const override {
    const double cells = grid_.nz - 1;
    for (std::size_t i = 0; i < u.size(); ++i) {
      const double in_cell = enter(u[i]);
      const auto between = [&](const S& from, const S& to) {
        const S change = to - from;
        Slope<S> r{S(from + in_cell * change)};
        r.d[0] = cells * change;
        return r;
      };
      ::new (static_cast<void*>(out + i)) OpticalPoint<Slope<S>>(
          point<Slope<S>>({between(entry_.xx, exit_.xx), between(entry_.yy, exit_.yy), between(entry_.zz, exit_.zz),
                           between(entry_.xy, exit_.xy), between(entry_.xz, exit_.xz), between(entry_.yz, exit_.yz)}));
    }
  }

 private:
  static constexpr int kWide = std::is_same_v<P, double> ? 1 : kLanes;
  /// Makes entry_ and exit_ the layers around u; returns the place between them. A ray is followed downwards: the last
  /// layers are kept.
  double enter(double u) const {
    const double place = u * (grid_.nz - 1);
    const int cell = std::clamp(static_cast<int>(place), 0, grid_.nz - 2);
    if (cell != cell_) {
      if (cell == cell_ + 1 && cell_ >= 0)
        entry_ = exit_;
      else
        entry_ = layer(cell);
      exit_ = layer(cell + 1);
      cell_ = cell;
    }
    return place - cell;
  }
  SymmetricTensor<S> layer(int z) const {
    const std::size_t down =
        static_cast<std::size_t>(z) * static_cast<std::size_t>(grid_.nx) * static_cast<std::size_t>(grid_.ny);
    const P fx = plain(fx_), fy = plain(fy_);
    const auto component = [&](std::size_t c) {
      const P a = corner(down, c), b = corner(down + 1, c), e = corner(down + static_cast<std::size_t>(grid_.nx), c),
              d = corner(down + static_cast<std::size_t>(grid_.nx) + 1, c);
      const P by_x = b - a, by_y = e - a, by_both = d - e - by_x;
      S r(P(a + fx * by_x + fy * (by_y + fx * by_both)));
      if constexpr (ScalarTraits<S>::derivatives > 0) {
        const P gx = by_x + fy * by_both, gy = by_y + fx * by_both;
        for (std::size_t i = 0; i < r.d.size(); ++i) r.d[i] = gx * fx_.d[i] + gy * fy_.d[i];
      }
      return r;
    };
    return {component(0), component(1), component(2), component(3), component(4), component(5)};
  }
  P corner(std::size_t away, std::size_t c) const {
    if constexpr (kWide == 1) {
      return grid_.nodes[first_[0] + away][c];
    } else {
      alignas(64) double values[kLanes];
      for (int k = 0; k < kLanes; ++k) values[k] = grid_.nodes[first_[k] + away][c];
      return Pack::load_aligned(values);
    }
  }
  template <class T>
  OpticalPoint<T> point(const SymmetricTensor<T>& a) const {
    const T order = a.xx + a.yy + a.zz;
    const Vec3<T> n = principal_axis(a);
    const T c(cos_), s(sin_), extraordinary = T(n_o_) + T(dn_) * order;
    return {{c * n.x - s * n.y, s * n.x + c * n.y, n.z},
            T(S(n_o_ * n_o_)),
            extraordinary * extraordinary,
            T(0.0),
            T(0.0),
            T(depth_)};
  }

  const VolumeGrid& grid_;
  S cos_, sin_, n_o_, dn_, depth_, fx_, fy_;
  std::size_t first_[kWide];  ///< node of the first layer at the corner of the ray's cell
  mutable int cell_ = -2;
  mutable SymmetricTensor<S> entry_, exit_;
};

}  // namespace birefit
