#pragma once
// Fringes interpolated over squares of the picture: their phase and amplitudes are smooth where the intensity is not,
// so that a few rays serve thousands of pixels.

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "core/chebyshev.h"
#include "core/threads.h"
#include "samples/fringe.h"
#include "samples/image.h"

namespace birefit {

/// Squares of `block_px` pixels side by side from the picture's rim on, row by row.
struct FringeBlocks {
  static constexpr int kRim = 2;  ///< pixels around the picture whose fringes its edge needs
  int columns = 0, rows = 0, block_px = 0;
  FringeBlocks(int width, int height, int block)
      : columns((width + 2 * kRim + block - 1) / block),
        rows((height + 2 * kRim + block - 1) / block),
        block_px(block) {}
  int count() const { return columns * rows; }
};

/// What a thread keeps of one row of one picture while it goes along it.
struct FringeScratch {
  double row = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> lines;
};

/// Polynomials of degree 11 in column and row through 12 x 12 Chebyshev points of every square that is asked for.
template <class S>
class FringeTable {
 public:
  static constexpr int kPoints = 12;
  static constexpr int kRays = kPoints * kPoints;
  using P = PlainOf<S>;

  FringeTable() = default;
  /// ray(column, row): the fringe at points of the picture, one a lane, in a scalar whose k-th derivative is the
  /// derivatives[k]-th of S. `wanted`: one flag a square. What was smooth when it was planned need not be, the image of
  /// the optic axis may have come in since: squares whose tail (chebyshev.h) would change the intensity by more than
  /// `allowed` are left to rays.
  template <class Ray>
  FringeTable(const FringeBlocks& blocks, const std::vector<std::uint8_t>& wanted, double allowed, int threads,
              const std::vector<std::size_t>& derivatives, const Ray& ray)
      : blocks_(blocks), start_(wanted.size(), -1), derivatives_(derivatives), planes_(1 + derivatives.size()) {
    std::vector<int> list;
    for (std::size_t b = 0; b < wanted.size(); ++b)
      if (wanted[b]) {
        start_[b] = static_cast<int>(list.size());
        list.push_back(static_cast<int>(b));
      }
    const std::size_t block_size = kFields * planes_ * kRays;
    std::vector<double> values(list.size() * block_size);
    coefficients_.resize(values.size());
    constexpr int kStep = kLanesOf<S>, kSteps = (kRays + kStep - 1) / kStep;
    parallel_for(static_cast<int>(list.size()) * kSteps, threads, [&](int step) {
      const int i = step / kSteps, b = list[static_cast<std::size_t>(i)], first = step % kSteps * kStep;
      alignas(64) double column[kLanes], row[kLanes];
      for (int k = 0; k < kStep; ++k) {
        const int n = std::min(first + k, kRays - 1);
        column[k] = place(b % blocks_.columns, rule().x[static_cast<std::size_t>(n % kPoints)]);
        row[k] = place(b / blocks_.columns, rule().x[static_cast<std::size_t>(n / kPoints)]);
      }
      const auto p = [&] {
        if constexpr (kStep == 1)
          return ray(column[0], row[0]);
        else
          return ray(Pack::load_aligned(column), Pack::load_aligned(row));
      }();
      using R = decltype(p.amplitude);
      const R* parts[kFields] = {&p.amplitude, &p.phase, &p.mean, &p.quadrature};
      for (int k = 0; k < std::min(kStep, kRays - first); ++k)
        for (std::size_t f = 0; f < kFields; ++f) {
          double* to = values.data() + static_cast<std::size_t>(i) * block_size + f * planes_ * kRays + first + k;
          to[0] = lane(plain(*parts[f]), k);
          if constexpr (ScalarTraits<R>::derivatives > 0)
            for (std::size_t j = 1; j < planes_; ++j) to[j * kRays] = lane(parts[f]->d[j - 1], k);
        }
    });
    for (std::size_t i = 0; i < list.size(); ++i) {
      const auto field = [&](std::size_t f) { return values.data() + (i * kFields + f) * planes_ * kRays; };
      const auto largest_of = [&](std::size_t f) {
        return std::abs(*std::max_element(field(f), field(f) + kRays,
                                          [](double a, double b) { return std::abs(a) < std::abs(b); }));
      };
      const double left = tail<kPoints>(field(0)) + tail<kPoints>(field(2)) + tail<kPoints>(field(3)) +
                          (largest_of(0) + largest_of(3)) * tail<kPoints>(field(1));
      if (!(left <= allowed)) start_[static_cast<std::size_t>(list[i])] = kGone;
      const auto largest_slope = [&](std::size_t f, int order) { return largest_derivative<kPoints>(field(f), order); };
      steepest_ = std::max(
          steepest_, largest_slope(0, 1) + largest_slope(2, 1) + (largest_of(0) + largest_of(3)) * largest_slope(1, 1));
      most_third_ = std::max(most_third_, largest_slope(0, 3) + largest_slope(2, 3) + largest_slope(3, 3));
    }
    fields_.fill({.own = 0});
    fields_[0] = {};
    for (std::size_t plane = 1; plane < planes_; ++plane)
      fields_[derivatives_[plane - 1] + 1] = fields_of(values, list.size(), plane);
    parallel_for(static_cast<int>(list.size() * kFields * planes_), threads, [&](int plane) {
      const std::size_t at = static_cast<std::size_t>(plane) * kRays;
      to_powers<kPoints>(values.data() + at, coefficients_.data() + at);
    });
  }

