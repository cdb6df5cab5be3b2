#pragma once
// How each micrograph of a fit is rendered and weighed.

#include <memory>
#include <vector>

#include "fit/problem/least_squares.h"
#include "fit/problem/task.h"

namespace birefit::estimation {

struct Frame {
  RenderPlan plan;
  NoiseModel noise;
  bool noise_of_all = false;  ///< told by all frames together: the residual of one tells no more of it
  Image sigma;                ///< standard deviation of every pixel's value, in its units
  double rounding_sd = 0;  ///< of what rounding does to all pixels alike: those of even light, less noisy than a code
  Pixels pixels;           ///< that take part
};
using Frames = std::vector<Frame>;

/// Where a fit begins: plans, noise and pixels at the start values.
struct Start {
  Frames frames;
  Theta theta;
  Eigen::VectorXd searched;
};

/// Throws UserError for a job that no fit can be made of: no image, no usable pixel, fewer pixels than unknowns.
Start prepare(const Task& task);

/// All of one pixel each, as the rows of a table are.
bool are_rows(const Frames& frames);
/// Every pixel is rays of its own, microseconds each: no table serves all of a ring.
bool has_own_rays(const Scene& scene, const RenderPlan& plan);
bool has_own_rays(const Task& task, const Frame& frame, int g);
/// Some frame's picture is by wave optics.
bool by_waves(const Frames& frames);

/// What is known of the misfit before a fit: of a single frame through the prior of a calibration, its mean has the
/// misfit that the calibration's frames had.
std::vector<Misfit> misfit_of_prior(const Task& task, const Theta& theta);

/// Standard deviation of a lamp's brightness from frame to frame, as a share: what is expected of a lamp before its
/// frames have shown it.
inline constexpr double kLampJitter = 0.003;
/// The same where several frames are compared, with a lamp's jitter: before it is measured no minimum may be chosen by
/// it.
std::vector<Misfit> misfit_expected(const Task& task, const Frames& frames, const Theta& theta);

/// The problem of all frames' pixels.
std::unique_ptr<LeastSquares> problem_of(const Task& task, const Frames& frames, const std::vector<Misfit>& misfit);

/// The values that the model has for a frame's whole image.
Image fitted_image(const Task& task, const Frames& frames, int frame, const Theta& theta);

/// Frames planned anew where `theta` is.
Frames replanned(const Task& task, Frames frames, const Theta& theta);

}  // namespace birefit::estimation
