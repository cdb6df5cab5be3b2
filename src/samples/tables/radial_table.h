#pragma once
// Smooth functions of one coordinate, tabulated once and read at every pixel. A sample that is symmetric about the
// viewing axis needs one ray for every radius, not one for every pixel.

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

#include "core/chebyshev.h"
#include "core/scalar.h"
#include "core/threads.h"
#include "samples/image.h"

namespace birefit {

/// `functions` functions of v in [0, 1], each a polynomial of degree 11 on every one of `panels` equal panels, through
/// the panel's 12 Chebyshev points (none at an end, so ends may be singular points of the functions). Derivatives by
/// parameters are tabulated beside the values and those by v come from the polynomial: together they are the exact
/// derivative of what is read.
template <class S>
class RadialTable {
 public:
  static constexpr int kPoints = 12;
  using P = PlainOf<S>;

  RadialTable() = default;
  /// evaluate(v, out): the functions at v (one a lane), out has `functions` places; called from `threads` threads.
  template <class Evaluate>
  RadialTable(int panels, int functions, int threads, const Evaluate& evaluate)
      : panels_(panels), plane_(static_cast<std::size_t>(functions) * kPoints) {
    const ChebyshevRule<kPoints>& rule = chebyshev_rule<kPoints>();
    const int n = panels * kPoints;
    const std::size_t points = static_cast<std::size_t>(n);
    // [plane][function][panel][point]
    std::vector<double> values(points * static_cast<std::size_t>(functions) * kPlanes);
    constexpr int kStep = kLanesOf<S>;
    parallel_for((n + kStep - 1) / kStep, threads, [&](int step) {
      const int first = step * kStep;
      std::vector<S> out(static_cast<std::size_t>(functions));
      alignas(64) double v[kLanes];
      for (int k = 0; k < kStep; ++k) {
        const int i = std::min(first + k, n - 1);
        v[k] = (i / kPoints + 0.5 + 0.5 * rule.x[static_cast<std::size_t>(i % kPoints)]) / panels;
      }
      if constexpr (kStep == 1)
        evaluate(v[0], out.data());
      else
        evaluate(Pack::load_aligned(v), out.data());
      for (int k = 0; k < std::min(kStep, n - first); ++k) {
        const int i = first + k;
        for (int f = 0; f < functions; ++f) {
          const std::size_t at = static_cast<std::size_t>(f) * points + static_cast<std::size_t>(i);
          const S& value = out[static_cast<std::size_t>(f)];
          values[at] = lane(plain(value), k);
          if constexpr (kPlanes > 1)
            for (std::size_t j = 0; j + 1 < kPlanes; ++j)
              values[(j + 1) * points * static_cast<std::size_t>(functions) + at] = lane(value.d[j], k);
        }
      }
    });
    coefficients_.resize(static_cast<std::size_t>(panels) * kPlanes * plane_);
    // Rounding leaves 1e-17 of what vanishes (crossed polarizers, parameters that do not matter).
    const double* from = values.data();
    for (std::size_t plane = 0; plane < kPlanes; ++plane) {
      std::vector<double> size(static_cast<std::size_t>(functions), 0.0);
      for (std::size_t f = 0; f < size.size(); ++f)
        for (std::size_t panel = 0; panel < static_cast<std::size_t>(panels); ++panel, from += kPoints)
          for (std::size_t c = 0; c < kPoints; ++c) {
            double sum = 0;
            for (std::size_t k = 0; k < kPoints; ++k) sum += rule.to_powers[c][k] * from[k];
            coefficients_[(panel * kPlanes + plane) * plane_ + f * kPoints + c] = sum;
            size[f] = std::max(size[f], std::abs(sum));
          }
      const double all = *std::max_element(size.begin(), size.end());
      int live = 0;
      for (int f = 0; f < functions; ++f)
        if (size[static_cast<std::size_t>(f)] > 1e-15 * all) live = f + 1;
      if (plane == 0)
        live_ = live;
      else if (live > 0 &&
               !combination(values, points * static_cast<std::size_t>(functions), static_cast<int>(plane) - 1))
        (live <= 1 ? of_one_ : live <= 3 ? of_three_ : of_all_).add(static_cast<int>(plane) - 1);
    }
    directions_.clear();
  }

