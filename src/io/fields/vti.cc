#include <algorithm>
#include <array>
#include <map>
#include <sstream>
#include <string_view>

#include <fmt/format.h>
#include <pugixml.hpp>

#include "io/fields/blocks.h"
#include "io/fields/vtk.h"
#include "io/files/byte_order.h"

namespace birefit::fields {
namespace {

class VtiReader {
 public:
  VtiReader(std::string content, const VolumeRequest& request) : content_(std::move(content)), request_(request) {
    raw_.file = request.path.string();
  }

  RawVolume read() {
    refuse_spacing(request_, ".vti");
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
                      std::string("is no XML: ") + parsed.description(), "VTK XML image data is read");
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
    if (request_.array.empty() && !array(points, "n") && !array(points, "Q") &&
        (array(cells, "n") || array(cells, "Q")))
      refuse(raw_.file, "has its directors in CellData", "in ParaView: Cell Data To Point Data");
    const std::string field = chosen_array(request_, names(points));
    take_field(values(array(points, field.c_str()), {3, 6, 9}), field, raw_);
    for (const auto& [name, to] : {std::pair("S", &raw_.order), std::pair("domain_mask", &raw_.mask)}) {
      if (const pugi::xml_node node = array(points, name)) {
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
  static std::vector<std::string> names(const pugi::xml_node& data) {
    std::vector<std::string> list;
    for (const pugi::xml_node& node : data.children("DataArray")) list.push_back(node.attribute("Name").as_string());
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
      const std::string text = node.child_value();
      read_ascii(text, raw_.file, name, count + 1, r.values);
      check_count(name, r.values.size(), count);
      return r;
    }
    const std::string order = file_.attribute("byte_order").as_string("LittleEndian");
    if (order != "LittleEndian" && order != "BigEndian") refuse(raw_.file, "byte_order " + order + " is unknown", "");
    const bool swapped = order == "BigEndian";  // this program runs on little-endian machines
    const std::size_t size = size_of_type(type);
    if (size == 0) refuse(raw_.file, name + " is of the unknown type '" + type + "'", "save Float32 or Float64");
    std::string_view text;
    bool base64 = true;
    if (format == "binary") {
      text = node.child_value();
    } else if (format == "appended") {
      const std::size_t offset = node.attribute("offset").as_ullong();
      if (!node.attribute("offset") || offset >= appended_.size())
        refuse(raw_.file, name + " is appended behind the end of the file", "it was cut short: save it again");
      text = appended_.substr(offset);
      base64 = appended_base64_;
    } else {
      refuse(raw_.file, name + " has the unknown format '" + format + "'", "ascii, binary and appended are read");
    }
    const std::string bytes = file_.attribute("compressor") ? unpacked_bytes(text, base64, swapped, count * size, name)
                                                            : plain_bytes(text, base64, swapped, count, size, name);
    for (std::size_t i = 0; i < count; ++i) r.values.push_back(number_of_type(type, bytes.data() + i * size, swapped));
    return r;
  }

  /// Of a word of a header, which counts bytes.
  std::size_t word_size() const {
    const std::string header = file_.attribute("header_type").as_string("UInt32");
    if (header != "UInt32" && header != "UInt64")
      refuse(raw_.file, "header_type " + header + " is unknown", "UInt32 and UInt64 are read");
    return header == "UInt32" ? 4 : 8;
  }
  static std::uint64_t word(std::string_view bytes, std::size_t at, std::size_t size, bool swapped) {
    const char* from = bytes.data() + at * size;
    return size == 4 ? read_as<std::uint32_t>(from, swapped) : read_as<std::uint64_t>(from, swapped);
  }

  std::string plain_bytes(std::string_view text, bool base64, bool swapped, std::size_t count, std::size_t size,
                          const std::string& name) const {
    const std::size_t prefix = word_size(), wanted = prefix + count * size;
    const std::string bytes = base64 ? base64_bytes(text, wanted) : std::string(text.substr(0, wanted));
    if (bytes.size() < prefix) refuse(raw_.file, name + " is cut short", "save it again");
    check_count(name, static_cast<std::size_t>(word(bytes, 0, prefix, swapped) / size), count);
    if (bytes.size() < wanted) refuse(raw_.file, name + " is cut short", "save it again");
    return bytes.substr(prefix);
  }

  /// Blocks: their number, the size of each and of the last (0: as the others), their packed sizes; then the blocks.
  std::string unpacked_bytes(std::string_view text, bool base64, bool swapped, std::size_t wanted,
                             const std::string& name) const {
    static const std::map<std::string, Packing> kPackings = {{"vtkZLibDataCompressor", Packing::zlib},
                                                             {"vtkLZ4DataCompressor", Packing::lz4},
                                                             {"vtkLZMADataCompressor", Packing::lzma}};
    const std::string compressor = file_.attribute("compressor").as_string();
    const auto packing = kPackings.find(compressor);
    if (packing == kPackings.end())
      refuse(raw_.file, "is compressed by " + compressor + ", which is not read",
             "zlib, LZ4 and LZMA are (ParaView: Compressor Type), as is what is not compressed");
    const auto damaged = [&] { refuse(raw_.file, name + " is cut short or damaged", "save it again"); };
    const std::size_t size = word_size();
    std::string compact;  // without the line ends that some writers put in
    if (base64) {
      for (const char c : text)
        if (c == '<')
          break;  // behind appended data
        else if (c != ' ' && c != '\n' && c != '\r' && c != '\t')
          compact += c;
      text = compact;
    }
    const auto head = [&](std::size_t words) {
      std::string bytes = base64 ? base64_bytes(text, words * size) : std::string(text.substr(0, words * size));
      if (bytes.size() < words * size) damaged();
      return bytes;
    };
    const std::uint64_t blocks = word(head(1), 0, size, swapped);
    if (blocks > wanted) damaged();
    const std::string header = head(3 + blocks);
    const std::uint64_t each = word(header, 1, size, swapped), last = word(header, 2, size, swapped);
    // The sizes may be damaged: in doubles their product does not run over.
    const double total = static_cast<double>(blocks - (blocks > 0 && last > 0 ? 1 : 0)) * static_cast<double>(each) +
                         static_cast<double>(last);
    check_bytes(name, total, static_cast<double>(wanted));
    std::uint64_t packed_total = 0;
    for (std::uint64_t b = 0; b < blocks; ++b) {
      const std::uint64_t length = word(header, 3 + b, size, swapped);
      if (length > text.size()) damaged();
      packed_total += length;
    }
    // The header is encoded by itself, the blocks together.
    const std::size_t start = base64 ? base64_length(header.size()) : header.size();
    if (start > text.size()) damaged();
    const std::string decoded = base64 ? base64_bytes(text.substr(start), packed_total) : std::string();
    std::string_view data = base64 ? std::string_view(decoded) : text.substr(start);
    std::string bytes;
    for (std::uint64_t b = 0; b < blocks; ++b) {
      const std::uint64_t length = word(header, 3 + b, size, swapped);
      if (length > data.size()) damaged();
      const auto block = unpacked(data.substr(0, length), b + 1 == blocks && last > 0 ? last : each, packing->second);
      if (!block) damaged();
      bytes += *block;
      data.remove_prefix(length);
    }
    return bytes;
  }
  void check_bytes(const std::string& name, double found, double expected) const {
    if (found != expected)
      refuse(raw_.file,
             fmt::format("{} has {:.0f} bytes, its {} x {} x {} nodes need {}", name, found, raw_.nx, raw_.ny, raw_.nz,
                         expected),
             "WholeExtent counts from the first to the last node");
  }
  void check_count(const std::string& name, std::size_t found, std::size_t expected) const {
    if (found != expected)
      refuse(raw_.file,
             fmt::format("{} has {} numbers, its {} x {} x {} nodes need {}", name, found, raw_.nx, raw_.ny, raw_.nz,
                         expected),
             "WholeExtent counts from the first to the last node");
  }
  std::string content_;
  const VolumeRequest& request_;
  RawVolume raw_;
  std::string_view appended_;
  bool appended_base64_ = false;
  pugi::xml_node file_;
};

}  // namespace

RawVolume read_vti(std::string content, const VolumeRequest& request) {
  return VtiReader(std::move(content), request).read();
}

}  // namespace birefit::fields
