#include "io/volume_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <map>
#include <sstream>

#include <fmt/format.h>
#include <Eigen/Dense>
#include <pugixml.hpp>

namespace birefit {
namespace {

constexpr std::size_t kMostNodes = 100'000'000;

/// What both formats come down to: components of one array by node, x fastest.
struct NodeArray {
  int components = 0;
  std::vector<double> values;  ///< [node * components + component]
};

struct RawVolume {
  std::string file;
  int nx = 0, ny = 0, nz = 0;
  std::array<double, 3> spacing_um{};
  std::string name;     ///< of the array with the directors, for messages
  bool tensor = false;  ///< `field` is Q with 6 components xx, yy, zz, xy, xz, yz
  NodeArray field;      ///< 3 or 6 components
  std::optional<NodeArray> order, mask;
};

[[noreturn]] void refuse(const std::string& file, const std::string& what, const std::string& hint) {
  throw UserError({file}, what, hint);
}

void check_size(const std::string& file, double nx, double ny, double nz) {
  if (!(nx >= 2 && ny >= 2 && nz >= 2))
    refuse(file,
           fmt::format("has {:.0f} x {:.0f} x {:.0f} nodes (x, y, z): at least 2 are needed along each", nx, ny, nz),
           "repeat a single layer: the field then does not change across it");
  if (nx * ny * nz > static_cast<double>(kMostNodes))
    refuse(file, fmt::format("has {:.3g} nodes, more than {:.0e}", nx * ny * nz, static_cast<double>(kMostNodes)),
           "keep every second node along each side");
}

// ---- from arrays to the grid ---------------------------------------------------------------------------------------

class GridMaker {
 public:
  GridMaker(const RawVolume& raw, double bulk_order) : raw_(raw) { result_.bulk_order = bulk_order; }

  LoadedVolume make() {
    auto grid = std::make_shared<VolumeGrid>();
    grid->nx = raw_.nx, grid->ny = raw_.ny, grid->nz = raw_.nz;
    grid->spacing_um = raw_.spacing_um;
    const std::size_t count =
        static_cast<std::size_t>(raw_.nx) * static_cast<std::size_t>(raw_.ny) * static_cast<std::size_t>(raw_.nz);
    grid->nodes.assign(count, {});
    double largest = 0;
    for (std::size_t i = 0; i < count; ++i) {
      if (raw_.mask) {
        const double inside = raw_.mask->values[i];
        if (std::isnan(inside)) refuse_node("domain_mask", i, "is NaN", "1 inside, 0 outside");
        if (!(inside > 0.5)) continue;  // what stands there does not matter
      }
      ++inside_;
      const double order = raw_.tensor ? by_tensor(i, grid->nodes[i]) : by_director(i, grid->nodes[i]);
      largest = std::max(largest, std::abs(order));
    }
    if (inside_ == 0) refuse(raw_.file, "domain_mask leaves no node", "it is 1 (above 0.5) inside the liquid crystal");
    if (!(largest > 0))
      refuse(raw_.file, raw_.tensor ? "Q is zero at every node" : "S is zero at every node",
             "nothing here turns light");
    if (!(result_.bulk_order > 0)) result_.bulk_order = raw_.tensor || raw_.order ? largest : 1;
    if (largest > 1.05 * result_.bulk_order)
      result_.warnings.push_back(
          fmt::format("The order in {} reaches {:.4g}, above bulk_order = {:.4g}: the birefringence there is larger "
                      "than the material's.",
                      raw_.file, largest, result_.bulk_order));
    for (auto& node : grid->nodes)
      for (double& component : node) component /= result_.bulk_order;
    if (worst_length_ > 1e-3)
      result_.warnings.push_back(
          fmt::format("Directors in {} are not of unit length (off by up to {:.2g}, at {}); they were normalised.",
                      raw_.file, worst_length_, place(worst_node_)));
    result_.grid = std::move(grid);
    return std::move(result_);
  }

