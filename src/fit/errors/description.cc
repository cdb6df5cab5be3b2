// Does the model describe what there is to see?

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "fit/errors/report.h"
#include "fit/problem/light.h"

namespace birefit::estimation {
namespace {

/// Chi-square of a constant with the uneven background of all frames that share one offset.
double chi_square_of_level(const Task& task, const LeastSquares& problem, int offset) {
  constexpr int kShapes = 4;
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(kShapes, kShapes);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(kShapes), shape(kShapes);
  double squares = 0;
  for (int g = 0; g < task.frames(); ++g) {
    const Micrograph& m = task.micrograph(g);
    if (m.offset.index != offset) continue;
    const PixelSet& set = problem.pixels(g);
    for (Eigen::Index i = 0; i < set.value.size(); ++i) {
      const auto [x, y] = set.pixels[static_cast<std::size_t>(i)];
      shape.setZero();
      for (const LightTerm& term : light_terms(m))
        if (!term.of_intensity)
          shape[term.shape ? 1 + static_cast<int>(*term.shape) : 0] = term.shape_at(m.scene.view, x, y);
      const double weight = 1 / (set.sigma[i] * set.sigma[i]);
      gram += weight * shape * shape.transpose();
      right += weight * set.value[i] * shape;
      squares += weight * set.value[i] * set.value[i];
    }
  }
  return std::max(0.0, squares - right.dot(gram.completeOrthogonalDecomposition().solve(right)));
}

/// Of images without structure but that of uneven light; nothing where the model is one itself.
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
  for (const Micrograph& m : task.job.micrographs)
    if (done.insert(m.offset.index).second) sum += chi_square_of_level(task, problem, m.offset.index);
  return sum;
}

}  // namespace

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
