#pragma once
// The few rays that stand for a picture when a method is chosen: each method is measured on them against their own
// converged answer. docs/methods.md, "Choosing".

#include <functional>
#include <utility>

#include "render/pixel_model.h"
#include "transport/intensity_distance.h"
#include "transport/method.h"

namespace birefit {

class Pilots {
 public:
  /// Droplets, cells, plates, slabs and volumes; the truth is converged to far below the scene's accuracy.
  Pilots(const Scene& scene, const Values<double>& value);
  std::size_t size() const { return rays_.size(); }
  /// Largest change of any polarizer-analyser intensity (slabs: of the matrix with its phase) on any pilot; stops at
  /// the first that exceeds `enough`. 1e300 where the method has no answer.
  double error(const TransportMethod<double>& method, const Mesh& mesh, double enough = 1e300) const;
  /// Equal steps and the medium's breaks.
  Mesh mesh(int steps) const { return uniform_mesh(steps, breaks_); }
  /// Points of the medium that one ray takes, faces not counted.
  int samples(const TransportMethod<double>& method, const Mesh& mesh) const { return samples_(method, mesh); }

 private:
  void add_droplet(const Scene& scene, const Values<double>& value);
  void add_ball(const Scene& scene, const Values<double>& value);
  void add_planar(const Scene& scene, const Values<double>& value);
  void add_volume(const Scene& scene, const Values<double>& value);
  std::vector<std::function<double(const TransportMethod<double>&, const Mesh&)>> rays_;
  std::function<int(const TransportMethod<double>&, const Mesh&)> samples_;
  std::vector<double> breaks_;
  mutable std::size_t hardest_ = 0;
};

/// The directions, as tan(incidence) (cos azimuth, sin azimuth), on which cells, plates and slabs are judged: of a list
/// at most `most`, from the flattest to the steepest.
std::vector<std::pair<double, double>> pilot_directions(const Scene& scene, const Values<double>& value,
                                                        std::size_t most = 12);

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
