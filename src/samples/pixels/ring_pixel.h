#pragma once
// Pixels at circles about one middle: a sphere's rim, a core's edge in its middle. See edge_pixels.h.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "samples/pixels/pixel_mean.h"

namespace birefit {

/// Added to a pixel's number of samples a side: an edge passes through it or one beside it.
inline constexpr std::uint8_t kEdgePixel = 128;
/// Pixels whose middles lie so far within or beyond a circle (px) are edge pixels: whoever takes the value in the
/// middle reads its neighbours, and beyond that light is smooth enough for points spread evenly.
inline constexpr double kEdgeWithin = 1.5, kEdgeBeyond = 1.05;
/// As far from a defect.
inline constexpr double kDefectWithin = 2;

/// One pixel at circles about one middle, by polar coordinates about it: fringes at a circle follow it, so an arc needs
/// few points, and from one arc to the next the mean is smooth in the roots of the distances from where it is not.
/// Mirror images, and a picture turned by a right angle, have the same points.
template <class S>
class RingPixel {
 public:
  using P = PlainOf<S>;
  /// `circles`: the rim, and a core's edge, where there is one.
  RingPixel(const SampleImage<S>& model, const std::array<EdgeCircle, 2>& circles, int count, double column, double row)
      : model_(model),
        column_(column),
        row_(row),
        x_(column - circles[0].column),
        y_(row - circles[0].row),
        rim_(circles[0].radius),
        core_(count > 1 ? circles[1].radius : 0),
        around_(model.round() ? 0 : 0.75) {
    constexpr double kNear = kDefectWithin + 1;
    for (const auto& [at_column, at_row] : model.defects())
      if (defect_count_ < defects_.size() && std::hypot(column - at_column, row - at_row) < kNear)
        defects_[defect_count_++] = {at_column - circles[0].column, at_row - circles[0].row};
  }

  /// The mean by about n arcs a unit of the root of the distance from an edge.
  S mean(int n) {
    thread_local WeightedPoints points, at_rim;
    thread_local Arcs arcs;
    points.clear(), at_rim.clear(), arcs.size = 0;
    // Parts that lie to one side of either axis, seen from the middle as if they were in the first quadrant.
    const double left = std::abs(x_) - 0.5, right = std::abs(x_) + 0.5, low = std::abs(y_) - 0.5,
                 high = std::abs(y_) + 0.5;
    const double sign_x = x_ < 0 ? -1 : 1, sign_y = y_ < 0 ? -1 : 1;
    int around = 1;
    for (const bool beyond_x : {false, true})
      for (const bool beyond_y : {false, true}) {
        const Part part{beyond_x ? 0 : std::max(left, 0.0), beyond_x ? -left : right,
                        beyond_y ? 0 : std::max(low, 0.0),  beyond_y ? -low : high,
                        beyond_x ? -sign_x : sign_x,        beyond_y ? -sign_y : sign_y};
        if (part.right - part.left > kNothing && part.high - part.low > kNothing)
          around = std::max(around, add_part(part, n, arcs, at_rim));
      }
    if (arcs.size == 0) return S(0.0);
    add_points(arcs, rule_of(around), points);
    points.fill_up(kStep);
    S sum = sum_over(model_, column_, row_, points);
    if constexpr (ScalarTraits<S>::derivatives > 0)
      if (at_rim.size > 0) {
        at_rim.fill_up(kStep);
        add_moving_rim(at_rim, sum);
      }
    return sum;
  }

 private:
  static constexpr std::size_t kStep = static_cast<std::size_t>(kLanesOf<S>);
  static constexpr double kNothing = 1e-9;
  /// Of the pixel, in one quadrant.
  struct Part {
    double left, right, low, high, sign_x, sign_y;
  };
  /// Arcs within parts: radius = foot + range sin^2 angle. Memory is kept.
  struct Arcs {
    enum { angle, weight, foot, range, left, right, low, high, sign_x, sign_y, kinds };
    std::array<std::vector<double>, kinds> of;
    std::size_t size = 0;
    void add(double at, double of_weight, double of_foot, double of_range, const Part& part) {
      if (size == of[0].size())
        for (auto& list : of) list.resize(2 * size + 64);
      const std::array<double, kinds> all{at,         of_weight, of_foot,   of_range,    part.left,
                                          part.right, part.low,  part.high, part.sign_x, part.sign_y};
      for (std::size_t i = 0; i < kinds; ++i) of[i][size] = all[i];
      ++size;
    }
  };

