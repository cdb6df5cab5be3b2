#pragma once
// The weighted least-squares problem behind a fit: pixels, weights, priors; gain and offset solved exactly inside
// (variable projection: Golub & Pereyra, SIAM J. Numer. Anal. 10, 413 (1973); the projected Jacobian is Kaufman's,
// BIT 15, 49 (1975): exact gradient, second-order term of the Hessian dropped); Ceres over what remains.

#include <array>
#include <atomic>
#include <exception>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <Eigen/Dense>

#include "birefit/fit.h"
#include "fit/problem/light.h"
#include "fit/problem/pixels.h"
#include "fit/problem/task.h"

namespace birefit::estimation {

/// What a micrograph's misfit does to its weights beyond the noise of its pixels. Its residual's generalised mean
/// gets the variance of the noise plus `mean_sd`^2, everything else its variance times `shape_variance`. In a fit of
/// frames the mean of each frame is one observation, however many pixels it has.
struct Misfit {
  double mean_sd = 0;  ///< units of the values
  double shape_variance = 1;
  bool mean_follows_shape = true;  ///< nothing is known of the mean's misfit: it is scaled like the rest
};

struct SolveOptions {
  int max_iterations = 100;
  double function_tolerance = 1e-12;  ///< relative change of the objective
  double least_gain = 0;              ///< of chi-square, that a step has to be worth for another to follow
  int held = -1;                      ///< a searched unknown that stays where it is
  const std::atomic<bool>* interrupted = nullptr;
  std::function<void(const std::string&)> progress;
  std::vector<Iteration>* iterations = nullptr;  ///< appended to
  std::string label;                             ///< of progress lines
};
struct SolveSummary {
  bool converged = false;
  bool interrupted = false;
  std::string report;
};

/// Whitened rows in a fixed order (micrograph by micrograph, then priors), evaluated at one point at a time.
class LeastSquares {
 public:
  /// `plans` and `pixels` of every sight of the task, which has to outlive the problem.
  LeastSquares(const Task& task, std::vector<RenderPlan> plans, std::vector<PixelSet> pixels);

  int searched_size() const { return static_cast<int>(unknowns_.searched.size()); }
  void set_misfit(const std::vector<Misfit>& misfit);
  const std::vector<Misfit>& misfit() const { return misfit_; }

  /// Renders, solves the linear unknowns, fills the residual and (derivatives = true) the Jacobian.
  void evaluate(const Eigen::VectorXd& searched, bool derivatives);
  /// Minimises from `searched`, which becomes the optimum; leaves the problem evaluated there with derivatives.
  SolveSummary solve(Eigen::VectorXd& searched, const SolveOptions& options);

