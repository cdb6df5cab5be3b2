// Does an interval hold what it says? Images simulated at the estimate, fitted from scratch.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>

#include "birefit/fit.h"
#include "core/threads.h"
#include "fit/errors/statistics.h"
#include "fit/problem/shared_zeros.h"
#include "fit/weights/noise.h"

namespace birefit {
namespace {

using namespace estimation;

/// The fit's residual in units of its noise, cut into squares that are drawn with replacement and turned in sign
/// (moving blocks: H. R. Kuensch, Ann. Stat. 17, 1217 (1989)). Squares are twice as wide as what neighbours share.
/// (Moved as a whole it would lack what the fit has taken out of it: slow variations.) A pixel whose source was not
/// used keeps its own.
Image resampled_residual(const MicrographResult& of, std::mt19937_64& random) {
  const int width = of.residual.width(), height = of.residual.height();
  Image whitened(width, height), noise(width, height);
  Mask used(width, height);
  int left = width, right = -1, top = height, bottom = -1;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const double r = of.residual(x, y) / of.sigma(x, y);
      if (!std::isfinite(r)) continue;
      whitened(x, y) = r;
      used(x, y) = 1;
      left = std::min(left, x), right = std::max(right, x), top = std::min(top, y), bottom = std::max(bottom, y);
    }
  if (right < 0) return noise;
  const int w = right - left + 1, h = bottom - top + 1;
  const auto below = [&](int n) { return static_cast<int>(random() % static_cast<std::uint64_t>(n)); };
  const int side = static_cast<int>(std::ceil(2 * std::sqrt(correlation_area(whitened, used))));
  const int start_x = left - below(side), start_y = top - below(side);
  for (int block_y = start_y; block_y <= bottom; block_y += side)
    for (int block_x = start_x; block_x <= right; block_x += side) {
      const int dx = below(w), dy = below(h);
      const double sign = below(2) ? 1 : -1;
      for (int y = std::max(top, block_y); y <= std::min(bottom, block_y + side - 1); ++y)
        for (int x = std::max(left, block_x); x <= std::min(right, block_x + side - 1); ++x) {
          if (!used(x, y)) continue;
          const int from_x = left + (x - left + dx) % w, from_y = top + (y - top + dy) % h;
          noise(x, y) = sign * (used(from_x, from_y) ? whitened(from_x, from_y) : whitened(x, y)) * of.sigma(x, y);
        }
    }
  return noise;
}

/// More than its noise, by the fit's own measure.
bool misfits(const MicrographResult& of) { return of.chi_square > of.used + 5 * std::sqrt(2.0 * of.used); }

/// What a camera with the fit's noise would have recorded.
Image simulated(const Picture& micrograph, const MicrographResult& of, std::mt19937_64& random) {
  Image values = of.fitted;
  if (misfits(of)) {
    const Image noise = resampled_residual(of, random);
    for (std::size_t i = 0; i < values.size(); ++i) values.values()[i] += noise.values()[i];
    return values;
  }
  const Image sd = standard_deviation(micrograph, of.noise, of.fitted);
  const bool photons =
      of.noise.counts_per_photon > 0 && of.noise.black_counts == 0 && micrograph.variance_scale.empty();
  std::normal_distribution<double> normal;
  for (std::size_t i = 0; i < values.size(); ++i) {
    double& value = values.values()[i];
    // Beyond a billion photons their noise is normal, and of no matter.
    if (photons && value > 0 && value < 1e9 * of.noise.counts_per_photon) {
      std::poisson_distribution<long> photon(value / of.noise.counts_per_photon);
      value = static_cast<double>(photon(random)) * of.noise.counts_per_photon + of.noise.read_counts * normal(random);
    } else {
      value += sd.values()[i] * normal(random);
    }
  }
  return values;
}

/// Priors are observations, too, and so is what was stated: another draw has seen other ones.
void redraw_priors(FitJob& job, const Theta& truth, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  for (int i = 0; i < job.parameters.size(); ++i) {
    Parameter& p = job.parameters[i];
    if (p.free && p.prior_sd)
      p.value = std::clamp(truth[static_cast<std::size_t>(i)] + *p.prior_sd * normal(random), p.lower, p.upper);
    else if (const double sd = p.known_to.of(p.value); !p.free && !p.linear && sd > 0)  // a gain's is a drift
      p.value = truth[static_cast<std::size_t>(i)] + sd * normal(random);
  }
  if (!job.prior) return;
  JointPrior& prior = *job.prior;
  Eigen::VectorXd drawn(prior.mean.size());
  for (double& x : drawn) x = normal(random);
  const Eigen::LDLT<Eigen::MatrixXd> root(prior.covariance);
  drawn = root.vectorD().cwiseMax(0.0).cwiseSqrt().cwiseProduct(drawn);
  drawn = root.transpositionsP().transpose() * Eigen::VectorXd(root.matrixL() * drawn);
  for (std::size_t k = 0; k < prior.names.size(); ++k)
    if (const ParameterRef ref = job.parameters.find(prior.names[k]); ref && job.parameters[ref].free)
      prior.mean[static_cast<Eigen::Index>(k)] =
          truth[static_cast<std::size_t>(ref.index)] + drawn[static_cast<Eigen::Index>(k)];
}

}  // namespace