  /// The fringes of up to `count` columns of a row of the picture from `column` on: out[field * (1 + derivatives of S)
  /// + plane][i] becomes those of column + i, fields in the order of FringePoint, those that fields() names. Returns of
  /// how many: up to the end of a square, 0 in one that was not asked for. Places up to the next whole number of lanes
  /// are overwritten. `scratch` belongs to this table and one thread.
  int run(int column, double row, int count, bool quadrature, FringeScratch& scratch, double* const* out) const {
    const std::size_t fields = quadrature ? kFields : kFields - 1;
    const double* line = line_at(column, row, fields, scratch);
    if (!line) return 0;
    const int bx = (column + kRim) / blocks_.block_px,
              end = std::min(column + count, (bx + 1) * blocks_.block_px - kRim);
    const double per_px = 2.0 / blocks_.block_px, first = (column + kRim - bx * blocks_.block_px) * per_px - 1;
    alignas(64) double steps[kLanes];
    for (int k = 0; k < kLanes; ++k) steps[k] = first + k * per_px;
    P x0;
    if constexpr (kLanesOf < S >> 1)
      x0 = P::load_aligned(steps);
    else
      x0 = first;
    for (std::size_t f = 0; f < fields; ++f, line += kOut * kPoints)
      for (std::size_t plane = 0; plane < kOut; ++plane) {
        if (!fields_[plane].has(f)) continue;
        std::array<P, kPoints> c;
        for (std::size_t i = 0; i < kPoints; ++i) c[i] = P(line[plane * kPoints + i]);
        double* to = out[f * kOut + plane];
        P x = x0;
        for (int i = 0; i < end - column; i += kLanesOf<S>, x = x + P(kLanesOf<S> * per_px)) {
          const P square = x * x;
          P even = c[kPoints - 2], odd = c[kPoints - 1];
          for (std::size_t k = kPoints - 2; k >= 2; k -= 2) {
            even = even * square + c[k - 2];
            odd = odd * square + c[k - 1];
          }
          const P value = odd * x + even;
          if constexpr (kLanesOf < S >> 1)
            value.store_unaligned(to + i);
          else
            to[i] = value;
        }
      }
    return end - column;
  }

  /// From now on the mean field is its mean over a pixel, as far as its curvature makes one, for a picture of which
  /// none is traced.
  void average_means() {
    const double share = square(2.0 / blocks_.block_px) / 24;
    for (std::size_t i = 0; i < coefficients_.size() / (kFields * planes_ * kRays); ++i)
      for (std::size_t plane = 0; plane < planes_; ++plane) {
        double* c = coefficients_.data() + ((i * kFields + 2) * planes_ + plane) * kRays;
        // Upwards: a power's curvature is made of higher ones, which are as they were.
        for (std::size_t j = 0; j < kPoints; ++j)
          for (std::size_t k = 0; k < kPoints; ++k) {
            double bend = 0;
            if (k + 2 < kPoints) bend += static_cast<double>((k + 1) * (k + 2)) * c[j * kPoints + k + 2];
            if (j + 2 < kPoints) bend += static_cast<double>((j + 1) * (j + 2)) * c[(j + 2) * kPoints + k];
            c[j * kPoints + k] += share * bend;
          }
      }
  }

  /// What changes with derivative plane - 1 of S, fields left out to which no square owes more than rounding of it:
  /// run() does not write them.
  FringeFields fields(std::size_t plane) const { return fields_[plane]; }
  /// None is left out, for a picture of which a part is traced.
  void keep_all_fields() {
    for (const std::size_t d : derivatives_) fields_[d + 1] = {};
  }
  /// By which part of the fringes' largest slope differences over three pixels miss that of amplitude, mean and
  /// quadrature: a sixth of the third derivative.
  double slope_error() const {
    return steepest_ > 0 ? square(2.0 / blocks_.block_px) * most_third_ / (6 * steepest_) : 0;
  }
  /// All squares that were asked for are there.
  bool complete() const {
    return std::none_of(start_.begin(), start_.end(), [](int s) { return s == kGone; });
  }

  /// Values at one place; false in a square that was not asked for.
  bool read(double column, double row, FringeScratch& scratch, FringePoint<double>& out) const {
    const double* line = line_at(static_cast<int>(std::floor(column)), row, kFields, scratch);
    if (!line) return false;
    const double at = (column + kRim) / blocks_.block_px, x = 2 * (at - std::floor(at)) - 1;
    double* parts[kFields] = {&out.amplitude, &out.phase, &out.mean, &out.quadrature};
    for (double* part : parts) {
      *part = 0;
      for (std::size_t i = kPoints; i-- > 0;) *part = *part * x + line[i];
      line += kOut * kPoints;
    }
    return true;
  }

