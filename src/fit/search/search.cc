#include "fit/search/search.h"

#include <algorithm>
#include <cmath>

#include "fit/problem/constant.h"
#include "fit/search/centre.h"
#include "samples/kind.h"

namespace birefit::estimation {
namespace {

/// The start with the centre where the images show it, within its bounds; nothing where no centre is searched or the
/// start is there already.
std::optional<Eigen::VectorXd> start_at_symmetry(const Task& task, const Start& start) {
  Eigen::VectorXd centred = start.searched;
  std::array<int, 2> at{-1, -1};
  for (int g = 0; g < task.frames(); ++g) {
    const View& view = task.picture(g).scene.view;
    const auto unknown = [&](ParameterRef ref) {
      const std::vector<int>& searched = task.unknowns.searched;
      const auto found = ref ? std::find(searched.begin(), searched.end(), ref.index) : searched.end();
      return found == searched.end() ? -1 : static_cast<int>(found - searched.begin());
    };
    const std::array<int, 2> here{unknown(view.center_x_px), unknown(view.center_y_px)};
    if (here[0] < 0 || here[1] < 0 || here == at) continue;  // frames that share a centre: the first one's
    const Image& values = task.picture(g).values;
    Mask used(values.width(), values.height());
    for (const auto& [x, y] : start.frames[static_cast<std::size_t>(g)].pixels) used(x, y) = 1;
    const std::optional<std::array<double, 2>> centre = centre_of_symmetry(values, used);
    if (!centre) return std::nullopt;
    at = here;
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const Parameter& parameter = task.searched(static_cast<std::size_t>(here[axis]));
      const double place = (axis == 0 ? view.center_x_px : view.center_y_px).stated((*centre)[axis]);
      if (!(place > parameter.lower && place < parameter.upper)) return std::nullopt;
      centred[here[axis]] = place;
    }
  }
  if (at[0] < 0) return std::nullopt;
  // What is found is good to a hundredth of an image: a start as near as that is no worse.
  const View& view = task.picture(0).scene.view;
  const double image = view.file.bin * std::max(view.width, view.height);
  if ((centred - start.searched).cwiseAbs().maxCoeff() < 0.01 * image) return std::nullopt;
  return centred;
}

/// How closely the search looks, all pictures together: at the places of its grid, and where it goes on from the best
/// of them. They differ where every pixel is rays of its own.
struct Closeness {
  double enough = 0;  ///< units of chi-square by which a constant image is off; a wrong order is by a good part of that
  double fewest = 0;  ///< pixels that lie where the image is not flat, however much of it is background
  double accuracy = 0;       ///< of the pictures
  bool edges_alike = false;  ///< the means over pixels at edges and defects are made as roughly as those of others
};
// Of hundreds of pixels, each with noise of its own, a third of a percent tells valleys; a percent, where they may be.
constexpr Closeness kOfAGlance{5000, 25, 1e-2, true}, kOfMinima{20000, 100, 3e-3, false};

/// How many pixels of a frame the search looks at: where every pixel is rays of its own, no more than it takes.
std::size_t scanned_pixels(const Task& task, const Frames& frames, int g, const Closeness& close) {
  const std::size_t share =
      static_cast<std::size_t>(std::max(50, task.job.options.scan_pixels / std::max(1, task.frames())));
  const Frame& frame = frames[static_cast<std::size_t>(g)];
  if (!has_own_rays(task, frame, g)) return share;
  const Image& values = task.picture(g).values;
  double mean = 0, square = 0, fourth = 0;
  const double n = static_cast<double>(frame.pixels.size());
  for (const auto& [x, y] : frame.pixels) mean += values(x, y) / n;
  for (const auto& [x, y] : frame.pixels) {
    const double z = (values(x, y) - mean) / frame.sigma(x, y), z2 = z * z;
    square += z2 / n, fourth += z2 * z2 / n;
  }
  if (!(fourth > 0)) return share;
  const double showing = square * square / fourth;  // their share: 1 where all are as far off as each other
  constexpr double kFewestOfOne = 10;               // as far as centres and edges are a picture's own
  const double pictures = std::max(1, task.frames()),
               needed = std::max(std::max(close.fewest / pictures, kFewestOfOne) / showing,
                                 close.enough / pictures / std::max(square - 1, 1e-9));
  return needed < static_cast<double>(share) ? static_cast<std::size_t>(needed) : share;
}

/// Where a picture is one number the mean of its pixels tells all of it, and has a row instead of hundreds.
bool is_one_number(const Picture& micrograph) { return traits_of(micrograph.scene).even && micrograph.uneven.empty(); }
PixelSet mean_of(const Picture& micrograph, const Frame& frame) {
  double weights = 0, sum = 0;
  for (const auto& [x, y] : frame.pixels) {
    const double weight = 1 / (frame.sigma(x, y) * frame.sigma(x, y));
    weights += weight, sum += weight * micrograph.values(x, y);
  }
  return {{frame.pixels.front()},
          Eigen::VectorXd::Constant(1, sum / weights),
          Eigen::VectorXd::Constant(1, 1 / std::sqrt(weights))};
}

/// Rough enough to be quick, and finer than what the mean of a frame is known to: what the plan is off by would be
/// another minimum's advantage.
RenderPlan rough_plan(const Task& task, int g, const Theta& theta) {
  constexpr double kRough = 1e-4;
  return task.planned(g, theta, kRough);
}
/// Of pixels that are rays of their own.
RenderPlan rougher_plan(const Task& task, int g, const Theta& theta, const Closeness& close) {
  RenderPlan rough = task.planned(g, theta, close.accuracy);
  if (close.edges_alike) {
    std::fill(rough.means.samples.begin(), rough.means.samples.end(), 1);
    rough.means.edge_points = rough.means.defect_points = 2;
  }
  return rough;
}

/// The problem of what is looked at so closely.
std::unique_ptr<LeastSquares> sampled(const Task& task, const Frames& frames, const Theta& theta,
                                      const Closeness& close) {
  std::vector<PixelSet> sets;
  std::vector<RenderPlan> plans;
  for (int g = 0; g < task.frames(); ++g) {
    const Picture& micrograph = task.picture(g);
    const Frame& frame = frames[static_cast<std::size_t>(g)];
    sets.push_back(
        is_one_number(micrograph)
            ? mean_of(micrograph, frame)
            : pixel_set(micrograph, frame.sigma, subsample(frame.pixels, scanned_pixels(task, frames, g, close))));
    plans.push_back(is_one_number(micrograph)      ? rough_plan(task, g, theta)
                    : has_own_rays(task, frame, g) ? rougher_plan(task, g, theta, close)
                    : frame.plan.wavelengths       ? task.planned(g, theta, close.accuracy)  // a third fewer of them
                                                   : frame.plan);
  }
  auto problem = std::make_unique<LeastSquares>(task, std::move(plans), std::move(sets));
  problem->set_misfit(misfit_expected(task, frames, theta));
  return problem;
}

/// What the search looks at.
class Looks {
 public:
  Looks(const Task& task, const Frames& frames, const Theta& theta)
      : closely_(sampled(task, frames, theta, kOfMinima)),
        glance_(any_has_own_rays(task, frames) ? sampled(task, frames, theta, kOfAGlance) : nullptr) {}
  LeastSquares& closely() { return *closely_; }
  LeastSquares& at_a_glance() { return glance_ ? *glance_ : *closely_; }
  int evaluations() const { return closely_->evaluations() + (glance_ ? glance_->evaluations() : 0); }

