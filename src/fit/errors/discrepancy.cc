#include "fit/errors/discrepancy.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "fit/errors/patterns.h"
#include "fit/errors/statistics.h"
#include "fit/problem/frame.h"
#include "fit/weights/noise.h"
#include "samples/kind.h"

namespace birefit::estimation {
namespace {

/// Sums over the pixels of a picture, or the rows of a table, in units of the noise: J the unknowns' columns, B the
/// patterns', r the residual.
struct Sums {
  Eigen::MatrixXd jj, jb, bb;
  Eigen::VectorXd jr, br;
  double rr = 0, pixels = 0;
  std::vector<int> group;  ///< of every pattern
};
/// What a part of them adds.
struct Part {
  Eigen::MatrixXd jj;
  Eigen::VectorXd jr;
};
using Partition = std::vector<Part>;

/// All, and parted in two ways: into sectors and rings, or columns and rows.
struct Parted {
  Sums all;
  std::array<Partition, 2> parts;

  /// As they are where the noise has this variance, in units of what it had.
  void measure_by(double variance) {
    all.jj /= variance, all.jb /= variance, all.bb /= variance;
    all.jr /= variance, all.br /= variance, all.rr /= variance;
    for (Partition& partition : parts)
      for (Part& part : partition) part.jj /= variance, part.jr /= variance;
  }
};

Part no_part(const Task& task) {
  const Eigen::Index n = task.unknowns.size();
  return {Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n)};
}

/// Patterns of rms 1, whatever they came with.
void scale_patterns(Sums& sums) {
  Eigen::VectorXd scale = (sums.bb.diagonal() / std::max(1.0, sums.pixels)).cwiseSqrt();
  scale = scale.unaryExpr([](double v) { return v > 0 ? 1 / v : 0.0; });
  sums.bb = scale.asDiagonal() * sums.bb * scale.asDiagonal();
  sums.jb = sums.jb * scale.asDiagonal();
  sums.br = scale.cwiseProduct(sums.br);
}

/// Of a picture, over every stride-th pixel.
Sums sums_of(const LeastSquares& problem, int picture, const Patterns& patterns, Eigen::Index stride,
             std::array<Partition, 2>& parts) {
  const PixelSet& set = problem.pixels(picture);
  const Eigen::Index n = parts[0].front().jr.size(), m = patterns.count();
  Sums sums{Eigen::MatrixXd::Zero(n, n),
            Eigen::MatrixXd::Zero(n, m),
            Eigen::MatrixXd::Zero(m, m),
            Eigen::VectorXd::Zero(n),
            Eigen::VectorXd::Zero(m),
            0,
            0,
            {}};
  for (int k = 0; k < patterns.count(); ++k) sums.group.push_back(patterns.group(k));
  problem.for_noise_whitened_rows(picture, [&](Eigen::Index begin, const Eigen::MatrixXd& all_rows,
                                               const Eigen::VectorXd& all_residuals) {
    const Eigen::Index first = (stride - begin % stride) % stride,
                       used = (all_rows.rows() - first + stride - 1) / stride;
    if (used <= 0) return;
    const auto every = Eigen::seqN(first, used, stride);
    const Eigen::MatrixXd rows = all_rows(every, Eigen::all);
    const Eigen::VectorXd residual = all_residuals(every);
    Eigen::MatrixXd columns(rows.rows(), m);
    Eigen::VectorXd pattern(m);
    for (Eigen::Index i = 0; i < rows.rows(); ++i) {
      const Eigen::Index pixel = begin + first + i * stride;
      patterns.at(pixel, pattern);
      columns.row(i) = pattern.transpose() / set.sigma[pixel];
      const std::array<std::size_t, 2> at = patterns.parts_at(pixel);
      for (std::size_t way = 0; way < parts.size(); ++way) {
        Part& part = parts[way][at[way]];
        part.jj.selfadjointView<Eigen::Lower>().rankUpdate(rows.row(i).transpose());
        part.jr += rows.row(i).transpose() * residual[i];
      }
    }
    sums.jj += rows.transpose() * rows, sums.jb += rows.transpose() * columns, sums.bb += columns.transpose() * columns;
    sums.jr += rows.transpose() * residual, sums.br += columns.transpose() * residual;
    sums.rr += residual.squaredNorm(), sums.pixels += static_cast<double>(rows.rows());
  });
  scale_patterns(sums);
  return sums;
}

Parted parted(const Task& task, const LeastSquares& problem, int picture, Eigen::Index stride) {
  Parted sums;
  sums.parts.fill(Partition(Patterns::kParts, no_part(task)));
  sums.all = sums_of(problem, picture, Patterns(task, problem, picture), stride, sums.parts);
  for (Partition& partition : sums.parts)
    for (Part& part : partition) part.jj = Eigen::MatrixXd(part.jj.selfadjointView<Eigen::Lower>());
  return sums;
}

/// Frames that are one number each, rows of a table or even pictures, in units of their noise: what they scatter by
/// beyond it is no pattern, but white.
Parted parted_rows(const Task& task, const LeastSquares& problem) {
  const RowPatterns patterns(task, problem);
  const auto rows = static_cast<Eigen::Index>(task.frames());
  Eigen::MatrixXd jacobian(rows, task.unknowns.size()), columns(rows, patterns.count());
  Eigen::VectorXd residual(rows);
  Parted parted;
  parted.parts.fill(Partition(Patterns::kParts, no_part(task)));
  for (Eigen::Index g = 0; g < rows; ++g) {
    const LeastSquares::FrameMisfit frame = problem.frame_misfit(static_cast<int>(g));
    jacobian.row(g) = frame.mean_jacobian_whitened.transpose();
    residual[g] = frame.mean_whitened;
    columns.row(g) = 1 / frame.mean_noise_sd * patterns.of(static_cast<int>(g)).transpose();
    for (Partition& partition : parted.parts) {
      Part& part = partition[static_cast<std::size_t>(g * Patterns::kParts / rows)];
      part.jj += jacobian.row(g).transpose() * jacobian.row(g), part.jr += jacobian.row(g).transpose() * residual[g];
    }
  }
  Sums& sums = parted.all;
  sums.jj = jacobian.transpose() * jacobian, sums.jb = jacobian.transpose() * columns;
  sums.bb = columns.transpose() * columns, sums.jr = jacobian.transpose() * residual;
  sums.br = columns.transpose() * residual, sums.rr = residual.squaredNorm(), sums.pixels = static_cast<double>(rows);
  for (int k = 0; k < patterns.count(); ++k) sums.group.push_back(patterns.group(k));
  scale_patterns(sums);
  return parted;
}

struct Discrepancy {
  double evidence = 0;         ///< twice the log of the likelihood ratio against noise alone
  double white = 1;            ///< variance of what no pattern explains, over the noise's
  Eigen::MatrixXd covariance;  ///< of the unknowns, by a discrepancy of the size that the residual shows
};
/// Of one picture or table; `c`: the unknowns' covariance by noise alone, `pulls`: J^T r of all pictures.
Discrepancy by_patterns(const Sums& s, const Eigen::MatrixXd& c, const Eigen::VectorXd& pulls) {
  const Eigen::Index m = s.br.size(), p = c.rows();
  const Eigen::MatrixXd g = s.bb - s.jb.transpose() * c * s.jb;
  const Eigen::VectorXd h = s.br - s.jb.transpose() * (c * pulls);
  const double excess = std::max(s.rr / s.pixels - 1, 3 * std::sqrt(2 / s.pixels));
  Eigen::VectorXd v = Eigen::VectorXd::Constant(Patterns::kGroups, excess / static_cast<double>(m));
  Eigen::VectorXd of_pattern(m), found = Eigen::VectorXd::Zero(m);
  double free = 0, evidence = 0;
  const auto spread = [&] {
    for (Eigen::Index k = 0; k < m; ++k) of_pattern[k] = v[s.group[static_cast<std::size_t>(k)]];
  };
  constexpr int kTimes = 60;
  for (int time = 0; time < kTimes; ++time) {
    spread();
    // (G + V^-1)^-1 = V^1/2 (1 + V^1/2 G V^1/2)^-1 V^1/2, which a vanishing variance leaves sound.
    const Eigen::VectorXd root = of_pattern.cwiseSqrt();
    Eigen::MatrixXd inner = root.asDiagonal() * g * root.asDiagonal();
    inner.diagonal().array() += 1;
    const Eigen::LDLT<Eigen::MatrixXd> solver(inner);
    const Eigen::MatrixXd sigma = root.asDiagonal() * solver.solve(Eigen::MatrixXd::Identity(m, m)) * root.asDiagonal();
    found = sigma * h;
    evidence = h.dot(found) - solver.vectorD().array().abs().log().sum();
    Eigen::VectorXd squares = Eigen::VectorXd::Zero(v.size()), known = squares;
    free = 0;
    for (Eigen::Index k = 0; k < m; ++k) {
      const int group = s.group[static_cast<std::size_t>(k)];
      const double share = of_pattern[k] > 0 ? 1 - sigma(k, k) / of_pattern[k] : 0;
      squares[group] += found[k] * found[k], known[group] += share, free += share;
    }
    const Eigen::VectorXd before = v;
    // None of them is larger than all that is left over: what an unknown takes up nearly whole has no size of its own.
    for (Eigen::Index group = 0; group < v.size(); ++group)
      v[group] = known[group] > 1e-9 ? std::min(squares[group] / known[group], s.rr / s.pixels) : 0;
    if ((v - before).cwiseAbs().maxCoeff() <= 1e-3 * before.maxCoeff()) break;
  }
  spread();
  // What no pattern explains is white, and scales what noise does.
  const Eigen::VectorXd pull = s.jr - s.jb * found, moved = c * (pulls - s.jb * found);
  const double rest =
      s.rr - 2 * found.dot(s.br) + found.dot(s.bb * found) - 2 * pull.dot(moved) + moved.dot(s.jj * moved);
  const double white = std::max(1.0, rest / std::max(1.0, s.pixels - static_cast<double>(p) - free));
  const Eigen::MatrixXd influence = c * s.jb;
  return {evidence, white, influence * of_pattern.asDiagonal() * influence.transpose()};
}

/// The covariance of the unknowns by fits without a part at a time, nearly all of it.
Eigen::MatrixXd by_parts(const Partition& parts, const Eigen::MatrixXd& information) {
  constexpr double kLeftOut = 0.98;
  const double m = static_cast<double>(parts.size());
  Eigen::VectorXd mean_pull = Eigen::VectorXd::Zero(information.rows());
  for (const Part& part : parts) mean_pull += part.jr / m;
  std::vector<Eigen::VectorXd> steps;
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(information.rows());
  for (const Part& part : parts) {
    steps.push_back(-(information - kLeftOut * part.jj).ldlt().solve(part.jr - mean_pull));
    mean += steps.back() / m;
  }
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(information.rows(), information.rows());
  for (const Eigen::VectorXd& step : steps) covariance += (m - 1) / m * (step - mean) * (step - mean).transpose();
  return covariance;
}

/// Pictures whose model changes from place to place, with enough of each to tell patterns apart: one, or several of
/// spheres. (Of several of a bar or a disc, three in a calibration, patterns and pictures left out in turn widen far
/// beyond what the pictures' own scatter is, which is in the errors already; behind a calibration what one picture
/// misses is known from the calibration's frames.)
bool tells_patterns(const Task& task, const LeastSquares& problem) {
  constexpr std::size_t kFewestPixels = 400;
  constexpr double kContrast = 0.05;  // else it is one number
  if (task.job.prior || task.unknowns.size() == 0 || (task.frames() > 1 && !are_of_spheres(task))) return false;
  for (int g = 0; g < task.frames(); ++g) {
    const auto [low, high] = problem.intensity_range(g);
    if (task.observable(g).quantity != Quantity::intensity || traits_of(task.picture(g).scene).even ||
        problem.pixels(g).pixels.size() < kFewestPixels ||
        !(high - low > kContrast * std::max(std::abs(high), std::abs(low))))
      return false;
  }
  return true;
}

/// Frames of one number each, enough of them to tell a pattern from what is fitted.
bool tells_row_patterns(const Task& task, const LeastSquares& problem) {
  constexpr int kFreedom = 8;
  for (int g = 0; g < task.frames(); ++g) {
    const Picture& picture = task.picture(g);
    const bool even = traits_of(picture.scene).even && picture.uneven.empty() && picture.effects.empty();
    if (task.observable(g).quantity == Quantity::ring_radius_cm || (!even && problem.pixels(g).pixels.size() != 1))
      return false;
  }
  return task.unknowns.size() > 0 && task.frames() >= task.unknowns.size() + kFreedom;
}

/// Does a picture scatter about the fit by more than its noise? Of n pixels chi-square scatters by 2/n. A
/// noise that was read off the picture is known to no better than 38/n; read once more off what is left over it is
/// known to 14/n (weights/noise.cc).
bool is_beyond_noise(const Task& task, const Optimum& optimum, int g) {
  const auto pixels = static_cast<double>(optimum.problem->pixels(g).value.size());
  const double reduced = optimum.problem->frame_misfit(g).chi_square / pixels;
  if (!(reduced > 1 + 3 * std::sqrt(2 / pixels))) return false;
  const Frame& frame = optimum.frames[static_cast<std::size_t>(g)];
  if (!frame.noise.estimated || frame.noise_of_all) return true;
  const Image fitted = fitted_image(task, optimum.frames, g, optimum.theta);
  const Picture& picture = task.picture(g);
  const Image again = standard_deviation(picture, estimate_noise(picture, &fitted, true), fitted);
  double louder = 0;  // mean over the pixels that are fitted, as chi-square is
  for (const auto& [x, y] : frame.pixels) louder += std::pow(again(x, y) / frame.sigma(x, y), 2) / pixels;
  return reduced / louder > 1 + 3 * std::sqrt((2 + 14) / pixels);
}

/// What there is to say of a fit's residual; nothing where noise explains it.
struct LeftOver {
  std::array<Partition, 2> parts;  ///< the same one of all pictures together
  Eigen::MatrixXd information;
  Inverse inverse;
  Eigen::MatrixXd covariance;  ///< of the unknowns, by discrepancies of the size that the residuals show
  double white = 1;            ///< the largest
  double sampled = 1;          ///< share of the pixels
};
std::optional<LeftOver> left_over(const Task& task, const Optimum& optimum) {
  const LeastSquares& problem = *optimum.problem;
  if (optimum.stopped) return std::nullopt;
  const bool rows = tells_row_patterns(task, problem);
  if (!rows && !tells_patterns(task, problem)) return std::nullopt;
  constexpr double kPixels = 40000;  // they tell a discrepancy as well as all of them
  const double pixels = rows ? task.frames() : static_cast<double>(problem.pixel_rows());
  std::vector<Parted> pictures;
  if (rows) pictures.push_back(parted_rows(task, problem));
  for (int g = 0; g < task.frames() && !rows; ++g)
    pictures.push_back(parted(task, problem, g, static_cast<Eigen::Index>(std::ceil(pixels / kPixels))));
  LeftOver left;
  left.sampled = 0;
  for (Parted& picture : pictures) {
    left.sampled += picture.all.pixels / pixels;
    // A misfit of thousands of times the noise leaves no digits for sums in units of that.
    constexpr double kLargest = 100;
    picture.measure_by(std::max(1.0, picture.all.rr / picture.all.pixels / kLargest));
  }
  const Eigen::MatrixXd factor = problem.factor(true), of_data = problem.factor(false),
                        prior = factor.transpose() * factor - of_data.transpose() * of_data;
  // A noise that is larger than it was thought to be is no pattern: in its units they are sought again.
  constexpr int kTimes = 3;
  constexpr double kAsThought = 1.1;
  std::vector<Discrepancy> found(pictures.size());
  double evidence = 0;
  for (int time = 0; time < kTimes && (time == 0 || left.white >= kAsThought); ++time) {
    left.information = prior;
    Eigen::VectorXd pulls = Eigen::VectorXd::Zero(prior.rows());
    for (std::size_t g = 0; g < pictures.size(); ++g) {
      if (time > 0) pictures[g].measure_by(found[g].white);
      left.information += pictures[g].all.jj, pulls += pictures[g].all.jr;
    }
    left.inverse = invert_normal_equations(Eigen::MatrixXd(left.information.llt().matrixU()));
    if (std::count(left.inverse.undetermined.begin(), left.inverse.undetermined.end(), true) > 0) return std::nullopt;
    left.white = 1, evidence = 0;
    left.covariance = Eigen::MatrixXd::Zero(prior.rows(), prior.cols());
    for (std::size_t g = 0; g < pictures.size(); ++g) {
      found[g] = by_patterns(pictures[g].all, left.inverse.covariance, pulls);
      left.white = std::max(left.white, found[g].white), evidence = std::max(evidence, found[g].evidence);
      // What pictures depart by they may all depart by alike: as if their shifts were one.
      left.covariance += static_cast<double>(pictures.size()) * found[g].covariance;
    }
  }
  // Clean pictures stay below it (NoDepartureIsAskedForInCleanPictures), and clean tables, whose rows are fewer.
  constexpr double kEvidenceOfPixels = 15, kEvidenceOfRows = 9;
  // What noise does not explain is scaled by its own size as well (Misfit); only of what is round it asks without a
  // pattern that is seen.
  bool beyond_noise = false;
  for (int g = 0; g < task.frames() && !rows; ++g)
    beyond_noise = beyond_noise || (traits_of(task.picture(g).scene).round && is_beyond_noise(task, optimum, g));
  if (!beyond_noise && !(evidence > (rows ? kEvidenceOfRows : kEvidenceOfPixels))) return std::nullopt;
  left.parts.fill(Partition(Patterns::kParts, no_part(task)));
  for (const Parted& picture : pictures)
    for (std::size_t way = 0; way < left.parts.size(); ++way)
      for (std::size_t i = 0; i < left.parts[way].size(); ++i) {
        left.parts[way][i].jj += picture.parts[way][i].jj;
        left.parts[way][i].jr += picture.parts[way][i].jr;
      }
  return left;
}

}  // namespace

