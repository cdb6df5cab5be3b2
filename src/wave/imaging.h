#pragma once
// From the scattered field behind an object to what the camera sees: objective, analyser, pixels. Fourier integrals as
// matrix products, so that pupil and picture have the sampling they need, whatever the propagation's grid.

#include "birefit/image.h"
#include "wave/split_step.h"

namespace birefit {

/// Fixed during a fit, like WaveGrid.
struct WaveImaging {
  double pupil_step_per_um = 0;  ///< between transverse wavevectors; the picture repeats itself after 2 pi of it
  int pupil_half = 0;            ///< wavevectors -half .. half of it in each direction
  double spacing_um = 0;         ///< of the points where intensity is computed
  int half_x = 0, half_y = 0;    ///< points -half .. half about the object's centre; beyond: the incident light alone
};
/// objective_na <= n_host; reach: farthest point of the picture from the object's centre that is wanted (um), along x
/// and y; no further than the grid's own field tells.
WaveImaging plan_imaging(const WaveGrid&, double k0_per_um, double objective_na, double reach_x_um, double reach_y_um);

template <class S>
struct WaveMicroscope {
  S objective_na = S(0.0);
  bool aplanatic = false;      ///< docs/conventions.md
  S focus_um = S(0.0);         ///< z of the focal plane
  Complex<S> ax, ay;           ///< the field that is let through, of unit length
  S center_x_px, center_y_px;  ///< where the object's centre is seen
  S pixel_um = S(0.0);
  int width = 0, height = 0;  ///< of the picture, pixels
};

/// Mean intensity of every pixel, and its derivatives: 1 + derivatives images, resized to fit. Derivatives beyond those
/// that `fields` has are by parameters that the light on its way does not depend on.
template <class S>
void form_image(const WaveGrid&, const WaveImaging&, const WaveLight<S>&, const WaveMicroscope<S>&,
                const std::vector<WaveField>&, int threads, const std::vector<Image*>& images);

}  // namespace birefit
