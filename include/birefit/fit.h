#pragma once
// Estimating the free parameters of scenes from micrographs: what goes in (FitJob), what comes out (FitResult).
// Method and statistics: docs/methods.md, "The fit".

#include <array>
#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "birefit/image.h"
#include "birefit/measurement.h"
#include "birefit/parameters.h"
#include "birefit/render.h"
#include "birefit/scene.h"

/// Polarized micrographs: what they would look like, and what they say about their samples.
namespace birefit {

/// How hard a fit tries, and what it may decide by itself.
struct FitOptions {
  int threads = 0;           ///< 0 = all cores
  int max_iterations = 100;  ///< of the solver, from each start
  int scan_pixels = 4000;    ///< at most, of the coarse scan, spread over all micrographs
  /// starts polished after the scan, of four times as many looked at; more where the image is described badly
  int scan_candidates = 12;
  bool leave_out_outliers = false;  ///< pixels that stand out of the residual: dust, scratches
  /// Of what pictures are known to depart by (Departure::name, or how some of them begin; "specks", "outside"), what is
  /// not asked for where something is left over: how good are errors where the list lacks something?
  std::vector<std::string> not_asked;
  /// Ceiling::wave for spheres where rays would shift a parameter, if that takes no longer than max_seconds
  bool choose_waves = false;
  double max_seconds = 60;  ///< see choose_waves
  /// Nobody will read the errors: what is stated and what pictures depart by is taken as exact.
  bool values_only = false;
  int samples = 0;           ///< draws from the posterior, for FitResult::samples
  bool choose_rays = false;  ///< straight or curved rays (Scene::rays) by what curved ones would change
  std::function<void(const std::string&)> progress;  ///< called with one line now and then; may be empty
  const std::atomic<bool>* interrupted = nullptr;    ///< set by Ctrl-C: end with the best state so far
};

/// One of several states that a sample may be in and that no parameter leads from one to the other.
struct SampleBranch {
  std::string name;             ///< "hedgehog", "ring"
  std::vector<Sample> samples;  ///< of each picture in this branch
  std::vector<int> idle;        ///< parameters that this branch does not have
};

/// A quantity that follows from numbers of a job and that nothing is rendered with: `report:` of a config.
struct Derived {
  std::string name, unit;
  Tie tie;
};

/// What is fitted to what: all that fit() needs, no files.
struct FitJob {
  ParameterTable parameters;
  std::vector<Measurement> measurements;
  Demand demand;  ///< how their scenes are computed; `options` may leave ceiling and rays to the fit
  std::vector<SampleBranch> branches;  ///< more than one: each is fitted, the best is reported
  std::optional<JointPrior> prior;
  std::vector<Derived> derived;  ///< to be worked out of the answer, with errors
  FitOptions options;
  std::vector<std::string> warnings;  ///< gathered while reading the input
  /// Sentences' parts: what is known of the pictures that makes any answer one with misfit (FitResult::misfit).
  std::vector<std::string> misfit;
  /// sentences: what nobody has stated and the model therefore takes for granted
  std::vector<std::string> taken_as_exact;
};

/// What a fit says of one free parameter; all numbers in its unit.
struct ParameterEstimate {
  std::string name, unit;
  double value = 0, stderr_ = 0;                   ///< standard error; NaN when not identifiable
  double interval95_low = 0, interval95_high = 0;  ///< Student t with FitResult::interval_degrees_of_freedom
  /// interval95 is where the profile likelihood falls as far: value +- t stderr is not that place here
  bool profiled = false;
  double start = 0, lower = 0, upper = 0;  ///< where the fit began, and the bounds it had
  std::optional<double> prior_value, prior_sd;
  bool at_bound = false;  ///< the estimate is one of the bounds
  bool linear = false;    ///< see Parameter
  /// "" or, at a physical limit, "upper" / "lower": the one-sided 95 % limit is in limit_value.
  std::string limit;
  double limit_value = 0;
};

/// What a fit says of a number that follows from others: one of FitJob::derived, or an entry of the table that is tied.
struct DerivedEstimate {
  std::string name, unit, expression;
  bool tied = false;  ///< an entry of the table, by its name
  /// Its expression is outside of what it may be (`expected`), and it was held at the end: no answer.
  bool held = false;
  double expected = 0;
  /// Standard error to first order, with what parameters and stated numbers have in common; NaN where one of the
  /// parameters is not known.
  double value = 0, stderr_ = 0;
  double interval95_low = 0, interval95_high = 0;
  Eigen::VectorXd by;  ///< d(value)/d(parameters), in the order of FitResult::names
};

/// Odds of another minimum, or branch, above which the answer is called ambiguous.
inline constexpr double kAmbiguousOdds = 0.01;

/// Another minimum the data cannot exclude.
struct RivalMinimum {
  Theta theta;
  double chi_square = 0;
  /// Of its evidence against the reported minimum's: likelihood_ratio times the ratio of the shares of the bounds that
  /// either takes up.
  double odds = 0;
  /// exp(-delta chi-square / 2 / max(1, reduced chi-square)); above 1 where the reported minimum owes its odds to its
  /// width
  double likelihood_ratio = 0;
  /// Makes the answer ambiguous: odds or likelihood_ratio above kAmbiguousOdds; among a sphere's ripples odds alone,
  /// and not within two standard errors of the reported minimum.
  bool counts = true;
};

/// How one branch of the sample did.
struct BranchResult {
  std::string name;
  double chi_square = 0;  ///< all branches by the noise of the best one
  int parameters = 0;     ///< free ones
  /// of its evidence against the reported branch's: exp(-difference of (chi-square / max(1, reduced) + priors' - 2
  /// log_share) / 2)
  double odds = 0;
  bool reported = false;
};

/// One eigen-direction of the scaled Fisher matrix (each parameter in units of its start range or value).
struct FisherDirection {
  std::vector<std::pair<std::string, double>> weights;  ///< unit vector, scaled
  double stderr_ = 0;                                   ///< of the scaled combination
  bool identifiable = true;
  std::string words;  ///< "birefringence up 0.01 with diameter_um down 0.4: only their combination is known ..."
};

/// What became of one frame: a picture, or a table's row, or its rings, as an image of as many pixels.
struct MicrographResult {
  std::string name;
  Image fitted;      ///< in units of the micrograph's values
  Image residual;    ///< values - fitted; NaN where not used
  Image sigma;       ///< standard deviation used for whitening
  int used = 0;      ///< pixels
  int outside = 0;   ///< usable pixels that the sample takes out: around a disc's forces, along its rim and beyond
  int outliers = 0;  ///< pixels left out because they stood out of the residual (FitOptions::leave_out_outliers)
  double chi_square = 0;
  double residual_rms = 0;  ///< units of the values
  double signal_range = 0;  ///< of the fitted values, for judging the rms; of a one-pixel row, its table's
  NoiseModel noise;
  RenderPlan plan;
};

/// What the estimates hang on: an input that the fit takes as exact and all micrographs share, or that is stated, and
/// what `step` more of it would do to them.
struct InputEffect {
  std::string name, unit;
  double value = 0, step = 0;  ///< step: 1 deg, 1 px, else 1 % of the value
  double known_to = 0;         ///< standard deviation that is in the errors; 0: taken as exact
  std::vector<double> shift;   ///< of FitResult::parameters, to first order
};

/// A number that is stated and that nobody knows exactly (Parameter::known_to).
struct StatedNumber {
  std::string name, unit;
  double stated = 0, known_to = 0;  ///< and its standard deviation
  bool fitted = false;              ///< pictures tell it: a nuisance beside the parameters; else by its derivative
  double value = 0, stderr_ = 0;    ///< where fitted
  std::string most_of;              ///< the searched parameter whose variance it makes most of
  double share = 0;                 ///< of that variance, where not fitted
  /// Standard deviations by which pictures want it elsewhere.
  double away() const { return fitted && known_to > 0 ? (value - stated) / known_to : 0; }
};
/// A departure of the picture from the model that was fitted since something was left over (docs/methods.md, "Nearly
/// the model"). Light and background: shares of the gain at the picture's edge; blur: variance (px^2), < 0: sharpened;
/// gamma: light to the power of 1 + gamma; curve: light times 1 + curve (light - 1); stretch: share by
/// which the picture is wider, and as much lower (or longer along the diagonal from its upper left, as much narrower
/// across).
struct Departure {
  std::string name, unit;
  std::string words;  ///< how a picture looks that has it: "light that grows to the right by"
  double value = 0, stderr_ = 0;
  double usual = 0;  ///< standard deviation among pictures that are nearly the model
};
/// Beyond so many standard deviations pictures contradict what was stated.
inline constexpr double kContradicted = 3;

/// A strip of a bar, plate or disc by itself, the rest of the image left out.
struct Strip {
  std::array<int, 4> roi_px{};  ///< columns and rows x0, y0, x1, y1, ends exclusive
  /// standard deviation of its frames' mean residuals, of the model intensity; 0 of one frame
  double frame_scatter = 0;
  double reduced_chi_square = 0;  ///< about its own fit, by noise alone
  /// searched parameters by a few steps from the fit of the whole; errors with its own misfit
  std::vector<double> value, stderr_;
};

/// The scan before the solver: objective along one parameter (for the report's chart).
struct ScanTrace {
  std::string name;
  std::vector<double> value, chi_square;
};

/// A step of the solver (for the report).
struct Iteration {
  int number = 0;
  double chi_square = 0, step = 0;  ///< step: its norm, as Ceres states it
};

/// The objective with one parameter held and all others at their best (for the report's chart).
struct ProfileTrace {
  std::string name;
  std::vector<double> value, rise;  ///< rise: above the reported minimum, as chi-square with the fit's weights
};

/// Fits of images simulated at the estimate, each from the job's own start (`fit --coverage`).
struct Coverage {
  int draws = 0;
  bool of_residuals = false;  ///< the simulated noise is the fit's residual, drawn in blocks; else the noise model's
  int answered = 0;           ///< fits with an answer; the others said that they have none
  int wrong = 0;              ///< answered, with a searched parameter more than 5 standard errors off: what must not be
  /// How the intervals of one searched parameter did.
  struct Of {
    std::string name;
    /// fractions of the answered fits whose interval holds the value simulated with
    double inside68 = 0, inside95 = 0;
    double spread = 0;  ///< standard deviation of the estimates over the mean standard error
    double bias = 0;    ///< mean error over the mean standard error
  };
  std::vector<Of> parameters;
};

/// Draws from the posterior (FitOptions::samples; docs/methods.md, "Samples").
struct Samples {
  Eigen::MatrixXd values;      ///< a draw a row, in the order of FitResult::parameters
  double autocorrelation = 1;  ///< integrated, of the slowest parameter, in steps of every walker
  double effective = 0;        ///< so many independent draws tell as much of that parameter
  double accepted = 1;         ///< share of the proposals
  /// The draws of one parameter, in its unit.
  struct Of {
    std::string name;
    double median = 0, low = 0, high = 0;  ///< 2.5 and 97.5 % of the draws lie below
  };
  std::vector<Of> parameters;
};

/// What a fit found, how well it knows it, and whether it is an answer at all. A fit without an answer is no error.
struct FitResult {
  bool converged = false;    ///< the solver ended at a minimum
  bool interrupted = false;  ///< ended early by FitOptions::interrupted, with the best state so far
  bool ambiguous = false;    ///< by a rival that counts, or a branch with odds above kAmbiguousOdds
  bool identifiable = true;  ///< the images determine every searched parameter, alone and in combination
  bool pinned = false;       ///< at a bound that is no physical limit
  /// false: the model leaves more than half of what the images show beyond their noise; or, of one picture of a droplet
  /// or shell, misses so much that its values are worth little (docs/methods.md, "Nearly the model")
  bool described = true;
  /// that share: 0 a perfect model, 1 no better than a constant image (below 0 by chance; 0 too where there is nothing
  /// to compare with)
  double left_over = 0;
  /// An answer all the same, but what noise does not explain is left over, or what was stated is contradicted: why, in
  /// sentences. Empty: a plain answer.
  std::vector<std::string> misfit;
  std::vector<ParameterEstimate> parameters;  ///< free ones in table order: searched first, then linear
  std::vector<DerivedEstimate> derived;       ///< tied entries, then FitJob::derived
  std::vector<std::string> names;             ///< order of correlation and covariance
  Eigen::MatrixXd covariance, correlation;    ///< parameters' own units
  Eigen::MatrixXd stated_covariance;  ///< the part by what is stated, lamp and camera: common to fits of one set-up
  /// "white noise" | "scaled by reduced chi-square" | "clustered by image" | ..., in words
  std::string covariance_kind;
  double interval_degrees_of_freedom = 0;         ///< of the t quantile behind interval95
  double chi_square = 0, reduced_chi_square = 0;  ///< of values and priors; reduced: over degrees_of_freedom
  int degrees_of_freedom = 0;                     ///< values that were used and priors, less the free parameters
  std::optional<JointPrior::FrameScatter> frame_scatter;  ///< several images in one fit
  /// ln of the share of the bounds that the answer takes up: its highest likelihood times this share is the branch's
  /// evidence
  double log_share = 0;
  std::vector<RivalMinimum> rivals;
  std::vector<BranchResult> branches;  ///< empty unless the job had several
  std::vector<FisherDirection> directions;
  /// those that shift a searched parameter by a tenth of its standard error or more; largest first
  std::vector<InputEffect> inputs;
  /// What is stated and not known exactly, and is in the errors; those that matter most first.
  std::vector<StatedNumber> stated;
  std::vector<Departure> departures;  ///< empty unless something was left over
  std::vector<Strip> strips;          ///< empty where strips agree, or the sample has none
  /// columns and rows as Strip::roi_px: strips in which frames agree far better than elsewhere and the model no worse;
  /// a proposal
  std::optional<std::array<int, 4>> trusted_px;
  std::vector<MicrographResult> micrographs;
  std::vector<ScanTrace> scans;
  std::vector<ProfileTrace> profiles;  ///< of the parameters whose interval is `profiled`
  std::optional<Coverage> coverage;    ///< filled by whoever asked for measure_coverage()
  std::optional<Samples> samples;      ///< where draws were asked for and the parameters have a posterior
  std::vector<Iteration> iterations;
  int evaluations = 0;                ///< of the model, all images together
  double seconds = 0;                 ///< of wall time
  std::vector<std::string> warnings;  ///< sentences; empty when there is nothing to warn of
  /// sentences: what the model takes for granted wherever such a sample is fitted so
  std::vector<std::string> taken_as_exact;
  std::string verdict;        ///< one paragraph in words
  std::string solver_report;  ///< Ceres' own
  Theta theta;                ///< full table at the optimum

