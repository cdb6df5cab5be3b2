#pragma once
// What lenses, cameras and resampling do to the model's light, to first order.

#include <algorithm>
#include <array>
#include <vector>

#include <Eigen/Dense>

#include "birefit/measurement.h"

namespace birefit::estimation {

/// The light of a picture where it is known, and what effects refer to.
struct KnownLight {
  Image light;
  Mask known;
  double center_x = 0, center_y = 0;  ///< of the sample, px

  KnownLight(int width, int height) : light(width, height), known(width, height) {}
  /// `values` at these pixels of a view; the centre where theta puts it.
  KnownLight(const View& view, const Theta& theta, const std::vector<std::array<int, 2>>& pixels,
             const Eigen::Ref<const Eigen::VectorXd>& values);
  void set(int x, int y, double value) { light(x, y) = value, known(x, y) = 1; }
};

/// d(light of a pixel)/d(effect), in units of the light per unit of the effect (PictureEffect::Kind); 0 where it takes
/// a neighbour that is not known.
double effect_at(PictureEffect::Kind kind, const KnownLight& picture, int x, int y);

/// How a picture changes by a parameter, per unit of it.
struct LightChange {
  Image light;                        ///< at all pixels that are known
  double center_x = 0, center_y = 0;  ///< of the sample, px
};
/// d(effect_at)/d(that parameter).
double effect_change_at(PictureEffect::Kind kind, const KnownLight& picture, const LightChange& change, int x, int y);

}  // namespace birefit::estimation
