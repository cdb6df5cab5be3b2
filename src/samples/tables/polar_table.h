#pragma once
// Light behind a sphere that looks different from all sides: smooth over most of its disc, so that rays at a few
// thousand points serve any number of pixels. The squares lie in coordinates of the disc, not of the picture: they go
// where it goes and grow as it grows.

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "core/chebyshev.h"
#include "core/threads.h"
#include "samples/choices.h"
#include "samples/image.h"

namespace birefit {

/// The disc's coordinates: v = sqrt(1 - rho/edge), 0 at the rim, where light ends like that root, and turn: y/x and
/// -x/y in turn, from -1 to 1 in each quarter that is centred on half an axis; an angle without a trigonometric
/// function, 8 a full turn. A shell's core is a disc of its own, whose rho is the distance at which a ray passes its
/// middle: so begins the way through it at its edge.
namespace disc {
/// squares of level 0; level l has 2^l times as many along either
constexpr int kPanels = 4, kSectors = 8, kLevels = 7;
constexpr int panels(int level) { return kPanels << level; }
constexpr int sectors(int level) { return kSectors << level; }

/// Also with lanes; (0, 0) lies on the positive x axis.
template <class P>
P turn_of(const P& x, const P& y, P& inverse_major) {
  const P ax = max_of(x, -x), ay = max_of(y, -y);
  const auto flat = ax >= ay;
  const P major = select(flat, x, y), there = max_of(ax, ay);
  inverse_major = inverse(select(there < P(1e-100), P(1.0), major));
  const P quarter = select(flat, select(x < P(0.0), P(2.0), P(0.0)), select(y < P(0.0), P(3.0), P(1.0)));
  return P(2.0) * quarter + P(1.0) + select(flat, y, -x) * inverse_major;
}
inline void direction_of(double turn, double& c, double& s) {
  const int quarter = std::clamp(static_cast<int>(turn / 2), 0, 3);
  const double u = turn - 2 * quarter - 1, f = 1 / std::sqrt(1 + u * u);
  const double cs[4] = {f, -u * f, -f, u * f}, sn[4] = {u * f, f, -u * f, -f};
  c = cs[quarter];
  s = sn[quarter];
}
/// The place (across, around), each from 0 to 1, in a square.
inline double v_in(const DiscSquare& q, double across) { return (q.panel + across) / panels(q.level); }
inline double turn_in(const DiscSquare& q, double around) { return (q.sector + around) * 8 / sectors(q.level); }
}  // namespace disc

/// Which square of a list a place of the disc lies in: by the squares of the finest level.
class DiscMap {
 public:
  DiscMap() = default;
  /// Of the squares of the core, or of the others.
  explicit DiscMap(const std::vector<DiscSquare>& squares, bool of_core = false)
      : at_(static_cast<std::size_t>(kAcross * kAround), -1) {
    for (std::size_t i = 0; i < squares.size(); ++i) {
      const DiscSquare& q = squares[i];
      if (q.of_core != of_core) continue;
      const int size = 1 << (disc::kLevels - 1 - q.level);
      for (int r = q.sector * size; r < (q.sector + 1) * size; ++r)
        for (int c = q.panel * size; c < (q.panel + 1) * size; ++c)
          at_[static_cast<std::size_t>(r * kAcross + c)] = static_cast<int>(i);
    }
  }
  /// The square's number in the list, -1 where none covers the place, one a lane.
  template <class P>
  P find(const P& v, const P& turn) const {
    using std::floor;
    const P column = min_of(max_of(floor(v * P(kAcross)), P(0.0)), P(kAcross - 1.0)),
            row = min_of(max_of(floor(turn * P(kAround / 8.0)), P(0.0)), P(kAround - 1.0));
    const P cell = column + P(kAcross) * row;
    if constexpr (std::is_same_v<P, Pack>) {
      alignas(64) double which[kLanes];
      for (int k = 0; k < kLanes; ++k) which[k] = at_[static_cast<std::size_t>(lane(cell, k))];
      return Pack::load_aligned(which);
    } else {
      return at_[static_cast<std::size_t>(cell)];
    }
  }
  const std::vector<int>& cells() const { return at_; }