  /// How far a polynomial of this degree is from a function at the worst: the sizes of its two highest Chebyshev
  /// coefficients together.
  double tail() const {
    double worst = 0;
    for (std::size_t panel = 0; panel < static_cast<std::size_t>(panels_); ++panel)
      for (std::size_t f = 0; f < plane_; f += kPoints) {
        const double* c = coefficients_.data() + panel * kPlanes * plane_ + f;
        worst = std::max(worst, std::ldexp(std::abs(c[kPoints - 1]), 2 - kPoints) +
                                    std::ldexp(std::abs(c[kPoints - 2]), 3 - kPoints));
      }
    return worst;
  }

  /// How a sum moves with the place: by v, and the same sum over another basis (its derivative by the angle).
  struct Slopes {
    P by_v = P(0.0), turned = P(0.0);
  };
  /// sum_k basis[k] f_k(v) over the functions that were tabulated (F, or three or five), with its derivatives at fixed
  /// v and basis; with `slopes` also those, turned[k] in the place of basis[k]. v outside [0, 1] is extrapolated from
  /// the end panels. Functions after the last one that is not negligible are left out.
  BIREFIT_INLINE S sum(int functions, const P& v, const P* basis, const P* turned = nullptr,
                       Slopes* slopes = nullptr) const {
    return functions <= 3 ? sum<3>(v, basis, turned, slopes) : sum<5>(v, basis, turned, slopes);
  }
  template <int F>
  BIREFIT_INLINE S sum(const P& v, const P* basis, const P* turned = nullptr, Slopes* slopes = nullptr) const {
    if (F > 1 && live_ <= 1) return sum_of_live<1, F>(v, basis, turned, slopes);
    if (F > 3 && live_ <= 3) return sum_of_live<3, F>(v, basis, turned, slopes);
    return sum_of_live<F, F>(v, basis, turned, slopes);
  }

