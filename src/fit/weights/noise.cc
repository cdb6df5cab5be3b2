#include "fit/weights/noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "core/robust.h"
#include "core/sub_grid.h"

namespace birefit::estimation {
namespace {

/// Variance of rounding to codes one apart.
constexpr double kQuantisation = 1.0 / 12;

/// Value per count: 1, or 1 / (parallel - dark) where calibration frames turned counts into transmission.
double value_per_count(const Picture& micrograph, int x, int y) {
  return micrograph.variance_scale.empty() ? 1.0 : std::sqrt(micrograph.variance_scale(x, y));
}

/// The values that pixels take (counts): how far apart codes are, and whether the lowest one holds what was cut off.
class Codes {
 public:
  explicit Codes(const Picture& micrograph) {
    const int width = micrograph.values.width(), height = micrograph.values.height();
    constexpr std::size_t kEnough = 1 << 18;  // pixels that tell it
    const std::size_t stride = 1 + micrograph.values.size() / kEnough;
    std::vector<double> values;
    bool integers = true;
    std::size_t next = 0;
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        if (!micrograph.mask(x, y) || next++ % stride != 0) continue;
        values.push_back(micrograph.values(x, y) / value_per_count(micrograph, x, y));
        integers = integers && values.back() == std::floor(values.back());
        largest_ = std::max(largest_, std::abs(values.back()));
      }
    std::sort(values.begin(), values.end());
    std::vector<double> times;
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (i == 0 || values[i] != values[i - 1]) distinct_.push_back(values[i]), times.push_back(0);
      ++times.back();
    }
    // Where codes are met many times each (more often than symmetry repeats a value of doubles), those between them
    // do not exist. Elsewhere counts are whole, and calibrated values come from counts and inherit their rounding.
    constexpr double kMet = 12;
    const bool calibrated = !micrograph.variance_scale.empty();
    all_met_ = !calibrated && distinct_.size() > 2 && median(times) > kMet && evenly_spaced();
    whole_ = (integers && largest_ > 1) || calibrated;
    // As for saturation: a fringe's dark line puts up to three times the pixels of the next codes into its lowest one.
    constexpr double kPileUpRatio = 4, kPileUpFraction = 0.002, kPileUpPixels = 20;
    const double fewest = std::max(kPileUpPixels, kPileUpFraction * static_cast<double>(values.size()));
    const bool can_tell = distinct_.size() > 3 && times[0] >= fewest;
    if (can_tell && times[0] > kPileUpRatio * (times[1] + times[2] + times[3]) / 3) cut_ = distinct_[0];
  }

  /// The lowest code where pixels pile up at it: whatever was darker was cut off there and scatters no more.
  std::optional<double> cut() const { return cut_; }

  /// Distance of neighbouring codes between two signals; 0 where values are not rounded.
  double step(double low, double high) const {
    if (!all_met_) return whole_ ? 1 : 0;
    const auto last = std::prev(distinct_.end());
    const auto from = std::min(std::lower_bound(distinct_.begin(), distinct_.end(), low), std::prev(last));
    const auto to = std::max(std::lower_bound(from, last, high), std::next(from));
    return (*to - *from) / static_cast<double>(to - from);
  }

  /// Variance below which nothing can be told (counts^2): of rounding, else what doubles and renderers cannot resolve.
  double floor() const {
    double finest = step(-largest_, largest_);
    for (std::size_t i = 1; all_met_ && i < distinct_.size(); ++i)
      finest = std::min(finest, distinct_[i] - distinct_[i - 1]);
    return finest > 0 ? kQuantisation * finest * finest : std::max(1e-10 * largest_ * largest_, 1e-300);
  }

