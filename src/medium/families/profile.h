#pragma once
// Sampled depth profile (slab scenes): u = depth / thickness.

#include <algorithm>
#include <memory>
#include <vector>

#include "birefit/scene.h"
#include "medium/column.h"

namespace birefit {

/// Interpolation coefficients of a profile, made once and shared by all scalars.
/// `constant`: piece i is a layer. `linear`: piecewise linear in the (sign-aligned) axis components, normalised
/// afterwards, and in the complex indices. `cubic`: natural cubic splines of the same.
class ProfileTable {
 public:
  explicit ProfileTable(const SlabProfile& profile);
  double thickness_um() const { return thickness_um_; }
  bool absorbing() const { return absorbing_; }
  bool jumps() const { return jumps_; }
  const std::vector<double>& edges() const { return edges_; }  ///< of the pieces in u: 0 = first, 1 = last

  struct Piece {
    double from;     ///< u at the start of the piece
    double c[7][4];  ///< ax, ay, az, n_o, n_e, k_o, k_e as cubics in (u - from)
  };
  const Piece& piece_at(double u) const {
    const auto it = std::upper_bound(edges_.begin() + 1, edges_.end() - 1, u);
    return pieces_[static_cast<std::size_t>(it - edges_.begin() - 1)];
  }

 private:
  double thickness_um_ = 0;
  bool absorbing_ = false, jumps_ = false;
  std::vector<double> edges_;
  std::vector<Piece> pieces_;
};

template <class S>
struct ProfileLaw {
  std::shared_ptr<const ProfileTable> table;
  template <class T>
  OpticalPoint<T> at(const T& u) const {
    const ProfileTable::Piece& piece = table->piece_at(lane(plain(u), 0));
    const T x = u - piece.from;
    T v[7];
    for (int i = 0; i < 7; ++i) v[i] = ((x * piece.c[i][3] + piece.c[i][2]) * x + piece.c[i][1]) * x + piece.c[i][0];
    // (n + i k)^2 = n^2 - k^2 + 2 i n k
    return {normalized(Vec3<T>{v[0], v[1], v[2]}),
            v[3] * v[3] - v[5] * v[5],
            v[4] * v[4] - v[6] * v[6],
            2.0 * v[3] * v[5],
            2.0 * v[4] * v[6],
            T(table->thickness_um())};
  }
};

}  // namespace birefit
