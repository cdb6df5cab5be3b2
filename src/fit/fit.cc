#include "birefit/fit.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <set>

#include <fmt/format.h>

#include "fit/centre.h"
#include "fit/least_squares.h"
#include "fit/light.h"
#include "fit/noise.h"
#include "fit/outliers.h"
#include "fit/profile.h"
#include "fit/scan.h"
#include "fit/statistics.h"
#include "fit/verdict.h"
#include "medium/references.h"
#include "render/wave.h"

namespace birefit {
namespace {

using namespace estimation;

/// Standard errors by which rays may shift a parameter before waves are worth their time, or a warning.
constexpr double kShiftThatMatters = 0.3;

/// Part of an image that dust and scratches may cover at most.
constexpr double kMostOutliers = 0.1;

/// Pixels the mask leaves and whose value and weight are numbers.
std::vector<std::array<int, 2>> usable_pixels(const Micrograph& micrograph, const Image& sigma) {
  std::vector<std::array<int, 2>> pixels;
  for (int y = 0; y < micrograph.values.height(); ++y)
    for (int x = 0; x < micrograph.values.width(); ++x)
      if (micrograph.mask(x, y) && std::isfinite(micrograph.values(x, y)) && std::isfinite(sigma(x, y)) &&
          sigma(x, y) > 0)
        pixels.push_back({x, y});
  return pixels;
}

PixelSet pixel_set(const Micrograph& micrograph, const Image& sigma, std::vector<std::array<int, 2>> pixels) {
  PixelSet set;
  set.pixels = std::move(pixels);
  const auto n = static_cast<Eigen::Index>(set.pixels.size());
  set.value.resize(n);
  set.sigma.resize(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    set.value[i] = micrograph.values(set.pixels[i][0], set.pixels[i][1]);
    set.sigma[i] = sigma(set.pixels[i][0], set.pixels[i][1]);
  }
  return set;
}

/// A fixed part of the pixels that meets every region: multiples of the golden section leave no gap longer than
/// 2.6 times the mean (Knuth, TAOCP 6.4) and, unlike a stride, cannot lock to a row length.
std::vector<std::array<int, 2>> subsample(const std::vector<std::array<int, 2>>& pixels, std::size_t wanted) {
  if (pixels.size() <= wanted) return pixels;
  constexpr double kGolden = 0.6180339887498949;
  std::vector<std::size_t> chosen(wanted);
  for (std::size_t i = 0; i < wanted; ++i) {
    const double turn = kGolden * static_cast<double>(i + 1);
    chosen[i] = std::min(pixels.size() - 1,
                         static_cast<std::size_t>((turn - std::floor(turn)) * static_cast<double>(pixels.size())));
  }
  std::sort(chosen.begin(), chosen.end());
  chosen.erase(std::unique(chosen.begin(), chosen.end()), chosen.end());
  std::vector<std::array<int, 2>> part;
  for (const std::size_t i : chosen) part.push_back(pixels[i]);
  return part;
}

/// A plan that resolves more than the one the solver worked with, or resolves it elsewhere.
bool asks_for_more(const RenderPlan& now, const RenderPlan& before) {
  if (now.method != before.method || (now.disc.empty() && now.steps > before.steps) || now.mesh.size() > before.mesh.size() ||
      now.radial_panels > before.radial_panels || now.centre_panels > before.centre_panels ||
      !std::equal(now.part_panels.begin(), now.part_panels.end(), before.part_panels.begin(), before.part_panels.end(), std::less_equal<>()) ||
      (before.fringe_means && !now.fringe_means))
    return true;
  if (outgrown(now, before)) return true;
  const double moved = std::hypot(now.sampling_center_x_px - before.sampling_center_x_px,
                                  now.sampling_center_y_px - before.sampling_center_y_px);
  if (now.samples != before.samples && moved > before.sampling_bin_px) return true;
  for (std::size_t i = 0; i < now.samples.size(); ++i)
    if (now.samples[i] > (i < before.samples.size() ? before.samples[i] : 1)) return true;
  return false;
}

/// Rows of a signal table are micrographs of one pixel named file:line.
std::string table_of(const std::string& name) { return name.substr(0, name.rfind(':')); }

/// One fit from start to report. The stages are in run()'s order; each leaves the state better than before, so that an
/// interruption anywhere has something to report.
class Fit {
 public:
  explicit Fit(const FitJob& job)
      : job_(job), unknowns_(Unknowns::of(job)), frames_(static_cast<int>(job.micrographs.size())) {}

  /// The global part. Returns the best objective per pixel of the subsample; above `hopeless_above` the search ends early.
  double search(double hopeless_above) {
    const auto begin = std::chrono::steady_clock::now();
    prepare();
    const double best = look_for_minima(hopeless_above);
    result_.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    return best;
  }

  /// Largest change of a parameter that curved rays would make, in standard errors; 0 where there are none to compare with, or
  /// where they describe the image clearly worse.
  double change_by_curved_rays() const { return by_curved_rays_; }

  /// The same for wave optics: what fitting rays to a wave image of these parameters would return; NaN where none was made.
  double change_by_waves() const { return by_waves_; }

  /// The rest. What another branch has beaten is reported where the search left it.
  FitResult finish(bool beaten) {
    const auto begin = std::chrono::steady_clock::now();
    beaten_ = beaten;
    stopped_ = stopped_ || beaten;
    find_minima();
    settle_weights();
    settle_plans();
    settle_outliers();
    settle_misfit();
    weigh_rivals();
    report();
    result_.seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    return std::move(result_);
  }

 private:
  bool interrupted() const { return job_.options.interrupted && job_.options.interrupted->load(); }
  void say(const std::string& line) const {
    if (job_.options.progress) job_.options.progress(line);
  }

  void prepare();
  double look_for_minima(double hopeless_above);
  /// How many pixels of a frame the search looks at: where every pixel is rays of its own, no more than it takes.
  std::size_t scanned_pixels(int g) const;
  std::optional<Eigen::VectorXd> start_at_symmetry() const;
  void look_near_rays();
  void find_minima();
  void settle_weights();
  void settle_plans();
  void settle_outliers();
  void settle_misfit();
  double ripple_period_of(std::size_t j) const;
  bool ripples() const;
  double score(const Candidate&) const;
  double rank(const Candidate&) const;
  void weigh_rivals();
  void report();

  void rebuild_problem();
  SolveSummary solve(Eigen::VectorXd& searched, const std::string& label, int max_iterations = 0);
  void solve_main(const std::string& label);
  double gain_of(int g) const {
    const ParameterRef ref = job_.micrographs[g].gain;
    return ref ? theta_[ref.index] : 1.0;
  }
  std::vector<Misfit> assess_misfit();
  std::vector<Misfit> prior_misfit() const;
  double row_correlation(const std::vector<LeastSquares::FrameMisfit>& frames) const;
  Image fitted_image(int g) const;
  Outliers outliers_of(int g) const;
  std::optional<double> chi_square_of_a_constant() const;
  bool judge_description(double chi_square);
  void report_parameters(const Inverse& inverse, const Inverse& of_noise);
  std::optional<double> upper_limit(int unknown, const Inverse& inverse);
  void settle_interval(ParameterEstimate& estimate, int unknown, const Inverse& of_noise);
  void weigh_inputs(const Inverse& of_noise);
  void report_micrographs();
  void collect_warnings();
  struct Shift {
    int index = 0;  ///< in the table
    double change = 0, standard_errors = 0;
  };
  Shift largest_shift(const Eigen::VectorXd& shift, const Eigen::VectorXd& sd) const;
  Eigen::VectorXd change_of_unknowns(const Theta& from, const Theta& to) const;
  std::optional<Eigen::VectorXd> foretell_curved_rays(const Eigen::VectorXd& sd);
  std::optional<Eigen::VectorXd> foretell_waves(const Eigen::VectorXd& sd);
  Eigen::MatrixXd propagation_errors();
  double pay_for_misfit(const Inverse& of_noise, Inverse& inverse) const;
  std::string covariance_words() const;

  const FitJob& job_;
  Unknowns unknowns_;
  int frames_;
  FitResult result_;

  std::vector<RenderPlan> plans_;
  std::vector<NoiseModel> noise_;
  std::vector<Image> sigma_;
  std::vector<std::vector<std::array<int, 2>>> pixels_;
  std::unique_ptr<LeastSquares> problem_;
  Eigen::VectorXd start_, best_;
  std::vector<Eigen::VectorXd> rivals_;
  Theta theta_;
  int scan_points_ = 0, evaluations_ = 0;
  ScanResult found_;
  double sample_rows_ = 0;  ///< pixels that the scan looked at
  bool beaten_ = false;
  double by_curved_rays_ = 0;
  double by_waves_ = std::numeric_limits<double>::quiet_NaN();
  bool stopped_ = false;

