// Frame by frame: how much larger than noise the misfit is, over how many pixels it is shared, and how the frames'
// means scatter. The scatter is a random effect with equal variance for every frame: each frame's mean residual is one
// observation, its variance solves sum e_g^2 / (tau^2 + s_g^2) = degrees of freedom (Mandel & Paule, Anal. Chem. 42,
// 1194 (1970)), and the t quantile counts frames. A cluster-robust sandwich (Liang & Zeger, Biometrika 73, 13 (1986))
// of five frames and three parameters would be half its size too small: the normal equations make its scores nearly
// zero.

#include <algorithm>
#include <cmath>
#include <map>

#include "fit/errors/statistics.h"
#include "fit/weights/settle.h"

namespace birefit::estimation {
namespace {

using FrameSums = std::vector<LeastSquares::FrameMisfit>;

/// Degrees of freedom left to the frames' means.
double freedom_of_means(const Task& task, const Optimum& optimum, const FrameSums& frames) {
  if (frames.size() < 2) return 0;
  const Eigen::MatrixXd covariance = invert_normal_equations(optimum.problem->factor()).covariance;
  double dof = 0;
  for (int g = 0; g < task.frames(); ++g) {
    const auto& frame = frames[static_cast<std::size_t>(g)];
    const Misfit& now = optimum.problem->misfit()[static_cast<std::size_t>(g)];
    const double ratio = now.mean_sd / frame.mean_noise_sd;
    const double factor = now.mean_follows_shape ? 1 / now.shape_variance : 1 / (1 + ratio * ratio);
    const Eigen::VectorXd& row = frame.mean_jacobian_whitened;
    dof += 1 - std::clamp(factor * row.dot(covariance * row), 0.0, 1.0);
  }
  return dof;
}

/// Pixels that share one misfit, of a frame's residual without its mean where that is another observation.
double shared_area(const Task& task, const Optimum& optimum, const LeastSquares::FrameMisfit& frame, int g,
                   bool mean_known) {
  const Micrograph& micrograph = task.micrograph(g);
  Image whitened(micrograph.values.width(), micrograph.values.height());
  Mask mask(whitened.width(), whitened.height());
  const PixelSet& set = optimum.problem->pixels(g);
  Eigen::VectorXd residual = optimum.problem->noise_whitened_residual(g);
  if (mean_known) residual.array() -= frame.mean_residual / set.sigma.array();
  for (Eigen::Index i = 0; i < residual.size(); ++i) {
    const auto [x, y] = set.pixels[static_cast<std::size_t>(i)];
    whitened(x, y) = residual[i];
    mask(x, y) = 1;
  }
  return correlation_area(whitened, mask);
}

/// The excess over noise of each frame's residual, in its weights.
void weigh_shapes(const Task& task, const Optimum& optimum, const FrameSums& frames, bool own_scatter,
                  std::vector<Misfit>& misfit, MisfitFound& found) {
  const double pixels = static_cast<double>(optimum.problem->pixel_rows());
  found.beyond_noise = false;
  found.largest_area = 1;
  for (int g = 0; g < task.frames(); ++g) {
    const auto& frame = frames[static_cast<std::size_t>(g)];
    Misfit& own = misfit[static_cast<std::size_t>(g)];
    const double n = frame.mean_noise_sd > 0 ? static_cast<double>(optimum.problem->pixels(g).value.size()) : 0;
    const bool mean_known = own_scatter || !own.mean_follows_shape;
    const double mean_part = mean_known ? frame.mean_whitened * frame.mean_whitened : 0;
    const double reduced = (frame.chi_square - mean_part) / std::max(1.0, n * (1 - task.unknowns.size() / pixels));
    // White noise stays below this in all but 1 of 3 million images: exact errors stay exact.
    const double sampling = std::sqrt(2 / n);
    if (!(reduced > 1 + 5 * sampling)) continue;
    found.beyond_noise = true;
    own.shape_variance = reduced;
    constexpr double kClearly = 0.1;  // smaller excesses are a noise model a little off
    if (reduced > 1 + std::max(kClearly, 5 * sampling)) {
      const double area = std::min(shared_area(task, optimum, frame, g, mean_known), n / 4);
      own.shape_variance *= std::max(1.0, area);
      found.largest_area = std::max(found.largest_area, area);
    }
  }
}

/// The frames' common standard deviation, units of the model intensity, whose expected scatter is what is seen; 0 where
/// noise explains it.
double scatter_of_means(const Task& task, const Theta& theta, const FrameSums& frames, double dof) {
  const auto excess = [&](double sd) {
    double total = -dof;
    for (int g = 0; g < task.frames(); ++g) {
      const auto& frame = frames[static_cast<std::size_t>(g)];
      const double ratio = sd * std::abs(task.gain_of(g, theta)) / frame.mean_noise_sd;
      total += frame.mean_whitened * frame.mean_whitened / (1 + ratio * ratio);
    }
    return total;
  };
  double high = 1e-9;
  while (excess(high) > 0 && high < 1e9) high *= 2;
  double low = 0;
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (low + high);
    (excess(middle) > 0 ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

/// Number of neighbouring rows that share one misfit, all tables together: (1 + r) / (1 - r), r the correlation of
/// neighbours, where it exceeds twice its sampling error. That is exact for a correlation that falls geometrically and,
/// as r is known far better than the sum of all lags, does not end where the sampling error does. The fitted mean makes
/// r small by (1 + 3 r) / n (Marriott & Pope, Biometrika 41, 390 (1954)).
double row_correlation(const Task& task, const Theta& theta, const FrameSums& frames, double frame_sd) {
  std::map<std::string, std::vector<double>> tables;
  for (int g = 0; g < task.frames(); ++g) {
    const auto& frame = frames[static_cast<std::size_t>(g)];
    const double ratio = frame_sd * std::abs(task.gain_of(g, theta)) / frame.mean_noise_sd;
    tables[table_of(task.micrograph(g).name)].push_back(frame.mean_whitened / std::sqrt(1 + ratio * ratio));
  }
  double squares = 0, products = 0, rows = 0, pairs = 0;
  for (const auto& [name, residual] : tables)
    for (std::size_t i = 0; i < residual.size(); ++i) {
      squares += residual[i] * residual[i], ++rows;
      if (i > 0) products += residual[i - 1] * residual[i], ++pairs;
    }
  if (!(squares > 0) || !(pairs > 0)) return 1;
  double r = products / pairs / (squares / rows);
  if (r < 2 / std::sqrt(pairs)) return 1;
  r = std::min(r + (1 + 3 * r) / (pairs / static_cast<double>(tables.size())), 1 - 1 / pairs);
  return (1 + r) / (1 - r);
}

std::vector<Misfit> assess_misfit(const Task& task, const Optimum& optimum, MisfitFound& found) {
  std::vector<Misfit> misfit = misfit_of_prior(task, optimum.theta);
  FrameSums frames;
  for (int g = 0; g < task.frames(); ++g) frames.push_back(optimum.problem->frame_misfit(g));
  const double dof = freedom_of_means(task, optimum, frames);
  constexpr double kEnoughFrames = 0.9;  // one degree of freedom, to rounding of leverages
  const bool own_scatter = dof >= kEnoughFrames;
  weigh_shapes(task, optimum, frames, own_scatter, misfit, found);

  found.frames_scatter = false;
  if (!own_scatter) return misfit;
  double sum = 0;
  for (const auto& frame : frames) sum += frame.mean_whitened * frame.mean_whitened;
  constexpr double kSignificant = 0.999;
  found.frames_scatter = sum > dof && (found.beyond_noise || sum > chi_square_quantile(kSignificant, dof));
  found.frame_sd = found.frames_scatter ? scatter_of_means(task, optimum.theta, frames, dof) : 0;
  // Rows of a table are its pixels: neighbours share a misfit that is wider than their distance.
  const bool rows = are_rows(optimum.frames);
  found.row_length = rows && found.frames_scatter
                         ? std::min(row_correlation(task, optimum.theta, frames, found.frame_sd), dof / 4)
                         : 1;
  found.frame_dof = dof / found.row_length;
  for (int g = 0; g < task.frames(); ++g) {
    Misfit& own = misfit[static_cast<std::size_t>(g)];
    own.mean_sd = found.frame_sd * std::sqrt(found.row_length) * std::abs(task.gain_of(g, optimum.theta));
    own.mean_follows_shape = false;
  }
  return misfit;
}

}  // namespace

Optimum with_settled_misfit(const Task& task, Optimum optimum) {
  for (int pass = 0; pass < 8; ++pass) {
    const double before = optimum.misfit.frame_sd;
    optimum.problem->set_misfit(assess_misfit(task, optimum, optimum.misfit));
    // Weights common to all rows of a single image move no minimum; against a prior or between frames they do.
    const bool moves = task.frames() > 1 || optimum.problem->prior_rows() > 0;
    if (!moves || optimum.stopped) {
      optimum.problem->evaluate(optimum.searched, true);
      break;
    }
    solve_again(task, optimum, "misfit weighed");
    constexpr double kSettled = 0.002;
    if (pass > 0 && std::abs(optimum.misfit.frame_sd - before) <= kSettled * optimum.misfit.frame_sd) break;
  }
  return optimum;
}

}  // namespace birefit::estimation
