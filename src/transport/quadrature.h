#pragma once
// Gauss-Legendre nodes on a mesh.

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

}  // namespace birefit
