// Frame by frame: how much larger than noise the misfit is, over how many pixels it is shared, and how the frames'
// means scatter. The scatter is a random effect with equal variance for every frame: each frame's mean residual is one
// observation, its variance solves sum e_g^2 / (tau^2 + s_g^2) = degrees of freedom (Mandel & Paule, Anal. Chem. 42,
// 1194 (1970)), and the t quantile counts frames. A cluster-robust sandwich (Liang & Zeger, Biometrika 73, 13 (1986))
// of five frames and three parameters would be half its size too small: the normal equations make its scores nearly
// zero.

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>

#include "fit/errors/statistics.h"
#include "fit/weights/lamp.h"
#include "fit/weights/settle.h"

namespace birefit::estimation {
namespace {

using FrameSums = std::vector<LeastSquares::FrameMisfit>;

/// Of a frame's mean in the fit, 1 where it is that of its noise.
double weight_of_mean(const Misfit& now, const LeastSquares::FrameMisfit& frame) {
  const double ratio = now.mean_sd / frame.mean_noise_sd;
  return now.mean_follows_shape ? 1 / now.shape_variance : 1 / (1 + ratio * ratio);
}

/// Degree of freedom left to each frame's mean, from 0 to 1.
std::vector<double> freedom_of_means(const Task& task, const Optimum& optimum, const FrameSums& frames) {
  if (frames.size() < 2) return {0};
  const Eigen::MatrixXd covariance = invert_normal_equations(optimum.problem->factor()).covariance;
  std::vector<double> freedom;
  for (int g = 0; g < task.frames(); ++g) {
    const auto& frame = frames[static_cast<std::size_t>(g)];
    const double factor = weight_of_mean(optimum.problem->misfit()[static_cast<std::size_t>(g)], frame);
    const Eigen::VectorXd& row = frame.mean_jacobian_whitened;
    freedom.push_back(1 - std::clamp(factor * row.dot(covariance * row), 0.0, 1.0));
  }
  return freedom;
}

/// Pixels that share one misfit, of a frame's residual without its mean where that is another observation.
double shared_area(const Task& task, const Optimum& optimum, const LeastSquares::FrameMisfit& frame, int g,
                   bool mean_known) {
  const Picture& micrograph = task.picture(g);
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
    const double mean_part = mean_known ? frame.mean_chi_square : 0;
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

/// Frames show a scatter where their noise alone would make it less often than once in a hundred fits.
constexpr double kShown = 0.99;

/// Of the frames' means, in units of their noise and the lamp's jitter.
double sum_of_squares(const FrameSums& frames, const std::vector<double>& ratio, double jitter) {
  double sum = 0;
  for (std::size_t g = 0; g < frames.size(); ++g)
    sum += frames[g].mean_whitened * frames[g].mean_whitened / (1 + std::pow(jitter * ratio[g], 2));
  return sum;
}

/// What the lamp's jitter is over each frame's noise, per unit of its brightness; 0 where a row's noise is not known,
/// so that its scatter holds the jitter already.
std::vector<double> lamp_over_noise(const Task& task, const FrameSums& frames) {
  std::vector<double> ratio;
  for (int g = 0; g < task.frames(); ++g) {
    const auto& frame = frames[static_cast<std::size_t>(g)];
    const bool known = task.observable(g).quantity == Quantity::intensity &&
                       !task.sights[static_cast<std::size_t>(g)].noise_of_rows;
    ratio.push_back(known ? std::abs(frame.mean_light) / frame.mean_noise_sd : 0);
  }
  return ratio;
}

/// What the lamp's jitter may be, by the frames' means; `optimum` has derivatives.
LampJitter lamp_of(const Task& task, const Optimum& optimum, const FrameSums& frames,
                   const std::vector<double>& ratio) {
  const Eigen::Index rows = task.frames(), unknowns = task.unknowns.size();
  FrameMeans means;
  means.residual = means.light = means.weight = Eigen::VectorXd(rows);
  means.jacobian = Eigen::MatrixXd(rows, unknowns);
  for (Eigen::Index g = 0; g < rows; ++g) {
    const auto& frame = frames[static_cast<std::size_t>(g)];
    means.residual[g] = frame.mean_whitened;
    means.light[g] = ratio[static_cast<std::size_t>(g)];
    means.weight[g] = weight_of_mean(optimum.problem->misfit()[static_cast<std::size_t>(g)], frame);
    means.jacobian.row(g) = frame.mean_jacobian_whitened.transpose();
  }
  means.covariance = invert_normal_equations(optimum.problem->factor()).covariance;
  return lamp_jitter(means);
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
    tables[task.sights[static_cast<std::size_t>(g)].table].push_back(frame.mean_whitened /
                                                                     std::sqrt(1 + ratio * ratio));
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

/// Twice the negative logarithm of the likelihood of the frames' means: with a lamp's jitter at its best, its prior
/// included, and with a scatter of any size that the means alone tell.
double deviance_by_lamp(const FrameSums& frames, const std::vector<double>& ratio) {
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i <= kLampPlaces; ++i) {
    const double jitter = lamp_place(i);
    double sum = (jitter / kLampJitter) * (jitter / kLampJitter) + sum_of_squares(frames, ratio, jitter);
    for (const double r : ratio) sum += std::log1p(std::pow(jitter * r, 2));
    least = std::min(least, sum);
  }
  return least;
}
double deviance_by_scatter(const Task& task, const Theta& theta, const FrameSums& frames) {
  std::vector<double> ratio;
  double smallest = std::numeric_limits<double>::infinity();
  for (int g = 0; g < task.frames(); ++g) {
    ratio.push_back(std::abs(task.gain_of(g, theta)) / frames[static_cast<std::size_t>(g)].mean_noise_sd);
    if (ratio.back() > 0) smallest = std::min(smallest, 1 / ratio.back());
  }
  constexpr double kStep = 1.05;
  double least = std::numeric_limits<double>::infinity();
  const double most = smallest * std::sqrt(sum_of_squares(frames, ratio, 0));
  for (double sd = 0.1 * smallest; sd < most; sd *= kStep) {
    double sum = sum_of_squares(frames, ratio, sd);
    for (const double r : ratio) sum += std::log1p(std::pow(sd * r, 2));
    least = std::min(least, sum);
  }
  return least;
}

std::vector<Misfit> assess_misfit(const Task& task, const Optimum& optimum, MisfitFound& found) {
  std::vector<Misfit> misfit = misfit_of_prior(task, optimum.theta);
  FrameSums frames;
  for (int g = 0; g < task.frames(); ++g) frames.push_back(optimum.problem->frame_misfit(g));
  const std::vector<double> freedom = freedom_of_means(task, optimum, frames);
  const double dof = std::accumulate(freedom.begin(), freedom.end(), 0.0);
  constexpr double kEnoughFrames = 0.9;  // one degree of freedom, to rounding of leverages
  const bool own_scatter = dof >= kEnoughFrames;
  weigh_shapes(task, optimum, frames, own_scatter, misfit, found);

  found.frames_scatter = false;
  found.lamp_wider.resize(0);
  if (!own_scatter) return misfit;
  const std::vector<double> ratio = lamp_over_noise(task, frames);
  const LampJitter lamp = lamp_of(task, optimum, frames, ratio);
  found.lamp_jitter = lamp.share;
  // What scatters by more than a lamp does is not the lamp, nor need it be where frames are not described either.
  // The noise that was read off a table's rows is no better known than what they scatter by.
  constexpr double kSignificant = 0.999, kOfNoiseRead = 0.95;
  const bool rows = are_rows(optimum.frames),
             read = std::any_of(task.sights.begin(), task.sights.end(),
                                [](const Sight& sight) { return sight.noise_of_rows; });
  const double significant = chi_square_quantile(read ? kOfNoiseRead : kSignificant, dof);
  constexpr double kTellsWhich = 2;  // degrees of freedom: a single one tells of any scatter only that it is there
  const bool of_model = found.beyond_noise && dof > kTellsWhich - 0.1 &&
                        sum_of_squares(frames, ratio, 0) > chi_square_quantile(kShown, dof) &&
                        deviance_by_scatter(task, optimum.theta, frames) < deviance_by_lamp(frames, ratio);
  if (of_model || sum_of_squares(frames, ratio, found.lamp_jitter) > significant) found.lamp_jitter = 0;
  found.lamp_wider = found.lamp_jitter > 0 ? lamp.wider : Eigen::VectorXd();
  found.lamp_share = 0;
  for (const double r : lamp.shown ? ratio : std::vector<double>{})
    found.lamp_share = std::max(found.lamp_share, 1 - 1 / (1 + std::pow(found.lamp_jitter * r, 2)));
  const double sum = sum_of_squares(frames, ratio, found.lamp_jitter);
  found.frames_scatter = sum > dof && found.lamp_jitter == 0 && (found.beyond_noise || sum > significant);
  found.frame_sd = found.frames_scatter ? scatter_of_means(task, optimum.theta, frames, dof) : 0;
  // Rows of a table are its pixels: neighbours share a misfit that is wider than their distance.
  found.row_length = rows && found.frames_scatter
                         ? std::min(row_correlation(task, optimum.theta, frames, found.frame_sd), dof / 4)
                         : 1;
  found.frame_dof = dof / found.row_length;
  for (int g = 0; g < task.frames(); ++g) {
    Misfit& own = misfit[static_cast<std::size_t>(g)];
    const double of_frames = found.frame_sd * std::sqrt(found.row_length) * std::abs(task.gain_of(g, optimum.theta));
    own.mean_sd = std::hypot(of_frames, found.lamp_jitter * frames[static_cast<std::size_t>(g)].mean_light);
    own.mean_follows_shape = false;
  }
  return misfit;
}

}  // namespace

double deviance(const Task& task, const LeastSquares& problem) {
  if (task.frames() < 2) return problem.objective();
  FrameSums frames;
  double shapes = 0, squares = 0;
  for (int g = 0; g < task.frames(); ++g) {
    frames.push_back(problem.frame_misfit(g));
    shapes += (frames.back().chi_square - frames.back().mean_chi_square) /
              problem.misfit()[static_cast<std::size_t>(g)].shape_variance;
    squares += frames.back().mean_whitened * frames.back().mean_whitened;
  }
  const double of_means = std::min(deviance_by_lamp(frames, lamp_over_noise(task, frames)),
                                   deviance_by_scatter(task, problem.theta(), frames));
  return shapes + std::min(squares, of_means) + problem.prior_chi_square();
}

Optimum with_settled_misfit(const Task& task, Optimum optimum) {
  // What frames scatter by is judged from where their noise alone would put them: elsewhere they scatter more.
  if (task.frames() > 1 && !optimum.stopped) {
    optimum.problem->set_misfit(misfit_of_prior(task, optimum.theta));
    solve_again(task, optimum, "frames weighed");
  }
  constexpr double kSettled = 0.002;
  // Of a shape's variance, a tenth of which moves an error bar by a twentieth.
  constexpr double kShapeSettled = 0.1;
  const auto still = [](double now, double then, double share) { return std::abs(now - then) <= share * now; };
  for (int pass = 0; pass < 8; ++pass) {
    const MisfitFound before = optimum.misfit;
    const std::vector<Misfit> weights = optimum.problem->misfit();
    optimum.problem->set_misfit(assess_misfit(task, optimum, optimum.misfit));
    // Weights common to all rows of a single image move no minimum; against a prior or between frames they do.
    const bool moves = task.frames() > 1 || optimum.problem->prior_rows() > 0;
    if (!moves || optimum.stopped) {
      optimum.problem->evaluate(optimum.searched, true);
      break;
    }
    solve_again(task, optimum, "misfit weighed");
    // Against a prior a shape's weight may take the fit to where the shape is another.
    const bool shapes_still = optimum.problem->prior_rows() == 0 ||
                              std::equal(weights.begin(), weights.end(), optimum.problem->misfit().begin(),
                                         [&](const Misfit& then, const Misfit& now) {
                                           return still(now.shape_variance, then.shape_variance, kShapeSettled);
                                         });
    if (pass > 0 && shapes_still && still(optimum.misfit.frame_sd, before.frame_sd, kSettled) &&
        still(optimum.misfit.lamp_jitter, before.lamp_jitter, kSettled))
      break;
  }
  return optimum;
}

}  // namespace birefit::estimation
