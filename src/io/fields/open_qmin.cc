#include "io/fields/open_qmin.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <string_view>

#include <fmt/format.h>

namespace birefit::fields {
namespace {

using Site = std::array<double, 10>;  // x y z Qxx Qxy Qxz Qyy Qyz type S
constexpr std::size_t kType = 8, kOrder = 9;

/// The numbers of a line, between blanks, tabs or commas; how many there are is returned, at most 11.
std::size_t read_line(std::string_view line, Site& site, bool& all_numbers) {
  std::size_t count = 0, at = 0;
  all_numbers = true;
  const auto gap = [](char c) { return c == ' ' || c == '\t' || c == ',' || c == '\r'; };
  for (;;) {
    while (at < line.size() && gap(line[at])) ++at;
    if (at == line.size() || count > site.size()) return count;
    double value = 0;
    const auto [end, error] = std::from_chars(line.data() + at, line.data() + line.size(), value);
    if (error == std::errc::result_out_of_range) value = 0;  // a number too small for doubles
    all_numbers = all_numbers && (error == std::errc() || error == std::errc::result_out_of_range) &&
                  (end == line.data() + line.size() || gap(*end));
    if (!all_numbers) return count;
    if (count < site.size()) site[count] = value;
    ++count;
    at = static_cast<std::size_t>(end - line.data());
  }
}

}  // namespace

RawVolume read_open_qmin(const std::string& content, const VolumeRequest& request) {
  RawVolume raw;
  raw.file = request.path.string();
  std::vector<Site> sites;
  std::string_view rest = content;
  for (int number = 1; !rest.empty(); ++number) {
    const std::size_t end = std::min(rest.find('\n'), rest.size());
    const std::string_view line = rest.substr(0, end);
    rest.remove_prefix(std::min(end + 1, rest.size()));
    Site site{};
    bool all_numbers = true;
    const std::size_t count = read_line(line, site, all_numbers);
    const bool blank = line.find_first_not_of(" \t\r") == std::string_view::npos;
    if (blank || line.front() == '#' || (!all_numbers && sites.empty() && number == 1)) continue;  // names of columns
    if (!all_numbers || count < kOrder || count > site.size())
      throw UserError({raw.file, number},
                      fmt::format("has {} where ten numbers are expected, x y z Qxx Qxy Qxz Qyy Qyz type S",
                                  all_numbers ? fmt::format("{} numbers", count) : "text"),
                      "a field as text is what open-Qmin writes; .npy, .npz, .vti and .vtk are read too");
    if (count == kOrder) site[kOrder] = std::numeric_limits<double>::quiet_NaN();
    sites.push_back(site);
    if (sites.size() > kMostNodes) check_size(raw.file, static_cast<double>(sites.size()), 2, 2);
  }
  if (sites.empty()) refuse(raw.file, "has no lines of numbers", "x y z Qxx Qxy Qxz Qyy Qyz type S, a line a site");
  std::array<double, 3> low = {sites[0][0], sites[0][1], sites[0][2]}, high = low;
  for (const Site& site : sites)
    for (std::size_t k = 0; k < 3; ++k) {
      if (site[k] != std::floor(site[k]))
        refuse(raw.file, fmt::format("has a site at {:g}, between the nodes of a lattice", site[k]),
               "x, y and z count nodes; spacing_um says how far they are apart");
      low[k] = std::min(low[k], site[k]), high[k] = std::max(high[k], site[k]);
    }
  const std::array<double, 3> n{high[0] - low[0] + 1, high[1] - low[1] + 1, high[2] - low[2] + 1};
  check_size(raw.file, n[0], n[1], n[2]);
  raw.nx = static_cast<int>(n[0]), raw.ny = static_cast<int>(n[1]), raw.nz = static_cast<int>(n[2]);
  const std::size_t nodes =
      static_cast<std::size_t>(raw.nx) * static_cast<std::size_t>(raw.ny) * static_cast<std::size_t>(raw.nz);
  if (sites.size() != nodes)
    refuse(raw.file,
           fmt::format("has {} sites, a box of {} x {} x {} needs {}", sites.size(), raw.nx, raw.ny, raw.nz, nodes),
           "of a run on several processes join the files of all of them");
  raw.spacing_um = demand_spacing(request, "text");
  raw.tensor = true;
  raw.name = "Q";
  raw.usual_norm = 1.5;
  raw.field.components = 6;
  raw.field.values.assign(6 * nodes, 0);
  raw.mask = NodeArray{1, std::vector<double>(nodes, -1)};
  const bool ordered = std::none_of(sites.begin(), sites.end(), [](const Site& s) { return std::isnan(s[kOrder]); });
  if (ordered) raw.order = NodeArray{1, std::vector<double>(nodes, 0)};
  for (const Site& site : sites) {
    const std::size_t x = static_cast<std::size_t>(site[0] - low[0]), y = static_cast<std::size_t>(site[1] - low[1]),
                      z = static_cast<std::size_t>(site[2] - low[2]);
    const std::size_t i = (z * static_cast<std::size_t>(raw.ny) + y) * static_cast<std::size_t>(raw.nx) + x;
    if (raw.mask->values[i] >= 0)
      refuse(raw.file, fmt::format("has the site {:g} {:g} {:g} twice", site[0], site[1], site[2]), "save it again");
    // Boundaries and particles have types above 0, sites beside them below.
    raw.mask->values[i] = site[kType] > 0 ? 0 : 1;
    double* q = raw.field.values.data() + 6 * i;
    q[0] = site[3], q[1] = site[6], q[2] = -site[3] - site[6], q[3] = site[4], q[4] = site[5], q[5] = site[7];
    if (ordered) raw.order->values[i] = site[kOrder];
  }
  return raw;
}

}  // namespace birefit::fields