 private:
  std::string place(std::size_t node) const {
    const std::size_t nx = static_cast<std::size_t>(raw_.nx), ny = static_cast<std::size_t>(raw_.ny);
    return fmt::format("[x, y, z] = [{}, {}, {}]", node % nx, node / nx % ny, node / nx / ny);
  }
  [[noreturn]] void refuse_node(const std::string& array, std::size_t node, const std::string& what,
                                const std::string& hint) const {
    refuse(raw_.file, fmt::format("{} {} at node {}", array, what, place(node)), hint);
  }
  double by_director(std::size_t i, std::array<double, 6>& node) {
    const double* n = raw_.field.values.data() + 3 * i;
    const double s = raw_.order ? raw_.order->values[i] : 1, length = std::hypot(n[0], n[1], n[2]);
    if (!std::isfinite(s))
      refuse_node("S", i, "is not a finite number", "give domain_mask = 0 where there is no liquid crystal");
    if (s == 0) return 0;  // isotropic: no direction needed
    if (!std::isfinite(length)) refuse_node(raw_.name, i, "is not a finite number", outside());
    if (!(length > 0)) refuse_node(raw_.name, i, "is zero", outside());
    if (std::abs(length - 1) > worst_length_) {
      worst_length_ = std::abs(length - 1);
      worst_node_ = i;
    }
    node = director_tensor(n[0] / length, n[1] / length, n[2] / length, s);
    return s;
  }
  /// The axis of the largest eigenvalue; Q = S (n n - 1/3) has it at 2 S / 3. What is biaxial is left out.
  double by_tensor(std::size_t i, std::array<double, 6>& node) {
    const double* q = raw_.field.values.data() + 6 * i;
    double size = 0;
    for (int c = 0; c < 6; ++c) {
      if (!std::isfinite(q[c]))
        refuse_node(raw_.name, i, "is not a finite number",
                    "Q = 0 is isotropic: write that where there is no liquid crystal");
      size = std::max(size, std::abs(q[c]));
    }
    if (size == 0) return 0;
    if (std::abs(q[0] + q[1] + q[2]) > 1e-3 * size)
      refuse_node(
          raw_.name, i, fmt::format("has the trace {:.3g}", q[0] + q[1] + q[2]),
          "Q = S (n n - 1/3) has none; six components come as xx, yy, zz, then xy, xz, yz (.npy) or xy, yz, xz (.vti)");
    Eigen::Matrix3d m;
    m << q[0], q[3], q[4], q[3], q[1], q[5], q[4], q[5], q[2];
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(m);
    const Eigen::Vector3d n = solver.eigenvectors().col(2);
    const double s = 1.5 * solver.eigenvalues()[2];
    node = director_tensor(n[0], n[1], n[2], s);
    return s;
  }
  std::string outside() const {
    return raw_.mask ? "the domain mask says that liquid crystal is there"
                     : "where there is no liquid crystal give domain_mask = 0 (.vti), or write the tensor Q, which may "
                       "be 0, in place of n";
  }