  // What settle_misfit() found.
  double frame_sd_ = 0;          ///< of the model intensity, common to a frame
  double frame_dof_ = 0;         ///< degrees of freedom behind it
  bool frames_scatter_ = false;  ///< measured between this fit's own frames
  double largest_area_ = 1;      ///< pixels that share one misfit
  bool misfit_ = false;          ///< more than noise in some micrograph
  double row_length_ = 1;        ///< neighbouring rows of a table that share one misfit
  bool rows_ = false;            ///< micrographs of one pixel each: rows of a table
  std::vector<Outliers> left_out_;  ///< of each micrograph
};

void Fit::prepare() {
  if (job_.micrographs.empty()) throw UserError(Where{}, "there is no image to fit");
  result_.warnings = job_.warnings;
  theta_ = job_.parameters.values();
  // What an earlier fit knows is a better start than the config's.
  if (job_.prior)
    for (std::size_t i = 0; i < job_.prior->names.size(); ++i)
      if (const ParameterRef ref = job_.parameters.find(job_.prior->names[i]); ref && job_.parameters[ref].free)
        theta_[ref.index] = std::clamp(job_.prior->mean[static_cast<Eigen::Index>(i)], job_.parameters[ref].lower,
                                       job_.parameters[ref].upper);
  start_.resize(static_cast<Eigen::Index>(unknowns_.searched.size()));
  for (std::size_t j = 0; j < unknowns_.searched.size(); ++j)
    start_[static_cast<Eigen::Index>(j)] = theta_[unknowns_.searched[j]];
  best_ = start_;
  std::size_t used = 0;
  for (const Micrograph& micrograph : job_.micrographs) {
    plans_.push_back(plan(micrograph.scene, theta_));
    noise_.push_back(micrograph.noise ? *micrograph.noise : estimate_noise(micrograph));
    sigma_.push_back(standard_deviation(micrograph, noise_.back(), smoothed(micrograph)));
    pixels_.push_back(usable_pixels(micrograph, sigma_.back()));
    if (pixels_.back().empty())
      throw UserError(Where{}, micrograph.name + " has no usable pixel", "check mask, roi_px and saturation_counts");
    used += pixels_.back().size();
  }
  rows_ = used == pixels_.size();
  if (used <= static_cast<std::size_t>(unknowns_.size()))
    throw UserError(Where{}, fmt::format("{} usable pixels cannot determine {} parameters", used, unknowns_.size()),
                    "check mask and roi_px");
}

void Fit::rebuild_problem() {
  std::vector<PixelSet> sets;
  for (int g = 0; g < frames_; ++g) sets.push_back(pixel_set(job_.micrographs[g], sigma_[g], pixels_[g]));
  const std::vector<Misfit> misfit = problem_ ? problem_->misfit() : prior_misfit();
  if (problem_) evaluations_ += problem_->evaluations();
  problem_ = std::make_unique<LeastSquares>(job_, unknowns_, plans_, std::move(sets));
  problem_->set_misfit(misfit);
}

SolveSummary Fit::solve(Eigen::VectorXd& searched, const std::string& label, int max_iterations) {
  SolveOptions options;
  options.max_iterations = max_iterations > 0 ? max_iterations : job_.options.max_iterations;
  options.interrupted = job_.options.interrupted;
  options.progress = job_.options.progress;
  options.label = label;
  // Propagation takes a tenth of a second and more an image: to a thousandth of a chi-square unit, not to rounding.
  if (std::any_of(plans_.begin(), plans_.end(), [](const RenderPlan& p) { return p.wave != nullptr; })) options.function_tolerance = 3e-8;
  if (!label.empty()) options.iterations = &result_.iterations;
  const SolveSummary summary = problem_->solve(searched, options);
  stopped_ = stopped_ || summary.interrupted;
  return summary;
}

void Fit::solve_main(const std::string& label) {
  const SolveSummary summary = solve(best_, label);
  result_.converged = summary.converged && !stopped_;
  result_.solver_report = summary.report;
  theta_ = problem_->theta();
}

/// A single frame through the prior of a calibration: its mean has the misfit the calibration's frames had.
std::vector<Misfit> Fit::prior_misfit() const {
  std::vector<Misfit> misfit(frames_);
  if (job_.prior && job_.prior->frame_scatter)
    for (int g = 0; g < frames_; ++g) {
      misfit[g].mean_sd = job_.prior->frame_scatter->intensity_sd * std::abs(gain_of(g));
      misfit[g].mean_follows_shape = false;
    }
  return misfit;
}

/// Wave pictures are too dear for a grid. Rays know the fringe orders to within a few: from their minima, and from the neighbouring
/// orders of every parameter that forms fringes, with the wave model.
void Fit::look_near_rays() {
  FitJob by_rays = job_;
  by_rays.branches.clear();
  for (Micrograph& m : by_rays.micrographs) {
    m.scene.ceiling = Ceiling::one_way, m.scene.method = "auto", m.scene.microscope.focus_um = {};
    // They are off by a quarter of the image: good enough to start from.
    m.scene.intensity_accuracy = std::max(m.scene.intensity_accuracy, 1e-2);
  }
  Fit rays(by_rays);
  rays.search(std::numeric_limits<double>::infinity());
  if (!rays.stopped_) rays.find_minima();
  evaluations_ += rays.evaluations_ + (rays.problem_ ? rays.problem_->evaluations() : 0);
  result_.scans = std::move(rays.found_.traces);
  scan_points_ = rays.scan_points_;
  std::vector<Eigen::VectorXd> minima{rays.best_}, starts;
  minima.insert(minima.end(), rays.rivals_.begin(), rays.rivals_.end());
  starts = minima;
  starts.push_back(start_);
  Eigen::VectorXd rates = Eigen::VectorXd::Zero(start_.size());
  for (std::size_t j = 0; j < unknowns_.searched.size(); ++j) {
    const Parameter& parameter = job_.parameters[unknowns_.searched[j]];
    double rate = 0;
    for (const Micrograph& m : by_rays.micrographs) rate = std::max(rate, std::abs(fringe_phase_per_unit(m.scene, rays.theta_, unknowns_.searched[j])));
    rates[static_cast<Eigen::Index>(j)] = rate;
    if (!(rate * (parameter.upper - parameter.lower) > std::numbers::pi)) continue;
    for (const double orders : {-2.0, -1.0, -0.5, 0.5, 1.0, 2.0}) {
      Eigen::VectorXd x = rays.best_;
      const auto at = static_cast<Eigen::Index>(j);
      x[at] += orders * 2 * std::numbers::pi / rate;
      if (x[at] > parameter.lower && x[at] < parameter.upper) starts.push_back(std::move(x));
    }
  }
  say("neighbouring fringe orders by wave optics");
  const auto is_diameter = [&](int g, std::size_t j) {
    const auto* droplet = std::get_if<Droplet>(&job_.micrographs[g].scene.sample);
    return droplet && droplet->diameter_um.index == unknowns_.searched[j];
  };
  // A grid for the largest droplet among the places to look at: a larger one than it was made for would be cut off.
  const auto problem_for = [&](const std::vector<Eigen::VectorXd>& places) {
    std::vector<PixelSet> sets;
    std::vector<RenderPlan> plans;
    for (int g = 0; g < frames_; ++g) {
      const Scene& scene = job_.micrographs[g].scene;
      Theta theta = theta_;
      for (std::size_t j = 0; j < unknowns_.searched.size(); ++j) {
        double& value = theta[static_cast<std::size_t>(unknowns_.searched[j])];
        value = places.front()[static_cast<Eigen::Index>(j)];
        if (is_diameter(g, j))
          for (const Eigen::VectorXd& x : places) value = std::max(value, x[static_cast<Eigen::Index>(j)]);
      }
      plans.push_back(plan(scene, theta));
      sets.push_back(pixel_set(job_.micrographs[g], sigma_[g], pixels_[g]));
    }
    auto problem = std::make_unique<LeastSquares>(job_, unknowns_, std::move(plans), std::move(sets));
    problem->set_misfit(prior_misfit());
    return problem;
  };
  std::unique_ptr<LeastSquares> all = problem_for(starts);
  // Less than a third of an order apart in everything that forms fringes: the same minimum.
  const auto same = [&](const Eigen::VectorXd& a, const Eigen::VectorXd& b) { return ((a - b).cwiseProduct(rates)).cwiseAbs().maxCoeff() < 2; };
  found_ = polish(*all, job_, std::move(starts), 3, same);
  // Rays may have been wrong by more than that: where no minimum describes the image, along every axis through the best, half an order a step, as long as that helps. A droplet's
  // edge carries all its rings: smaller steps of the diameter, as in the scan.
  constexpr double kDescribed = 2, kHelps = 0.98;
  constexpr int kRounds = 3, kDiameters = 30, kMostSteps = 100;
  for (int round = 0; round < kRounds && !found_.interrupted; ++round) {
    const Candidate best = found_.candidates.front();
    if (best.objective <= kDescribed * static_cast<double>(all->pixel_rows())) break;
    say("no minimum near that of rays describes the image: looking farther");
    std::vector<Eigen::VectorXd> lines;
    for (std::size_t j = 0; j < unknowns_.searched.size(); ++j) {
      const Parameter& parameter = job_.parameters[unknowns_.searched[j]];
      const auto at = static_cast<Eigen::Index>(j);
      const double width = parameter.upper - parameter.lower;
      if (!(rates[at] * width > std::numbers::pi)) continue;
      const int steps = std::clamp(static_cast<int>(std::ceil(rates[at] * width / std::numbers::pi)), is_diameter(0, j) ? kDiameters : 1, kMostSteps);
      for (int i = 0; i < steps; ++i) {
        lines.push_back(best.searched);
        lines.back()[at] = parameter.lower + width * (i + 0.5) / steps;
      }
    }
    if (lines.empty()) break;
    evaluations_ += all->evaluations();
    all = problem_for(lines);
    ScanResult more = polish(*all, job_, std::move(lines), 3, same);
    const bool helps = more.candidates.front().objective < kHelps * best.objective;
    found_.interrupted = more.interrupted;
    found_.points += more.points;
    if (!helps) break;
    for (Candidate& other : found_.candidates)
      if (std::none_of(more.candidates.begin(), more.candidates.end(), [&](const Candidate& known) { return same(known.searched, other.searched); })) more.candidates.push_back(std::move(other));
    found_.candidates = std::move(more.candidates);
  }
  found_.traces = std::move(result_.scans);
  found_.points += scan_points_;
  evaluations_ += all->evaluations();
  stopped_ = stopped_ || rays.stopped_ || found_.interrupted;
  sample_rows_ = static_cast<double>(all->pixel_rows());
  for (std::size_t j = 0; j < unknowns_.searched.size(); ++j) theta_[static_cast<std::size_t>(unknowns_.searched[j])] = found_.candidates.front().searched[static_cast<Eigen::Index>(j)];
  for (int g = 0; g < frames_; ++g) plans_[g] = plan(job_.micrographs[g].scene, theta_);
}

/// The start with the centre where the images show it, within its bounds; nothing where no centre is searched or the start is there already.
std::optional<Eigen::VectorXd> Fit::start_at_symmetry() const {
  Eigen::VectorXd centred = start_;
  std::array<int, 2> at{-1, -1};
  for (int g = 0; g < frames_; ++g) {
    const View& view = job_.micrographs[g].scene.view;
    const auto unknown = [&](ParameterRef ref) {
      const auto found = ref ? std::find(unknowns_.searched.begin(), unknowns_.searched.end(), ref.index) : unknowns_.searched.end();
      return found == unknowns_.searched.end() ? -1 : static_cast<int>(found - unknowns_.searched.begin());
    };
    const std::array<int, 2> here{unknown(view.center_x_px), unknown(view.center_y_px)};
    if (here[0] < 0 || here[1] < 0 || here == at) continue;  // frames that share a centre: the first one's
    Mask used(job_.micrographs[g].values.width(), job_.micrographs[g].values.height());
    for (const auto& [x, y] : pixels_[g]) used(x, y) = 1;
    const std::optional<std::array<double, 2>> centre = centre_of_symmetry(job_.micrographs[g].values, used);
    if (!centre) return std::nullopt;
    at = here;
    for (int axis = 0; axis < 2; ++axis) {
      const Parameter& parameter = job_.parameters[unknowns_.searched[static_cast<std::size_t>(here[axis])]];
      if (!((*centre)[axis] > parameter.lower && (*centre)[axis] < parameter.upper)) return std::nullopt;
      centred[here[axis]] = (*centre)[axis];
    }
  }
  if (at[0] < 0) return std::nullopt;
  // What is found is good to a hundredth of an image: a start as near as that is no worse.
  const View& view = job_.micrographs.front().scene.view;
  if ((centred - start_).cwiseAbs().maxCoeff() < 0.01 * std::max(view.width, view.height)) return std::nullopt;
  return centred;
}

std::size_t Fit::scanned_pixels(int g) const {
  const std::size_t share = std::max<std::size_t>(50, job_.options.scan_pixels / std::max(1, frames_));
  const RenderPlan& plan = plans_[g];
  const bool own_rays = std::holds_alternative<Droplet>(job_.micrographs[g].scene.sample) && plan.radial_panels == 0;
  if (!own_rays) return share;
  // kEnough: units of chi-square by which a constant image is then off; a wrong order is by a good part of that. kFewest: pixels that lie where the image is not flat, however
  // much of it is background.
  constexpr double kEnough = 20000, kFewest = 100;
  const Image& values = job_.micrographs[g].values;
  double mean = 0, square = 0, fourth = 0;
  const double n = static_cast<double>(pixels_[g].size());
  for (const auto& [x, y] : pixels_[g]) mean += values(x, y) / n;
  for (const auto& [x, y] : pixels_[g]) {
    const double z = (values(x, y) - mean) / sigma_[g](x, y), z2 = z * z;
    square += z2 / n, fourth += z2 * z2 / n;
  }
  if (!(fourth > 0)) return share;
  const double showing = square * square / fourth;  // their share: 1 where all are as far off as each other
  const double needed = std::max(kFewest / showing, kEnough / std::max(square - 1, 1e-9));
  return needed < static_cast<double>(share) ? static_cast<std::size_t>(needed) : share;
}

double Fit::look_for_minima(double hopeless_above) {
  if (std::any_of(plans_.begin(), plans_.end(), [](const RenderPlan& p) { return p.wave != nullptr; })) {
    look_near_rays();
    result_.scans = std::move(found_.traces);
    scan_points_ = found_.points;
    return found_.candidates.front().objective / std::max(1.0, sample_rows_);
  }
  const std::vector<FringePhase> fringes = fringe_phases(job_, unknowns_, theta_);
  const auto sampled = [&] {
    std::vector<PixelSet> part;
    for (int g = 0; g < frames_; ++g) part.push_back(pixel_set(job_.micrographs[g], sigma_[g], subsample(pixels_[g], scanned_pixels(g))));
    auto problem = std::make_unique<LeastSquares>(job_, unknowns_, plans_, std::move(part));
    problem->set_misfit(prior_misfit());
    return problem;
  };
  std::unique_ptr<LeastSquares> sampled_pixels = sampled();
  // The picture's own middle, where fringes fit better around it: the grid takes the centre as known.
  if (const std::optional<Eigen::VectorXd> centred = start_at_symmetry()) {
    const std::vector<RenderPlan> given = plans_;
    const double by_given = lowest_of_few(*sampled_pixels, job_, unknowns_, start_, fringes);
    Theta theta = theta_;
    for (std::size_t j = 0; j < unknowns_.searched.size(); ++j) theta[unknowns_.searched[j]] = (*centred)[static_cast<Eigen::Index>(j)];
    for (int g = 0; g < frames_; ++g) plans_[g] = plan(job_.micrographs[g].scene, theta);
    std::unique_ptr<LeastSquares> around_centre = sampled();
    evaluations_ += sampled_pixels->evaluations();
    if (lowest_of_few(*around_centre, job_, unknowns_, *centred, fringes) < by_given) {
      start_ = *centred, theta_ = theta;
      sampled_pixels = std::move(around_centre);
    } else {
      evaluations_ += around_centre->evaluations();
      plans_ = given;
    }
  }
  LeastSquares& sample = *sampled_pixels;
  sample_rows_ = static_cast<double>(sample.pixel_rows());
  found_ = scan(sample, job_, unknowns_, start_, fringes, hopeless_above * std::max(1.0, sample_rows_));
  evaluations_ += sample.evaluations();
  stopped_ = stopped_ || found_.interrupted;
  result_.scans = std::move(found_.traces);
  scan_points_ = found_.points;
  return found_.candidates.front().objective / std::max(1.0, sample_rows_);
}

void Fit::find_minima() {
  best_ = found_.candidates.front().searched;

  rebuild_problem();
  if (stopped_) {
    problem_->evaluate(best_, true);
    theta_ = problem_->theta();
    return;
  }
  // On all pixels: the best, and whatever a subsample of this size cannot exclude (the difference of two chi-squares
  // scatters by twice its root).
  const double reduced =
      std::max(1.0, found_.candidates.front().objective / std::max(1.0, sample_rows_));
  constexpr double kPlausible = 30;
  struct Minimum {
    Candidate at;
    double rank;
    bool converged;
    std::string report;
  };
  std::vector<Minimum> minima;
  const auto minimum = [&](const Eigen::VectorXd& x, const SolveSummary& summary) {
    const Candidate at{x, problem_->objective(), projected_information(*problem_)};
    return Minimum{at, rank(at), summary.converged, summary.report};
  };
  for (std::size_t i = 0; i < found_.candidates.size(); ++i) {
    if (i > 0 && found_.candidates[i].objective - found_.candidates[0].objective > kPlausible * reduced) break;
    Eigen::VectorXd x = found_.candidates[i].searched;
    const SolveSummary summary = solve(x, i == 0 ? "fit" : "", i == 0 ? 0 : 30);
    minima.push_back(minimum(x, summary));
    if (stopped_) break;
  }
  const auto lower = [](const Minimum& a, const Minimum& b) { return a.rank < b.rank; };
  // A sphere's ripples are too fine for the scan's grid: from the best minimum on to its neighbours, as long as that helps.
  for (int round = 0; round < 4 && !stopped_; ++round) {
    const Minimum from = *std::min_element(minima.begin(), minima.end(), lower);
    bool better = false;
    const auto look_from = [&](Eigen::VectorXd x) {
      const SolveSummary summary = solve(x, "", 30);
      const Minimum found = minimum(x, summary);
      const auto known = std::find_if(minima.begin(), minima.end(), [&](const Minimum& m) { return separation(m.at, found.at.searched) < 5 && separation(found.at, m.at.searched) < 5; });
      if (known == minima.end()) {
        better = better || found.rank < from.rank;
        if (found.rank - from.rank < kPlausible * reduced) minima.push_back(found);
      } else if (found.at.objective < known->at.objective) {
        *known = found;
      }
    };
    for (std::size_t j = 0; j < unknowns_.searched.size(); ++j) {
      const Parameter& parameter = job_.parameters[unknowns_.searched[j]];
      const double period = ripple_period_of(j);
      if (period == 0) continue;
      const auto moved = [&](double by) {
        Eigen::VectorXd x = from.at.searched;
        x[static_cast<Eigen::Index>(j)] += by;
        return x;
      };
      const auto allowed = [&](const Eigen::VectorXd& x) { return !stopped_ && x[static_cast<Eigen::Index>(j)] > parameter.lower && x[static_cast<Eigen::Index>(j)] < parameter.upper; };
      for (const double ripples : {-2.0, -1.0, -0.5, 0.5, 1.0, 2.0})  // TE and TM resonances interlace
        if (const Eigen::VectorXd x = moved(ripples * period); allowed(x)) look_from(x);
      // A resonance that follows the noise is a dip far narrower than the valley it lies in: beside it the misfit rises less than its own width foretells.
      const double sd = 1 / from.at.information.col(static_cast<Eigen::Index>(j)).norm();
      for (const double side : {-1.0, 1.0}) {
        std::optional<Eigen::VectorXd> start;
        double least = from.at.objective + kPlausible * reduced;
        for (double off = 8; off * sd < 0.5 * period; off *= 2) {
          const Eigen::VectorXd x = moved(side * off * sd);
          if (!allowed(x)) break;
          problem_->evaluate(x, false);
          if (problem_->objective() < std::min(least, from.at.objective + 0.5 * off * off)) least = problem_->objective(), start = x;
        }
        if (start) look_from(*start);
      }
    }
    if (!better) break;
  }
  const auto lowest = std::min_element(minima.begin(), minima.end(), lower);
  best_ = lowest->at.searched;
  result_.converged = lowest->converged && !stopped_;
  result_.solver_report = lowest->report;
  for (auto i = minima.begin(); i != minima.end(); ++i)
    if (i != lowest) rivals_.push_back(i->at.searched);
  problem_->evaluate(best_, true);
  theta_ = problem_->theta();
}

Image Fit::fitted_image(int g) const {
  return lit(job_.micrographs[g], theta_, render(job_.micrographs[g].scene, plans_[g], theta_, {}, job_.options.threads).intensity);
}

/// Poisson weights from the data themselves pull a fit low (bright outliers get small weights): the variance must
/// come from the fitted signal.
void Fit::settle_weights() {
  // What the image's own differences call noise may be fringes. Those of the residual may hold misfit: both are upper
  // bounds, and the fit takes the residual's when it is clearly lower.
  constexpr double kClearly = 0.8;
  bool lower = false;
  for (int g = 0; g < frames_ && !stopped_; ++g) {
    if (!noise_[g].estimated) continue;
    const Image image = fitted_image(g);
    const NoiseModel again = estimate_noise(job_.micrographs[g], &image);
    if (mean_variance(job_.micrographs[g], again, image) >= kClearly * mean_variance(job_.micrographs[g], noise_[g], image)) continue;
    noise_[g] = again;
    sigma_[g] = standard_deviation(job_.micrographs[g], again, image);
    lower = true;
  }
  if (lower) {
    rebuild_problem();
    result_.iterations.clear();  // chi-square in other units; the report draws one curve
    solve_main("noise from the residual");
  }
  for (int pass = 0; pass < 3 && !stopped_; ++pass) {
    if (pass > 0 &&
        std::all_of(noise_.begin(), noise_.end(), [](const NoiseModel& n) { return n.counts_per_photon == 0; }))
      return;  // the weights do not depend on the signal
    for (int g = 0; g < frames_; ++g) sigma_[g] = standard_deviation(job_.micrographs[g], noise_[g], fitted_image(g));
    const Candidate before{best_, 0, projected_information(*problem_)};
    rebuild_problem();
    solve_main("reweighted");
    constexpr double kStill = 0.02;  // standard errors
    if (separation(before, best_) < kStill) break;
  }
}

void Fit::settle_plans() {
  for (int round = 0; round < 2 && !stopped_; ++round) {
    bool grown = false;
    for (int g = 0; g < frames_; ++g) {
      try {
        RenderPlan now = plan(job_.micrographs[g].scene, theta_);
        if (!asks_for_more(now, plans_[g])) continue;
        plans_[g] = std::move(now);
        grown = true;
      } catch (const UserError& error) {
        // Bounds that each are possible need not be so together.
        result_.identifiable = false;
        result_.warnings.push_back("The search ended where the scene cannot be: " + error.problems().front().what + ". Narrower bounds keep it away from there.");
        return;
      }
    }
    if (!grown) return;
    say("the model needs finer steps here: solving once more");
    rebuild_problem();
    solve_main("replanned");
  }
}

/// What stands out of a micrograph's residual, among all its usable pixels.
Outliers Fit::outliers_of(int g) const {
  const Micrograph& micrograph = job_.micrographs[g];
  const Image fitted = fitted_image(g);
  Image whitened(fitted.width(), fitted.height());
  Mask used(fitted.width(), fitted.height(), 0);
  for (const auto& [x, y] : usable_pixels(micrograph, sigma_[g])) {
    used(x, y) = 1;
    whitened(x, y) = (micrograph.values(x, y) - fitted(x, y)) / sigma_[g](x, y);
  }
  return find_outliers(whitened, used);
}

/// Leaves out what stands out and fits again until that changes no more: the loss min(z^2, limit^2), z of a pixel or of its neighbourhood.
/// Every round judges all pixels anew, so that what a bad start made stand out comes back.
void Fit::settle_outliers() {
  left_out_.assign(static_cast<std::size_t>(frames_), {});
  if (!job_.options.leave_out_outliers || rows_) return;
  constexpr int kMostRounds = 10;
  for (int round = 0; round < kMostRounds && !stopped_; ++round) {
    bool changed = false;
    for (int g = 0; g < frames_; ++g) {
      Outliers found = outliers_of(g);
      const std::vector<std::array<int, 2>> usable = usable_pixels(job_.micrographs[g], sigma_[g]);
      // So much cannot be dust: then the model is wrong, and leaving out what shows it would hide that.
      if (found.count > kMostOutliers * static_cast<double>(usable.size())) {
        if (round == 0 || left_out_[static_cast<std::size_t>(g)].count > 0) result_.warnings.push_back(fmt::format(
            "{}: {:.2g} % of the pixels stand out of the residual, more than dust would: none was left out. Mask what is foreign, or change the model.",
            job_.micrographs[g].name, 100.0 * found.count / static_cast<double>(usable.size())));
        found = {};
      }
      Outliers& before = left_out_[static_cast<std::size_t>(g)];
      if (found.count == before.count && (found.count == 0 || found.pixels.values() == before.pixels.values())) continue;
      changed = true;
      pixels_[g].clear();
      for (const auto& [x, y] : usable)
        if (found.count == 0 || !found.pixels(x, y)) pixels_[g].push_back({x, y});
      if (noise_[g].estimated) {  // a scratch looks like noise
        Micrograph seen = job_.micrographs[g];
        for (std::size_t i = 0; found.count > 0 && i < seen.mask.values().size(); ++i)
          if (found.pixels.values()[i]) seen.mask.values()[i] = 0;
        const Image fitted = fitted_image(g);
        noise_[g] = estimate_noise(seen, &fitted);
        sigma_[g] = standard_deviation(seen, noise_[g], fitted);
      }
      before = std::move(found);
    }
    if (!changed) return;
    rebuild_problem();
    solve_main("without outliers");
  }
}

/// Frame by frame: how much larger than noise the misfit is, over how many pixels it is shared, and how the frames'
/// means scatter. The scatter is a random effect with equal variance for every frame: each frame's mean residual is
/// one observation, its variance solves sum e_g^2 / (tau^2 + s_g^2) = degrees of freedom (Mandel & Paule, Anal. Chem.
/// 42, 1194 (1970)), and the t quantile counts frames. A cluster-robust sandwich (Liang & Zeger, Biometrika 73, 13
/// (1986)) of five frames and three parameters would be half its size too small: the normal equations make its scores
/// nearly zero.
std::vector<Misfit> Fit::assess_misfit() {
  std::vector<Misfit> misfit = prior_misfit();
  const double pixels = static_cast<double>(problem_->pixel_rows());
  std::vector<LeastSquares::FrameMisfit> frames;
  for (int g = 0; g < frames_; ++g) frames.push_back(problem_->frame_misfit(g));

  // Degrees of freedom left to the frames' means.
  double dof = 0;
  if (frames_ > 1) {
    const Eigen::MatrixXd covariance = invert_normal_equations(problem_->factor()).covariance;
    for (int g = 0; g < frames_; ++g) {
      const Misfit& now = problem_->misfit()[g];
      const double ratio = now.mean_sd / frames[g].mean_noise_sd;
      const double factor = now.mean_follows_shape ? 1 / now.shape_variance : 1 / (1 + ratio * ratio);
      const Eigen::VectorXd& row = frames[g].mean_jacobian_whitened;
      dof += 1 - std::clamp(factor * row.dot(covariance * row), 0.0, 1.0);
    }
  }
  constexpr double kEnoughFrames = 0.9;  // one degree of freedom, to rounding of leverages
  const bool own_scatter = dof >= kEnoughFrames;

  misfit_ = false;
  largest_area_ = 1;
  for (int g = 0; g < frames_; ++g) {
    const double n = frames[g].mean_noise_sd > 0 ? static_cast<double>(problem_->pixels(g).value.size()) : 0;
    const bool mean_known = own_scatter || !misfit[g].mean_follows_shape;
    const double mean_part = mean_known ? frames[g].mean_whitened * frames[g].mean_whitened : 0;
    const double reduced = (frames[g].chi_square - mean_part) / std::max(1.0, n * (1 - unknowns_.size() / pixels));
    // White noise stays below this in all but 1 of 3 million images: exact errors stay exact.
    const double sampling = std::sqrt(2 / n);
    if (!(reduced > 1 + 5 * sampling)) continue;
    misfit_ = true;
    misfit[g].shape_variance = reduced;
    constexpr double kClearly = 0.1;  // smaller excesses are a noise model a little off
    if (reduced > 1 + std::max(kClearly, 5 * sampling)) {
      const Micrograph& micrograph = job_.micrographs[g];
      Image whitened(micrograph.values.width(), micrograph.values.height());
      Mask mask(whitened.width(), whitened.height());
      const PixelSet& set = problem_->pixels(g);
      Eigen::VectorXd residual = problem_->noise_whitened_residual(g);
      if (mean_known) residual.array() -= frames[g].mean_residual / set.sigma.array();
      for (Eigen::Index i = 0; i < residual.size(); ++i) {
        whitened(set.pixels[i][0], set.pixels[i][1]) = residual[i];
        mask(set.pixels[i][0], set.pixels[i][1]) = 1;
      }
      const double area = std::min(correlation_area(whitened, mask), n / 4);
      misfit[g].shape_variance *= std::max(1.0, area);
      largest_area_ = std::max(largest_area_, area);
    }
  }

  frames_scatter_ = false;
  if (own_scatter) {
    double sum = 0;
    for (const auto& frame : frames) sum += frame.mean_whitened * frame.mean_whitened;
    constexpr double kSignificant = 0.999;
    frames_scatter_ = sum > dof && (misfit_ || sum > chi_square_quantile(kSignificant, dof));
    frame_sd_ = 0;
    if (frames_scatter_) {
      const auto excess = [&](double sd) {
        double total = -dof;
        for (int g = 0; g < frames_; ++g) {
          const double ratio = sd * std::abs(gain_of(g)) / frames[g].mean_noise_sd;
          total += frames[g].mean_whitened * frames[g].mean_whitened / (1 + ratio * ratio);
        }
        return total;
      };
      double high = 1e-9;
      while (excess(high) > 0 && high < 1e9) high *= 2;
      double low = 0;
      for (int i = 0; i < 100; ++i) {
        const double middle = 0.5 * (low + high);
        (excess(middle) > 0 ? low : high) = middle;
      }
      frame_sd_ = 0.5 * (low + high);
    }
    // Rows of a table are its pixels: neighbours share a misfit that is wider than their distance.
    row_length_ = rows_ && frames_scatter_ ? std::min(row_correlation(frames), dof / 4) : 1;
    frame_dof_ = dof / row_length_;
    for (int g = 0; g < frames_; ++g) {
      misfit[g].mean_sd = frame_sd_ * std::sqrt(row_length_) * std::abs(gain_of(g));
      misfit[g].mean_follows_shape = false;
    }
  }
  return misfit;
}

/// Number of neighbouring rows that share one misfit, all tables together: (1 + r) / (1 - r), r the correlation of neighbours,
/// where it exceeds twice its sampling error. That is exact for a correlation that falls geometrically and, as r is known far better
/// than the sum of all lags, does not end where the sampling error does. The fitted mean makes r small by (1 + 3 r) / n
/// (Marriott & Pope, Biometrika 41, 390 (1954)).
double Fit::row_correlation(const std::vector<LeastSquares::FrameMisfit>& frames) const {
  std::map<std::string, std::vector<double>> tables;
  for (int g = 0; g < frames_; ++g) {
    const double ratio = frame_sd_ * std::abs(gain_of(g)) / frames[g].mean_noise_sd;
    tables[table_of(job_.micrographs[g].name)].push_back(frames[g].mean_whitened / std::sqrt(1 + ratio * ratio));
  }
  double squares = 0, products = 0, rows = 0, pairs = 0;
  for (const auto& [name, residual] : tables)
    for (std::size_t i = 0; i < residual.size(); ++i) {
      squares += residual[i] * residual[i], ++rows;
      if (i > 0) products += residual[i - 1] * residual[i], ++pairs;
    }
  if (!(squares > 0) || !(pairs > 0)) return 1;
  double r = products / pairs / (squares / rows);
  if (r < 2 / std::sqrt(pairs)) return 1;
  r = std::min(r + (1 + 3 * r) / (pairs / static_cast<double>(tables.size())), 1 - 1 / pairs);
  return (1 + r) / (1 - r);
}

void Fit::settle_misfit() {
  for (int pass = 0; pass < 8; ++pass) {
    const double before = frame_sd_;
    const std::vector<Misfit> misfit = assess_misfit();
    problem_->set_misfit(misfit);
    // Weights common to all rows of a single image move no minimum; against a prior or between frames they do.
    const bool moves = frames_ > 1 || problem_->prior_rows() > 0;
    if (!moves || stopped_) {
      problem_->evaluate(best_, true);
      return;
    }
    solve_main("misfit weighed");
    constexpr double kSettled = 0.002;
    if (pass > 0 && std::abs(frame_sd_ - before) <= kSettled * frame_sd_) return;
  }
}

/// Between one ripple of a sphere's image and the next, of a searched unknown; 0 where it has none.
double Fit::ripple_period_of(std::size_t j) const {
  double period = 0;
  for (const Micrograph& m : job_.micrographs) period = std::max(period, ripple_period(m.scene, problem_->theta(), unknowns_.searched[j]));
  return period;
}

bool Fit::ripples() const {
  for (std::size_t j = 0; j < unknowns_.searched.size(); ++j)
    if (ripple_period_of(j) > 0) return true;
  return false;
}

/// -2 ln of a minimum's evidence.
double Fit::score(const Candidate& c) const { return c.objective - 2 * log_share(c.information, job_, unknowns_); }
/// What the best minimum has least of. Only of a sphere's ripples, which are alike but for their width, is that the evidence: a minimum that is flat because fringes have an
/// extremum there takes up all bounds.
double Fit::rank(const Candidate& c) const { return ripples() ? score(c) : c.objective; }

/// Minima that survived the scan, with the weights of the final problem: misfit is paid for in the odds as well.
void Fit::weigh_rivals() {
  if (!stopped_ && !rivals_.empty()) {
    Candidate main{best_, problem_->objective(), projected_information(*problem_)};
    const bool rippled = ripples();
    std::vector<Candidate> others;
    for (Eigen::VectorXd x : rivals_) {
      solve(x, "", 30);
      Candidate rival{x, problem_->objective(), projected_information(*problem_)};
      if (stopped_) break;
      // Far apart in the standard errors of either, or else they are two places of one valley. (At an extremum of the fringes one alone
      // calls everything near.)
      if (separation(main, x) < 5 && separation(rival, main.searched) < 5) {
        if (rival.objective < main.objective) std::swap(main, rival);
        continue;
      }
      if (rank(rival) < rank(main)) std::swap(main, rival);
      const bool known = std::any_of(others.begin(), others.end(),
                                     [&](const Candidate& other) { return separation(other, rival.searched) < 5 && separation(rival, other.searched) < 5; });
      if (!known) others.push_back(std::move(rival));
    }
    // Of a dip and the valley it lies in, the valley, whose interval holds both.
    constexpr double kHeld = 2, kWorthHolding = 0.05;
    const auto valley = std::find_if(others.begin(), others.end(), [&](const Candidate& rival) {
      return rippled && separation(rival, main.searched) < kHeld && score(rival) - score(main) < -2 * std::log(kWorthHolding);
    });
    if (valley != others.end()) std::swap(main, *valley);
    for (const Candidate& rival : others) {
      RivalMinimum minimum;
      minimum.likelihood_ratio = std::exp(-0.5 * (rival.objective - main.objective));
      minimum.odds = std::exp(-0.5 * (score(rival) - score(main)));
      // Among a sphere's many resonances one always follows the noise, a dip too narrow to be likely. Elsewhere neither measure alone dismisses a rival: at an extremum of the
      // fringes a minimum is no parabola, and its share no more than a guess.
      minimum.counts = rippled ? minimum.odds > kAmbiguousOdds && separation(main, rival.searched) >= kHeld : std::max(minimum.odds, minimum.likelihood_ratio) > kAmbiguousOdds;
      if (!(std::max(minimum.odds, minimum.likelihood_ratio) > 1e-3)) continue;
      problem_->evaluate(rival.searched, false);
      minimum.theta = problem_->theta();
      for (int g = 0; g < frames_; ++g) minimum.chi_square += problem_->frame_misfit(g).chi_square;
      minimum.chi_square += problem_->prior_chi_square();
      result_.ambiguous = result_.ambiguous || minimum.counts;
      result_.rivals.push_back(std::move(minimum));
    }
    std::stable_sort(result_.rivals.begin(), result_.rivals.end(),
                     [](const RivalMinimum& a, const RivalMinimum& b) { return a.odds > b.odds; });
    best_ = main.searched;
  }
  problem_->evaluate(best_, true);
  theta_ = problem_->theta();
}

/// Of images without structure but that of uneven light; nothing where the model is one itself.
std::optional<double> Fit::chi_square_of_a_constant() const {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (int g = 0; g < frames_; ++g) {
    const auto [l, h] = problem_->intensity_range(g);
    low = std::min(low, l);
    high = std::max(high, h);
  }
  constexpr double kUniform = 1e-9;
  if (!(high - low > kUniform)) return std::nullopt;
  // Frames that share an offset share the constant; an uneven background is part of it.
  double null_chi_square = 0;
  std::set<int> done;
  for (int g = 0; g < frames_; ++g) {
    const int group = job_.micrographs[g].offset.index;
    if (!done.insert(group).second) continue;
    constexpr int kShapes = 4;
    Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(kShapes, kShapes);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(kShapes), shape(kShapes);
    double squares = 0;
    for (int other = 0; other < frames_; ++other) {
      const Micrograph& m = job_.micrographs[other];
      if (m.offset.index != group) continue;
      const PixelSet& set = problem_->pixels(other);
      for (Eigen::Index i = 0; i < set.value.size(); ++i) {
        shape.setZero();
        for (const LightTerm& term : light_terms(m))
          if (!term.of_intensity)
            shape[term.shape ? 1 + static_cast<int>(*term.shape) : 0] = term.shape_at(m.scene.view, set.pixels[static_cast<std::size_t>(i)][0], set.pixels[static_cast<std::size_t>(i)][1]);
        const double weight = 1 / (set.sigma[i] * set.sigma[i]);
        gram += weight * shape * shape.transpose();
        right += weight * set.value[i] * shape;
        squares += weight * set.value[i] * set.value[i];
      }
    }
    null_chi_square += std::max(0.0, squares - right.dot(gram.completeOrthogonalDecomposition().solve(right)));
  }
  return null_chi_square;
}

/// Does the model describe the images at all? False: an image without structure is as good, compared in units of the misfit (an F test), with what the
/// freedom of the model and the number of places the scan looked at gain by chance. A model that is better than that and yet leaves most of what there
/// is to see is not the sample's, whatever its parameters' errors.
bool Fit::judge_description(double chi_square) {
  const std::optional<double> constant = chi_square_of_a_constant();
  if (!constant) return true;
  const double rows = static_cast<double>(problem_->pixel_rows()), reduced = std::max(1.0, chi_square / rows);
  // More than half: measured images of crystals with an uneven field leave up to 0.37 and return the right voltage, a bipolar droplet taken for a radial one
  // leaves 0.77 and returns a birefringence 6 standard errors off.
  constexpr double kMisfit = 2, kMostLeft = 0.5;
  result_.left_over = *constant > rows ? (chi_square - rows) / (*constant - rows) : 0;
  result_.described = !(reduced > kMisfit && result_.left_over > kMostLeft);
  const double by_chance = 25 + 2 * unknowns_.size() + 2 * std::log(std::max(1, scan_points_));
  return (*constant - chi_square) / reduced > by_chance;
}

std::string Fit::covariance_words() const {
  std::string words;
  double largest = 1;
  for (const Misfit& misfit : problem_->misfit()) largest = std::max(largest, misfit.shape_variance);
  if (frames_scatter_)
    words = fmt::format("{} scatter by {:.2g} of the model intensity about the joint fit",
                        rows_ ? "misfit included: the rows" : "clustered by image: the frames", frame_sd_);
  else if (job_.prior && job_.prior->frame_scatter)
    words = fmt::format("frame misfit of {:.2g} of the model intensity from the prior's fit included",
                        job_.prior->frame_scatter->intensity_sd);
  if (row_length_ > 1.5) words += fmt::format(", {:.2g} neighbours alike", row_length_);
  if (misfit_) {
    if (!words.empty()) words += "; ";
    words += largest_area_ > 1.5
                 ? fmt::format("scaled by reduced chi-square {:.3g} and the {:.3g} pixels that share one misfit",
                               largest / largest_area_, largest_area_)
                 : fmt::format("scaled by reduced chi-square {:.3g}", largest);
  }
  return words.empty() ? "white noise: the noise model explains the residuals" : words;
}

/// Where the profile likelihood of a searched unknown, going up from the estimate, leaves 95 % one-sided confidence; nothing when it
/// stays below that up to the bound, or when the physical limit at its lower bound is itself excluded. Needed where the curvature at
/// the estimate says nothing: a director below its threshold hardly answers to the voltage, above it does.
std::optional<double> Fit::upper_limit(int unknown, const Inverse& inverse) {
  const int index = unknowns_.table_index(unknown);
  const Parameter& parameter = job_.parameters[index];
  const bool prior = parameter.prior_sd || (job_.prior && std::count(job_.prior->names.begin(), job_.prior->names.end(), parameter.name) > 0);
  if (prior || stopped_ || !std::isfinite(parameter.upper)) return std::nullopt;
  const double allowed = std::pow(student_t_quantile(0.95, result_.interval_degrees_of_freedom), 2);
  Profile profile(*problem_, job_, unknowns_, best_, inverse.covariance, unknown);
  if (profile.rise(parameter.lower, allowed) > allowed) return std::nullopt;
  constexpr int kSteps = 40, kHalvings = 12;  // the limit to 1e-5 of the range
  double inside = theta_[index];
  const double step = (parameter.upper - inside) / kSteps;
  for (int i = 1; i <= kSteps; ++i) {
    const double value = i == kSteps ? parameter.upper : inside + step;
    if (profile.rise(value, allowed) <= allowed) {
      inside = value;
      continue;
    }
    double outside = value;
    for (int k = 0; k < kHalvings; ++k) {
      const double middle = 0.5 * (inside + outside);
      (profile.rise(middle, allowed) <= allowed ? inside : outside) = middle;
    }
    return outside;
  }
  return std::nullopt;
}

/// value +- t stderr where the objective is a parabola that far; else the places where the profile likelihood has fallen as much.
/// `of_noise`: the covariance without what models err by, which is added to either half.
void Fit::settle_interval(ParameterEstimate& estimate, int unknown, const Inverse& of_noise) {
  const double t = student_t_quantile(0.975, result_.interval_degrees_of_freedom), sd = std::sqrt(of_noise.covariance(unknown, unknown));
  if (stopped_ || !std::isfinite(t * sd) || !(sd > 0) || of_noise.undetermined[static_cast<std::size_t>(unknown)]) return;
  // A joint prior is itself the parabola that an earlier fit was taken for: followed far along its valley it bends where the earlier data do
  // not (docs/methods.md, "Profiles").
  if (job_.prior) return;
  const Parameter& parameter = job_.parameters[unknowns_.table_index(unknown)];
  // A valley longer than the bounds is no interval but a verdict.
  if (!(t * sd < parameter.upper - parameter.lower)) return;
  constexpr double kBent = 0.1;  // 5 % of the interval
  Profile profile(*problem_, job_, unknowns_, best_, of_noise.covariance, unknown);
  const std::array<double, 2> straight = profile.straightness(t * t);
  if (std::abs(straight[0] - 1) < kBent && std::abs(straight[1] - 1) < kBent) return;
  // A bound that the data do not exclude is no end of the interval.
  const auto half = [&](double end) {
    const double to = profile.crossing(end, t * t), length = std::abs(to - estimate.value);
    return to == end ? std::max(length, t * sd) : length;
  };
  const double low = half(parameter.lower), high = half(parameter.upper);
  if (profile.lowest() < -1)
    result_.warnings.push_back(fmt::format("A better fit by {:.2g} in chi-square was met on the profile of {}: the solver had not reached the minimum.", -profile.lowest(), parameter.name));
  if (std::abs(low / (t * sd) - 1) < 0.5 * kBent && std::abs(high / (t * sd) - 1) < 0.5 * kBent) return;  // only the way there was bent
  const double more = t * t * (estimate.stderr_ * estimate.stderr_ - sd * sd);
  estimate.interval95_low = estimate.value - std::sqrt(low * low + more);
  estimate.interval95_high = estimate.value + std::sqrt(high * high + more);
  estimate.profiled = true;
  result_.profiles.push_back(profile.trace());
}

void Fit::report_parameters(const Inverse& inverse, const Inverse& of_noise) {
  const Eigen::VectorXd gradient = problem_->gradient();
  const double t = student_t_quantile(0.975, result_.interval_degrees_of_freedom);
  for (int j = 0; j < unknowns_.size(); ++j) {
    const int index = unknowns_.table_index(j);
    const Parameter& parameter = job_.parameters[index];
    ParameterEstimate estimate;
    estimate.name = parameter.name;
    estimate.unit = parameter.unit;
    estimate.value = theta_[index];
    estimate.stderr_ = std::sqrt(inverse.covariance(j, j));
    estimate.start = parameter.value;
    estimate.lower = parameter.lower;
    estimate.upper = parameter.upper;
    estimate.linear = j >= static_cast<int>(unknowns_.searched.size());
    if (parameter.prior_sd) {
      estimate.prior_value = parameter.value;
      estimate.prior_sd = parameter.prior_sd;
    } else if (job_.prior) {
      for (std::size_t k = 0; k < job_.prior->names.size(); ++k)
        if (job_.prior->names[k] == parameter.name) {
          const auto at = static_cast<Eigen::Index>(k);
          estimate.prior_value = job_.prior->mean[at];
          estimate.prior_sd = std::sqrt(job_.prior->covariance(at, at));
        }
    }
    estimate.interval95_low = estimate.value - t * estimate.stderr_;
    estimate.interval95_high = estimate.value + t * estimate.stderr_;
    const double width = parameter.upper - parameter.lower;
    const double close = std::isfinite(width) ? 1e-6 * width : 1e-9 * std::abs(estimate.value);
    const bool at_lower = estimate.value <= parameter.lower + close && gradient[j] >= 0;
    const bool at_upper = estimate.value >= parameter.upper - close && gradient[j] <= 0;
    if (at_lower || at_upper) {
      estimate.at_bound = true;
      const bool physical =
          at_lower ? parameter.lower == parameter.physical_lower : parameter.upper == parameter.physical_upper;
      if (!physical) result_.pinned = true;
      if (physical && std::isfinite(estimate.stderr_) && estimate.stderr_ > 0) {
        // The likelihood is the tail of a normal whose top lies `outside` standard errors beyond the limit; with a flat
        // prior on the allowed side 95 % of that tail lie within `reach`.
        const double outside = std::min(30.0, 0.5 * std::abs(gradient[j]) * estimate.stderr_);
        const double reach = -normal_quantile(0.05 * normal_cdf(-outside)) - outside;
        estimate.limit = at_lower ? "upper" : "lower";
        estimate.limit_value = estimate.value + (at_lower ? 1 : -1) * reach * estimate.stderr_;
        estimate.interval95_low = std::min(estimate.value, estimate.limit_value);
        estimate.interval95_high = std::max(estimate.value, estimate.limit_value);
      }
    }
    // The curvature at the estimate need not be that of the way to nature's bound: ask there.
    const bool limited = !estimate.limit.empty() && estimate.limit_value < parameter.upper;
    if (!estimate.linear && parameter.lower == parameter.physical_lower && !limited && !at_upper)
      if (const std::optional<double> limit = upper_limit(j, of_noise)) {
        estimate.limit = "upper";
        estimate.limit_value = *limit;
        estimate.interval95_low = parameter.lower;
        estimate.interval95_high = *limit;
      }
    if (!estimate.linear && !estimate.at_bound && estimate.limit.empty()) settle_interval(estimate, j, of_noise);
    result_.names.push_back(parameter.name);
    result_.parameters.push_back(std::move(estimate));
  }
  problem_->evaluate(best_, true);  // profiles moved it
}

/// What the fit takes as exact, and what the estimates owe to it.
void Fit::weigh_inputs(const Inverse& of_noise) {
  if (stopped_ || unknowns_.searched.empty() || std::any_of(plans_.begin(), plans_.end(), [](const RenderPlan& p) { return p.wave != nullptr; })) return;
  std::map<int, int> readers;
  for (const Micrograph& m : job_.micrographs) {
    std::set<int> read;
    for_each_ref(m.scene, [&](const ParameterRef& ref) {
      if (!ref || job_.parameters[ref].free) return;
      const bool of_a_vector = job_.parameters[ref].name.find(".axis.") != std::string::npos;  // no quantity by itself
      if (!of_a_vector) read.insert(ref.index);
    });
    for (const int index : read) ++readers[index];
  }
  std::vector<int> inputs;
  for (const auto& [index, number] : readers)
    if (number == frames_) inputs.push_back(index);
  std::vector<InputEffect> effects;
  const auto add = [&](const std::string& name, const std::string& unit, double value, const Eigen::VectorXd& by) {
    InputEffect effect{name, unit, value, unit == "deg" || unit == "px" ? 1.0 : 0.01 * std::abs(value), {}};
    const Eigen::VectorXd shift = problem_->shift_by(effect.step * by, of_noise.covariance);
    if (shift.allFinite()) effect.shift.assign(shift.begin(), shift.end());
    if (effect.step > 0 && !effect.shift.empty()) effects.push_back(std::move(effect));
  };
  const Eigen::MatrixXd columns = problem_->intensity_by(inputs);
  for (std::size_t k = 0; k < inputs.size(); ++k) {
    const Parameter& p = job_.parameters[inputs[k]];
    add(p.name, p.unit, theta_[static_cast<std::size_t>(inputs[k])], columns.col(static_cast<Eigen::Index>(k)));
  }
  // The size of a pixel is no parameter: by differences.
  const double pixel = job_.micrographs.front().scene.view.pixel_size_um;
  if (pixel > 0 && std::all_of(job_.micrographs.begin(), job_.micrographs.end(), [&](const Micrograph& m) { return m.scene.view.pixel_size_um == pixel; })) {
    constexpr double kStep = 1e-4;
    Eigen::VectorXd by(problem_->pixel_rows());
    Eigen::Index row = 0;
    for (int g = 0; g < frames_; ++g) {
      std::array<Image, 2> images;
      for (const int side : {0, 1}) {
        Scene scene = job_.micrographs[g].scene;
        scene.view.pixel_size_um *= 1 + (side ? kStep : -kStep);
        images[static_cast<std::size_t>(side)] = render(scene, plans_[g], theta_, {}, job_.options.threads).intensity;
      }
      for (const auto& [x, y] : pixels_[g]) by[row++] = (images[1](x, y) - images[0](x, y)) / (2 * kStep * pixel);
    }
    add("micrograph.pixel_size_um", "um", pixel, by);
  }
  const auto weight = [&](const InputEffect& effect) {
    double most = 0;
    for (std::size_t j = 0; j < unknowns_.searched.size(); ++j)
      if (const double sd = result_.parameters[j].stderr_; sd > 0) most = std::max(most, std::abs(effect.shift[j]) / sd);
    return most;
  };
  constexpr double kOfNote = 0.1;
  std::erase_if(effects, [&](const InputEffect& effect) { return weight(effect) < kOfNote; });
  std::stable_sort(effects.begin(), effects.end(), [&](const InputEffect& a, const InputEffect& b) { return weight(a) > weight(b); });
  result_.inputs = std::move(effects);
}

void Fit::report_micrographs() {
  for (int g = 0; g < frames_; ++g) {
    const Micrograph& micrograph = job_.micrographs[g];
    MicrographResult out;
    out.name = micrograph.name;
    out.fitted = fitted_image(g);
    out.sigma = sigma_[g];
    out.noise = noise_[g];
    out.plan = plans_[g];
    out.used = static_cast<int>(pixels_[g].size());
    out.outliers = left_out_[static_cast<std::size_t>(g)].count;
    out.chi_square = problem_->frame_misfit(g).chi_square;
    out.residual =
        Image(micrograph.values.width(), micrograph.values.height(), std::numeric_limits<double>::quiet_NaN());
    double squares = 0, low = std::numeric_limits<double>::infinity(), high = -low;
    for (const auto [x, y] : pixels_[g]) {
      const double fitted = out.fitted(x, y);
      const double residual = micrograph.values(x, y) - fitted;
      out.residual(x, y) = residual;
      squares += residual * residual;
      low = std::min(low, fitted);
      high = std::max(high, fitted);
    }
    out.residual_rms = std::sqrt(squares / out.used);
    out.signal_range = high - low;
    result_.micrographs.push_back(std::move(out));
  }
  // A row of a table has no range of its own: the table's.
  std::map<std::string, std::pair<double, double>> tables;
  for (const MicrographResult& row : result_.micrographs)
    if (row.used == 1) {
      auto& [low, high] = tables.try_emplace(table_of(row.name), row.fitted(0, 0), row.fitted(0, 0)).first->second;
      low = std::min(low, row.fitted(0, 0));
      high = std::max(high, row.fitted(0, 0));
    }
  for (MicrographResult& row : result_.micrographs)
    if (row.used == 1) {
      const auto [low, high] = tables.at(table_of(row.name));
      row.signal_range = high - low;
    }
}

void Fit::collect_warnings() {
  std::vector<std::string>& warnings = result_.warnings;
  const auto warn = [&](std::string text) {
    if (std::find(warnings.begin(), warnings.end(), text) == warnings.end()) warnings.push_back(std::move(text));
  };
  double range_low = std::numeric_limits<double>::infinity(), range_high = -range_low;
  for (const MicrographResult& micrograph : result_.micrographs)
    for (const auto& set : {micrograph.fitted})
      for (const double value : set.values())
        range_low = std::min(range_low, value), range_high = std::max(range_high, value);
  struct Rows {
    double number = 0, chi_square = 0, squares = 0, low = std::numeric_limits<double>::infinity(), high = -low;
  };
  std::map<std::string, Rows> tables;
  for (int g = 0; g < frames_; ++g) {
    const MicrographResult& micrograph = result_.micrographs[g];
    for (const std::string& warning : micrograph.plan.warnings) warn(warning);
    const double reduced = micrograph.chi_square / std::max(1, micrograph.used);
    // A uniform frame has no range of its own: then that of all frames, then its own level, is the yardstick.
    double range = micrograph.signal_range;
    if (!(range > 1e-6 * (range_high - range_low))) range = range_high - range_low;
    if (!(range > 1e-9 * std::abs(range_high))) range = std::abs(range_high);
    const double percent = range > 0 ? 100 * micrograph.residual_rms / range : 0;
    if (micrograph.used == 1) {  // a row of a table (name:line): judged with the others of it
      Rows& rows = tables[table_of(micrograph.name)];
      rows.number += 1;
      rows.chi_square += micrograph.chi_square;
      rows.squares += micrograph.residual_rms * micrograph.residual_rms;
      const double value = job_.micrographs[g].values(pixels_[g][0][0], pixels_[g][0][1]);
      rows.low = std::min(rows.low, value);
      rows.high = std::max(rows.high, value);
      continue;
    }
    if (micrograph.outliers > 0) {
      const Outliers& out = left_out_[static_cast<std::size_t>(g)];
      warn(fmt::format("{}: {} pixels in {} ({:.2g} %) stand out of the residual and were left out, the largest around column {}, row {}.", micrograph.name,
                       out.count, out.spots == 1 ? "one spot" : fmt::format("{} spots", out.spots), 100.0 * out.count / (out.count + micrograph.used),
                       out.largest_column, out.largest_row));
    } else if (!job_.options.leave_out_outliers && reduced > 1.05) {
      const Outliers out = outliers_of(g);
      double theirs = 0;
      for (const auto& [x, y] : pixels_[g])
        if (out.pixels(x, y)) theirs += std::pow(micrograph.residual(x, y) / micrograph.sigma(x, y), 2);
      if (out.count > 0 && out.count < kMostOutliers * micrograph.used && theirs > 0.2 * (micrograph.chi_square - micrograph.used))
        warn(fmt::format("{}: {} pixels in {}, the largest around column {}, row {}, make {:.0f} % of the misfit: dust or a scratch? Mask them, or set fit: {{outliers: leave_out}}.",
                         micrograph.name, out.count, out.spots == 1 ? "one spot" : fmt::format("{} spots", out.spots), out.largest_column, out.largest_row,
                         100 * std::min(1.0, theirs / (micrograph.chi_square - micrograph.used))));
    }
    if (reduced > 2) {
      warn(fmt::format(
          "{}: the model does not describe the image within its noise (reduced chi-square {:.3g}, residual "
          "{:.2g} % of the signal range){}",
          micrograph.name, reduced, percent,
          percent > 15 ? ": so large a misfit means that the model is wrong or incomplete; do not trust the values."
                       : "; the errors allow for it as far as the residuals show it."));
    }
  }
  for (const auto& [name, rows] : tables) {
    const double percent = rows.high > rows.low ? 100 * std::sqrt(rows.squares / rows.number) / (rows.high - rows.low) : 0;
    if (rows.chi_square / rows.number > 2 && rows.number > 3)
      warn(fmt::format("{}: the model does not describe the signal within its noise (reduced chi-square {:.3g}, residual {:.2g} % of the "
                       "signal's spread){}",
                       name, rows.chi_square / rows.number, percent,
                       percent > 5 ? ": a curve this far off is another one, or its label is wrong; do not trust the values."
                                   : "; the errors allow for it as far as the residuals show it."));
  }
  for (const ParameterEstimate& estimate : result_.parameters)
    if (estimate.prior_sd && estimate.stderr_ > 0.98 * *estimate.prior_sd)
      warn(fmt::format("The image adds nothing to the prior on {}.", estimate.name));
}

/// Of the parameters searched for but the centre, the one that another model moves most, in the standard errors `sd`.
Fit::Shift Fit::largest_shift(const Eigen::VectorXd& shift, const Eigen::VectorXd& sd) const {
  Shift most{unknowns_.searched.front()};
  for (int j = 0; j < std::ssize(unknowns_.searched); ++j) {
    const int index = unknowns_.table_index(j);
    if (job_.parameters[index].name.find("center_px") != std::string::npos || !(sd[j] > 0)) continue;
    if (std::abs(shift[j]) > most.standard_errors * sd[j]) most = {index, shift[j], std::abs(shift[j]) / sd[j]};
  }
  return most;
}

Eigen::VectorXd Fit::change_of_unknowns(const Theta& from, const Theta& to) const {
  Eigen::VectorXd change(unknowns_.size());
  for (int j = 0; j < unknowns_.size(); ++j) {
    const auto index = static_cast<std::size_t>(unknowns_.table_index(j));
    change[j] = to[index] - from[index];
  }
  return change;
}

/// Straight chords shift a birefringence by percents and the residual need not show it (docs/methods.md, "Curved rays"): a short fit
/// with curved rays from where this one ended says by how much. Returns what they change, searched unknowns first, then linear ones, where it is more than
/// the standard errors `sd` and the image does not contradict it.
std::optional<Eigen::VectorXd> Fit::foretell_curved_rays(const Eigen::VectorXd& sd) {
  const auto has_curved = [](const Micrograph& m) {
    return has_curved_rays(m.scene) && m.scene.rays == Rays::straight && m.scene.ceiling != Ceiling::wave;
  };
  if (stopped_ || unknowns_.searched.empty() || !std::all_of(job_.micrographs.begin(), job_.micrographs.end(), has_curved)) return std::nullopt;
  FitJob curved = job_;
  std::vector<RenderPlan> plans;
  std::vector<PixelSet> sets;
  // Of large images a part tells it, fitted both ways: what its noise does to a fit, it does to both.
  constexpr std::size_t kPixels = 1 << 17;
  std::size_t all = 0, used = 0;
  for (const auto& pixels : pixels_) all += pixels.size();
  const bool part = all > kPixels;
  for (int g = 0; g < frames_; ++g) {
    Scene& scene = curved.micrographs[g].scene;
    scene.rays = Rays::eikonal;
    plans.push_back(plan(scene, theta_));
    const auto pixels = part ? subsample(pixels_[g], std::max<std::size_t>(50, kPixels * pixels_[g].size() / all)) : pixels_[g];
    used += pixels.size();
    sets.push_back(pixel_set(curved.micrographs[g], sigma_[g], pixels));
  }
  SolveOptions few;
  few.max_iterations = 12;
  few.interrupted = job_.options.interrupted;
  double straight_objective = problem_->objective();
  // To a tenth of a chi-square unit, a third of a standard error: integrated rays leave kinks, which a search for more would follow.
  few.function_tolerance = 0.1 / std::max(straight_objective, 1.0);
  Theta straight = theta_;
  if (part) {
    LeastSquares problem(job_, unknowns_, plans_, sets);
    problem.set_misfit(problem_->misfit());
    Eigen::VectorXd searched = best_;
    problem.solve(searched, few);
    straight_objective = problem.objective();
    straight = problem.theta();
  }
  LeastSquares problem(curved, unknowns_, std::move(plans), std::move(sets));
  problem.set_misfit(problem_->misfit());
  Eigen::VectorXd searched = best_;
  problem.solve(searched, few);
  const Eigen::VectorXd change = change_of_unknowns(straight, problem.theta());
  const Shift shift = largest_shift(change, sd);
  by_curved_rays_ = shift.standard_errors;
  const double ratio = problem.objective() / straight_objective, reduced = std::max(1.0, result_.reduced_chi_square);
  const double worse = (problem.objective() - straight_objective) * static_cast<double>(all) / static_cast<double>(used);
  if (!(worse < 9 * reduced)) by_curved_rays_ = 0;
  if (by_curved_rays_ < 1) return std::nullopt;
  const double value = theta_[static_cast<std::size_t>(shift.index)];
  result_.warnings.push_back(fmt::format(
      "Rays are taken as straight. Curved ones (physics.rays: eikonal or auto) would put {} at {:.4g} ({:+.2g} %, {:.3g} standard errors), with a chi-square {:.3g} times this one. "
      "The error bars contain this as the error of the model.",
      job_.parameters[shift.index].name, value + shift.change, 100 * shift.change / value, by_curved_rays_, ratio));
  return change;
}

/// Rays of any kind shift what they estimate in droplets of a few wavelengths, and with a free gain the residual need not show it: fitted
/// to a wave image of the parameters found, they return something else. The difference is the bias to expect: returned, searched unknowns first, where
/// it matters beside the standard errors `sd`.
std::optional<Eigen::VectorXd> Fit::foretell_waves(const Eigen::VectorXd& sd) {
  const auto has_waves = [](const Micrograph& m) {
    return std::holds_alternative<Droplet>(m.scene.sample) && m.scene.ceiling == Ceiling::one_way && m.scene.microscope.objective_na > 0;
  };
  if (stopped_ || unknowns_.searched.empty() || !std::all_of(job_.micrographs.begin(), job_.micrographs.end(), has_waves)) return std::nullopt;
  constexpr double kMostSeconds = 10;  // for a warning
  std::vector<PixelSet> sets;
  for (int g = 0; g < frames_; ++g) {
    Scene waves = job_.micrographs[g].scene;
    waves.ceiling = Ceiling::wave;
    waves.method = "auto";
    waves.rays = Rays::straight;
    const WaveChoice choice = wave_choice(waves, theta_);
    if (choice.seconds_an_image > (job_.options.choose_waves ? job_.options.max_seconds : kMostSeconds)) return std::nullopt;
    const Image image = lit(job_.micrographs[g], theta_, render(waves, plan(waves, theta_), theta_, {}, job_.options.threads).intensity);
    PixelSet set = pixel_set(job_.micrographs[g], sigma_[g], pixels_[g]);
    for (std::size_t i = 0; i < set.pixels.size(); ++i)
      set.value[static_cast<Eigen::Index>(i)] = image(set.pixels[i][0], set.pixels[i][1]);
    sets.push_back(std::move(set));
  }
  LeastSquares problem(job_, unknowns_, plans_, std::move(sets));
  problem.set_misfit(problem_->misfit());
  SolveOptions few;
  few.max_iterations = 12;
  few.interrupted = job_.options.interrupted;
  Eigen::VectorXd searched = best_;
  problem.solve(searched, few);
  const Eigen::VectorXd change = change_of_unknowns(theta_, problem.theta());
  const Shift shift = largest_shift(change, sd);
  by_waves_ = shift.standard_errors;
  if (by_waves_ < kShiftThatMatters) return std::nullopt;
  result_.warnings.push_back(fmt::format(
      "Rays are not the image of this sample: fitted to a wave-optical image of the parameters found here, rays return {} off by {:+.2g} ({:+.2g} %, "
      "{:.3g} standard errors). The error bars contain this as the error of the model; physics.ceiling: wave does away with it.",
      job_.parameters[shift.index].name, shift.change, 100 * shift.change / theta_[static_cast<std::size_t>(shift.index)], by_waves_));
  return change;
}

/// Propagation is itself a hundredth to a twentieth of the image away from Maxwell's equations, and samples are not the field. A radial twin has an exact
/// image, too: what the others' differences from it do to the estimates, searched unknowns first, then linear ones; a column for each cause, none without waves.
Eigen::MatrixXd Fit::propagation_errors() {
  Eigen::MatrixXd shifts(unknowns_.size(), 0);
  if (stopped_ || std::none_of(plans_.begin(), plans_.end(), [](const RenderPlan& p) { return p.wave != nullptr; })) return shifts;
  std::vector<std::vector<Image>> pictures;  // of each frame, each scene of its twin
  for (const Micrograph& m : job_.micrographs) {
    const std::optional<RadialTwin> twin = radial_twin(m.scene, theta_);
    if (!twin) return shifts;
    try {
      pictures.emplace_back();
      for (const Scene& scene : twin->scenes) pictures.back().push_back(lit(m, theta_, render(scene, plan(scene, twin->theta), twin->theta, {}, job_.options.threads).intensity));
    } catch (const UserError& error) {  // too large for the series
      result_.warnings.push_back(std::string("What wave propagation errs by could not be measured on a ball of this size; the error bars do not contain it. ") + error.what());
      return shifts;
    }
  }
  const auto causes = std::max_element(pictures.begin(), pictures.end(), [](const auto& a, const auto& b) { return a.size() < b.size(); })->size() - 1;
  for (std::size_t cause = 0; cause < causes; ++cause) {
    std::vector<PixelSet> sets;
    for (int g = 0; g < frames_; ++g) {
      const std::vector<Image>& seen = pictures[static_cast<std::size_t>(g)];
      sets.push_back(pixel_set(job_.micrographs[g], sigma_[g], pixels_[g]));
      const Image fitted = fitted_image(g);
      for (std::size_t i = 0; i < sets.back().pixels.size(); ++i) {
        const auto [x, y] = sets.back().pixels[i];
        sets.back().value[static_cast<Eigen::Index>(i)] = fitted(x, y) + (cause + 1 < seen.size() ? seen[cause](x, y) - seen[cause + 1](x, y) : 0.0);
      }
    }
    LeastSquares problem(job_, unknowns_, plans_, std::move(sets));
    problem.set_misfit(problem_->misfit());
    SolveOptions few;
    few.max_iterations = 2;  // next to linear
    few.interrupted = job_.options.interrupted;
    Eigen::VectorXd searched = best_;
    problem.solve(searched, few);
    shifts.conservativeResize(Eigen::NoChange, shifts.cols() + 1);
    Eigen::Index at = 0;
    for (const std::vector<int>* part : {&unknowns_.searched, &unknowns_.linear})
      for (const int index : *part) shifts(at++, shifts.cols() - 1) = problem.theta()[static_cast<std::size_t>(index)] - theta_[static_cast<std::size_t>(index)];
  }
  return shifts;
}

/// A slow misfit, like that of uneven light, may be far below the noise of a pixel and still shift a parameter by many standard errors: what
/// the residual holds of each parameter's own pattern says by how much. It holds what `inverse` has beyond the noise as well: the larger of
/// the two counts. Returns the largest factor on a standard error.
double Fit::pay_for_misfit(const Inverse& of_noise, Inverse& inverse) const {
  const Eigen::VectorXd along = problem_->misfit_along(of_noise.covariance);
  Eigen::VectorXd factor = Eigen::VectorXd::Ones(along.size());
  for (Eigen::Index j = 0; j < along.size(); ++j)
    if (const double variance = inverse.covariance(j, j); variance > 0)
      factor[j] = std::sqrt(std::max(1.0, along[j] * along[j] * of_noise.covariance(j, j) / variance));
  inverse.covariance = factor.asDiagonal() * inverse.covariance * factor.asDiagonal();
  return factor.size() > 0 ? factor.maxCoeff() : 1;
}

void Fit::report() {
  const Eigen::MatrixXd factor = problem_->factor();
  const Inverse of_noise = invert_normal_equations(factor);
  Inverse inverse = of_noise;
  const Eigen::MatrixXd shifts = propagation_errors();
  inverse.covariance += shifts * shifts.transpose();
  const double along = pay_for_misfit(of_noise, inverse);
  result_.theta = theta_;
  result_.interrupted = (stopped_ && !beaten_) || interrupted();
  if (result_.interrupted) result_.converged = false;
  for (int g = 0; g < frames_; ++g) result_.chi_square += problem_->frame_misfit(g).chi_square;
  const double data_chi_square = result_.chi_square;
  // Priors are observations too; those between parameters in a changed weighting keep their own weight.
  result_.chi_square += problem_->prior_chi_square();
  result_.degrees_of_freedom = static_cast<int>(problem_->pixel_rows()) + problem_->prior_rows() - unknowns_.size();
  result_.reduced_chi_square = result_.chi_square / std::max(1, result_.degrees_of_freedom);

  double dof = std::max(1.0, result_.degrees_of_freedom / largest_area_);
  if (frames_scatter_) {
    dof = frame_dof_;
    result_.frame_scatter = JointPrior::FrameScatter{frame_sd_, frame_dof_};
  }
  if (along > 1) dof = std::min(dof, static_cast<double>(LeastSquares::kLeastModulations));
  if (job_.prior) {
    dof = std::min(dof, job_.prior->degrees_of_freedom);
    if (job_.prior->frame_scatter) dof = std::min(dof, job_.prior->frame_scatter->degrees_of_freedom);
  }
  result_.interval_degrees_of_freedom = dof;

  const Eigen::VectorXd sd = inverse.covariance.diagonal().cwiseMax(0).cwiseSqrt();
  const std::optional<Eigen::VectorXd> by_curved = foretell_curved_rays(sd), by_waves = foretell_waves(sd);
  for (const auto& left_out : {by_curved, by_waves})
    if (left_out) inverse.covariance += *left_out * left_out->transpose();
  result_.log_share = log_share(projected_information(*problem_), job_, unknowns_);
  result_.covariance = inverse.covariance;
  const Eigen::VectorXd inverse_sd =
      inverse.covariance.diagonal().unaryExpr([](double v) { return v > 0 ? 1 / std::sqrt(v) : 0.0; });
  result_.correlation = inverse_sd.asDiagonal() * inverse.covariance * inverse_sd.asDiagonal();
  result_.correlation.diagonal().setOnes();
  result_.covariance_kind = covariance_words();
  if (along > 1) result_.covariance_kind += fmt::format(", standard errors up to {:.2g} times larger by what the residual does along the parameters", along);
  if (!shifts.isZero(0)) result_.covariance_kind += ", and the error of wave propagation" + std::string(shifts.cols() > 1 ? " and of sampling" : "") + " by the exact image of a radial twin";
  if (by_curved) result_.covariance_kind += ", and what curved rays would change";
  if (by_waves) result_.covariance_kind += ", and what rays lose of a wave-optical image";
  report_parameters(inverse, of_noise);
  judge_identifiability(result_, job_, unknowns_, factor, of_noise);
  weigh_inputs(of_noise);
  const bool signal = judge_description(data_chi_square);
  if (!signal) result_.identifiable = false;
  report_micrographs();
  collect_warnings();
  if (unknowns_.size() == 0) result_.warnings.push_back("No parameter is marked `fit`: the image was only compared.");
  result_.evaluations = evaluations_ + problem_->evaluations();
  // Since then, too: profiles and warnings may be half done.
  if (interrupted()) result_.interrupted = true, result_.converged = false;
  result_.verdict = verdict(result_, signal);
}

/// The branch with the best odds, which reports how all of them did.
FitResult best_branch(const FitJob& job, std::vector<FitResult> results) {
  // Each fit settled its own noise: the smallest residual's is the one that all are measured by.
  const auto residual = [](const FitResult& r, const FitResult& by, bool squares_only) {
    double sum = 0, n = 0;
    for (std::size_t g = 0; g < r.micrographs.size(); ++g) {
      const std::vector<double>&v = r.micrographs[g].residual.values(), &sigma = by.micrographs[g].sigma.values();
      for (std::size_t i = 0; i < v.size(); ++i)
        if (std::isfinite(v[i]) && std::isfinite(sigma[i]) && sigma[i] > 0) sum += std::pow(v[i] / (squares_only ? 1 : sigma[i]), 2), ++n;
    }
    return std::pair(sum, n);
  };
  const auto smallest = std::min_element(results.begin(), results.end(), [&](const FitResult& a, const FitResult& b) {
    return residual(a, a, true).first < residual(b, b, true).first;
  });
  const auto [least, pixels] = residual(*smallest, *smallest, false);
  const double reduced = std::max(1.0, least / std::max(1.0, pixels - static_cast<double>(smallest->parameters.size())));
  std::vector<double> score;
  std::vector<BranchResult> branches;
  for (std::size_t b = 0; b < results.size(); ++b) {
    BranchResult branch;
    branch.name = job.branches[b].name;
    branch.chi_square = residual(results[b], *smallest, false).first;
    branch.parameters = static_cast<int>(results[b].parameters.size());
    double prior = 0;
    for (const ParameterEstimate& p : results[b].parameters)
      if (p.prior_sd && p.prior_value) prior += std::pow((p.value - *p.prior_value) / *p.prior_sd, 2);
    score.push_back(branch.chi_square / reduced + prior - 2 * results[b].log_share);
    branches.push_back(branch);
  }
  const std::size_t best = static_cast<std::size_t>(std::min_element(score.begin(), score.end()) - score.begin());
  FitResult result = std::move(results[best]);
  std::string others;
  for (std::size_t b = 0; b < branches.size(); ++b) {
    branches[b].odds = std::exp(-0.5 * (score[b] - score[best]));
    branches[b].reported = b == best;
    if (b == best) continue;
    if (branches[b].odds > kAmbiguousOdds) result.ambiguous = true;
    others += fmt::format("{}{} {:.2g}", others.empty() ? "" : ", ", branches[b].name, branches[b].odds);
    result.evaluations += results[b].evaluations;
    result.seconds += results[b].seconds;
  }
  result.verdict = fmt::format("Branch: {} (odds of the others against it: {}{}). ", branches[best].name, others,
                               result.ambiguous ? "; the image does not decide between them" : "") + result.verdict;
  result.branches = std::move(branches);
  return result;
}

/// `by_straight`, what `done` came to, or where the choice is open and curved rays matter, the fit with those.
FitResult with_chosen_rays(const FitJob& job, const Fit& done, FitResult by_straight) {
  if (!job.options.choose_rays || !(done.change_by_curved_rays() >= 1)) return by_straight;
  FitJob curved = job;
  curved.options.choose_rays = false;
  for (Micrograph& m : curved.micrographs) m.scene.rays = Rays::eikonal;
  FitResult better = fit(curved);
  for (MicrographResult& m : better.micrographs)
    m.plan.reasons.push_back(fmt::format("curved rays were chosen: they describe the image as well or better, and straight ones shift a parameter by {:.3g} standard errors", done.change_by_curved_rays()));
  better.seconds += by_straight.seconds;
  better.evaluations += by_straight.evaluations;
  return better;
}

/// A prior that the data contradict may hold the fit where they are not described at all: says what they would have without it.
void doubt_priors(const FitJob& job, FitResult& result) {
  const auto misfit = [](const FitResult& r) {
    double chi_square = 0, values = 0;
    for (const MicrographResult& m : r.micrographs) chi_square += m.chi_square, values += m.used;
    return chi_square / std::max(1.0, values - static_cast<double>(r.parameters.size()));
  };
  FitJob without = job;
  int priors = 0;
  for (int i = 0; i < without.parameters.size(); ++i)
    if (without.parameters[i].free && without.parameters[i].prior_sd) without.parameters[i].prior_sd.reset(), ++priors;
  constexpr double kBad = 4, kBetter = 0.1;
  if (priors == 0 || result.interrupted || misfit(result) < kBad) return;
  without.options.choose_rays = false;
  FitResult free = fit(without);
  result.seconds += free.seconds;
  result.evaluations += free.evaluations;
  if (free.interrupted || !free.converged || misfit(free) > kBetter * misfit(result)) return;
  std::string words;
  for (const ParameterEstimate& p : result.parameters) {
    if (!p.prior_sd || !p.prior_value) continue;
    for (const ParameterEstimate& q : free.parameters)
      if (q.name == p.name && std::abs(q.value - *p.prior_value) > 4 * std::hypot(*p.prior_sd, q.stderr_))
        words += fmt::format("{}{} = {:.4g} +- {:.2g} instead of {:.4g} +- {:.2g}{}", words.empty() ? "" : ", ", q.name, q.value, q.stderr_, *p.prior_value, *p.prior_sd, q.unit.empty() ? "" : " " + q.unit);
  }
  if (words.empty()) return;
  result.verdict = fmt::format("Data and prior contradict each other: without the prior the data's reduced chi-square falls from {:.3g} to {:.3g}, with {}. One of the two is wrong. ", misfit(result), misfit(free), words) +
                   result.verdict;
  result.identifiable = false;
}

}  // namespace

FitResult fit(const FitJob& job) {
  constexpr double kNever = std::numeric_limits<double>::infinity();
  if (job.options.choose_waves) {
    FitJob chosen = job;
    chosen.options.choose_waves = false;
    const Theta theta = job.parameters.values();
    // What a fit takes, from what one image does: some 15 evaluations with derivatives, each as dear as one image a parameter and one more,
    // and as many again for the neighbouring orders, on all threads.
    double seconds = 0;
    std::string words;
    bool series = true;
    for (const Micrograph& m : job.micrographs) {
      const WaveChoice choice = wave_choice(m.scene, theta);
      seconds += choice.seconds_an_image;
      words = choice.words;
      series = series && choice.series;
    }
    int searched = 1;
    for (int i = 0; i < job.parameters.size(); ++i) searched += job.parameters[i].free && !job.parameters[i].linear;
    const double whole = 15.0 * (series ? 20 : 1) * seconds * searched;
    if (whole > job.options.max_seconds) {
      chosen.warnings.push_back(fmt::format("{} A fit would take about {:.2g} s, more than physics.max_seconds: {:g}; rays are taken instead.", words, whole, job.options.max_seconds));
      return fit(chosen);
    }
    FitResult by_rays;
    if (!series) {  // the series costs no more than rays do
      chosen.options.choose_rays = false;
      Fit rays(chosen);
      rays.search(kNever);
      by_rays = rays.finish(false);
      if (by_rays.interrupted || rays.change_by_waves() < kShiftThatMatters) {
        if (job.branches.size() > 1 && !by_rays.interrupted) return fit(chosen);  // by rays, every branch
        for (MicrographResult& m : by_rays.micrographs)
          if (!by_rays.interrupted) m.plan.reasons.push_back(fmt::format("rays suffice: wave optics would shift no parameter by more than {:.2g} standard errors", rays.change_by_waves()));
        return by_rays;
      }
    }
    for (Micrograph& m : chosen.micrographs) m.scene.ceiling = Ceiling::wave;
    FitResult better = fit(chosen);
    better.seconds += by_rays.seconds;
    better.evaluations += by_rays.evaluations;
    return better;
  }
  if (job.branches.size() < 2) {
    Fit only(job);
    only.search(kNever);
    FitResult result = with_chosen_rays(job, only, only.finish(false));
    doubt_priors(job, result);
    return result;
  }
  // A branch whose misfit per pixel, by the same noise, is this many times the best one's has lost.
  constexpr double kBeaten = 10;
  std::vector<Fit> fits;
  std::vector<FitJob> jobs;
  std::vector<double> objectives;
  jobs.reserve(job.branches.size());  // a Fit refers to its job
  fits.reserve(job.branches.size());
  double best = kNever;
  for (const SampleBranch& branch : job.branches) {
    FitJob one = job;
    one.branches.clear();
    for (std::size_t g = 0; g < one.micrographs.size(); ++g) one.micrographs[g].scene.sample = branch.samples[g];
    for (const int index : branch.idle) one.parameters[index].free = false;
    if (job.options.progress)
      one.options.progress = [&](const std::string& line) { job.options.progress(branch.name + ": " + line); };
    jobs.push_back(std::move(one));
    fits.emplace_back(jobs.back());
    objectives.push_back(fits.back().search(kBeaten * best));
    best = std::min(best, objectives.back());
  }
  std::vector<FitResult> results;
  for (std::size_t b = 0; b < fits.size(); ++b) {
    results.push_back(with_chosen_rays(jobs[b], fits[b], fits[b].finish(objectives[b] > kBeaten * best)));
    if (results.back().interrupted) return std::move(results.back());
  }
  return best_branch(job, std::move(results));
}

}  // namespace birefit
