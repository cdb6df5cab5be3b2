#pragma once
// What a method answers when asked for an accuracy, and what it says about its own answer.

#include <functional>
#include <string>

#include "transport/method.h"

namespace birefit::study {

struct Answer {
  Mat2<double> transfer;
  double estimate = 0;  ///< of the relative error (Frobenius) the method stands by
  double samples = 0;   ///< of the medium
  std::string flag;     ///< why the answer must not be used; empty = it may
};

/// What a method is asked: a ray through a column, inside it or, with a host on both sides, through its faces too.
struct Question {
  const Column<double>& column;
  Ray<double> ray;
  double host_index = 0;  ///< 0: transfer(), else transmission()
};

double frobenius(const Mat2<double>& m);
double relative_distance(const Mat2<double>& m, const Mat2<double>& reference);
bool finite(const Mat2<double>& m);

/// Halves the steps of a method with a known order until the change is below `tolerance`, at most to `most` steps. The
/// changes must fall at least by half the order a halving, and the estimate is twice what then is left: a method that
/// has not begun to converge may agree with itself by accident.
Answer by_halving(const TransportMethod<double>& method, const Question& question, double tolerance, int most = 16384);
/// The diagonal method: the change under halving, and twice the amplitude that the coupling it leaves out can reach.
Answer diagonal_answer(const Question& question, double tolerance);
/// Modal: the change under halving, and what the last pass through the equation for the ratios changed, which must be
/// less than half of the pass before.
Answer modal_answer(const Question& question, double tolerance);
/// wei_norman (exponential = false) or wei_norman_exp with series of `order`: layers halved until the method's own
/// report is below `tolerance`.
Answer wei_norman_answer(bool exponential, int order, const Question& question, double tolerance);
/// ode_operator (scalar = false) or ode_scalar at `tolerance`, against itself at a tenth of it.
Answer ode_answer(bool scalar, const Question& question, double tolerance);

}  // namespace birefit::study
