#include "medium/families/profile.h"

#include <stdexcept>

namespace birefit {
namespace {

/// Second derivatives of the natural cubic spline through (x, y): tridiagonal, Thomas' algorithm.
std::vector<double> spline_curvature(const std::vector<double>& x, const std::vector<double>& y) {
  const int n = static_cast<int>(x.size());
  std::vector<double> m(n, 0.0), c(n, 0.0), d(n, 0.0);
  for (int i = 1; i + 1 < n; ++i) {
    const double left = x[i] - x[i - 1], right = x[i + 1] - x[i];
    const double rhs = 6 * ((y[i + 1] - y[i]) / right - (y[i] - y[i - 1]) / left);
    const double pivot = 2 * (left + right) - left * c[i - 1];
    c[i] = right / pivot;
    d[i] = (rhs - left * d[i - 1]) / pivot;
  }
  for (int i = n - 2; i >= 1; --i) m[i] = d[i] - c[i] * m[i + 1];
  return m;
}

}  // namespace

ProfileTable::ProfileTable(const SlabProfile& profile) {
  using Row = SlabProfile::Row;
  std::vector<Row> rows = profile.rows;
  const bool constant = profile.interpolation == SlabProfile::Interpolation::constant;
  const bool cubic = profile.interpolation == SlabProfile::Interpolation::cubic;
  if (rows.empty() || (!constant && rows.size() < 2)) throw std::logic_error("profile has too few rows");
  for (std::size_t i = 0; i < rows.size(); ++i) {
    Row& row = rows[i];
    const double length = std::sqrt(row.ax * row.ax + row.ay * row.ay + row.az * row.az);
    row.ax /= length, row.ay /= length, row.az /= length;
    // a and -a are one state: take the nearer of the two, so that interpolation never passes through zero needlessly.
    if (i > 0 && row.ax * rows[i - 1].ax + row.ay * rows[i - 1].ay + row.az * rows[i - 1].az < 0)
      row.ax = -row.ax, row.ay = -row.ay, row.az = -row.az;
    absorbing_ = absorbing_ || row.k_o != 0 || row.k_e != 0;
  }
  const double first_um = constant ? 0.0 : rows.front().depth_um;
  thickness_um_ = rows.back().depth_um - first_um;
  edges_.push_back(0.0);
  for (std::size_t i = constant ? 0 : 1; i < rows.size(); ++i)
    edges_.push_back(i + 1 == rows.size() ? 1.0 : (rows[i].depth_um - first_um) / thickness_um_);

  const auto value = [&](std::size_t row, int field) {
    const Row& r = rows[row];
    const double fields[7] = {r.ax, r.ay, r.az, r.n_o, r.n_e, r.k_o, r.k_e};
    return fields[field];
  };
  const std::size_t pieces = edges_.size() - 1;
  pieces_.resize(pieces);
  jumps_ = constant && pieces > 1;
  for (int f = 0; f < 7; ++f) {
    std::vector<double> y;
    for (std::size_t i = 0; i < rows.size(); ++i) y.push_back(value(i, f));
    const std::vector<double> curvature = cubic ? spline_curvature(edges_, y) : std::vector<double>();
    for (std::size_t i = 0; i < pieces; ++i) {
      Piece& piece = pieces_[i];
      piece.from = edges_[i];
      double* c = piece.c[f];
      c[0] = y[i];
      c[1] = c[2] = c[3] = 0;
      if (constant) continue;
      const double h = edges_[i + 1] - edges_[i];
      c[1] = (y[i + 1] - y[i]) / h;
      if (!cubic) continue;
      c[1] -= h * (2 * curvature[i] + curvature[i + 1]) / 6;
      c[2] = curvature[i] / 2;
      c[3] = (curvature[i + 1] - curvature[i]) / (6 * h);
    }
  }
}

}  // namespace birefit