  /// How many points an arc needs.
  int add_part(const Part& part, int n, Arcs& arcs, WeightedPoints& at_rim) const {
    const double nearest = std::hypot(part.left, part.low),
                 farthest = std::min(rim_, std::hypot(part.right, part.high));
    if (farthest - nearest < kNothing) return 1;
    const double at_right = std::hypot(part.right, part.low), at_high = std::hypot(part.left, part.high);
    std::array<double, 20> cuts{nearest};
    std::size_t count = 1;
    const auto cut = [&](double radius) {
      if (radius > nearest && radius < farthest && count + 1 < cuts.size()) cuts[count++] = radius;
    };
    // Arcs begin or end on another side from here on.
    cut(at_right), cut(at_high);
    // Light about a defect is a cone with its tip there, a corner of every piece.
    for (std::size_t k = 0; k < defect_count_; ++k) cut(std::hypot(defects_[k][0], defects_[k][1]));
    if (core_ > nearest) {
      cut(core_);
      // Where the rim is near, light within the core's edge changes as does the root of the distance from the rim, too:
      // pieces so short that it is smooth on each.
      for (double gap = rim_ - core_; gap > 1e-12 && gap < 1; gap *= 16) cut(core_ - gap);
    }
    cuts[count++] = farthest;
    std::sort(cuts.begin(), cuts.begin() + static_cast<long>(count));
    for (std::size_t i = 0; i + 1 < count; ++i) {
      const double from = cuts[i], to = cuts[i + 1], middle = 0.5 * (from + to);
      if (to - from < kNothing) continue;
      // From the side's foot on an arc's end moves along that side like the root of the radius. Roots of the distances
      // from there and from the edge are both smooth in the angle.
      const double foot = std::min(from, std::max(middle < at_right ? part.low : part.right,
                                                  middle < at_high ? part.left : part.high)),
                   edge = core_ > middle ? core_ : rim_;
      const double inside_first = std::sqrt(std::max(0.0, edge - from)),
                   inside_last = std::sqrt(std::max(0.0, edge - to));
      const double first = std::atan2(std::sqrt(from - foot), inside_first),
                   length = std::atan2(std::sqrt(to - foot), inside_last) - first;
      const PixelRule& rule = rule_of(2 + static_cast<int>(std::ceil(n * (0.25 + inside_first - inside_last))));
      for (std::size_t k = 0; k < rule.x.size(); ++k)
        arcs.add(first + length * (0.5 + rule.x[k]), rule.w[k] * length, foot, edge - foot, part);
    }
    const double turn =
        std::asin(std::min(1.0, (part.right * part.high - part.left * part.low) / (at_right * at_high)));
    const int around =
        1 + static_cast<int>(
                std::ceil(n * std::max(around_ * std::hypot(part.right - part.left, part.high - part.low), 2 * turn)));
    if constexpr (ScalarTraits<S>::derivatives > 0)
      if (farthest == rim_) {
        Arcs rim;
        // sin^2 = 1/2, and the weight is the arc's length
        rim.add(0.25 * std::numbers::pi, 0.5 / rim_, 0, 2 * rim_, part);
        const std::size_t before = at_rim.size;
        add_points(rim, rule_of(2 * around), at_rim);
        at_rim.pack_from(before);
      }
    return around;
  }
  static Pack other_leg(const Pack& radius, const Pack& leg) {
    return root(max_of((radius - leg) * (radius + leg), Pack(1e-30)));
  }
  /// Points along the chord of every arc, seen from the middle. A defect cuts arcs: those parts of one have as many
  /// points each.
  void add_points(Arcs& arcs, const PixelRule& rule, WeightedPoints& points) const {
    const std::size_t lanes = static_cast<std::size_t>(kLanes);
    while (arcs.size % lanes != 0) {
      for (auto& list : arcs.of)
        if (list.size() == arcs.size) list.resize(2 * arcs.size);
      for (auto& list : arcs.of) list[arcs.size] = list[arcs.size - 1];
      arcs.of[Arcs::weight][arcs.size++] = 0;
    }
    for (std::size_t i = 0; i < arcs.size; i += lanes) {
      const auto get = [&](auto kind) { return Pack::load_unaligned(&arcs.of[static_cast<std::size_t>(kind)][i]); };
      const Pack range = get(Arcs::range), left = get(Arcs::left), right = get(Arcs::right), low = get(Arcs::low),
                 high = get(Arcs::high), sign_x = get(Arcs::sign_x), sign_y = get(Arcs::sign_y);
      Pack s, c;
      sin_cos(get(Arcs::angle), s, c);
      const Pack radius = get(Arcs::foot) + range * s * s,
                 weight = get(Arcs::weight) * Pack(2.0) * range * s * c * radius;
      // It comes in through the lower or the right side, and leaves by the left or the upper one.
      const Pack on_low = other_leg(radius, low), on_left = other_leg(radius, left);
      const auto by_right = on_low > right, by_high = on_left > high;
      Pack x0 = select(by_right, right, on_low), y0 = select(by_right, other_leg(radius, right), low);
      const Pack x1 = select(by_high, other_leg(radius, high), left), y1 = select(by_high, high, on_left);
      const auto add = [&](const Pack& from_x, const Pack& from_y, const Pack& to_x, const Pack& to_y) {
        const Pack dx = to_x - from_x, dy = to_y - from_y, middle_x = Pack(0.5) * (from_x + to_x),
                   middle_y = Pack(0.5) * (from_y + to_y), turned = weight * (from_x * to_y - to_x * from_y);
        for (std::size_t k = 0; k < rule.x.size(); ++k) {
          const Pack x = middle_x + Pack(rule.x[k]) * dx, y = middle_y + Pack(rule.x[k]) * dy,
                     over = inverse_root(x * x + y * y), scale = radius * over;
          const std::size_t at = points.more(lanes);
          (sign_x * (x * scale) - Pack(x_)).store_unaligned(&points.x[at]);
          (sign_y * (y * scale) - Pack(y_)).store_unaligned(&points.y[at]);
          (turned * (Pack(rule.w[k]) * over * over)).store_unaligned(&points.w[at]);
        }
      };
      for (std::size_t k = 0; k < defect_count_; ++k) {
        const Pack x = sign_x * Pack(defects_[k][0]), y = sign_y * Pack(defects_[k][1]),
                   scale = radius * inverse_root(x * x + y * y + Pack(1e-30)), at_x = x * scale, at_y = y * scale;
        // Where it is not in an arc's way the arc's first part has no length.
        const auto within = x > Pack(0.0) && y > Pack(0.0) && x0 * at_y > y0 * at_x && at_x * y1 > at_y * x1;
        if (birefit::none(within)) continue;
        const Pack cut_x = select(within, at_x, x0), cut_y = select(within, at_y, y0);
        add(x0, y0, cut_x, cut_y);
        x0 = cut_x, y0 = cut_y;
      }
      add(x0, y0, x1, y1);
    }
  }
  /// Light need not vanish at the rim: a rim that moves outwards brings in what is seen there. (At a core's edge light
  /// is continuous: what one side gains the other loses.)
  void add_moving_rim(const WeightedPoints& at_rim, S& sum) const {
    const P inside(1 - 1e-9);
    for (std::size_t i = 0; i < at_rim.size; i += kStep) {
      const P dx = load_lanes<P>(&at_rim.x[i]), dy = load_lanes<P>(&at_rim.y[i]), x = P(column_) + dx, y = P(row_) + dy;
      S light;
      model_.light(P(column_ - x_) + inside * (dx + P(x_)), P(row_ - y_) + inside * (dy + P(y_)), &light);
      const P per =
          load_lanes<P>(&at_rim.w[i]) * plain(light) * P(0.5 * rim_);  // rim() grows by 2 / radius a pixel inwards
      const S moving = model_.rim(x, y);
      for (std::size_t j = 0; j < moving.d.size(); ++j) sum.d[j] = sum.d[j] + P(sum_of_lanes(per * moving.d[j]));
    }
  }

  const SampleImage<S>& model_;
  double column_, row_, x_, y_, rim_, core_, around_;
  std::array<std::array<double, 2>, 4> defects_;
  std::size_t defect_count_ = 0;
};

}  // namespace birefit
