// Does the model describe what there is to see?

#include <algorithm>
#include <cmath>

#include "fit/errors/report.h"
#include "fit/problem/constant.h"

namespace birefit::estimation {
bool judge_description(const Task& task, const Optimum& optimum, double chi_square, int places, FitResult& result) {
  const std::optional<double> constant = chi_square_of_a_constant(task, *optimum.problem);
  if (!constant) return true;
  const double rows = static_cast<double>(optimum.problem->pixel_rows()), reduced = std::max(1.0, chi_square / rows);
  // More than half: measured images of crystals with an uneven field leave up to 0.37 and return the right voltage, a
  // bipolar droplet taken for a radial one leaves 0.77 and returns a birefringence 6 standard errors off.
  constexpr double kMisfit = 2, kMostLeft = 0.5;
  result.left_over = *constant > rows ? (chi_square - rows) / (*constant - rows) : 0;
  result.described = !(reduced > kMisfit && result.left_over > kMostLeft);
  const double by_chance = 25 + 2 * task.unknowns.size() + 2 * std::log(std::max(1, places));
  return (*constant - chi_square) / reduced > by_chance;
}

}  // namespace birefit::estimation
