#pragma once
// Scales and ticks of charts. Private to io.

#include <cmath>
#include <string>
#include <vector>

namespace birefit {

/// Colours of text and curves, and of the lines around them.
constexpr const char *kInk = "#2b2f36", *kFrame = "#8a919b";

/// From values to places on the page; by their logarithm where `log`.
struct AxisScale {
  double low = 0, high = 1, from = 0, to = 1;
  bool log = false;
  double operator()(double value) const {
    const double t = log ? std::log(value / low) / std::log(high / low) : (value - low) / (high - low);
    return from + t * (to - from);
  }
  /// Zero and less have no place on a logarithmic axis.
  bool has(double value) const { return std::isfinite(value) && (!log || value > 0); }
};

struct AxisTick {
  double value;
  std::string label;  ///< as SVG
};

/// Steps of 1, 2 or 5 times a power of ten: the multiples inside [low, high], about `count` of them.
std::vector<double> nice_ticks(double low, double high, int count);
/// Decimals that the ticks of `step` need.
std::string tick_label(double value, double step);
/// A formatted number as SVG, which has no <sup>: a true minus sign, powers of ten raised.
std::string svg_number(const std::string& number);
/// About `count` ticks and, for large or tiny numbers, a common power of ten that goes into the axis label. Where
/// `alike` the powers of ten of a logarithmic axis are all written out or none is.
std::vector<AxisTick> axis_ticks(const AxisScale& scale, int count, int& power, bool alike = false);
/// Where a logarithmic axis has small ticks without labels: at 2 to 9 times every power of ten or, where there is no
/// room for that, at every power. None of others.
std::vector<double> small_ticks(const AxisScale& scale);
/// The label of an axis, escaped, and the common power of its ticks.
std::string with_power(const std::string& label, int power);
/// What a label takes of a line, about.
double width_of(const std::string& label);

}  // namespace birefit
