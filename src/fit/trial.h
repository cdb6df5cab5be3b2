#pragma once
// A job looked at by hand: what its fit would make of chosen values of the parameters, without searching any.

#include <memory>
#include <vector>

#include "birefit/fit.h"

namespace birefit {

/// The model at one place, as a fit of the job has it there: gain, offset and all else that is linear solved.
struct Trial {
  Theta theta;                ///< of the whole table
  std::vector<Image> fitted;  ///< of every frame (FitResult::micrographs), in units of its values
  /// as FitResult has them, by the same weights: of values and priors
  double chi_square = 0, reduced_chi_square = 0;
};

/// Tries places of one job, one at a time. Weights are those that a fit begins with, or ended with.
class Trials {
 public:
  /// By the noise of the job, stated or estimated. Throws UserError where no fit could begin.
  explicit Trials(FitJob job);
  /// By the weights, pixels, branch and physics with which the job's fit ended; what is stated and not known exactly is
  /// where that fit had it. Departures that it fitted beside the job's own parameters are left out.
  Trials(FitJob job, const FitResult& result);
  ~Trials();
  Trials(const Trials&) = delete;
  Trials& operator=(const Trials&) = delete;

  /// Table indices of the parameters that a fit searches: what at() has values of, in this order.
  const std::vector<int>& searched() const;
  /// Where the fit begins, or ended.
  const std::vector<double>& start() const;
  /// Standard deviation of every value of a frame; NaN where it takes no part.
  Image sigma(std::size_t frame) const;
  /// The job, as it is looked at.
  const FitJob& job() const;
  /// How frames are rendered now.
  const RenderPlan& plan(std::size_t frame) const;

  /// Plans anew for these values, as `birefit render` would.
  void plan_at(const std::vector<double>& values);
  /// By the plans as they are. Throws UserError, std::invalid_argument where there are more or fewer values.
  Trial at(const std::vector<double>& values);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace birefit
