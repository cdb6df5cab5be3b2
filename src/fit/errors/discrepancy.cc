#include "fit/errors/discrepancy.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "fit/errors/statistics.h"
#include "fit/problem/effects.h"
#include "samples/kind.h"
#include "scene/values.h"

namespace birefit::estimation {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr int kParts = 12;  ///< sectors, and rings

/// Where a pixel lies: from -1 to 1 along the picture's longer side, and about the sphere.
struct Place {
  double x, y, radius, azimuth;  ///< of the picture; in sphere's radii, and from the polarizer on
};

/// What discrepancies look like, in groups of patterns that are as likely as one another.
class Patterns {
 public:
  Patterns() {
    const auto add_group = [this](int patterns) {
      group_.insert(group_.end(), static_cast<std::size_t>(patterns), groups_++);
    };
    // By the order in which of() lists them.
    add_group(5), add_group(22), add_group(9), add_group(2);
    add_group(6), add_group(8), add_group(10), add_group(18);
    add_group(3), add_group(1);
  }
  int count() const { return static_cast<int>(group_.size()); }
  int groups() const { return groups_; }
  int group(int pattern) const { return group_[static_cast<std::size_t>(pattern)]; }
  /// `light`: the model's, from 0 to 1 over the picture, and how it changes by these effects.
  struct Light {
    double value, stretched_along_x, stretched_along_diagonal, grown, blurred;
  };
  void of(const Place& at, const Light& light, Eigen::Ref<Eigen::VectorXd> out) const {
    int k = 0;
    const auto wave = [&](int i, int j) {
      return std::cos(kPi * i * 0.5 * (at.x + 1)) * std::cos(kPi * j * 0.5 * (at.y + 1));
    };
    const auto waves = [&](int from, int to, double factor) {
      for (int order = from; order <= to; ++order)
        for (int i = 0; i <= order; ++i) out[k++] = factor * wave(i, order - i);
    };
    waves(1, 2, 1), waves(3, 6, 1);  // light that is added, slow and faster
    waves(1, 3, light.value);        // that light is multiplied by
    // A camera that is not linear.
    out[k++] = light.value * light.value, out[k++] = light.value * light.value * light.value;
    // Rings: of a cross between polarizers, of all azimuths, of others.
    constexpr double kReach = 1.3;
    const bool inside = at.radius < kReach;
    const double t = kPi * at.radius / kReach, c2 = std::cos(2 * at.azimuth), s2 = std::sin(2 * at.azimuth);
    const auto ring = [&](int order, double by) { out[k++] = inside ? std::cos(order * t) * by : 0; };
    for (int order = 0; order < 14; ++order) ring(order, s2 * s2);
    for (int order = 0; order < 10; ++order) ring(order, 1);
    for (int order = 0; order < 6; ++order) ring(order, c2), ring(order, 2 * s2 * c2), ring(order, c2 * s2 * s2);
    // Out of round, or pixels out of square: then its size is uncertain by as much, which itself leaves no trace.
    out[k++] = light.stretched_along_x, out[k++] = light.stretched_along_diagonal, out[k++] = light.grown;
    out[k++] = light.blurred;  // blurred or sharpened
  }

