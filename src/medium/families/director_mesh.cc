#include "medium/families/director_mesh.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Dense>

namespace birefit {
namespace {

constexpr double kPi = std::numbers::pi;

}  // namespace

DirectorMesh::DirectorMesh(int elements, int degree) : degree_(degree) {
  const int n = degree + 1;
  for (int i = 0; i <= elements; ++i) edges_.push_back(0.5 * (1 - std::cos(kPi * i / elements)));
  edges_.front() = 0;
  edges_.back() = 1;
  // Gauss-Lobatto points: ends and zeros of P'_degree, by Newton from the Chebyshev points.
  for (int i = 0; i < n; ++i) {
    double x = -std::cos(kPi * i / degree), p = 0;
    for (int pass = 0; pass < 100; ++pass) {
      double before = 1;
      p = x;
      for (int k = 2; k <= degree; ++k) {
        const double next = ((2 * k - 1) * x * p - (k - 1) * before) / k;
        before = p;
        p = next;
      }
      const double step = (x * p - before) / (n * p);
      x -= step;
      if (std::abs(step) < 1e-16) break;
    }
    if (i == 0) x = -1;
    if (i == degree) x = 1;
    point_.push_back(x);
    weight_.push_back(2 / (degree * n * p * p));
  }
  std::vector<double> legendre(static_cast<std::size_t>(n));  // P_degree at the points
  for (int i = 0; i < n; ++i)
    legendre[static_cast<std::size_t>(i)] =
        std::sqrt(2 / (degree * n * weight_[static_cast<std::size_t>(i)])) * ((degree - i) % 2 ? -1 : 1);
  slope_.assign(static_cast<std::size_t>(n * n), 0.0);
  for (int k = 0; k < n; ++k)
    for (int j = 0; j < n; ++j) {
      double& d = slope_[static_cast<std::size_t>(k * n + j)];
      if (k != j)
        d = legendre[static_cast<std::size_t>(k)] / legendre[static_cast<std::size_t>(j)] /
            (point_[static_cast<std::size_t>(k)] - point_[static_cast<std::size_t>(j)]);
      else if (k == 0)
        d = -0.25 * degree * n;
      else if (k == degree)
        d = 0.25 * degree * n;
    }
  Eigen::MatrixXd powers(n, n);
  for (int k = 0; k < n; ++k)
    for (int j = 0; j < n; ++j) powers(k, j) = std::pow(point_[static_cast<std::size_t>(k)], j);
  const Eigen::MatrixXd inverse_powers = powers.inverse();
  monomial_.resize(static_cast<std::size_t>(n * n));
  for (int power = 0; power < n; ++power)
    for (int j = 0; j < n; ++j) monomial_[static_cast<std::size_t>(power * n + j)] = inverse_powers(power, j);
}

double DirectorMesh::place(int node) const {
  const int e = std::min(node / degree_, elements() - 1);
  return middle(e) + 0.5 * width(e) * point_[static_cast<std::size_t>(node - e * degree_)];
}

int DirectorMesh::element_at(double u) const {
  const auto it = std::upper_bound(edges_.begin() + 1, edges_.end() - 1, u);
  return static_cast<int>(it - edges_.begin()) - 1;
}

std::optional<DirectorMesh> DirectorMesh::half() const {
  if (is_half_ || elements() % 2 == 1) return std::nullopt;
  DirectorMesh half = *this;
  half.is_half_ = true;
  half.edges_.resize(static_cast<std::size_t>(elements() / 2 + 1));
  for (double& weight : half.weight_) weight *= 2;
  return half;
}

}  // namespace birefit
