// Where the steps of a method end.

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "transport/methods.h"

namespace birefit {

Mesh uniform_mesh(int steps, const std::vector<double>& breaks) {
  std::vector<double> edges{0.0};
  for (double b : breaks)
    if (b > 0 && b < 1) edges.push_back(b);
  edges.push_back(1.0);
  Mesh mesh{0.0};
  for (std::size_t i = 0; i + 1 < edges.size(); ++i) {
    const double width = edges[i + 1] - edges[i];
    const int n = std::max(1, static_cast<int>(std::lround(steps * width)));
    for (int k = 1; k < n; ++k) mesh.push_back(edges[i] + width * k / n);
    mesh.push_back(edges[i + 1]);
  }
  return mesh;
}

Mesh adapted_mesh(const Column<double>& column, const Ray<double>& ray, double tolerance, double* error_estimate,
                  int max_steps) {
  const Magnus4<double> method;
  // Inner steps of the medium are exact and belong to the nodes, not to a step's error.
  struct Piece final : Column<double> {
    const Column<double>& whole;
    explicit Piece(const Column<double>& c) : whole(c) {}
    void sample(std::span<const double> u, OpticalPoint<double>* out) const override { whole.sample(u, out); }
    void sample_with_slope(std::span<const double> u, OpticalPoint<Slope<double>>* out) const override {
      whole.sample_with_slope(u, out);
    }
  } piece(column);
  constexpr double kNever = std::numeric_limits<double>::infinity();
  const auto step = [&](double from, double to) { return method.transfer(piece, ray, {from, to}); };
  const auto change = [&](double from, double middle, double to) {
    try {
      const Mat2<double> d = step(middle, to) * step(from, middle) - step(from, to);
      return std::sqrt(norm(d.a) + norm(d.b) + norm(d.c) + norm(d.d));
    } catch (const std::domain_error&) {  // far too long a step
      return kNever;
    }
  };
  const Mesh start = uniform_mesh(4, column.breaks);
  Mesh mesh{0.0};
  double total = 0;
  // Depth-first, left to right: `open` holds right ends still to be reached.
  std::vector<double> open(start.rbegin(), start.rend() - 1);
  while (!open.empty()) {
    const double from = mesh.back(), to = open.back(), middle = 0.5 * (from + to);
    const double error = change(from, middle, to);
    const bool exhausted = static_cast<int>(mesh.size() + open.size()) >= max_steps || to - from < 1e-9;
    // A step that cannot get better (rounding) is accepted too.
    if (error <= tolerance * (to - from) || error < 4e-15 || exhausted) {
      mesh.push_back(to);
      open.pop_back();
      total += error;
    } else {
      open.push_back(middle);
    }
  }
  if (error_estimate) *error_estimate = total;
  return mesh;
}

}  // namespace birefit