 private:
  std::vector<int> group_;
  int groups_ = 0;
};

/// Sums over the pixels, in units of the noise: J the unknowns' columns, B the patterns', r the residual.
struct Sums {
  Eigen::MatrixXd jj, jb, bb;
  Eigen::VectorXd jr, br;
  double rr = 0, pixels = 0;
  struct Part {
    Eigen::MatrixXd jj;
    Eigen::VectorXd jr;
  };
  std::vector<Part> sectors, rings;
};

/// The model's light over the picture, from 0 to 1.
KnownLight light_of(const LeastSquares& problem, const View& view, const Theta& theta) {
  const std::array<double, 2> range = problem.intensity_range(0);
  const double contrast = std::max(range[1] - range[0], 1e-300);
  return {view, theta, problem.pixels(0).pixels, (problem.intensity().array() - range[0]).matrix() / contrast};
}
Patterns::Light patterns_light(const KnownLight& light, int x, int y) {
  using Kind = PictureEffect::Kind;
  return {light.light(x, y), effect_at(Kind::stretch_x, light, x, y), effect_at(Kind::stretch_diagonal, light, x, y),
          effect_at(Kind::growth, light, x, y), effect_at(Kind::blur, light, x, y)};
}

/// Over every stride-th pixel.
Sums sums_of(const Task& task, const Optimum& optimum, const Patterns& patterns, Eigen::Index stride) {
  const LeastSquares& problem = *optimum.problem;
  const PixelSet& set = problem.pixels(0);
  const Scene& scene = task.picture(0).scene;
  const Values<double> value(optimum.theta, {});
  const double center_x = value(scene.view.center_x_px), center_y = value(scene.view.center_y_px),
               radius_px = 0.5 * value(traits_of(scene).sphere_diameter_um) / value(scene.view.pixel_size_um),
               from = value.radians(scene.microscope.polarizer_deg),
               half_side = 0.5 * std::max(scene.view.width, scene.view.height);
  const KnownLight light = light_of(problem, scene.view, optimum.theta);
  const Eigen::Index n = task.unknowns.size(), m = patterns.count();
  const Sums::Part none{Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n)};
  Sums sums{Eigen::MatrixXd::Zero(n, n),
            Eigen::MatrixXd::Zero(n, m),
            Eigen::MatrixXd::Zero(m, m),
            Eigen::VectorXd::Zero(n),
            Eigen::VectorXd::Zero(m),
            0,
            0,
            std::vector<Sums::Part>(kParts, none),
            std::vector<Sums::Part>(kParts, none)};
  problem.for_noise_whitened_rows(0, [&](Eigen::Index begin, const Eigen::MatrixXd& all_rows,
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
      const auto [x, y] = set.pixels[static_cast<std::size_t>(pixel)];
      const double dx = x - center_x, dy = center_y - y;
      const Place place{(x + 0.5) / half_side - 1, (y + 0.5) / half_side - 1, std::hypot(dx, dy) / radius_px,
                        std::atan2(dy, dx) - from};
      patterns.of(place, patterns_light(light, x, y), pattern);
      columns.row(i) = pattern.transpose() / set.sigma[pixel];
      const double turn = place.azimuth / (2 * kPi);
      // Eleven rings to just beyond the rim, and all that is outside.
      const auto sector = static_cast<std::size_t>(kParts * (turn - std::floor(turn))) % kParts;
      const auto ring = static_cast<std::size_t>(std::min(kParts - 1.0, place.radius / 1.05 * (kParts - 1)));
      for (Sums::Part* part : {&sums.sectors[sector], &sums.rings[ring]}) {
        part->jj.selfadjointView<Eigen::Lower>().rankUpdate(rows.row(i).transpose());
        part->jr += rows.row(i).transpose() * residual[i];
      }
    }
    sums.jj += rows.transpose() * rows, sums.jb += rows.transpose() * columns, sums.bb += columns.transpose() * columns;
    sums.jr += rows.transpose() * residual, sums.br += columns.transpose() * residual;
    sums.rr += residual.squaredNorm(), sums.pixels += static_cast<double>(rows.rows());
  });
  for (std::vector<Sums::Part>* parts : {&sums.sectors, &sums.rings})
    for (Sums::Part& part : *parts) part.jj = Eigen::MatrixXd(part.jj.selfadjointView<Eigen::Lower>());
  // Patterns of rms 1.
  Eigen::VectorXd scale = (sums.bb.diagonal() / sums.pixels).cwiseSqrt();
  scale = scale.unaryExpr([](double v) { return v > 0 ? 1 / v : 0.0; });
  sums.bb = scale.asDiagonal() * sums.bb * scale.asDiagonal();
  sums.jb = sums.jb * scale.asDiagonal();
  sums.br = scale.cwiseProduct(sums.br);
  return sums;
}

struct Discrepancy {
  double evidence;             ///< twice the log of the likelihood ratio against noise alone
  double white;                ///< variance of what no pattern explains, over the noise's
  Eigen::MatrixXd covariance;  ///< of the unknowns, by a discrepancy of the size that the residual shows
};
/// `c`: the unknowns' covariance by noise alone.
Discrepancy by_patterns(const Patterns& patterns, const Sums& s, const Eigen::MatrixXd& c) {
  const Eigen::Index m = patterns.count(), p = c.rows();
  const Eigen::MatrixXd g = s.bb - s.jb.transpose() * c * s.jb;
  const Eigen::VectorXd h = s.br - s.jb.transpose() * (c * s.jr);
  const double excess = std::max(s.rr / s.pixels - 1, 3 * std::sqrt(2 / s.pixels));
  Eigen::VectorXd v = Eigen::VectorXd::Constant(patterns.groups(), excess / static_cast<double>(m));
  Eigen::VectorXd of_pattern(m), found = Eigen::VectorXd::Zero(m);
  double free = 0, evidence = 0;
  const auto spread = [&] {
    for (Eigen::Index k = 0; k < m; ++k) of_pattern[k] = v[patterns.group(static_cast<int>(k))];
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
      const int group = patterns.group(static_cast<int>(k));
      const double share = of_pattern[k] > 0 ? 1 - sigma(k, k) / of_pattern[k] : 0;
      squares[group] += found[k] * found[k], known[group] += share, free += share;
    }
    const Eigen::VectorXd before = v;
    for (Eigen::Index group = 0; group < v.size(); ++group)
      v[group] = known[group] > 1e-9 ? squares[group] / known[group] : 0;
    if ((v - before).cwiseAbs().maxCoeff() <= 1e-3 * before.maxCoeff()) break;
  }
  spread();
  // What no pattern explains is white, and scales what noise does.
  const Eigen::VectorXd pull = s.jr - s.jb * found, moved = c * pull;
  const double rest =
      s.rr - 2 * found.dot(s.br) + found.dot(s.bb * found) - 2 * pull.dot(moved) + moved.dot(s.jj * moved);
  const double white = std::max(1.0, rest / std::max(1.0, s.pixels - static_cast<double>(p) - free));
  const Eigen::MatrixXd influence = c * s.jb;
  return {evidence, white, influence * of_pattern.asDiagonal() * influence.transpose()};
}

