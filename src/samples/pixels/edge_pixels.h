#pragma once
// Pixels at lines along which light has a slope without bound on one side (SampleImage::edges): a sphere's rim, a
// core's edge. At a distance u from such a line a ray's way through the sphere, and with it the light, is a smooth
// function of t = sqrt(u), in which fringes are evenly spaced however they crowd in u. A pixel is cut along its edges,
// and each part takes Gauss points in t.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "samples/pixels/pixel_mean.h"
#include "samples/pixels/ring_pixel.h"

namespace birefit {

/// One pixel as its edges cut it. Lines across the edges are counted by q, places on them by s, both from -1/2 to 1/2.
template <class S>
class EdgePixel {
 public:
  using P = PlainOf<S>;
  EdgePixel(const SampleImage<S>& model, double column, double row) : model_(model), column_(column), row_(row) {
    look();
  }

  /// The mean by n lines across the pixel, and as many points on each as fringes in t need where n points do between
  /// them in u.
  S mean(int n) {
    if (dark_) return S(0.0);
    thread_local WeightedPoints points;
    points.clear();
    thread_local std::vector<Line> at_rim;
    at_rim.clear();
    const std::array<double, kMostBreaks> breaks = find_breaks();
    for (std::size_t i = 0; i + 1 < count_; ++i)
      add_piece(breaks[i], breaks[i + 1], i > 0, i + 2 < count_, n, points, at_rim);
    if (points.size == 0) return S(0.0);
    points.fill_up(kStep);
    S sum = sum_over(model_, column_, row_, points);
    if constexpr (ScalarTraits<S>::derivatives > 0) add_moving_rim(at_rim, sum);
    return sum;
  }

 private:
  static constexpr std::size_t kStep = static_cast<std::size_t>(kLanesOf<S>), kMostEdges = 2,
                               kMostBreaks = 2 + 4 * kMostEdges;
  /// Edges farther away than this (px) neither cut a pixel nor crowd its fringes.
  static constexpr double kFar = 2.5;
  static constexpr double kNothing = 1e-9;
  struct Edge {
    int number = 0;
    std::optional<EdgeCircle> circle;         ///< its middle counted from the pixel's
    bool rising = false;                      ///< beyond_edge() grows with s
    double along = 0, aside = 0, square = 0;  ///< the circle's middle in s and q, and its radius squared
  };
  struct Line {
    double q, weight;
    std::array<double, kMostEdges> crossing;  ///< s where it meets each edge
  };