 private:
  static constexpr int kAcross = disc::panels(disc::kLevels - 1), kAround = disc::sectors(disc::kLevels - 1);
  std::vector<int> at_;
};

/// The parts of `before` no longer hold what `now` was made for.
inline bool outgrown_disc(const std::vector<DiscSquare>& now, const std::vector<DiscSquare>& before) {
  if (now.empty() || before.empty()) return now.empty() != before.empty();
  for (const bool of_core : {false, true}) {
    const DiscMap now_at(now, of_core), before_at(before, of_core);
    for (std::size_t i = 0; i < now_at.cells().size(); ++i) {
      const int new_one = now_at.cells()[i], old_one = before_at.cells()[i];
      if ((new_one < 0) != (old_one < 0)) return true;  // the core has come to be a disc of its own
      if (new_one < 0) break;
      const DiscSquare &a = now[static_cast<std::size_t>(new_one)], &b = before[static_cast<std::size_t>(old_one)];
      if (a.steps > 1.25 * b.steps + 1 || (b.smooth && (!a.smooth || a.level > b.level))) return true;
    }
  }
  return false;
}

/// f(value, lanes that have it) for every value among the lanes where `here`, from the smallest on.
template <class P, class Mask, class F>
void for_each_value(const P& values, const Mask& here, const F& f) {
  const P of_interest = select(here, values, P(1e300));
  for (double next = smallest(of_interest); next < 1e300;
       next = smallest(select(of_interest > P(next), of_interest, P(1e300))))
    f(next, of_interest == P(next));
}

/// Polynomials of degree 11 in v and in turn through 12 x 12 Chebyshev points of every smooth square. Derivatives by
/// parameters are tabulated beside the values, those by place come from the polynomials.
template <class S>
class PolarTable {
 public:
  static constexpr int kPoints = 12;
  static constexpr int kRays = kPoints * kPoints;
  using P = PlainOf<S>;

  PolarTable() = default;
  /// light(square, v, cos, sin of the azimuth) at points of the disc, one a lane. What was smooth when it was planned
  /// need not be: a core's edge, a pole may have come in since. Squares whose tail (chebyshev.h) exceeds `allowed` are
  /// left to rays.
  template <class Light>
  PolarTable(const std::vector<DiscSquare>& squares, double allowed, int threads, const Light& light)
      : squares_(squares), start_(squares.size(), -1) {
    std::vector<int> list;
    for (std::size_t b = 0; b < squares.size(); ++b)
      if (squares[b].smooth) {
        start_[b] = static_cast<int>(list.size());
        list.push_back(static_cast<int>(b));
      }
    coefficients_.resize(list.size() * kPlanes * kRays);
    parallel_for(static_cast<int>(list.size()), threads, [&](int i) {
      const int b = list[static_cast<std::size_t>(i)];
      const DiscSquare& square = squares_[static_cast<std::size_t>(b)];
      std::vector<double> values(kPlanes * kRays);
      constexpr int kStep = kLanesOf<S>;
      for (int first = 0; first < kRays; first += kStep) {
        alignas(64) double v[kLanes], c[kLanes], s[kLanes];
        for (int k = 0; k < kStep; ++k) {
          const std::size_t n = static_cast<std::size_t>(std::min(first + k, kRays - 1));
          v[k] = disc::v_in(square, 0.5 + 0.5 * rule().x[n % kPoints]);
          disc::direction_of(disc::turn_in(square, 0.5 + 0.5 * rule().x[n / kPoints]), c[k], s[k]);
        }
        S value;
        if constexpr (kStep == 1)
          value = light(b, v[0], c[0], s[0]);
        else
          value = light(b, Pack::load_aligned(v), Pack::load_aligned(c), Pack::load_aligned(s));
        for (int k = 0; k < std::min(kStep, kRays - first); ++k) {
          double* to = values.data() + first + k;
          to[0] = lane(plain(value), k);
          if constexpr (kPlanes > 1)
            for (int j = 1; j < kPlanes; ++j) to[j * kRays] = lane(value.d[static_cast<std::size_t>(j - 1)], k);
        }
      }
      if (!(tail<kPoints>(values.data()) <= allowed)) {
        start_[static_cast<std::size_t>(b)] = -1;
        return;
      }
      for (int plane = 0; plane < kPlanes; ++plane)
        to_powers<kPoints>(
            values.data() + plane * kRays,
            coefficients_.data() + (static_cast<std::size_t>(i) * kPlanes + static_cast<std::size_t>(plane)) * kRays);
    });
    // Parameters that only move the disc have nothing here.
    for (int plane = 1; plane < kPlanes; ++plane) {
      double most = 0;
      for (std::size_t i = 0; i < list.size(); ++i) {
        const double* c = coefficients_.data() + (i * kPlanes + static_cast<std::size_t>(plane)) * kRays;
        most = std::max(most, std::abs(*std::max_element(
                                  c, c + kRays, [](double x, double y) { return std::abs(x) < std::abs(y); })));
      }
      if (most > 0) live_[static_cast<std::size_t>(count_++)] = plane;
    }
  }