  // At the last evaluated point:
  double objective() const { return residual_.squaredNorm(); }  ///< priors and misfit weights included
  const Theta& theta() const { return theta_; }
  /// Inverse covariance of the linear unknowns where the searched ones are known, by the weights and priors.
  const Eigen::MatrixXd& linear_information() const { return linear_information_; }
  /// Whitened, the priors' rows last; whitened model less value.
  const Eigen::VectorXd& residual() const { return residual_; }
  /// Of the rows of residual() by the searched unknowns, the linear ones held; after evaluate() with derivatives.
  const Eigen::MatrixXd& searched_columns() const { return searched_columns_; }
  const Eigen::VectorXd& intensity() const { return intensity_; }  ///< of the model, every pixel of every frame
  int evaluations() const { return evaluations_; }
  /// Noise-whitened residual sums of one micrograph, its misfit weights not applied.
  struct FrameMisfit {
    double chi_square = 0;                   ///< sum of (residual / noise sd)^2
    double mean_chi_square = 0;              ///< its part along the generalised mean
    double mean_whitened = 0;                ///< generalised mean residual over its noise standard deviation
    double mean_noise_sd = 0;                ///< that standard deviation, units of the values
    double mean_residual = 0;                ///< units of the values
    double mean_light = 0;                   ///< generalised mean of gain times intensity, units of the values
    Eigen::VectorXd mean_jacobian_whitened;  ///< d mean_whitened / d unknown (searched first)
  };
  FrameMisfit frame_misfit(int micrograph) const;
  const PixelSet& pixels(int micrograph) const { return frames_[micrograph].set; }
  /// Whitened residual of one micrograph without its misfit weights, in the pixels' order.
  Eigen::VectorXd noise_whitened_residual(int micrograph) const;
  /// what(first, rows, residual) for some thousand pixels of one micrograph at a time, from its pixel `first` on: the
  /// whitened rows [d/d searched, d/d linear] and the whitened residual, both without its misfit weights. Only where
  /// its mean has the weight of all else (Misfit::mean_follows_shape).
  void for_noise_whitened_rows(
      int micrograph,
      const std::function<void(Eigen::Index, const Eigen::MatrixXd&, const Eigen::VectorXd&)>& what) const;
  /// Triangular factor of all whitened rows [d/d searched, d/d linear], priors included (`with_priors`).
  Eigen::MatrixXd factor(bool with_priors = true) const;
  /// Gradient of the objective with respect to every unknown.
  Eigen::VectorXd gradient() const;
  /// By how much the residual enlarges the standard error of each unknown, `covariance` being that of all unknowns
  /// after the weights; 1 where it holds no more of what shifts the unknown than white noise does. In the whole image
  /// the fit leaves nothing of it; modulated by cosines over the image, and along the distance from the sample's
  /// centre, the residual tells what was there: the orthonormal-series estimate of a long-run variance (U. K. Mueller,
  /// J. Econometrics 141, 1331 (2007); Y. Sun, Econometrics J. 14, 345 (2011)). Micrographs below 32 x 32 pixels are
  /// not looked at.
  Eigen::VectorXd misfit_along(const Eigen::MatrixXd& covariance) const;
  static constexpr int kLeastModulations = 8;
  /// d(intensity of every pixel)/d(table entry), a column each, at the last evaluated point.
  Eigen::MatrixXd intensity_by(const std::vector<int>& table_indices);
  /// By how much the unknowns at the optimum change when the model's intensity does by this at every pixel; to first
  /// order.
  Eigen::VectorXd shift_by(const Eigen::VectorXd& intensity_change, const Eigen::MatrixXd& covariance) const;
  /// What the rows have in common with further columns, d(intensity of every pixel)/d(something else), by the weights
  /// of the problem: the columns among themselves, with the unknowns' (searched first) and with the residual.
  struct Beside {
    Eigen::MatrixXd among, with_unknowns;
    Eigen::VectorXd with_residual;
  };
  Beside beside(Eigen::MatrixXd intensity_columns) const;
  /// Of the model intensity over all used pixels of a micrograph.
  std::array<double, 2> intensity_range(int micrograph) const;
  /// Sum of squares of the prior rows.
  double prior_chi_square() const;
  int prior_rows() const { return static_cast<int>(prior_root_.rows()); }
  Eigen::Index pixel_rows() const { return pixel_rows_; }

  /// Triangular factor of the rows [d/d searched, residual] of the projected problem (the linear unknowns follow),
  /// priors included, the searched unknowns in units of `scale`: all that a step of the solver needs to know of a
  /// million rows.
  Eigen::MatrixXd projected_factor(const Eigen::VectorXd& scale) const;

