#include "io/report/page.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace birefit::page {

std::string unit_suffix(const std::string& unit) {
  if (unit.empty()) return {};
  return (unit == "deg" ? "" : "\u202f") + pretty_unit(unit);
}

std::string value_html(double value, double error) { return html_number(format_value(value, error)); }

std::string fact(const std::string& name, const std::string& html) {
  return "<dt>" + escape_html(name) + "</dt><dd>" + html + "</dd>\n";
}

std::string list(const std::vector<std::string>& sentences) {
  std::string out = "<ul>\n";
  for (const std::string& sentence : sentences) out += "<li>" + escape_html(sentence) + "</li>\n";
  return out + "</ul>\n";
}

std::string wide_and_narrow(Chart chart) {
  chart.width = 884;
  std::string out = "<div class=\"wide\">" + svg(chart) + "</div>";
  chart.width = 370;
  return out + "<div class=\"narrow\">" + svg(chart) + "</div>\n";
}

std::string plain(double value) {
  const bool large = std::abs(value) >= 1e4 && std::abs(value) < 1e7;
  return html_number(large ? fmt::format("{:.0f}", value) : fmt::format("{:.4g}", value));
}

bool later_row(const Config& config, std::size_t micrograph) {
  return !config.signals.empty() && std::none_of(config.signals.begin(), config.signals.end(),
                                                 [&](const SignalTable& t) { return t.first == micrograph; });
}

}  // namespace birefit::page