  bool empty() const { return coefficients_.empty(); }
  /// What the light changes with its place.
  struct Slopes {
    P by_v = P(0.0), by_turn = P(0.0);
  };
  /// The light at v, turn where `here`, square by DiscMap::find, with the derivatives it has where it is; those that it
  /// owes to a place that moves follow from `slopes`, which are left alone where S has no derivatives. Returns those of
  /// these lanes that lie in a square that is not smooth.
  template <class Mask>
  Mask read(const P& square, const P& v, const P& turn, const Mask& here, S& out, Slopes& slopes) const {
    out = S(0.0);
    Mask left = here;
    // Lanes are neighbours in the picture and mostly lie in one square: its coefficients are single numbers for all of
    // them.
    for_each_value(square, here, [&](double number, const auto& in_it) {
      const int start = start_[static_cast<std::size_t>(number)];
      if (start < 0) return;
      left = left && !in_it;
      const DiscSquare& q = squares_[static_cast<std::size_t>(number)];
      const double* c = coefficients_.data() + static_cast<std::size_t>(start) * (kPlanes * kRays);
      const double across = 2.0 * disc::panels(q.level), around = 0.25 * disc::sectors(q.level);
      // in the square, each from -1 to 1
      const P x = v * P(across) - P(2.0 * q.panel + 1), y = turn * P(around) - P(2.0 * q.sector + 1);
      if constexpr (kPlanes == 1) {
        out = select(in_it, polynomial(c, x, y), out);
      } else {
        P by_x, by_y;
        out.value = select(in_it, polynomial(c, x, y, by_x, by_y), out.value);
        slopes.by_v = select(in_it, by_x * P(across), slopes.by_v);
        slopes.by_turn = select(in_it, by_y * P(around), slopes.by_turn);
        for (int k = 0; k < count_; ++k) {
          const std::size_t plane = static_cast<std::size_t>(live_[static_cast<std::size_t>(k)]);
          out.d[plane - 1] = select(in_it, polynomial(c + plane * kRays, x, y), out.d[plane - 1]);
        }
      }
    });
    return left;
  }

 private:
  static constexpr int kPlanes = 1 + ScalarTraits<S>::derivatives;

  static P polynomial(const double* c, const P& x, const P& y) {
    P value(0.0);
    for (int j = kPoints - 1; j >= 0; --j) {
      const double* row = c + j * kPoints;
      P f(row[kPoints - 1]);
      for (int i = kPoints - 2; i >= 0; --i) f = f * x + P(row[i]);
      value = value * y + f;
    }
    return value;
  }
  static P polynomial(const double* c, const P& x, const P& y, P& by_x, P& by_y) {
    P value(0.0);
    by_x = by_y = P(0.0);
    for (int j = kPoints - 1; j >= 0; --j) {
      const double* row = c + j * kPoints;
      P f(row[kPoints - 1]), slope(0.0);
      for (int i = kPoints - 2; i >= 0; --i) {
        slope = slope * x + f;
        f = f * x + P(row[i]);
      }
      by_y = by_y * y + value;
      value = value * y + f;
      by_x = by_x * y + slope;
    }
    return value;
  }
  static const ChebyshevRule<kPoints>& rule() { return chebyshev_rule<kPoints>(); }

  std::vector<DiscSquare> squares_;
  std::vector<int> start_;            ///< place among the coefficients, -1 = not smooth
  std::vector<double> coefficients_;  ///< [smooth square][plane][power of turn][power of v], plane 0 the value
  std::array<int, static_cast<std::size_t>(kPlanes)> live_{};  ///< derivatives that do not vanish
  int count_ = 0;
};

}  // namespace birefit
