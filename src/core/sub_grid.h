#pragma once
// Pictures of which every second pixel is used: one colour, or one analyser, of a mosaic. Neighbours are then those of
// the coarser grid.

#include <cstdlib>
#include <numeric>

#include "birefit/image.h"

namespace birefit {

struct SubGrid {
  int spacing = 1;     ///< of used pixels along both sides
  int x0 = 0, y0 = 0;  ///< the first column and row, below the spacing
  int width = 0, height = 0;
};

/// The coarsest grid that holds all used pixels of a mask, no coarser than a cell of four: what is farther apart is no
/// mosaic. Few pixels say nothing.
inline SubGrid sub_grid(const Mask& mask) {
  constexpr int kFewest = 16, kLargest = 4;
  SubGrid grid{1, 0, 0, mask.width(), mask.height()};
  int first_x = -1, first_y = -1, along_x = 0, along_y = 0, used = 0;
  for (int y = 0; y < mask.height(); ++y)
    for (int x = 0; x < mask.width(); ++x) {
      if (!mask(x, y)) continue;
      if (used++ == 0) first_x = x, first_y = y;
      along_x = std::gcd(along_x, std::abs(x - first_x)), along_y = std::gcd(along_y, y - first_y);
      if (along_x == 1 || along_y == 1) return grid;
    }
  const int spacing = std::gcd(along_x, along_y);
  if (used < kFewest || spacing < 2 || spacing > kLargest) return grid;
  grid.spacing = spacing, grid.x0 = first_x % spacing, grid.y0 = first_y % spacing;
  grid.width = (mask.width() - grid.x0 + spacing - 1) / spacing;
  grid.height = (mask.height() - grid.y0 + spacing - 1) / spacing;
  return grid;
}

/// What lies on the grid; of nothing, nothing.
template <class T>
Grid<T> on_grid(const Grid<T>& whole, const SubGrid& grid) {
  if (whole.empty()) return {};
  Grid<T> part(grid.width, grid.height);
  for (int y = 0; y < grid.height; ++y)
    for (int x = 0; x < grid.width; ++x) part(x, y) = whole(grid.x0 + grid.spacing * x, grid.y0 + grid.spacing * y);
  return part;
}

/// The other way: a part back into its places.
template <class T>
void put_back(const Grid<T>& part, const SubGrid& grid, Grid<T>& whole) {
  for (int y = 0; y < grid.height; ++y)
    for (int x = 0; x < grid.width; ++x) whole(grid.x0 + grid.spacing * x, grid.y0 + grid.spacing * y) = part(x, y);
}

}  // namespace birefit