  const RawVolume& raw_;
  LoadedVolume result_;
  std::size_t inside_ = 0, worst_node_ = 0;
  double worst_length_ = 0;
};

/// [3][3] in rows to xx, yy, zz, xy, xz, yz.
void to_six(NodeArray& field) {
  std::vector<double> six;
  six.reserve(field.values.size() / 9 * 6);
  for (std::size_t i = 0; i + 9 <= field.values.size(); i += 9) {
    const double* m = field.values.data() + i;
    six.insert(six.end(), {m[0], m[4], m[8], 0.5 * (m[1] + m[3]), 0.5 * (m[2] + m[6]), 0.5 * (m[5] + m[7])});
  }
  field.values = std::move(six);
  field.components = 6;
}

template <class T>
T read_as(const char* from) {
  T value;
  std::memcpy(&value, from, sizeof value);
  return value;
}

// ---- .npy ----------------------------------------------------------------------------------------------------------
// https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html

/// The text behind 'key': in the header's dictionary, up to where its value ends.
std::string npy_entry(const std::string& header, const std::string& key) {
  std::size_t at = header.find("'" + key + "'");
  if (at == std::string::npos) return {};
  at = header.find(':', at);
  if (at == std::string::npos) return {};
  at = header.find_first_not_of(' ', at + 1);
  if (at == std::string::npos) return {};
  const char first = header[at];
  const std::size_t end = first == '('    ? header.find(')', at)
                          : first == '['  ? header.find(']', at)
                          : first == '\'' ? header.find('\'', at + 1)
                                          : header.find_first_of(",}", at);
  return end == std::string::npos
             ? std::string()
             : header.substr(at, end - at + (first == '(' || first == '\'' || first == '[' ? 1 : 0));
}

RawVolume read_npy(const std::string& content, const VolumeRequest& request) {
  RawVolume raw;
  raw.file = request.path.string();
  raw.name = "the director";
  const auto cut_short = [&] { refuse(raw.file, "is cut short", "save it again"); };
  if (content.size() < 10 || content.compare(0, 6, "\x93NUMPY") != 0)
    refuse(raw.file, "is no NumPy array", "numpy.save writes one (no .npz)");
  const int version = static_cast<unsigned char>(content[6]);
  if (version < 1 || version > 3)
    refuse(raw.file, fmt::format("is a NumPy array of version {}", version), "versions 1 to 3 are read");
  const std::size_t start = version == 1 ? 10 : 12;
  if (content.size() < start) cut_short();
  const std::size_t length =
      version == 1 ? read_as<std::uint16_t>(content.data() + 8) : read_as<std::uint32_t>(content.data() + 8);
  if (content.size() < start + length) cut_short();
  const std::string header = content.substr(start, length);
  const std::string type = npy_entry(header, "descr"), order = npy_entry(header, "fortran_order"),
                    shape_text = npy_entry(header, "shape");
  if (type != "'<f4'" && type != "'<f8'")
    refuse(raw.file, "holds " + (type.empty() ? std::string("an unknown type") : type) + ", not little-endian floats",
           "save array.astype('<f4') or '<f8'");
  const bool fortran = order == "True";
  if (!fortran && order != "False") refuse(raw.file, "does not say its fortran_order", "numpy.save writes it");
  std::vector<std::size_t> shape;
  double all = 1;
  for (std::size_t i = 0; i < shape_text.size();) {
    if (shape_text[i] < '0' || shape_text[i] > '9') {
      ++i;
      continue;
    }
    std::size_t n = 0;
    const auto [end, error] = std::from_chars(shape_text.data() + i, shape_text.data() + shape_text.size(), n);
    i = static_cast<std::size_t>(end - shape_text.data());
    if (error != std::errc()) n = kMostNodes * 10;
    shape.push_back(n);
    all *= static_cast<double>(n);
  }
  const std::string expected = request.x_first ? "(nx, ny, nz, 3)" : "(nz, ny, nx, 3)";
  const bool director = shape.size() == 4 && shape[3] == 3, six = shape.size() == 4 && shape[3] == 6,
             nine = shape.size() == 5 && shape[3] == 3 && shape[4] == 3;
  if (!director && !six && !nine) {
    const bool leading = shape.size() == 4 && (shape[0] == 3 || shape[0] == 6);
    refuse(raw.file,
           "has the shape " + (shape_text.empty() ? "()" : shape_text) + ", expected " + expected +
               " for a director, .. 6) or .. 3, 3) for a tensor Q",
           leading ? "the components come last: numpy.moveaxis(array, 0, -1)" : "");
  }
  const std::size_t x = request.x_first ? 0 : 2, z = request.x_first ? 2 : 0;
  check_size(raw.file, static_cast<double>(shape[x]), static_cast<double>(shape[1]), static_cast<double>(shape[z]));
  if (!request.spacing_um) throw UserError(request.where, "a .npy file needs spacing_um", "[dx, dy, dz] between nodes");
  raw.spacing_um = *request.spacing_um;
  raw.nx = static_cast<int>(shape[x]), raw.ny = static_cast<int>(shape[1]), raw.nz = static_cast<int>(shape[z]);
  const std::size_t bytes = type == "'<f4'" ? 4 : 8, data = start + length;
  if (static_cast<double>(content.size() - data) != all * static_cast<double>(bytes))
    refuse(raw.file,
           fmt::format("has {} bytes of data, its shape needs {:.0f}", content.size() - data,
                       all * static_cast<double>(bytes)),
           "it was cut short or mixed up: save it again");
  raw.tensor = !director;
  if (raw.tensor) raw.name = "Q";
  raw.field.components = director ? 3 : six ? 6 : 9;
  const std::size_t components = static_cast<std::size_t>(raw.field.components);
  // Of one step along z, y, x and the component, in numbers; the last two axes of (.., 3, 3) in rows or in columns,
  // which a symmetric tensor does not mind.
  std::array<std::size_t, 4> stride;
  const std::array<std::size_t, 4> n{shape[0], shape[1], shape[2], components};
  for (std::size_t i = 0; i < 4; ++i) {
    stride[i] = 1;
    for (std::size_t k = 0; k < 4; ++k)
      if (fortran ? k < i : k > i) stride[i] *= n[k];
  }
  raw.field.values.resize(shape[0] * shape[1] * shape[2] * components);
  std::size_t to = 0;
  for (std::size_t k = 0; k < shape[z]; ++k)
    for (std::size_t j = 0; j < shape[1]; ++j)
      for (std::size_t i = 0; i < shape[x]; ++i)
        for (std::size_t c = 0; c < components; ++c) {
          const char* from =
              content.data() + data + bytes * (k * stride[z] + j * stride[1] + i * stride[x] + c * stride[3]);
          raw.field.values[to++] = bytes == 4 ? static_cast<double>(read_as<float>(from)) : read_as<double>(from);
        }
  if (nine) to_six(raw.field);
  return raw;
}

// ---- .vti ----------------------------------------------------------------------------------------------------------
// https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html

/// Bytes of base64 from `from` on, until `bytes` are there or the text ends; length and data may each be padded.
std::string base64_bytes(std::string_view text, std::size_t bytes) {
  std::string out;
  unsigned group = 0;
  int digits = 0, padding = 0;
  for (char c : text) {
    if (out.size() >= bytes) break;
    int digit;
    if (c >= 'A' && c <= 'Z')
      digit = c - 'A';
    else if (c >= 'a' && c <= 'z')
      digit = c - 'a' + 26;
    else if (c >= '0' && c <= '9')
      digit = c - '0' + 52;
    else if (c == '+')
      digit = 62;
    else if (c == '/')
      digit = 63;
    else if (c == '=')
      digit = 0, ++padding;
    else if (c == ' ' || c == '\n' || c == '\r' || c == '\t')
      continue;
    else
      break;
    group = group << 6 | static_cast<unsigned>(digit);
    if (++digits < 4) continue;
    for (int k = 0; k < 3 - padding; ++k) out.push_back(static_cast<char>(group >> (16 - 8 * k) & 255));
    group = 0;
    digits = padding = 0;
  }
  return out;
}

class VtiReader {
 public:
  VtiReader(std::string content, const VolumeRequest& request) : content_(std::move(content)), request_(request) {
    raw_.file = request.path.string();
  }

