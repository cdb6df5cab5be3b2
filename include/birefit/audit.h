#pragma once
// Where fits fail, and whether they know: pictures that are nearly the model's, fitted as a job asks.

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "birefit/fit.h"

namespace birefit {

/// One picture (or all of a job's), drawn at random, disturbed and fitted.
struct AuditFit {
  std::string departure;  ///< "none" of what is exactly as stated
  std::string amount;     ///< "2.5 %"
  int size = 0;           ///< 1 to 3, small to large; 0 where the departure is none
  int problem = 0;        ///< of the sample, the same for all departures
  std::string grade;      ///< FitResult::grade()
  bool answered = false;
  /// The departure is of a stated number, by more than two of its standard deviations, and the pictures told nothing of
  /// it (a plain answer, the number not fitted): what leaves no trace cannot be found.
  bool apart = false;
  /// One searched parameter, in its unit: what the picture was made with, the estimate, its 95 % interval.
  struct Of {
    std::string name;
    double truth = 0, value = 0, low = 0, high = 0;
    /// The interval has the truth.
    bool holds() const { return low <= truth && truth <= high; }
    /// Between which 95 % of the draws from the posterior lie, where the job asks for draws (FitOptions::samples).
    std::optional<std::array<double, 2>> drawn;
    /// There are draws, and their interval has the truth.
    bool drawn_holds() const { return drawn && (*drawn)[0] <= truth && truth <= (*drawn)[1]; }
    /// Half-widths of the interval by which the value is off.
    double off() const;
  };
  std::vector<Of> parameters;  ///< searched ones, where answered
};

/// How many pictures, and which.
struct AuditOptions {
  int problems = 1;  ///< of every departure and size; three times as many of "none"
  std::uint64_t seed = 1;
  std::vector<std::string> departures;          ///< those alone, beside "none"; empty: all that apply
  std::function<void(const std::string&)> say;  ///< of every fit, from any thread
};

/// Draws the searched parameters about their values, within a quarter of the width of their bounds, the centre of a
/// picture within a pixel of where it is stated; renders by the job's own model, disturbs, adds the noise that is
/// stated (else that of the picture, else 1 % of the range), rounds to codes what is in counts, and fits as the job
/// asks, on all threads. Levels are those of the job's picture where there is one. Deterministic; ends early where the
/// job is interrupted. Throws UserError where a departure that is asked for does not apply, and of jobs with a joint
/// prior or tables of other than intensities.
std::vector<AuditFit> audit(const FitJob& job, const AuditOptions& options);
/// A departure in words: its name in AuditOptions::departures, what it is, its three sizes.
struct DepartureWords {
  std::string name, what;
  std::array<std::string, 3> amounts;
};
/// The departures that apply to a job, in the order in which audit() takes them.
std::vector<DepartureWords> departures_of(const FitJob& job);

/// Of one departure and size, without those apart.
struct AuditRow {
  std::string departure, amount;
  /// Pictures (problems), of which so many have an answer, so many of these with misfit; and those apart.
  int size = 0, problems = 0, answers = 0, with_misfit = 0, apart = 0;
  int intervals = 0, held = 0;    ///< of the answers: one for every searched parameter, and those that hold
  int drawn = 0, drawn_held = 0;  ///< of those with draws, by the draws' own
  double width = 0;  ///< median half-width over that of the same sample as stated; not a number without those
  double worst = 0;  ///< half-widths by which an estimate of an answer is off
};
/// A row for every departure and size among the fits, in their order.
std::vector<AuditRow> tally(const std::vector<AuditFit>& fits);

}  // namespace birefit