  P beyond(int edge, const P& s, const P& q) const {
    return across_x_ ? model_.beyond_edge(edge, P(column_) + s, P(row_) + q)
                     : model_.beyond_edge(edge, P(column_) + q, P(row_) + s);
  }
  /// Which edges are near, and whether their lines run along columns or rows.
  void look() {
    double nearest = kFar;
    std::array<std::array<double, 2>, kMostEdges> slopes;
    const int all = model_.edges();
    for (int e = 0; e < all; ++e) {
      Edge edge{e, model_.circle(e)};
      double by_x, by_y, distance;
      if (edge.circle) {
        by_x = edge.circle->column -= column_, by_y = edge.circle->row -= row_;  // to the middle
        distance = edge.circle->radius - std::sqrt(by_x * by_x + by_y * by_y);
      } else {
        const auto at = [&](double right, double down) {
          return lane(model_.beyond_edge(e, P(column_ + right), P(row_ + down)), 0);
        };
        const double right = at(0.5, 0), left = at(-0.5, 0), down = at(0, 0.5), up = at(0, -0.5);
        by_x = right - left, by_y = down - up;
        distance = 0.25 * (right + left + down + up) / std::max(std::hypot(by_x, by_y), 1e-300);
      }
      constexpr double kBeside = 0.75;  // more than half a pixel's diagonal
      if (e == 0 && distance < -kBeside) dark_ = true;
      if (!(std::abs(distance) < kFar)) continue;
      // on a diagonal, whatever rounding says
      if (std::abs(distance) < nearest)
        nearest = std::abs(distance), across_x_ = std::abs(by_x) >= std::abs(by_y) * (1 - 1e-9);
      slopes[edges_] = {by_x, by_y};
      edge_[edges_++] = edge;
    }
    for (std::size_t i = 0; i < edges_; ++i) {
      edge_[i].rising = slopes[i][across_x_ ? 0 : 1] > 0;
      if (!edge_[i].circle) continue;
      const EdgeCircle& c = *edge_[i].circle;
      edge_[i].along = across_x_ ? c.column : c.row, edge_[i].aside = across_x_ ? c.row : c.column,
      edge_[i].square = c.radius * c.radius;
    }
  }
  /// Where lines meet an edge: a circle, or by the secant method.
  P crossing(const Edge& edge, const P& q) const {
    if (edge.circle) {
      const P aside = q - P(edge.aside), square = P(edge.square) - aside * aside;
      const double sign = edge.rising ? 1 : -1;
      return select(square > P(0.0), P(edge.along) - P(sign) * root(max_of(square, P(1e-30))), P(sign * kFar));
    }
    constexpr int kSteps = 5;
    P a(-0.5), b(0.5), fa = beyond(edge.number, a, q), fb = beyond(edge.number, b, q);
    for (int i = 0; i < kSteps; ++i) {
      const P slope = fb - fa, safe = select(slope * slope < P(1e-28), P(1e-14), slope);
      const P next = min_of(max_of(P(b - fb * (b - a) * inverse(safe)), P(-kFar)), P(kFar));
      a = b, fa = fb, b = next, fb = beyond(edge.number, next, q);
    }
    return b;
  }
  /// Where an edge comes in or leaves by a side that lines end at, the mean over lines has a kink: there the pixel is
  /// cut, from -1/2 to 1/2.
  std::array<double, kMostBreaks> find_breaks() {
    std::array<double, kMostBreaks> breaks{-0.5};
    count_ = 1;
    const auto add = [&](double q) {
      if (std::abs(q) < 0.5 && count_ + 1 < kMostBreaks) breaks[count_++] = q;
    };
    for (std::size_t e = 0; e < edges_; ++e) {
      const Edge& edge = edge_[e];
      for (const double side : {-0.5, 0.5}) {
        if (edge.circle) {
          const double to_middle = edge.along - side, square = edge.square - to_middle * to_middle;
          if (square < 0 || (to_middle > 0) != edge.rising) continue;
          const double half = std::sqrt(square);
          add(edge.aside - half), add(edge.aside + half);
        } else {
          find_breaks(edge, side, add);
        }
      }
    }
    breaks[count_++] = 0.5;
    std::sort(breaks.begin(), breaks.begin() + static_cast<long>(count_));
    return breaks;
  }
  /// The parabola through three places, and the secant method along the side.
  template <class Add>
  void find_breaks(const Edge& edge, double side, const Add& add) const {
    const auto at = [&](double q) { return lane(crossing(edge, P(q)), 0); };
    const auto on_side = [&](double q) { return lane(beyond(edge.number, P(side), P(q)), 0); };
    const double before_middle = at(-0.5), c = at(0), after_middle = at(0.5), b = after_middle - before_middle,
                 a = 2 * (after_middle + before_middle - 2 * c);
    const double root_of = b * b - 4 * a * (c - side);
    if (!(root_of >= 0)) return;
    const double middle = -0.5 * (b + (b < 0 ? -1 : 1) * std::sqrt(root_of));
    for (const double start : {(c - side) / (middle == 0 ? 1e-300 : middle), middle / (a == 0 ? 1e-300 : a)}) {
      if (!(std::abs(start) < 0.75)) continue;
      double q = start, before = start + 0.01, f_before = on_side(before);
      for (int i = 0; i < 4; ++i) {
        const double f = on_side(q), slope = f - f_before;
        if (std::abs(slope) < 1e-15) break;
        const double next = std::clamp(q - f * (q - before) / slope, -0.75, 0.75);
        before = q, f_before = f, q = next;
      }
      add(q);
    }
  }