  RawVolume read() {
    if (request_.spacing_um)
      throw UserError(request_.where, "spacing_um belongs to .npy files: a .vti says it itself", "leave it out");
    // Behind its underscore the appended data may be anything but XML.
    std::string xml = content_;
    const std::size_t tag = content_.find("<AppendedData");
    if (tag != std::string::npos) {
      const std::size_t close = content_.find('>', tag);
      const std::size_t mark = close == std::string::npos ? close : content_.find('_', close);
      if (mark == std::string::npos) refuse(raw_.file, "its AppendedData has no data (no '_')", "save it again");
      appended_ = std::string_view(content_).substr(mark + 1);
      xml = content_.substr(0, close + 1) + "</AppendedData></VTKFile>";
    }
    pugi::xml_document document;
    if (const pugi::xml_parse_result parsed = document.load_buffer(xml.data(), xml.size()); !parsed) {
      const auto end =
          xml.begin() + std::clamp<std::ptrdiff_t>(parsed.offset, 0, static_cast<std::ptrdiff_t>(xml.size()));
      throw UserError({raw_.file, 1 + static_cast<int>(std::count(xml.begin(), end, '\n'))},
                      std::string("is no XML: ") + parsed.description(),
                      "VTK XML image data (.vti) is read; legacy .vtk files are not");
    }
    file_ = document.child("VTKFile");
    const pugi::xml_node image = file_.child("ImageData");
    if (!file_ || !image)
      refuse(raw_.file,
             file_
                 ? std::string("is VTK data of type ") + file_.attribute("type").as_string("(none)") + ", not ImageData"
                 : "is no VTK XML file",
             "in ParaView: Resample To Image, then save as .vti");
    appended_base64_ = std::string(file_.child("AppendedData").attribute("encoding").as_string("base64")) != "raw";
    const std::array<double, 6> extent = numbers<6>(image, "WholeExtent", {});
    const pugi::xml_node piece = image.child("Piece");
    if (!piece || piece.next_sibling("Piece"))
      refuse(raw_.file, piece ? "has several pieces" : "has no Piece",
             "save it from one process, or merge it in ParaView");
    if (piece.attribute("Extent") && numbers<6>(piece, "Extent", {}) != extent)
      refuse(raw_.file, "its Piece is not the WholeExtent", "save the whole image");
    raw_.spacing_um = numbers<3>(image, "Spacing", {{1, 1, 1}});
    for (double s : raw_.spacing_um)
      if (!(s > 0 && s < 1e6)) refuse(raw_.file, "Spacing must be three positive numbers (micrometres)", "");
    const std::array<double, 9> turn = numbers<9>(image, "Direction", {{1, 0, 0, 0, 1, 0, 0, 0, 1}});
    if (turn != std::array<double, 9>{1, 0, 0, 0, 1, 0, 0, 0, 1})
      refuse(raw_.file, "is turned (Direction)", "save it along its axes and use rotation_deg");
    check_size(raw_.file, extent[1] - extent[0] + 1, extent[3] - extent[2] + 1, extent[5] - extent[4] + 1);
    raw_.nx = static_cast<int>(extent[1] - extent[0]) + 1, raw_.ny = static_cast<int>(extent[3] - extent[2]) + 1,
    raw_.nz = static_cast<int>(extent[5] - extent[4]) + 1;
    const pugi::xml_node points = piece.child("PointData"), cells = piece.child("CellData");
    const pugi::xml_node n = array(points, "n"), q = array(points, "Q");
    if (!n && !q) {
      if (array(cells, "n") || array(cells, "Q"))
        refuse(raw_.file, "has its directors in CellData", "in ParaView: Cell Data To Point Data");
      refuse(raw_.file, "has no array n (3 components) or Q (6 or 9) in PointData" + names(points), "rename the array");
    }
    if (n && q) refuse(raw_.file, "has both n and Q", "leave one out");
    raw_.tensor = !n;
    raw_.name = n ? "n" : "Q";
    raw_.field = values(n ? n : q, n ? std::vector<int>{3} : std::vector<int>{6, 9});
    if (raw_.field.components == 9) {
      to_six(raw_.field);
    } else if (raw_.tensor) {
      // VTK: .. xy, yz, xz
      for (std::size_t i = 0; i + 6 <= raw_.field.values.size(); i += 6)
        std::swap(raw_.field.values[i + 4], raw_.field.values[i + 5]);
    }
    for (const auto& [name, to] : {std::pair("S", &raw_.order), std::pair("domain_mask", &raw_.mask)}) {
      if (const pugi::xml_node node = array(points, name)) {
        if (raw_.tensor && to == &raw_.order) continue;  // the tensor says it
        *to = values(node, {1});
      } else if (array(cells, name)) {
        refuse(raw_.file, std::string("has ") + name + " in CellData", "in ParaView: Cell Data To Point Data");
      }
    }
    return std::move(raw_);
  }

