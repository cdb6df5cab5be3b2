#pragma once
// Numbers and text for people: summary, log and report. Private to io.

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <string>

#include <fmt/format.h>

#include "core/printable.h"

namespace birefit {

/// Decimals that show `error` with two significant digits; may be negative.
inline int decimals_for(double error) {
  const double rounded = std::strtod(fmt::format("{:.1e}", error).c_str(), nullptr);  // 0.0996 is 0.10: one digit less
  return 1 - static_cast<int>(std::floor(std::log10(rounded) + 1e-12));
}

/// `value` rounded where its error has two significant digits; six digits when the error says nothing.
inline std::string format_value(double value, double error) {
  if (!std::isfinite(value)) return std::isnan(value) ? "not known" : value > 0 ? "inf" : "-inf";
  if (!std::isfinite(error) || !(error > 0)) return fmt::format("{:.6g}", value);
  const int decimals = decimals_for(error);
  const double magnitude = std::max(std::abs(value), error);
  if (magnitude >= 1e7 || magnitude < 1e-4 || decimals > 12)
    return fmt::format("{:.{}e}", value,
                       std::clamp(static_cast<int>(std::floor(std::log10(magnitude))) + decimals, 1, 15));
  if (decimals >= 0) return fmt::format("{:.{}f}", value, decimals);
  const double unit = std::pow(10.0, -decimals);
  return fmt::format("{:.0f}", std::round(value / unit) * unit);
}

inline std::string format_error(double error) {
  if (!std::isfinite(error)) return "not known";
  if (!(error > 0)) return "0";
  return format_value(error, error);
}

inline std::string format_percent(double fraction) {
  if (!std::isfinite(fraction)) return "-";
  const double percent = 100 * std::abs(fraction);
  return percent >= 1000 ? "> 1000 %"
         : percent >= 10 ? fmt::format("{:.0f} %", percent)
                         : fmt::format("{:.2g} %", percent);
}

/// "sample.droplet.diameter_um" is "diameter_um"; "micrographs[1].gain" keeps its frame, and that of signal[1] its
/// table: "gain [1]".
inline std::string short_name(const std::string& name) {
  std::size_t dot = name.rfind('.');
  // A lone "x" says nothing: "center_px.x".
  if (dot != std::string::npos && dot > 0 && name.size() - dot <= 3) dot = name.rfind('.', dot - 1);
  std::string text = name.substr(dot == std::string::npos ? 0 : dot + 1);
  for (const std::string& list : {std::string("micrographs"), std::string("signal")}) {
    const std::size_t end = name.find(']');
    if (name.rfind(list + "[", 0) == 0 && end != std::string::npos)
      text += " " + name.substr(list.size(), end + 1 - list.size());
  }
  return text;
}

/// Text inside an element or a quoted attribute of HTML and SVG. Everything a user wrote passes through here.
inline std::string escape_html(const std::string& text) {
  std::string out;
  out.reserve(text.size());
  for (const char c : printable_lines(text)) switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        // Control characters are not allowed in HTML, whatever a config holds.
        if (static_cast<unsigned char>(c) >= 32 || c == '\n' || c == '\t') out += c;
    }
  return out;
}

/// A formatted number for reading: a true minus sign, powers of ten raised.
inline std::string html_number(const std::string& number) {
  std::string out;
  std::size_t i = 0;
  if (number == "nan" || number == "-nan") return "not known";
  if (number == "inf" || number == "-inf") return number[0] == '-' ? "\u2212\u221e" : "\u221e";
  for (; i < number.size() && number[i] != 'e'; ++i) out += number[i] == '-' ? "\u2212" : std::string(1, number[i]);
  if (i >= number.size() || i == 0 || (number[i - 1] != '.' && (number[i - 1] < '0' || number[i - 1] > '9')))
    return out + number.substr(std::min(i, number.size()));
  const int exponent = std::atoi(number.c_str() + i + 1);
  return out + "\u2009\u00d7\u200910<sup>" + (exponent < 0 ? "\u2212" : "") + std::to_string(std::abs(exponent)) +
         "</sup>";
}

/// "um" is written \u00b5m, "deg" \u00b0.
inline std::string pretty_unit(const std::string& unit) {
  if (unit == "deg") return "\u00b0";
  std::string text = escape_html(unit);
  for (std::size_t at = text.find("um"); at != std::string::npos; at = text.find("um", at + 3))
    if ((at == 0 || !std::isalpha(static_cast<unsigned char>(text[at - 1]))) &&
        (at + 2 == text.size() || !std::isalpha(static_cast<unsigned char>(text[at + 2]))))
      text.replace(at, 2, "\u00b5m");
  return text;
}

}  // namespace birefit
