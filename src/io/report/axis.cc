#include "io/report/axis.h"

#include <algorithm>

#include <fmt/format.h>

#include "io/report/format.h"

namespace birefit {
namespace {

std::vector<AxisTick> linear_ticks(double low, double high, int count, int& power) {
  const double largest = std::max(std::abs(low), std::abs(high));
  power = 0;
  if (largest >= 1e5 || (largest > 0 && largest < 1e-3)) power = static_cast<int>(std::floor(std::log10(largest)));
  const double factor = std::pow(10.0, power);
  const std::vector<double> values = nice_ticks(low / factor, high / factor, count);
  std::vector<AxisTick> ticks;
  const double step = values.size() > 1 ? values[1] - values[0] : 1;
  for (const double value : values) ticks.push_back({value * factor, html_number(tick_label(value, step))});
  return ticks;
}

/// With an exponent, or written out.
std::string power_label(int exponent, bool exponents) {
  if (!exponents) return fmt::format("{:.{}f}", std::pow(10.0, exponent), std::max(0, -exponent));
  return std::string("10<tspan dy=\"-4\" font-size=\"8.5\">") + (exponent < 0 ? "\u2212" : "") +
         std::to_string(std::abs(exponent)) + "</tspan>";
}

std::vector<AxisTick> log_ticks(double low, double high, int count, int& power, bool alike) {
  power = 0;
  const double decades = std::log10(high / low);
  if (decades < 0.9) return linear_ticks(low, high, count, power);
  std::vector<AxisTick> ticks;
  const int every = std::max(1, static_cast<int>(std::ceil(decades / count)));
  const int lowest = static_cast<int>(std::ceil(std::log10(low) - 1e-9)),
            highest = static_cast<int>(std::floor(std::log10(high) + 1e-9));
  const bool all_short = lowest >= -3 && highest <= 4;
  for (int d = lowest; d <= highest; ++d)
    if (d % every == 0) ticks.push_back({std::pow(10.0, d), power_label(d, alike ? !all_short : d < 0 || d > 3)});
  if (ticks.size() >= 2) return ticks;
  ticks.clear();
  for (int d = static_cast<int>(std::floor(std::log10(low))); d <= std::ceil(std::log10(high)); ++d)
    for (const double m : {1.0, 2.0, 5.0})
      if (const double value = m * std::pow(10.0, d); value >= low * (1 - 1e-9) && value <= high * (1 + 1e-9))
        ticks.push_back({value, svg_number(fmt::format("{:.3g}", value))});
  return ticks;
}

}  // namespace

std::vector<double> nice_ticks(double low, double high, int count) {
  std::vector<double> ticks;
  if (!(high > low) || !std::isfinite(high - low) || count < 1) return ticks;
  const double raw = (high - low) / count, power = std::pow(10.0, std::floor(std::log10(raw)));
  const double lead = raw / power;
  const double step = (lead < 1.5 ? 1 : lead < 3.5 ? 2 : lead < 7.5 ? 5 : 10) * power;
  const double first = std::ceil(low / step - 1e-9);
  for (double k = first; k * step <= high + 1e-9 * step && ticks.size() < 100; ++k)
    ticks.push_back(k == 0 ? 0.0 : k * step);
  return ticks;
}

std::string tick_label(double value, double step) {
  const int decimals = step > 0 ? std::clamp(static_cast<int>(std::ceil(-std::log10(step) - 1e-6)), 0, 12) : 0;
  return fmt::format("{:.{}f}", value, decimals);
}

std::string svg_number(const std::string& number) {
  std::string text = html_number(number);
  if (const std::size_t at = text.find("<sup>"); at != std::string::npos) {
    text.replace(at, 5, "<tspan dy=\"-4\" font-size=\"8.5\">");
    text.replace(text.find("</sup>"), 6, "</tspan>");
  }
  return text;
}

std::vector<AxisTick> axis_ticks(const AxisScale& scale, int count, int& power, bool alike) {
  return scale.log ? log_ticks(scale.low, scale.high, count, power, alike)
                   : linear_ticks(scale.low, scale.high, count, power);
}

std::vector<double> small_ticks(const AxisScale& scale) {
  std::vector<double> ticks;
  const double decades = scale.log ? std::log10(scale.high / scale.low) : 0;
  if (!(decades >= 0.9) || !(decades < 400)) return ticks;
  const bool between = std::abs(scale.to - scale.from) / decades > 24;
  for (int d = static_cast<int>(std::floor(std::log10(scale.low))); d <= std::ceil(std::log10(scale.high)); ++d)
    for (int m = 1; m <= (between ? 9 : 1); ++m)
      if (const double value = m * std::pow(10.0, d); value > scale.low && value < scale.high) ticks.push_back(value);
  return ticks;
}

std::string with_power(const std::string& label, int power) {
  if (power == 0) return escape_html(label);
  return escape_html(label) + " \u00d710<tspan dy=\"-4\" font-size=\"8.5\">" + (power < 0 ? "\u2212" : "") +
         std::to_string(std::abs(power)) + "</tspan>";
}

double width_of(const std::string& label) {
  bool markup = false;
  int characters = 0;
  for (const char c : label) {
    if (c == '<') markup = true;
    characters += !markup && (static_cast<unsigned char>(c) & 0xc0) != 0x80;
    if (c == '>') markup = false;
  }
  return 6.3 * characters;
}

}  // namespace birefit
