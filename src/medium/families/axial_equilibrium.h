#pragma once
// Equilibrium of a nematic droplet with normal anchoring in an electric field along an axis, one elastic constant,
// positive dielectric anisotropy (Humar et al., Opt. Express 17, 2009; docs/methods.md): the angle theta of the
// director from the field minimises
//   F / (K R) = 2 pi Int rho drho dz {1/2 |grad theta|^2 + 1/2 sin^2 theta (1/rho^2 + e^2)},   e = R / coherence
//   length,
// at fixed radius of the equatorial disclination ring. Strong anchoring; symmetric about the equator.

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "core/scalar.h"

namespace birefit {

class Memo;  // birefit/memo.h

/// theta - axial_boundary_angle() on the quarter disc r in [0, 1], polar angle in [0, pi/2]: a tensor grid of elements,
/// polynomials of degree `degree` on each through Gauss-Lobatto points. Elements are finer where the field makes layers
/// of thickness 1/e (sphere, equator) and around the ring.
struct AxialGrid {
  int elements = 8;  ///< along either coordinate
  int degree = 5;
  int nodes() const { return elements * degree + 1; }
};

/// Edges of the elements, as functions of e and ring that stay fixed in number: radius r of edge k, and polar angle
/// (rad) of edge k counted from the equator. ring = 0: the hedgehog.
template <class T>
T axial_radius_edge(const AxialGrid& grid, int k, const T& e, const T& ring, bool has_ring);
template <class T>
T axial_polar_edge(const AxialGrid& grid, int k, const T& e, const T& ring, bool has_ring);

/// Gauss-Lobatto points on [-1, 1] and their weights.
struct LobattoRule {
  std::vector<double> x, w;
  Eigen::MatrixXd derivative;  ///< (i, j): slope at x_i of the polynomial that is 1 at x_j
};
/// 1 <= degree <= 20.
const LobattoRule& lobatto_rule(int degree);

struct AxialEquilibrium {
  double e, ring;
  AxialGrid grid;
  Eigen::VectorXd r, polar_rad;  ///< of the nodes; polar angle falls from pi/2
  Eigen::MatrixXd change;        ///< theta - axial_boundary_angle at (r, polar), rad
  /// of `change` by e and ring, node by node: the nodes move, too; empty unless `slopes` were asked for
  Eigen::MatrixXd by_e, by_ring;
  int newton_steps = 0;
  /// theta at any place of the upper half.
  double theta(double rho, double z) const;
  /// F / (K R), the energy of the whole sphere. A ring's diverges with the logarithm of its core radius r_c: of a ring
  /// it is what is left when pi^2/2 ring ln(R / r_c) is taken off.
  double energy() const;
};

/// L = ln(R / r_c) + core energy (per length, in pi K / 4) with which a ring is where its tension and the field
/// balance, dF/dring = 0: a ring whose own L is larger shrinks. Of a droplet of micrometres L is 5 to 10 (r_c 5 to 10
/// nm, core energy 0 to 1; docs/methods.md). `stable`: it returns there when moved.
struct RingBalance {
  double core_length;
  bool stable;
};
/// On the production grid, by differences of the energy over a tenth of the way to the sphere. `memo` may be null.
RingBalance ring_balance(double e, double ring, Memo* memo = nullptr);

/// Newton's method from a closed-form start, always the same: equal arguments give equal bits. e in [0, 60], ring 0 or
/// in [0.2, 0.995]. Throws std::domain_error where Newton does not converge, which no e and ring in range do.
AxialEquilibrium axial_equilibrium(double e, double ring, const AxialGrid& grid = {}, bool slopes = true);
/// Grid that images use. Largest error of a hedgehog 3e-5 rad up to e = 25, 3e-4 at e = 40; of a ring, close to it,
/// 1e-4 at e = 10, 6e-4 at e = 40, where its distance to the sphere is of the coherence length
/// (tests/cross/axial_droplet_test.cc).
inline AxialGrid axial_production_grid(double ring) { return {ring > 0 ? 10 : 8, 5}; }
/// The same on the production grid to 1e-8 rad, in a few steps from the nearest of a fixed ladder of equilibria, which
/// are made when first needed: equal arguments give equal bits whatever was asked before. Both are remembered by
/// `memo`, for images that differ in other parameters; without one the ladder's is made for this call.
std::shared_ptr<const AxialEquilibrium> known_axial_equilibrium(double e, double ring, bool slopes,
                                                                Memo* memo = nullptr);

// ---- the edges -----------------------------------------------------------------------------------------------------

/// x in [0, 1] to [0, 1], slope `fine` at both ends.
template <class T>
T graded(double x, const T& fine) {
  return fine * (x * (1 - x) * (1 - 2 * x)) + x * x * (3 - 2 * x);
}
template <class T>
T axial_radius_edge(const AxialGrid& grid, int k, const T& e, const T& ring, bool has_ring) {
  if (!has_ring) return graded(static_cast<double>(k) / grid.elements, 1.0 / (1.0 + e * (1.0 / 6)));
  const int inner = grid.elements * 5 / 8;
  if (k <= inner)
    return ring *
           graded(static_cast<double>(k) / inner, 1.0 / (1.0 + e * ring * (1.0 / 6) + 0.25 * ring / (1.0 - ring)));
  return ring + (1.0 - ring) * graded(static_cast<double>(k - inner) / (grid.elements - inner),
                                      1.0 / (1.0 + e * (1.0 - ring) * (1.0 / 6)));
}
template <class T>
T axial_polar_edge(const AxialGrid& grid, int k, const T& e, const T& ring, bool has_ring) {
  const double x = static_cast<double>(k) / grid.elements;
  const T fine = has_ring ? 1.0 / (1.0 + e * (1.0 / 6) + 0.25 / (1.0 - ring)) : 1.0 / (1.0 + e * (1.0 / 6));
  return 1.5707963267948966 * (1.0 - (fine * (x - x * x * x) + x * x * x));
}

}  // namespace birefit
