#include <algorithm>
#include <charconv>
#include <map>

#include <fmt/format.h>

#include "io/fields/vtk.h"
#include "io/files/byte_order.h"

namespace birefit::fields {

std::size_t size_of_type(const std::string& type) {
  static const std::map<std::string, std::size_t> kSizes = {{"Float32", 4}, {"Float64", 8}, {"Int8", 1},  {"UInt8", 1},
                                                            {"Int16", 2},   {"UInt16", 2},  {"Int32", 4}, {"UInt32", 4},
                                                            {"Int64", 8},   {"UInt64", 8}};
  const auto found = kSizes.find(type);
  return found == kSizes.end() ? 0 : found->second;
}

double number_of_type(const std::string& type, const char* from, bool swapped) {
  if (type == "Float32") return read_as<float>(from, swapped);
  if (type == "Float64") return read_as<double>(from, swapped);
  if (type == "Int8") return read_as<std::int8_t>(from);
  if (type == "UInt8") return read_as<std::uint8_t>(from);
  if (type == "Int16") return read_as<std::int16_t>(from, swapped);
  if (type == "UInt16") return read_as<std::uint16_t>(from, swapped);
  if (type == "Int32") return read_as<std::int32_t>(from, swapped);
  if (type == "UInt32") return read_as<std::uint32_t>(from, swapped);
  if (type == "Int64") return static_cast<double>(read_as<std::int64_t>(from, swapped));
  return static_cast<double>(read_as<std::uint64_t>(from, swapped));
}

void read_ascii(std::string_view text, const std::string& file, const std::string& name, std::size_t most,
                std::vector<double>& values) {
  const char *at = text.data(), *end = at + text.size();
  while (values.size() < most) {
    while (at < end && (*at == ' ' || *at == '\n' || *at == '\r' || *at == '\t')) ++at;
    if (at == end) return;
    double x = 0;
    const auto [next, error] = std::from_chars(at, end, x);
    if (error != std::errc() && error != std::errc::result_out_of_range)
      refuse(file, fmt::format("{}: value {} is no number", name, values.size() + 1), "");
    values.push_back(x);
    at = next;
  }
}

std::string chosen_array(const VolumeRequest& request, const std::vector<std::string>& names) {
  const auto has = [&](const std::string& name) { return std::find(names.begin(), names.end(), name) != names.end(); };
  const std::string file = request.path.string();
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "; it has " : ", ") + name;
  if (!request.array.empty()) {
    if (!has(request.array)) refuse(file, "has no array " + request.array + list, "check `array`");
    return request.array;
  }
  if (has("n") && has("Q")) refuse(file, "has both n and Q", "`array: n` or `array: Q` chooses one");
  if (has("n")) return "n";
  if (has("Q")) return "Q";
  refuse(file, "has no array n (3 components) or Q (6 or 9) in PointData" + list,
         "`array: NAME` chooses the one with the director or with Q");
}

void take_field(NodeArray array, const std::string& name, RawVolume& raw) {
  raw.name = name;
  raw.tensor = array.components != 3;
  raw.field = std::move(array);
  if (raw.field.components == 9) {
    to_six(raw.field);
  } else if (raw.tensor) {
    // VTK: .. xy, yz, xz
    for (std::size_t i = 0; i + 6 <= raw.field.values.size(); i += 6)
      std::swap(raw.field.values[i + 4], raw.field.values[i + 5]);
  }
}

}  // namespace birefit::fields