 private:
  struct Term : LightTerm {
    int unknown = -1;           ///< index among the linear unknowns, -1 = known or searched
    int searched = -1;          ///< index among the searched unknowns, where a task searches it after all
    Eigen::VectorXd at_pixels;  ///< the shape, or what the effect does; empty where it is 1
    Eigen::VectorXd whitened;   ///< what the coefficient stands before
  };
  struct Frame {
    PixelSet set;
    Eigen::VectorXd inverse_sigma;
    double inverse_sigma_norm = 0;
    double shared = 0;  ///< PixelSet::shared_sd over the noise of the mean
    Eigen::Index begin = 0, count = 0;
    std::vector<int> read;  ///< searched unknowns that its scene reads, or what it reads follows from
    std::vector<int> tied;  ///< table indices of what it reads and is tied
    std::set<int> direct;   ///< table indices of all that it reads
    std::vector<Term> terms;
    double shape_factor = 1, mean_factor = 1;  ///< whitening of the parts across and along the mean
    double intensity_low = 0, intensity_high = 0;
    Rendering rendering;  ///< kept for its memory
  };
  void render_frame(std::size_t frame, bool derivatives, bool known, int threads);
  void render_frames(const Eigen::VectorXd& searched, bool derivatives);
  using ColumnOf = std::function<Eigen::Ref<Eigen::VectorXd>(std::size_t)>;
  void render_used(std::size_t frame, const std::vector<int>& active, int threads,
                   Eigen::Ref<Eigen::VectorXd> intensity, const ColumnOf& derivative);
  void render_tied(std::size_t frame, const std::vector<int>& wanted, int threads,
                   Eigen::Ref<Eigen::VectorXd> intensity, const ColumnOf& derivative);
  template <class Body>
  void for_frames(const Body& body);
  Eigen::VectorXd light(const Frame& frame, bool of_intensity, Eigen::Index begin, Eigen::Index rows) const;
  void whiten(const Frame& frame, Eigen::Ref<Eigen::MatrixXd> columns, int threads) const;
  template <class Columns>
  void add_products(const Frame& frame, int threads, const Columns& columns, Eigen::MatrixXd& gram,
                    Eigen::MatrixXd& cross) const;
  void set_priors();
  void set_effects(Frame& frame, const Eigen::Ref<const Eigen::VectorXd>& intensity) const;
  void to_values(const Frame& frame, Eigen::Ref<Eigen::MatrixXd> columns, const std::vector<int>& searched,
                 int threads) const;
  void solve_linear();
  /// Some thousand rows of one micrograph, or the priors'.
  struct Tile {
    int micrograph = 0;  ///< -1 = priors
    Eigen::Index begin = 0, count = 0;
  };
  Eigen::MatrixXd full_rows(const Tile& tile) const;
  template <class Rows>
  Eigen::MatrixXd factor_of(Eigen::Index columns, const Rows& rows_of) const;

  const Task& task_;
  const FitJob& job_;
  const Unknowns& unknowns_;
  std::vector<RenderPlan> plans_;
  std::vector<Frame> frames_;
  std::vector<Misfit> misfit_;
  std::vector<Tile> tiles_;
  Eigen::Index pixel_rows_ = 0;
  Eigen::MatrixXd prior_root_;      ///< whitening of all unknowns' deviation from the prior means
  Eigen::VectorXd prior_target_;    ///< prior_root_ * means
  std::vector<bool> student_;       ///< of each of those rows: with the tails of Student's t
  std::vector<bool> linear_prior_;  ///< and about a linear unknown
  Eigen::VectorXd prior_slope_;     ///< d(residual of the row)/d(its deviation), at the last evaluated point; else 1

  Theta theta_;
  Eigen::VectorXd intensity_;  ///< raw
  /// d intensity / d searched and, last, the intensity where derivatives were asked for last: a solver ends where it
  /// looked before its last step, and between two fits from there weights have changed, not the sample. Kept unless it
  /// would take much memory.
  Eigen::MatrixXd rendered_;
  std::optional<Eigen::VectorXd> rendered_at_;
  Eigen::VectorXd whitened_value_;
  Eigen::MatrixXd linear_information_;
  Eigen::VectorXd residual_;
  Eigen::MatrixXd searched_columns_;  ///< d whitened model / d searched, linear unknowns held
  Eigen::MatrixXd projection_;        ///< linear x searched: how the linear unknowns follow the searched ones
  bool has_derivatives_ = false;
  int evaluations_ = 0;
};

}  // namespace birefit::estimation