double missed_of_contrast(const Task& task, const Optimum& optimum, int frame) {
  const LeastSquares& problem = *optimum.problem;
  const Eigen::ArrayXd sigma = problem.pixels(frame).sigma.array(),
                       residual = problem.noise_whitened_residual(frame).array() * sigma;
  const auto [low, high] = problem.intensity_range(frame);
  const double missed = std::sqrt(std::max(0.0, (residual.square() - sigma.square()).mean()));
  return missed / std::max(std::abs(task.gain_of(frame, optimum.theta)) * (high - low), 1e-300);
}

double missed_of_all(const Task& task, const Optimum& optimum) {
  double low = std::numeric_limits<double>::infinity(), high = -low, missed = 0;
  for (int g = 0; g < task.frames(); ++g) {
    const auto [l, h] = optimum.problem->intensity_range(g);
    low = std::min(low, l), high = std::max(high, h);
    missed += std::pow(missed_of_contrast(task, optimum, g) * (h - l), 2) / task.frames();
  }
  return std::sqrt(missed) / std::max(high - low, 1e-300);
}

bool are_of_spheres(const Task& task) {
  return !are_colours(task) && std::all_of(task.sights.begin(), task.sights.end(), [](const Sight& sight) {
    return static_cast<bool>(traits_of(sight.picture->scene).sphere_diameter_um);
  });
}

bool leaves_discrepancy(const Task& task, const Optimum& optimum) { return left_over(task, optimum).has_value(); }

std::vector<Eigen::MatrixXd> covariances_by_discrepancy(const Task& task, const Optimum& optimum) {
  constexpr double kFactor = 1.5;
  const std::optional<LeftOver> left = left_over(task, optimum);
  if (!left) return {};
  std::vector<Eigen::MatrixXd> all{left->white * left->sampled * left->inverse.covariance + left->covariance};
  for (const Partition& partition : left->parts) all.push_back(by_parts(partition, left->information));
  std::erase_if(all, [](const Eigen::MatrixXd& covariance) { return !covariance.allFinite(); });
  for (Eigen::MatrixXd& covariance : all) covariance *= kFactor * kFactor;
  return all;
}

}  // namespace birefit::estimation
