#pragma once
// Every number of a scene that may vary is an entry of one table; a scene holds references into it, a render reads a
// plain vector theta. Whether an entry is free is a property of the fit, never of the scene.

#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Dense>

#include "birefit/error.h"

namespace birefit {

class Expression;  // birefit/expression.h

/// How well a number is known that is stated and not fitted: a standard deviation of so much and such a share of the
/// value; exact where both are 0.
struct Uncertainty {
  /// sd in the unit of the value, share of its magnitude; both >= 0.
  double sd = 0, share = 0;
  /// The standard deviation of a number with this value, in its unit.
  double of(double value) const { return sd + share * (value < 0 ? -value : value); }
};

/// What to do with a number: the forms of docs/configuration.md.
struct Parameter {
  std::string name;                                         ///< config path, e.g. "sample.droplet.diameter_um"
  std::string unit;                                         ///< "um", "deg", "V", "K", "px" or "" (dimensionless)
  double value = 0;                                         ///< start of a fit, and what `render` uses
  bool free = false;                                        ///< estimated by the fit
  bool automatic = false;                                   ///< `fit: auto`: start (and bounds) come from the image
  double lower = -std::numeric_limits<double>::infinity();  ///< fit bound
  double upper = std::numeric_limits<double>::infinity();   ///< fit bound
  std::optional<double> prior_sd;                           ///< Gaussian prior centred on `value`
  /// A bound that equals one of these is a physical limit (a length of zero, a pure number range), so that a fit
  /// pinned there is an honest one-sided limit and not a failure.
  double physical_lower = -std::numeric_limits<double>::infinity();
  double physical_upper = std::numeric_limits<double>::infinity();
  bool linear = false;  ///< gain or offset: solved exactly inside the fit, never searched
  /// Of a number that is not fitted: it enters every error, by its derivative or, where pictures tell it themselves, as
  /// a nuisance (docs/methods.md, "What nobody knows exactly"). Of a gain that pictures share: first to last, a drift.
  Uncertainty known_to;
  /// Free for that reason alone: `prior_sd` has the tails of Student's t with four degrees of freedom, which let go of
  /// what pictures contradict.
  bool nuisance = false;
  Where where;  ///< where the config gives it
};

/// Values of a whole ParameterTable, in its order and each in its unit.
using Theta = std::vector<double>;

/// Index into a ParameterTable. Default-constructed = "not given" (the scene part documents what that means).
struct ParameterRef {
  int index = -1;  ///< from 0; < 0: not given
  /// The scene has times * parameter + plus: places are stated in the pixels of a file, of which a picture may have a
  /// part, or means of several.
  double times = 1, plus = 0;

  /// It is given.
  explicit operator bool() const { return index >= 0; }
  /// The same parameter, whatever the scene makes of it.
  friend bool operator==(ParameterRef a, ParameterRef b) { return a.index == b.index; }
  /// What the scene has.
  double in(const Theta& theta) const { return times * theta.at(static_cast<std::size_t>(index)) + plus; }
  /// The parameter of which the scene has this.
  double stated(double in_scene) const { return (in_scene - plus) / times; }
  /// A scene that has `by` times what this one has, and `more`.
  ParameterRef seen(double by, double more) const { return {index, by * times, by * plus + more}; }
};

/// A number that follows from others: an expression, its units settled, and the entries that its names stand for.
struct Tie {
  std::shared_ptr<const Expression> law;
  std::vector<int> of;  ///< table indices, in the order of the expression's names
};

/// d(number)/d(table[index]).
struct TieSlope {
  int index = -1;
  double by = 0;
};

/// The numbers of a job, each known by its index, which stays as others are added, and by its name.
class ParameterTable {
 public:
  /// Appends an entry and returns its place; of entries with one name find() has the first.
  ParameterRef add(Parameter parameter);
  /// A number that is fixed and has no config path of its own (defaults).
  ParameterRef add_constant(std::string name, double value, std::string unit = {});

  /// Entries, constants among them.
  int size() const { return static_cast<int>(parameters_.size()); }
  /// The entry referred to; throws std::out_of_range where the reference is empty or not of this table.
  Parameter& operator[](ParameterRef ref) { return parameters_.at(ref.index); }
  /// The same, to read.
  const Parameter& operator[](ParameterRef ref) const { return parameters_.at(ref.index); }
  /// The entry at an index from 0; throws std::out_of_range beyond the table.
  Parameter& operator[](int index) { return parameters_.at(index); }
  /// The same, to read.
  const Parameter& operator[](int index) const { return parameters_.at(index); }
  ParameterRef find(const std::string& name) const;  ///< empty when absent
  /// Parameter::value of every entry, what is tied worked out: what a render starts from.
  Theta values() const;

  /// From now on the entry follows from others, which may be tied themselves, before it. It is not free, and its
  /// `lower` and `upper` are what it may be. Scenes know nothing of ties: they read what follow() has written.
  void tie(int index, Tie tie);
  /// The tied entries, each behind those that it follows from.
  std::vector<int> tied() const;
  /// What the entry follows from; null where it is not tied.
  const Tie* tie_of(int index) const;
  /// Works out what is tied, from the rest of `theta`. Where the expression leaves what an entry may be, the entry
  /// stays at that end; where it is no number, at Parameter::value.
  void follow(Theta& theta) const;
  /// The expression's own value at `theta`, wherever it is.
  double value_of(const Tie& tie, const Theta& theta) const;
  /// A tied entry whose expression is outside of what it may be, or no number.
  bool is_held(int index, const Theta& theta) const;
  /// Derivatives of an entry by all that are not tied and move it, exact: of a tied one by the chain rule, none where
  /// it is held; of any other, 1 by itself.
  std::vector<TieSlope> slopes(int index, const Theta& theta) const;
  /// The same of a number that is no entry.
  std::vector<TieSlope> slopes(const Tie& tie, const Theta& theta) const;
  /// The entries that are not tied and that this one follows from, ascending; of one that is not tied itself.
  std::vector<int> roots(int index) const;
  /// Least and largest value of an entry as far as its bounds, or those of what it follows from, go: at their corners.
  std::pair<double, double> reach(int index) const;

 private:
  std::vector<Parameter> parameters_;
  std::vector<std::pair<int, Tie>> ties_;
  std::map<int, std::size_t> tie_at_;  ///< of which entry, where in ties_
};

/// A joint Gaussian prior from an earlier fit (docs/configuration.md, `prior:`).
struct JointPrior {
  std::string source;              ///< file it came from, for the report
  std::vector<std::string> names;  ///< parameters of this fit, in the order of mean and covariance
  Eigen::VectorXd mean;            ///< in the parameters' own units, as is the covariance
  Eigen::MatrixXd covariance;
  double degrees_of_freedom = std::numeric_limits<double>::infinity();  ///< of the fit that made it: Student t
  /// What one whole frame is off by, as the earlier fit measured it between its frames (FitResult::frame_scatter);
  /// nothing when it had a single frame.
  struct FrameScatter {
    /// of an error added to the model intensity of every pixel of a frame (residual / |gain|)
    double intensity_sd = 0;
    double degrees_of_freedom = 0;
  };
  std::optional<FrameScatter> frame_scatter;
};

}  // namespace birefit
