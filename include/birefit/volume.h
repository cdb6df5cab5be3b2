#pragma once
// A director field on the nodes of a box: what a simulation of a liquid crystal gives. Files of them: birefit/io.h.

#include <array>
#include <cstddef>
#include <vector>

namespace birefit {

/// The tensor s n n^T at every node, n the director (unit length, sign without meaning), s the order there over the
/// order that the material's birefringence belongs to; 0 = no liquid crystal or an isotropic one (to wave optics all
/// zero is the host). Between nodes the tensor is interpolated, never the vector. Light passes from the first layer of
/// z to the last; x points right and y up in the image.
struct VolumeGrid {
  int nx = 0, ny = 0, nz = 0;  ///< nodes, at least 2 along each
  /// between nodes along x, y, z, > 0: the box is (nx - 1) spacing_um[0] wide
  std::array<double, 3> spacing_um{};
  std::vector<std::array<double, 6>> nodes;  ///< xx, yy, zz, xy, xz, yz; x runs fastest, then y

  /// Index into `nodes`, each of x, y, z from 0; not checked.
  std::size_t at(int x, int y, int z) const {
    return (static_cast<std::size_t>(z) * static_cast<std::size_t>(ny) + static_cast<std::size_t>(y)) *
               static_cast<std::size_t>(nx) +
           static_cast<std::size_t>(x);
  }
};

/// s n n^T.
inline std::array<double, 6> director_tensor(double nx, double ny, double nz, double s = 1) {
  return {s * nx * nx, s * ny * ny, s * nz * nz, s * nx * ny, s * nx * nz, s * ny * nz};
}

}  // namespace birefit