/// The variances of the unknowns by fits without a part at a time, nearly all of it.
Eigen::VectorXd by_parts(const std::vector<Sums::Part>& parts, const Eigen::MatrixXd& information) {
  constexpr double kLeftOut = 0.98;
  const double m = static_cast<double>(parts.size());
  Eigen::VectorXd mean_pull = Eigen::VectorXd::Zero(information.rows());
  for (const Sums::Part& part : parts) mean_pull += part.jr / m;
  std::vector<Eigen::VectorXd> steps;
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(information.rows()), variance = mean;
  for (const Sums::Part& part : parts) {
    steps.push_back(-(information - kLeftOut * part.jj).ldlt().solve(part.jr - mean_pull));
    mean += steps.back() / m;
  }
  for (const Eigen::VectorXd& step : steps) variance += (step - mean).cwiseAbs2() * (m - 1) / m;
  return variance;
}

/// What there is to say of a fit's residual; nothing where it is not one picture of a sphere, or where noise explains
/// it.
struct LeftOver {
  Sums sums;
  Eigen::MatrixXd information;
  Inverse inverse;
  Discrepancy found;
  double pixels = 0;
};
std::optional<LeftOver> left_over(const Task& task, const Optimum& optimum) {
  const bool spheres = task.frames() == 1 && task.observable(0).quantity == Quantity::intensity &&
                       traits_of(task.picture(0).scene).sphere_diameter_um;
  if (!spheres || task.unknowns.size() == 0 || optimum.stopped) return std::nullopt;
  const LeastSquares& problem = *optimum.problem;
  const double pixels = static_cast<double>(problem.pixel_rows()), chi_square = problem.frame_misfit(0).chi_square;
  const Patterns patterns;
  constexpr double kPixels = 40000;  // they tell a discrepancy as well as all of them
  const Eigen::Index stride = static_cast<Eigen::Index>(std::ceil(pixels / kPixels));
  Sums sums = sums_of(task, optimum, patterns, stride);
  const Eigen::MatrixXd all = problem.factor(true), data = problem.factor(false);
  Eigen::MatrixXd information = sums.jj + (all.transpose() * all - data.transpose() * data);
  Inverse inverse = invert_normal_equations(Eigen::MatrixXd(information.llt().matrixU()));
  if (std::count(inverse.undetermined.begin(), inverse.undetermined.end(), true) > 0) return std::nullopt;
  Discrepancy found = by_patterns(patterns, sums, inverse.covariance);
  constexpr double kEvidence = 15;  // clean pictures stay below it (NoDepartureIsAskedForInCleanPictures)
  if (!(chi_square / pixels > 1 + 3 * std::sqrt(2 / pixels)) && !(found.evidence > kEvidence)) return std::nullopt;
  return LeftOver{std::move(sums), std::move(information), std::move(inverse), std::move(found), pixels};
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

Eigen::VectorXd sd_of_discrepancy(const Task& task, const Optimum& optimum) {
  constexpr double kFactor = 1.5;
  const std::optional<LeftOver> left = left_over(task, optimum);
  if (!left) return {};
  Eigen::VectorXd variance =
      (left->found.white * left->sums.pixels / left->pixels * left->inverse.covariance + left->found.covariance)
          .diagonal();
  for (const auto* parts : {&left->sums.sectors, &left->sums.rings})
    variance = variance.cwiseMax(by_parts(*parts, left->information));
  return variance.allFinite() ? Eigen::VectorXd(kFactor * variance.cwiseMax(0).cwiseSqrt()) : Eigen::VectorXd();
}

}  // namespace birefit::estimation