  /// Lines from q = from to `to`; at a break the mean over lines goes like a power of the root of the distance from it.
  void add_piece(double from, double to, bool break_before, bool break_after, int n, WeightedPoints& points,
                 std::vector<Line>& at_rim) const {
    const double length = to - from;
    if (length < kNothing) return;
    const PixelRule& rule = rule_of(n);
    std::array<Line, kMostPoints> lines;
    const std::size_t count = rule.x.size();
    for (std::size_t i = 0; i < count; ++i) {
      const double a = 0.5 + rule.x[i], b = 1 - a;
      double& q = lines[i].q;
      double slope = 1;
      if (break_before && break_after)
        q = a * a * (3 - 2 * a), slope = 6 * a * b;
      else if (break_before)
        q = a * a, slope = 2 * a;
      else if (break_after)
        q = 1 - b * b, slope = 2 * b;
      else
        q = a;
      q = from + length * q;
      lines[i].weight = rule.w[i] * length * slope;
    }
    for (std::size_t first = 0; first < count; first += kStep) {
      alignas(64) std::array<double, kLanes> q{};
      for (std::size_t k = 0; k < kStep; ++k) q[k] = lines[std::min(first + k, count - 1)].q;
      for (std::size_t e = 0; e < edges_; ++e) {
        const P at = crossing(edge_[e], load_lanes<P>(q.data()));
        for (std::size_t k = 0; k < std::min(kStep, count - first); ++k) {
          const double s = lane(at, static_cast<int>(k));
          lines[first + k].crossing[e] = std::isfinite(s) ? s : (edge_[e].rising ? kFar : -kFar);
        }
      }
    }
    for (std::size_t i = 0; i < count; ++i) {
      add_line(lines[i], n, points);
      if constexpr (ScalarTraits<S>::derivatives > 0)
        if (edges_ > 0 && edge_[0].number == 0 && std::abs(lines[i].crossing[0]) < 0.5) at_rim.push_back(lines[i]);
    }
  }
  void add_line(const Line& line, int n, WeightedPoints& points) const {
    std::array<double, kMostEdges + 2> cuts{-0.5};
    std::size_t ends = 1;
    for (std::size_t e = 0; e < edges_; ++e)
      if (std::abs(line.crossing[e]) < 0.5) cuts[ends++] = line.crossing[e];
    cuts[ends++] = 0.5;
    if (ends == 4 && cuts[1] > cuts[2]) std::swap(cuts[1], cuts[2]);
    for (std::size_t i = 0; i + 1 < ends; ++i) {
      const double low = cuts[i], high = cuts[i + 1], middle = 0.5 * (low + high);
      if (high - low < kNothing) continue;
      // The nearest edge beyond which this part lies: light is smooth in the root of the distance from that one.
      double gap = kFar, place = 0;
      bool lit = true, rising = true;
      for (std::size_t e = 0; e < edges_; ++e) {
        const double at = line.crossing[e];
        if (edge_[e].rising ? middle > at : middle < at) {
          const double here = std::max(0.0, edge_[e].rising ? low - at : at - high);
          if (here < gap) gap = here, place = at, rising = edge_[e].rising;
        } else if (edge_[e].number == 0) {
          lit = false;
        }
      }
      if (!lit) continue;
      const double sign = rising ? 1 : -1;
      if (gap == kFar) {
        const PixelRule& rule = rule_of(nodes(n, high - low));
        const Room to = room(points, rule.x.size());
        for (std::size_t k = 0; k < rule.x.size(); ++k)
          to.s[k] = low + (high - low) * (0.5 + rule.x[k]), to.q[k] = line.q,
          to.w[k] = line.weight * rule.w[k] * (high - low);
        continue;
      }
      const double first = std::sqrt(gap), length = std::sqrt(gap + high - low) - first,
                   weight = 2 * line.weight * length;
      const PixelRule& rule = rule_of(nodes(n, length));
      const Room to = room(points, rule.x.size());
      for (std::size_t k = 0; k < rule.x.size(); ++k) {
        const double t = first + length * (0.5 + rule.x[k]);
        to.s[k] = place + sign * t * t, to.q[k] = line.q, to.w[k] = weight * rule.w[k] * t;
      }
    }
  }
  struct Room {
    double *s, *q, *w;
  };
  Room room(WeightedPoints& points, std::size_t count) const {
    const std::size_t from = points.more(count);
    double *x = &points.x[from], *y = &points.y[from];
    return {across_x_ ? x : y, across_x_ ? y : x, &points.w[from]};
  }
  /// Points on a part of a line, by its length in t (or in s).
  static int nodes(int n, double length) { return std::min(2 * n, 1 + static_cast<int>(std::ceil(1.25 * n * length))); }

