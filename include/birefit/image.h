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
  /// All samples `fill`; width and height >= 0.
  Grid(int width, int height, T fill = T{})
      : width_(width), height_(height), values_(static_cast<std::size_t>(width) * height, fill) {}

  /// Columns.
  int width() const { return width_; }
  /// Rows.
  int height() const { return height_; }
  /// Width times height.
  std::size_t size() const { return values_.size(); }
  /// No samples.
  bool empty() const { return values_.empty(); }

  /// The sample in a column, from 0 at the left, and a row, from 0 on top; not checked.
  T& operator()(int column, int row) { return values_[static_cast<std::size_t>(row) * width_ + column]; }
  /// The same, to read.
  const T& operator()(int column, int row) const { return values_[static_cast<std::size_t>(row) * width_ + column]; }
  /// The first of the `width()` samples of row r, which lie side by side; not checked.
  T* row(int r) { return values_.data() + static_cast<std::size_t>(r) * width_; }
  /// The same, to read.
  const T* row(int r) const { return values_.data() + static_cast<std::size_t>(r) * width_; }
  /// All samples, row after row from the top.
  std::vector<T>& values() { return values_; }
  /// The same, to read.
  const std::vector<T>& values() const { return values_; }

 private:
  int width_ = 0;
  int height_ = 0;
  std::vector<T> values_;
};

/// One channel of linear light or of what the declaration says: counts, transmission, intensity.
using Image = Grid<double>;
/// 1 = use the pixel, 0 = leave it out.
using Mask = Grid<std::uint8_t>;

/// Half-open pixel rectangle [x0, x1) x [y0, y1).
struct PixelRect {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  /// Columns.
  int width() const { return x1 - x0; }
  /// Rows.
  int height() const { return y1 - y0; }
  /// Whether the pixel of column x and row y is in it.
  bool contains(int x, int y) const { return x >= x0 && x < x1 && y >= y0 && y < y1; }
  /// The same four numbers.
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
