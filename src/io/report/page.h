#pragma once
// What the sections of a report share. Private to io.

#include <limits>
#include <string>
#include <vector>

#include "birefit/io.h"
#include "io/report/chart.h"
#include "io/report/format.h"

namespace birefit::page {

inline constexpr const char* kMeasured = "#3c434d";
inline constexpr const char* kFitted = "#c0392b";
inline constexpr const char* kBlue = "#2166ac";
inline constexpr const char* kGrey = "#8a919b";
inline constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

/// A space and the unit as HTML; "" without one.
std::string unit_suffix(const std::string& unit);
/// Rounded where its error has two significant digits.
std::string value_html(double value, double error);
/// Four digits, as HTML.
std::string plain(double value);
/// A term and what is said of it, in a <dl>.
std::string fact(const std::string& name, const std::string& html);
std::string list(const std::vector<std::string>& sentences);
/// A chart for the page's width and another one for a phone, where the first would be too small to read.
std::string wide_and_narrow(Chart chart);
/// The micrograph is a row of a table, but not its first: what was said of the first holds.
bool later_row(const Config& config, std::size_t micrograph);

}  // namespace birefit::page
