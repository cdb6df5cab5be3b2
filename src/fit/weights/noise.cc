#include "fit/weights/noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "core/robust.h"

namespace birefit::estimation {
namespace {

/// Variance of rounding to whole counts.
constexpr double kQuantisation = 1.0 / 12;

/// Value per count: 1, or 1 / (parallel - dark) where calibration frames turned counts into transmission.
double value_per_count(const Micrograph& micrograph, int x, int y) {
  return micrograph.variance_scale.empty() ? 1.0 : std::sqrt(micrograph.variance_scale(x, y));
}

struct Sample {
  double signal, difference;  // counts; difference has the variance of one pixel
};

/// Differences that cancel smooth structure. The tensor product of (1 -4 6 -4 1) with itself answers to a fringe of
/// 8 pixels along the diagonal with 1e-4 of its amplitude where Immerkaer's 3 x 3 mask (CVIU 64, 300, 1996), the
/// tensor product of (1 -2 1), still answers with 1e-2; it needs more room, so the small mask is the second choice.
/// The signal is the mean under the squared mask: exactly what the variance of the difference depends on when the
/// pixel variance is linear in the signal.
template <int N>
std::vector<Sample> differences(const Micrograph& micrograph, const Image* fitted, const std::array<double, N>& mask) {
  constexpr int kHalf = N / 2;
  double norm = 0;
  for (const double m : mask) norm += m * m;
  std::vector<Sample> samples;
  const int width = micrograph.values.width(), height = micrograph.values.height();
  for (int y = kHalf; y + kHalf < height; ++y)
    for (int x = kHalf; x + kHalf < width; ++x) {
      double difference = 0, signal = 0;
      bool usable = true;
      for (int j = -kHalf; j <= kHalf && usable; ++j)
        for (int i = -kHalf; i <= kHalf; ++i) {
          usable = usable && micrograph.mask(x + i, y + j);
          if (!usable) break;
          const double m = mask[i + kHalf] * mask[j + kHalf], value = micrograph.values(x + i, y + j);
          const double model = fitted ? (*fitted)(x + i, y + j) : 0;
          difference += m * (value - model);
          signal += m * m * (fitted ? model : value);
        }
      if (!usable) continue;
      const double unit = value_per_count(micrograph, x, y);
      samples.push_back({signal / (norm * norm) / unit, difference / norm / unit});
    }
  return samples;
}

/// Variance floor in counts^2: rounding for integer data, else what doubles and renderers cannot resolve.
double variance_floor(const Micrograph& micrograph) {
  bool integers = true;
  double largest = 0;
  for (int y = 0; y < micrograph.values.height(); ++y)
    for (int x = 0; x < micrograph.values.width(); ++x)
      if (micrograph.mask(x, y)) {
        const double value = micrograph.values(x, y);
        integers = integers && value == std::floor(value);
        largest = std::max(largest, std::abs(value) / value_per_count(micrograph, x, y));
      }
  // Calibrated values come from counts and inherit their rounding.
  if ((integers && largest > 1) || !micrograph.variance_scale.empty()) return kQuantisation;
  return std::max(1e-10 * largest * largest, 1e-300);
}

}  // namespace

NoiseModel estimate_noise(const Micrograph& micrograph, const Image* fitted) {
  constexpr std::size_t kEnough = 200;
  std::vector<Sample> samples = differences<5>(micrograph, fitted, {1, -4, 6, -4, 1});
  if (samples.size() < kEnough) samples = differences<3>(micrograph, fitted, {1, -2, 1});
  NoiseModel noise;
  noise.estimated = true;
  const double floor = variance_floor(micrograph);
  noise.read_counts = std::sqrt(floor);
  if (samples.size() < 9) return noise;
  std::sort(samples.begin(), samples.end(), [](const Sample& a, const Sample& b) {
    return a.signal != b.signal ? a.signal < b.signal : a.difference < b.difference;
  });

  // One robust variance per signal bin: the median absolute deviation ignores dust, edges and the defect.
  struct Bin {
    double signal, variance, count;
  };
  std::vector<Bin> bins;
  const std::size_t number = std::clamp<std::size_t>(samples.size() / 100, 1, 24);
  // Bins of equal width in signal see the bright and the dark end alike; those with too few samples are skipped.
  const double low = samples[samples.size() / 200].signal,
               high = samples[samples.size() - 1 - samples.size() / 200].signal;
  std::vector<std::vector<double>> absolute(number);
  std::vector<double> signal_sum(number, 0.0);
  for (const Sample& sample : samples) {
    const double position = high > low ? (sample.signal - low) / (high - low) : 0;
    const auto bin = static_cast<std::size_t>(std::clamp(position * static_cast<double>(number), 0.0, number - 1.0));
    absolute[bin].push_back(std::abs(sample.difference));
    signal_sum[bin] += sample.signal;
  }
  for (std::size_t i = 0; i < number; ++i) {
    if (absolute[i].size() < std::min<std::size_t>(30, samples.size())) continue;
    const double count = static_cast<double>(absolute[i].size());
    const double sd = kNormalSdPerMad * median(absolute[i]);
    bins.push_back({std::max(0.0, signal_sum[i] / count), std::max(sd * sd, floor), count});
  }
  if (bins.empty()) return noise;

  // Weighted straight line with both coefficients >= 0. A robust variance has the relative error ~ 2/sqrt(count):
  // weights come from the fitted line, not from the scattering variances themselves, which would favour low ones.
  double constant = 0, slope = 0;
  for (int pass = 0; pass < 4; ++pass) {
    double w0 = 0, wx = 0, wxx = 0, wy = 0, wxy = 0;
    for (const Bin& bin : bins) {
      const double expected = pass ? constant + slope * bin.signal : bin.variance;
      const double w = bin.count / (expected * expected);
      w0 += w, wx += w * bin.signal, wxx += w * bin.signal * bin.signal;
      wy += w * bin.variance, wxy += w * bin.signal * bin.variance;
    }
    const double determinant = w0 * wxx - wx * wx;
    const bool line = determinant > 1e-9 * w0 * wxx;
    constant = line ? (wxx * wy - wx * wxy) / determinant : wy / w0;
    slope = line ? (w0 * wxy - wx * wy) / determinant : 0;
    if (slope < 0) constant = wy / w0, slope = 0;
    if (constant < floor) {
      constant = floor;
      slope = wxx > 0 ? std::max(0.0, (wxy - floor * wx) / wxx) : 0;
    }
  }
  noise.read_counts = std::sqrt(std::max(constant, floor));
  noise.counts_per_photon = slope;
  return noise;
}

Image smoothed(const Micrograph& micrograph) {
  const int width = micrograph.values.width(), height = micrograph.values.height();
  Image result(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      double sum = 0, count = 0;
      for (int j = std::max(0, y - 1); j <= std::min(height - 1, y + 1); ++j)
        for (int i = std::max(0, x - 1); i <= std::min(width - 1, x + 1); ++i)
          if (micrograph.mask(i, j)) sum += micrograph.values(i, j), ++count;
      result(x, y) = count > 0 ? sum / count : 0;
    }
  return result;
}

Image standard_deviation(const Micrograph& micrograph, const NoiseModel& noise, const Image& signal) {
  const int width = micrograph.values.width(), height = micrograph.values.height();
  double read_variance = noise.read_counts * noise.read_counts;
  // A model without read noise still has the rounding, or no dark pixel could be weighted.
  if (!(read_variance > 0)) read_variance = variance_floor(micrograph);
  Image result(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const double unit = value_per_count(micrograph, x, y);
      const double counts = unit > 0 ? std::max(0.0, signal(x, y)) / unit : 0;
      result(x, y) = unit * std::sqrt(read_variance + noise.counts_per_photon * counts);
    }
  return result;
}

double mean_variance(const Micrograph& micrograph, const NoiseModel& noise, const Image& signal) {
  const Image sd = standard_deviation(micrograph, noise, signal);
  double sum = 0, count = 0;
  for (int y = 0; y < sd.height(); ++y)
    for (int x = 0; x < sd.width(); ++x)
      if (micrograph.mask(x, y) && std::isfinite(sd(x, y))) sum += sd(x, y) * sd(x, y), ++count;
  return count > 0 ? sum / count : 0;
}

}  // namespace birefit::estimation
