#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <map>
#include <string_view>

#include <fmt/format.h>

#include "io/fields/vtk.h"

namespace birefit::fields {
namespace {

/// Words and numbers of a legacy file, whose header is text and whose data are text or big-endian numbers.
class LegacyReader {
 public:
  LegacyReader(const std::string& content, const VolumeRequest& request) : text_(content), request_(request) {
    raw_.file = request.path.string();
  }

  RawVolume read() {
    refuse_spacing(request_, ".vtk");
    line();  // "# vtk DataFile Version .."
    line();  // a title
    const std::string kind = upper(word());
    if (kind != "ASCII" && kind != "BINARY")
      refuse(raw_.file, "says neither ASCII nor BINARY in its third line", "save it again");
    binary_ = kind == "BINARY";
    if (upper(word()) != "DATASET") refuse(raw_.file, "has no DATASET", "save it again");
    grid(upper(word()));
    check_size(raw_.file, n_[0], n_[1], n_[2]);
    raw_.nx = static_cast<int>(n_[0]), raw_.ny = static_cast<int>(n_[1]), raw_.nz = static_cast<int>(n_[2]);
    for (double s : raw_.spacing_um)
      if (!(s > 0 && s < 1e6))
        refuse(raw_.file, "its nodes are not apart by positive distances (micrometres) along x, y and z", "");
    attributes();
    std::vector<std::string> names;
    for (const auto& [name, unused] : arrays_) names.push_back(name);
    const std::string field = chosen_array(request_, names);
    NodeArray& array = arrays_.at(field);
    if (array.components != 3 && array.components != 6 && array.components != 9)
      refuse(raw_.file, fmt::format("{} has {} components, expected 3, 6 or 9", field, array.components), "");
    take_field(std::move(array), field, raw_);
    for (const auto& [name, to] : {std::pair("S", &raw_.order), std::pair("domain_mask", &raw_.mask)})
      if (const auto found = arrays_.find(name);
          found != arrays_.end() && name != field && found->second.components == 1)
        *to = std::move(found->second);
    return std::move(raw_);
  }

 private:
  static std::string upper(std::string word) {
    std::transform(word.begin(), word.end(), word.begin(), [](unsigned char c) { return std::toupper(c); });
    return word;
  }
  std::string_view line() {
    const std::size_t end = std::min(text_.find('\n', at_), text_.size());
    const std::string_view found = text_.substr(at_, end - at_);
    at_ = std::min(end + 1, text_.size());
    return found;
  }
  std::string word() {
    while (at_ < text_.size() && std::isspace(static_cast<unsigned char>(text_[at_]))) ++at_;
    const std::size_t from = at_;
    while (at_ < text_.size() && !std::isspace(static_cast<unsigned char>(text_[at_]))) ++at_;
    return std::string(text_.substr(from, at_ - from));
  }
  double number(const std::string& of) {
    const std::string text = word();
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size())
      refuse(raw_.file, of + " must be a number, found '" + text.substr(0, 40) + "'", "save it again");
    return value;
  }
  std::size_t count(const std::string& of) {
    const double value = number(of);
    if (!(value >= 0 && value <= 9.0 * kMostNodes) || value != std::floor(value))
      refuse(raw_.file, of + " must be a count, found " + fmt::format("{:g}", value), "save it again");
    return static_cast<std::size_t>(value);
  }

  /// The legacy words for types.
  static std::string modern(const std::string& type) {
    static const std::map<std::string, std::string> kTypes = {
        {"float", "Float32"}, {"double", "Float64"},        {"char", "Int8"},          {"unsigned_char", "UInt8"},
        {"short", "Int16"},   {"unsigned_short", "UInt16"}, {"int", "Int32"},          {"unsigned_int", "UInt32"},
        {"long", "Int64"},    {"unsigned_long", "UInt64"},  {"vtktypeint64", "Int64"}, {"vtkIdType", "Int64"}};
    const auto found = kTypes.find(type);
    return found == kTypes.end() ? std::string() : found->second;
  }

  std::vector<double> numbers(std::size_t wanted, const std::string& type, const std::string& name) {
    std::vector<double> values;
    const std::string stored = modern(type);
    if (stored.empty()) refuse(raw_.file, name + " is of the unknown type '" + type + "'", "save float or double");
    if (binary_) {
      line();  // the rest of the line that names them
      const std::size_t size = size_of_type(stored);
      if (text_.size() - at_ < wanted * size) refuse(raw_.file, name + " is cut short", "save it again");
      values.reserve(wanted);
      for (std::size_t i = 0; i < wanted; ++i)
        values.push_back(number_of_type(stored, text_.data() + at_ + i * size, true));
      at_ += wanted * size;
      return values;
    }
    values.reserve(std::min(wanted, text_.size()));
    while (values.size() < wanted) {
      if (at_ >= text_.size()) refuse(raw_.file, name + " is cut short", "save it again");
      values.push_back(number(name));
    }
    return values;
  }

