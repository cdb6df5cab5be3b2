#include "io/results/residual.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "io/report/format.h"

namespace birefit {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// What rounding makes of an even image is no range.
bool is_range(double range, double size) { return range > 1e-9 * size; }

struct Span {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  double size() const { return std::max(std::abs(low), std::abs(high)); }
  double range() const { return high > low && is_range(high - low, size()) ? high - low : 0; }
};

/// Of the fitted values at used pixels.
void add(const MicrographResult& m, Span& span) {
  if (m.residual.size() != m.fitted.size()) return;
  for (std::size_t i = 0; i < m.fitted.size(); ++i) {
    if (!std::isfinite(m.residual.values()[i])) continue;
    span.low = std::min(span.low, m.fitted.values()[i]), span.high = std::max(span.high, m.fitted.values()[i]);
  }
}

double own_range(const MicrographResult& m) {
  Span span;
  add(m, span);
  return m.signal_range > 0 && (span.low > span.high || is_range(m.signal_range, span.size())) ? m.signal_range : 0;
}

}  // namespace

double residual_fraction(const MicrographResult& micrograph) {
  const double range = own_range(micrograph);
  return range > 0 ? micrograph.residual_rms / range : kNone;
}

double residual_fraction(const FitResult& result) {
  Span all;
  for (const MicrographResult& m : result.micrographs) add(m, all);
  // One of several pictures that is nearly even says nothing of the sample's range.
  constexpr double kNearlyEven = 0.05;
  double sum = 0, pixels = 0;
  for (const MicrographResult& m : result.micrographs) {
    const double own = own_range(m), range = own > kNearlyEven * all.range() ? own : all.range();
    if (!(range > 0) || !std::isfinite(m.residual_rms) || m.used <= 0) continue;
    sum += m.used * std::pow(m.residual_rms / range, 2);
    pixels += m.used;
  }
  return pixels > 0 ? std::sqrt(sum / pixels) : kNone;
}

std::string describe_residual(const FitResult& result) {
  if (const double fraction = residual_fraction(result); std::isfinite(fraction))
    return format_percent(fraction) + " of the signal range";
  double sum = 0, pixels = 0;
  for (const MicrographResult& m : result.micrographs)
    if (std::isfinite(m.residual_rms) && m.used > 0) sum += m.used * m.residual_rms * m.residual_rms, pixels += m.used;
  return pixels > 0 ? fmt::format("{:.3g} (even images have no range)", std::sqrt(sum / pixels)) : "-";
}

}  // namespace birefit
