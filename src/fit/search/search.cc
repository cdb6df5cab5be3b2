#include "fit/search/search.h"

#include <algorithm>
#include <cmath>

#include "fit/search/centre.h"

namespace birefit::estimation {
namespace {

/// The start with the centre where the images show it, within its bounds; nothing where no centre is searched or the
/// start is there already.
std::optional<Eigen::VectorXd> start_at_symmetry(const Task& task, const Start& start) {
  Eigen::VectorXd centred = start.searched;
  std::array<int, 2> at{-1, -1};
  for (int g = 0; g < task.frames(); ++g) {
    const View& view = task.micrograph(g).scene.view;
    const auto unknown = [&](ParameterRef ref) {
      const std::vector<int>& searched = task.unknowns.searched;
      const auto found = ref ? std::find(searched.begin(), searched.end(), ref.index) : searched.end();
      return found == searched.end() ? -1 : static_cast<int>(found - searched.begin());
    };
    const std::array<int, 2> here{unknown(view.center_x_px), unknown(view.center_y_px)};
    if (here[0] < 0 || here[1] < 0 || here == at) continue;  // frames that share a centre: the first one's
    const Image& values = task.micrograph(g).values;
    Mask used(values.width(), values.height());
    for (const auto& [x, y] : start.frames[static_cast<std::size_t>(g)].pixels) used(x, y) = 1;
    const std::optional<std::array<double, 2>> centre = centre_of_symmetry(values, used);
    if (!centre) return std::nullopt;
    at = here;
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const Parameter& parameter = task.searched(static_cast<std::size_t>(here[axis]));
      if (!((*centre)[axis] > parameter.lower && (*centre)[axis] < parameter.upper)) return std::nullopt;
      centred[here[axis]] = (*centre)[axis];
    }
  }
  if (at[0] < 0) return std::nullopt;
  // What is found is good to a hundredth of an image: a start as near as that is no worse.
  const View& view = task.micrograph(0).scene.view;
  if ((centred - start.searched).cwiseAbs().maxCoeff() < 0.01 * std::max(view.width, view.height)) return std::nullopt;
  return centred;
}

/// How many pixels of a frame the search looks at: where every pixel is rays of its own, no more than it takes.
std::size_t scanned_pixels(const Task& task, const Frames& frames, int g) {
  const std::size_t share =
      static_cast<std::size_t>(std::max(50, task.job.options.scan_pixels / std::max(1, task.frames())));
  const Frame& frame = frames[static_cast<std::size_t>(g)];
  const bool own_rays =
      std::holds_alternative<Droplet>(task.micrograph(g).scene.sample) && frame.plan.radial_panels == 0;
  if (!own_rays) return share;
  // kEnough: units of chi-square by which a constant image is then off; a wrong order is by a good part of that.
  // kFewest: pixels that lie where the image is not flat, however much of it is background.
  constexpr double kEnough = 20000, kFewest = 100;
  const Image& values = task.micrograph(g).values;
  double mean = 0, square = 0, fourth = 0;
  const double n = static_cast<double>(frame.pixels.size());
  for (const auto& [x, y] : frame.pixels) mean += values(x, y) / n;
  for (const auto& [x, y] : frame.pixels) {
    const double z = (values(x, y) - mean) / frame.sigma(x, y), z2 = z * z;
    square += z2 / n, fourth += z2 * z2 / n;
  }
  if (!(fourth > 0)) return share;
  const double showing = square * square / fourth;  // their share: 1 where all are as far off as each other
  const double needed = std::max(kFewest / showing, kEnough / std::max(square - 1, 1e-9));
  return needed < static_cast<double>(share) ? static_cast<std::size_t>(needed) : share;
}

/// The problem of the pixels that the grid looks at.
std::unique_ptr<LeastSquares> sampled(const Task& task, const Frames& frames, const Theta& theta) {
  Frames part = frames;
  for (int g = 0; g < task.frames(); ++g) {
    Pixels& pixels = part[static_cast<std::size_t>(g)].pixels;
    pixels = subsample(pixels, scanned_pixels(task, frames, g));
  }
  return problem_of(task, part, misfit_of_prior(task, theta));
}

}  // namespace

Minima search(const Task& task, const Start& start, double hopeless_above) {
  if (by_waves(start.frames)) return search_near_rays(task, start);
  const FitJob& job = task.job;
  Minima minima;
  minima.frames = start.frames;
  minima.theta = start.theta;
  Eigen::VectorXd from = start.searched;
  const std::vector<FringePhase> fringes = fringe_phases(job, task.unknowns, minima.theta);
  std::unique_ptr<LeastSquares> sample = sampled(task, minima.frames, minima.theta);
  // The picture's own middle, where fringes fit better around it: the grid takes the centre as known.
  if (const std::optional<Eigen::VectorXd> centred = start_at_symmetry(task, start)) {
    const double by_given = lowest_of_few(*sample, job, task.unknowns, from, fringes);
    const Theta theta = task.with(minima.theta, *centred);
    Frames frames = replanned(task, minima.frames, theta);
    std::unique_ptr<LeastSquares> around_centre = sampled(task, frames, minima.theta);
    minima.evaluations += sample->evaluations();
    if (lowest_of_few(*around_centre, job, task.unknowns, *centred, fringes) < by_given) {
      from = *centred, minima.theta = theta, minima.frames = std::move(frames);
      sample = std::move(around_centre);
    } else {
      minima.evaluations += around_centre->evaluations();
    }
  }
  minima.rows = static_cast<double>(sample->pixel_rows());
  minima.scan = scan(*sample, job, task.unknowns, from, fringes, hopeless_above * std::max(1.0, minima.rows));
  minima.evaluations += sample->evaluations();
  minima.stopped = minima.scan.interrupted;
  return minima;
}

}  // namespace birefit::estimation