 private:
  template <std::size_t N>
  std::array<double, N> numbers(const pugi::xml_node& node, const char* key,
                                std::optional<std::array<double, N>> fallback) const {
    if (!node.attribute(key)) {
      if (fallback) return *fallback;
      refuse(raw_.file, std::string(node.name()) + " has no " + key, "save it again");
    }
    std::array<double, N> r;
    std::istringstream in(node.attribute(key).as_string());
    for (double& x : r)
      if (!(in >> x))
        refuse(raw_.file, fmt::format("{} must be {} numbers, found '{}'", key, N, node.attribute(key).as_string()),
               "save it again");
    return r;
  }
  static pugi::xml_node array(const pugi::xml_node& data, const char* name) {
    return data.find_child_by_attribute("DataArray", "Name", name);
  }
  static std::string names(const pugi::xml_node& data) {
    std::string list;
    for (const pugi::xml_node& node : data.children("DataArray"))
      list += (list.empty() ? "; it has " : ", ") + std::string(node.attribute("Name").as_string());
    return list;
  }
  NodeArray values(const pugi::xml_node& node, const std::vector<int>& allowed) const {
    const std::string name = node.attribute("Name").as_string(), type = node.attribute("type").as_string(),
                      format = node.attribute("format").as_string("ascii");
    NodeArray r;
    r.components = node.attribute("NumberOfComponents").as_int(1);
    if (std::find(allowed.begin(), allowed.end(), r.components) == allowed.end())
      refuse(raw_.file,
             fmt::format("{} has {} components, expected {}{}", name, r.components, allowed[0],
                         allowed.size() > 1 ? fmt::format(" or {}", allowed[1]) : ""),
             "");
    const std::size_t count = static_cast<std::size_t>(raw_.nx) * static_cast<std::size_t>(raw_.ny) *
                              static_cast<std::size_t>(raw_.nz) * static_cast<std::size_t>(r.components);
    r.values.reserve(count);
    if (format == "ascii") {
      const char *at = node.child_value(), *end = at + std::strlen(at);
      for (;;) {
        while (at < end && (*at == ' ' || *at == '\n' || *at == '\r' || *at == '\t')) ++at;
        if (at == end) break;
        double x = 0;
        const auto [next, error] = std::from_chars(at, end, x);
        if (error != std::errc() && error != std::errc::result_out_of_range)
          refuse(raw_.file, fmt::format("{}: value {} is no number", name, r.values.size() + 1), "");
        r.values.push_back(x);
        at = next;
      }
      check_count(name, r.values.size(), count);
      return r;
    }
    if (file_.attribute("compressor"))
      refuse(raw_.file,
             std::string("is compressed (") + file_.attribute("compressor").as_string() + "), which is not read",
             "save it uncompressed (ParaView: Compressor Type None) or in ascii");
    if (std::string(file_.attribute("byte_order").as_string("LittleEndian")) != "LittleEndian")
      refuse(raw_.file, "is BigEndian, which is not read", "save it little-endian or in ascii");
    const std::string header = file_.attribute("header_type").as_string("UInt32");
    if (header != "UInt32" && header != "UInt64")
      refuse(raw_.file, "header_type " + header + " is unknown", "UInt32 and UInt64 are read");
    static const std::map<std::string, std::size_t> sizes = {
        {"Float32", 4}, {"Float64", 8}, {"Int8", 1},   {"UInt8", 1}, {"Int16", 2},
        {"UInt16", 2},  {"Int32", 4},   {"UInt32", 4}, {"Int64", 8}, {"UInt64", 8}};
    const auto size = sizes.find(type);
    if (size == sizes.end())
      refuse(raw_.file, name + " is of the unknown type '" + type + "'", "save Float32 or Float64");
    const std::size_t prefix = header == "UInt32" ? 4 : 8, wanted = prefix + count * size->second;
    std::string bytes;
    if (format == "binary") {
      bytes = base64_bytes(node.child_value(), wanted);
    } else if (format == "appended") {
      const std::size_t offset = node.attribute("offset").as_ullong();
      if (!node.attribute("offset") || offset >= appended_.size())
        refuse(raw_.file, name + " is appended behind the end of the file", "it was cut short: save it again");
      bytes = appended_base64_ ? base64_bytes(appended_.substr(offset), wanted)
                               : std::string(appended_.substr(offset, wanted));
    } else {
      refuse(raw_.file, name + " has the unknown format '" + format + "'", "ascii, binary and appended are read");
    }
    if (bytes.size() < prefix) refuse(raw_.file, name + " is cut short", "save it again");
    const std::uint64_t stated =
        prefix == 4 ? read_as<std::uint32_t>(bytes.data()) : read_as<std::uint64_t>(bytes.data());
    check_count(name, static_cast<std::size_t>(stated / size->second), count);
    if (bytes.size() < wanted) refuse(raw_.file, name + " is cut short", "save it again");
    for (std::size_t i = 0; i < count; ++i) r.values.push_back(number(type, bytes.data() + prefix + i * size->second));
    return r;
  }
  void check_count(const std::string& name, std::size_t found, std::size_t expected) const {
    if (found != expected)
      refuse(raw_.file,
             fmt::format("{} has {} numbers, its {} x {} x {} nodes need {}", name, found, raw_.nx, raw_.ny, raw_.nz,
                         expected),
             "WholeExtent counts from the first to the last node");
  }
  static double number(const std::string& type, const char* from) {
    if (type == "Float32") return read_as<float>(from);
    if (type == "Float64") return read_as<double>(from);
    if (type == "Int8") return read_as<std::int8_t>(from);
    if (type == "UInt8") return read_as<std::uint8_t>(from);
    if (type == "Int16") return read_as<std::int16_t>(from);
    if (type == "UInt16") return read_as<std::uint16_t>(from);
    if (type == "Int32") return read_as<std::int32_t>(from);
    if (type == "UInt32") return read_as<std::uint32_t>(from);
    if (type == "Int64") return static_cast<double>(read_as<std::int64_t>(from));
    return static_cast<double>(read_as<std::uint64_t>(from));
  }