  /// Light need not vanish at the rim: a rim that moves outwards brings in what is seen there. (At a core's edge light
  /// is continuous: what one side gains the other loses.)
  void add_moving_rim(const std::vector<Line>& lines, S& sum) const {
    constexpr double kInside = 1e-8, kApart = 1e-3;  // px
    const double sign = edges_ > 0 && edge_[0].rising ? 1 : -1;
    for (std::size_t first = 0; first < lines.size(); first += kStep) {
      alignas(64) std::array<double, kLanes> at{}, beside{}, weight{};
      for (std::size_t k = 0; k < kStep; ++k) {
        const Line& line = lines[std::min(first + k, lines.size() - 1)];
        at[k] = line.crossing[0], beside[k] = line.q, weight[k] = first + k < lines.size() ? line.weight : 0;
      }
      const P s = load_lanes<P>(at.data()), q = load_lanes<P>(beside.data()), inside = s + P(sign * kInside);
      const P slope = (beyond(0, s + P(sign * kApart), q) - beyond(0, s - P(sign * kApart), q)) * P(0.5 / kApart);
      const P x = P(column_) + (across_x_ ? s : q), y = P(row_) + (across_x_ ? q : s);
      S light;
      model_.light(across_x_ ? P(column_) + inside : x, across_x_ ? y : P(row_) + inside, &light);
      const P per = load_lanes<P>(weight.data()) * plain(light) * inverse(slope);
      const S moving = model_.rim(x, y);
      for (std::size_t j = 0; j < moving.d.size(); ++j) sum.d[j] = sum.d[j] + P(sum_of_lanes(per * moving.d[j]));
    }
  }

