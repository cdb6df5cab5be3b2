#pragma once
// Gauss-Legendre nodes on a mesh.

#include <array>
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

/// The nodes of the mesh used last by this thread: every ray of an image asks for the same.
struct GaussNodes {
  std::vector<double> mesh, u, weight;
};
inline const GaussNodes& gauss8_nodes(const std::vector<double>& mesh) {
  thread_local GaussNodes last;
  if (last.mesh != mesh) {
    last.mesh = mesh;
    gauss8_nodes(mesh, last.u, last.weight);
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