 private:
  /// Codes follow each other at like distances, also where a curve or a stretch of contrast widened some: nearly all
  /// neighbouring distances within a factor of two. Of values that a picture merely repeats a third are.
  bool evenly_spaced() const {
    std::size_t alike = 0;
    for (std::size_t i = 2; i < distinct_.size(); ++i) {
      const double before = distinct_[i - 1] - distinct_[i - 2], after = distinct_[i] - distinct_[i - 1];
      alike += after <= 2 * before && before <= 2 * after;
    }
    return 5 * alike >= 4 * (distinct_.size() - 2);
  }

  std::vector<double> distinct_;
  double largest_ = 0;
  bool all_met_ = false, whole_ = false;
  std::optional<double> cut_;
};

struct Sample {
  double signal, difference;  // counts; difference has the variance of one pixel
  double slope_x, slope_y;    // counts a pixel
  double expected = 1;        // variance, up to a factor that all share
};

/// Differences that cancel smooth structure. The tensor product of (1 -4 6 -4 1) with itself answers to a fringe of
/// 8 pixels along the diagonal with 1e-4 of its amplitude where Immerkaer's 3 x 3 mask (CVIU 64, 300, 1996), the
/// tensor product of (1 -2 1), still answers with 1e-2; it needs more room, so the small mask is the second choice.
/// The signal is the mean under the squared mask: exactly what the variance of the difference depends on when the
/// pixel variance is linear in the signal. Neighbourhoods with pixels that were cut off are left out.
template <int N>
std::vector<Sample> differences(const Picture& micrograph, const Image* fitted, const std::array<double, N>& mask,
                                std::optional<double> cut) {
  constexpr int kHalf = N / 2;
  double norm = 0, lever = 0;
  for (const double m : mask) norm += m * m;
  for (int i = -kHalf; i <= kHalf; ++i) lever += N * i * i;
  std::vector<Sample> samples;
  const int width = micrograph.values.width(), height = micrograph.values.height();
  for (int y = kHalf; y + kHalf < height; ++y)
    for (int x = kHalf; x + kHalf < width; ++x) {
      Sample sum{};
      bool usable = true;
      for (int j = -kHalf; j <= kHalf && usable; ++j)
        for (int i = -kHalf; i <= kHalf; ++i) {
          const double value = micrograph.values(x + i, y + j);
          usable = micrograph.mask(x + i, y + j) && !(cut && value / value_per_count(micrograph, x + i, y + j) <= *cut);
          if (!usable) break;
          const double m = mask[i + kHalf] * mask[j + kHalf], model = fitted ? (*fitted)(x + i, y + j) : 0;
          const double signal = fitted ? model : value;
          sum.difference += m * (value - model);
          sum.signal += m * m * signal;
          sum.slope_x += i * signal, sum.slope_y += j * signal;
        }
      if (!usable) continue;
      const double unit = value_per_count(micrograph, x, y);
      samples.push_back({sum.signal / (norm * norm) / unit, sum.difference / norm / unit, sum.slope_x / lever / unit,
                         sum.slope_y / lever / unit, 1});
    }
  return samples;
}

/// The variance that rounding adds and differences do not see, in units of the step squared; `seen` is what they show.
/// With noise of variance n the rounding error's mean at a place is a sawtooth whose harmonics have the mean square
/// exp(-4 pi^2 k^2 n) / (2 pi^2 k^2), together 1/12 without noise; neighbours share it where the signal is flat
/// (`shared` = 1). Noise and rounding add up to n + 1/12 either way: solved for n.
double hidden_rounding(double seen, double shared) {
  const auto sawtooth = [](double n) {
    double sum = 0;
    constexpr double kPi = std::numbers::pi;
    for (int k = 1; k <= 30; ++k) sum += std::exp(-4 * kPi * kPi * k * k * n) / (2 * kPi * kPi * k * k);
    return sum;
  };
  double low = 0, high = std::max(seen, kQuantisation);
  for (int i = 0; i < 40; ++i) {
    const double n = 0.5 * (low + high);
    (n + kQuantisation - shared * sawtooth(n) < seen ? low : high) = n;
  }
  return std::max(0.0, low + kQuantisation - seen);
}