  /// True when the run deserves exit code 0.
  bool has_answer() const { return converged && !ambiguous && identifiable && !pinned && described && !interrupted; }
  /// "answer", "answer with misfit", or why there is none: "not converged", "not described", "ambiguous", "not
  /// identifiable", "at a bound".
  std::string grade() const;
};

/// Estimates every free parameter; of several branches, those of the one with the best odds, and `ambiguous` when
/// another has odds above kAmbiguousOdds. Deterministic: same job, same bits, whatever the number of threads. A job
/// without usable pixels throws UserError; everything about the data's quality is in the result.
FitResult fit(const FitJob& job);

/// Does the interval hold what it says? `draws` images simulated at `result`, fitted as `job` asks, on all threads.
/// Where the fit's misfit exceeds its noise, its residuals serve as noise, in blocks drawn with replacement and turned
/// in sign, so that what neighbouring pixels share stays shared. Deterministic. Ends early, with fewer draws, when
/// interrupted.
Coverage measure_coverage(const FitJob& job, const FitResult& result, int draws);

/// What images of the job's scenes tell of its free parameters, at their start values: before a fit, or before the
/// image is taken.
struct Outlook {
  std::vector<ParameterEstimate> parameters;  ///< value = start, stderr_ = Cramer-Rao bound (NaN: not determined)
  std::vector<FisherDirection> directions;
  bool identifiable = true;
  std::string noise;  ///< where the noise comes from, in words
};
/// Micrographs may be without values: then their scene's view counts, the noise model given, or else 1 % of the image's
/// range.
Outlook outlook(const FitJob& job);

/// One more image beside the job's own, with a gain and an offset of its own.
struct Shot {
  std::string words;   ///< "analyser turned by 45 deg"
  double stderr_ = 0;  ///< of the parameter asked for, with the job's images and this one
};
/// Which image to take next: candidates, best first; "the same again" is among them. Throws UserError when `parameter`
/// is not a free parameter of the job (suggests the nearest) or the job is a table of signals.
std::vector<Shot> next_shots(const FitJob& job, const std::string& parameter);

}  // namespace birefit