 private:
  static constexpr int kGone = -2, kRim = FringeBlocks::kRim;
  static constexpr std::size_t kFields = 4, kOut = 1 + static_cast<std::size_t>(ScalarTraits<S>::derivatives);

  double place(int block, double x) const { return (block + 0.5 + 0.5 * x) * blocks_.block_px - kRim; }
  /// What of a derivative is not negligible: a phase counts as much as the amplitude that it turns.
  FringeFields fields_of(const std::vector<double>& values, std::size_t squares, std::size_t plane) const {
    std::array<double, kFields> value{}, change{};
    for (std::size_t i = 0; i < squares; ++i)
      for (std::size_t f = 0; f < kFields; ++f)
        for (int k = 0; k < kRays; ++k) {
          const double* at = values.data() + (i * kFields + f) * planes_ * kRays + k;
          value[f] = std::max(value[f], std::abs(at[0]));
          change[f] = std::max(change[f], std::abs(at[plane * kRays]));
        }
    const double fringes = value[0] + value[3], all = change[0] + change[1] * fringes + change[2] + change[3];
    FringeFields fields{.own = 0};
    for (std::size_t f = 0; f < kFields; ++f)
      if (!(change[f] * (f == 1 ? fringes : 1) <= 1e-14 * all)) fields.own |= 1u << f;
    if (!fields.has(1)) return fields;
    double along = 0, square = 0, beside = 0;
    const auto of_phase = [&](const auto& work) {
      for (std::size_t i = 0; i < squares; ++i) {
        const double* at = values.data() + (i * kFields + 1) * planes_ * kRays;
        for (int k = 0; k < kRays; ++k) work(at[k], at[plane * kRays + static_cast<std::size_t>(k)]);
      }
    };
    of_phase([&](double phase, double by) { along += phase * by, square += phase * phase; });
    const double share = square > 0 ? along / square : 0;
    of_phase([&](double phase, double by) { beside = std::max(beside, std::abs(by - share * phase)); });
    if (beside <= 1e-13 * change[1]) fields.own &= ~2u, fields.phase_share = share;
    return fields;
  }
  const double* line_at(int column, double row, std::size_t fields, FringeScratch& scratch) const {
    if (start_.empty()) return nullptr;
    const int bx = (column + kRim) / blocks_.block_px,
              by = static_cast<int>(std::floor((row + kRim) / blocks_.block_px));
    if (column < -kRim || by < 0 || bx >= blocks_.columns || by >= blocks_.rows ||
        start_[static_cast<std::size_t>(by * blocks_.columns + bx)] < 0)
      return nullptr;
    if (scratch.row != row) follow_row(row, by, fields, scratch);
    return scratch.lines.data() + static_cast<std::size_t>(bx) * kFields * kOut * kPoints;
  }
  /// Polynomials of the column alone for one row: [square][field][value and derivatives of S][power], of the first
  /// `fields`.
  void follow_row(double row, int by, std::size_t fields, FringeScratch& scratch) const {
    const double per_px = 2.0 / blocks_.block_px, y = (row - (by * blocks_.block_px - kRim)) * per_px - 1;
    scratch.row = row;
    scratch.lines.assign(static_cast<std::size_t>(blocks_.columns) * kFields * kOut * kPoints, 0.0);
    for (int bx = 0; bx < blocks_.columns; ++bx) {
      const int start = start_[static_cast<std::size_t>(by * blocks_.columns + bx)];
      if (start < 0) continue;
      for (std::size_t f = 0; f < fields; ++f) {
        const double* c = coefficients_.data() + (static_cast<std::size_t>(start) * kFields + f) * planes_ * kRays;
        double* line = scratch.lines.data() + (static_cast<std::size_t>(bx) * kFields + f) * kOut * kPoints;
        for (std::size_t plane = 0; plane < planes_; ++plane) {
          if (plane > 0 && !fields_[derivatives_[plane - 1] + 1].has(f)) continue;
          const double* powers = c + plane * kRays;
          std::array<double, kPoints> value;
          std::copy(powers + kRays - kPoints, powers + kRays, value.begin());
          for (std::size_t j = kPoints - 1; j-- > 0;)
            for (std::size_t i = 0; i < kPoints; ++i) value[i] = value[i] * y + powers[j * kPoints + i];
          std::copy(value.begin(), value.end(), line + (plane == 0 ? 0 : derivatives_[plane - 1] + 1) * kPoints);
        }
      }
    }
  }
  static const ChebyshevRule<kPoints>& rule() { return chebyshev_rule<kPoints>(); }

  FringeBlocks blocks_{0, 0, 1};
  /// place among the coefficients, -1 = not asked for, kGone = no longer smooth
  std::vector<int> start_;
  std::array<FringeFields, kOut> fields_{};
  std::vector<std::size_t> derivatives_;  ///< of S, one a plane after the first
  std::size_t planes_ = 1;
  /// first derivative of the fringes, third of amplitude, mean and quadrature, by half a square
  double steepest_ = 0, most_third_ = 0;
  std::vector<double> coefficients_;  ///< [square][field][plane][power of row][power of column]
};

}  // namespace birefit
