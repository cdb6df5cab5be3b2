#pragma once
// The user's mistakes. Every one of them becomes a Problem: a place, what is wrong there, what to do. Problems are
// collected, so that one run reports all of them, and thrown together as UserError (exit code 2 of the program).
// A broken contract inside birefit is an assert or std::logic_error (exit code 3); a fit without an answer is no
// error at all but data in FitResult (exit code 1).

#include <exception>
#include <string>
#include <vector>

namespace birefit {

/// A place in a file of the user's. `line` and `column` count from 1; 0 = unknown or the whole file.
struct Where {
  std::string file;
  int line = 0;
  int column = 0;
};

/// One mistake. `what` names the key and what was found and expected; `hint` says what to do (may be empty).
struct Problem {
  Where where;
  std::string what;
  std::string hint;
};

/// "drop.yaml:14:7: diameter_um = -3.2 is outside (0, 10000]; did you mean 3.2?"
std::string to_string(const Problem& problem);

/// One or more mistakes of the user's; what() is all of them, one line each.
class UserError : public std::exception {
 public:
  /// Of at least one problem.
  explicit UserError(std::vector<Problem> problems);
  /// Of the one problem that these make.
  UserError(Where where, std::string what, std::string hint = {});
  /// What it was made of, in that order.
  const std::vector<Problem>& problems() const { return problems_; }
  /// All problems as to_string() has them, one line each.
  const char* what() const noexcept override { return text_.c_str(); }

 private:
  std::vector<Problem> problems_;
  std::string text_;
};

/// Collects mistakes until the whole input has been read.
class Problems {
 public:
  /// One more, of these parts (Problem).
  void add(Where where, std::string what, std::string hint = {});
  /// All of an error that was caught.
  void add(const UserError& error);
  /// Nothing was collected.
  bool empty() const { return problems_.empty(); }
  /// In the order in which they were added.
  const std::vector<Problem>& all() const { return problems_; }
  /// Throws UserError with everything collected so far, if there is anything.
  void throw_if_any() const;

 private:
  std::vector<Problem> problems_;
};

}  // namespace birefit