  void grid(const std::string& kind) {
    if (kind != "STRUCTURED_POINTS" && kind != "STRUCTURED_GRID" && kind != "RECTILINEAR_GRID")
      refuse(raw_.file, "is a DATASET " + kind + ", not nodes of a box",
             "in ParaView: Resample To Image, then save as .vti");
    raw_.spacing_um = {1, 1, 1};
    for (;;) {
      const std::size_t before = at_;
      const std::string key = upper(word());
      if (key == "DIMENSIONS") {
        for (double& n : n_) n = static_cast<double>(count("DIMENSIONS"));
      } else if (key == "SPACING" || key == "ASPECT_RATIO") {
        for (double& s : raw_.spacing_um) s = number(key);
      } else if (key == "ORIGIN") {
        for (int i = 0; i < 3; ++i) number(key);
      } else if (key == "POINTS") {
        const std::size_t points = count("POINTS");
        const std::vector<double> places = numbers(3 * points, word(), "POINTS");
        box(places);
      } else if (key == "X_COORDINATES" || key == "Y_COORDINATES" || key == "Z_COORDINATES") {
        const std::size_t axis = static_cast<std::size_t>(key[0] - 'X'), steps = count(key);
        if (static_cast<double>(steps) != n_[axis])
          refuse(raw_.file, fmt::format("has {} {}, DIMENSIONS say {:.0f}", steps, key, n_[axis]), "save it again");
        const std::vector<double> places = numbers(steps, word(), key);
        if (steps >= 2) raw_.spacing_um[axis] = (places.back() - places.front()) / static_cast<double>(steps - 1);
        for (std::size_t i = 0; i < steps; ++i)
          even(places[i] - places[0], raw_.spacing_um[axis] * static_cast<double>(i), raw_.spacing_um[axis]);
      } else if (key == "METADATA") {
        skip_metadata();
      } else {
        at_ = before;
        return;
      }
    }
  }
  void even(double found, double expected, double step) const {
    // Single precision of coordinates far from the origin.
    constexpr double kEven = 1e-3;
    if (!(std::abs(found - expected) <= kEven * std::abs(step)))
      refuse(raw_.file, "its nodes are not evenly spaced along x, y and z",
             "in ParaView: Resample To Image, then save as .vti");
  }
  void box(const std::vector<double>& places) {
    const std::size_t nx = static_cast<std::size_t>(n_[0]), ny = static_cast<std::size_t>(n_[1]);
    if (static_cast<double>(places.size()) != 3 * n_[0] * n_[1] * n_[2])
      refuse(raw_.file, fmt::format("has {} POINTS, DIMENSIONS say {:.0f}", places.size() / 3, n_[0] * n_[1] * n_[2]),
             "save it again");
    check_size(raw_.file, n_[0], n_[1], n_[2]);
    const std::array<std::size_t, 3> step{1, nx, nx * ny};
    for (std::size_t k = 0; k < 3; ++k) raw_.spacing_um[k] = places[3 * step[k] + k] - places[k];
    for (std::size_t i = 0; i < places.size() / 3; ++i)
      for (std::size_t k = 0; k < 3; ++k) {
        const std::size_t along = i / step[k] % static_cast<std::size_t>(n_[k]);
        even(places[3 * i + k] - places[k], raw_.spacing_um[k] * static_cast<double>(along), raw_.spacing_um[k]);
      }
  }
  void skip_metadata() {
    line();
    while (at_ < text_.size() && !line().empty()) {
    }
  }

  void attributes() {
    const std::size_t nodes = static_cast<std::size_t>(n_[0] * n_[1] * n_[2]);
    bool of_points = false;
    const auto keep = [&](const std::string& name, int components, const std::string& type) {
      NodeArray array;
      array.components = components;
      array.values = numbers(nodes * static_cast<std::size_t>(components), type, name);
      arrays_[name] = std::move(array);
    };
    for (std::string key = upper(word()); !key.empty(); key = upper(word())) {
      if (key == "POINT_DATA") {
        of_points = true;
        if (count("POINT_DATA") != nodes) refuse(raw_.file, "POINT_DATA is not of all nodes", "save it again");
      } else if (key == "CELL_DATA") {
        if (arrays_.empty() || !of_points)
          refuse(raw_.file, "has its arrays in CELL_DATA", "in ParaView: Cell Data To Point Data");
        return;
      } else if (key == "VECTORS" || key == "NORMALS" || key == "TENSORS" || key == "TENSORS6") {
        const std::string name = word(), type = word();
        keep(name, key == "TENSORS" ? 9 : key == "TENSORS6" ? 6 : 3, type);
      } else if (key == "SCALARS") {
        const std::string name = word(), type = word();
        int components = 1;
        const std::size_t before = at_;
        std::string next = word();
        if (!next.empty() && std::isdigit(static_cast<unsigned char>(next[0]))) {
          components = std::clamp(std::atoi(next.c_str()), 1, 9);
        } else {
          at_ = before;
        }
        const std::size_t table = at_;
        if (upper(word()) == "LOOKUP_TABLE")
          word();
        else
          at_ = table;
        keep(name, components, type);
      } else if (key == "LOOKUP_TABLE") {
        const std::string name = word();
        const std::size_t size = count("LOOKUP_TABLE");
        numbers(4 * size, binary_ ? "unsigned_char" : "float", name);
      } else if (key == "FIELD") {
        word();
        const std::size_t arrays = count("FIELD");
        for (std::size_t i = 0; i < arrays; ++i) {
          std::string name = word();
          if (upper(name) == "METADATA") {
            skip_metadata();
            name = word();
          }
          const std::size_t components = count(name), tuples = count(name);
          const std::string type = word();
          if (tuples == nodes && components >= 1 && components <= 9)
            keep(name, static_cast<int>(components), type);
          else
            numbers(components * tuples, type, name);
        }
      } else if (key == "METADATA") {
        skip_metadata();
      } else {
        refuse(raw_.file, "has '" + key.substr(0, 40) + "' where an array should start", "save it as .vti");
      }
    }
  }

  std::string_view text_;
  const VolumeRequest& request_;
  RawVolume raw_;
  std::size_t at_ = 0;
  bool binary_ = false;
  std::array<double, 3> n_{};
  std::map<std::string, NodeArray> arrays_;
};

}  // namespace

RawVolume read_legacy_vtk(const std::string& content, const VolumeRequest& request) {
  return LegacyReader(content, request).read();
}

}  // namespace birefit::fields
