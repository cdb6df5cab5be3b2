#pragma once
// From an optimum to a result: errors, limits, intervals, what the image shows and what it does not, and words for all
// of it.

#include <string>

#include "fit/errors/left_out.h"
#include "fit/errors/rivals.h"
#include "fit/errors/stated.h"
#include "fit/errors/statistics.h"

namespace birefit::estimation {

/// What the standard errors are made of.
struct Covariances {
  Eigen::MatrixXd factor;          ///< triangular, of all whitened rows
  Inverse of_noise;                ///< by the weights alone
  Inverse with_misfit;             ///< and what propagation errs by, and what the residual holds along the parameters
  double along = 1;                ///< largest factor on a standard error by the latter
  Eigen::VectorXd by_discrepancy;  ///< standard deviations of all unknowns by one that is left over; empty: none
  bool discrepancy() const { return by_discrepancy.size() > 0; }
  std::string by_light;      ///< what lamp and camera do that makes a part of note of `with_misfit`; empty: nothing
  Eigen::MatrixXd of_light;  ///< all that they make of it; empty: nothing
  Stated stated;             ///< what it would be to state these otherwise is in `with_misfit`, too
};
/// `propagation`: LeftOut::propagation.
Covariances covariances_of(const Task& task, const Optimum& optimum, const Eigen::MatrixXd& propagation);
/// Adds what a discrepancy could do. After what better models would change is foretold: that is judged in units of the
/// errors without it.
void pay_for_discrepancy(const Task& task, const Optimum& optimum, Covariances& covariances);
/// Adds what numbers that nobody knows exactly could do.
void pay_for_stated(const Task& task, const Optimum& optimum, Covariances& covariances);

/// Everything that is to be said of a fit. `beaten`: another branch has won, so that this one was not finished.
FitResult report(const Task& task, Optimum& optimum, const Minima& minima, Rivals rivals, const LeftOut& left_out,
                 Covariances covariances, bool beaten);

// Parts of the report, each of which fills its members of the result.

/// Values, standard errors, limits, intervals, with the result's covariance and interval_degrees_of_freedom. Moves the
/// problem and brings it back.
void report_parameters(const Task& task, Optimum& optimum, const Inverse& of_noise, FitResult& result);
/// result.inputs: what the fit takes as exact, and what the estimates owe to it.
void weigh_inputs(const Task& task, const Optimum& optimum, const Inverse& of_noise, FitResult& result);
/// Does the model describe the images at all? False: an image without structure is as good, compared in units of the
/// misfit (an F test), with what the freedom of the model and the number of `places` the scan looked at gain by chance.
/// A model that is better than that and yet leaves most of what there is to see is not the sample's, whatever its
/// parameters' errors: result.described.
bool judge_description(const Task& task, const Optimum& optimum, double chi_square, int places, FitResult& result);
/// Where a discrepancy is left over: a model of a round sample that misses over 3 % of the contrast is no answer, nor
/// are values that it, and not noise alone, leaves next to unknown: to a tenth, or to a fifth of flat samples, whose
/// real pictures miss more. Says why in a sentence, with result.described = false; else nothing.
std::string judge_discrepancy(const Task& task, const Optimum& optimum, const Inverse& of_noise, FitResult& result);
/// The same of tables: 3 % of the range of a table's values.
std::string judge_rows(const Task& task, const Optimum& optimum, FitResult& result);
/// Those that matter beside the errors, largest first.
void keep_inputs_of_note(const Task& task, FitResult& result);
/// The part of the covariance by what is stated.
Eigen::MatrixXd stated_covariance(const Task& task, const Covariances& covariances);
/// result.stated, from those that were paid for and those that were fitted, and result.inputs by them.
void report_stated(const Task& task, const Optimum& optimum, const Covariances& covariances, FitResult& result);
/// result.derived: what is tied, and FitJob::derived. A tied number that is held at an end of what it may be is no
/// answer.
void report_derived(const Task& task, const Covariances& covariances, FitResult& result);
/// Takes nuisances out of parameters, covariance and all that goes by their order: they are in result.stated.
void leave_nuisances(const Task& task, FitResult& result);
/// Fills result.misfit: why an answer is one with misfit.
void judge_misfit(const Task& task, const Optimum& optimum, const Covariances& covariances, FitResult& result);
void report_micrographs(const Task& task, const Optimum& optimum, FitResult& result);
/// Where strips of a bar, plate or disc that the model does not describe tell different things: result.strips, a
/// warning, and a region where frames scatter far less than elsewhere and chi-square is below its median.
void compare_strips(const Task& task, const Optimum& optimum, FitResult& result);
void collect_warnings(const Task& task, const Optimum& optimum, FitResult& result);

}  // namespace birefit::estimation