 private:
  static constexpr std::size_t kPlanes = 1 + static_cast<std::size_t>(ScalarTraits<S>::derivatives);
  /// Light knows fewer quantities than a scene has parameters: it does not tell size from wavelength, nor indices that
  /// all grow from a shorter wavelength. A derivative that is a combination of earlier ones (to rounding, on all
  /// points) is not read but combined.
  bool combination(const std::vector<double>& values, std::size_t size, int j) {
    const auto plane = [&](int k) { return values.data() + (static_cast<std::size_t>(k) + 1) * size; };
    std::vector<double> rest(plane(j), plane(j) + size);
    const auto dot = [&](const double* a, const double* b) { return std::inner_product(a, a + size, b, 0.0); };
    const double norm = std::sqrt(dot(rest.data(), rest.data()));
    std::array<double, kPlanes> weights{};
    // Twice: what rounding left the first time.
    for (int pass = 0; pass < 2; ++pass)
      for (const Direction& d : directions_) {
        const double along = dot(d.values.data(), rest.data());
        for (std::size_t i = 0; i < size; ++i) rest[i] -= along * d.values[i];
        for (std::size_t k = 0; k < weights.size(); ++k) weights[k] += along * d.weights[k];
      }
    const double left = std::sqrt(dot(rest.data(), rest.data()));
    if (!directions_.empty() && left <= 1e-11 * norm) {
      // As a difference of much larger ones it would be rounding.
      for (int k = 0; k < j; ++k)
        if (std::abs(weights[static_cast<std::size_t>(k)]) * std::sqrt(dot(plane(k), plane(k))) > 1e3 * norm)
          return false;
      for (int k = 0; k < j; ++k)
        if (const double w = weights[static_cast<std::size_t>(k)]; w != 0) combined_.push_back({j, k, w});
      return true;
    }
    Direction d{std::move(rest), {}};
    for (double& x : d.values) x /= left;
    for (std::size_t k = 0; k < weights.size(); ++k) d.weights[k] = -weights[k] / left;
    d.weights[static_cast<std::size_t>(j)] = 1 / left;
    directions_.push_back(std::move(d));
    return false;
  }
  /// A unit vector among the derivatives' values, and which sum of derivatives it is.
  struct Direction {
    std::vector<double> values;
    std::array<double, kPlanes> weights{};
  };
  struct Combined {
    int plane, of;
    double weight;
  };
  struct Planes {
    std::array<int, kPlanes> list{};
    int count = 0;
    void add(int j) { list[static_cast<std::size_t>(count++)] = j; }
  };
  /// L polynomials at x and their slopes; c: the coefficients of the first.
  template <int L, bool kSlope>
  BIREFIT_INLINE static void horner(const double* c, const P& x, P* value, P* slope) {
    for (int f = 0; f < L; ++f) {
      value[f] = P(c[f * kPoints + kPoints - 1]);
      if constexpr (kSlope) slope[f] = P(0.0);
    }
    for (int k = kPoints - 1; k-- > 0;)
      for (int f = 0; f < L; ++f) {
        if constexpr (kSlope) slope[f] = slope[f] * x + value[f];
        value[f] = value[f] * x + P(c[f * kPoints + k]);
      }
  }
  template <int L>
  BIREFIT_INLINE static P contract(const P* basis, const P* f) {
    P total = basis[0] * f[0];
    for (int k = 1; k < L; ++k) total = total + basis[k] * f[k];
    return total;
  }
  /// The derivatives of which the first L functions are not negligible, contracted with the basis.
  template <int L>
  BIREFIT_INLINE void add_planes(const Planes& planes, const double* c, const P& x, const P* basis, S& total) const {
    for (int i = 0; i < planes.count; ++i) {
      const int j = planes.list[static_cast<std::size_t>(i)];
      P f[L];
      horner<L, false>(c + (static_cast<std::size_t>(j) + 1) * plane_, x, f, nullptr);
      total.d[j] = contract<L>(basis, f);
    }
  }
  template <int L, int F>
  BIREFIT_INLINE S sum_of_live(const P& v, const P* basis, const P* turned, Slopes* slopes) const {
    const P scaled = v * P(static_cast<double>(panels_));
    using std::floor;
    const P cell = min_of(max_of(floor(scaled), P(0.0)), P(panels_ - 1.0));
    const P x = P(2.0) * (scaled - cell) - P(1.0);
    // Lanes are neighbours in the image and mostly lie on one panel: its coefficients are single numbers for all of
    // them.
    double panel = smallest(cell);
    S total = on_panel<L, F>(panel, x, basis, turned, slopes);
    for (const double last = largest(cell); panel < last;) {
      panel += 1;
      const auto here = cell == P(panel);
      if (birefit::none(here)) continue;
      Slopes there;
      total = select(here, on_panel<L, F>(panel, x, basis, turned, slopes ? &there : nullptr), total);
      if (slopes) {
        slopes->by_v = select(here, there.by_v, slopes->by_v);
        slopes->turned = select(here, there.turned, slopes->turned);
      }
    }
    return total;
  }
  template <int L, int F>
  BIREFIT_INLINE S on_panel(double panel, const P& x, const P* basis, const P* turned, Slopes* slopes) const {
    const double* c = coefficients_.data() + static_cast<std::size_t>(panel) * kPlanes * plane_;
    P value[L];
    if (slopes) {
      P slope[L];
      horner<L, true>(c, x, value, slope);
      slopes->by_v = contract<L>(basis, slope) * P(2.0 * panels_);
      slopes->turned = contract<L>(turned, value);
    } else {
      horner<L, false>(c, x, value, nullptr);
    }
    S total(contract<L>(basis, value));
    if constexpr (kPlanes > 1) {
      add_planes<1>(of_one_, c, x, basis, total);
      add_planes<(F > 3 ? 3 : F)>(of_three_, c, x, basis, total);
      add_planes<F>(of_all_, c, x, basis, total);
      for (const Combined& w : combined_) total.d[w.plane] = total.d[w.plane] + P(w.weight) * total.d[w.of];
    }
    return total;
  }

  int panels_ = 0;
  std::size_t plane_ = 0;              ///< places of all functions of a plane
  std::vector<double> coefficients_;   ///< [panel][plane][function][power], plane 0 the value
  int live_ = 0;                       ///< functions up to the last whose values are not negligible
  std::vector<Direction> directions_;  ///< of the derivatives that are read; only while the table is made
  std::vector<Combined> combined_;     ///< derivatives that are not read
  /// read derivatives of which the first one, three, all functions are not negligible
  Planes of_one_, of_three_, of_all_;
};

}  // namespace birefit
