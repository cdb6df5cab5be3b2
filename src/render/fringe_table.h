#pragma once
// Fringes interpolated over squares of the picture: their phase and amplitudes are smooth where the intensity is not, so
// that a few rays serve thousands of pixels.

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "core/threads.h"
#include "render/chebyshev.h"
#include "render/fringe.h"
#include "render/pixel_model.h"

namespace birefit {

/// Squares of `block_px` pixels side by side from column -1, row -1 on (the picture's rim), row by row.
struct FringeBlocks {
  int columns = 0, rows = 0, block_px = 0;
  FringeBlocks(int width, int height, int block)
      : columns((width + 2 + block - 1) / block), rows((height + 2 + block - 1) / block), block_px(block) {}
  int count() const { return columns * rows; }
};

/// Polynomials of degree 7 in column and row through 8 x 8 Chebyshev points of every square that is asked for.
template <class S>
class FringeTable {
 public:
  static constexpr int kPoints = 8;
  static constexpr int kRays = kPoints * kPoints;
  using P = PlainOf<S>;

  FringeTable() = default;
  /// ray(column, row): the fringe at points of the picture, one a lane. `wanted`: one flag a square.
  template <class Ray>
  FringeTable(const FringeBlocks& blocks, const std::vector<std::uint8_t>& wanted, int threads, const Ray& ray)
      : blocks_(blocks), start_(wanted.size(), -1) {
    std::vector<int> list;
    for (std::size_t b = 0; b < wanted.size(); ++b)
      if (wanted[b]) {
        start_[b] = static_cast<int>(list.size());
        list.push_back(static_cast<int>(b));
      }
    coefficients_.resize(list.size() * kBlock);
    parallel_for(static_cast<int>(list.size()), threads, [&](int i) {
      const int b = list[static_cast<std::size_t>(i)];
      std::vector<double> values(kBlock);
      constexpr int kStep = kLanesOf<S>;
      for (int first = 0; first < kRays; first += kStep) {
        alignas(64) double column[kLanes], row[kLanes];
        for (int k = 0; k < kStep; ++k) {
          const int n = std::min(first + k, kRays - 1);
          column[k] = place(b % blocks_.columns, rule().x[static_cast<std::size_t>(n % kPoints)]);
          row[k] = place(b / blocks_.columns, rule().x[static_cast<std::size_t>(n / kPoints)]);
        }
        FringePoint<S> p;
        if constexpr (kStep == 1)
          p = ray(column[0], row[0]);
        else
          p = ray(Pack::load_aligned(column), Pack::load_aligned(row));
        for (int k = 0; k < std::min(kStep, kRays - first); ++k) {
          const S* parts[kFields] = {&p.amplitude, &p.phase, &p.mean, &p.quadrature};
          for (int f = 0; f < kFields; ++f) {
            double* to = values.data() + f * kPlanes * kRays + first + k;
            to[0] = lane(plain(*parts[f]), k);
            if constexpr (kPlanes > 1)
              for (int j = 1; j < kPlanes; ++j) to[j * kRays] = lane(parts[f]->d[static_cast<std::size_t>(j - 1)], k);
          }
        }
      }
      double* out = coefficients_.data() + static_cast<std::size_t>(i) * kBlock;
      for (int plane = 0; plane < kFields * kPlanes; ++plane) to_powers<kPoints>(values.data() + plane * kRays, out + plane * kRays);
    });
  }

  /// False where the lanes do not lie in one square that was asked for, or not in one row of the picture.
  bool read(const P& column, const P& row, bool quadrature, FringePoint<S>& out) const {
    if (start_.empty()) return false;
    const double y = lane(row, 0);
    if (kLanesOf<S> > 1 && (smallest(row) != y || largest(row) != y)) return false;
    const auto at = [&](double x) { return static_cast<int>(std::floor((x + 1) / blocks_.block_px)); };
    const int bx = at(smallest(column)), by = at(y);
    if (at(largest(column)) != bx || bx < 0 || by < 0 || bx >= blocks_.columns || by >= blocks_.rows) return false;
    const int start = start_[static_cast<std::size_t>(by * blocks_.columns + bx)];
    if (start < 0) return false;
    const double per_px = 2.0 / blocks_.block_px;
    const P x = (column - P(bx * blocks_.block_px - 1.0)) * P(per_px) - P(1.0);
    const double down = (y - (by * blocks_.block_px - 1.0)) * per_px - 1;
    const double* c = coefficients_.data() + static_cast<std::size_t>(start) * kBlock;
    S* parts[kFields] = {&out.amplitude, &out.phase, &out.mean, &out.quadrature};
    for (int f = 0; f < kFields; ++f) {
      if (f == 3 && !quadrature) {
        *parts[f] = S(0.0);
        continue;
      }
      const double* field = c + f * kPlanes * kRays;
      if constexpr (kPlanes == 1) {
        *parts[f] = polynomial(field, x, down);
      } else {
        parts[f]->value = polynomial(field, x, down);
        for (int j = 1; j < kPlanes; ++j) parts[f]->d[static_cast<std::size_t>(j - 1)] = polynomial(field + j * kRays, x, down);
      }
    }
    return true;
  }

 private:
  static constexpr int kFields = 4;
  static constexpr int kPlanes = 1 + ScalarTraits<S>::derivatives;
  static constexpr int kBlock = kFields * kPlanes * kRays;  ///< [field][plane][power of row][power of column]

  double place(int block, double x) const { return (block + 0.5 + 0.5 * x) * blocks_.block_px - 1; }
  static P polynomial(const double* c, const P& x, double y) {
    alignas(64) double row[kPoints];
    for (int i = 0; i < kPoints; ++i) row[i] = c[(kPoints - 1) * kPoints + i];
    for (int j = kPoints - 2; j >= 0; --j)
      for (int i = 0; i < kPoints; ++i) row[i] = row[i] * y + c[j * kPoints + i];
    const P square = x * x;
    P even(row[kPoints - 2]), odd(row[kPoints - 1]);
    for (int i = kPoints - 4; i >= 0; i -= 2) {
      even = even * square + P(row[i]);
      odd = odd * square + P(row[i + 1]);
    }
    return odd * x + even;
  }
  static const ChebyshevRule<kPoints>& rule() { return chebyshev_rule<kPoints>(); }

  FringeBlocks blocks_{0, 0, 1};
  std::vector<int> start_;  ///< place among the coefficients, -1 = not asked for
  std::vector<double> coefficients_;
};

}  // namespace birefit
