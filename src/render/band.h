#pragma once
// Bands of rows, which threads paint one by one: what they hold of them.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "birefit/plan.h"
#include "core/scalar.h"
#include "samples/tables/fringe_table.h"

namespace birefit {

/// How many samples the pixels of a part of one row take, by plan.means.samples. Rings of equal samples are painted
/// from the inside out; a root a ring and row instead of one a pixel.
class SampleRings {
 public:
  explicit SampleRings(const RenderPlan& plan) : center_x_(plan.means.center_x_px), center_y_(plan.means.center_y_px) {
    rings_.push_back(
        {0, plan.means.samples.empty() ? std::uint8_t{1} : static_cast<std::uint8_t>(plan.means.samples[0])});
    for (std::size_t i = 1; i < plan.means.samples.size(); ++i)
      if (plan.means.samples[i] != plan.means.samples[i - 1])
        rings_.push_back(
            {static_cast<double>(i) * plan.means.bin_px, static_cast<std::uint8_t>(plan.means.samples[i])});
  }
  void fill(int row, int first_column, std::uint8_t* out, int width) const {
    std::fill(out, out + width, rings_[0].samples);
    const double dy = row - center_y_, middle = center_x_ - first_column, w = width;
    for (std::size_t i = 1; i < rings_.size(); ++i) {
      const double square = rings_[i].radius * rings_[i].radius - dy * dy, half = square > 0 ? std::sqrt(square) : 0;
      const int left = static_cast<int>(std::clamp(std::floor(middle - half) + 1, 0.0, w));
      const int right = static_cast<int>(std::clamp(std::ceil(middle + half), 0.0, w));
      std::fill(out, out + std::min(left, right), rings_[i].samples);
      std::fill(out + right, out + width, rings_[i].samples);
    }
  }

 private:
  struct Ring {
    double radius;
    std::uint8_t samples;
  };
  double center_x_, center_y_;
  std::vector<Ring> rings_;
};

/// Which points of a row are needed: one-sample pixels and their neighbours, `reach` pixels around them.
class NeededPoints {
 public:
  /// samples(r): those of row r, -reach to reach, w places each.
  template <class Samples>
  void find(int reach, const Samples& samples, int w) {
    const std::uint8_t* here = samples(0);
    all_ = std::all_of(here, here + w, [](std::uint8_t n) { return n == 1; });
    if (all_) return;
    const std::size_t size = static_cast<std::size_t>(w), margin = static_cast<std::size_t>(reach);
    near_.assign(size + 2 * margin, 0);
    flags_.assign(size, 0);
    std::uint8_t *near = near_.data(), *flags = flags_.data();
    for (int r = -reach; r <= reach; ++r) {
      const std::uint8_t* n = samples(r);
      for (std::size_t c = 0; c < size; ++c) near[c + margin] |= n[c] == 1;
    }
    for (std::size_t shift = 0; shift <= 2 * margin; ++shift)
      for (std::size_t c = 0; c < size; ++c) flags[c] |= near[c + shift];
  }
  bool all() const { return all_; }
  bool any(int first, int count) const {
    if (all_) return true;
    const auto from = flags_.begin() + first;
    return std::find(from, from + count, 1) != from + count;
  }

 private:
  bool all_ = false;
  std::vector<std::uint8_t> near_, flags_;
};

/// What a thread works on: a band of rows with `reach` more on either side. Rows are counted from the band's first,
/// columns from the picture's rim, which is as wide as that of the squares of a table: their runs begin at a register's
/// boundary. Point values of the last rows are at row(field * planes + plane, r); one field, the intensity, or with
/// plan.means.fringes the four of a FringePoint.
class Band {
 public:
  static constexpr int kRim = FringeBlocks::kRim;
  /// Many rows, so that few are computed twice; few, so that threads end together.
  static constexpr int kRows = 25;
  void resize(int width, int planes, int reach) {
    held_ = 2 * reach + 1;
    used_ = (static_cast<std::size_t>(width) + 2 * kRim + kLanes - 1) / kLanes * kLanes;
    // A register more, and an odd number of cache lines: rows that begin at the same place of a page push each other
    // out of the cache.
    constexpr std::size_t kLine = 8;
    wide_ = ((used_ + kLanes + kLine - 1) / kLine | 1) * kLine;
    plane_ = wide_ * static_cast<std::size_t>(held_);
    points_.resize(std::max(points_.size(), plane_ * static_cast<std::size_t>(planes)));
    samples_.resize(wide_ * (kRows + 4 * kRim));
  }
  double* row(int plane, int r) {
    return points_.data() + static_cast<std::size_t>(plane) * plane_ +
           static_cast<std::size_t>((r + held_) % held_) * wide_;
  }
  /// Makes zeros of all of a row that is not computed: what is left of another picture would steer whole registers
  /// (PixelMoments). Without `gaps` that is what lies beyond its end.
  void clear(int plane, int r, bool gaps) { std::fill(row(plane, r) + (gaps ? 0 : used_), row(plane, r) + wide_, 0.0); }
  /// Samples of row r, from -2 kRim on.
  std::uint8_t* samples(int r) { return samples_.data() + static_cast<std::size_t>(r + 2 * kRim) * wide_; }

 private:
  int held_ = 0;
  std::size_t used_ = 0, wide_ = 0, plane_ = 0;
  std::vector<double, xsimd::aligned_allocator<double, 64>> points_;
  std::vector<std::uint8_t> samples_;
};

}  // namespace birefit