/// Variance of the pixels at one level of the signal.
struct Bin {
  double signal, variance, count;
  double darkest;  ///< signal in it
};

/// In standard deviations: of normal numbers one in 16,000 lies beyond, of dust and edges most.
constexpr double kTrim = 4;

/// At the level where `expected` is what samples expect; the median absolute deviation ignores dust, edges and the
/// defect. Deviations are in units of what each sample expects: a median of small and large ones together is below
/// their mean. `squares_too`: where a model is taken off, the mean square of all but what stands out, which knows a
/// variance 1.6 times as well.
double robust_variance(const std::vector<Sample>& samples, double expected, double step, double mask_order,
                       bool squares_too) {
  std::vector<double> absolute;
  for (const Sample& s : samples) absolute.push_back(std::abs(s.difference) * std::sqrt(expected / s.expected));
  const double sd = kNormalSdPerMad * median(absolute), count = static_cast<double>(samples.size());
  if (!(sd < step)) {
    if (!squares_too) return sd * sd;
    double squares = 0, kept = 0;
    for (const double x : absolute)
      if (x <= kTrim * sd) squares += x * x, ++kept;
    return squares / kept;
  }
  // Few codes have no median to speak of: the mean square, without what lies beyond four standard deviations.
  const double limit = kTrim * std::max(sd, step * std::sqrt(kQuantisation));
  double squares = 0, kept = 0, apart = 0;
  for (const Sample& s : samples) {
    if (std::abs(s.difference) <= limit) squares += s.difference * s.difference, ++kept;
    // How differences answer to the sawtooth that rounding makes of a slope.
    const auto answer = [&](double slope) {
      const double s2 = 4 * std::pow(std::sin(std::numbers::pi * slope / step), 2);
      return mask_order > 2 ? std::pow(s2, 4) / 70 : s2 * s2 / 6;
    };
    apart += answer(s.slope_x) * answer(s.slope_y);
  }
  const double seen = kept > 0 ? squares / kept / (step * step) : 0;
  return step * step * (seen + hidden_rounding(seen, 1 - std::min(1.0, apart / count)));
}

/// Standard deviation of the logarithm of a variance that `n` overlapping differences tell, times sqrt(n): of n, about
/// n / 7 are independent, and medians know a variance to 2.3 / sqrt of that.
constexpr double kVarianceSd = 6.2;

/// The level of samples of like signal, or two where the variance of the darker and of the brighter half differ by more
/// than chance: beside bright fringes the dark field and the feet of the fringes come into one bin, and the steepest
/// change of the variance is there. Signal and variance are both medians: means of a bin's signal would lie far above
/// the pixels that its median variance stands for. Levels that noise takes below the cut go into `near_cut`.
void add_levels(std::vector<Sample> samples, const Codes& codes, double mask_order, bool squares_too,
                std::vector<Bin>& bins, std::vector<Bin>& near_cut) {
  const auto darker = [](const Sample& a, const Sample& b) { return a.signal < b.signal; };
  const auto middle = samples.begin() + static_cast<std::ptrdiff_t>(samples.size() / 2);
  std::nth_element(samples.begin(), middle, samples.end(), darker);
  const double signal = middle->signal, expected = middle->expected, count = static_cast<double>(samples.size());
  const double begin = std::min_element(samples.begin(), std::next(middle), darker)->signal;
  const double end = std::max_element(middle, samples.end(), darker)->signal;
  const auto variance_of = [&](const std::vector<Sample>& of, double from, double to) {
    return std::max(robust_variance(of, expected, codes.step(from, to), mask_order, squares_too), codes.floor());
  };
  constexpr std::size_t kTwoLevels = 200;  // samples; fewer tell no two variances apart
  if (samples.size() >= kTwoLevels) {
    std::vector<Sample> dark(samples.begin(), middle), bright(middle, samples.end());
    const double log_ratio = std::log(variance_of(bright, signal, end) / variance_of(dark, begin, signal));
    if (std::abs(log_ratio) > 2 * kVarianceSd * std::sqrt(4 / count)) {
      add_levels(std::move(dark), codes, mask_order, squares_too, bins, near_cut);
      add_levels(std::move(bright), codes, mask_order, squares_too, bins, near_cut);
      return;
    }
  }
  const double variance = variance_of(samples, begin, end);
  // Of pixels that noise may take below the cut, those that are left scatter less: by 1 % of the variance at three
  // standard deviations.
  const bool truncated = codes.cut() && signal - *codes.cut() < 3 * std::sqrt(variance);
  (truncated ? near_cut : bins).push_back({signal, variance, count, begin});
}