  std::string content_;
  const VolumeRequest& request_;
  RawVolume raw_;
  std::string_view appended_;
  bool appended_base64_ = false;
  pugi::xml_node file_;
};

}  // namespace

LoadedVolume load_volume(const VolumeRequest& request) {
  std::error_code code;
  if (!std::filesystem::is_regular_file(request.path, code))
    throw UserError(
        request.where,
        request.path.string() + (std::filesystem::exists(request.path, code) ? " is no file" : " does not exist"));
  if (std::filesystem::file_size(request.path, code) > (std::uintmax_t{1} << 33))
    throw UserError(request.where, request.path.string() + " is larger than 8 GB",
                    "keep every second node along each side");
  const std::string extension = request.path.extension().string();
  if (extension != ".npy" && extension != ".vti")
    throw UserError(
        request.where, request.path.string() + " is neither .npy nor .vti",
        extension == ".npz" ? "numpy.save writes a .npy" : "numpy.save writes .npy; ParaView and VTK write .vti");
  std::ifstream in(request.path, std::ios::binary);
  std::string content{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  if (!in) throw UserError(request.where, request.path.string() + " cannot be read");
  const RawVolume raw =
      extension == ".npy" ? read_npy(content, request) : VtiReader(std::move(content), request).read();
  return GridMaker(raw, request.bulk_order).make();
}

}  // namespace birefit
