#pragma once
// What happens to pictures on their way from a sample to a file, written without the code that fits it.

#include <array>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "birefit/fit.h"

namespace birefit::study {

/// The making of one problem's pictures, in which a departure may have a hand.
struct Exposure {
  std::mt19937_64& random;
  double size = 0;  ///< the departure's
  double sign = 1;  ///< of what may go either way
};
/// A frame's levels.
struct Levels {
  double dark = 0, range = 1;  ///< value of no light; from there to the brightest of all frames
  double along = 0;            ///< of the frame among its own, -0.5 to 0.5
};

struct Disturbance {
  std::string name, what;
  std::string unit;  ///< "%": sizes are shares
  std::array<double, 3> sizes;
  /// Of what is stated: the table's index, and the departure is of its value.
  int parameter = -1;
  bool of_share = false;  ///< sizes are shares of the value
  /// Pictures may have no trace of it, and every size is more than twice what is usual: counted apart where nothing is
  /// left over.
  bool beyond_usual = false;
  /// Each may be empty. Values of the table that the pictures are made with; light, of no unit; values, before or after
  /// the noise.
  std::function<void(Exposure&, Theta&)> scene;
  /// What else is there: a scene's own copy, and values behind those of the table for its new numbers.
  std::function<void(Exposure&, Scene&, Theta&)> added;
  std::function<void(Exposure&, const Scene&, const Theta&, Image& light)> light;
  std::function<void(Exposure&, const Levels&, Image&values)> values, codes;
  std::function<void(Exposure&, Image& noise)> noise;
  /// Pictures at other places of the table, whose mean with these weights is seen.
  std::function<std::vector<std::pair<double, Theta>>(Exposure&, const Theta&)> mixed;
};

/// Those that apply to a job, as `with_all_stated` makes it.
std::vector<Disturbance> disturbances(const FitJob& job);

}  // namespace birefit::study
