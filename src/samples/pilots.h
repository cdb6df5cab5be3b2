#pragma once
// The few rays that stand for a picture when a method is chosen: each method is measured on them against their own
// converged answer. docs/methods.md, "Choosing".

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "samples/image.h"
#include "transport/intensity_distance.h"
#include "transport/method.h"

namespace birefit {

/// A ray's error, huge where it has none.
inline double or_huge(double error) { return std::isfinite(error) ? error : 1e300; }

/// A kind hands over its rays, each of which knows its own answer, converged to far below the scene's accuracy.
struct Pilots {
  /// Largest change of any polarizer-analyser intensity (slabs: of the matrix with its phase) on one ray.
  std::vector<std::function<double(const TransportMethod<double>&, const Mesh&)>> rays;
  /// Points of the medium that one ray takes, faces not counted.
  std::function<int(const TransportMethod<double>&, const Mesh&)> samples_of;
  std::vector<double> breaks;  ///< of the medium

  std::size_t size() const { return rays.size(); }
  /// The largest of all rays; stops at the first that exceeds `enough`. 1e300 where the method has no answer.
  double error(const TransportMethod<double>& method, const Mesh& mesh, double enough = 1e300) const;
  /// Equal steps and the medium's breaks.
  Mesh mesh(int steps) const { return uniform_mesh(steps, breaks); }
  int samples(const TransportMethod<double>& method, const Mesh& mesh) const { return samples_of(method, mesh); }

 private:
  mutable std::size_t hardest_ = 0;
};

/// A method and its effort.
struct Effort {
  const TransportMethod<double>* method = nullptr;
  int steps = 0;
  int samples = 0;  ///< of the medium, a ray
  double error = 1e300;
};
/// Of all registered one-way methods and all efforts the one that takes the fewest samples a ray and holds `target` on
/// the pilots; so must the next finer effort: a method may agree by chance. `only`: this method alone ("" = all);
/// `but`: not this one. `even_steps`: a kink in the middle stays a node. The most accurate effort tried where none
/// holds the target.
Effort cheapest_effort(const Pilots& pilots, double target, const std::string& only, bool even_steps,
                       const std::string& but = "");

}  // namespace birefit
