#pragma once
// A flat nematic cell in a field: from the numbers of a scene to the equilibrium profile and its law. u = depth /
// thickness.

#include <memory>
#include <vector>

#include "birefit/scene.h"
#include "medium/column.h"
#include "medium/families/equilibrium.h"
#include "medium/families/planar.h"

namespace birefit {

/// eps0 in pN / V^2.
inline constexpr double kVacuumPermittivity = 8.8541878128;

/// What the scene's numbers mean for the energy (equilibrium.h).
template <class S, class V>
CellForces<S> cell_forces(const FreederickszDirector& director, const S& thickness_um, const V& value) {
  using Anchoring = FreederickszDirector::Anchoring;
  CellForces<S> p;
  const bool constants = static_cast<bool>(director.k11_pn);
  p.k33 = constants ? value(director.k33_pn) / value(director.k11_pn) : value(director.k33_over_k11);
  if (director.k22_pn || director.k22_over_k11)
    p.k22 = constants ? value(director.k22_pn) / value(director.k11_pn) : value(director.k22_over_k11);
  p.gamma = (director.eps_parallel ? value(director.eps_parallel) / value(director.eps_perpendicular)
                                   : value(director.eps_ratio)) -
            1.0;
  if (director.voltage_v && !director.threshold_v) {
    const S volts = value(director.voltage_v);
    p.drive = kVacuumPermittivity * (value(director.eps_parallel) - value(director.eps_perpendicular)) * volts * volts /
              value(director.k11_pn);
  } else {
    const S v = director.reduced_voltage ? value(director.reduced_voltage)
                                         : value(director.voltage_v) / value(director.threshold_v);
    const double gamma = lane(plain(p.gamma), 0);
    const bool falls = gamma < 0 || (gamma == 0 && director.anchoring == Anchoring::homeotropic);
    p.drive = (std::numbers::pi * std::numbers::pi) * v * v;
    if (falls) p.drive = -(p.drive * p.k33);
  }
  const S pretilt = value.radians(director.pretilt_deg), right(std::numbers::pi / 2);
  p.tilt_entry = director.anchoring == Anchoring::homeotropic ? right - pretilt : pretilt;
  p.tilt_exit = director.anchoring == Anchoring::planar   ? pretilt
                : director.anchoring == Anchoring::hybrid ? right
                                                          : p.tilt_entry;
  p.twisted = director.twist_deg || director.pitch_um;
  p.twist = value.radians(director.twist_deg);
  if (director.pitch_um) p.chirality = (2 * std::numbers::pi) * thickness_um / value(director.pitch_um);
  return p;
}

/// The profile as polynomials of the local coordinate x in [-1, 1] of each element, made once and shared.
template <class S>
struct DirectorProfile {
  const DirectorMesh* mesh = nullptr;
  /// coefficient of x^power of element e at e * (degree + 1) + power; azimuth empty without twist
  std::vector<S> tilt, azimuth;
};

/// Solved in plain numbers; derivatives, where S has them, by the implicit-function theorem. All lanes of S must be
/// equal.
template <class S>
std::shared_ptr<const DirectorProfile<S>> make_director_profile(const CellForces<S>& forces, Memo* memo) {
  const auto number = [](const S& x) { return lane(plain(x), 0); };
  const DirectorMesh& mesh = cell_mesh();
  const std::shared_ptr<const DirectorSolution> known = known_director(
      {number(forces.k33), number(forces.k22), number(forces.gamma), number(forces.drive), number(forces.chirality),
       number(forces.tilt_entry), number(forces.tilt_exit), number(forces.twist), forces.twisted},
      memo);
  const DirectorSolution& solution = *known;
  std::vector<S> tilt(solution.tilt.begin(), solution.tilt.end()),
      azimuth(solution.azimuth.begin(), solution.azimuth.end());
  constexpr int kDerivatives = ScalarTraits<S>::derivatives;
  if constexpr (kDerivatives > 0) {
    using D = Dual<double, kDerivatives>;
    const auto dual = [](const S& x) {
      D r(lane(plain(x), 0));
      for (std::size_t i = 0; i < kDerivatives; ++i) r.d[i] = lane(x.d[i], 0);
      return r;
    };
    std::vector<std::array<double, kDerivatives>> tilt_d, azimuth_d;
    director_tangents<kDerivatives>(
        {dual(forces.k33), dual(forces.k22), dual(forces.gamma), dual(forces.drive), dual(forces.chirality),
         dual(forces.tilt_entry), dual(forces.tilt_exit), dual(forces.twist), forces.twisted},
        mesh, solution, tilt_d, azimuth_d);
    for (std::size_t i = 0; i < tilt.size(); ++i)
      for (std::size_t k = 0; k < kDerivatives; ++k) tilt[i].d[k] = PlainOf<S>(tilt_d[i][k]);
    for (std::size_t i = 0; i < azimuth.size(); ++i)
      for (std::size_t k = 0; k < kDerivatives; ++k) azimuth[i].d[k] = PlainOf<S>(azimuth_d[i][k]);
  }
  auto profile = std::make_shared<DirectorProfile<S>>();
  profile->mesh = &mesh;
  const auto polynomials = [&](const std::vector<S>& nodes, std::vector<S>& to) {
    if (nodes.empty()) return;
    for (int e = 0; e < mesh.elements(); ++e)
      for (int power = 0; power <= mesh.degree(); ++power) {
        S sum(0.0);
        for (int j = 0; j <= mesh.degree(); ++j)
          sum = sum + mesh.monomial(power, j) * nodes[static_cast<std::size_t>(e * mesh.degree() + j)];
        to.push_back(sum);
      }
  };
  polynomials(tilt, profile->tilt);
  polynomials(azimuth, profile->azimuth);
  return profile;
}

/// A cell of constant indices whose director is a profile. Between elements the slope is continuous to the solver's
/// error, so that meshes need no node there.
template <class S>
struct FreederickszLaw {
  std::shared_ptr<const DirectorProfile<S>> profile;
  S azimuth_rad, ordinary, extraordinary, thickness_um;
  template <class T>
  OpticalPoint<T> at(const T& u) const {
    const DirectorMesh& mesh = *profile->mesh;
    const int element = mesh.element_at(lane(plain(u), 0)), n = mesh.degree() + 1;
    const T x = (u - mesh.middle(element)) * (2 / mesh.width(element));
    const auto sum = [&](const std::vector<S>& coefficients) {
      const S* c = &coefficients[static_cast<std::size_t>(element * n)];
      T r(c[n - 1]);
      for (int power = n - 2; power >= 0; --power) r = r * x + T(c[power]);
      return r;
    };
    const T tilt = sum(profile->tilt);
    const T azimuth = profile->azimuth.empty() ? T(azimuth_rad) : T(azimuth_rad) + sum(profile->azimuth);
    return {axis_from_angles<T>(tilt, azimuth), T(ordinary), T(extraordinary), T(0.0), T(0.0), T(thickness_um)};
  }
};

}  // namespace birefit