 private:
  static bool any_has_own_rays(const Task& task, const Frames& frames) {
    for (int g = 0; g < task.frames(); ++g)
      if (has_own_rays(task, frames[static_cast<std::size_t>(g)], g)) return true;
    return false;
  }
  std::unique_ptr<LeastSquares> closely_, glance_;
};

bool all_are_one_number(const Task& task) {
  return std::all_of(task.sights.begin(), task.sights.end(), [](const Sight& s) { return is_one_number(*s.picture); });
}

/// With every searched unknown at that end of what it may be, where it has one.
Theta at_bounds(const Task& task, Theta theta, bool upper) {
  for (std::size_t j = 0; j < task.unknowns.searched.size(); ++j) {
    const Parameter& parameter = task.searched(j);
    if (const double bound = upper ? parameter.upper : parameter.lower; std::isfinite(bound))
      theta[static_cast<std::size_t>(task.unknowns.searched[j])] = bound;
  }
  return theta;
}

/// Whether the best place describes so little that a fit of all pixels will not either. A signal that the pixels looked
/// at do not show has no minimum that the search could tell from others.
bool is_hopeless(const Task& task, LeastSquares& sample, const ScanResult& scan) {
  const Candidate& best = scan.candidates.front();
  sample.evaluate(best.searched, false);
  const std::optional<double> constant = chi_square_of_a_constant(task, sample);
  const double rows = static_cast<double>(sample.pixel_rows()), fewest = 10.0 * task.unknowns.size();
  if (!constant || rows < fewest || scan.interrupted) return false;
  constexpr double kMisfit = 2,
                   kMostLeft = 0.6;  // a little more than what makes a verdict: the best place is not quite the minimum
  const double reduced = std::max(1.0, best.objective / rows);
  const double by_chance = 2 * task.unknowns.size() + 2 * std::log(std::max(1, scan.points));
  const bool not_described = reduced > kMisfit && best.objective - rows > kMostLeft * (*constant - rows);
  return not_described || *constant - best.objective < by_chance * reduced;
}

/// Whether the plans of both make the same pictures, at the best place and at some spread over all that is looked at:
/// a second search by the other would find what the first has.
bool look_the_same(LeastSquares& one, LeastSquares& other, const std::vector<PicturePhase>& phases,
                   const Eigen::VectorXd& best) {
  constexpr int kPlaces = 24;
  constexpr double kShare = 0.01;
  for (int i = -1; i < kPlaces; ++i) {
    Eigen::VectorXd x = best;
    const std::vector<double> share = spread_in_box(std::max(i, 0), phases.size());
    for (std::size_t j = 0; i >= 0 && j < phases.size(); ++j)
      if (phases[j].total() > 0) x[static_cast<Eigen::Index>(j)] = phases[j].value_at(share[j] * phases[j].total());
    one.evaluate(x, false);
    other.evaluate(x, false);
    if (!(std::abs(one.objective() - other.objective()) < kShare * one.objective())) return false;
  }
  return true;
}

}  // namespace