Coverage measure_coverage(const FitJob& job, const FitResult& result, int draws) {
  Coverage coverage;
  coverage.of_residuals = std::any_of(result.micrographs.begin(), result.micrographs.end(), misfits);
  const FitJob whole = with_shared_zeros(job);  // a draw has another zero, and not another angle for every frame
  std::vector<std::optional<FitResult>> fits(static_cast<std::size_t>(std::max(0, draws)));
  const auto one = [&](int draw, int threads) {
    if (job.options.interrupted && job.options.interrupted->load()) return;
    std::mt19937_64 random(0x9e3779b97f4a7c15u * static_cast<std::uint64_t>(draw + 1));
    FitJob again = whole;
    again.options.progress = nullptr;
    again.options.samples = 0;
    again.options.threads = threads;
    std::size_t sight = 0;
    for (Measurement& measurement : again.measurements) {
      if (Picture* m = std::get_if<Picture>(&measurement)) {
        const Image drawn = simulated(*m, result.micrographs[sight++], random);
        for (std::size_t i = 0; i < drawn.size(); ++i)
          if (m->mask.values()[i]) m->values.values()[i] = drawn.values()[i];
        continue;
      }
      Readings& readings = std::get<Readings>(measurement);
      const Picture as_they_are;  // neither calibrated nor masked
      for (Eigen::Index at = 0; at < readings.values.size();) {
        const Image drawn = simulated(as_they_are, result.micrographs[sight++], random);
        for (const double value : drawn.values()) readings.values[at++] = value;
      }
    }
    redraw_priors(again, result.theta, random);
    FitResult refit;
    try {
      refit = fit(again);
    } catch (const UserError&) {  // a model too large on the way: a draw without an answer
      refit = {};
    }
    for (MicrographResult& m : refit.micrographs) m = {};  // images of hundreds of draws
    if (!refit.interrupted) fits[static_cast<std::size_t>(draw)] = std::move(refit);
  };
  // A fit keeps two cores busy about half the time; two fits beside each other keep them busy.
  const int threads = thread_count(job.options.threads);
  parallel_for(draws, threads, [&](int draw) { one(draw, 1); });

  for (const ParameterEstimate& p : result.parameters) coverage.parameters.push_back({p.name, 0, 0, 0, 0});
  std::vector<double> squares(coverage.parameters.size(), 0.0), errors(squares), sum(squares), number(squares);
  for (const std::optional<FitResult>& refit : fits) {
    if (!refit) continue;
    ++coverage.draws;
    if (!refit->has_answer()) continue;
    ++coverage.answered;
    bool wrong = false;
    for (std::size_t j = 0; j < coverage.parameters.size(); ++j) {
      const ParameterEstimate& truth = result.parameters[j];
      const auto same = [&](const ParameterEstimate& p) { return p.name == truth.name; };
      const auto found = std::find_if(refit->parameters.begin(), refit->parameters.end(), same);
      if (found == refit->parameters.end()) {  // another branch
        wrong = true;
        continue;
      }
      const double off = found->value - truth.value, sd = found->stderr_;
      Coverage::Of& of = coverage.parameters[j];
      of.inside68 += std::abs(off) <= sd * student_t_quantile(0.8413447460685429, refit->interval_degrees_of_freedom);
      of.inside95 += found->interval95_low <= truth.value && truth.value <= found->interval95_high;
      sum[j] += off, squares[j] += off * off, errors[j] += sd, ++number[j];
      wrong = wrong || (!found->linear && found->limit.empty() && std::abs(off) > 5 * sd);
    }
    coverage.wrong += wrong;
  }
  for (std::size_t j = 0; j < coverage.parameters.size(); ++j) {
    const double n = number[j];
    if (n == 0) continue;
    Coverage::Of& of = coverage.parameters[j];
    of.inside68 /= n;
    of.inside95 /= n;
    of.spread = n > 1 ? std::sqrt(std::max(0.0, squares[j] - sum[j] * sum[j] / n) / (n - 1)) / (errors[j] / n) : 0;
    of.bias = sum[j] / errors[j];
  }
  return coverage;
}

}  // namespace birefit
