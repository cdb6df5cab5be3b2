#pragma once
// The director of a flat nematic cell in a field along its normal: the profile of tilt and azimuth that minimises the
// Frank-Oseen and electric energy at a given voltage, between strongly anchoring faces.
//
// With zeta = depth / thickness, t the tilt from the layer plane, f the azimuth, energies per area in K11 / thickness:
//   F = Int 1/2 (cos^2 t + k33 sin^2 t) t'^2 + 1/2 cos^2 t (k22 cos^2 t + k33 sin^2 t) f'^2 - k22 chirality cos^2 t f'
//   dzeta
//       - 1/2 drive Q / (1 - gamma Q),      Q = Int sin^2 t / (1 + gamma sin^2 t) dzeta.
// The electric term is that of a fixed voltage and a displacement D uniform over the depth (Deuling, Mol. Cryst. Liq.
// Cryst. 19, 123 (1972); Leslie, ibid. 12, 57 (1970) for the twist), less a constant. It is regular at gamma = 0, the
// uniform field.

#include <memory>
#include <vector>

#include "core/scalar.h"
#include "medium/families/director_mesh.h"

namespace birefit {

class Memo;  // birefit/memo.h

/// Everything the equilibrium depends on, without dimensions; angles in radians.
template <class S>
struct CellForces {
  S k33 = S(1.0), k22 = S(1.0);  ///< K33/K11 and K22/K11, > 0
  S gamma = S(0.0);              ///< eps_par/eps_perp - 1, > -1
  /// eps0 (eps_par - eps_perp) V^2 / K11: pi^2 at the threshold of an untwisted planar cell; its sign is gamma's.
  S drive = S(0.0);
  S chirality = S(0.0);  ///< 2 pi thickness / pitch; > 0 is right-handed
  S tilt_entry = S(0.0), tilt_exit = S(0.0);
  S twist = S(0.0);      ///< azimuth at the exit less that at the entry
  bool twisted = false;  ///< azimuth and chirality take part; else f = 0 everywhere
};

/// The mesh of all cells: 16 elements of degree 10. The profile is then good to 1e-9 rad up to ten times the threshold
/// voltage, 1e-6 up to fifty times (tests/laws/equilibrium_test.cc).
const DirectorMesh& cell_mesh();

/// Tilt and azimuth at the nodes of a mesh and, of the energy there, what it takes to follow a change of the forces.
struct DirectorSolution {
  std::vector<double> tilt, azimuth;  ///< azimuth empty without twist
  int iterations = 0;
  double energy = 0;  ///< in K11 / thickness; 0 = the untwisted planar state
};

/// The equilibrium in plain numbers: Newton's method on the energy with backtracking, started from the elliptic profile
/// of one elastic constant and a uniform field, on the side of the pretilt. Collocation order: halving all elements
/// divides the error of the profile by 2^(degree + 1). Throws UserError when no equilibrium is found.
DirectorSolution solve_director(const CellForces<double>& forces, const DirectorMesh& mesh = cell_mesh());

/// The same on the mesh of all cells, remembered by `memo` if there is one.
std::shared_ptr<const DirectorSolution> known_director(const CellForces<double>& forces, Memo* memo);

/// d(tilt), d(azimuth) at the nodes for each of N directions in which the forces change (the .d of `forces`): the
/// implicit-function theorem at a solution, exact for the discrete equations.
template <int N>
void director_tangents(const CellForces<Dual<double, N>>& forces, const DirectorMesh& mesh,
                       const DirectorSolution& solution, std::vector<std::array<double, N>>& tilt,
                       std::vector<std::array<double, N>>& azimuth);

extern template void director_tangents<1>(const CellForces<Dual<double, 1>>&, const DirectorMesh&,
                                          const DirectorSolution&, std::vector<std::array<double, 1>>&,
                                          std::vector<std::array<double, 1>>&);
extern template void director_tangents<2>(const CellForces<Dual<double, 2>>&, const DirectorMesh&,
                                          const DirectorSolution&, std::vector<std::array<double, 2>>&,
                                          std::vector<std::array<double, 2>>&);
extern template void director_tangents<4>(const CellForces<Dual<double, 4>>&, const DirectorMesh&,
                                          const DirectorSolution&, std::vector<std::array<double, 4>>&,
                                          std::vector<std::array<double, 4>>&);

}  // namespace birefit