Minima search(const Task& task, const Start& start, double hopeless_above) {
  if (by_waves(start.frames)) return search_near_rays(task, start);
  Minima minima;
  minima.frames = start.frames;
  minima.theta = start.theta;
  Eigen::VectorXd from = start.searched;
  auto looks = std::make_unique<Looks>(task, minima.frames, minima.theta);
  const std::vector<PicturePhase> phases = picture_phases(looks->at_a_glance(), task, minima.theta);
  // The picture's own middle, where fringes fit better around it: the grid takes the centre as known.
  if (const std::optional<Eigen::VectorXd> centred = start_at_symmetry(task, start)) {
    const double by_given = lowest_of_few(looks->at_a_glance(), task, from, phases);
    const Theta theta = task.with(minima.theta, *centred);
    Frames frames = replanned(task, minima.frames, theta);
    auto around_centre = std::make_unique<Looks>(task, frames, minima.theta);
    minima.evaluations += looks->evaluations();
    if (lowest_of_few(around_centre->at_a_glance(), task, *centred, phases) < by_given) {
      from = *centred, minima.theta = theta, minima.frames = std::move(frames);
      looks = std::move(around_centre);
    } else {
      minima.evaluations += around_centre->evaluations();
    }
  }
  minima.rows = static_cast<double>(looks->closely().pixel_rows());
  const double hopeless = hopeless_above * std::max(1.0, minima.rows);
  minima.scan = scan(looks->at_a_glance(), looks->closely(), task, from, phases, hopeless);
  minima.evaluations += looks->evaluations();
  // Plans are made for where the search begins. Pictures that are one number each turn on the third decimal of it: what
  // is described badly by plans for the start (a field below its threshold needs few steps) is looked for once more by
  // those for either end of what may be.
  constexpr double kDoubtful = 5;
  const auto lowest = [&] { return minima.scan.candidates.front().objective; };
  for (const bool upper : {true, false}) {
    if (!all_are_one_number(task) || minima.scan.interrupted ||
        !(lowest() > minima.rows + kDoubtful * std::sqrt(2 * minima.rows)))
      break;
    const Theta end = at_bounds(task, minima.theta, upper);
    auto other = std::make_unique<Looks>(task, minima.frames, end);
    if (look_the_same(looks->at_a_glance(), other->at_a_glance(), phases, minima.scan.candidates.front().searched))
      continue;
    ScanResult scanned = scan(other->at_a_glance(), other->closely(), task, from, phases, hopeless);
    minima.evaluations += other->evaluations();
    if (scanned.interrupted || !(scanned.candidates.front().objective < lowest())) continue;
    minima.scan = std::move(scanned);
    minima.theta = task.with(minima.theta, minima.scan.candidates.front().searched);
    minima.frames = replanned(task, minima.frames, minima.theta);
    looks = std::move(other);
  }
  minima.hopeless = is_hopeless(task, looks->closely(), minima.scan);
  minima.stopped = minima.scan.interrupted;
  return minima;
}

}  // namespace birefit::estimation