/// Samples of like signal together. Bins of equal width see the bright and the dark end alike; those with too few
/// samples are skipped.
std::vector<Bin> binned(std::vector<Sample> samples, const Codes& codes, double mask_order, bool squares_too) {
  const std::size_t few = samples.size() / 200;
  const auto signal_of_rank = [&](std::size_t rank) {
    const auto at = samples.begin() + static_cast<std::ptrdiff_t>(rank);
    const auto darker = [](const Sample& a, const Sample& b) { return a.signal < b.signal; };
    std::nth_element(samples.begin(), at, samples.end(), darker);
    return at->signal;
  };
  const double low = signal_of_rank(few), high = signal_of_rank(samples.size() - 1 - few);
  const std::size_t number = std::clamp<std::size_t>(samples.size() / 100, 1, 24);
  std::vector<std::vector<Sample>> parts(number);
  for (const Sample& sample : samples) {
    const double position = high > low ? (sample.signal - low) / (high - low) * static_cast<double>(number) : 0;
    if (std::isfinite(position))  // the spread of the largest numbers is none
      parts[static_cast<std::size_t>(std::clamp(position, 0.0, static_cast<double>(number - 1)))].push_back(sample);
  }
  std::vector<Bin> bins, near_cut;
  for (std::vector<Sample>& part : parts)
    if (part.size() >= std::min<std::size_t>(30, samples.size()))
      add_levels(std::move(part), codes, mask_order, squares_too, bins, near_cut);
  for (std::vector<Bin>* levels : {&bins, &near_cut})  // a few specks are not the darkest level
    for (Bin& bin : *levels) bin.darkest = std::max(bin.darkest, low), bin.signal = std::max(bin.signal, bin.darkest);
  return bins.empty() ? near_cut : bins;
}

/// variance = at_dark + slope (signal - dark), both parts positive, dark the black level where it is known, else the
/// darkest level seen: above a black level, a straight line from zero would need a negative variance there.
struct VarianceLine {
  double dark, at_dark, slope;
  double at(double signal) const { return at_dark + slope * (signal - dark); }
};

