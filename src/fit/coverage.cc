// Does an interval hold what it says? Images simulated at the estimate, fitted from scratch.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>

#include "birefit/fit.h"
#include "core/threads.h"
#include "fit/noise.h"
#include "fit/statistics.h"

namespace birefit {
namespace {

using namespace estimation;

/// The fit's residual in units of its noise, shifted round the image by a random step and turned in sign: what neighbours share they
/// still share (a moving-block bootstrap with one block). Only between pixels that were used.
Image moved_residual(const MicrographResult& of, std::mt19937_64& random) {
  const int w = of.residual.width(), h = of.residual.height();
  const int dx = static_cast<int>(random() % static_cast<std::uint64_t>(w)), dy = static_cast<int>(random() % static_cast<std::uint64_t>(h));
  const double sign = random() % 2 ? 1 : -1;
  Image noise(w, h);
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x) {
      const int from_x = (x + dx) % w, from_y = (y + dy) % h;
      const double whitened = of.residual(from_x, from_y) / of.sigma(from_x, from_y);
      noise(x, y) = std::isfinite(whitened) ? sign * whitened * of.sigma(x, y) : 0;
    }
  return noise;
}

/// What a camera with the fit's noise would have recorded.
Image simulated(const Micrograph& micrograph, const MicrographResult& of, bool residuals, std::mt19937_64& random) {
  Image values = of.fitted;
  if (residuals) {
    const Image noise = moved_residual(of, random);
    for (std::size_t i = 0; i < values.size(); ++i) values.values()[i] += noise.values()[i];
    return values;
  }
  const Image sd = standard_deviation(micrograph, of.noise, of.fitted);
  const bool photons = of.noise.counts_per_photon > 0 && micrograph.variance_scale.empty();
  std::normal_distribution<double> normal;
  for (std::size_t i = 0; i < values.size(); ++i) {
    double& value = values.values()[i];
    if (photons && value > 0) {
      std::poisson_distribution<long> photon(value / of.noise.counts_per_photon);
      value = static_cast<double>(photon(random)) * of.noise.counts_per_photon + of.noise.read_counts * normal(random);
    } else {
      value += sd.values()[i] * normal(random);
    }
  }
  return values;
}

}  // namespace

Coverage measure_coverage(const FitJob& job, const FitResult& result, int draws) {
  Coverage coverage;
  // The share of the misfit in the weights; 1.2 is a noise model that is a little off.
  constexpr double kMoreThanNoise = 1.2;
  coverage.of_residuals = result.reduced_chi_square > kMoreThanNoise;
  std::vector<std::optional<FitResult>> fits(static_cast<std::size_t>(std::max(0, draws)));
  const auto one = [&](int draw, int threads) {
    if (job.options.interrupted && job.options.interrupted->load()) return;
    std::mt19937_64 random(0x9e3779b97f4a7c15u * static_cast<std::uint64_t>(draw + 1));
    FitJob again = job;
    again.options.progress = nullptr;
    again.options.threads = threads;
    for (std::size_t g = 0; g < again.micrographs.size(); ++g) {
      Micrograph& m = again.micrographs[g];
      const Image drawn = simulated(m, result.micrographs[g], coverage.of_residuals, random);
      for (std::size_t i = 0; i < drawn.size(); ++i)
        if (m.mask.values()[i]) m.values.values()[i] = drawn.values()[i];
    }
    FitResult refit = fit(again);
    for (MicrographResult& m : refit.micrographs) m = {};  // images of hundreds of draws
    if (!refit.interrupted) fits[static_cast<std::size_t>(draw)] = std::move(refit);
  };
  // A fit keeps two cores busy about half the time; two fits beside each other keep them busy.
  const int threads = thread_count(job.options.threads);
  parallel_for(draws, threads, [&](int draw) { one(draw, 1); });

  for (const ParameterEstimate& p : result.parameters) coverage.parameters.push_back({p.name, 0, 0, 0, 0});
  std::vector<double> squares(coverage.parameters.size(), 0.0), errors(squares), sum(squares);
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
      sum[j] += off, squares[j] += off * off, errors[j] += sd;
      wrong = wrong || (!found->linear && found->limit.empty() && std::abs(off) > 5 * sd);
    }
    coverage.wrong += wrong;
  }
  const double n = coverage.answered;
  for (std::size_t j = 0; j < coverage.parameters.size() && n > 0; ++j) {
    Coverage::Of& of = coverage.parameters[j];
    of.inside68 /= n;
    of.inside95 /= n;
    of.spread = n > 1 ? std::sqrt(std::max(0.0, squares[j] - sum[j] * sum[j] / n) / (n - 1)) / (errors[j] / n) : 0;
    of.bias = sum[j] / errors[j];
  }
  return coverage;
}

}  // namespace birefit
