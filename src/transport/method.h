#pragma once
// The interface every transport method implements, and the list of them. Adding a method: one file in methods/ and one
// line in methods.def.

#include <span>
#include <string>
#include <vector>

#include "core/jones.h"
#include "medium/column.h"
#include "transport/one_way.h"

namespace birefit {

/// Light through one column.
template <class S>
struct Ray {
  S k0_per_um;  ///< 2 pi / vacuum wavelength
  S kx, ky;     ///< tangential wavevector in units of k0, constant along the column
  Continuity continuity = Continuity::e_and_h;
};

/// Step boundaries in u, 0 = first < .. < last = 1; contains every break of the column.
using Mesh = std::vector<double>;

/// How a method describes itself to the planner, the charts and the documentation.
struct MethodInfo {
  const char* name;
  int order;            ///< global error ~ steps^-order; 0 = spectral (quadrature)
  bool needs_planar;    ///< exact only where transport is diagonal
  bool reflections;     ///< has transmission() only, backward waves and faces included
  const char* summary;  ///< what it is, one line
  const char* source;
  bool slow_axes = false;  ///< only where the axis turns slowly against the phase; more steps do not mend it
  bool magnus = false;     ///< magnus_retarder() of the same order is its retarder()
};

template <class S>
class TransportMethod {
 public:
  virtual ~TransportMethod() = default;
  virtual const MethodInfo& info() const = 0;
  /// Transfer matrix of E_t from just inside u = 0 to just inside u = 1, steps of the medium at its breaks included,
  /// entry and exit faces not. Plain doubles: throws std::domain_error instead of an answer that is not finite or
  /// amplifies as no passive medium can (see checked_transfer): steps too long for the method (a series in the
  /// commutators needs less than about pi of what does not commute in a step; a homogeneous medium takes any step), a
  /// wave that is totally reflected inside, modes where there are none. In lanes, one ray of many, nothing is checked.
  virtual Mat2<S> transfer(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh) const = 0;
  /// Normal incidence (kx = ky = 0), lossless, no jumps: the retarder on the flux-normalised field (e_and_h) or on E_t
  /// (e_only), common phase left out.
  virtual Su2<S> retarder(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh) const = 0;
  /// E_t behind the column over E_t of the wave that falls on it, host of real index on both sides: exit * transfer *
  /// entry, unless the method does more.
  virtual Mat2<S> transmission(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh, const S& host_index) const;
};

/// All methods for scalar S, in the order of methods.def.
template <class S>
std::span<const TransportMethod<S>* const> transport_methods();
template <class S>
const TransportMethod<S>& transport_method(const std::string& name);  ///< throws std::logic_error when unknown
const std::vector<std::string>& transport_method_names();

/// What every transfer() ends with: t itself, unless it is a plain double and no answer. A lossless medium changes
/// |E_t| by sqrt(q_in/q_out) at most, about 1e3 at a gap of 1e-12 to total reflection; beyond 1e6 it is the method that
/// grows.
[[noreturn]] void refuse_transfer(const MethodInfo& info);  ///< std::domain_error
template <class S>
const Mat2<S>& checked_transfer([[maybe_unused]] const MethodInfo& info, const Mat2<S>& t) {
  if constexpr (std::is_same_v<S, double>)
    if (!(norm(t.a) + norm(t.b) + norm(t.c) + norm(t.d) < 1e12)) refuse_transfer(info);
  return t;
}
/// Outside faces: E_t transmitted into the column at u = 0 and out of it at u = 1, host of real index n.
template <class S>
Mat2<S> entry_factor(const Column<S>& column, const Ray<S>& ray, const S& host_index);
template <class S>
Mat2<S> exit_factor(const Column<S>& column, const Ray<S>& ray, const S& host_index);
/// Factor on E_t where the medium steps at mesh[node], E and H continuous; the identity where it does not.
template <class S>
Mat2<S> step_of_medium(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh, std::size_t node);
/// Both, in a lossless column with E and H continuous, where they are real.
template <class S>
struct FaceFactors {
  Matrix2<S> entry, exit;
};
template <class S>
FaceFactors<S> lossless_faces(const Column<S>& column, const Ray<S>& ray, const S& host_index);
/// n equal steps between 0 and 1 merged with the column's breaks (each piece gets at least one step).
Mesh uniform_mesh(int steps, const std::vector<double>& breaks = {});
/// Steps of magnus4 whose local error (one step against two halves, Frobenius norm) is below tolerance per unit u.
/// Never fails: stops refining at max_steps and returns what it has; error_estimate receives the sum of local errors.
Mesh adapted_mesh(const Column<double>& column, const Ray<double>& ray, double tolerance,
                  double* error_estimate = nullptr, int max_steps = 200000);

}  // namespace birefit
