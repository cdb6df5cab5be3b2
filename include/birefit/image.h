#pragma once
// Images in memory: one channel, row-major, row 0 on top (docs/conventions.md). Nothing here knows about files.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace birefit {

/// width x height samples, value(column, row). No ownership games: a value type.
template <class T>
class Grid {
 public:
  Grid() = default;
  Grid(int width, int height, T fill = T{})
      : width_(width), height_(height), values_(static_cast<std::size_t>(width) * height, fill) {}

  int width() const { return width_; }
  int height() const { return height_; }
  std::size_t size() const { return values_.size(); }
  bool empty() const { return values_.empty(); }

  T& operator()(int column, int row) { return values_[static_cast<std::size_t>(row) * width_ + column]; }
  const T& operator()(int column, int row) const { return values_[static_cast<std::size_t>(row) * width_ + column]; }
  T* row(int r) { return values_.data() + static_cast<std::size_t>(r) * width_; }
  const T* row(int r) const { return values_.data() + static_cast<std::size_t>(r) * width_; }
  std::vector<T>& values() { return values_; }
  const std::vector<T>& values() const { return values_; }

 private:
  int width_ = 0;
  int height_ = 0;
  std::vector<T> values_;
};

using Image = Grid<double>;
/// 1 = use the pixel, 0 = leave it out.
using Mask = Grid<std::uint8_t>;

/// Half-open pixel rectangle [x0, x1) x [y0, y1).
struct PixelRect {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  int width() const { return x1 - x0; }
  int height() const { return y1 - y0; }
  bool contains(int x, int y) const { return x >= x0 && x < x1 && y >= y0 && y < y1; }
  friend bool operator==(const PixelRect&, const PixelRect&) = default;
};

/// The samples of a rectangle within the grid.
template <class T>
Grid<T> cropped(const Grid<T>& whole, const PixelRect& part) {
  Grid<T> samples(part.width(), part.height());
  for (int y = 0; y < part.height(); ++y) std::copy_n(whole.row(part.y0 + y) + part.x0, part.width(), samples.row(y));
  return samples;
}

}  // namespace birefit
