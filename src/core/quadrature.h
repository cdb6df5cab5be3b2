#pragma once
// Gauss-Legendre nodes.

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace birefit {

/// 8 Gauss-Legendre nodes in every step of the mesh; weights sum to 1. Abramowitz & Stegun 25.4.30.
inline void gauss8_nodes(const std::vector<double>& mesh, std::vector<double>& u, std::vector<double>& weight) {
  static constexpr double kX[4] = {0.1834346424956498, 0.5255324099163290, 0.7966664774136267, 0.9602898564975363};
  static constexpr double kW[4] = {0.3626837833783620, 0.3137066458778873, 0.2223810344533745, 0.1012285362903763};
  u.clear();
  weight.clear();
  for (std::size_t i = 0; i + 1 < mesh.size(); ++i) {
    const double middle = 0.5 * (mesh[i] + mesh[i + 1]), half = 0.5 * (mesh[i + 1] - mesh[i]);
    for (int k = 7; k >= 0; --k) {
      const double x = k >= 4 ? -kX[k - 4] : kX[3 - k];
      u.push_back(middle + half * x);
      weight.push_back(half * (k >= 4 ? kW[k - 4] : kW[3 - k]));
    }
  }
}

/// n Gauss-Legendre nodes on (-1, 1), upwards, and their weights: Newton's method on the recurrence of P_n from
/// Tricomi's estimate of its zeros.
inline void legendre_nodes(int n, std::vector<double>& x, std::vector<double>& weight) {
  x.resize(static_cast<std::size_t>(n));
  weight.resize(x.size());
  for (int i = 0; i < n; ++i) {
    double z = -std::cos(std::numbers::pi * (i + 0.75) / (n + 0.5)), slope = 1;
    for (int pass = 0; pass < 8; ++pass) {
      double last = 1, now = z;  // P_0, P_1
      for (int k = 2; k <= n; ++k) {
        const double next = ((2 * k - 1) * z * now - (k - 1) * last) / k;
        last = now;
        now = next;
      }
      slope = n * (z * now - last) / (z * z - 1);
      const double step = now / slope;
      z -= step;
      if (std::fabs(step) < 1e-15) break;
    }
    x[static_cast<std::size_t>(i)] = z;
    weight[static_cast<std::size_t>(i)] = 2 / ((1 - z * z) * slope * slope);
  }
}

/// One Gauss-Legendre rule over each piece between breaks, of as many nodes as the mesh has steps there: spectral where
/// the medium is smooth. Weights sum to 1. Beyond 64 nodes a piece is parted: one long rule would gain nothing and take
/// time as its square. The nodes used last by this thread are kept: every ray of an image asks for the same.
struct GaussNodes {
  std::vector<double> mesh, breaks, u, weight;
};
inline const GaussNodes& gauss_nodes(const std::vector<double>& mesh, const std::vector<double>& breaks) {
  thread_local GaussNodes last;
  if (last.mesh == mesh && last.breaks == breaks) return last;
  last = {mesh, breaks, {}, {}};
  constexpr std::size_t kLongestRule = 64;
  std::vector<double> x, w;
  for (std::size_t i = 0, from = 0; i + 1 < mesh.size(); ++i) {
    if (i + 2 < mesh.size() && !std::binary_search(breaks.begin(), breaks.end(), mesh[i + 1])) continue;
    const std::size_t all = i + 1 - from, parts = (all + kLongestRule - 1) / kLongestRule;
    const double width = (mesh[i + 1] - mesh[from]) / static_cast<double>(parts);
    for (std::size_t part = 0; part < parts; ++part) {
      const std::size_t nodes = all * (part + 1) / parts - all * part / parts;
      if (x.size() != nodes) legendre_nodes(static_cast<int>(nodes), x, w);
      const double middle = mesh[from] + width * (static_cast<double>(part) + 0.5);
      for (std::size_t k = 0; k < nodes; ++k) {
        last.u.push_back(middle + 0.5 * width * x[k]);
        last.weight.push_back(0.5 * width * w[k]);
      }
    }
    from = i + 1;
  }
  return last;
}

/// The polynomial through 8 values at the Gauss nodes of [-1, 1], in the order of gauss8_nodes(): its derivative there
/// and its values at both ends.
struct GaussPolynomial {
  std::array<std::array<double, 8>, 8> derivative;
  std::array<double, 8> at_start, at_end;
};
inline const GaussPolynomial& gauss8_polynomial() {
  static const GaussPolynomial rule = [] {
    std::vector<double> u, weight;
    gauss8_nodes({-1.0, 1.0}, u, weight);
    GaussPolynomial r;
    // Barycentric: Berrut & Trefethen, SIAM Review 46, 501 (2004).
    std::array<double, 8> w;
    for (std::size_t k = 0; k < 8; ++k) {
      w[k] = 1;
      for (std::size_t m = 0; m < 8; ++m)
        if (m != k) w[k] /= u[k] - u[m];
    }
    const auto at = [&](double x) {
      std::array<double, 8> l;
      double sum = 0;
      for (std::size_t k = 0; k < 8; ++k) sum += l[k] = w[k] / (x - u[k]);
      for (double& value : l) value /= sum;
      return l;
    };
    r.at_start = at(-1), r.at_end = at(1);
    for (std::size_t i = 0; i < 8; ++i) {
      r.derivative[i][i] = 0;
      for (std::size_t k = 0; k < 8; ++k)
        if (k != i) {
          r.derivative[i][k] = w[k] / w[i] / (u[i] - u[k]);
          r.derivative[i][i] -= r.derivative[i][k];
        }
    }
    return r;
  }();
  return rule;
}

}  // namespace birefit
