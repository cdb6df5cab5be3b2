#include "fit/errors/discrepancy.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "fit/errors/patterns.h"
#include "fit/errors/statistics.h"
#include "samples/kind.h"

namespace birefit::estimation {
namespace {

/// Sums over the pixels of one picture, in units of the noise: J the unknowns' columns, B the patterns', r the
/// residual.
struct Sums {
  Eigen::MatrixXd jj, jb, bb;
  Eigen::VectorXd jr, br;
  double rr = 0, pixels = 0;
  std::vector<int> group;  ///< of every pattern
};
/// What a part of all pictures adds to those.
struct Part {
  Eigen::MatrixXd jj;
  Eigen::VectorXd jr;
};
/// Ways to part the pictures: into sectors and rings, or columns and rows; and one from another.
using Partition = std::vector<Part>;

struct Parted {
  std::vector<Sums> pictures;
  std::array<Partition, 2> within;

  /// As they are where the noise has this variance, in units of what it had.
  void measure_by(double variance) {
    for (Sums& s : pictures) {
      s.jj /= variance, s.jb /= variance, s.bb /= variance;
      s.jr /= variance, s.br /= variance, s.rr /= variance;
    }
    for (Partition& partition : within)
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

/// Over every stride-th pixel.
Sums sums_of(const LeastSquares& problem, const Patterns& patterns, int picture, Eigen::Index stride,
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

Parted parted(const Task& task, const LeastSquares& problem, Eigen::Index stride) {
  Parted all;
  all.within.fill(Partition(Patterns::kParts, no_part(task)));
  for (int g = 0; g < task.frames(); ++g)
    all.pictures.push_back(sums_of(problem, Patterns(task, g, problem), g, stride, all.within));
  for (Partition& partition : all.within)
    for (Part& part : partition) part.jj = Eigen::MatrixXd(part.jj.selfadjointView<Eigen::Lower>());
  return all;
}

/// Frames that are one number each, rows of a table or even pictures, by the weights of their fit: the scatter that
/// they show is in those, what they have in common with their neighbours is not.
Parted parted_rows(const Task& task, const LeastSquares& problem) {
  const RowPatterns patterns(task, problem);
  const auto rows = static_cast<Eigen::Index>(task.frames());
  Eigen::MatrixXd jacobian(rows, task.unknowns.size()), columns(rows, patterns.count());
  Eigen::VectorXd residual(rows);
  Parted all;
  all.within.fill(Partition(Patterns::kParts, no_part(task)));
  for (Eigen::Index g = 0; g < rows; ++g) {
    const LeastSquares::FrameMisfit frame = problem.frame_misfit(static_cast<int>(g));
    const Misfit& misfit = problem.misfit()[static_cast<std::size_t>(g)];
    const double weight = misfit.mean_follows_shape ? 1 / std::sqrt(misfit.shape_variance)
                                                    : 1 / std::hypot(1, misfit.mean_sd / frame.mean_noise_sd);
    jacobian.row(g) = weight * frame.mean_jacobian_whitened.transpose();
    residual[g] = weight * frame.mean_whitened;
    columns.row(g) = weight / frame.mean_noise_sd * patterns.of(static_cast<int>(g)).transpose();
    for (Partition& partition : all.within) {
      Part& part = partition[static_cast<std::size_t>(g * Patterns::kParts / rows)];
      part.jj += jacobian.row(g).transpose() * jacobian.row(g), part.jr += jacobian.row(g).transpose() * residual[g];
    }
  }
  Sums sums{jacobian.transpose() * jacobian, jacobian.transpose() * columns,
            columns.transpose() * columns,   jacobian.transpose() * residual,
            columns.transpose() * residual,  residual.squaredNorm(),
            static_cast<double>(rows),       {}};
  for (int k = 0; k < patterns.count(); ++k) sums.group.push_back(patterns.group(k));
  scale_patterns(sums);
  all.pictures.push_back(std::move(sums));
  return all;
}

struct Discrepancy {
  double evidence = 0;         ///< twice the log of the likelihood ratio against noise alone
  double white = 1;            ///< variance of what no pattern explains, over the noise's
  Eigen::MatrixXd covariance;  ///< of the unknowns, by a discrepancy of the size that the residual shows
};
/// Of the patterns' coefficients in one picture, given the variances of all.
struct Found {
  Eigen::VectorXd root;      ///< standard deviations before
  Eigen::MatrixXd alone;     ///< (1 + V^1/2 B'B V^1/2)^-1
  Eigen::MatrixXd shared;    ///< V^1/2 B'J
  Eigen::VectorXd mean;      ///< after
  Eigen::VectorXd variance;  ///< after
};
/// `information`, `c`: of the unknowns by noise alone, and its inverse.
class ByPatterns {
 public:
  ByPatterns(const std::vector<Sums>& pictures, const Eigen::MatrixXd& information, const Eigen::MatrixXd& c)
      : pictures_(pictures), information_(information), c_(c), found_(pictures.size()) {
    pull_ = Eigen::VectorXd::Zero(c.rows());
    for (const Sums& s : pictures) pull_ += s.jr;
  }
  Discrepancy operator()() {
    double rr = 0, pixels = 0, patterns = 0;
    for (const Sums& s : pictures_)
      rr += s.rr, pixels += s.pixels, patterns += static_cast<double>(s.group.size()) / pictures_.size();
    const double excess = std::max(rr / pixels - 1, 3 * std::sqrt(2 / pixels));
    Eigen::VectorXd v = Eigen::VectorXd::Constant(Patterns::kGroups, excess / patterns);
    constexpr int kTimes = 60;
    for (int time = 0; time < kTimes; ++time) {
      settle(v);
      const Eigen::VectorXd before = std::exchange(v, variances(v));
      if ((v - before).cwiseAbs().maxCoeff() <= 1e-3 * before.maxCoeff()) break;
    }
    // What no pattern explains is white, and scales what noise does.
    Eigen::VectorXd pull = pull_;
    double rest = rr;
    Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(c_.rows(), c_.rows());
    for (std::size_t g = 0; g < pictures_.size(); ++g) {
      const Sums& s = pictures_[g];
      const Eigen::VectorXd& mean = found_[g].mean;
      pull -= s.jb * mean, rest += mean.dot(s.bb * mean) - 2 * mean.dot(s.br);
      const Eigen::MatrixXd influence = c_ * s.jb;
      for (Eigen::Index k = 0; k < mean.size(); ++k)
        covariance += v[s.group[static_cast<std::size_t>(k)]] * influence.col(k) * influence.col(k).transpose();
    }
    const Eigen::VectorXd moved = c_ * pull;
    Eigen::MatrixXd jj = Eigen::MatrixXd::Zero(c_.rows(), c_.rows());
    for (const Sums& s : pictures_) jj += s.jj;
    rest += moved.dot(jj * moved) - 2 * pull.dot(moved);
    const double left = pixels - static_cast<double>(c_.rows()) - free_;
    return {evidence_, std::max(1.0, rest / std::max(1.0, left)), covariance};
  }

 private:
  /// The coefficients after, by the inverse of (G + V^-1) = V^-1/2 (A - U C U') V^-1/2, where A = 1 + V^1/2 B'B V^1/2
  /// is a block a picture and U = V^1/2 B'J has a column an unknown (Woodbury's identity).
  void settle(const Eigen::VectorXd& v) {
    Eigen::MatrixXd among = information_;
    evidence_ = 0;
    for (std::size_t g = 0; g < pictures_.size(); ++g) {
      const Sums& s = pictures_[g];
      Found& found = found_[g];
      const auto m = static_cast<Eigen::Index>(s.group.size());
      found.root.resize(m);
      for (Eigen::Index k = 0; k < m; ++k) found.root[k] = std::sqrt(v[s.group[static_cast<std::size_t>(k)]]);
      Eigen::MatrixXd inner = found.root.asDiagonal() * s.bb * found.root.asDiagonal();
      inner.diagonal().array() += 1;
      const Eigen::LDLT<Eigen::MatrixXd> solver(inner);
      found.alone = solver.solve(Eigen::MatrixXd::Identity(m, m));
      found.shared = found.root.asDiagonal() * s.jb.transpose();
      among -= found.shared.transpose() * found.alone * found.shared;
      evidence_ -= solver.vectorD().array().abs().log().sum();
    }
    const Eigen::LDLT<Eigen::MatrixXd> solver(among);
    evidence_ -= solver.vectorD().array().abs().log().sum() - information_.ldlt().vectorD().array().abs().log().sum();
    // h of a picture is V^1/2 (B'r - B'J C J'r), and J'r is of all pictures.
    std::vector<Eigen::VectorXd> h;
    Eigen::VectorXd along = Eigen::VectorXd::Zero(c_.rows());
    const Eigen::VectorXd taken = c_ * pull_;
    for (std::size_t g = 0; g < pictures_.size(); ++g) {
      Found& found = found_[g];
      h.push_back(found.root.cwiseProduct(pictures_[g].br) - found.shared * taken);
      along += found.shared.transpose() * (found.alone * h.back());
    }
    const Eigen::VectorXd answer = solver.solve(along);
    for (std::size_t g = 0; g < pictures_.size(); ++g) {
      Found& found = found_[g];
      const Eigen::MatrixXd seen = found.alone * found.shared;
      const Eigen::VectorXd mean = found.alone * h[g] + seen * answer;
      evidence_ += h[g].dot(mean);
      found.mean = found.root.cwiseProduct(mean);
      const Eigen::MatrixXd solved = solver.solve(seen.transpose());
      found.variance = found.root.cwiseAbs2().cwiseProduct(found.alone.diagonal() +
                                                           seen.cwiseProduct(solved.transpose()).rowwise().sum());
    }
  }
  /// Of the groups, the next ones.
  Eigen::VectorXd variances(const Eigen::VectorXd& v) {
    Eigen::VectorXd squares = Eigen::VectorXd::Zero(v.size()), known = squares;
    free_ = 0;
    for (std::size_t g = 0; g < pictures_.size(); ++g)
      for (std::size_t k = 0; k < pictures_[g].group.size(); ++k) {
        const int group = pictures_[g].group[k];
        const auto i = static_cast<Eigen::Index>(k);
        const double share = v[group] > 0 ? 1 - found_[g].variance[i] / v[group] : 0;
        squares[group] += found_[g].mean[i] * found_[g].mean[i], known[group] += share, free_ += share;
      }
    for (Eigen::Index group = 0; group < v.size(); ++group)
      squares[group] = known[group] > 1e-9 ? squares[group] / known[group] : 0;
    return squares;
  }

  const std::vector<Sums>& pictures_;
  const Eigen::MatrixXd &information_, &c_;
  Eigen::VectorXd pull_;
  std::vector<Found> found_;
  double evidence_ = 0, free_ = 0;
};

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

/// One picture whose model changes from place to place, with enough of it to tell patterns apart. (Of several, three in
/// a calibration, the patterns and the pictures left out in turn widen far beyond what the pictures' own scatter is,
/// which is in the errors already.)
bool tells_patterns(const Task& task, const LeastSquares& problem) {
  constexpr std::size_t kFewestPixels = 400;
  constexpr double kContrast = 0.05;  // else it is one number
  for (int g = 0; g < task.frames(); ++g) {
    const auto [low, high] = problem.intensity_range(g);
    if (task.observable(g).quantity != Quantity::intensity || traits_of(task.picture(g).scene).even ||
        problem.pixels(g).pixels.size() < kFewestPixels ||
        !(high - low > kContrast * std::max(std::abs(high), std::abs(low))))
      return false;
  }
  // Behind a calibration what one picture misses is known from the calibration's frames.
  return task.frames() == 1 && !task.job.prior && task.unknowns.size() > 0;
}

/// Frames of one number each, enough of them to tell a pattern from what is fitted.
bool tells_row_patterns(const Task& task, const LeastSquares& problem) {
  constexpr int kFreedom = 8;
  for (int g = 0; g < task.frames(); ++g) {
    const Picture& picture = task.picture(g);
    const bool even = traits_of(picture.scene).even && picture.uneven.empty() && picture.effects.empty();
    if (task.observable(g).quantity != Quantity::intensity || (!even && problem.pixels(g).pixels.size() != 1))
      return false;
  }
  return task.unknowns.size() > 0 && task.frames() >= task.unknowns.size() + kFreedom;
}

/// What there is to say of a fit's residual; nothing where noise explains it.
struct LeftOver {
  Parted parted;
  Eigen::MatrixXd information;
  Inverse inverse;
  Discrepancy found;
  double sampled = 1;  ///< share of the pixels
};
std::optional<LeftOver> left_over(const Task& task, const Optimum& optimum) {
  const LeastSquares& problem = *optimum.problem;
  if (optimum.stopped) return std::nullopt;
  const bool rows = tells_row_patterns(task, problem);
  if (!rows && !tells_patterns(task, problem)) return std::nullopt;
  constexpr double kPixels = 40000;  // they tell a discrepancy as well as all of them
  double pixels = rows ? task.frames() : static_cast<double>(problem.pixel_rows());
  Parted sums =
      rows ? parted_rows(task, problem) : parted(task, problem, static_cast<Eigen::Index>(std::ceil(pixels / kPixels)));
  const Eigen::MatrixXd all = problem.factor(true), data = problem.factor(false),
                        prior = all.transpose() * all - data.transpose() * data;
  double chi_square = 0, used = 0;
  for (int g = 0; g < task.frames(); ++g) chi_square += problem.frame_misfit(g).chi_square;
  for (const Sums& s : sums.pictures) used += s.pixels;
  Eigen::MatrixXd information;
  Inverse inverse;
  Discrepancy found;
  // A misfit of thousands of times the noise leaves no digits for sums in units of that.
  constexpr double kLargest = 100;
  sums.measure_by(std::max(1.0, chi_square / pixels / kLargest));
  // A noise that is larger than it was thought to be is no pattern: in its units they are sought again.
  constexpr int kTimes = 3;
  constexpr double kAsThought = 1.1;
  for (int time = 0; time < kTimes; ++time) {
    if (time > 0) sums.measure_by(found.white);
    information = prior;
    for (const Sums& s : sums.pictures) information += s.jj;
    inverse = invert_normal_equations(Eigen::MatrixXd(information.llt().matrixU()));
    if (std::count(inverse.undetermined.begin(), inverse.undetermined.end(), true) > 0) return std::nullopt;
    found = ByPatterns(sums.pictures, information, inverse.covariance)();
    if (found.white < kAsThought) break;
  }
  constexpr double kEvidence = 15;  // clean pictures stay below it (NoDepartureIsAskedForInCleanPictures)
  // What noise does not explain is charged by its own size, too: what has no size of its own needs a pattern to be
  // seen.
  const bool round = !rows && traits_of(task.picture(0).scene).round;
  const bool beyond_noise = round && chi_square / pixels > 1 + 3 * std::sqrt(2 / pixels);
  if (!beyond_noise && !(found.evidence > kEvidence)) return std::nullopt;
  return LeftOver{std::move(sums), std::move(information), std::move(inverse), std::move(found), used / pixels};
}

}  // namespace

double missed_of_contrast(const Task& task, const Optimum& optimum) {
  const LeastSquares& problem = *optimum.problem;
  const Eigen::ArrayXd sigma = problem.pixels(0).sigma.array(),
                       residual = problem.noise_whitened_residual(0).array() * sigma;
  const auto [low, high] = problem.intensity_range(0);
  const double missed = std::sqrt(std::max(0.0, (residual.square() - sigma.square()).mean()));
  return missed / std::max(std::abs(task.gain_of(0, optimum.theta)) * (high - low), 1e-300);
}

bool leaves_discrepancy(const Task& task, const Optimum& optimum) { return left_over(task, optimum).has_value(); }

std::vector<Eigen::MatrixXd> covariances_by_discrepancy(const Task& task, const Optimum& optimum) {
  constexpr double kFactor = 1.5;
  const std::optional<LeftOver> left = left_over(task, optimum);
  if (!left) return {};
  std::vector<Eigen::MatrixXd> all{left->found.white * left->sampled * left->inverse.covariance +
                                   left->found.covariance};
  for (const Partition& partition : left->parted.within) all.push_back(by_parts(partition, left->information));
  std::erase_if(all, [](const Eigen::MatrixXd& covariance) { return !covariance.allFinite(); });
  for (Eigen::MatrixXd& covariance : all) covariance *= kFactor * kFactor;
  return all;
}

}  // namespace birefit::estimation
