#pragma once
// The waist of the hourglass: many director families above, many transport methods below, and between them only this:
// a straight column of light, sampled at plain numbers u in [0, 1] from entry to exit. Families map u to depth as it
// suits them (clustered at a defect, scaled by the thickness), so that one fixed mesh in u serves every ray and every
// parameter value, and the objective of a fit stays smooth.

#include <algorithm>
#include <memory>
#include <new>
#include <span>
#include <stdexcept>
#include <type_traits>
#include <vector>

#include "core/scalar.h"
#include "core/taylor.h"

namespace birefit {

/// The medium at one point of a column, in the column's frame: z along the column (for a stratified slab its normal).
template <class S>
struct OpticalPoint {
  Vec3<S> axis;                     ///< unit optic axis; axis and -axis are the same state
  S ordinary, extraordinary;        ///< permittivities n_o^2, n_e^2, real parts
  S ordinary_im, extraordinary_im;  ///< imaginary parts, >= 0 absorbs; only read when Column::absorbing
  S depth_slope_um;                 ///< d depth / d u
};

template <class S>
using Slope = Dual<S, 1>;

/// The highest order of a series in depth that a transport may use.
inline constexpr int kTaylorOrder = 11;
/// One coefficient more, because the coupling of the modes needs the derivative of the medium.
template <class S>
using Series = Taylor<S, kTaylorOrder + 1>;
/// Scalars whose columns give their Taylor series: values without derivatives.
template <class S>
inline constexpr bool kHasSeries = std::is_same_v<S, double> || std::is_same_v<S, Pack>;

template <class S>
class Column {
 public:
  virtual ~Column() = default;
  /// The medium at each u; out has u.size() places.
  virtual void sample(std::span<const double> u, OpticalPoint<S>* out) const = 0;
  /// The same with d/du of every field in .d[0].
  virtual void sample_with_slope(std::span<const double> u, OpticalPoint<Slope<S>>* out) const = 0;
  /// The Taylor series of every field about u, in powers of u up to `order` <= kTaylorOrder + 1. Only columns made of a
  /// law know it, and only for scalars with kHasSeries; others throw std::logic_error.
  virtual void sample_taylor(double, int, OpticalPoint<Series<S>>*) const {
    throw std::logic_error("this column has no Taylor series");
  }

  bool absorbing = false;
  /// The axis stays in a plane that contains z and does not turn: transport is diagonal at normal incidence.
  bool planar = false;
  /// Inner points where the medium has a kink or, with `jumps`, a step: meshes must have a node there.
  std::vector<double> breaks;
  bool jumps = false;
};

/// Makes a Column of a law with a member template `OpticalPoint<T> at(const T& u) const` for T = S, T = Slope<S> and,
/// where kHasSeries<S>, T = Series<S>.
template <class S, class Law>
class LawColumn final : public Column<S> {
 public:
  explicit LawColumn(Law law) : law_(std::move(law)) {}
  void sample(std::span<const double> u, OpticalPoint<S>* out) const override {
    // in place: 1 kB each
    for (std::size_t i = 0; i < u.size(); ++i)
      ::new (static_cast<void*>(out + i)) OpticalPoint<S>(law_.template at<S>(S(u[i])));
  }
  void sample_with_slope(std::span<const double> u, OpticalPoint<Slope<S>>* out) const override {
    for (std::size_t i = 0; i < u.size(); ++i) {
      Slope<S> x{S(u[i])};
      x.d[0] = S(1.0);
      ::new (static_cast<void*>(out + i)) OpticalPoint<Slope<S>>(law_.template at<Slope<S>>(x));
    }
  }
  void sample_taylor(double u, int order, OpticalPoint<Series<S>>* out) const override {
    if constexpr (kHasSeries<S>) {
      *out = law_.template at<Series<S>>(Series<S>::variable(S(u), order));
      for (Series<S>* x : {&out->axis.x, &out->axis.y, &out->axis.z, &out->ordinary, &out->extraordinary,
                           &out->ordinary_im, &out->extraordinary_im, &out->depth_slope_um})
        x->order = order;  // constants too: they may be integrated
    } else {
      Column<S>::sample_taylor(u, order, out);
    }
  }
  Law& law() { return law_; }

 private:
  Law law_;
};

/// A column whose samples at the node sets of one method are computed once and shared by all rays: for plates, where
/// only the direction changes from pixel to pixel. Node sets seen before freeze() are remembered; others still work.
template <class S>
class CachedColumn final : public Column<S> {
 public:
  explicit CachedColumn(std::unique_ptr<Column<S>> column) : column_(std::move(column)) {
    this->absorbing = column_->absorbing;
    this->planar = column_->planar;
    this->breaks = column_->breaks;
    this->jumps = column_->jumps;
  }
  void freeze() { frozen_ = true; }
  void sample(std::span<const double> u, OpticalPoint<S>* out) const override {
    serve(u, out, values_, [&](auto* p) { column_->sample(u, p); });
  }
  void sample_with_slope(std::span<const double> u, OpticalPoint<Slope<S>>* out) const override {
    serve(u, out, slopes_, [&](auto* p) { column_->sample_with_slope(u, p); });
  }
  void sample_taylor(double u, int order, OpticalPoint<Series<S>>* out) const override {
    column_->sample_taylor(u, order, out);
  }

 private:
  template <class P>
  struct Entry {
    std::vector<double> u;
    std::vector<P> points;
  };
  template <class P, class Compute>
  void serve(std::span<const double> u, P* out, std::vector<Entry<P>>& cache, const Compute& compute) const {
    for (const Entry<P>& entry : cache)
      if (entry.u.size() == u.size() && std::equal(u.begin(), u.end(), entry.u.begin())) {
        std::copy(entry.points.begin(), entry.points.end(), out);
        return;
      }
    compute(out);
    if (!frozen_) cache.push_back({{u.begin(), u.end()}, {out, out + u.size()}});
  }
  std::unique_ptr<Column<S>> column_;
  mutable std::vector<Entry<OpticalPoint<S>>> values_;
  mutable std::vector<Entry<OpticalPoint<Slope<S>>>> slopes_;
  bool frozen_ = false;
};

}  // namespace birefit
