#pragma once
// Pixels of a picture that a fit leaves out since the model cannot hold there; where they are follows the parameters.

#include <vector>

#include "birefit/parameters.h"

namespace birefit {

class Zone {
 public:
  virtual ~Zone() = default;
  /// Whether a fit uses the pixel.
  virtual bool fitted(double column, double row) const = 0;

  struct Mover {
    ParameterRef parameter;
    /// Places so far apart (in its unit) leave nothing between them that neither covers; 0: the ends of its bounds do.
    double step = 0;
    double period = 0;  ///< after which all is as before; 0: never
  };
  /// What moves it.
  virtual std::vector<Mover> movers() const = 0;
};

}  // namespace birefit