/// The line by the likelihood of sample variances, -n/2 (ln m + v/m): a model far below what a level shows is as
/// unlikely as it is harmful. Where no line describes all levels, none gets less than half of its own variance, twice
/// the weight that it justifies. For a given ratio of the two parts their common factor is known: one number is
/// searched for.
VarianceLine variance_line(const std::vector<Bin>& bins, double floor, std::optional<double> black) {
  double total = 0, mean_signal = 0;
  const double dark = black ? std::min(*black, bins.front().darkest) : bins.front().darkest;
  for (const Bin& bin : bins) total += bin.count, mean_signal += bin.count * (bin.signal - dark);
  mean_signal = std::max(mean_signal / total, 1e-300);
  const auto line = [&](double share) {  // of the constant part at the mean signal
    const double per_signal = (1 - share) / mean_signal;
    double factor = 0, least = floor / share;
    for (const Bin& bin : bins) {
      const double shape = share + per_signal * (bin.signal - dark);
      factor += bin.count / total * bin.variance / shape;
      least = std::max(least, 0.5 * bin.variance * (1 - 3 * kVarianceSd / std::sqrt(bin.count)) / shape);
    }
    factor = std::max(factor, least);
    return VarianceLine{dark, factor * share, factor * per_signal};
  };
  const auto unlikely = [&](const VarianceLine& l) {
    double sum = 0;
    for (const Bin& bin : bins) {
      const double m = l.at(bin.signal);
      sum += bin.count * (std::log(m) + bin.variance / m);
    }
    return sum;
  };
  VarianceLine best = line(1);
  double least = unlikely(best), at = 0;
  const auto look = [&](double log_ratio) {
    const VarianceLine l = line(1 / (1 + std::pow(10.0, log_ratio)));
    if (const double here = unlikely(l); here < least) best = l, least = here, at = log_ratio;
  };
  constexpr double kLeast = -3, kMost = 8;  // decades between the two parts
  for (double log_ratio = kLeast; log_ratio <= kMost; log_ratio += 0.1) look(log_ratio);
  for (double step = 0.05; step > 1e-4; step /= 2) {
    const double middle = at;
    look(middle - step), look(middle + step);
  }
  return best;
}

}  // namespace

CoarseCodes coarse_codes(const std::vector<const Picture*>& pictures) {
  CoarseCodes codes;
  std::vector<double> values;
  double squares = 0, freedom = 0;  // about each picture's own mean
  for (const Picture* picture : pictures) {
    if (!picture->variance_scale.empty()) return {};
    const std::size_t from = values.size();
    for (std::size_t i = 0; i < picture->values.size(); ++i)
      if (picture->mask.values()[i]) values.push_back(picture->values.values()[i]);
    const double count = static_cast<double>(values.size() - from);
    if (count < 2) continue;
    const double mean = std::accumulate(values.begin() + static_cast<std::ptrdiff_t>(from), values.end(), 0.0) / count;
    for (std::size_t i = from; i < values.size(); ++i) squares += (values[i] - mean) * (values[i] - mean);
    freedom += count - 1;
  }
  const double pixels = static_cast<double>(values.size());
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  constexpr double kMet = 12;  // times that a code is met; values that are no codes repeat less
  if (values.size() < 2 || kMet * static_cast<double>(values.size()) > pixels) return {};
  std::vector<double> apart;
  for (std::size_t i = 1; i < values.size(); ++i) apart.push_back(values[i] - values[i - 1]);
  codes.step = *std::min_element(apart.begin(), apart.end());
  const double seen = squares / freedom / (codes.step * codes.step), hidden = hidden_rounding(seen, 1);
  codes.shared_sd = codes.step * std::sqrt(hidden);
  codes.pixel_sd = codes.step * std::sqrt(seen + hidden);
  return codes;
}

