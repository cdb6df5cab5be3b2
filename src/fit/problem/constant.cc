#include "fit/problem/constant.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "fit/problem/light.h"

namespace birefit::estimation {
namespace {

/// Chi-square of a constant with the uneven background of all frames that share one offset; what is stated of it is not
/// fitted.
double chi_square_of_level(const Task& task, const LeastSquares& problem, int offset) {
  constexpr int kShapes = 4;
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(kShapes, kShapes);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(kShapes), shape(kShapes);
  double squares = 0;
  for (int g = 0; g < task.frames(); ++g) {
    const Picture& m = task.picture(g);
    if (m.offset.index != offset) continue;
    const PixelSet& set = problem.pixels(g);
    for (Eigen::Index i = 0; i < set.value.size(); ++i) {
      const auto [x, y] = set.pixels[static_cast<std::size_t>(i)];
      double value = set.value[i];
      shape.setZero();
      for (const LightTerm& term : light_terms(m)) {
        if (term.of_intensity || term.effect) continue;
        const double at = term.shape_at(m.scene.view, x, y);
        const Parameter* known = term.shape && term.coefficient ? &task.job.parameters[term.coefficient] : nullptr;
        if (known && !known->free)
          value -= known->value * at;
        else
          shape[term.shape ? 1 + static_cast<int>(*term.shape) : 0] = at;
      }
      const double weight = 1 / (set.sigma[i] * set.sigma[i]);
      gram += weight * shape * shape.transpose();
      right += weight * value * shape;
      squares += weight * value * value;
    }
  }
  return std::max(0.0, squares - right.dot(gram.completeOrthogonalDecomposition().solve(right)));
}

}  // namespace

std::optional<double> chi_square_of_a_constant(const Task& task, const LeastSquares& problem) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (int g = 0; g < task.frames(); ++g) {
    const auto [l, h] = problem.intensity_range(g);
    low = std::min(low, l);
    high = std::max(high, h);
  }
  constexpr double kUniform = 1e-9;
  if (!(high - low > kUniform)) return std::nullopt;
  // Frames that share an offset share the constant; an uneven background is part of it.
  double sum = 0;
  std::set<int> done;
  for (int g = 0; g < task.frames(); ++g)
    if (const int offset = task.picture(g).offset.index; done.insert(offset).second)
      sum += chi_square_of_level(task, problem, offset);
  return sum;
}

}  // namespace birefit::estimation
