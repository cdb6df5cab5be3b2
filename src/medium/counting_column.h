#pragma once
// How much of the medium a method asks for: the cost that charts and the planner compare.

#include "medium/column.h"

namespace birefit {

/// Counts how often the medium is asked.
template <class S>
class CountingColumn final : public Column<S> {
 public:
  explicit CountingColumn(const Column<S>& column) : column_(column) {
    this->absorbing = column.absorbing;
    this->planar = column.planar;
    this->breaks = column.breaks;
    this->jumps = column.jumps;
  }
  void sample(std::span<const double> u, OpticalPoint<S>* out) const override {
    count_ += static_cast<double>(u.size());
    column_.sample(u, out);
  }
  void sample_with_slope(std::span<const double> u, OpticalPoint<Slope<S>>* out) const override {
    count_ += static_cast<double>(u.size());
    column_.sample_with_slope(u, out);
  }
  double count() const { return count_; }

 private:
  const Column<S>& column_;
  mutable double count_ = 0;
};

}  // namespace birefit