  const SampleImage<S>& model_;
  double column_, row_;
  bool across_x_ = true, dark_ = false;
  std::array<Edge, kMostEdges> edge_{};
  std::size_t edges_ = 0, count_ = 0;
};

template <class S>
S mean_over_edge_pixel(const SampleImage<S>& model, double column, double row, int n) {
  std::array<EdgeCircle, 2> circles;
  int count = 0;
  for (int e = 0; e < model.edges(); ++e)
    if (const auto circle = model.circle(e))
      circles[static_cast<std::size_t>(count++)] = *circle;
    else if (std::abs(lane(model.beyond_edge(e, PlainOf<S>(column), PlainOf<S>(row)), 0)) < 2.5)
      return EdgePixel<S>(model, column, row).mean(n);
  return RingPixel<S>(model, circles, count, column, row).mean(n);
}

/// By its distance from the edges, or from a defect.
template <class S>
bool is_edge_pixel(const SampleImage<S>& model, double column, double row) {
  for (int e = 0; e < model.edges(); ++e) {
    const auto circle = model.circle(e);
    const double beyond = circle ? circle->radius - std::hypot(column - circle->column, row - circle->row)
                                 : lane(model.beyond_edge(e, PlainOf<S>(column), PlainOf<S>(row)), 0);
    if (beyond < kEdgeWithin && beyond > -kEdgeBeyond) return true;
  }
  return false;
}
template <class S>
bool is_defect_pixel(const SampleImage<S>& model, double column, double row) {
  for (const auto& [x, y] : model.defects())
    if (std::hypot(column - x, row - y) < kDefectWithin) return true;
  return false;
}
/// The mean as a picture takes it.
template <class S>
S mean_over_cut_pixel(const SampleImage<S>& model, const RenderPlan& plan, double column, double row) {
  return mean_over_edge_pixel(model, column, row,
                              is_defect_pixel(model, column, row) ? plan.means.defect_points : plan.means.edge_points);
}

/// Finds the edge pixels of rows of a picture.
class EdgeMarks {
 public:
  /// Looks at `rows` rows from first_row on and `columns` columns from first_column on.
  template <class S>
  void look(const SampleImage<S>& model, int first_row, int rows, int first_column, int columns) {
    first_row_ = first_row, first_column_ = first_column, columns_ = columns;
    circles_.clear(), marked_.clear();
    for (const auto& [column, row] : model.defects()) circles_.push_back({{column, row, 0}, kDefectWithin, 1});
    for (int e = 0; e < model.edges(); ++e) {
      if (const auto circle = model.circle(e)) {
        circles_.push_back({*circle, kEdgeBeyond, kEdgeWithin});
        continue;
      }
      constexpr int kStep = kLanesOf<S>;
      const std::size_t wide = static_cast<std::size_t>(columns);
      marked_.assign(wide * static_cast<std::size_t>(rows), 0);
      alignas(64) std::array<double, kLanes> along{};
      for (int r = 0; r < rows; ++r)
        for (int c = 0; c < columns; c += kStep) {
          for (int k = 0; k < kStep; ++k) along[static_cast<std::size_t>(k)] = first_column + c + k;
          const PlainOf<S> beyond = model.beyond_edge(e, load_lanes<PlainOf<S>>(along.data()),
                                                      PlainOf<S>(static_cast<double>(first_row + r)));
          if (smallest(beyond) >= kEdgeWithin || largest(beyond) <= -kEdgeBeyond) continue;
          for (int k = 0; k < std::min(kStep, columns - c); ++k)
            marked_[static_cast<std::size_t>(r) * wide + static_cast<std::size_t>(c + k)] =
                lane(beyond, k) < kEdgeWithin && lane(beyond, k) > -kEdgeBeyond;
        }
    }
  }
  /// Adds kEdgePixel where it is due in the row-th of the rows.
  void mark(int row, std::uint8_t* samples) const {
    for (const auto& [circle, beyond, within] : circles_) {
      // All within the outer circle but what is within the inner one: two arcs of the row, or one.
      const double dy = first_row_ + row - circle.row, middle = circle.column - first_column_;
      const auto half = [&](double radius) {
        return radius > std::abs(dy) ? std::sqrt(radius * radius - dy * dy) : -1.0;
      };
      const double outer = half(circle.radius + beyond), inner = half(circle.radius - within);
      if (outer < 0) continue;
      const auto from = [&](double x) {
        return static_cast<int>(std::clamp(std::ceil(x), 0.0, static_cast<double>(columns_)));
      };
      const auto paint = [&](double low, double high) {
        for (int c = from(low), end = from(high); c < end; ++c) samples[c] |= kEdgePixel;
      };
      if (inner < 0) {
        paint(middle - outer, middle + outer);
      } else {
        paint(middle - outer, middle - inner);
        paint(middle + inner, middle + outer);
      }
    }
    if (marked_.empty()) return;
    const std::uint8_t* at = marked_.data() + static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_);
    for (int c = 0; c < columns_; ++c)
      if (at[c]) samples[c] |= kEdgePixel;
  }

 private:
  struct Ring {
    EdgeCircle circle;
    double beyond, within;
  };
  int first_row_ = 0, first_column_ = 0, columns_ = 0;
  std::vector<Ring> circles_;
  std::vector<std::uint8_t> marked_;  ///< at the edge that is no circle; there is one at most
};

}  // namespace birefit