NoiseModel estimate_noise(const Picture& micrograph, const Image* fitted, bool squares) {
  if (const SubGrid grid = sub_grid(micrograph.mask); grid.spacing > 1) {
    Picture part;
    part.values = on_grid(micrograph.values, grid), part.mask = on_grid(micrograph.mask, grid);
    part.variance_scale = on_grid(micrograph.variance_scale, grid);
    const Image model = fitted ? on_grid(*fitted, grid) : Image();
    return estimate_noise(part, fitted ? &model : nullptr, squares);
  }
  constexpr std::size_t kEnough = 200;
  const Codes codes(micrograph);
  double order = 4;
  std::vector<Sample> samples = differences<5>(micrograph, fitted, {1, -4, 6, -4, 1}, codes.cut());
  if (samples.size() < kEnough) samples = differences<3>(micrograph, fitted, {1, -2, 1}, codes.cut()), order = 2;
  NoiseModel noise;
  noise.estimated = true;
  noise.read_counts = std::sqrt(codes.floor());
  if (samples.size() < 9) return noise;
  std::vector<Bin> bins = binned(samples, codes, order, false);
  if (bins.empty()) return noise;
  // Levels no farther apart than noise alone takes pixels tell one variance, and no slope: a frame of even light.
  constexpr double kApart = 4;  // standard deviations
  double count = 0, variance = 0;
  for (const Bin& bin : bins) count += bin.count, variance += bin.count * bin.variance;
  variance = std::max(variance / count, codes.floor());
  if (bins.back().signal - bins.front().darkest < kApart * std::sqrt(variance)) {
    noise.read_counts = std::sqrt(variance);
    return noise;
  }
  // Calibration took the black level off, a cut is one.
  std::optional<double> black = codes.cut();
  if (!micrograph.variance_scale.empty()) black = 0;
  VarianceLine line = variance_line(bins, codes.floor(), black);
  if (squares) {
    // Levels from here to there have pixels of different variance: once more, in units of what the line says of each.
    for (Sample& s : samples) s.expected = std::max(line.at(std::max(s.signal, line.dark)), codes.floor());
    bins = binned(std::move(samples), codes, order, true);
    line = variance_line(bins, codes.floor(), black);
  }
  noise.counts_per_photon = line.slope;
  // A model may come to be darker than anything seen: there the variance is not extrapolated below half of what was, by
  // the line or by the darkest pixels themselves, which a line through fringes finer than pixels may pass far below.
  const double seen = line.at_dark + line.slope * (bins.front().darkest - line.dark);
  const double least = 0.5 * std::max(seen, bins.front().variance);
  const double without_light = line.at_dark - line.slope * line.dark;
  const bool from_zero = line.slope == 0 || (without_light >= 0.5 * seen && seen >= least);
  if (!from_zero) noise.black_counts = line.dark + (least - line.at_dark) / line.slope;
  noise.read_counts = std::sqrt(without_light + line.slope * noise.black_counts);
  return noise;
}

Image smoothed(const Picture& micrograph) {
  const int width = micrograph.values.width(), height = micrograph.values.height();
  const int spacing = sub_grid(micrograph.mask).spacing;
  Image result(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      double sum = 0, count = 0;
      for (int j = y < spacing ? y : y - spacing; j <= std::min(height - 1, y + spacing); j += spacing)
        for (int i = x < spacing ? x : x - spacing; i <= std::min(width - 1, x + spacing); i += spacing)
          if (micrograph.mask(i, j)) sum += micrograph.values(i, j), ++count;
      result(x, y) = count > 0 ? sum / count : 0;
    }
  return result;
}

Image standard_deviation(const Picture& micrograph, const NoiseModel& noise, const Image& signal) {
  const int width = micrograph.values.width(), height = micrograph.values.height();
  double read_variance = noise.read_counts * noise.read_counts;
  // A model without read noise still has the rounding, or no dark pixel could be weighted.
  if (!(read_variance > 0)) read_variance = Codes(micrograph).floor();
  Image result(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const double unit = value_per_count(micrograph, x, y);
      const double light = unit > 0 ? std::max(0.0, signal(x, y) / unit - noise.black_counts) : 0;
      result(x, y) = unit * std::sqrt(read_variance + noise.counts_per_photon * light);
    }
  return result;
}

std::vector<double> usable_values(const Picture& picture) {
  std::vector<double> values;
  for (std::size_t i = 0; i < picture.values.size(); ++i)
    if (picture.mask.values()[i] && std::isfinite(picture.values.values()[i]))
      values.push_back(picture.values.values()[i]);
  return values;
}

double mean_variance(const Picture& micrograph, const NoiseModel& noise, const Image& signal) {
  const Image sd = standard_deviation(micrograph, noise, signal);
  double sum = 0, count = 0;
  for (int y = 0; y < sd.height(); ++y)
    for (int x = 0; x < sd.width(); ++x)
      if (micrograph.mask(x, y) && std::isfinite(sd(x, y))) sum += sd(x, y) * sd(x, y), ++count;
  return count > 0 ? sum / count : 0;
}

}  // namespace birefit::estimation
