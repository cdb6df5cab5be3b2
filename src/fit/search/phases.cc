#include "fit/search/phases.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "birefit/error.h"

namespace birefit::estimation {
namespace {

/// Where the line through (x, y), both ascending, has `y`; beyond its ends, there.
double inverse_of(const std::vector<double>& x, const std::vector<double>& y, double wanted) {
  const std::size_t above = static_cast<std::size_t>(std::lower_bound(y.begin(), y.end(), wanted) - y.begin());
  if (above == 0) return x.front();
  if (above == y.size()) return x.back();
  return x[above - 1] + (x[above] - x[above - 1]) * (wanted - y[above - 1]) / (y[above] - y[above - 1]);
}

/// 0 where the bounds leave what the model can do (no equilibrium, beyond a clearing point): there is no image to look
/// at either.
double rate_at(const Task& task, int frame, const Theta& theta, int index) {
  try {
    const double rate =
        fringe_phase_per_unit(task.picture(frame).scene, task.job.demand, task.job.parameters, theta, index);
    return std::isfinite(rate) ? rate : 0;
  } catch (const UserError&) {
    return 0;
  }
}

bool is_centre(const Task& task, int index) {
  return std::any_of(task.sights.begin(), task.sights.end(), [&](const Sight& sight) {
    const View& view = sight.picture->scene.view;
    return view.center_x_px.index == index || view.center_y_px.index == index;
  });
}

/// By the retardance; empty for what forms no fringes.
PicturePhase fringe_phase(const Task& task, const Theta& theta, int index) {
  // A rate may be largest anywhere between the bounds (a voltage just above its threshold).
  constexpr int kIntervals = 16;
  // Of hundreds of rows of a table a few dozen show it.
  const int frames = task.frames(), stride = (frames + 31) / 32;
  const Parameter& parameter = task.job.parameters[index];
  const double width = parameter.upper - parameter.lower;
  std::array<Theta, 3> others{theta, theta, theta};
  for (const int other : task.unknowns.searched) {
    const Parameter& bounds = task.job.parameters[other];
    if (!std::isfinite(bounds.upper - bounds.lower)) continue;
    others[1][static_cast<std::size_t>(other)] = bounds.lower;
    others[2][static_cast<std::size_t>(other)] = bounds.upper;
  }
  std::vector<double> rates;
  PicturePhase phase;
  for (int i = 0; i <= kIntervals; ++i) {
    phase.value.push_back(parameter.lower + width * i / kIntervals);
    double fastest = 0;
    for (Theta& probe : others) {
      probe[static_cast<std::size_t>(index)] = phase.value.back();
      task.job.parameters.follow(probe);
      for (int g = 0; g < frames; g += stride)
        if (task.observable(g).quantity == Quantity::intensity)  // nothing else has fringes
          fastest = std::max(fastest, rate_at(task, g, probe, index));
    }
    rates.push_back(fastest);
  }
  phase.radians.push_back(0);
  for (std::size_t i = 1; i < rates.size(); ++i)
    phase.radians.push_back(phase.radians.back() + std::max(rates[i - 1], rates[i]) * width / kIntervals);
  phase.of_fringes = true;
  return phase.total() > 0 ? phase : PicturePhase{};
}

/// Along the j-th searched unknown through `from`, by pictures at so many intervals; empty where they do not change.
/// Where the model cannot make one (bounds may leave what it can do) nothing turns.
PicturePhase measured_along(LeastSquares& problem, const Task& task, Eigen::VectorXd from, std::size_t j,
                            int intervals) {
  const Parameter& parameter = task.searched(j);
  PicturePhase phase;
  std::vector<Eigen::VectorXd> pictures;
  std::vector<int> made(static_cast<std::size_t>(intervals) + 1, -1);
  for (int i = 0; i <= intervals; ++i) {
    phase.value.push_back(parameter.lower + (parameter.upper - parameter.lower) * i / intervals);
    from[static_cast<Eigen::Index>(j)] = phase.value.back();
    try {
      problem.evaluate(from, false);
    } catch (const UserError&) {
      continue;
    }
    if (!problem.intensity().allFinite()) continue;
    made[static_cast<std::size_t>(i)] = static_cast<int>(pictures.size());
    pictures.push_back(problem.intensity());
  }
  if (pictures.size() < 3) return {};
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(problem.pixel_rows());
  for (const Eigen::VectorXd& picture : pictures) mean += picture / static_cast<double>(pictures.size());
  double squares = 0;
  for (const Eigen::VectorXd& picture : pictures)
    squares += (picture - mean).squaredNorm() / static_cast<double>(pictures.size());
  constexpr double kNothing = 1e-7;  // of the intensity, a pixel: rounding
  if (!(squares > kNothing * kNothing * static_cast<double>(problem.pixel_rows()))) return {};
  phase.radians.push_back(0);
  for (std::size_t i = 1; i < made.size(); ++i) {
    const bool both = made[i] >= 0 && made[i - 1] >= 0;
    const double turned =
        both ? (pictures[static_cast<std::size_t>(made[i])] - pictures[static_cast<std::size_t>(made[i - 1])]).norm() /
                   std::sqrt(squares)
             : 0;
    phase.radians.push_back(phase.radians.back() + turned);
  }
  return phase;
}

/// By the pictures themselves, the fastest of a few places of the other unknowns.
PicturePhase measured_phase(LeastSquares& problem, const Task& task, const Theta& theta, std::size_t j) {
  // Where neighbours differ by as much as any two, they are too far apart to say how often the picture has turned
  // between them.
  constexpr int kIntervals = 24, kMostIntervals = 96, kPlaces = 4;
  constexpr double kTooFar = 0.8;
  Eigen::VectorXd start(static_cast<Eigen::Index>(task.unknowns.searched.size()));
  for (std::size_t k = 0; k < task.unknowns.searched.size(); ++k)
    start[static_cast<Eigen::Index>(k)] = theta[static_cast<std::size_t>(task.unknowns.searched[k])];
  PicturePhase fastest;
  for (int place = 0; place < kPlaces; ++place) {
    Eigen::VectorXd from = start;
    const std::vector<double> share = spread_in_box(place, task.unknowns.searched.size());
    for (std::size_t k = 0; place > 0 && k < share.size(); ++k) {
      const Parameter& other = task.searched(k);
      if (std::isfinite(other.upper - other.lower) && !is_centre(task, task.unknowns.searched[k]))
        from[static_cast<Eigen::Index>(k)] = other.lower + (other.upper - other.lower) * share[k];
    }
    PicturePhase phase;
    for (int intervals = kIntervals; intervals <= kMostIntervals; intervals *= 2) {
      phase = measured_along(problem, task, from, j, intervals);
      if (phase.total() < kTooFar * intervals) break;
    }
    if (phase.total() > fastest.total()) fastest = std::move(phase);
  }
  return fastest;
}

}  // namespace

double PicturePhase::at(double v) const { return inverse_of(radians, value, v); }
double PicturePhase::value_at(double wanted) const { return inverse_of(value, radians, wanted); }

std::vector<PicturePhase> picture_phases(LeastSquares& problem, const Task& task, const Theta& theta) {
  std::vector<PicturePhase> phases;
  for (std::size_t j = 0; j < task.unknowns.searched.size(); ++j) {
    const Parameter& parameter = task.searched(j);
    PicturePhase phase;
    if (const double width = parameter.upper - parameter.lower; std::isfinite(width) && width > 0) {
      phase = fringe_phase(task, theta, task.unknowns.searched[j]);
      if (phase.value.empty() && !is_centre(task, task.unknowns.searched[j]))
        phase = measured_phase(problem, task, theta, j);
    }
    phases.push_back(std::move(phase));
  }
  return phases;
}

std::vector<double> spread_in_box(int index, std::size_t axes) {
  constexpr std::array<int, 16> kPrimes{2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53};
  std::vector<double> place(axes);
  for (std::size_t k = 0; k < axes; ++k) {
    const int base = kPrimes[k % kPrimes.size()];
    double digit = 1.0 / base;
    for (int i = index + 1; i > 0; i /= base, digit /= base) place[k] += digit * (i % base);
  }
  return place;
}

}  // namespace birefit::estimation
